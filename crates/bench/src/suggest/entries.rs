//! Where a needle may enter for a target.
//!
//! # How they are found
//!
//! 1. Directions from the target, 3 deg apart all round, are placed as a scenario with such a goal is: the needle has
//!    to be long enough, nothing may stand where guide and needle are, it may not enter at the ends of the chest, where
//!    the phantom lacks clavicles and vessels, nor be oblique to the skin by more than 60 deg, and has to keep its
//!    margins to bone, vessels and organs: straight, and as tissue bends it where the needle is known.
//! 2. Those that are left are ordered by score. From the best on, each is moved by up to 2 deg to where its score is
//!    best, and is looked at with the robot: as many configurations as the scenario wants are feasible, by the code of
//!    `check`. Entries nearer than 15 mm to a better one are left out, those near one where the robot fails too.
//! 3. What works is ordered by its score with the robot's term.

use std::f64::consts::FRAC_PI_3;

use nalgebra::Point3;
use needlebench_clearance::ClearanceModel;
use needlebench_parallel::{Control, in_parallel};
use needlebench_patient::routes::{RouteTask, WithRobot};
use needlebench_patient::{Refused, SuggestError, counted};
use needlebench_planning::{Planner, crossed_fissures, judged_straight};
use needlebench_routing::{Obstacle, Ray, RouteNeedle, SolidAnatomy};
use needlebench_scenario::scenario::{GoalSection, RouteSection};
use needlebench_scenario::{Goal, GoalPlacer, PlacedPhantom, ResolvedScenario, direction};
use needlebench_study::Outcome;
use serde::Serialize;

use super::grid::{around, directions};
use crate::preview::{ConfigurationPreview, goal_preview};
use crate::study::planned_rows;

/// Distance between proposed entries on the skin, m: entries nearer than that are the same to a hand.
const APART_M: f64 = 0.015;
/// Distance from an entry where the robot fails within which it is not asked again, m.
const FAILED_APART_M: f64 = 0.008;
/// Entries that are looked at together, whatever the number of threads.
const BATCH: usize = 8;
/// Most entries that the robot is checked for: where so many fail, the base placement is unsuitable.
const MOST_ASKED: usize = 64;
/// Part of the skin's normal along the body beyond which the skin is that of an end of the chest: neck, shoulders or
/// waist begin there, which the phantom does not have (assumed: 45 deg).
const END_Z: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Highest entry of a shipped chest, as a share of its half length: the second rib space is at 0.42 in front (README of
/// the phantoms), and above it clavicles and subclavian vessels, which they do not have, would be in the way (assumed).
const HIGHEST: f64 = 0.5;
/// Largest angle between needle and the skin's normal, rad: beyond it a needle slips along the skin (assumed).
const STEEPEST_RAD: f64 = FRAC_PI_3;

/// A term of the score: linear from utility 0 at `worst` to utility 1 at `best`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TermScale {
    name: &'static str,
    worst: f64,
    best: f64,
    weight: f64,
}

/// The terms of an entry's score, in SI: short, well clear of what it must not meet, square to the skin, across no
/// fissure, and within the robot's reach in many configurations. Values and weights are assumed.
const SCALES: [TermScale; 5] = [
    TermScale {
        name: "depth_m",
        worst: 0.140,
        best: 0.040,
        weight: 1.0,
    },
    TermScale {
        name: "margin_to_spare_m",
        worst: 0.0,
        best: 0.005,
        weight: 1.0,
    },
    TermScale {
        name: "angle_to_skin_normal_rad",
        worst: STEEPEST_RAD,
        best: 0.0,
        weight: 1.0,
    },
    TermScale {
        name: "fissures_crossed",
        worst: 1.0,
        best: 0.0,
        weight: 0.5,
    },
    TermScale {
        name: "working_configurations",
        worst: 0.0,
        best: 8.0,
        weight: 1.0,
    },
];

