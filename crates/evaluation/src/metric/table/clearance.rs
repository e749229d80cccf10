//! Clearances: the minimum over some classes, and of each class.

#![expect(
    clippy::large_types_passed_by_value,
    reason = "entries are made at compile time"
)]

use needlebench_cell::ClearanceClass;
use needlebench_scenario::study::StudyMode::{self, Dynamic, Planned, Static};

use super::{ALL, CLEARANCE_RESOLUTION_M, MM, MOVING};
use crate::metric::entry::Better::More;
use crate::metric::entry::Bound::{Attained, Certified};
use crate::metric::entry::Draw::{Nominal, ThisDraw};
use crate::metric::entry::Precision::{Coarse, Fine};
use crate::metric::entry::Source::Configuration;
use crate::metric::entry::Stage::{FinalPosture, PlannedMotion, Simulated};
use crate::metric::entry::{Metric, Missing, Role, Statistics};
use crate::metric::quantity::Quantity::Length;
use crate::metric::readers::{
    Motion, attained, certified, nearest, of_posture, surroundings, unwanted,
};

/// One clearance as it is known in five ways: of the final posture, or of a static case's; along the planned motion as
/// the nearest approach and as a certified bound; and along the simulated one likewise. `$with` adds what is the
/// family's own.
macro_rules! clearance {
    ($stem:literal, $words:literal, $definition:literal, $classes:expr, $with:ident) => {
        &[
            $with(
                Metric::new(
                    concat!($stem, "_posture"),
                    concat!($words, ", final posture"),
                    $definition,
                    Length,
                    Configuration(|each| of_posture(each, $classes)),
                )
                .known(Attained, Nominal, FinalPosture)
                .in_static_cases(concat!($stem, "_static"))
                .family($stem)
                .better(More, CLEARANCE_RESOLUTION_M),
            ),
            $with(
                Metric::new(
                    concat!($stem, "_planned_attained"),
                    concat!($words, ", attained in the plan"),
                    $definition,
                    Length,
                    Configuration(|each| attained(each, $classes, Motion::Planned)),
                )
                .known(Attained, Nominal, PlannedMotion)
                .only_in(&[Planned])
                .family($stem)
                .better(More, CLEARANCE_RESOLUTION_M),
            ),
            $with(
                Metric::new(
                    concat!($stem, "_planned"),
                    concat!($words, ", certified in the plan"),
                    $definition,
                    Length,
                    Configuration(|each| certified(each, $classes, Motion::Planned)),
                )
                .known(Certified, Nominal, PlannedMotion)
                .only_in(&[Planned])
                .family($stem)
                .better(More, CLEARANCE_RESOLUTION_M),
            ),
            $with(
                Metric::new(
                    concat!($stem, "_attained"),
                    concat!($words, ", attained"),
                    $definition,
                    Length,
                    Configuration(|each| attained(each, $classes, Motion::Simulated)),
                )
                .known(Attained, ThisDraw, Simulated)
                .family($stem)
                .better(More, CLEARANCE_RESOLUTION_M),
            ),
            $with(
                Metric::new(
                    $stem,
                    $words,
                    $definition,
                    Length,
                    Configuration(|each| certified(each, $classes, Motion::Simulated)),
                )
                .known(Certified, ThisDraw, Simulated)
                .better(More, CLEARANCE_RESOLUTION_M),
            ),
        ]
    };
}

/// One class of clearance, with its criterion. `$with` adds what is the class's own.
macro_rules! clearance_of_class {
    (
        $class:ident, $stem:literal, $words:literal, $definition:literal,
        $criterion:literal, $limit:ident, $with:ident
    ) => {{
        const CLASS: ClearanceClass = ClearanceClass::$class;
        const fn judged(metric: Metric) -> Metric {
            let modes: &[StudyMode] = match metric.stage {
                FinalPosture => &[Static],
                PlannedMotion => MOVING,
                Simulated => &[Dynamic],
            };
            $with(
                metric
                    .criterion($criterion, modes, |criteria| {
                        criteria.min_clearance_mm.$limit.map(|mm| mm * MM)
                    })
                    // A class that the cell has no part for cannot be violated.
                    .missing(Missing::Skips)
                    .detail(|each, _, _| nearest(each, CLASS)),
            )
        }
        clearance!($stem, $words, $definition, std::iter::once(CLASS), judged)
    }};
}

