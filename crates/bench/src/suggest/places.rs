//! Base placements that are feasible for the goals of a scenario.
//!
//! Placements on a grid about the patient, in whole centimetres, are evaluated as static cases of a study are. An
//! invalid placement is refused with what makes it invalid; one where a goal has fewer feasible configurations than the
//! scenario requires, with the rule that rejects most of them. The others are ordered by their worst goal: first by its
//! number of feasible configurations, then by the clearance of its best configuration's arm from the surroundings.
//! Proposals are at least 100 mm apart.

use std::sync::atomic::Ordering;

use nalgebra::Vector3;
use needlebench_cell::ClearanceClass;
use needlebench_input::Finding;
use needlebench_parallel::{Control, in_parallel};
use needlebench_patient::{Refused, SuggestError, counted};
use needlebench_scenario::{Change, KeyPath, ResolvedScenario, ScenarioFamily, Setting};
use needlebench_study::Outcome;
use serde::Serialize;

use super::grid::{BasePlace, places};
use crate::Runnable;
use crate::preview::Preview;
use crate::study::{CaseRow, StaticWorker, planned_rows};

/// Distance between proposed places, mm.
const APART_MM: f64 = 100.0;
/// Places that one worker looks at, one after the other: geometry is prepared once for them.
const RUN: usize = 4;

/// What a place is to a goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlaceGoal {
    /// Its name.
    pub goal: String,
    /// Configurations that are feasible there, by their final postures.
    pub working: usize,
    /// That of them with the largest clearance.
    pub best: String,
    /// Least clearance of its arm from patient, table, gantry, mount and obstacles, m; none if there is none of them.
    pub clearance_m: Option<f64>,
    /// Configurations that also have a motion that meets the criteria, if motions were planned.
    pub working_planned: Option<usize>,
}

/// A proposed place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Lines for `[robot]` in a scenario.
    pub toml: String,
    /// `base_position_mm`, m.
    pub base_position_m: [f64; 3],
    /// `base_rpy_deg`, rad.
    pub base_rpy_rad: [f64; 3],
    /// The same as a scenario has it.
    #[serde(skip)]
    pub position_mm: [f64; 3],
    /// The same as a scenario has it.
    #[serde(skip)]
    pub rpy_deg: [f64; 3],
    /// Goal by goal.
    pub goals: Vec<PlaceGoal>,
    /// Feasible configurations of the goal with fewest.
    pub working: usize,
    /// Clearance of the goal with least, m.
    pub clearance_m: Option<f64>,
}

/// A place that was tried.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceSample {
    /// Position of the base, mm.
    pub position_mm: [f64; 3],
    /// Feasible configurations of the goal with fewest; none for an invalid placement.
    pub working: Option<usize>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlaceSearch {
    /// Names of the goals that a placement must be feasible for.
    pub goals: Vec<String>,
    /// What the judgement rests on.
    pub basis: &'static str,
    /// Places that were tried.
    pub tried: usize,
    /// Of these, feasible for all goals.
    pub allowed: usize,
    /// What rejected the others, the most frequent first.
    pub refused: Vec<Refused>,
    /// Required number of feasible configurations.
    pub wanted: usize,
    /// The place that the scenario has, judged likewise; none if it is invalid or infeasible for a goal.
    pub present: Option<Place>,
    /// The proposals, the best first.
    pub places: Vec<Place>,
    /// All that was tried.
    #[serde(skip)]
    pub samples: Vec<PlaceSample>,
}

/// What became of a place.
enum Judged {
    Serves(Vec<PlaceGoal>),
    /// A goal has so few; by this rule.
    Fails(usize, String),
    /// It cannot be.
    Invalid(String),
}