/// What the score is made of, for people.
pub const ENTRY_TERMS: &str = "score: 100 times the mean of depth (1 at 40 mm, 0 at 140), clearance in excess of the \
     required margins from bone, vessels and organs (1 at 5 mm), angle to the skin normal (1 at 0 \
     deg, 0 at 60), fissures crossed (half weight), and feasible configurations";

/// A term of one entry's score.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EntryTerm {
    /// What it is, with its unit.
    pub term: &'static str,
    /// Its value, SI.
    pub value: f64,
    /// From 0 to 1.
    pub utility: f64,
    /// Its weight.
    pub weight: f64,
}

/// Why a direction is no entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum EntryRule {
    /// The needle does not reach from the guide to the target.
    NeedleTooShort,
    /// Guide or entry collides, or the goal is invalid otherwise.
    Blocked,
    /// Near the neck, a shoulder or the waist, where the phantom lacks what a needle could meet.
    End,
    /// Too oblique to the skin.
    Oblique,
    /// Through bone or too near to it.
    Bone,
    /// Through a vessel or too near to it.
    Vessel,
    /// Through an organ or too near to it.
    Organ,
    /// Too near to one of them once tissue bends the needle.
    Bent,
    /// Too few configurations of the robot work there.
    Robot,
}

impl EntryRule {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::NeedleTooShort,
        Self::Blocked,
        Self::End,
        Self::Oblique,
        Self::Bone,
        Self::Vessel,
        Self::Organ,
        Self::Bent,
        Self::Robot,
    ];

    /// As JSON has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::NeedleTooShort => "needle_too_short",
            Self::Blocked => "blocked",
            Self::End => "end_of_chest",
            Self::Oblique => "oblique",
            Self::Bone => "bone",
            Self::Vessel => "vessel",
            Self::Organ => "organ",
            Self::Bent => "bent",
            Self::Robot => "robot",
        }
    }

    /// For people.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::NeedleTooShort => "needle too short",
            Self::Blocked => "guide collides with table or objects",
            Self::End => "at neck, shoulder or waist, where the phantom is incomplete",
            Self::Oblique => "more than 60 deg from the skin normal",
            Self::Bone => "bone on the path",
            Self::Vessel => "vessel on the path",
            Self::Organ => "another organ on the path",
            Self::Bent => "bent needle too close to bone, vessel or organ",
            Self::Robot => "infeasible for the robot",
        }
    }

    /// Of its name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }
}

/// A direction that was tried.
#[derive(Debug, Clone, PartialEq)]
pub struct EntrySample {
    /// Azimuth and elevation from the target, deg.
    pub direction_deg: [f64; 2],
    /// The first rule that refuses it; none if it is allowed.
    pub refused: Option<EntryRule>,
}

/// How far the needle keeps from a tissue.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TissueMargin {
    /// Bone, vessel or organ.
    pub tissue: String,
    /// What of it is nearest by its margin.
    pub part: String,
    /// Distance of the needle's surface, m.
    pub distance_m: f64,
    /// The required distance, m.
    pub margin_m: f64,
}

/// A needle as tissue bends it: to where its bevel pushes it, or to the worst of twelve sides where that is not known.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BentMargins {
    /// How far the tip is off the axis, m.
    pub bend_m: f64,
    /// Whether it is known to which side: only then does the bent needle have to keep the margins. A bend to any side is part
    /// of the error that they are for.
    pub is_side_known: bool,
    /// What the bent needle keeps from bone, vessels and organs.
    pub bent_margins: Vec<TissueMargin>,
}