/// Headings on the nearest approach of the simulated motion.
const fn headed(
    metric: Metric,
    table: Option<(u8, &'static str)>,
    page: (u8, &'static str),
) -> Metric {
    match (metric.bound, metric.stage) {
        (Attained, Simulated) => {
            let metric = metric.page(page.0, page.1);
            match table {
                Some((place, heading)) => metric.table(place, heading),
                None => metric,
            }
        }
        _ => metric,
    }
}

/// Heading in the table of a case, on what is attained: of the simulated motion, else the planned one,
/// else the posture.
const fn in_case(metric: Metric, place: u8, heading: &'static str) -> Metric {
    match metric.bound {
        Attained => metric.case(place, heading),
        _ => metric,
    }
}

/// What ranks by the simulated motion: its certified bound, or its nearest approach where nothing is
/// proven.
const fn ranked(metric: Metric, key: &'static str) -> Metric {
    match metric.stage {
        Simulated => metric.ranked(key).pareto(),
        _ => metric,
    }
}

pub(super) const CLEARANCE: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        let nearest = Statistics::BY_CASE
            .role(Role::Clearance)
            .criterion("min_clearance_mm")
            .page(Fine);
        let proven = Statistics::BY_CASE
            .criterion("min_certified_clearance_mm")
            .page(Coarse);
        let metric = match (metric.bound, metric.stage) {
            (_, FinalPosture) => metric.static_statistics(nearest),
            (Certified, _) => metric.statistics(proven),
            _ => metric.statistics(nearest),
        };
        let metric = match (metric.bound, metric.stage) {
            (Attained, Simulated) => metric
                .table(9, "clearance\n(mm)")
                .summary(2, "Clearance (mm)")
                .page_side(1, "Clearance"),
            (Certified, Simulated) => metric.page(12, "Certified clearance"),
            _ => metric,
        };
        ranked(in_case(metric, 0, "clearance\nmm"), "clearance_mm")
    }
    clearance!(
        "clearance",
        "clearance",
        "minimum clearance of arm and tool from phantom, table, gantry, mount and obstacles, \
         without guide stand-off and self-clearance",
        surroundings(),
        with
    )
};

pub(super) const LEAST_CLEARANCE: &[Metric] = {
    // The arm's own links are close to each other by design: no table leads with that.
    const fn with(metric: Metric) -> Metric {
        metric
    }
    clearance!(
        "least_clearance",
        "minimum clearance",
        "minimum clearance of all bodies, including self-clearance, without guide stand-off",
        unwanted(),
        with
    )
};

pub(super) const ARM_TO_SKIN: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, Some((5, "arm to\nskin (mm)")), (3, "Arm to skin"))
    }
    clearance_of_class!(
        RobotPhantom,
        "arm_to_skin",
        "arm to skin",
        "clearance of the arm from the skin",
        "min_clearance_mm.robot_phantom",
        robot_phantom,
        with
    )
};

pub(super) const TO_TABLE: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, None, (4, "To table"))
    }
    clearance_of_class!(
        RobotTable,
        "to_table",
        "arm and tool to table",
        "clearance of arm and tool from the table",
        "min_clearance_mm.robot_table",
        robot_table,
        with
    )
};

pub(super) const TO_GANTRY: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, None, (5, "To gantry"))
    }
    clearance_of_class!(
        RobotGantry,
        "to_gantry",
        "arm and tool to gantry",
        "clearance of arm and tool from the gantry",
        "min_clearance_mm.robot_gantry",
        robot_gantry,
        with
    )
};

pub(super) const TO_MOUNT: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, None, (6, "To mount"))
    }
    clearance_of_class!(
        RobotMount,
        "to_mount",
        "arm and tool to mount",
        "clearance of arm and tool from the mount",
        "min_clearance_mm.robot_mount",
        robot_mount,
        with
    )
};

pub(super) const TO_OBSTACLES: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, None, (6, "To obstacles"))
    }
    clearance_of_class!(
        RobotObstacle,
        "to_obstacles",
        "arm and tool to obstacles",
        "clearance of arm and tool from the obstacles",
        "min_clearance_mm.robot_obstacle",
        robot_obstacle,
        with
    )
};

pub(super) const TO_PEOPLE: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, None, (6, "To people"))
    }
    clearance_of_class!(
        RobotPerson,
        "to_people",
        "arm and tool to people",
        "clearance of arm and tool from the people in the room",
        "min_clearance_mm.robot_person",
        robot_person,
        with
    )
};

