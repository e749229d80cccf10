//! The constraint margin of a posture: searches compare base placements and tools by it.

use needlebench_cell::{ClearanceClass, Rule};
use needlebench_clearance::CUT_MARGIN_M;
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_evaluation::worst_miss_by_posture_m;
use needlebench_planning::{Member, Planner};
use needlebench_scenario::ResolvedScenario;
use needlebench_study::MetricColumn;

/// Name of its column.
pub const MARGIN_COLUMN: &str = "margin_mm";

/// Largest margin of an infeasible configuration, m: below the resolution of any value, but negative.
const NOT_WORKING_M: f64 = -1e-9;

/// The classes of clearance that count in margins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CountedClasses([bool; ClearanceClass::ALL.len()]);

impl CountedClasses {
    /// Those of which this says so.
    pub fn of(counts: impl Fn(ClearanceClass) -> bool) -> Self {
        Self(ClearanceClass::ALL.map(counts))
    }

    fn counts(self, class: ClearanceClass) -> bool {
        self.0[class as usize]
    }
}

impl Default for CountedClasses {
    /// Those of a search that names none.
    fn default() -> Self {
        let section = needlebench_scenario::study::search::SearchSection::default();
        Self::of(|class| section.counts(class))
    }
}

/// Description of the column.
pub fn margin_column() -> MetricColumn {
    MetricColumn {
        name: MARGIN_COLUMN.to_owned(),
        key: "margin".to_owned(),
        words: "margin".to_owned(),
        description: "constraint margin of the posture: non-negative if the configuration is feasible, negative in every \
                      other row of a valid layout; the least of the clearances of the counted classes beyond the \
                      required ones, and of the distances from singularities; other classes, and criteria on other \
                      quantities, contribute only the amount by which they fail. Out of reach: minus the missing \
                      distance. A sine of 1 and 1 rad count as 100 mm, mm"
            .to_owned(),
        unit: "mm".to_owned(),
        more_is_better: Some(true),
        spread: true,
        by_case: false,
        measure: None,
        criterion: None,
    }
}

/// The margin of a configuration's posture, m.
///
/// Of one that has no posture it is how far the arm falls short of the pose, negative: it grows as the goal
/// comes nearer. At the edge of reach the first posture that there is breaks the rules about singularities.
pub(super) fn margin_m(
    planner: &Planner<'_>,
    resolved: &ResolvedScenario,
    member: &Member,
    posture: &ConfigurationReport,
    counted: CountedClasses,
    is_ok: bool,
) -> f64 {
    let Some(candidate) = &member.candidate else {
        return member.surplus.min(NOT_WORKING_M);
    };
    let limits = planner.limits();
    let mut least = planner.surplus_of_joints(&candidate.margins, &member.rejections);
    for pair in candidate.clearance.iter() {
        let room = pair.separation.distance_m - limits.get(pair.class).judged_m;
        // What does not count takes part with what it is missed by alone.
        if counted.counts(pair.class) || room < 0.0 {
            least = least.min(room);
        }
    }
    for class in posture.unknown_clearances() {
        // By how much the body behind a cut would have to be farther for the clearance to be known.
        let known_m = posture.posture_clearance_m[class].max(0.0) + CUT_MARGIN_M;
        let behind_cuts_m = posture.posture_behind_cuts_m.get(class);
        least = least.min(behind_cuts_m.copied().unwrap_or_default() - known_m);
    }
    let class = ClearanceClass::NeedleRoute;
    let criteria = &resolved.scenario.criteria;
    let route = posture.posture_clearance_m.get(class.name());
    if let (true, Some(route_m), Some(limit_mm)) = (
        counted.counts(class),
        route,
        criteria.min_clearance_mm.least_mm(class),
    ) {
        least = least.min(route_m - limit_mm * 1e-3);
    }
    for rejection in &member.rejections {
        if rejection.rule == Rule::NeedleRoute {
            least = least.min(rejection.value - rejection.limit);
        }
    }
    if let Some(missed) = worst_miss_by_posture_m(posture, criteria) {
        least = least.min(missed);
    }
    if is_ok {
        least
    } else {
        least.min(NOT_WORKING_M)
    }
}
