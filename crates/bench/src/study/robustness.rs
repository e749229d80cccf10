//! Robustness: how far the phantom may be shifted or turned before a configuration breaks.
//!
//! The phantom is moved by the keys that place it in a scenario, so every failing case can be rerun. Two
//! questions are answered:
//!
//! - *aware*: the move is known to the plan. Goals by entry and target move with the phantom, the posture is
//!   recomputed, and the configuration breaks where its static case is no longer ok, and no posture is at
//!   a roll that was ok elsewhere. A goal by a flange pose stays in place.
//! - *unaware*: the arm stays in place when the patient moves; it breaks where a clearance is less than the
//!   rules or the criteria require.
//!
//! # Method
//!
//! The result is the nearest break found: an upper bound of the radius of failure, and no proof that nothing
//! nearer breaks.
//!
//! Along each of a fixed set of directions the first break is searched for in steps of a stated length, and
//! bisected. A pattern search around the directions of the nearest ones looks for nearer ones. Then evenly
//! spread points of the ball within the nearest break are evaluated; if one breaks, the search continues around
//! it, until a sweep of as many points finds none. The numbers of directions and points, and of invalid layouts
//! in the last sweep, are part of the result.
//!
//! An invalid layout, such as a patient within the table, counts neither as a break nor as feasible.
//!
//! # How a layout is decided
//!
//! By its static case. Most layouts are decided without one: the posture at the roll that was ok last is solved
//! in closed form, its joints and its needle are evaluated, and its clearances are proven by how far arm and
//! patient have travelled since distances were measured ([`KnownGaps`](needlebench_clearance::KnownGaps)).
//! What is proven is what the case would say, so all that is reported is the same with
//! [`by_bounds`](RobustnessSettings::by_bounds) or without.

mod layouts;
mod proofs;
mod search;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_clearance::ClearanceModel;
use needlebench_input::Finding;
use needlebench_kinematics::Joints;
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::family::{SHIFT_KEYS, TURN_KEYS};
use needlebench_scenario::{Change, KeyPath, PhantomMove, ScenarioFamily};
use serde::Serialize;

use layouts::{Layouts, Question};
use proofs::Proofs;
use search::{Search, Verdict, nearest_break};

/// How far and how finely breaks are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobustnessSettings {
    /// Largest shift, mm.
    pub max_shift_mm: f64,
    /// Largest rotation, deg.
    pub max_tilt_deg: f64,
    /// Longest stretch of a shift that may go unseen, mm.
    pub step_mm: f64,
    /// Longest stretch of a turn that may go unseen, deg.
    pub step_deg: f64,
    /// Directions of shifts, besides the six along the axes.
    pub shift_directions: u32,
    /// Directions of turns.
    pub tilt_directions: u32,
    /// Points along an axis of the ball within the nearest break, none of which may break: of a shift there
    /// are as many to the third power, of a turn, which has two angles, to the second.
    pub points_per_axis: u32,
    /// Decides by bounds of travel where these prove the answer: the answers are those of evaluating every
    /// layout, and come sooner.
    pub by_bounds: bool,
}

impl Default for RobustnessSettings {
    fn default() -> Self {
        Self {
            max_shift_mm: 50.0,
            max_tilt_deg: 20.0,
            step_mm: 2.0,
            step_deg: 1.0,
            shift_directions: 64,
            tilt_directions: 16,
            points_per_axis: 16,
            by_bounds: true,
        }
    }
}

/// Width within which a break is located, mm and deg.
pub const RESOLUTION: f64 = 0.01;

/// The nearest break that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Breaking {
    /// How far, mm or deg: the first place found broken, at most [`RESOLUTION`] behind the last one
    /// that was not.
    pub radius: f64,
    /// The move: world x, y and z in mm for a shift; head yaw and body roll in deg for a turn.
    pub offset: Vec<f64>,
    /// Keys of the breaking case and their values.
    pub keys: BTreeMap<String, f64>,
    /// The rule or criterion that is broken there, as in [`Row::detail`](needlebench_study::Row).
    pub detail: String,
}

/// The smallest move that was found to break a configuration, and how it was searched for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SmallestFound {
    /// The break; none if none was found within the limit.
    pub found: Option<Breaking>,
    /// Farthest distance that was looked at, mm or deg.
    pub limit: f64,
    /// Directions that were scanned.
    pub directions: u32,
    /// Evenly spread points within the radius, or the limit, that were looked at last: none breaks.
    pub points: u32,
    /// Those of them with an invalid layout.
    pub impossible: u32,
    /// Whether the search converged: otherwise a smaller value may exist.
    pub settled: bool,
}

/// How far the phantom may be moved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Robustness {
    /// Smallest shift found that breaks the configuration, posture recomputed; length of the vector.
    pub shift: SmallestFound,
    /// Smallest turn found about the vertical and the body's long axis, `sqrt(yaw^2 + roll^2)`.
    pub tilt: SmallestFound,
    /// The same with the arm fixed; none where it has no posture at all.
    pub unaware: Option<Unaware>,
    /// Layouts that were looked at, whether evaluated or decided by proof.
    pub evaluations: u64,
}

