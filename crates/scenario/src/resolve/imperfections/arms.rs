//! Real arms: how far their joint origins are from the nominal ones.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3, Vector6};
use needlebench_input::{Finding, Location, ModelSource, TomlText, nearest_name};
use needlebench_kinematics::{Chain, JOINT_COUNT, Pose, UrGeometry, UrModel};
use needlebench_robot::arm::data::{ArmData, PopulationData};
use needlebench_robot::{Arm, Calibration, LoadedRobot};

use crate::scenario::{ArmClass, CalibrationBlock, POPULATION};

/// OriginDeviations of an arm's joint origins: per joint, translation (m) and rotation vector (rad) of the true
/// origin in the nominal one.
pub type OriginDeviations = [Vector6<f64>; JOINT_COUNT];

/// Distribution of arms: `mean + sum_k weight_k * modes_k` with independent standard normal
/// weights. It has the mean and the covariance of the arms that it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmPopulation {
    /// Mean deviation per joint: translation (m), rotation vector (rad).
    pub mean: [Vector6<f64>; JOINT_COUNT],
    /// Deviation of each arm from the mean, over the root of the number of arms less one.
    pub modes: Vec<[Vector6<f64>; JOINT_COUNT]>,
}

impl ArmPopulation {
    /// The population with the mean and the covariance of some arms; one arm is that arm itself.
    fn of(arms: &[OriginDeviations], scale: f64) -> Self {
        let count = arms.len() as f64;
        let mean: OriginDeviations = std::array::from_fn(|joint| {
            arms.iter().map(|arm| arm[joint]).sum::<Vector6<f64>>() * (scale / count)
        });
        let modes = if arms.len() < 2 {
            Vec::new()
        } else {
            let share = (count - 1.0).sqrt().recip();
            arms.iter()
                .map(|arm| std::array::from_fn(|i| (arm[i] * scale - mean[i]) * share))
                .collect()
        };
        Self { mean, modes }
    }

    /// The same spread about no deviation at all: what a calibration leaves.
    fn about_none(self) -> Self {
        Self {
            mean: [Vector6::zeros(); JOINT_COUNT],
            ..self
        }
    }

    /// OriginDeviations for the weights of the modes.
    ///
    /// # Panics
    /// If there are not as many weights as modes.
    pub fn deviations(&self, weights: &[f64]) -> [Vector6<f64>; JOINT_COUNT] {
        assert_eq!(weights.len(), self.modes.len());
        let mut deviations = self.mean;
        for (mode, weight) in self.modes.iter().zip(weights) {
            for (deviation, share) in deviations.iter_mut().zip(mode) {
                *deviation += share * *weight;
            }
        }
        deviations
    }

    /// A chain with its joint origins moved by deviations.
    pub fn moved(chain: &Chain, deviations: &[Vector6<f64>; JOINT_COUNT]) -> Chain {
        let mut moved = *chain;
        for (joint, deviation) in moved.joints.iter_mut().zip(deviations) {
            joint.parent_from_joint *= Isometry3::from_parts(
                Translation3::from(deviation.fixed_rows::<3>(0).into_owned()),
                UnitQuaternion::new(deviation.fixed_rows::<3>(3).into_owned()),
            );
        }
        moved
    }
}

/// How a calibrated arm deviates from nominal joint origins.
fn deviations_of(calibration: &Calibration, nominal: &UrGeometry) -> OriginDeviations {
    let nominal = nominal.chain();
    let real = calibration.chain();
    std::array::from_fn(|joint| {
        let from: &Pose = &nominal.joints[joint].parent_from_joint;
        let moved = from.inverse() * real.joints[joint].parent_from_joint;
        let translation: Vector3<f64> = moved.translation.vector;
        let rotation = moved.rotation.scaled_axis();
        Vector6::new(
            translation.x,
            translation.y,
            translation.z,
            rotation.x,
            rotation.y,
            rotation.z,
        )
    })
}

fn read(location: &Location) -> Result<Calibration, Finding> {
    let file = location.display();
    let bytes = location
        .read()
        .map_err(|error| Finding::new(&file, format!("cannot read the calibration: {error}")))?;
    let text = String::from_utf8(bytes)
        .map_err(|error| Finding::new(&file, format!("not UTF-8 text: {error}")))?;
    Calibration::parse(&file, &text)
}