pub(super) const SELF_CLEARANCE: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        let nearest = Statistics::BY_CASE.criterion("min_self_mm").page(Coarse);
        let metric = match (metric.bound, metric.stage) {
            (_, FinalPosture) => metric.static_statistics(nearest),
            (Certified, _) => metric.statistics(Statistics::SPREAD),
            _ => metric.statistics(nearest),
        };
        let metric = headed(
            metric,
            Some((8, "self-clearance\n(mm)")),
            (7, "Self-clearance"),
        );
        ranked(in_case(metric, 1, "self\nmm"), "self_clearance_mm")
    }
    clearance_of_class!(
        SelfCollision,
        "self_clearance",
        "self-clearance",
        "clearance between the links of arm and tool",
        "min_clearance_mm.self",
        self_collision,
        with
    )
};

pub(super) const TOOL_TO_SKIN: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, Some((6, "tool to\nskin (mm)")), (8, "Tool to skin"))
    }
    clearance_of_class!(
        ToolPhantom,
        "tool_to_skin",
        "tool to skin",
        "clearance of the tool, without its guide tube, from the skin",
        "min_clearance_mm.tool_phantom",
        tool_phantom,
        with
    )
};

pub(super) const GUIDE_TO_SKIN: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        headed(metric, None, (9, "Guide to skin"))
    }
    clearance_of_class!(
        GuideStandoff,
        "guide_to_skin",
        "guide to skin",
        "clearance of the guide tube from the skin",
        "min_clearance_mm.guide_standoff",
        guide_standoff,
        with
    )
};

pub(super) const NEEDLE_CORRIDOR: &[Metric] = {
    const fn with(metric: Metric) -> Metric {
        let metric = headed(
            metric,
            Some((7, "access\nclearance (mm)")),
            (10, "Access clearance"),
        );
        let metric = match (metric.bound, metric.stage) {
            (Attained, Simulated) => metric.summary(4, "Access clearance (mm)"),
            _ => metric,
        };
        ranked(in_case(metric, 2, "access\nmm"), "needle_corridor_mm")
    }
    clearance_of_class!(
        NeedleCorridor,
        "needle_corridor",
        "access clearance",
        "clearance of the access zone behind the guide, which needle and hand require, during the \
         hold",
        "min_clearance_mm.needle_corridor",
        needle_corridor,
        with
    )
};

/// Margins of the planned motion, of those that its posture allows, and the clearance of the retreat.
pub(super) const MARGIN: &[Metric] = &[
    Metric::new(
        "margin_attainable",
        "attainable margin",
        "minimum clearance from phantom, table, gantry, mount and obstacles in excess of the \
         required one, over the postures common to all motions: start, approach and its end",
        Length,
        Configuration(|each| each.margin.as_ref()?.attainable_m),
    )
    .known(Certified, Nominal, PlannedMotion)
    .better(More, CLEARANCE_RESOLUTION_M),
    Metric::new(
        "margin_planned",
        "achieved margin",
        "minimum clearance from phantom, table, gantry, mount and obstacles in excess of the \
         required one, over the planned motion",
        Length,
        Configuration(|each| each.margin.as_ref()?.achieved_m),
    )
    .known(Certified, Nominal, PlannedMotion)
    .better(More, CLEARANCE_RESOLUTION_M),
    Metric::new(
        "clearance_retreat",
        "clearance, retreat",
        "minimum clearance of arm and tool from phantom, table, gantry, mount and obstacles during \
         the retreat",
        Length,
        Configuration(|each| {
            let classes = &each.retreat_clearance.classes;
            surroundings()
                .filter_map(|class| classes.get(class.name())?.certified_lower_bound_m)
                .reduce(f64::min)
        }),
    )
    .known(Certified, Nominal, PlannedMotion)
    .better(More, CLEARANCE_RESOLUTION_M),
];

/// The same for all configurations, whatever the motion.
pub(super) const NEEDLE_ROUTE: &[Metric] = &[Metric::new(
    "needle_route",
    "needle to bone, vessel, organ",
    "clearance of the planned needle from bone, vessel and organ",
    Length,
    Configuration(|each| of_posture(each, std::iter::once(ClearanceClass::NeedleRoute))),
)
.in_static_cases("needle_route")
.better(More, CLEARANCE_RESOLUTION_M)
.page(11, "Needle path")
.criterion("min_clearance_mm.needle_route", ALL, |criteria| {
    criteria.min_clearance_mm.needle_route.map(|mm| mm * MM)
})
.missing(Missing::Skips)
.detail(|each, _, _| nearest(each, ClearanceClass::NeedleRoute))];
