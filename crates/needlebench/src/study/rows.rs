//! From what a run reports of a configuration to a row of a study.

use std::borrow::Cow;

use needlebench_cell::ClearanceClass;
use needlebench_evaluation::NeedleMeasurement;
use needlebench_evaluation::report::{ClassClearance, ConfigurationReport};
use needlebench_kinematics::trajectory::Phase;
use needlebench_planning::{Candidate, ConfigurationPlan, Planner, Rule};
use needlebench_study::{Metric, Outcome, Row};

const MM: f64 = 1e3;
const UM: f64 = 1e6;

/// Columns of the final joint positions.
const JOINTS: [Metric; 6] = [
    Metric::Joint1,
    Metric::Joint2,
    Metric::Joint3,
    Metric::Joint4,
    Metric::Joint5,
    Metric::Joint6,
];

/// Columns of the classes of clearance.
const CLASSES: [(ClearanceClass, Metric); 9] = [
    (ClearanceClass::RobotPhantom, Metric::RobotPhantom),
    (ClearanceClass::RobotTable, Metric::RobotTable),
    (ClearanceClass::RobotGantry, Metric::RobotGantry),
    (ClearanceClass::RobotMount, Metric::RobotMount),
    (ClearanceClass::SelfCollision, Metric::SelfClearance),
    (ClearanceClass::ToolPhantom, Metric::ToolPhantom),
    (ClearanceClass::GuideStandoff, Metric::GuideStandoff),
    (ClearanceClass::NeedleCorridor, Metric::NeedleCorridor),
    (ClearanceClass::NeedleRoute, Metric::NeedleRoute),
];

/// Classes that count for `clearance_mm`.
const SURROUNDINGS: [ClearanceClass; 5] = [
    ClearanceClass::RobotPhantom,
    ClearanceClass::RobotTable,
    ClearanceClass::RobotGantry,
    ClearanceClass::RobotMount,
    ClearanceClass::ToolPhantom,
];

/// The rule that rejects a configuration: `joint_limit`, `collision robot_phantom`.
pub(super) fn broken_rule(plan: &ConfigurationPlan) -> Option<Cow<'static, str>> {
    let rejection = plan.rejections.first()?;
    let name = rejection.rule.name();
    Some(match (rejection.rule, rejection.class) {
        (Rule::Collision | Rule::NoMotion, Some(class)) => {
            format!("{name} {}", class.name()).into()
        }
        _ => name.into(),
    })
}

/// What posture and motion alone say of a configuration, and its clearances.
pub(super) fn row(
    planner: &Planner<'_>,
    plan: &ConfigurationPlan,
    report: &ConfigurationReport,
) -> Row {
    let index = u8::try_from(plan.configuration.index()).expect("there are eight");
    let mut row = Row::new(index, Outcome::Rejected, "");
    if let Some(candidate) = &plan.candidate {
        row.set(Metric::Roll, candidate.roll_rad.to_degrees());
        set_posture(&mut row, candidate);
        let surplus_m = planner.surplus(candidate, &plan.rejections);
        row.set(Metric::Surplus, surplus_m * MM);
    } else if let Some(rejection) = plan.rejections.first()
        && rejection.rule == Rule::Unreachable
    {
        // What it misses is how far the worst broken rule is broken.
        row.set(Metric::Surplus, -rejection.value * MM);
    }
    // m/rad are mm/mrad.
    set(
        &mut row,
        Metric::TipSensitivity,
        report.tip_sensitivity_m_per_rad,
    );
    let classes = &report.clearance.classes;
    for (class, metric) in CLASSES {
        let found = classes.get(class.name());
        set(&mut row, metric, found.map(|found| found.minimum_m * MM));
    }
    let surroundings = |value: fn(&ClassClearance) -> Option<f64>| {
        SURROUNDINGS
            .iter()
            .filter_map(|class| classes.get(class.name()))
            .map(value)
            .reduce(|least, next| Some(least?.min(next?)))
            .flatten()
    };
    let least_m = surroundings(|found| Some(found.minimum_m));
    set(&mut row, Metric::Clearance, least_m.map(|m| m * MM));
    let proven_m = surroundings(|found| found.certified_lower_bound_m);
    set(
        &mut row,
        Metric::CertifiedClearance,
        proven_m.map(|m| m * MM),
    );
    let budget = report.budget.as_ref();
    let rms_m = budget.map(|budget| budget.total.at_target.analytic.rms_m);
    set(&mut row, Metric::TipRms, rms_m.map(|m| m * MM));
    let arrival_s = plan.trajectory.as_ref().map(|trajectory| {
        let phases = trajectory.phases().into_iter();
        let moving = phases.filter(|(phase, _, _)| *phase != Phase::Hold);
        moving.map(|(_, _, end_s)| end_s).fold(0.0, f64::max)
    });
    set(&mut row, Metric::MotionTime, arrival_s);
    row
}

