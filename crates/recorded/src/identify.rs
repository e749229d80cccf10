//! Loads, rotor inertia and friction of an arm, from the torques and currents of a recorded run.
//!
//! Two fits of the same equation, each linear in what is sought but for gravity:
//!
//! ```text
//! torque = links(q, qd, qdd) + load(q, qd, qdd; m, m c) + J qdd  (+ sign(qd) Fc + qd Fv)
//! ```
//!
//! - *the controller's model*: `target_moment`, all rows, without friction. It gives the load that was
//!   set, the rotors' inertia and the gravity that the controller uses. Links count as points
//!   at their centres, or with their tensors: whichever explains the run better, and both are reported.
//! - *the arm*: torques as measured, or measured currents times torque constants, with friction, from
//!   rows in which the joint moves: a joint at rest sticks, and its current says nothing of its torque.
//!
//! Intervals are of 95 %, by leaving out a twentieth of the run at a time. The held-out error is that of
//! every other twentieth from a fit of those between, and the other way round.

mod current;
mod fit;

use std::array::from_fn;

use nalgebra::Vector3;
use needlebench_cell::Robot;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints};
use serde::Serialize;

use crate::derivative::slopes;
pub use crate::regression::Estimate;
use crate::regression::{BLOCKS, estimate, spans};
use crate::run::Effort;
use crate::terms::Arm;
use crate::{Load, RecordedRun};
pub use current::{CurrentLaw, JointDrive};
use fit::{Data, Fit, Model};

/// Speed from which a joint counts as moving, rad/s: three times the one at which break-away has fallen
/// off (1 deg/s).
pub(crate) const MOVING_RAD_S: f64 = 0.05;

/// No UR arm carries more, kg: an estimate beyond is of a run that does not show the load.
const HEAVIEST_KG: f64 = 100.0;

/// Most loads that are identified; rows of further ones do not count.
const MOST_LOADS: usize = 8;

/// Coarsest intervals, to each side, of what counts as identified: the larger of an absolute one and a
/// share of the value.
mod coarsest {
    /// Mass of a load, kg.
    pub const MASS: (f64, f64) = (0.05, 0.05);
    /// Centre of a load, m.
    pub const CENTRE: (f64, f64) = (0.01, 0.1);
    /// Inertia of a rotor, kg m^2.
    pub(crate) const ROTOR: (f64, f64) = (0.005, 0.1);
    /// Gravity, m/s^2.
    pub const GRAVITY: (f64, f64) = (0.02, 0.0);
    /// Sliding friction, N m.
    pub const COULOMB: (f64, f64) = (0.1, 0.2);
    /// Viscous friction, N m s/rad.
    pub const VISCOUS: (f64, f64) = (0.1, 0.3);
}

/// Identification results of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// The controller's model, from `target_moment`.
    pub controller: Option<ControllerFit>,
    /// How currents go with torques.
    pub current: Option<CurrentLaw>,
    /// What the arm does, from torques or currents as measured.
    pub measured: Option<MeasuredFit>,
    /// What could not be identified and why; belongs in every report.
    pub notes: Vec<String>,
}

/// A load of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IdentifiedLoad {
    /// The load that the controller used, from the log.
    pub logged: Option<Load>,
    /// Mass, kg.
    pub mass_kg: Estimate,
    /// Centre in the flange frame, m.
    pub centre_m: [Estimate; 3],
}

/// The controller's model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ControllerFit {
    /// Inertia of the rotors at the joints, kg m^2.
    pub rotor_inertia_kgm2: [Estimate; JOINT_COUNT],
    /// Loads.
    pub loads: Vec<IdentifiedLoad>,
    /// Gravity, m/s^2.
    pub gravity_m_s2: Estimate,
    /// Whether links have inertia about their own centres.
    pub has_tensors: bool,
    /// RMS residual of `target_moment`, N m.
    pub rms_nm: [f64; JOINT_COUNT],
    /// The same of rows that the fit has not seen, N m.
    pub held_out_rms_nm: [f64; JOINT_COUNT],
    /// The same with the links' tensors left out if they are in, and the other way round, N m.
    pub rms_otherwise_nm: [f64; JOINT_COUNT],
    /// The same with the arm's own data: its rotors, and the load and gravity as given, N m; none
    /// without rotors in the data.
    pub rms_by_data_nm: Option<[f64; JOINT_COUNT]>,
}

