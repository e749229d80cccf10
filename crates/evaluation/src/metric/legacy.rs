//! What older versions called their numbers.
//!
//! Frozen: versions that wrote `configurations[].metrics` in reports, and keys in tables of studies,
//! need nothing of this.

use std::collections::BTreeMap;

use needlebench_cell::ClearanceClass;
use needlebench_cell::study::StudyMode;
use serde_json::Value;

/// Family of a class's clearance.
fn stem(class: ClearanceClass) -> &'static str {
    match class {
        ClearanceClass::RobotPhantom => "arm_to_skin",
        ClearanceClass::RobotTable => "to_table",
        ClearanceClass::RobotGantry => "to_gantry",
        ClearanceClass::RobotMount => "to_mount",
        ClearanceClass::RobotObstacle => "to_obstacles",
        ClearanceClass::SelfCollision => "self_clearance",
        ClearanceClass::ToolPhantom => "tool_to_skin",
        ClearanceClass::GuideStandoff => "guide_to_skin",
        ClearanceClass::NeedleCorridor => "needle_corridor",
        ClearanceClass::NeedleRoute => "needle_route",
    }
}

/// Numbers of a configuration and where they stand.
const NUMBERS: [(&str, &str); 21] = [
    ("roll", "/roll_rad"),
    ("q1", "/joints_rad/0"),
    ("q2", "/joints_rad/1"),
    ("q3", "/joints_rad/2"),
    ("q4", "/joints_rad/3"),
    ("q5", "/joints_rad/4"),
    ("q6", "/joints_rad/5"),
    ("joint_margin", "/margins/joint_limit"),
    ("wrist_sine", "/margins/wrist_sine"),
    ("elbow_sine", "/margins/elbow_sine"),
    ("shoulder_margin", "/margins/shoulder_m"),
    ("manipulability", "/margins/manipulability_m3"),
    ("tip_sensitivity", "/tip_sensitivity_m_per_rad"),
    ("tip_rms", "/budget/total/at_target/analytic/rms_m"),
    (
        "tip_lateral_rms",
        "/budget/total/at_target/analytic/lateral_rms_m",
    ),
    ("engine_difference_peak", "/engine_difference/peak_tip_m"),
    (
        "engine_difference_settled",
        "/engine_difference/settled_tip_m",
    ),
    ("free_fraction", "/room/free_fraction"),
    ("sight_fraction", "/room/sight_fraction"),
    ("hand_cone", "/room/hand_cone_half_angle_rad"),
    ("needle_route", "/clearance/needle_route/minimum_m"),
];

/// Numbers of each engine and where they stand; the largest counts.
const OF_ENGINES: [(&str, &str); 9] = [
    ("tip_error", "/tip_position_error_m"),
    ("needle_angle_error", "/needle_angle_error_rad"),
    ("guide_position_error", "/guide_position_error_m"),
    ("lateral_error", "/lateral_error_m"),
    ("depth_error", "/depth_error_m"),
    ("settling_time", "/settling_time_s"),
    ("peak_torque", "/peak_torque_ratio"),
    ("contact_force", "/contact/peak_force_n"),
    ("tracking_error", "/peak_tracking_error_m"),
];

/// What was measured of a configuration, as a report without `metrics` has it, by today's keys.
pub fn former_report(configuration: &Value) -> BTreeMap<String, f64> {
    let number = |pointer: &str| configuration.pointer(pointer)?.as_f64();
    let mut found: BTreeMap<String, f64> = NUMBERS
        .iter()
        .filter_map(|(key, pointer)| Some(((*key).to_owned(), number(pointer)?)))
        .collect();
    let sines = number("/margins/wrist_sine").zip(number("/margins/elbow_sine"));
    let others = [
        ("singularity_margin", sines.map(|(a, b)| a.min(b))),
        ("motion_time", arrival_s(configuration)),
        ("preference", preference(configuration)),
    ];
    for (key, value) in others {
        found.extend(value.map(|value| (key.to_owned(), value)));
    }
    engines(configuration, &mut found);
    clearances(configuration, &mut found);
    found
}

fn arrival_s(configuration: &Value) -> Option<f64> {
    let phases = configuration.get("motion")?.as_array()?;
    let times = phases
        .iter()
        .filter(|phase| {
            let name = phase.get("phase").and_then(Value::as_str);
            matches!(name, Some("transfer" | "approach"))
        })
        .map(|phase| phase.get("end_s").and_then(Value::as_f64));
    times.reduce(|a, b| Some(a?.max(b?))).flatten()
}

