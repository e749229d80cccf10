//! What an engine's motion differs from the reference integrator's by.

use std::collections::BTreeMap;

use nalgebra::Point3;
use needlebench_cell::Cell;
use needlebench_engine::{HeldWindow, PlantState, Recording};
use needlebench_scenario::Goal;
use serde::Serialize;

use crate::needle::tip_of;

/// Below this a difference is rounding, and no order can be read from it, m.
const ROUNDING_M: f64 = 1e-12;

/// Order of convergence that is documented for both engines: semi-implicit Euler.
pub const DOCUMENTED_ORDER: f64 = 1.0;

/// How far a measured order may be from the documented one: at steps that are not small the next
/// order shows.
pub const ORDER_TOLERANCE: f64 = 0.25;

/// Each engine compared with the reference integrator, by the engine's name.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct RefereeReport {
    /// By engine.
    #[serde(flatten)]
    pub engines: BTreeMap<String, RefereeComparison>,
}

/// One engine compared with the reference integrator, on the part of the motion before the first contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RefereeComparison {
    /// End of what was compared: that of the motion, or the first contact that the engine saw.
    pub until_s: f64,
    /// Engine and reference integrator, each in a closed loop with its own servo.
    pub closed_loop: TipDifference,
    /// The reference integrator from the engine's own states under the engine's recorded torques, window by window;
    /// none where the motion is shorter than a window.
    pub held_torques: Option<HeldTorques>,
    /// The closed loop again at smaller steps, the first entry at the scenario's own.
    pub convergence: Vec<StepDifference>,
    /// Order of convergence from the two smallest steps; none where the differences are rounding.
    pub order: Option<f64>,
    /// The order that is documented for the engine.
    pub documented_order: f64,
}

impl RefereeComparison {
    /// Whether a measured order, if there is one, is the documented one.
    pub fn is_documented(&self, order: Option<f64>) -> bool {
        order.is_none_or(|order| (order - self.documented_order).abs() <= ORDER_TOLERANCE)
    }
}

/// Length of a window of held torques, s: long enough for a wrong force to move the tip (1 % of gravity by
/// some 0.1 mm), short enough for a difference to grow by gravity no more than some per cent.
pub const HELD_WINDOW_S: f64 = 0.05;

/// An engine compared with the reference integrator over windows of truly held torques, without any servo.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct HeldTorques {
    /// Length of a window, s.
    pub window_s: f64,
    /// How many there were.
    pub windows: usize,
    /// Largest distance of the tips at the end of a window, m.
    pub peak_tip_m: f64,
    /// End of that window, s.
    pub peak_time_s: f64,
    /// How many times as large gravity makes a difference over a window, at most.
    pub growth: f64,
    /// The largest distance at smaller steps, the first entry at the scenario's own.
    pub convergence: Vec<StepDifference>,
    /// Order of convergence from the two smallest steps; none where the distances are rounding.
    pub order: Option<f64>,
}

impl HeldTorques {
    /// One step's windows; none if there were none.
    pub fn of(
        cell: &Cell,
        goal: &Goal,
        recording: &Recording,
        windows: &[HeldWindow],
    ) -> Option<Self> {
        let first = windows.first()?;
        let mut found = Self {
            window_s: (first.last - first.first) as f64 * recording.timestep_s,
            windows: windows.len(),
            ..Self::default()
        };
        for window in windows {
            let [engine, referee] = [&recording.state[window.last], &window.state]
                .map(|state| tip_of(cell, goal, &state.world_from_flange));
            let apart_m = (engine - referee).norm();
            if apart_m > found.peak_tip_m {
                found.peak_tip_m = apart_m;
                found.peak_time_s = recording.time_s[window.last];
            }
            found.growth = found.growth.max(window.growth);
        }
        Some(found)
    }
}

/// Distance of two tips along a motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Default)]
pub struct TipDifference {
    /// Largest distance at the same time, m.
    pub peak_tip_m: f64,
    /// When.
    pub peak_time_s: f64,
    /// Distance at the end, m; none if the motion was compared up to a contact only.
    pub settled_tip_m: Option<f64>,
}

