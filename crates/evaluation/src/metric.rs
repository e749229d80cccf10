//! The metrics by which configurations are compared: one list for rankings, Pareto sets and the
//! comparison of results.
//!
//! Metrics are read from a configuration's part of the report by the keys that are documented for
//! `report.json`, so that a result that was just made and one that was stored by an older version
//! are read by the same code. What is missing, `null` or not finite was *not measured*.

pub use crate::facts::ConfigurationFacts;

/// What a metric measures, with its SI unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// m.
    Length,
    /// rad.
    Angle,
    /// s.
    Time,
    /// N.
    Force,
    /// m/rad, the same number as mm/mrad.
    LengthPerAngle,
    /// A plain number.
    Ratio,
}

impl Quantity {
    /// Unit in reports.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Length => "m",
            Self::Angle => "rad",
            Self::Time => "s",
            Self::Force => "N",
            Self::LengthPerAngle => "m/rad",
            Self::Ratio => "1",
        }
    }

    /// A value as people read it: mm, degrees and so on, with its unit.
    pub fn text(self, value: f64) -> String {
        match self {
            Self::Length => length_text(value),
            Self::Angle if value != 0.0 && value.to_degrees().abs() < 0.01 => {
                format!("{:.3e} deg", value.to_degrees())
            }
            Self::Angle => format!("{:.2} deg", value.to_degrees()),
            Self::Time => format!("{value:.2} s"),
            Self::Force => format!("{value:.2} N"),
            Self::LengthPerAngle => format!("{value:.2} mm/mrad"),
            Self::Ratio => format!("{value:.2}"),
        }
    }
}

fn length_text(metres: f64) -> String {
    let magnitude = metres.abs();
    if magnitude >= 1e-4 {
        format!("{:.1} mm", metres * 1e3)
    } else if magnitude >= 1e-7 {
        format!("{:.1} um", metres * 1e6)
    } else if magnitude >= 1e-10 {
        format!("{:.1} nm", metres * 1e9)
    } else if magnitude > 0.0 {
        "< 0.1 nm".to_owned()
    } else {
        "0 mm".to_owned()
    }
}

/// Which way is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Larger values.
    More,
    /// Smaller values.
    Less,
}