/// Proposes up to `count` places for all of some goals of a family's scenario. The same for any number of threads.
///
/// # Errors
/// If there is no patient, a goal is a pose of the flange, its route is refused, or it was interrupted.
pub fn suggest_places(
    family: &ScenarioFamily,
    goals: &[String],
    count: usize,
    control: &Control<'_>,
) -> Result<PlaceSearch, SuggestError> {
    let base = family.base();
    check_goals(base, goals)?;
    let tried = places(base)
        .map_err(|error| SuggestError::refused(error.to_string(), "only UR arms can be placed"))?;
    if tried.is_empty() {
        return Err(SuggestError::refused(
            "no patient to place the base beside",
            "add a [phantom] section",
        ));
    }
    let wanted = (base.scenario.criteria.min_working_configurations as usize).max(1);
    let search = Search {
        family,
        goals,
        wanted,
    };
    control.progress.message("places");
    control.progress.expect(tried.len() as u64);
    let runs: Vec<&[BasePlace]> = tried.chunks(RUN).collect();
    let judged = in_parallel(control.threads, &runs, |run| {
        let mut worker = StaticWorker::default();
        let judge = |place: &BasePlace| {
            let judged = (!control.cancel.load(Ordering::Relaxed))
                .then(|| search.judge(&mut worker, Some(*place)));
            control.progress.step();
            judged
        };
        run.iter().map(judge).collect::<Vec<_>>()
    });
    let judged: Option<Vec<Judged>> = judged.into_iter().flatten().collect();
    let judged = judged.ok_or(SuggestError::Interrupted)?;
    let samples = tried
        .iter()
        .zip(&judged)
        .map(|(place, judged)| PlaceSample {
            position_mm: place.position_mm,
            working: match judged {
                Judged::Serves(goals) => goals.iter().map(|goal| goal.working).min(),
                Judged::Fails(working, _) => Some(*working),
                Judged::Invalid(_) => None,
            },
        });
    let samples: Vec<PlaceSample> = samples.collect();
    let refused = counted(judged.iter().filter_map(|judged| match judged {
        Judged::Serves(_) => None,
        Judged::Fails(_, rule) | Judged::Invalid(rule) => Some(rule.as_str()),
    }));
    let served = tried
        .iter()
        .zip(judged)
        .filter_map(|(place, judged)| match judged {
            Judged::Serves(goals) => Some(proposal(place, goals)),
            _ => None,
        });
    let mut served: Vec<Place> = served.collect();
    let allowed = served.len();
    served.sort_by(better_first);
    let present = match search.judge(&mut StaticWorker::default(), None) {
        Judged::Serves(goals) => Some(proposal(&present_place(base), goals)),
        _ => None,
    };
    Ok(PlaceSearch {
        goals: goals.to_vec(),
        basis: crate::preview::BASIS,
        tried: tried.len(),
        allowed,
        refused,
        wanted,
        present,
        places: search.apart(served, count),
        samples,
    })
}

/// Goals that are infeasible from every placement are rejected before anything is tried.
fn check_goals(base: &ResolvedScenario, goals: &[String]) -> Result<(), SuggestError> {
    for goal in &base.goals {
        if !goals.contains(&goal.name) {
            continue;
        }
        let section = base
            .scenario
            .goals
            .iter()
            .find(|each| each.name == goal.name);
        if section.is_some_and(|section| section.flange_pose.is_some()) {
            return Err(SuggestError::refused(
                format!(
                    "goal `{}` is a flange pose, which moves with the base",
                    goal.name
                ),
                "give it an entry and a target",
            ));
        }
        if let Some(route) = needlebench_planning::route_rejection(base, goal) {
            return Err(SuggestError::refused(
                format!(
                    "no base placement is feasible for goal `{}`: {}",
                    goal.name, route.detail
                ),
                "request entries first: --entries",
            ));
        }
    }
    Ok(())
}

struct Search<'a> {
    family: &'a ScenarioFamily,
    goals: &'a [String],
    wanted: usize,
}

