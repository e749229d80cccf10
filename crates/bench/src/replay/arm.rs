//! The arm that is replayed: the log's load, identified rotors, and friction that the controller makes up
//! for.

use nalgebra::{Matrix3, Vector3};
use needlebench_cell::{BodyKind, Cell, NeedleCorridor, Tool};
use needlebench_engine::{Actuation, JointFriction, Servo, ServoGains};
use needlebench_kinematics::{Body, JOINT_COUNT, JOINT_LABELS, Joints};
use needlebench_recorded::{Identification, Load, RecordedRun};
use needlebench_scenario::ResolvedScenario;
use needlebench_uncertainty::servo_of;

/// A rotor of less than this share of the known one is none.
const LEAST_ROTOR: f64 = 0.05;

/// Largest ratio of [`Servo::stability_ratio`] of a joint by its rotor alone; stable below 1.
const STABLE: f64 = 0.8;

/// Stands for the needle's corridor, which a replay does not measure, m.
const NO_CORRIDOR_M: f64 = 1e-3;

/// Arms, one per load of the log, and their drives.
pub(super) struct ReplayedArm {
    /// The cells, by load.
    pub cells: Vec<Cell>,
    /// The servos, by load.
    pub servos: Vec<Servo>,
    pub actuation: Actuation,
    /// Torque per current, N m/A; none where nothing is known.
    pub torque_constants: [Option<f64>; JOINT_COUNT],
    /// How it was set up.
    pub words: Vec<String>,
}

impl ReplayedArm {
    pub fn new(
        run: &RecordedRun,
        resolved: &ResolvedScenario,
        identification: &Identification,
    ) -> Self {
        let mut words = Vec::new();
        let rotors = rotors(resolved, identification, &mut words);
        let loads: Vec<Option<Load>> = if run.loads.is_empty() {
            words.push("load: the scenario's tool, as the log has no payload".to_owned());
            vec![None]
        } else {
            let kg: Vec<String> = run
                .loads
                .iter()
                .map(|(_, load)| format!("{} kg", load.mass_kg))
                .collect();
            words.push(format!("load: from the log, {}", kg.join(", ")));
            run.loads.iter().map(|(_, load)| Some(*load)).collect()
        };
        let cells: Vec<Cell> = loads
            .iter()
            .map(|load| cell(resolved, *load, rotors))
            .collect();
        let mut usual = servo_of(resolved);
        let timestep_s = resolved.scenario.engines.timestep_ms * 1e-3;
        softened(&mut usual.gains, &rotors, timestep_s, &mut words);
        let believed = believed_gravity(resolved, identification, &mut words);
        let as_points = identification
            .controller
            .as_ref()
            .is_some_and(|controller| !controller.has_tensors);
        if as_points {
            words.push("feed-forward: links as point masses, as in the controller".to_owned());
        }
        let servos = cells
            .iter()
            .map(|cell| {
                let mut dynamics = cell.dynamics_under(&believed);
                if as_points {
                    let mut points = cell.clone();
                    for body in &mut points.robot.bodies {
                        body.inertia_kgm2 = Matrix3::zeros();
                    }
                    dynamics = points.dynamics_under(&believed);
                }
                Servo {
                    dynamics,
                    gains: usual.gains,
                    effort_limit_nm: usual.effort_limit_nm,
                }
            })
            .collect();
        let friction = friction(resolved, identification, &mut words);
        let data = resolved
            .robot_description
            .arm
            .as_ref()
            .map(|used| &used.arm.data);
        let of_data = data.and_then(|data| data.motors.as_ref());
        let of_log = identification.current.as_ref();
        Self {
            cells,
            servos,
            actuation: Actuation {
                friction,
                ..Actuation::default()
            },
            torque_constants: std::array::from_fn(|joint| {
                of_log
                    .and_then(|law| law.joints[joint].torque_constant_nm_a.known())
                    .or(of_data.map(|motors| motors.torque_constant_nm_a[joint]))
            }),
            words,
        }
    }
}

/// Gravity that the controller counts with, world axes, m/s^2: as identified, as the scenario has it, or as
/// the arm's data have it.
fn believed_gravity(
    resolved: &ResolvedScenario,
    identification: &Identification,
    words: &mut Vec<String>,
) -> Vector3<f64> {
    let down = -Vector3::z();
    let controller = identification.controller.as_ref();
    if let Some(found) = controller.and_then(|fit| fit.gravity_m_s2.known()) {
        words.push(format!(
            "feed-forward: gravity {found:.3} m/s^2, identified from this log"
        ));
        return down * found;
    }
    let data = resolved
        .robot_description
        .arm
        .as_ref()
        .map(|used| &used.arm.data);
    let of_data = data.and_then(|data| data.gravity.as_ref());
    match (resolved.scenario.controller.gravity_m_s2, of_data) {
        (None, Some(of_data)) => {
            words.push(format!(
                "feed-forward: gravity {} m/s^2, the arm's data",
                of_data.believed_m_s2
            ));
            down * of_data.believed_m_s2
        }
        _ => resolved.gravity.believed(),
    }
}