/// Where the joints are, and how far from their limits and singularities.
pub(super) fn set_posture(row: &mut Row, candidate: &Candidate) {
    for (metric, &position_rad) in JOINTS.into_iter().zip(&candidate.joints) {
        row.set(metric, position_rad.to_degrees());
    }
    let margins = &candidate.margins;
    row.set(Metric::JointMargin, margins.joint_limit);
    row.set(Metric::WristSine, margins.wrist_sine);
    row.set(Metric::ElbowSine, margins.elbow_sine);
    row.set(Metric::ShoulderMargin, margins.shoulder_m * MM);
    row.set(Metric::Manipulability, margins.manipulability);
}

/// Where the needle is.
pub(super) fn set_needle(row: &mut Row, needle: &NeedleMeasurement) {
    row.set(Metric::TipError, needle.tip_position_error_m * MM);
    row.set(Metric::TipLateral, needle.lateral_error_m * MM);
    row.set(Metric::TipAxial, needle.depth_error_m * MM);
    row.set(
        Metric::NeedleAngle,
        needle.needle_angle_error_rad.to_degrees(),
    );
}

/// What the engines measured.
///
/// The needle's errors are those of the engine with the larger tip error. Values over the engines
/// are their largest; a settling time is missing if it is missing in one of them.
pub(super) fn set_measured(row: &mut Row, report: &ConfigurationReport) {
    let engines = &report.engines;
    let worst = engines.values().max_by(|a, b| {
        let error_m = |needle: &NeedleMeasurement| needle.tip_position_error_m;
        error_m(&a.needle).total_cmp(&error_m(&b.needle))
    });
    if let Some(worst) = worst {
        set_needle(row, &worst.needle);
    }
    for (engine, metric) in [
        ("rapier", Metric::TipErrorRapier),
        ("mujoco", Metric::TipErrorMujoco),
    ] {
        let error_m = engines
            .get(engine)
            .map(|each| each.needle.tip_position_error_m);
        set(row, metric, error_m.map(|m| m * MM));
    }
    let difference = report.engine_difference;
    let peak_m = difference.map(|each| each.peak_tip_m);
    set(row, Metric::EnginePeakDifference, peak_m.map(|m| m * UM));
    let settled_m = difference.map(|each| each.settled_tip_m);
    set(
        row,
        Metric::EngineSettledDifference,
        settled_m.map(|m| m * UM),
    );
    let ratios = engines.values().map(|each| each.motion.peak_torque_ratio);
    set(row, Metric::PeakTorqueRatio, ratios.reduce(f64::max));
    let times_s = engines.values().map(|each| each.motion.settling_time_s);
    let last_s = times_s.reduce(|one, other| Some(one?.max(other?)));
    set(row, Metric::SettlingTime, last_s.flatten());
}

fn set(row: &mut Row, metric: Metric, value: Option<f64>) {
    row.set(metric, value.unwrap_or(f64::NAN));
}
