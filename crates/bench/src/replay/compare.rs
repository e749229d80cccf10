//! What an engine did beside what the real arm did.

use nalgebra::{Point3, Vector3};
use needlebench_kinematics::{JOINT_COUNT, Joints};
use needlebench_recorded::{LogKind, RecordedRun, Tracking, tracking};
use serde::Serialize;

use super::arm::ReplayedArm;

/// Speed above which a joint moves, rad/s: a joint at rest sticks, and its current says nothing.
const MOVING_RAD_S: f64 = 0.05;

/// What an engine did at the rows of a log; not a number where it was not compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Joint angles less set-points, rad.
    pub error: Vec<Joints>,
    /// Torques that reach the links, N m.
    pub link_nm: Vec<Joints>,
    /// Torques of the motors, friction included, N m.
    pub motor_nm: Vec<Joints>,
}

impl Course {
    /// Nothing yet.
    pub(super) fn none(rows: usize) -> Self {
        let none = Joints::repeat(f64::NAN);
        Self {
            error: vec![none; rows],
            link_nm: vec![none; rows],
            motor_nm: vec![none; rows],
        }
    }
}

/// How an engine follows the set-points of a log, and how far it is from the real arm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EngineReplay {
    /// Rows that were compared.
    pub rows: usize,
    /// How it follows the set-points.
    pub tracking: Tracking,
    /// Its joints beside the real ones; none of a simulator's log.
    pub against_real: Option<AgainstReal>,
    /// Root mean square difference of the torques that reach its links from `target_moment`, which has no
    /// friction either, N m; none without it.
    pub torque_rms_nm: Option<[f64; JOINT_COUNT]>,
    /// Root mean square difference of its currents from the measured ones while the joint moves, A; none
    /// where torque constants are not known, currents not measured, or the joint never moves.
    pub current_rms_a: [Option<f64>; JOINT_COUNT],
}

/// Distances of a simulated arm from the real one at the same times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AgainstReal {
    /// Root mean square of each joint, rad.
    pub rms_rad: [f64; JOINT_COUNT],
    /// Largest of each joint, rad.
    pub largest_rad: [f64; JOINT_COUNT],
    /// Root mean square of the tip, by the joint angles, m.
    pub tip_rms_m: f64,
    /// Largest of the tip, m.
    pub tip_largest_m: f64,
}

pub(super) fn compared(
    run: &RecordedRun,
    arm: &ReplayedArm,
    course: &Course,
    tip_in_flange_m: &Vector3<f64>,
) -> EngineReplay {
    let target = run
        .target
        .as_ref()
        .expect("only a log with set-points is replayed");
    let rows: Vec<usize> = (0..run.len())
        .filter(|row| course.error[*row].sum().is_finite())
        .collect();
    let of =
        |values: &dyn Fn(usize) -> Joints| rows.iter().map(|row| values(*row)).collect::<Vec<_>>();
    let chain = &arm.cells[0].robot.chain;
    let reference = of(&|row| target[row].position);
    let simulated = of(&|row| target[row].position + course.error[row]);
    let speed = of(&|row| target[row].velocity);
    let tip = |q: &Joints| chain.base_link_from_flange(q) * Point3::from(*tip_in_flange_m);
    let count = rows.len().max(1) as f64;
    let against_real = (run.kind == LogKind::Arm).then(|| {
        let (mut square, mut largest) = (Joints::zeros(), Joints::zeros());
        let (mut tip_square, mut tip_largest) = (0.0, 0.0_f64);
        for (simulated, row) in simulated.iter().zip(&rows) {
            let off = simulated - run.actual_q[*row];
            square += off.component_mul(&off);
            largest = largest.sup(&off.abs());
            let off_tip_m = (tip(simulated) - tip(&run.actual_q[*row])).norm();
            tip_square += off_tip_m * off_tip_m;
            tip_largest = tip_largest.max(off_tip_m);
        }
        AgainstReal {
            rms_rad: square.map(|square| (square / count).sqrt()).into(),
            largest_rad: largest.into(),
            tip_rms_m: (tip_square / count).sqrt(),
            tip_largest_m: tip_largest,
        }
    });
    EngineReplay {
        rows: rows.len(),
        tracking: tracking(chain, tip_in_flange_m, &reference, &speed, &simulated),
        against_real,
        torque_rms_nm: torque_rms(run, course, &rows),
        current_rms_a: current_rms(run, arm, course, &rows),
    }
}

fn torque_rms(run: &RecordedRun, course: &Course, rows: &[usize]) -> Option<[f64; JOINT_COUNT]> {
    let moment = run.target_moment_nm.as_ref()?;
    Some(std::array::from_fn(|joint| {
        let off = rows.iter().filter_map(|row| {
            let off = course.link_nm[*row][joint] - moment[*row][joint];
            off.is_finite().then_some(off)
        });
        rms(off).unwrap_or(f64::NAN)
    }))
}

fn current_rms(
    run: &RecordedRun,
    arm: &ReplayedArm,
    course: &Course,
    rows: &[usize],
) -> [Option<f64>; JOINT_COUNT] {
    std::array::from_fn(|joint| {
        let (current, target) = (run.actual_current_a.as_ref()?, run.target.as_ref()?);
        let constant = arm.torque_constants[joint]?;
        rms(rows.iter().filter_map(|row| {
            let moves = target[*row].velocity[joint].abs() > MOVING_RAD_S;
            let off = course.motor_nm[*row][joint] / constant - current[*row][joint];
            (moves && off.is_finite()).then_some(off)
        }))
    })
}

fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (square, count) = values.fold((0.0, 0.0), |(square, count), value| {
        (square + value * value, count + 1.0)
    });
    (count > 0.0).then(|| f64::sqrt(square / count))
}