/// The real arms of a block, the files that they are from, and what was assumed.
#[derive(Debug)]
pub(crate) struct RealArms {
    pub population: ArmPopulation,
    pub sources: Vec<ModelSource>,
    pub notes: Vec<String>,
}

/// Key that names the arm or the population.
const KEY: &str = "imperfections.calibration.arm";

/// The real arms of a block, for a robot.
pub(crate) fn resolve_calibration(
    toml: &TomlText<'_>,
    block: &CalibrationBlock,
    robot: &LoadedRobot,
    folder: &Path,
) -> Result<RealArms, Finding> {
    let (arms, notes) = if block.arm == POPULATION {
        population(toml, robot)?
    } else {
        let (arm, notes) = one_arm(toml, &block.arm, robot, folder)?;
        (vec![arm], notes)
    };
    let (deviations, sources): (Vec<_>, Vec<_>) = arms.into_iter().unzip();
    Ok(RealArms {
        population: match block.class() {
            ArmClass::NominalKinematics => ArmPopulation::of(&deviations, block.scale),
            ArmClass::FactoryCalibrated | ArmClass::CalibratedHere => {
                ArmPopulation::of(&deviations, block.scale * block.residual).about_none()
            }
        },
        sources,
        notes,
    })
}

/// A real arm's deviations and the file that they are from.
type RealArm = (OriginDeviations, ModelSource);

/// Every arm in the data of the robot's arm.
fn population(
    toml: &TomlText<'_>,
    robot: &LoadedRobot,
) -> Result<(Vec<RealArm>, Vec<String>), Finding> {
    let none = |lack: String| {
        toml.finding(KEY, format!("no arm population to sample from: {lack}"))
            .hint("name a calibration: its path relative to the scenario, or a shipped one")
    };
    let used = robot.description.arm.as_ref();
    let used =
        used.ok_or_else(|| none(format!("no arm data for {}", robot.description.arm_name)))?;
    let data = &used.arm.data;
    let population = data.population.as_ref();
    let population = population.ok_or_else(|| none(used.arm.lack(POPULATION)))?;
    let mut arms = Vec::with_capacity(population.calibrations.len());
    for entry in &population.calibrations {
        let calibration = read(&used.arm.file(&entry.file))?;
        let nominal = match &entry.of {
            Some(of) => of.parse::<UrModel>().expect("checked").geometry(),
            None => data.geometry.lengths(),
        };
        let of = entry.of.as_ref().unwrap_or(&data.name);
        calibration.chain_of(of, &nominal)?;
        arms.push((deviations_of(&calibration, &nominal), calibration.source));
    }
    Ok((arms, vec![note_on_population(data, population)]))
}

/// The number of arms, and of those of another type.
fn note_on_population(data: &ArmData, population: &PopulationData) -> String {
    let mut counts = BTreeMap::new();
    for entry in &population.calibrations {
        *counts.entry(entry.of.as_ref()).or_insert(0_u32) += 1;
    }
    let counts: Vec<String> = counts
        .iter()
        .map(|(of, count)| match of {
            None => format!("{count} {}", data.name),
            Some(of) => format!("{count} {of}, as deviations from nominal"),
        })
        .collect();
    format!(
        "arm population: {} measured calibrations ({})",
        population.calibrations.len(),
        counts.join("; ")
    )
}

/// A calibration by the name of one that ships or by its path.
fn one_arm(
    toml: &TomlText<'_>,
    reference: &str,
    robot: &LoadedRobot,
    folder: &Path,
) -> Result<(RealArm, Vec<String>), Finding> {
    let shipped = named_calibrations(robot);
    let location = match shipped.iter().find(|(name, _)| name == reference) {
        Some((_, location)) => location.clone(),
        None => Location::Disk(folder.join(reference)),
    };
    if let Err(error) = location.read() {
        let finding = toml.finding(KEY, format!("`{reference}`: {error}"));
        let names = shipped.iter().map(|(name, _)| name.as_str());
        let near = nearest_name(reference, names.clone().chain([POPULATION]));
        return Err(finding.hint(near.map_or_else(
            || {
                format!(
                    "`{POPULATION}`, a calibration's path relative to the scenario, or a shipped \
                     arm: {}",
                    names.collect::<Vec<_>>().join(", ")
                )
            },
            |near| format!("did you mean `{near}`?"),
        )));
    }
    let calibration = read(&location)?;
    let own = robot.description.arm.as_ref().map(|used| &used.arm.data);
    let own = own.filter(|data| {
        let lengths = data.geometry.lengths();
        calibration.chain_of(&data.name, &lengths).is_ok()
    });
    let (name, nominal) = if let Some(data) = own {
        (data.name.clone(), data.geometry.lengths())
    } else {
        let (model, _) = calibration.nearest_model();
        (model.name().to_owned(), model.geometry())
    };
    let notes = (name != robot.description.arm_name).then(|| {
        format!(
            "real arm: deviations of a {name} from its nominal lengths ({reference}), applied to \
             those of {}",
            robot.description.arm_name
        )
    });
    let arm = (deviations_of(&calibration, &nominal), calibration.source);
    Ok((arm, notes.into_iter().collect()))
}