/// A proposed entry.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entry {
    /// Lines for the goal in a scenario.
    pub toml: String,
    /// Azimuth and elevation from the target, deg: `entry_direction_deg`.
    pub direction_deg: [f64; 2],
    /// Where the needle enters the skin, phantom frame, m.
    pub entry_in_phantom_m: [f64; 3],
    /// From the skin to the target, m.
    pub depth_m: f64,
    /// Angle between the needle and the skin's normal, rad.
    pub angle_to_skin_normal_rad: f64,
    /// What the needle keeps from bone, vessels and organs.
    pub margins: Vec<TissueMargin>,
    /// How far tissue bends the median needle off its axis at the tip, and what it keeps then; none where no needle is
    /// known.
    #[serde(flatten)]
    pub bent: Option<BentMargins>,
    /// Fissures of the lungs that it crosses.
    pub fissures_crossed: Vec<String>,
    /// Configurations that are feasible there, by their final postures.
    pub working: usize,
    /// All eight: which are feasible, and why the others are not.
    pub configurations: Vec<ConfigurationPreview>,
    /// Configurations that also have a motion that meets the criteria, if motions were planned.
    pub working_planned: Option<usize>,
    /// From 0 to 1.
    pub score: f64,
    /// What it is made of.
    pub terms: Vec<EntryTerm>,
}

/// What was found for a target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EntrySearch {
    /// Name of the goal.
    pub goal: String,
    /// Lesion that is aimed at.
    pub lesion: Option<String>,
    /// The target, phantom frame, m.
    pub target_in_phantom_m: [f64; 3],
    /// What the judgement of robots rests on.
    pub basis: &'static str,
    /// Position of the robot's base that was asked, m.
    pub base_position_m: [f64; 3],
    /// Directions that were tried.
    pub tried: usize,
    /// Of these, with an admissible needle path.
    pub allowed: usize,
    /// Rules that rejected the others, the most frequent first.
    pub refused: Vec<Refused>,
    /// Admissible entries that the robot was checked for.
    pub asked: usize,
    /// Of these, those with too few feasible configurations, by the rule that rejects most of them.
    pub robot_refused: Vec<Refused>,
    /// Required number of feasible configurations.
    pub wanted: usize,
    /// The proposals, the best first.
    pub entries: Vec<Entry>,
    /// The direction with the best route, whether the robot reaches it or not.
    #[serde(skip)]
    pub best_route_deg: Option<[f64; 2]>,
    /// All that was tried.
    #[serde(skip)]
    pub samples: Vec<EntrySample>,
}

/// An allowed entry, before the robot is asked.
#[derive(Debug, Clone)]
struct Allowed {
    direction_deg: [f64; 2],
    goal: Goal,
    entry: Point3<f64>,
    angle_rad: f64,
    margins: Vec<TissueMargin>,
    bent: Option<BentMargins>,
    fissures: Vec<String>,
    score: f64,
}

/// Judges directions by their needles.
struct Judge<'a> {
    resolved: &'a ResolvedScenario,
    placed: &'a PlacedPhantom,
    placer: GoalPlacer<'a>,
    section: GoalSection,
    /// Phantom frame.
    target: Point3<f64>,
    /// For the needle as tissue bends it; none where no needle is known.
    bends: Option<(SolidAnatomy<'a>, RouteNeedle)>,
    /// What the scenario's criteria want of the route beside its margins, m.
    criterion_m: f64,
}

