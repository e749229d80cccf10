//! Ways moved to where they keep more.
//!
//! A way that is free is bent until all of it keeps higher clearances: postures that lack some are moved
//! along the gradient of what they lack most, which the nearest points give in closed form, and pieces
//! between them that still lack some are halved and their middles moved likewise. What is found is where the
//! known way can be pulled to, not another way round.

use needlebench_kinematics::{JOINT_COUNT, Joints};

use super::TransferSearch;

/// Steps by which a posture is moved at most.
const MOST_STEPS: u32 = 16;
/// Motion of any point in one of these steps at most, m.
const LONGEST_STEP_M: f64 = 0.08;
/// What a posture is moved beyond what it lacks, m: the next one is hardly any nearer then.
const BEYOND_M: f64 = 1e-4;
/// How often a piece is halved at most.
const MOST_HALVINGS: u32 = 7;
/// Share of a piece that each half of it may be as long as at most.
const LONGEST_HALF: f64 = 0.9;

impl TransferSearch<'_> {
    /// A way with the same ends that keeps the clearances and follows a known one; `None` where that cannot
    /// be pulled there, or the budget runs out.
    pub fn lifted(&mut self, waypoints: &[Joints]) -> Option<Vec<Joints>> {
        let last = waypoints.len() - 1;
        let mut way = vec![waypoints[0]];
        for (index, waypoint) in waypoints.iter().enumerate().skip(1) {
            let to = if index == last {
                *waypoint
            } else {
                match self.lifted_posture(waypoint) {
                    Some(posture) => posture,
                    // The pieces beside it may do without.
                    None => continue,
                }
            };
            self.lift_piece(&mut way, &to, MOST_HALVINGS)?;
        }
        Some(way)
    }

    /// Adds what leads from the end of a way to a posture.
    fn lift_piece(&mut self, way: &mut Vec<Joints>, to: &Joints, halvings: u32) -> Option<()> {
        let from = *way.last()?;
        if self.is_free(&from, to) {
            way.push(*to);
            return Some(());
        }
        if halvings == 0 || self.checks >= self.budget.checks {
            return None;
        }
        let middle = self.lifted_posture(&(0.5 * (from + to)))?;
        let whole_m = self.checker.largest_displacement_m(&from, to);
        let halves_m = [&from, to].map(|end| self.checker.largest_displacement_m(end, &middle));
        if halves_m
            .into_iter()
            .any(|half_m| half_m > LONGEST_HALF * whole_m)
        {
            return None;
        }
        self.lift_piece(way, &middle, halvings - 1)?;
        self.lift_piece(way, to, halvings - 1)
    }

    /// The posture nearby that keeps the clearances.
    fn lifted_posture(&mut self, posture: &Joints) -> Option<Joints> {
        let mut q = *posture;
        for _ in 0..MOST_STEPS {
            if self.checks >= self.budget.checks {
                return None;
            }
            self.checks += 1;
            let Some((lack_m, rate)) = self.checker.lack(&q, &self.least_m) else {
                return Some(q);
            };
            if lack_m <= 0.0 {
                return Some(q);
            }
            // The least motion, measured by the ways of points, that makes up for it.
            let radius_m = self.checker.sweep_radii_m();
            let by_way = Joints::from_fn(|i, _| rate[i] / (radius_m[i] * radius_m[i]));
            let slope = rate.dot(&by_way);
            if slope <= f64::EPSILON {
                return None;
            }
            let mut step = by_way * ((lack_m + BEYOND_M) / slope);
            let way_m = self.checker.largest_displacement_m(&Joints::zeros(), &step);
            step *= (LONGEST_STEP_M / way_m).min(1.0);
            for i in 0..JOINT_COUNT {
                let limit = self.limits.0[i];
                q[i] = (q[i] + step[i]).clamp(limit.lower_rad, limit.upper_rad);
            }
        }
        None
    }
}