/// Every calibration in the data of the robot's arm and of the shipped ones, by its file's name.
fn named_calibrations(robot: &LoadedRobot) -> Vec<(String, Location)> {
    let mut found = Vec::new();
    if let Some(used) = &robot.description.arm {
        used.arm.add_calibrations(&mut found);
    }
    for arm in Arm::shipped() {
        arm.add_calibrations(&mut found);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped() -> Vec<OriginDeviations> {
        let robot = crate::load_robot(&crate::Overrides::default()).unwrap();
        let toml = TomlText::without_text("test");
        let (arms, _) = population(&toml, &robot).unwrap();
        arms.into_iter().map(|(deviations, _)| deviations).collect()
    }

    /// Largest deviations of the nine files, read and composed by NumPy (`tests/validation/budget`): m and rad, to
    /// the digits that are given.
    const LARGEST: [(f64, f64); 2] = [(0.90756e-3, 0.5e-8), (6.77514e-3, 0.5e-8)];

    #[test]
    fn nine_arms_deviate_by_what_another_reader_of_their_files_has() {
        let arms = shipped();
        assert_eq!(arms.len(), 9);
        let largest = |rows: usize| {
            arms.iter()
                .flatten()
                .map(|each| each.fixed_rows::<3>(rows).norm())
                .fold(0.0, f64::max)
        };
        for (rows, (expected, digits)) in [0, 3].into_iter().zip(LARGEST) {
            let found = largest(rows);
            assert!((found - expected).abs() <= digits, "{found}");
        }
    }

    #[test]
    fn the_population_has_the_covariance_of_its_arms() {
        let arms = shipped();
        let population = ArmPopulation::of(&arms, 1.0);
        let count = arms.len() as f64;
        for joint in 0..JOINT_COUNT {
            let mean = arms.iter().map(|arm| arm[joint]).sum::<Vector6<f64>>() / count;
            let spread =
                |deviation: Vector6<f64>| (deviation - mean) * (deviation - mean).transpose();
            let sample: nalgebra::Matrix6<f64> = arms
                .iter()
                .map(|arm| spread(arm[joint]))
                .sum::<nalgebra::Matrix6<f64>>()
                / (count - 1.0);
            let ours: nalgebra::Matrix6<f64> = population
                .modes
                .iter()
                .map(|mode| mode[joint] * mode[joint].transpose())
                .sum();
            assert!((ours - sample).amax() <= 1e-18, "{joint}");
        }
    }

    /// Rounding of the composition of poses of half a metre.
    const ROUNDING_M: f64 = 1e-15;

    #[test]
    fn an_arm_moved_by_its_own_deviations_is_the_calibrated_one() {
        let robot = crate::load_robot(&crate::Overrides::default()).unwrap();
        let shipped = named_calibrations(&robot);
        let (_, location) = shipped.iter().find(|(name, _)| name == "ur3-2").unwrap();
        let calibration = read(location).unwrap();
        let deviations = deviations_of(&calibration, &UrGeometry::UR3);
        let population = ArmPopulation::of(&[deviations], 1.0);
        let moved = ArmPopulation::moved(&UrGeometry::UR3.chain(), &population.deviations(&[]));
        for (ours, theirs) in moved.joints.iter().zip(&calibration.chain().joints) {
            let off =
                ours.parent_from_joint.to_homogeneous() - theirs.parent_from_joint.to_homogeneous();
            assert!(off.amax() <= ROUNDING_M, "{off}");
        }
    }
}