/// The arm's parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredFit {
    /// Where torques are from, in words.
    pub source: String,
    /// Inertia of the rotors at the joints, kg m^2.
    pub rotor_inertia_kgm2: [Estimate; JOINT_COUNT],
    /// Sliding friction, N m.
    pub coulomb_nm: [Estimate; JOINT_COUNT],
    /// Viscous friction, N m s/rad.
    pub viscous_nms_rad: [Estimate; JOINT_COUNT],
    /// Loads.
    pub loads: Vec<IdentifiedLoad>,
    /// Gravity that was reckoned with, m/s^2.
    pub gravity_m_s2: f64,
    /// Whether links have inertia about their own centres.
    pub has_tensors: bool,
    /// RMS residual, N m.
    pub rms_nm: [f64; JOINT_COUNT],
    /// The same of rows that the fit has not seen, N m.
    pub held_out_rms_nm: [f64; JOINT_COUNT],
}

/// What is known of the arm beside its log.
#[derive(Debug, Clone, Copy)]
pub struct KnownArm<'a> {
    /// Links, masses and joints; its place in the world says where down is.
    pub robot: &'a Robot,
    /// Inertia of the rotors in its data, kg m^2.
    pub rotor_inertia_kgm2: Option<[f64; JOINT_COUNT]>,
    /// Torque constants in its data, N m/A.
    pub torque_constant_nm_a: Option<[f64; JOINT_COUNT]>,
    /// Gravity where it stands, m/s^2.
    pub gravity_m_s2: f64,
}

/// Identifies loads, rotors, friction and torque constants.
pub fn identify(run: &RecordedRun, known: &KnownArm<'_>) -> Identification {
    let mut notes = Vec::new();
    let robot = known.robot;
    let arm = Arm {
        chain: robot.chain,
        bodies: robot.bodies,
        up: robot.world_from_base_link.rotation.inverse() * Vector3::z(),
    };
    let states = states(run, &mut notes);
    let loads = distinct_loads(run, &mut notes);
    let load_of = |row: usize| {
        let logged = run.load_at(row).map(|at| run.loads[at].1);
        loads.iter().position(|load| *load == logged)
    };
    let context = Context {
        run,
        arm: &arm,
        states: &states,
        loads: &loads,
        load_of: &load_of,
    };
    let controller = run
        .target_moment_nm
        .as_ref()
        .map(|torque_nm| controller(&context, torque_nm, known));
    let current = current::law(run, &states);
    let measured = measured(&context, known, current.as_ref(), &mut notes);
    Identification {
        controller,
        current,
        measured,
        notes,
    }
}

struct Context<'a> {
    run: &'a RecordedRun,
    arm: &'a Arm,
    states: &'a [JointState],
    loads: &'a [Option<Load>],
    load_of: &'a dyn Fn(usize) -> Option<usize>,
}

/// Positions, speeds and accelerations: of the set-points, or of what was measured.
fn states<'a>(run: &'a RecordedRun, notes: &mut Vec<String>) -> std::borrow::Cow<'a, [JointState]> {
    if let Some(target) = &run.target {
        return std::borrow::Cow::Borrowed(target);
    }
    let given = run.actual_qd.clone();
    if given.is_none() {
        notes.push("speeds are derivatives of the measured angles".to_owned());
    }
    let qd = given.unwrap_or_else(|| slopes(&run.time_s, &run.actual_q, &run.stretches));
    notes.push("accelerations are derivatives of the measured speeds".to_owned());
    let qdd = slopes(&run.time_s, &qd, &run.stretches);
    let states = run.actual_q.iter().zip(qd).zip(qdd);
    states
        .map(|((position, velocity), acceleration)| JointState {
            position: *position,
            velocity,
            acceleration,
        })
        .collect::<Vec<_>>()
        .into()
}

