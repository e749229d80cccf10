//! Robustness: how far the phantom may be shifted or turned before a configuration breaks.
//!
//! The phantom is moved by the keys that place it in a scenario, so every breaking case can be run by
//! anyone. Two questions are asked:
//!
//! - *aware*: the plan knows of the move. Goals by entry and target go with the phantom, the posture is
//!   solved anew, and the configuration breaks where its static case is no longer ok, and no posture is at
//!   a roll that was ok elsewhere. A goal by a flange pose stays where it is.
//! - *unaware*: the arm stands where it was when the patient moved; it breaks where a clearance is less
//!   than the rules or the criteria want.
//!
//! # Method
//!
//! What is found is the nearest break of those that were looked at, not a bound: a radius is an upper bound
//! of the distance within which something breaks, and no proof that nothing does.
//!
//! Along each of a fixed set of directions the first break is looked for in steps of a stated length, and
//! bisected. Around the directions of the nearest ones a pattern search looks for nearer ones. Then evenly
//! spread points of the ball within the nearest break are looked at; if one breaks, the search goes on about
//! it, until a sweep of as many points finds none. How many directions and points there were, and how many of
//! the last sweep's layouts cannot exist, is part of the result.
//!
//! A layout that cannot exist, such as a patient within the table, is neither a break nor a place where
//! nothing breaks.

mod search;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_cell::{Change, Finding, KeyPath, ResolvedScenario, Roll, ScenarioFamily};
use needlebench_kinematics::Joints;
use needlebench_kinematics::ik::Configuration;
use needlebench_study::Outcome;
use serde::Serialize;

use super::static_case::StaticWorker;
use search::{Search, Verdict, nearest_break};

/// How far and how finely breaks are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobustnessSettings {
    /// Farthest shift, mm.
    pub max_shift_mm: f64,
    /// Largest turn, deg.
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
    /// The break; none where none was found within the limit.
    pub found: Option<Breaking>,
    /// Farthest distance that was looked at, mm or deg.
    pub limit: f64,
    /// Directions that were scanned.
    pub directions: u32,
    /// Evenly spread points within the radius, or the limit, that were looked at last: none breaks.
    pub points: u32,
    /// Those of them whose layout cannot exist: nothing is known there, because there is nothing.
    pub impossible: u32,
    /// Whether the search came to its end: otherwise nearer breaks were still found when it was given up.
    pub settled: bool,
}

/// How far the phantom may be moved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Robustness {
    /// Smallest shift found that breaks the configuration, posture solved anew; length of the vector.
    pub shift: SmallestFound,
    /// Smallest turn found about the vertical and the body's long axis, `sqrt(yaw^2 + roll^2)`.
    pub tilt: SmallestFound,
    /// The same with the arm left where it stands; none where it stands in no posture at all.
    pub unaware: Option<Unaware>,
    /// Layouts that were looked at.
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

/// Rolls that are tried before a configuration is swept over all of them.
const MOST_ROLLS: usize = 6;

