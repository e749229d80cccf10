//! What a log says of an arm, as data that scenarios use: `[robot] arm = "my_arm.toml"`.

use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS};
use needlebench_recorded::Estimate;
use needlebench_robot::arm::data::{
    ArmData, FrictionData, GravityData, MotorData, OwnCalibration, RotorData,
};
use needlebench_robot::{Calibration, RobotDescription};

use super::ReplayReport;

/// Decimals of a figure beyond those of its interval.
const FIGURES: i32 = 1;

/// An arm's data and its calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmFiles {
    /// The text of the `arm.toml`.
    pub arm: String,
    /// The text of the calibration, if it predicts what it has not seen.
    pub calibration: Option<String>,
    /// What is of the log, and what of the arm's type.
    pub notes: Vec<String>,
}

/// The data of the arm that a log is of: those of its type, with what the log shows in their place.
///
/// None where the arm has no data to start from. `calibration_file` is the name by which the data call the
/// calibration.
pub fn arm_files(
    report: &ReplayReport,
    robot: &RobotDescription,
    calibration_file: &str,
) -> Option<ArmFiles> {
    let used = robot.arm.as_ref()?;
    let of_type = &used.arm.data;
    let log = &report.log;
    let whence = format!(
        "identified from {} (SHA-256 {}..., {:.1} s)",
        log.source.file,
        &log.source.sha256[..12.min(log.source.sha256.len())],
        log.duration_s
    );
    let mut notes = Vec::new();
    let identification = &report.identification;
    let controller = identification.controller.as_ref();
    let measured = identification.measured.as_ref();
    let law = identification.current.as_ref();
    let mut merge = |name: &str,
                     found: [Option<Estimate>; JOINT_COUNT],
                     known: Option<([f64; JOINT_COUNT], &String)>| {
        let whole = merged(&whence, found, known);
        if let Some((_, source)) = &whole {
            notes.push(format!("{name}: {source}"));
        }
        whole
    };
    let joints = |of: &dyn Fn(usize) -> Option<Estimate>| std::array::from_fn(of);
    let rotors = merge(
        "rotors",
        joints(&|joint| {
            let believed = controller.map(|fit| fit.rotor_inertia_kgm2[joint]);
            let real = measured.map(|fit| fit.rotor_inertia_kgm2[joint]);
            believed.filter(is_known).or(real.filter(is_known))
        }),
        of_type
            .rotors
            .as_ref()
            .map(|each| (each.inertia_kgm2, &each.source)),
    );
    let motors = merge(
        "motors",
        joints(&|joint| {
            law.map(|law| law.joints[joint].torque_constant_nm_a)
                .filter(is_known)
        }),
        of_type
            .motors
            .as_ref()
            .map(|each| (each.torque_constant_nm_a, &each.source)),
    );
    let friction = of_type.friction.as_ref().map(|known| {
        let coulomb = merge(
            "Coulomb friction",
            joints(&|joint| {
                let of_law = law.map(|law| law.joints[joint].coulomb_nm);
                let real = measured.map(|fit| fit.coulomb_nm[joint]);
                of_law.filter(is_known).or(real.filter(is_known))
            }),
            Some((known.coulomb_nm, &known.source)),
        );
        let viscous = merge(
            "viscous friction",
            joints(&|joint| {
                let of_law = law.map(|law| law.joints[joint].viscous_nms_rad);
                let real = measured.map(|fit| fit.viscous_nms_rad[joint]);
                of_law.filter(is_known).or(real.filter(is_known))
            }),
            Some((known.viscous_nms_rad, &known.source)),
        );
        friction(known, coulomb, viscous)
    });
    let calibration = report.calibration.as_ref().filter(|fit| fit.is_worth);
    let population = of_type.population.clone().map(|mut population| {
        for each in &mut population.calibrations {
            each.file = used.arm.file_from_elsewhere(&each.file);
        }
        population
    });
    let mut data = ArmData {
        urdf: used.arm.file_from_elsewhere(&of_type.urdf),
        rotors: rotors
            .map(|(inertia_kgm2, source)| RotorData {
                inertia_kgm2,
                source,
            })
            .or(of_type.rotors.clone()),
        motors: motors
            .map(|(torque_constant_nm_a, source)| MotorData {
                torque_constant_nm_a,
                source,
            })
            .or(of_type.motors.clone()),
        gravity: controller
            .and_then(|fit| Some((fit.gravity_m_s2.known()?, fit.gravity_m_s2.half_width?)))
            .map(|(value, half)| GravityData {
                believed_m_s2: rounded(value, half),
                source: format!("{whence}, 95 %: +-{half:.1e}"),
            })
            .or(of_type.gravity.clone()),
        friction,
        population,
        calibration: calibration.map(|fit| OwnCalibration {
            file: calibration_file.to_owned(),
            source: format!(
                "{whence}: RMS error at held-out poses {:.2e} mm, with nominal lengths {:.3} mm",
                fit.held_out.rms_m * 1e3,
                fit.nominal_held_out.rms_m * 1e3
            ),
        }),
        ..of_type.clone()
    };
    // What is known now is lacking no more.
    for (table, is_there) in [
        ("rotors", data.rotors.is_some()),
        ("motors", data.motors.is_some()),
        ("gravity", data.gravity.is_some()),
        ("calibration", data.calibration.is_some()),
    ] {
        if is_there {
            data.lacks.remove(table);
        }
    }
    let comment = format!(
        "One {}, identified by needlebench replay of {}. Parameters not identifiable from the run \
         are those of its type.",
        of_type.name, log.source.file
    );
    Some(ArmFiles {
        arm: data.to_toml(&comment),
        calibration: calibration.map(|fit| {
            let comment = format!(
                "Joint origins of one {}, fitted to poses of {}\n\
                 (SHA-256 {}). As assumed by its controller, not measured externally.",
                of_type.name, log.source.file, log.source.sha256
            );
            Calibration::written(&fit.chain, &comment)
        }),
        notes,
    })
}