/// Gains of joints whose rotors are too light for them at this time step, scaled down.
fn softened(gains: &mut ServoGains, rotors: &Joints, timestep_s: f64, words: &mut Vec<String>) {
    let mut soft = Vec::new();
    for (joint, rotor) in rotors.iter().enumerate() {
        let (kp, kd) = (gains.kp_nm_per_rad[joint], gains.kd_nms_per_rad[joint]);
        let ratio = (2.0 * kd * timestep_s + kp * timestep_s.powi(2)) / (4.0 * rotor);
        if ratio > STABLE {
            gains.kp_nm_per_rad[joint] *= STABLE / ratio;
            gains.kd_nms_per_rad[joint] *= STABLE / ratio;
            soft.push(format!(
                "{} times {:.2}",
                JOINT_LABELS[joint],
                STABLE / ratio
            ));
        }
    }
    if !soft.is_empty() {
        words.push(format!(
            "servo gains are reduced where rotor inertia is too small for them at steps of {} ms: \
             {}",
            timestep_s * 1e3,
            soft.join(", ")
        ));
    }
}

/// Rotors as identified, else as they are known.
fn rotors(
    resolved: &ResolvedScenario,
    identification: &Identification,
    words: &mut Vec<String>,
) -> Joints {
    let known = resolved.cell.armature_kgm2;
    let controller = identification.controller.as_ref();
    let measured = identification.measured.as_ref();
    let mut identified = 0;
    let mut senseless = Vec::new();
    let rotors = Joints::from_fn(|joint, _| {
        let of_controller = controller.and_then(|fit| fit.rotor_inertia_kgm2[joint].known());
        let found =
            of_controller.or(measured.and_then(|fit| fit.rotor_inertia_kgm2[joint].known()));
        if found.is_some_and(|found| found < LEAST_ROTOR * known[joint]) {
            senseless.push(JOINT_LABELS[joint]);
            return known[joint];
        }
        identified += usize::from(found.is_some());
        found.unwrap_or(known[joint])
    });
    if !senseless.is_empty() {
        words.push(format!(
            "rotor inertia identified at {} is not positive or negligible, not used; check that \
             the torques of the log belong to its motion",
            senseless.join(", ")
        ));
    }
    words.push(match identified {
        JOINT_COUNT => "rotor inertia: identified from this log".to_owned(),
        0 => format!("rotor inertia: {}", resolved.servo.armature_source),
        count => format!(
            "rotor inertia: identified from this log at {count} joints, else {}",
            resolved.servo.armature_source
        ),
    });
    rotors
}

/// Friction as the arm's data have it, sliding and viscous as identified; none without data.
fn friction(
    resolved: &ResolvedScenario,
    identification: &Identification,
    words: &mut Vec<String>,
) -> Option<JointFriction> {
    let data = resolved
        .robot_description
        .arm
        .as_ref()
        .map(|used| &used.arm.data);
    let Some(known) = data.and_then(|data| data.friction.as_ref()) else {
        words.push("friction: none, as the arm's data have none".to_owned());
        return None;
    };
    let law = identification.current.as_ref();
    let pick = |of_law: &dyn Fn(usize) -> Option<f64>, known: [f64; JOINT_COUNT]| {
        Joints::from_fn(|joint, _| of_law(joint).map_or(known[joint], |found| found.max(0.0)))
    };
    let coulomb_nm = pick(
        &|joint| law?.joints[joint].coulomb_nm.known(),
        known.coulomb_nm,
    );
    let viscous = pick(
        &|joint| law?.joints[joint].viscous_nms_rad.known(),
        known.viscous_nms_rad,
    );
    words.push(format!(
        "friction: {}, fully compensated by the controller while a joint moves",
        if law.is_some() {
            "Coulomb and viscous, identified from this log where identifiable, otherwise the arm's \
             data"
        } else {
            "the arm's data"
        }
    ));
    // Break-away keeps its ratio to sliding.
    let stiction_nm = Joints::from_fn(|joint, _| {
        let ratio = known.stiction_nm[joint] / known.coulomb_nm[joint].max(f64::MIN_POSITIVE);
        coulomb_nm[joint] * ratio.max(1.0)
    });
    Some(JointFriction {
        coulomb_nm,
        stiction_nm,
        stribeck_rad_s: Joints::from(known.stribeck_deg_s.map(f64::to_radians)),
        viscous_nms_per_rad: viscous,
        bristle_stiffness_nm_per_rad: Joints::from(known.bristle_stiffness_nm_rad),
        bristle_damping_nms_per_rad: Joints::from(known.bristle_damping_nms_rad),
        compensation: 1.0,
        true_over_nominal: Joints::repeat(1.0),
    })
}

/// The cell with a load in place of its tool, or with its tool if nothing is said of a load.
fn cell(resolved: &ResolvedScenario, load: Option<Load>, rotors: Joints) -> Cell {
    let cell = &resolved.cell;
    let surroundings = cell.bodies.iter().filter(|body| {
        !matches!(
            body.kind,
            BodyKind::Base
                | BodyKind::Link
                | BodyKind::Tool
                | BodyKind::GuideTube
                | BodyKind::NeedleCorridor
        )
    });
    let tool = match load {
        None => cell.tool.clone(),
        Some(load) => Tool {
            name: "load".to_owned(),
            solids: Vec::new(),
            guide_solids: Vec::new(),
            visuals: Vec::new(),
            body: Body {
                mass_kg: load.mass_kg,
                com_m: Vector3::from(load.centre_m),
                inertia_kgm2: {
                    let [xx, yy, zz, xy, xz, yz] = load.inertia_kgm2;
                    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
                },
            },
            ..cell.tool.clone()
        },
    };
    Cell::assemble(
        cell.robot.clone(),
        tool,
        NeedleCorridor {
            radius_m: NO_CORRIDOR_M,
            length_m: NO_CORRIDOR_M,
            hand_cone_half_angle_rad: 0.0,
        },
        surroundings.cloned().collect(),
        rotors,
        cell.gravity_m_s2,
    )
}
