//! Real arms: how far their joint origins are from the nominal ones.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3, Vector6};
use needlebench_kinematics::{Chain, JOINT_COUNT, Pose};

use super::CalibrationBlock;
use crate::calibration::Calibration;
use crate::files::Location;
use crate::toml_text::TomlText;
use crate::{Finding, ModelSource, nearest_name};

/// Folder of the shipped calibrations.
const FOLDER: &str = "ur3/calibrations";

/// One arm: per joint, translation (m) and rotation vector (rad) of the true joint origin in the
/// nominal one.
type Deviations = [Vector6<f64>; JOINT_COUNT];

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
    fn of(arms: &[Deviations], scale: f64) -> Self {
        let count = arms.len() as f64;
        let mean: Deviations = std::array::from_fn(|joint| {
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

    /// Deviations for the weights of the modes.
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

/// How a calibrated arm deviates from the nominal model that it is nearest to.
fn deviations_of(calibration: &Calibration) -> Deviations {
    let (model, _) = calibration.nearest_model();
    let nominal = model.geometry().chain();
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

pub(crate) fn resolve_calibration(
    toml: &TomlText<'_>,
    block: &CalibrationBlock,
    folder: &Path,
    sources: &mut Vec<ModelSource>,
) -> Result<ArmPopulation, Finding> {
    const KEY: &str = "imperfections.calibration.arm";
    let shipped = Location::builtin_names(FOLDER, "yaml");
    let locations: Vec<Location> = if block.arm == "population" {
        let all = shipped.iter();
        all.map(|name| Location::of_model(name, FOLDER, "yaml", folder))
            .collect()
    } else {
        let location = Location::of_model(&block.arm, FOLDER, "yaml", folder);
        if let Err(error) = location.read() {
            let finding = toml.finding(KEY, format!("`{}`: {error}", block.arm));
            let names = shipped.iter().map(String::as_str);
            let near = nearest_name(&block.arm, names.chain(["population"]));
            return Err(finding.hint(near.map_or_else(
                || {
                    format!(
                        "`population`, a calibration's path relative to the scenario, or a \
                         shipped arm: {}",
                        shipped.join(", ")
                    )
                },
                |near| format!("did you mean `{near}`?"),
            )));
        }
        vec![location]
    };
    let mut arms = Vec::new();
    for location in &locations {
        let calibration = read(location)?;
        arms.push(deviations_of(&calibration));
        sources.push(calibration.source);
    }
    Ok(ArmPopulation::of(&arms, block.scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_kinematics::UrGeometry;

    fn shipped() -> Vec<Deviations> {
        Location::builtin_names(FOLDER, "yaml")
            .iter()
            .map(|name| Location::of_model(name, FOLDER, "yaml", Path::new("")))
            .map(|location| deviations_of(&read(&location).unwrap()))
            .collect()
    }

    /// What the makers' calibrations are known to stay within: 0.91 mm and 6.8 mrad.
    #[test]
    fn nine_arms_deviate_by_less_than_a_millimetre_and_seven_milliradians() {
        let arms = shipped();
        assert_eq!(arms.len(), 9);
        let largest = |rows: usize| {
            arms.iter()
                .flatten()
                .map(|each| each.fixed_rows::<3>(rows).norm())
                .fold(0.0, f64::max)
        };
        assert!((0.5e-3..1e-3).contains(&largest(0)), "{}", largest(0));
        assert!((5e-3..7e-3).contains(&largest(3)), "{}", largest(3));
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
        let location = Location::of_model("ur3-2", FOLDER, "yaml", Path::new(""));
        let calibration = read(&location).unwrap();
        let population = ArmPopulation::of(&[deviations_of(&calibration)], 1.0);
        let moved = ArmPopulation::moved(&UrGeometry::UR3.chain(), &population.deviations(&[]));
        for (ours, theirs) in moved.joints.iter().zip(&calibration.chain().joints) {
            let off =
                ours.parent_from_joint.to_homogeneous() - theirs.parent_from_joint.to_homogeneous();
            assert!(off.amax() <= ROUNDING_M, "{off}");
        }
    }
}