fn is_known(estimate: &Estimate) -> bool {
    estimate.known().is_some()
}

/// Values of the log where it has them, else those that are known, and where they are from.
fn merged(
    whence: &str,
    found: [Option<Estimate>; JOINT_COUNT],
    known: Option<([f64; JOINT_COUNT], &String)>,
) -> Option<([f64; JOINT_COUNT], String)> {
    if found.iter().all(Option::is_none) {
        return None;
    }
    let mut values = [0.0; JOINT_COUNT];
    let (mut of_log, mut of_type) = (Vec::new(), Vec::new());
    for joint in 0..JOINT_COUNT {
        values[joint] = match (found[joint], known) {
            (Some(estimate), _) => {
                let half = estimate.half_width.unwrap_or(0.0);
                of_log.push(format!("{} +-{half:.1e}", JOINT_LABELS[joint]));
                rounded(estimate.value?, half)
            }
            (None, Some((values, _))) => {
                of_type.push(JOINT_LABELS[joint]);
                values[joint]
            }
            (None, None) => return None,
        };
    }
    let mut source = format!("{whence}, 95 %: {}", of_log.join(", "));
    if let (false, Some((_, known))) = (of_type.is_empty(), known) {
        source = format!(
            "{source}; {}, not identifiable from the run: {known}",
            of_type.join(", ")
        );
    }
    Some((values, source))
}

/// A value with one digit more than its interval has.
fn rounded(value: f64, half_width: f64) -> f64 {
    if half_width <= 0.0 || !half_width.is_finite() {
        return value;
    }
    #[expect(clippy::cast_possible_truncation, reason = "exponents of doubles")]
    let places = FIGURES - libm::log10(half_width).floor() as i32;
    if !(0..=12).contains(&places) {
        return value;
    }
    let scale = 10_f64.powi(places);
    (value * scale).round() / scale
}

fn friction(
    known: &FrictionData,
    coulomb: Option<([f64; JOINT_COUNT], String)>,
    viscous: Option<([f64; JOINT_COUNT], String)>,
) -> FrictionData {
    let mut source = Vec::new();
    let mut friction = known.clone();
    if let Some((values, of)) = coulomb {
        // Break-away keeps its ratio to sliding.
        for (joint, value) in values.iter().enumerate() {
            let ratio = known.stiction_nm[joint] / known.coulomb_nm[joint].max(f64::MIN_POSITIVE);
            friction.stiction_nm[joint] = rounded(value * ratio.max(1.0), 0.01 * value);
            friction.stiction_nm[joint] = friction.stiction_nm[joint].max(*value);
        }
        friction.coulomb_nm = values;
        source.push(format!("Coulomb {of}"));
    }
    if let Some((values, of)) = viscous {
        friction.viscous_nms_rad = values.map(|value| value.max(0.0));
        source.push(format!("viscous {of}"));
    }
    if !source.is_empty() {
        source.push(format!("others: {}", known.source));
        friction.source = source.join("; ");
    }
    friction
}