/// The distinct loads of the log; one unknown load where it has none.
fn distinct_loads(run: &RecordedRun, notes: &mut Vec<String>) -> Vec<Option<Load>> {
    let mut loads: Vec<Option<Load>> = Vec::new();
    for (_, load) in &run.loads {
        if !loads.contains(&Some(*load)) {
            loads.push(Some(*load));
        }
    }
    if loads.len() > MOST_LOADS {
        notes.push(format!(
            "the log has {} loads: only the first {MOST_LOADS} are used",
            loads.len()
        ));
        loads.truncate(MOST_LOADS);
    }
    if loads.is_empty() {
        loads.push(None);
    }
    loads
}

fn controller(context: &Context<'_>, torque_nm: &[Joints], known: &KnownArm<'_>) -> ControllerFit {
    let data = Data::gather(context, &|row| torque_nm[row], &|_, _| true);
    let model = |has_tensors| Model {
        has_tensors,
        has_friction: false,
        gravity_m_s2: None,
    };
    let fits = [false, true].map(|has_tensors| Fit::weighted(&data, model(has_tensors)));
    let [points, tensors] = &fits;
    let has_tensors = tensors.unlikelihood(&data) < points.unlikelihood(&data);
    let (best, other) = if has_tensors {
        (tensors, points)
    } else {
        (points, tensors)
    };
    let without: Vec<Fit> = (0..BLOCKS)
        .map(|block| best.without(&data, block))
        .collect();
    let estimate = |of: &dyn Fn(&Fit) -> Option<f64>| estimate(best, &without, of);
    ControllerFit {
        rotor_inertia_kgm2: from_fn(|joint| {
            estimate(&|fit| fit.rotor(joint))
                .within(coarsest::ROTOR.0, coarsest::ROTOR.1)
                .not_negative()
        }),
        loads: loads(context, best, &without),
        gravity_m_s2: estimate(&|fit| fit.gravity())
            .within(coarsest::GRAVITY.0, coarsest::GRAVITY.1),
        has_tensors,
        rms_nm: best.rms_nm(&data),
        held_out_rms_nm: best.held_out_rms_nm(&data),
        rms_otherwise_nm: other.rms_nm(&data),
        rms_by_data_nm: known
            .rotor_inertia_kgm2
            .map(|rotors| data.rms_by(&rotors, known.gravity_m_s2, context.loads)),
    }
}