/// Keys of a shift and of a turn.
const SHIFT_KEYS: [&str; 3] = [
    "phantom.position_mm[0]",
    "phantom.position_mm[1]",
    "phantom.position_mm[2]",
];
const TILT_KEYS: [&str; 2] = ["phantom.head_yaw_deg", "phantom.body_roll_deg"];

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
    let here = family.vary(goal, changes)?;
    if here.phantom.is_none() {
        let finding = Finding::new(&here.source.file, "there is no phantom to move");
        return Err(vec![finding.key("phantom")]);
    }
    let mut worker = StaticWorker::default();
    let row = worker.row(&here, configuration);
    let joints_rad = row.measured.joints_rad;
    let mut mover = Mover {
        cancel,
        family,
        goal,
        changes,
        settings,
        evaluations: 0,
    };
    // Rolls that were ok in some layout, the one that was last is the last. Where the goal fixes the roll,
    // there is no other.
    let is_free = here
        .goals
        .first()
        .is_some_and(|goal| goal.roll == Roll::Free);
    let mut rolls_rad: Vec<f64> = Vec::new();
    let mut aware = |resolved: Result<ResolvedScenario, Vec<Finding>>| match resolved {
        Ok(resolved) => {
            // Mostly the posture at the roll of the layout before is ok too, and needs no sweep.
            let known = rolls_rad.iter().rposition(|&roll_rad| {
                let row = worker.row_at(&resolved, configuration, roll_rad);
                row.outcome == Outcome::Ok
            });
            if let Some(known) = known {
                rolls_rad[known..].rotate_left(1);
                return Verdict::Holds;
            }
            let row = worker.row(&resolved, configuration);
            match row.outcome {
                Outcome::Ok => {
                    if let Some(roll_rad) = row.measured.roll_rad.filter(|_| is_free) {
                        if rolls_rad.len() == MOST_ROLLS {
                            rolls_rad.remove(0);
                        }
                        rolls_rad.push(roll_rad);
                    }
                    Verdict::Holds
                }
                Outcome::Failed | Outcome::Rejected => Verdict::Breaks(row.detail.into_owned()),
                Outcome::Invalid => Verdict::Impossible,
            }
        }
        Err(findings) => goal_at_fault(&findings).map_or(Verdict::Impossible, Verdict::Breaks),
    };
    let (shift, tilt) = (mover.shift(&mut aware), mover.tilt(&mut aware));
    let unaware = joints_rad.map(|joints_rad| {
        let q = Joints::from_column_slice(&joints_rad);
        let mut stays = |resolved: Result<ResolvedScenario, Vec<Finding>>| match resolved {
            Ok(resolved) => match worker.clearance_broken(&resolved, &q) {
                Ok(None) => Verdict::Holds,
                Ok(Some(detail)) => Verdict::Breaks(detail.into_owned()),
                Err(_) => Verdict::Impossible,
            },
            Err(findings) => goal_at_fault(&findings).map_or(Verdict::Impossible, Verdict::Breaks),
        };
        Unaware {
            joints_deg: joints_rad.map(f64::to_degrees),
            shift: mover.shift(&mut stays),
            tilt: mover.tilt(&mut stays),
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

/// The goal's key at fault, where the move leaves the goal without a needle. A place that the phantom
/// cannot have, in the table or off it, is no evidence of anything: nobody can move it there.
fn goal_at_fault(findings: &[Finding]) -> Option<String> {
    let keys = findings.iter().filter_map(|finding| finding.key.clone());
    keys.into_iter().find(|key| key.starts_with("goals"))
}

/// Moves the phantom of a layout.
struct Mover<'a> {
    cancel: Option<&'a AtomicBool>,
    family: &'a ScenarioFamily,
    goal: &'a str,
    changes: &'a [(KeyPath, Change)],
    settings: &'a RobustnessSettings,
    evaluations: u64,
}

/// What is seen in a layout.
type Judge<'j> = dyn FnMut(Result<ResolvedScenario, Vec<Finding>>) -> Verdict + 'j;

impl Mover<'_> {
    fn shift(&mut self, judge: &mut Judge<'_>) -> SmallestFound {
        let search = Search {
            limit: self.settings.max_shift_mm,
            step: self.settings.step_mm,
            resolution: RESOLUTION,
            points: self.settings.points_per_axis.pow(3),
        };
        let directions = search::on_sphere(self.settings.shift_directions);
        self.nearest(&search, &directions, &SHIFT_KEYS, judge)
    }

    fn tilt(&mut self, judge: &mut Judge<'_>) -> SmallestFound {
        let search = Search {
            limit: self.settings.max_tilt_deg,
            step: self.settings.step_deg,
            resolution: RESOLUTION,
            points: self.settings.points_per_axis.pow(2),
        };
        let directions = search::on_circle(self.settings.tilt_directions);
        self.nearest(&search, &directions, &TILT_KEYS, judge)
    }

    fn nearest<const N: usize>(
        &mut self,
        search: &Search,
        directions: &[[f64; N]],
        keys: &[&str; N],
        judge: &mut Judge<'_>,
    ) -> SmallestFound {
        let paths = keys.map(|key| KeyPath::parse(key).expect("a path"));
        let mut evaluations = 0;
        let found = nearest_break(search, directions, |offset| {
            evaluations += 1;
            // What is found then is thrown away.
            if self.is_cancelled() {
                return Verdict::Impossible;
            }
            judge(self.moved(&paths, offset))
        });
        self.evaluations += evaluations;
        let breaking = found.nearest.map(|(radius, offset, detail)| {
            let moved = self.moved(&paths, &offset);
            Breaking {
                radius,
                offset: offset.to_vec(),
                keys: self.values(moved.as_ref().ok(), keys, &offset),
                detail,
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

    fn moved<const N: usize>(
        &self,
        paths: &[KeyPath; N],
        offset: &[f64; N],
    ) -> Result<ResolvedScenario, Vec<Finding>> {
        let mut changes = self.changes.to_vec();
        let adds = paths.iter().zip(offset);
        changes.extend(adds.map(|(path, by)| (path.clone(), Change::Add(*by))));
        self.family.vary(self.goal, &changes)
    }

    /// Where the phantom then lies; of a layout that cannot exist, what was added.
    fn values<const N: usize>(
        &self,
        resolved: Option<&ResolvedScenario>,
        keys: &[&str; N],
        offset: &[f64; N],
    ) -> BTreeMap<String, f64> {
        let phantom = resolved.and_then(|resolved| resolved.scenario.phantom.as_ref());
        let Some(phantom) = phantom else {
            let base = self.family.vary(self.goal, self.changes).ok();
            let from = base.map(|base| self.values(Some(&base), keys, offset));
            let sums = keys.iter().zip(offset).map(|(key, by)| {
                let start = from.as_ref().and_then(|from| from.get(*key));
                ((*key).to_owned(), start.copied().unwrap_or(0.0) + by)
            });
            return sums.collect();
        };
        let [x, y, z] = phantom.position_mm;
        let all = [
            (SHIFT_KEYS[0], x),
            (SHIFT_KEYS[1], y),
            (SHIFT_KEYS[2], z),
            (TILT_KEYS[0], phantom.head_yaw_deg),
            (TILT_KEYS[1], phantom.body_roll_deg),
        ];
        all.map(|(key, value)| (key.to_owned(), value)).into()
    }
}