impl Judge<'_> {
    fn section_at(&self, direction_deg: [f64; 2]) -> GoalSection {
        GoalSection {
            entry_mm: None,
            entry_direction_deg: Some(direction_deg),
            ..self.section.clone()
        }
    }

    fn judge(&self, direction_deg: [f64; 2]) -> Result<Allowed, EntryRule> {
        let (resolved, placed) = (self.resolved, self.placed);
        let tool = &resolved.cell.tool;
        let [azimuth, elevation] = direction_deg.map(f64::to_radians);
        let outwards = direction(azimuth, elevation);
        let skin = placed.phantom.skin_intersection(&self.target, &outwards);
        let (_, depth_m) = skin.ok_or(EntryRule::Blocked)?;
        let skin = self.target + depth_m * outwards.into_inner();
        if !placed.phantom.is_skin_seen(&skin) {
            return Err(EntryRule::End);
        }
        let needed_m = tool.guide_length_m() + self.section.standoff_mm * 1e-3 + depth_m;
        if tool.needle.length_m < needed_m {
            return Err(EntryRule::NeedleTooShort);
        }
        let ray = Ray {
            target: self.target,
            outwards,
        };
        let goal = self.placer.place(&self.section_at(direction_deg));
        let goal = goal.map_err(|finding| {
            // A needle that is asked to be in tissue is placed nowhere behind bone.
            let is_of_needle = |key: &String| key.ends_with(".needle.model");
            if finding.key.as_ref().is_some_and(is_of_needle) {
                EntryRule::Bone
            } else {
                EntryRule::Blocked
            }
        })?;
        let to_phantom = placed.world_from_phantom.inverse();
        let entry = to_phantom * goal.entry_m.ok_or(EntryRule::Blocked)?;
        let inwards = to_phantom.rotation * goal.axis.into_inner();
        let normal = placed.phantom.skin_normal(&entry);
        let size = placed.phantom.parameters.as_ref();
        let highest_m = size.map_or(f64::INFINITY, |size| HIGHEST * 0.5e-3 * size.length_mm);
        if normal.z.abs() > END_Z || entry.z > highest_m {
            return Err(EntryRule::End);
        }
        let angle_rad = normal.angle(&-inwards);
        if angle_rad > STEEPEST_RAD {
            return Err(EntryRule::Oblique);
        }
        let margins: Vec<TissueMargin> = judged_straight(resolved, placed, &goal)
            .map(|judged| TissueMargin {
                tissue: judged.nearest.part.tissue.to_string(),
                part: judged.nearest.part.name.clone(),
                distance_m: judged.distance_m,
                margin_m: judged.margin_m.max(self.criterion_m),
            })
            .collect();
        if let Some(worst) = worst(&margins) {
            return Err(EntryRule::of_name(&worst.tissue).unwrap_or(EntryRule::Organ));
        }
        let bent = self.bent(&ray, depth_m, &margins)?;
        let mut allowed = Allowed {
            direction_deg,
            fissures: crossed_fissures(resolved, &goal),
            goal,
            entry,
            angle_rad,
            margins,
            bent,
            score: 0.0,
        };
        allowed.score = score(&terms(&allowed, self.depth_m(&allowed), None));
        Ok(allowed)
    }

    /// The needle as tissue bends it, by the margins of the straight one; none where no needle is known.
    fn bent(
        &self,
        ray: &Ray,
        depth_m: f64,
        margins: &[TissueMargin],
    ) -> Result<Option<BentMargins>, EntryRule> {
        let Some((anatomy, needle)) = &self.bends else {
            return Ok(None);
        };
        // Here needles are not thrown.
        let bend = needle.bend(anatomy, ray, depth_m, 0.0);
        let bend = bend.ok_or(EntryRule::Bent)?;
        let of_tissue = |straight: &TissueMargin| {
            let mut obstacles = Obstacle::ALL.into_iter();
            let obstacle = obstacles.find(|each| each.name() == straight.tissue)?;
            let nearest = bend.nearest(anatomy, ray, obstacle)?;
            Some(TissueMargin {
                part: nearest.name,
                distance_m: bend.distances_m[obstacle as usize],
                ..straight.clone()
            })
        };
        let bent_margins: Vec<TissueMargin> = margins.iter().filter_map(of_tissue).collect();
        let is_side_known = bend.towards.is_some();
        if is_side_known && worst(&bent_margins).is_some() {
            return Err(EntryRule::Bent);
        }
        Ok(Some(BentMargins {
            bend_m: bend.tip_m,
            is_side_known,
            bent_margins,
        }))
    }

    fn depth_m(&self, allowed: &Allowed) -> f64 {
        (self.target - allowed.entry).norm()
    }

    /// The best direction within a step of the grid.
    fn refined(&self, allowed: &Allowed) -> Allowed {
        around(allowed.direction_deg)
            .filter_map(|direction_deg| self.judge(direction_deg).ok())
            .fold(allowed.clone(), |best, each| {
                if each.score > best.score { each } else { best }
            })
    }
}

