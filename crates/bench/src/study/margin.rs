//! The signed margin of a posture: what searches compare places and tools by.

use needlebench_cell::{ClearanceClass, ResolvedScenario};
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_evaluation::worst_miss_by_posture_m;
use needlebench_planning::{Member, Planner, Rule};
use needlebench_study::MetricColumn;

/// Name of its column.
pub const MARGIN_COLUMN: &str = "margin_mm";

/// What a configuration that does not work has at most, m: less than any figure is told apart by, but negative.
const NOT_WORKING_M: f64 = -1e-9;

/// Which classes of clearance count with all their room.
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
        let section = needlebench_cell::study::search::SearchSection::default();
        Self::of(|class| section.counts(class))
    }
}

/// What the column is.
pub fn margin_column() -> MetricColumn {
    MetricColumn {
        name: MARGIN_COLUMN.to_owned(),
        key: "margin".to_owned(),
        words: "margin".to_owned(),
        description: "room that the posture leaves, not negative where the configuration is ok and negative in every \
                      other row of a layout that can exist: the least of the clearances beyond what is judged of the \
                      classes that count, and of the distances from singularities; what does not count, and criteria on \
                      anything else, take part with what they are missed by. Out of reach: how far the arm falls short, \
                      negative. Sines and radians count 100 mm, mm"
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
