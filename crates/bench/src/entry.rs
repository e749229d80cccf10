//! Entries that scenarios leave open: the best proposal, or the planned route of a goal with `[goals.route]`.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Point3;
use needlebench_parallel::{Control, Silent};
use needlebench_patient::SuggestError;
use needlebench_patient::routes::{
    FreeRoutes, RouteTask, SOLID_DIRECTIONS, WithRobot, free_routes,
};
use needlebench_phantom::Phantom;
use needlebench_routing::RouteRules;
use needlebench_scenario::scenario::{GoalSection, NeedleRouteSection, RouteSection};
use needlebench_scenario::{ChooseEntry, ChosenEntry, GoalPlacer, NoEntry, ResolvedScenario};

use crate::suggest::suggest_entries;

/// Patients whose admissible needle paths are kept: as many as six sizes of chest with four lesions, and some more.
const MOST_KEPT: usize = 32;

/// Finds entries. The needle paths that the patient alone admits are kept: they do not depend on where the patient
/// lies.
#[derive(Debug, Default)]
pub struct EntryFinder {
    kept: Mutex<Vec<Kept>>,
}

/// Admissible paths, once they were searched for. The searching thread holds the lock, so that no other does the same.
type Slot = Arc<Mutex<Option<Arc<FreeRoutes>>>>;

/// Admissible needle paths, and all that they depend on.
#[derive(Debug)]
struct Kept {
    patient: Patient,
    free: Slot,
}

#[derive(Debug)]
struct Patient {
    phantom: Arc<Phantom>,
    target: Point3<f64>,
    has_lesion: bool,
    run: NeedleRouteSection,
    rules: RouteRules,
}

impl PartialEq for Patient {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.phantom, &other.phantom)
            && self.target == other.target
            && self.has_lesion == other.has_lesion
            && self.run == other.run
            && self.rules == other.rules
    }
}

impl ChooseEntry for EntryFinder {
    fn choose(&self, cell: &ResolvedScenario, goal: &GoalSection) -> Result<ChosenEntry, NoEntry> {
        let control = Control {
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            cancel: &AtomicBool::new(false),
            progress: &Silent,
        };
        match &goal.route {
            Some(rules) => self.by_route(cell, goal, rules, &control),
            None => by_proposal(cell, goal, &control),
        }
    }
}

impl EntryFinder {
    /// The planned route.
    fn by_route(
        &self,
        resolved: &ResolvedScenario,
        section: &GoalSection,
        rules: &RouteSection,
        control: &Control<'_>,
    ) -> Result<ChosenEntry, NoEntry> {
        let task = RouteTask {
            resolved,
            section,
            rules,
            robot: WithRobot::Yes,
            directions: SOLID_DIRECTIONS,
        };
        let free = self.free(&task, control)?;
        let Some(route) = free.best_served(&task, control)? else {
            return Err(nothing_serves(
                free.why_none(&task),
                "`needlebench ct routes` lists all paths tried, and changes that make one feasible",
            ));
        };
        let [azimuth, elevation] = route.direction_deg;
        Ok(ChosenEntry {
            direction_deg: route.direction_deg,
            in_words: format!(
                "`entry_direction_deg = [{azimuth}, {elevation}]`, {:.0} mm deep, odds {:.2}, \
                 feasible in {} of 8 configurations, best posture {}; `needlebench ct routes` \
                 lists the others",
                route.depth_m * 1e3,
                route.odds_ratio,
                route.working,
                route.best
            ),
        })
    }

    /// Paths admissible for the patient alone, searched for once.
    fn free(
        &self,
        task: &RouteTask<'_>,
        control: &Control<'_>,
    ) -> Result<Arc<FreeRoutes>, SuggestError> {
        let slot = self.slot(Patient {
            phantom: Arc::clone(task.phantom()?),
            target: GoalPlacer::new(task.resolved).target(task.section)?,
            has_lesion: task.section.lesion.is_some(),
            run: task.resolved.scenario.planning.needle_route.clone(),
            rules: task.route_rules(),
        });
        let mut known = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(free) = &*known {
            return Ok(Arc::clone(free));
        }
        let free = Arc::new(free_routes(task, &task.solids()?, control)?);
        *known = Some(Arc::clone(&free));
        Ok(free)
    }

    /// Where the admissible paths of a patient are kept; the oldest are dropped.
    fn slot(&self, patient: Patient) -> Slot {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = kept.iter().find(|each| each.patient == patient) {
            return Arc::clone(&known.free);
        }
        if kept.len() >= MOST_KEPT {
            kept.remove(0);
        }
        let free = Slot::default();
        kept.push(Kept {
            patient,
            free: Arc::clone(&free),
        });
        free
    }
}

fn nothing_serves(message: String, hint: &str) -> NoEntry {
    NoEntry {
        message,
        hint: hint.to_owned(),
        nothing_serves: true,
    }
}

/// The first proposal.
fn by_proposal(
    resolved: &ResolvedScenario,
    section: &GoalSection,
    control: &Control<'_>,
) -> Result<ChosenEntry, NoEntry> {
    let found = suggest_entries(resolved, section, 1, control)?;
    let Some(entry) = found.entries.first() else {
        return Err(nothing_serves(
            format!(
                "goal `{}` has no entry, and none can be assumed: {}",
                found.goal,
                found.why_none()
            ),
            "`needlebench suggest` lists all entries tried; or give `entry_mm` or \
             `entry_direction_deg`",
        ));
    };
    let nearest = entry
        .margins
        .iter()
        .min_by(|a, b| (a.distance_m - a.margin_m).total_cmp(&(b.distance_m - b.margin_m)));
    let nearest = nearest.map_or(String::new(), |each| {
        format!(
            ", {:.1} mm from {} ({})",
            each.distance_m * 1e3,
            each.part,
            each.tissue
        )
    });
    let [azimuth, elevation] = entry.direction_deg;
    Ok(ChosenEntry {
        direction_deg: entry.direction_deg,
        in_words: format!(
            "`entry_direction_deg = [{azimuth}, {elevation}]`, {:.0} mm deep{nearest}; first \
             proposal of `needlebench suggest`",
            entry.depth_m * 1e3
        ),
    })
}