impl Search<'_> {
    /// All goals at a place; `None` is the scenario's own.
    fn judge(&self, worker: &mut StaticWorker, place: Option<BasePlace>) -> Judged {
        let changes = place.map_or_else(Vec::new, |place| changes(&place));
        let mut served = Vec::with_capacity(self.goals.len());
        for goal in self.goals {
            let resolved = match self.family.vary(goal, &changes) {
                Ok(resolved) => resolved,
                Err(findings) => return Judged::Invalid(in_words(&findings)),
            };
            let rows = worker.rows(&resolved);
            let works = |row: &&CaseRow| row.outcome == Outcome::Ok;
            let working = rows.iter().filter(works).count();
            if working < self.wanted {
                let broken = rows.iter().filter(|row| !works(row));
                let rules = counted(broken.map(|row| row.detail.as_ref()));
                let rule = rules.first().map_or("", |first| first.rule.as_str());
                return Judged::Fails(
                    working,
                    match self.goals {
                        [_] => rule.to_owned(),
                        _ => format!("{goal}: {rule}"),
                    },
                );
            }
            let best = rows.iter().filter(works).max_by(|a, b| {
                let clear = |row: &CaseRow| clearance_m(row).unwrap_or(f64::INFINITY);
                // The first of equals.
                clear(a)
                    .total_cmp(&clear(b))
                    .then(std::cmp::Ordering::Greater)
            });
            served.push(PlaceGoal {
                goal: goal.clone(),
                working,
                best: best.map_or_else(String::new, |row| row.measured.label.to_owned()),
                clearance_m: best.and_then(clearance_m),
                working_planned: None,
            });
        }
        Judged::Serves(served)
    }

    /// The first places that stand apart from better ones and pass all that `check` asks.
    fn apart(&self, served: Vec<Place>, count: usize) -> Vec<Place> {
        let mut chosen: Vec<Place> = Vec::new();
        for place in served {
            if chosen.len() == count {
                break;
            }
            let is_near = |other: &Place| {
                let (a, b) = (
                    Vector3::from(place.position_mm),
                    Vector3::from(other.position_mm),
                );
                (a - b).norm() < APART_MM
            };
            if !chosen.iter().any(is_near) && self.passes(&place) {
                chosen.push(place);
            }
        }
        chosen
    }

    fn passes(&self, place: &Place) -> bool {
        let place = BasePlace {
            position_mm: place.position_mm,
            rpy_deg: place.rpy_deg,
        };
        self.goals.iter().all(|goal| {
            let resolved = self.family.vary(goal, &changes(&place)).ok();
            let runnable = resolved.and_then(|resolved| Runnable::checked(resolved).ok());
            runnable.is_some_and(|runnable| {
                Preview::of(runnable.scenario()).is_ok_and(|(_, findings)| findings.is_empty())
            })
        })
    }
}

/// The scenario with a goal alone and the base at a place.
///
/// # Errors
/// If there cannot be such a layout.
pub fn at_place(
    family: &ScenarioFamily,
    goal: &str,
    place: &Place,
) -> Result<ResolvedScenario, SuggestError> {
    let at = BasePlace {
        position_mm: place.position_mm,
        rpy_deg: place.rpy_deg,
    };
    let resolved = family.vary(goal, &changes(&at));
    resolved.map_err(|findings| SuggestError::refused(in_words(&findings), String::new()))
}

/// Plans the motions of a place's goals, and says for how many configurations there is one.
///
/// # Errors
/// If a goal cannot be planned at all.
pub fn plan_place(family: &ScenarioFamily, place: &mut Place) -> Result<(), SuggestError> {
    let mut counts = Vec::with_capacity(place.goals.len());
    for goal in &place.goals {
        let resolved = at_place(family, &goal.goal, place)?;
        let rows = planned_rows(&resolved)
            .map_err(|failure| SuggestError::refused(failure.to_string(), String::new()))?;
        let works = rows.iter().filter(|row| row.outcome == Outcome::Ok);
        counts.push(works.count());
    }
    for (goal, count) in place.goals.iter_mut().zip(counts) {
        goal.working_planned = Some(count);
    }
    Ok(())
}