fn preference(configuration: &Value) -> Option<f64> {
    let elbow = configuration.pointer("/room/elbow_as_preferred");
    let elbow = elbow.and_then(Value::as_bool).map(f64::from);
    let side = configuration.pointer("/room/preferred_side_free_fraction");
    let stated: Vec<f64> = [elbow, side.and_then(Value::as_f64)]
        .into_iter()
        .flatten()
        .collect();
    (!stated.is_empty()).then(|| stated.iter().sum::<f64>() / stated.len() as f64)
}

fn engines(configuration: &Value, found: &mut BTreeMap<String, f64>) {
    let Some(engines) = configuration.get("engines").and_then(Value::as_object) else {
        return;
    };
    for (key, pointer) in OF_ENGINES {
        let values = engines
            .values()
            .map(|engine| engine.pointer(pointer)?.as_f64());
        let farther = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        let worst = values.reduce(|a, b| Some(farther(a?, b?))).flatten();
        found.extend(worst.map(|worst| (key.to_owned(), worst)));
    }
    for (name, engine) in engines {
        let error_m = engine.get("tip_position_error_m").and_then(Value::as_f64);
        found.extend(error_m.map(|error_m| (format!("tip_error_{name}"), error_m)));
    }
}

fn clearances(configuration: &Value, found: &mut BTreeMap<String, f64>) {
    let engines = configuration.get("engines").and_then(Value::as_object);
    let was_simulated = engines.is_some_and(|engines| !engines.is_empty());
    // Of every family and way of knowing it: the least so far, none if one class lacks it.
    let mut least: BTreeMap<String, Option<f64>> = BTreeMap::new();
    for class in ClearanceClass::ALL {
        let Some(of_class) = configuration.pointer(&format!("/clearance/{}", class.name())) else {
            continue;
        };
        if class == ClearanceClass::NeedleRoute {
            continue;
        }
        let number = |key: &str| of_class.get(key).and_then(Value::as_f64);
        let phase = of_class.get("phase").and_then(Value::as_str);
        let simulated = of_class
            .get("engine")
            .map_or(was_simulated, |engine| !engine.is_null());
        let (attained, certified) = match (phase, simulated) {
            (Some("final_posture"), _) => ("_posture", None),
            (_, true) => ("_attained", Some("")),
            (_, false) => ("_planned_attained", Some("_planned")),
        };
        let mut families = vec![stem(class)];
        families.extend(class.is_surroundings().then_some("clearance"));
        families.extend(class.is_unwanted().then_some("least_clearance"));
        for family in families {
            let mut take = |suffix: &str, value: Option<f64>| {
                let known = least.entry(format!("{family}{suffix}"));
                let known = known.or_insert(Some(f64::INFINITY));
                *known = known.zip(value).map(|(known, value)| known.min(value));
            };
            take(attained, number("minimum_m"));
            if let Some(certified) = certified {
                take(certified, number("certified_lower_bound_m"));
            }
        }
    }
    found.extend(
        least
            .into_iter()
            .filter_map(|(key, least)| Some((key, least?))),
    );
}

/// How a row of an older study was computed, which decides what its columns are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FormerRow {
    /// A static case.
    Static,
    /// A posture without a motion, in a study that looked for motions.
    Posture,
    /// A planned motion.
    Planned,
    /// A simulated motion.
    Simulated,
}

impl FormerRow {
    /// How a row was computed, by the columns that it has, in a study of such a mode.
    pub fn of(mode: StudyMode, has: impl Fn(&str) -> bool) -> Self {
        if [
            "tip_error_rapier_mm",
            "tip_error_mujoco_mm",
            "peak_torque_ratio",
        ]
        .into_iter()
        .any(&has)
        {
            Self::Simulated
        } else if ["motion_time_s", "certified_clearance_mm"]
            .into_iter()
            .any(&has)
        {
            Self::Planned
        } else if mode == StudyMode::Static {
            Self::Static
        } else {
            Self::Posture
        }
    }
}