/// The margin with the largest shortfall.
fn worst(margins: &[TissueMargin]) -> Option<&TissueMargin> {
    let broken = margins
        .iter()
        .filter(|each| each.distance_m < each.margin_m);
    broken.min_by(|a, b| (a.distance_m - a.margin_m).total_cmp(&(b.distance_m - b.margin_m)))
}

fn terms(allowed: &Allowed, depth_m: f64, working: Option<usize>) -> Vec<EntryTerm> {
    let known = allowed.bent.iter().filter(|bent| bent.is_side_known);
    let bent = known.flat_map(|bent| &bent.bent_margins);
    let spare_m = allowed
        .margins
        .iter()
        .chain(bent)
        .map(|each| each.distance_m - each.margin_m)
        .fold(f64::INFINITY, f64::min);
    // Where there is nothing to keep away from there is all the room that counts.
    let spare_m = if spare_m.is_finite() {
        spare_m
    } else {
        SCALES[1].best
    };
    let values = [
        Some(depth_m),
        Some(spare_m),
        Some(allowed.angle_rad),
        Some(if allowed.fissures.is_empty() {
            0.0
        } else {
            1.0
        }),
        working.map(|count| count as f64),
    ];
    let known = SCALES.iter().zip(values);
    known
        .filter_map(|(scale, value)| {
            let value = value?;
            Some(EntryTerm {
                term: scale.name,
                value,
                utility: ((value - scale.worst) / (scale.best - scale.worst)).clamp(0.0, 1.0),
                weight: scale.weight,
            })
        })
        .collect()
}

fn score(terms: &[EntryTerm]) -> f64 {
    let weight: f64 = terms.iter().map(|term| term.weight).sum();
    let sum: f64 = terms.iter().map(|term| term.weight * term.utility).sum();
    sum / weight
}

/// Proposes up to `count` entries for a goal's target in a scenario's cell; an entry that it has does not count, nor
/// what it expects. The same for any number of threads.
///
/// # Errors
/// If there is no patient, the target is none, or it was interrupted.
pub fn suggest_entries(
    resolved: &ResolvedScenario,
    section: &GoalSection,
    count: usize,
    control: &Control<'_>,
) -> Result<EntrySearch, SuggestError> {
    let criteria = &resolved.scenario.criteria;
    let mut section = section.clone();
    section.expected.clear();
    let placer = GoalPlacer::new(resolved);
    let target = placer.target(&section)?;
    let placed = resolved.phantom.as_ref().expect("a target is in a patient");
    let by_routes = RouteTask {
        resolved,
        section: &section,
        rules: &RouteSection::default(),
        robot: WithRobot::No(String::new()),
        directions: 0,
    };
    let route = &resolved.scenario.planning.needle_route;
    let anatomy = || SolidAnatomy::new(&placed.phantom, target, section.lesion.is_some(), route);
    let needle = by_routes.route_rules().needle;
    let bends = needle.map(|needle| (anatomy(), needle));
    let judge = Judge {
        bends,
        resolved,
        placed,
        placer,
        section,
        target,
        criterion_m: criteria.min_clearance_mm.needle_route.unwrap_or(0.0) * 1e-3,
    };
    let tried = directions();
    control.progress.message("routes");
    let judged = in_parallel(control.threads, &tried, |direction_deg| {
        if control.is_cancelled() {
            Err(EntryRule::Blocked)
        } else {
            judge.judge(*direction_deg)
        }
    });
    if control.is_cancelled() {
        return Err(SuggestError::Interrupted);
    }
    let mut samples: Vec<EntrySample> = tried
        .iter()
        .zip(&judged)
        .map(|(direction_deg, judged)| EntrySample {
            direction_deg: *direction_deg,
            refused: judged.as_ref().err().copied(),
        })
        .collect();
    let mut allowed: Vec<Allowed> = judged.into_iter().flatten().collect();
    allowed.sort_by(|a, b| b.score.total_cmp(&a.score));
    let wanted = (criteria.min_working_configurations as usize).max(1);
    let asked = ask_robot(&judge, &allowed, count, wanted, control)?;
    for (direction_deg, rule) in asked.failed() {
        let sample = samples
            .iter_mut()
            .find(|sample| sample.direction_deg == direction_deg);
        if let Some(sample) = sample {
            sample.refused = Some(rule);
        }
    }
    let refused = counted(
        samples
            .iter()
            .filter_map(|sample| sample.refused)
            .filter(|rule| *rule != EntryRule::Robot)
            .map(EntryRule::name),
    );
    Ok(EntrySearch {
        goal: judge.section.name.clone(),
        lesion: judge.section.lesion.clone(),
        target_in_phantom_m: target.coords.into(),
        basis: crate::preview::BASIS,
        base_position_m: resolved
            .cell
            .robot
            .world_from_base_link
            .translation
            .vector
            .into(),
        tried: tried.len(),
        allowed: allowed.len(),
        refused,
        asked: asked.answers.len(),
        robot_refused: counted(
            asked
                .answers
                .iter()
                .filter_map(|answer| answer.broken.as_deref()),
        ),
        wanted,
        best_route_deg: asked
            .answers
            .first()
            .map(|answer| answer.allowed.direction_deg),
        entries: asked.entries(&judge, count),
        samples,
    })
}