fn measured(
    context: &Context<'_>,
    known: &KnownArm<'_>,
    current: Option<&CurrentLaw>,
    notes: &mut Vec<String>,
) -> Option<MeasuredFit> {
    let run = context.run;
    let mut gravity_m_s2 = known.gravity_m_s2;
    let mut usable = [true; JOINT_COUNT];
    let (source, torque_nm): (String, Vec<Joints>) = match (&run.effort_nm, &run.actual_current_a) {
        (Some((torque_nm, meaning)), _) => {
            if *meaning == Effort::Compensated {
                gravity_m_s2 = 0.0;
            }
            let source = match meaning {
                Effort::Torque => "measured torques",
                Effort::Compensated => "measured torques without gravity",
            };
            (source.to_owned(), torque_nm.clone())
        }
        (None, Some(current_a)) => {
            let of_log: [Option<f64>; JOINT_COUNT] =
                from_fn(|joint| current?.joints[joint].torque_constant_nm_a.known());
            let constants: [Option<f64>; JOINT_COUNT] = from_fn(|joint| {
                of_log[joint].or(known.torque_constant_nm_a.map(|constants| constants[joint]))
            });
            usable = constants.map(|constant| constant.is_some());
            if !usable.contains(&true) {
                notes.push(
                    "the arm's torques are not identified: the log has currents, but neither the log \
                     (target_current with target_moment) nor the arm's data has torque constants"
                        .to_owned(),
                );
                return None;
            }
            let of_data =
                (0..JOINT_COUNT).filter(|joint| of_log[*joint].is_none() && usable[*joint]);
            let of_data: Vec<&str> = of_data
                .map(|joint| needlebench_kinematics::JOINT_LABELS[joint])
                .collect();
            let mut source = "measured currents times the torque constants of this log".to_owned();
            if !of_data.is_empty() {
                source = format!(
                    "{source}, for {} those of the arm's data",
                    of_data.join(", ")
                );
            }
            let constants = Joints::from(constants.map(|constant| constant.unwrap_or(0.0)));
            let torque_nm = current_a
                .iter()
                .map(|a| a.component_mul(&constants))
                .collect();
            (source, torque_nm)
        }
        (None, None) => return None,
    };
    let states = context.states;
    let counts = |row: usize, joint: usize| {
        usable[joint] && states[row].velocity[joint].abs() > MOVING_RAD_S
    };
    let data = Data::gather(context, &|row| torque_nm[row], &counts);
    let model = |has_tensors| Model {
        has_tensors,
        has_friction: true,
        gravity_m_s2: Some(gravity_m_s2),
    };
    let fits = [false, true].map(|has_tensors| Fit::weighted(&data, model(has_tensors)));
    let has_tensors = fits[1].unlikelihood(&data) < fits[0].unlikelihood(&data);
    let best = &fits[usize::from(has_tensors)];
    let without: Vec<Fit> = (0..BLOCKS)
        .map(|block| best.without(&data, block))
        .collect();
    let estimate = |of: &dyn Fn(&Fit) -> Option<f64>| estimate(best, &without, of);
    Some(MeasuredFit {
        source,
        rotor_inertia_kgm2: from_fn(|joint| {
            estimate(&|fit| fit.rotor(joint))
                .within(coarsest::ROTOR.0, coarsest::ROTOR.1)
                .not_negative()
        }),
        coulomb_nm: from_fn(|joint| {
            estimate(&|fit| fit.coulomb(joint))
                .within(coarsest::COULOMB.0, coarsest::COULOMB.1)
                .not_negative()
        }),
        viscous_nms_rad: from_fn(|joint| {
            estimate(&|fit| fit.viscous(joint))
                .within(coarsest::VISCOUS.0, coarsest::VISCOUS.1)
                .not_negative()
        }),
        loads: loads(context, best, &without),
        gravity_m_s2,
        has_tensors,
        rms_nm: best.rms_nm(&data),
        held_out_rms_nm: best.held_out_rms_nm(&data),
    })
}

fn loads(context: &Context<'_>, fit: &Fit, without: &[Fit]) -> Vec<IdentifiedLoad> {
    let each = context.loads.iter().enumerate();
    each.map(|(at, logged)| {
        let shown = is_turned(context, at);
        let of_load = |of: &dyn Fn(&Fit) -> Option<f64>| {
            estimate(fit, without, &|fit| of(fit).filter(|_| shown))
        };
        IdentifiedLoad {
            logged: *logged,
            mass_kg: of_load(&|fit| fit.mass(at).filter(|mass_kg| *mass_kg < HEAVIEST_KG))
                .within(coarsest::MASS.0, coarsest::MASS.1)
                .not_negative(),
            centre_m: from_fn(|axis| {
                of_load(&|fit| fit.centre(at, axis)).within(coarsest::CENTRE.0, coarsest::CENTRE.1)
            }),
        }
    })
    .collect()
}

/// Whether the rows of a load are of more than one posture: the gravity torques of one hold three numbers of a load,
/// its weight and where that acts across the plumb line, and it has four.
fn is_turned(context: &Context<'_>, load: usize) -> bool {
    const TURNED_RAD: f64 = 0.02;
    let rows = (0..context.run.len()).filter(|row| (context.load_of)(*row) == Some(load));
    let mut postures = rows.map(|row| context.states[row].position);
    let first = postures.next();
    first.is_some_and(|first| postures.any(|other| (other - first).amax() > TURNED_RAD))
}

/// Block of each row.
pub(crate) fn blocks(count: usize) -> impl Iterator<Item = usize> {
    spans(count)
        .into_iter()
        .enumerate()
        .flat_map(|(block, rows)| rows.map(move |_| block))
}