/// A column of studies of older versions.
#[derive(Debug, Clone, Copy)]
pub struct FormerColumn {
    /// Its name; its unit is that of today's columns.
    pub name: &'static str,
    /// Today's key of what it held in rows of each kind, in the order of [`FormerRow`].
    pub keys: [Option<&'static str>; 4],
}

/// Of the posture alone, static cases apart.
const fn posture(name: &'static str, of_static: &'static str, key: &'static str) -> FormerColumn {
    FormerColumn {
        name,
        keys: [Some(of_static), Some(key), Some(key), Some(key)],
    }
}

macro_rules! clearance {
    ($name:literal, $stem:literal) => {
        FormerColumn {
            name: $name,
            keys: [
                Some(concat!($stem, "_static")),
                Some(concat!($stem, "_posture")),
                Some(concat!($stem, "_planned_attained")),
                Some(concat!($stem, "_attained")),
            ],
        }
    };
}

macro_rules! needle {
    ($name:literal, $stem:literal) => {
        FormerColumn {
            name: $name,
            keys: [
                Some(concat!($stem, "_static")),
                Some(concat!($stem, "_predicted")),
                Some(concat!($stem, "_predicted")),
                Some($stem),
            ],
        }
    };
}

const fn simulated(name: &'static str, key: &'static str) -> FormerColumn {
    FormerColumn {
        name,
        keys: [None, None, None, Some(key)],
    }
}

/// Columns of studies before their tables had keys.
pub const FORMER_COLUMNS: [FormerColumn; 37] = [
    posture("roll_deg", "roll_static", "roll"),
    posture("q1_deg", "q1_static", "q1"),
    posture("q2_deg", "q2_static", "q2"),
    posture("q3_deg", "q3_static", "q3"),
    posture("q4_deg", "q4_static", "q4"),
    posture("q5_deg", "q5_static", "q5"),
    posture("q6_deg", "q6_static", "q6"),
    posture("joint_margin", "joint_margin_static", "joint_margin"),
    posture("wrist_sine", "wrist_sine_static", "wrist_sine"),
    posture("elbow_sine", "elbow_sine_static", "elbow_sine"),
    posture(
        "shoulder_margin_mm",
        "shoulder_margin_static",
        "shoulder_margin",
    ),
    posture(
        "manipulability_m3",
        "manipulability_static",
        "manipulability",
    ),
    posture(
        "tip_sensitivity_mm_mrad",
        "tip_sensitivity_static",
        "tip_sensitivity",
    ),
    posture("surplus_mm", "surplus_static", "surplus"),
    clearance!("robot_phantom_mm", "arm_to_skin"),
    clearance!("robot_table_mm", "to_table"),
    clearance!("robot_gantry_mm", "to_gantry"),
    clearance!("robot_mount_mm", "to_mount"),
    clearance!("self_mm", "self_clearance"),
    clearance!("tool_phantom_mm", "tool_to_skin"),
    clearance!("guide_standoff_mm", "guide_to_skin"),
    clearance!("needle_corridor_mm", "needle_corridor"),
    posture("needle_route_mm", "needle_route", "needle_route"),
    clearance!("clearance_mm", "clearance"),
    FormerColumn {
        name: "certified_clearance_mm",
        keys: [None, None, Some("clearance_planned"), Some("clearance")],
    },
    needle!("tip_error_mm", "tip_error"),
    needle!("tip_lateral_mm", "lateral_error"),
    needle!("tip_axial_mm", "depth_error"),
    needle!("needle_angle_deg", "needle_angle_error"),
    posture("tip_rms_mm", "tip_rms_static", "tip_rms"),
    posture("motion_time_s", "motion_time", "motion_time"),
    simulated("tip_error_rapier_mm", "tip_error_rapier"),
    simulated("tip_error_mujoco_mm", "tip_error_mujoco"),
    simulated("engine_difference_peak_um", "engine_difference_peak"),
    simulated("engine_difference_settled_um", "engine_difference_settled"),
    simulated("peak_torque_ratio", "peak_torque"),
    simulated("settling_time_s", "settling_time"),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::MetricKey;

    #[test]
    fn every_former_name_stands_for_a_metric_of_today_in_the_same_unit() {
        for column in FORMER_COLUMNS {
            for key in column.keys.into_iter().flatten() {
                let found = MetricKey::named(key, &["rapier", "mujoco"]);
                let found = found.unwrap_or_else(|| panic!("{key} is no metric"));
                let unit = found.metric().unit;
                assert!(column.name.ends_with(unit.suffix), "{} {key}", column.name);
            }
        }
        for key in NUMBERS
            .map(|(key, _)| key)
            .into_iter()
            .chain(OF_ENGINES.map(|(key, _)| key))
        {
            assert!(MetricKey::named(key, &[]).is_some(), "{key}");
        }
        for class in ClearanceClass::ALL {
            assert!(MetricKey::named(stem(class), &[]).is_some(), "{class:?}");
        }
    }
}