/// What the robot makes of an allowed entry.
struct Answer {
    /// On the grid, before it was moved.
    grid_deg: [f64; 2],
    allowed: Allowed,
    configurations: Vec<ConfigurationPreview>,
    working: usize,
    /// The rule that rejects most configurations, if too few work.
    broken: Option<String>,
}

struct Asked {
    answers: Vec<Answer>,
}

impl Asked {
    fn failed(&self) -> impl Iterator<Item = ([f64; 2], EntryRule)> {
        let failed = self.answers.iter().filter(|answer| answer.broken.is_some());
        failed.map(|answer| (answer.grid_deg, EntryRule::Robot))
    }

    fn entries(self, judge: &Judge<'_>, count: usize) -> Vec<Entry> {
        let works = self
            .answers
            .into_iter()
            .filter(|answer| answer.broken.is_none());
        let mut entries: Vec<Entry> = works
            .map(|answer| {
                let Answer {
                    allowed,
                    configurations,
                    working,
                    ..
                } = answer;
                let depth_m = judge.depth_m(&allowed);
                let terms = terms(&allowed, depth_m, Some(working));
                let [azimuth, elevation] = allowed.direction_deg;
                let mm = allowed.entry.coords * 1e3;
                Entry {
                    toml: format!(
                        "entry_direction_deg = [{azimuth}, {elevation}] # enters at [{:.1}, {:.1}, {:.1}] mm, {:.0} mm deep",
                        mm.x,
                        mm.y,
                        mm.z,
                        depth_m * 1e3
                    ),
                    direction_deg: allowed.direction_deg,
                    entry_in_phantom_m: allowed.entry.coords.into(),
                    depth_m,
                    angle_to_skin_normal_rad: allowed.angle_rad,
                    margins: allowed.margins,
                    bent: allowed.bent,
                    fissures_crossed: allowed.fissures,
                    working,
                    configurations,
                    working_planned: None,
                    score: score(&terms),
                    terms,
                }
            })
            .collect();
        // The sort is stable: equals stay in the order of their routes.
        entries.sort_by(|a, b| b.score.total_cmp(&a.score));
        entries.truncate(count);
        entries
    }
}