fn changes(place: &BasePlace) -> Vec<(KeyPath, Change)> {
    let set = |key: &str, value: [f64; 3]| {
        let path = KeyPath::parse(key).expect("it is the path of a key");
        (path, Change::Set(Setting::from(value)))
    };
    vec![
        set("robot.base_position_mm", place.position_mm),
        set("robot.base_rpy_deg", place.rpy_deg),
    ]
}

/// Why a placement is invalid, without its numbers: to be counted.
fn in_words(findings: &[Finding]) -> String {
    let key = findings.iter().find_map(|finding| finding.key.as_deref());
    match key {
        Some("robot.base_position_mm") => "base or mount collides".to_owned(),
        Some("start.joints_deg") => "invalid start posture".to_owned(),
        Some(key) => format!("invalid `{key}`"),
        None => "invalid layout".to_owned(),
    }
}

/// Least clearance of the arm from its surroundings, m.
fn clearance_m(row: &CaseRow) -> Option<f64> {
    /// The arm against itself, and what the goal decides wherever the robot stands.
    const LEFT_OUT: [ClearanceClass; 5] = [
        ClearanceClass::ToolPhantom,
        ClearanceClass::SelfCollision,
        ClearanceClass::GuideStandoff,
        ClearanceClass::NeedleCorridor,
        ClearanceClass::NeedleRoute,
    ];
    let found = row.measured.posture_clearance_m.iter();
    let outer = found.filter(|(class, _)| LEFT_OUT.iter().all(|left| left.name() != **class));
    outer
        .map(|(_, clearance_m)| *clearance_m)
        .min_by(f64::total_cmp)
}

fn present_place(base: &ResolvedScenario) -> BasePlace {
    let pose = &base.cell.robot.world_from_base_link;
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let angles = [roll, pitch, yaw].map(|angle| tenth(angle.to_degrees()));
    BasePlace {
        position_mm: (pose.translation.vector * 1e3).map(tenth).into(),
        rpy_deg: base.scenario.robot.base_rpy_deg.unwrap_or(angles),
    }
}

fn tenth(number: f64) -> f64 {
    // Zero, and not its negative.
    (number * 10.0).round() / 10.0 + 0.0
}

fn proposal(place: &BasePlace, goals: Vec<PlaceGoal>) -> Place {
    let BasePlace {
        position_mm,
        rpy_deg,
    } = *place;
    Place {
        toml: format!(
            "base_position_mm = {}\nbase_rpy_deg = {}",
            listed(position_mm),
            listed(rpy_deg)
        ),
        base_position_m: position_mm.map(|mm| mm * 1e-3),
        base_rpy_rad: rpy_deg.map(f64::to_radians),
        position_mm,
        rpy_deg,
        working: goals.iter().map(|goal| goal.working).min().unwrap_or(0),
        clearance_m: goals
            .iter()
            .filter_map(|goal| goal.clearance_m)
            .min_by(f64::total_cmp),
        goals,
    }
}

/// As a scenario has it.
fn listed(numbers: [f64; 3]) -> String {
    let [x, y, z] = numbers;
    format!("[{x}, {y}, {z}]")
}

fn better_first(a: &Place, b: &Place) -> std::cmp::Ordering {
    let clear = |place: &Place| place.clearance_m.unwrap_or(f64::INFINITY);
    b.working
        .cmp(&a.working)
        .then(clear(b).total_cmp(&clear(a)))
}

impl PlaceSearch {
    /// Why nothing is proposed.
    pub fn why_none(&self) -> String {
        let most = self.refused.first();
        format!(
            "none of {} base placements around the patient is feasible for {}; most frequent \
             reason: {} ({})",
            self.tried,
            if self.goals.len() == 1 {
                "the goal"
            } else {
                "all goals"
            },
            most.map_or(String::new(), Refused::in_words),
            most.map_or(0, |most| most.count),
        )
    }
}