/// How far the phantom may be moved beside an arm that stays.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unaware {
    /// Final positions of the joints, deg.
    pub joints_deg: [f64; 6],
    /// Smallest shift found.
    pub shift: SmallestFound,
    /// Smallest turn found.
    pub tilt: SmallestFound,
}

/// How far the phantom of a layout may be moved before a configuration breaks. Where it is broken as
/// it stands, the radius is 0. Deterministic.
///
/// With `rest_on_table` a turned phantom rests on the table again, and a vertical shift is a change of
/// its cushion's height. `None` if it was cancelled.
///
/// # Errors
/// What is wrong with the layout itself.
pub fn robustness(
    family: &ScenarioFamily,
    goal: &str,
    changes: &[(KeyPath, Change)],
    configuration: Configuration,
    settings: &RobustnessSettings,
    cancel: Option<&AtomicBool>,
) -> Result<Option<Robustness>, Vec<Finding>> {
    let moves = family.phantom_moves(goal, changes)?;
    let model = ClearanceModel::new(&moves.base().cell);
    let proofs = if settings.by_bounds {
        Proofs::of(moves.base(), &model, configuration)
    } else {
        None
    };
    let mut layouts = Layouts::new(&moves, configuration, proofs);
    let joints_rad = layouts.joints_rad();
    let mut mover = Mover {
        cancel,
        settings,
        layouts: &mut layouts,
        evaluations: 0,
    };
    let (shift, tilt) = (mover.shift(Question::Aware), mover.tilt(Question::Aware));
    let unaware = joints_rad.map(|joints_rad| {
        let stays = Question::Unaware(Joints::from_column_slice(&joints_rad));
        Unaware {
            joints_deg: joints_rad.map(f64::to_degrees),
            shift: mover.shift(stays),
            tilt: mover.tilt(stays),
        }
    });
    let found = Robustness {
        shift,
        tilt,
        unaware,
        evaluations: mover.evaluations,
    };
    Ok(Some(found).filter(|_| !mover.is_cancelled()))
}

/// Moves the phantom of a layout.
struct Mover<'a, 'l> {
    cancel: Option<&'a AtomicBool>,
    settings: &'a RobustnessSettings,
    layouts: &'a mut Layouts<'l>,
    evaluations: u64,
}

impl Mover<'_, '_> {
    fn shift(&mut self, question: Question) -> SmallestFound {
        let search = Search {
            limit: self.settings.max_shift_mm,
            step: self.settings.step_mm,
            resolution: RESOLUTION,
            points: self.settings.points_per_axis.pow(3),
        };
        let directions = search::on_sphere(self.settings.shift_directions);
        self.nearest(&search, &directions, question, PhantomMove::Shift)
    }

    fn tilt(&mut self, question: Question) -> SmallestFound {
        let search = Search {
            limit: self.settings.max_tilt_deg,
            step: self.settings.step_deg,
            resolution: RESOLUTION,
            points: self.settings.points_per_axis.pow(2),
        };
        let directions = search::on_circle(self.settings.tilt_directions);
        self.nearest(&search, &directions, question, PhantomMove::Turn)
    }

    fn nearest<const N: usize>(
        &mut self,
        search: &Search,
        directions: &[[f64; N]],
        question: Question,
        as_move: fn([f64; N]) -> PhantomMove,
    ) -> SmallestFound {
        let mut evaluations = 0;
        let found = nearest_break(search, directions, |offset| {
            evaluations += 1;
            // What is found then is thrown away.
            if self.is_cancelled() {
                return Verdict::Impossible;
            }
            self.layouts.verdict(question, &as_move(*offset))
        });
        self.evaluations += evaluations;
        let breaking = found.nearest.map(|nearest| {
            let offset = nearest.offset();
            Breaking {
                radius: nearest.radius,
                offset: offset.to_vec(),
                keys: self.keys(&as_move(offset)),
                detail: self.layouts.detail(question, &as_move(nearest.seen_at)),
            }
        });
        SmallestFound {
            found: breaking,
            limit: search.limit,
            directions: u32::try_from(directions.len()).unwrap_or(u32::MAX),
            points: found.points,
            impossible: found.impossible,
            settled: found.settled,
        }
    }

    fn is_cancelled(&self) -> bool {
        self.cancel
            .is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }

    /// Where the phantom lies after a move, by key; for an invalid layout the moved keys only.
    fn keys(&self, by: &PhantomMove) -> BTreeMap<String, f64> {
        let moves = self.layouts.moves();
        let section = moves.section_after(by);
        let [yaw_key, roll_key] = TURN_KEYS;
        let position = SHIFT_KEYS.into_iter().zip(section.position_mm);
        let turns = [
            (yaw_key, section.head_yaw_deg),
            (roll_key, section.body_roll_deg),
        ];
        let exists = moves.resolved(by).is_ok();
        let all = position.chain(turns);
        all.filter(|(key, _)| exists || by.keys().contains(key))
            .map(|(key, value)| (key.to_owned(), value))
            .collect()
    }
}