/// Checks the robot for the best entries, until as many as required are feasible or it has failed often.
fn ask_robot(
    judge: &Judge<'_>,
    allowed: &[Allowed],
    count: usize,
    wanted: usize,
    control: &Control<'_>,
) -> Result<Asked, SuggestError> {
    let resolved = judge.resolved;
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model)
        .map_err(|error| SuggestError::refused(error.to_string(), "only UR arms can be checked"))?;
    control.progress.message("configurations");
    let mut answers: Vec<Answer> = Vec::new();
    let mut next = 0;
    let is_free = |entry: &Point3<f64>, answers: &[Answer]| {
        answers.iter().all(|answer| {
            let apart_m = if answer.broken.is_none() {
                APART_M
            } else {
                FAILED_APART_M
            };
            (entry - answer.allowed.entry).norm() >= apart_m
        })
    };
    while answers
        .iter()
        .filter(|answer| answer.broken.is_none())
        .count()
        < count
        && answers.len() < MOST_ASKED
    {
        let mut batch: Vec<([f64; 2], Allowed)> = Vec::new();
        while batch.len() < BATCH && next < allowed.len() {
            let candidate = &allowed[next];
            next += 1;
            let apart = |entry: &Point3<f64>| {
                is_free(entry, &answers)
                    && batch
                        .iter()
                        .all(|(_, each)| (entry - each.entry).norm() >= APART_M)
            };
            if !apart(&candidate.entry) {
                continue;
            }
            let refined = judge.refined(candidate);
            let chosen = if apart(&refined.entry) {
                refined
            } else {
                candidate.clone()
            };
            batch.push((candidate.direction_deg, chosen));
        }
        if batch.is_empty() {
            break;
        }
        control.progress.expect(batch.len() as u64);
        let previews = in_parallel(control.threads, &batch, |(_, allowed)| {
            let found =
                (!control.is_cancelled()).then(|| goal_preview(&planner, resolved, &allowed.goal));
            control.progress.step();
            found
        });
        for ((grid_deg, allowed), preview) in batch.into_iter().zip(previews) {
            let preview = preview.ok_or(SuggestError::Interrupted)?;
            let broken = (preview.working < wanted).then(|| {
                let rules = preview.configurations.iter().filter(|each| !each.works);
                let first = counted(rules.map(ConfigurationPreview::reason));
                first
                    .first()
                    .map_or_else(String::new, |first| first.rule.clone())
            });
            answers.push(Answer {
                grid_deg,
                allowed,
                working: preview.working,
                configurations: preview.configurations,
                broken,
            });
        }
    }
    Ok(Asked { answers })
}

/// Plans the motions to an entry of a goal, and says for how many configurations there is one.
///
/// # Errors
/// If the goal cannot be planned at all.
pub fn plan_entry(
    resolved: &ResolvedScenario,
    section: &GoalSection,
    entry: &mut Entry,
) -> Result<(), SuggestError> {
    let section = GoalSection {
        entry_mm: None,
        entry_direction_deg: Some(entry.direction_deg),
        ..section.clone()
    };
    let goal = GoalPlacer::new(resolved).place(&section)?;
    let mut with_goal = resolved.clone();
    with_goal.goals = vec![goal];
    with_goal.scenario.goals = vec![section];
    let rows = planned_rows(&with_goal)
        .map_err(|failure| SuggestError::refused(failure.to_string(), String::new()))?;
    let works = rows.iter().filter(|row| row.outcome == Outcome::Ok);
    entry.working_planned = Some(works.count());
    Ok(())
}

impl EntrySearch {
    /// Why nothing is proposed.
    pub fn why_none(&self) -> String {
        if self.allowed == 0 {
            let most = self.refused.first();
            let rule = most.and_then(|most| EntryRule::of_name(&most.rule));
            return format!(
                "none of {} directions has an admissible needle path; most frequent reason: {} \
                 ({})",
                self.tried,
                rule.map_or("", EntryRule::in_words),
                most.map_or(0, |most| most.count),
            );
        }
        let most = self.robot_refused.first();
        format!(
            "{} of {} needle paths are admissible, but of the {} best distinct ones none is \
             feasible in {} of 8 configurations; most frequent reason: {}",
            self.allowed,
            self.tried,
            self.asked,
            self.wanted,
            most.map_or("", |most| most.rule.as_str()),
        )
    }
}
