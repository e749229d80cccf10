//! Entries that scenarios leave open: the best proposal, or the planned route of a goal with `[goals.route]`.

use std::sync::atomic::AtomicBool;

use needlebench_cell::scenario::{GoalSection, RouteSection};
use needlebench_cell::{ChosenEntry, ResolvedScenario};

use crate::Control;
use crate::progress::Silent;
use crate::routes::{RoutePlan, RouteTask, SOLID_DIRECTIONS, WithRobot, plan_routes};
use crate::suggest::{SuggestError, suggest_entries};

/// Chooses the entry of a goal that has none. The choice does not depend on the number of threads.
///
/// # Errors
/// A message and a hint, where there is none.
pub fn choose_entry(
    resolved: &ResolvedScenario,
    section: &GoalSection,
) -> Result<ChosenEntry, [String; 2]> {
    let control = Control {
        threads: std::thread::available_parallelism().map_or(1, usize::from),
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    let chosen = match &section.route {
        Some(rules) => by_route(resolved, section, rules, &control),
        None => by_proposal(resolved, section, &control),
    };
    chosen.map_err(|error| match error {
        SuggestError::Interrupted => [error.to_string(), String::new()],
        SuggestError::Refused { message, hint } => [message, hint],
    })
}

/// The planned route.
fn by_route(
    resolved: &ResolvedScenario,
    section: &GoalSection,
    rules: &RouteSection,
    control: &Control<'_>,
) -> Result<ChosenEntry, SuggestError> {
    let task = RouteTask {
        resolved,
        section,
        rules,
        robot: WithRobot::Yes,
        directions: SOLID_DIRECTIONS,
    };
    let plan = plan_routes(&task, &task.solids()?, control)?;
    let Some(chosen) = &plan.chosen else {
        return Err(no_route(&plan));
    };
    let route = &plan.routes[chosen.route];
    let [azimuth, elevation] = route.direction_deg;
    let served = chosen.configuration.map_or_else(String::new, |label| {
        format!(", {} of 8 configurations, best {label}", route.working)
    });
    Ok(ChosenEntry {
        direction_deg: route.direction_deg,
        in_words: format!(
            "`entry_direction_deg = [{azimuth}, {elevation}]`, {:.0} mm deep, odds {:.2}{served}; `needlebench ct routes` \
             shows the others",
            route.depth_m * 1e3,
            route.risk.odds_ratio
        ),
    })
}

fn no_route(plan: &RoutePlan) -> SuggestError {
    let message = if plan.free == 0 {
        let most = plan.refused.iter().max_by_key(|each| each.count);
        format!(
            "goal `{}` has no route: none of {} directions is free, most often: {}",
            plan.goal,
            plan.tried,
            most.map_or("", |each| each.in_words)
        )
    } else {
        format!(
            "goal `{}` has no route that the robot serves: of {} that stand for the rest, none in {} of 8 configurations",
            plan.goal,
            plan.routes.len(),
            plan.wanted
        )
    };
    SuggestError::refused(
        message,
        "`needlebench ct routes` shows all that was tried, and what would free one",
    )
}

/// The first proposal.
fn by_proposal(
    resolved: &ResolvedScenario,
    section: &GoalSection,
    control: &Control<'_>,
) -> Result<ChosenEntry, SuggestError> {
    let found = suggest_entries(resolved, section, 1, control)?;
    let Some(entry) = found.entries.first() else {
        return Err(SuggestError::refused(
            format!(
                "goal `{}` has no entry, and none can be assumed: {}",
                found.goal,
                found.why_none()
            ),
            "`needlebench suggest` shows all that was tried; or give `entry_mm` or `entry_direction_deg`",
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
            "`entry_direction_deg = [{azimuth}, {elevation}]`, {:.0} mm deep{nearest}; the first of those that \
             `needlebench suggest` proposes",
            entry.depth_m * 1e3
        ),
    })
}