/// One metric.
#[derive(Debug, Clone, Copy)]
pub struct Metric {
    /// Name in reports and on the command line.
    pub name: &'static str,
    /// The same in words.
    pub words: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Which way is better.
    pub better: Better,
    /// Differences up to this, in SI units, are none.
    pub resolution: f64,
    /// Whether it decides on the Pareto set. Effort, far from its limit, and taste do not.
    pub in_pareto_set: bool,
    /// Key of the scenario's `[ranking]` and its unit in SI; none if it is not ranked by.
    pub ranking_key: Option<(&'static str, f64)>,
    read: fn(ConfigurationFacts<'_>) -> Option<f64>,
}

impl Metric {
    /// The metric with a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        METRICS.iter().find(|metric| metric.name == name)
    }

    /// Value of a configuration in SI units; none if it was not measured.
    pub fn read(&self, configuration: ConfigurationFacts<'_>) -> Option<f64> {
        (self.read)(configuration).filter(|value| value.is_finite())
    }

    /// By how much `b` is better than `a`; negative if it is worse.
    pub fn gain(&self, a: f64, b: f64) -> f64 {
        match self.better {
            Better::More => b - a,
            Better::Less => a - b,
        }
    }

    /// Better, worse (`Less`) or, within the resolution, the same.
    pub fn compare(&self, a: f64, b: f64) -> std::cmp::Ordering {
        let gain = self.gain(a, b);
        if gain.abs() <= self.resolution {
            std::cmp::Ordering::Equal
        } else {
            gain.total_cmp(&0.0)
        }
    }
}

/// Classes of arm and tool against what stands around them.
const SURROUNDINGS: [&str; 5] = [
    "robot_phantom",
    "robot_table",
    "robot_gantry",
    "robot_mount",
    "tool_phantom",
];

/// A metric that neither ranks nor decides on the Pareto set, for the comparison of results.
const fn compared(
    name: &'static str,
    words: &'static str,
    quantity: Quantity,
    better: Better,
    resolution: f64,
    read: fn(ConfigurationFacts<'_>) -> Option<f64>,
) -> Metric {
    Metric {
        name,
        words,
        quantity,
        better,
        resolution,
        in_pareto_set: false,
        ranking_key: None,
        read,
    }
}

/// Assumed: less than anybody would move a robot for.
const CLEARANCE_RESOLUTION_M: f64 = 0.5e-3;
/// Far below what any needle robot reaches, far above the rounding of two engines.
const NEEDLE_RESOLUTION_M: f64 = 1e-6;
/// Shortest time that anybody at the table would notice.
const TIME_RESOLUTION_S: f64 = 0.05;
/// One per cent of a quantity from 0 to 1.
const SHARE_RESOLUTION: f64 = 0.01;

/// Every metric, in the order of reports. A new one needs an entry here and, to be ranked by, a
/// key of the scenario's `[ranking]`.
pub const METRICS: &[Metric] = &[
    Metric {
        name: "clearance",
        words: "clearance",
        quantity: Quantity::Length,
        better: Better::More,
        resolution: CLEARANCE_RESOLUTION_M,
        in_pareto_set: true,
        ranking_key: Some(("clearance_mm", 1e-3)),
        read: |each| each.least_of(&SURROUNDINGS),
    },
    Metric {
        name: "self_clearance",
        words: "clearance from itself",
        quantity: Quantity::Length,
        better: Better::More,
        resolution: CLEARANCE_RESOLUTION_M,
        in_pareto_set: true,
        ranking_key: Some(("self_clearance_mm", 1e-3)),
        read: |each| each.class("self"),
    },
    Metric {
        name: "needle_corridor",
        words: "room behind the guide",
        quantity: Quantity::Length,
        better: Better::More,
        resolution: CLEARANCE_RESOLUTION_M,
        in_pareto_set: true,
        ranking_key: Some(("needle_corridor_mm", 1e-3)),
        read: |each| each.class("needle_corridor"),
    },
    Metric {
        name: "tip_error",
        words: "tip error",
        quantity: Quantity::Length,
        better: Better::Less,
        resolution: NEEDLE_RESOLUTION_M,
        in_pareto_set: true,
        ranking_key: Some(("tip_error_mm", 1e-3)),
        // Over all arms and patients where the scenario says how they differ, else of the one run.
        read: |each| {
            each.number("/budget/total/at_target/analytic/rms_m")
                .or_else(|| each.worst_engine("/tip_position_error_m"))
        },
    },
    Metric {
        name: "tip_sensitivity",
        words: "sensitivity of the tip",
        quantity: Quantity::LengthPerAngle,
        better: Better::Less,
        resolution: SHARE_RESOLUTION,
        in_pareto_set: true,
        ranking_key: Some(("tip_sensitivity_mm_mrad", 1.0)),
        read: |each| each.number("/tip_sensitivity_m_per_rad"),
    },
    Metric {
        name: "joint_margin",
        words: "margin to joint limits",
        quantity: Quantity::Ratio,
        better: Better::More,
        resolution: SHARE_RESOLUTION,
        in_pareto_set: true,
        ranking_key: Some(("joint_margin", 1.0)),
        read: |each| each.number("/margins/joint_limit"),
    },
    Metric {
        name: "singularity_margin",
        words: "margin to singularities",
        quantity: Quantity::Ratio,
        better: Better::More,
        resolution: SHARE_RESOLUTION,
        in_pareto_set: true,
        ranking_key: Some(("singularity_margin", 1.0)),
        read: |each| {
            let wrist = each.number("/margins/wrist_sine")?;
            Some(wrist.min(each.number("/margins/elbow_sine")?))
        },
    },
    Metric {
        name: "shoulder_margin",
        words: "distance from the shoulder singularity",
        quantity: Quantity::Length,
        better: Better::More,
        resolution: 1e-3,
        in_pareto_set: true,
        ranking_key: Some(("shoulder_margin_mm", 1e-3)),
        read: |each| each.number("/margins/shoulder_m"),
    },
    Metric {
        name: "motion_time",
        words: "motion time",
        quantity: Quantity::Time,
        better: Better::Less,
        resolution: TIME_RESOLUTION_S,
        in_pareto_set: true,
        ranking_key: Some(("motion_time_s", 1.0)),
        read: |each| each.arrival_s(),
    },
    Metric {
        name: "peak_torque",
        words: "peak torque of limit",
        quantity: Quantity::Ratio,
        better: Better::Less,
        resolution: SHARE_RESOLUTION,
        in_pareto_set: false,
        ranking_key: Some(("peak_torque_ratio", 1.0)),
        read: |each| each.worst_engine("/peak_torque_ratio"),
    },
    Metric {
        name: "free_fraction",
        words: "free space",
        quantity: Quantity::Ratio,
        better: Better::More,
        resolution: SHARE_RESOLUTION,
        in_pareto_set: true,
        ranking_key: Some(("free_fraction", 1.0)),
        read: |each| each.number("/room/free_fraction"),
    },
    Metric {
        name: "sight_fraction",
        words: "line of sight",
        quantity: Quantity::Ratio,
        better: Better::More,
        resolution: SHARE_RESOLUTION,
        in_pareto_set: true,
        ranking_key: Some(("sight_fraction", 1.0)),
        read: |each| each.number("/room/sight_fraction"),
    },
    Metric {
        name: "hand_cone",
        words: "cone for the hand",
        quantity: Quantity::Angle,
        better: Better::More,
        // 1 degree.
        resolution: 0.0175,
        in_pareto_set: true,
        ranking_key: Some(("hand_cone_deg", std::f64::consts::PI / 180.0)),
        read: |each| each.number("/room/hand_cone_half_angle_rad"),
    },
    Metric {
        name: "preference",
        words: "doctor's preferences",
        quantity: Quantity::Ratio,
        better: Better::More,
        resolution: SHARE_RESOLUTION,
        in_pareto_set: false,
        ranking_key: Some(("preference", 1.0)),
        read: |each| each.preference(),
    },
    compared(
        "needle_angle_error",
        "needle angle error",
        Quantity::Angle,
        Better::Less,
        1e-5,
        |each| each.worst_engine("/needle_angle_error_rad"),
    ),
    compared(
        "lateral_error",
        "lateral error",
        Quantity::Length,
        Better::Less,
        NEEDLE_RESOLUTION_M,
        |each| each.worst_engine("/lateral_error_m"),
    ),
    compared(
        "guide_position_error",
        "guide position error",
        Quantity::Length,
        Better::Less,
        NEEDLE_RESOLUTION_M,
        |each| each.worst_engine("/guide_position_error_m"),
    ),
    compared(
        "settling_time",
        "settling time",
        Quantity::Time,
        Better::Less,
        TIME_RESOLUTION_S,
        |each| each.worst_engine("/settling_time_s"),
    ),
    compared(
        "tracking_error",
        "peak tracking error",
        Quantity::Length,
        Better::Less,
        NEEDLE_RESOLUTION_M,
        |each| each.worst_engine("/peak_tracking_error_m"),
    ),
    compared(
        "contact_force",
        "peak contact force",
        Quantity::Force,
        Better::Less,
        0.1,
        |each| each.worst_engine("/contact/peak_force_n"),
    ),
    compared(
        "engine_difference_peak",
        "engines differ, peak",
        Quantity::Length,
        Better::Less,
        NEEDLE_RESOLUTION_M,
        |each| each.number("/engine_difference/peak_tip_m"),
    ),
    compared(
        "engine_difference_settled",
        "engines differ, settled",
        Quantity::Length,
        Better::Less,
        NEEDLE_RESOLUTION_M,
        |each| each.number("/engine_difference/settled_tip_m"),
    ),
    compared(
        "arm_to_skin",
        "arm to skin",
        Quantity::Length,
        Better::More,
        CLEARANCE_RESOLUTION_M,
        |each| each.class("robot_phantom"),
    ),
    compared(
        "tool_to_skin",
        "tool to skin",
        Quantity::Length,
        Better::More,
        CLEARANCE_RESOLUTION_M,
        |each| each.class("tool_phantom"),
    ),
    compared(
        "guide_to_skin",
        "guide to skin",
        Quantity::Length,
        Better::More,
        CLEARANCE_RESOLUTION_M,
        |each| each.class("guide_standoff"),
    ),
    compared(
        "to_table",
        "arm and tool to table",
        Quantity::Length,
        Better::More,
        CLEARANCE_RESOLUTION_M,
        |each| each.class("robot_table"),
    ),
    compared(
        "to_gantry",
        "arm and tool to gantry",
        Quantity::Length,
        Better::More,
        CLEARANCE_RESOLUTION_M,
        |each| each.class("robot_gantry"),
    ),
    compared(
        "to_mount",
        "arm and tool to mount",
        Quantity::Length,
        Better::More,
        CLEARANCE_RESOLUTION_M,
        |each| each.class("robot_mount"),
    ),
    compared(
        "needle_route",
        "needle to bone, vessel, organ",
        Quantity::Length,
        Better::More,
        CLEARANCE_RESOLUTION_M,
        |each| each.class("needle_route"),
    ),
];
