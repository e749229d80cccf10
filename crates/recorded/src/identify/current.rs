//! How currents go with torques: `current = (moment + Fc sign(qd) + Fv qd) / k`.

use std::array::from_fn;

use nalgebra::{DMatrix, DVector};
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints};
use serde::Serialize;

use super::{MOVING_RAD_S, coarsest};
use crate::RecordedRun;
use crate::regression::{BLOCKS, Estimate, Solution, estimate, solve, spans};

/// Coarsest interval of a torque constant, as a share of it.
const CONSTANT: f64 = 0.05;

/// Numbers per row: current, torque, direction, speed.
const TERMS: usize = 4;

/// The law of currents of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurrentLaw {
    /// Which current it is of: `target_current`, or `actual_current` where the log has no other.
    pub of: &'static str,
    /// One per joint.
    pub joints: [JointDrive; JOINT_COUNT],
    /// Root mean square of what the law leaves of measured currents, A; none without them.
    pub actual_rms_a: Option<[f64; JOINT_COUNT]>,
}

/// The drive of a joint, as its currents have it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointDrive {
    /// Torque per current, N m/A.
    pub torque_constant_nm_a: Estimate,
    /// Sliding friction that the controller makes up for, N m.
    pub coulomb_nm: Estimate,
    /// Viscous friction that it makes up for, N m s/rad.
    pub viscous_nms_rad: Estimate,
    /// Root mean square of what the law leaves, A.
    pub rms_a: f64,
    /// The same of rows that the fit has not seen, A.
    pub held_out_rms_a: f64,
}

/// The law of a run's currents; none where it has no currents or no torques of the controller.
pub(super) fn law(run: &RecordedRun, states: &[JointState]) -> Option<CurrentLaw> {
    let moment = run.target_moment_nm.as_ref()?;
    let (of, current) = match (&run.target_current_a, &run.actual_current_a) {
        (Some(target), _) => ("target_current", target),
        (None, Some(actual)) => ("actual_current", actual),
        (None, None) => return None,
    };
    let at_rest_counts = of == "target_current";
    let data = Data::gather(current, moment, states, at_rest_counts);
    let joints = from_fn(|joint| data.drive(joint));
    let actual_rms_a = run.actual_current_a.as_ref().map(|actual| {
        let actual = Data::gather(actual, moment, states, false);
        from_fn(|joint| {
            let fitted = data.fit(joint, |_| true);
            let (square, rows) = actual.left(joint, &fitted, |_| true);
            (square / rows.max(1.0)).sqrt()
        })
    });
    Some(CurrentLaw {
        of,
        joints,
        actual_rms_a,
    })
}

type Sums = [[f64; TERMS]; TERMS];

struct Data {
    sums: Vec<[(Sums, f64); JOINT_COUNT]>,
}

impl Data {
    /// Rows at rest count where currents are the controller's own: a real joint sticks.
    fn gather(
        current_a: &[Joints],
        moment_nm: &[Joints],
        states: &[JointState],
        at_rest_counts: bool,
    ) -> Self {
        let mut sums = vec![[([[0.0; TERMS]; TERMS], 0.0); JOINT_COUNT]; BLOCKS];
        for (block, rows) in spans(states.len()).into_iter().enumerate() {
            for row in rows {
                for joint in 0..JOINT_COUNT {
                    let v = states[row].velocity[joint];
                    if v.abs() <= MOVING_RAD_S && !(at_rest_counts && v == 0.0) {
                        continue;
                    }
                    let sign = if v == 0.0 { 0.0 } else { v.signum() };
                    let terms = [current_a[row][joint], moment_nm[row][joint], sign, v];
                    let (sums, rows) = &mut sums[block][joint];
                    for (line, a) in sums.iter_mut().zip(terms) {
                        for (sum, b) in line.iter_mut().zip(terms) {
                            *sum += a * b;
                        }
                    }
                    *rows += 1.0;
                }
            }
        }
        Self { sums }
    }

    fn total(&self, joint: usize, wanted: impl Fn(usize) -> bool) -> (Sums, f64) {
        let mut total = ([[0.0; TERMS]; TERMS], 0.0);
        for (_, block) in self.sums.iter().enumerate().filter(|(at, _)| wanted(*at)) {
            let (sums, rows) = &block[joint];
            for (line, others) in total.0.iter_mut().zip(sums) {
                for (sum, other) in line.iter_mut().zip(others) {
                    *sum += other;
                }
            }
            total.1 += rows;
        }
        total
    }

    fn fit(&self, joint: usize, wanted: impl Fn(usize) -> bool) -> Solution {
        let (sums, rows) = self.total(joint, wanted);
        let normal = DMatrix::from_fn(TERMS - 1, TERMS - 1, |i, j| sums[i + 1][j + 1]);
        let right = DVector::from_fn(TERMS - 1, |i, _| sums[0][i + 1]);
        let mut found = solve(&normal, &right);
        found.determined_by(rows);
        found
    }

    /// Sum of squares that a fit leaves, and rows.
    fn left(&self, joint: usize, fit: &Solution, wanted: impl Fn(usize) -> bool) -> (f64, f64) {
        let (sums, rows) = self.total(joint, wanted);
        let factors = [1.0, -fit.values[0], -fit.values[1], -fit.values[2]];
        let mut square = 0.0;
        for (line, a) in sums.iter().zip(factors) {
            for (sum, b) in line.iter().zip(factors) {
                square += a * b * sum;
            }
        }
        (square.max(0.0), rows)
    }

    fn drive(&self, joint: usize) -> JointDrive {
        let all = self.fit(joint, |_| true);
        let without: Vec<Solution> = (0..BLOCKS)
            .map(|block| self.fit(joint, |at| at != block))
            .collect();
        let estimate = |of: &dyn Fn(&Solution) -> Option<f64>| estimate(&all, &without, of);
        let constant = |fit: &Solution| {
            let per_nm = fit.values[0];
            (fit.determined[0] && per_nm > 0.0).then(|| 1.0 / per_nm)
        };
        let share = |place: usize| {
            move |fit: &Solution| {
                (fit.determined[place]).then(|| fit.values[place])?;
                Some(fit.values[place] * constant(fit)?)
            }
        };
        let torque_constant_nm_a = estimate(&constant).within(0.0, CONSTANT);
        let friction = |place: usize, (coarsest, of_value): (f64, f64)| {
            let mut found = estimate(&share(place))
                .within(coarsest, of_value)
                .not_negative();
            found.identifiable &= torque_constant_nm_a.identifiable;
            found
        };
        let squares = [0, 1].map(|parity| {
            let fit = self.fit(joint, |block| block % 2 == parity);
            self.left(joint, &fit, |block| block % 2 != parity)
        });
        let rows = squares[0].1 + squares[1].1;
        let (square, count) = self.left(joint, &all, |_| true);
        JointDrive {
            torque_constant_nm_a,
            coulomb_nm: friction(1, coarsest::COULOMB),
            viscous_nms_rad: friction(2, coarsest::VISCOUS),
            rms_a: (square / count.max(1.0)).sqrt(),
            held_out_rms_a: ((squares[0].0 + squares[1].0) / rows.max(1.0)).sqrt(),
        }
    }
}