/// Difference at one length of the step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepDifference {
    /// Length of the step.
    pub timestep_s: f64,
    /// Largest distance of the tips.
    pub peak_tip_m: f64,
}

/// Where the needle's tip was in every state of a motion, world: all that is compared.
#[derive(Debug, Clone, PartialEq)]
pub struct TipPath {
    /// Length of a step, s.
    pub timestep_s: f64,
    /// The tip in every state, the starting one included.
    pub tip_m: Vec<Point3<f64>>,
    /// Number of steps before the first contact; all of them without one.
    pub steps_before_contact: usize,
}

impl TipPath {
    /// The tip of a recording.
    pub fn of(cell: &Cell, goal: &Goal, recording: &Recording) -> Self {
        Self {
            steps_before_contact: steps_before_contact(recording),
            ..Self::of_states(cell, goal, recording.timestep_s, &recording.state)
        }
    }

    /// The tip of a motion without contacts.
    pub fn of_states(cell: &Cell, goal: &Goal, timestep_s: f64, states: &[PlantState]) -> Self {
        let tips = states
            .iter()
            .map(|state| tip_of(cell, goal, &state.world_from_flange));
        Self {
            timestep_s,
            tip_m: tips.collect(),
            steps_before_contact: states.len().saturating_sub(1),
        }
    }

    /// Distances to the tip of another motion at the same times, over the states that both have.
    fn distances_m(&self, other: &Self) -> impl Iterator<Item = f64> {
        let both = self.tip_m.iter().zip(&other.tip_m);
        both.map(|(one, other)| (one - other).norm())
    }

    fn time_s(&self, state: usize) -> f64 {
        state as f64 * self.timestep_s
    }
}

/// Number of steps before the first contact of a recording; all of them without one.
pub fn steps_before_contact(recording: &Recording) -> usize {
    recording
        .state
        .iter()
        .position(|state| state.contact.count > 0)
        .map_or(recording.steps(), |index| index.saturating_sub(1))
}

/// Distance of the needle's tips, state by state, over the first `steps` that both have.
pub fn tip_difference(engine: &TipPath, other: &TipPath, steps: usize) -> TipDifference {
    let mut difference = TipDifference::default();
    let (mut last_m, mut states) = (0.0, 0);
    for apart_m in engine.distances_m(other).take(steps + 1) {
        last_m = apart_m;
        if apart_m > difference.peak_tip_m {
            difference.peak_tip_m = apart_m;
            difference.peak_time_s = engine.time_s(states);
        }
        states += 1;
    }
    let to_the_end = states >= engine.tip_m.len();
    difference.settled_tip_m = to_the_end.then_some(last_m);
    difference
}

/// `log(e1 / e2) / log(h1 / h2)` of the two smallest steps.
pub fn measured_order(convergence: &[StepDifference]) -> Option<f64> {
    let [.., coarse, fine] = convergence else {
        return None;
    };
    (fine.peak_tip_m > ROUNDING_M).then(|| {
        libm::log(coarse.peak_tip_m / fine.peak_tip_m)
            / libm::log(coarse.timestep_s / fine.timestep_s)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(errors_m: [f64; 3]) -> Vec<StepDifference> {
        errors_m
            .into_iter()
            .zip([1e-3, 5e-4, 2.5e-4])
            .map(|(peak_tip_m, timestep_s)| StepDifference {
                timestep_s,
                peak_tip_m,
            })
            .collect()
    }

    #[test]
    fn the_order_is_that_of_the_smallest_steps() {
        let order = measured_order(&series([9e-6, 4e-6, 1e-6])).unwrap();
        assert!((order - 2.0).abs() < 1e-12, "{order}");
    }

    #[test]
    fn rounding_has_no_order() {
        assert_eq!(measured_order(&series([1e-15, 3e-15, 2e-15])), None);
        assert_eq!(measured_order(&series([1e-6, 1e-6, 1e-6])[..1]), None);
    }
}
