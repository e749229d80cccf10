//! One row: one configuration in one case.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// What became of a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Outcome {
    /// It works and meets all criteria.
    Ok = 0,
    /// It works but misses a criterion, which [`Row::detail`] names.
    Failed = 1,
    /// A rule rejects it, which [`Row::detail`] names.
    Rejected = 2,
    /// The layout cannot exist; [`Row::detail`] is the key that is at fault.
    Invalid = 3,
}

impl Outcome {
    /// All of them, each at the index that it is cast to.
    pub const ALL: [Self; 4] = [Self::Ok, Self::Failed, Self::Rejected, Self::Invalid];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Failed => "failed",
            Self::Rejected => "rejected",
            Self::Invalid => "invalid",
        }
    }
}

/// A number that a row has, or has not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[expect(missing_docs, reason = "described in `METRICS`")]
pub enum Metric {
    Roll,
    Joint1,
    Joint2,
    Joint3,
    Joint4,
    Joint5,
    Joint6,
    JointMargin,
    WristSine,
    ElbowSine,
    ShoulderMargin,
    Manipulability,
    TipSensitivity,
    Surplus,
    RobotPhantom,
    RobotTable,
    RobotGantry,
    RobotMount,
    SelfClearance,
    ToolPhantom,
    GuideStandoff,
    NeedleCorridor,
    NeedleRoute,
    Clearance,
    CertifiedClearance,
    TipError,
    TipLateral,
    TipAxial,
    NeedleAngle,
    TipRms,
    MotionTime,
    TipErrorRapier,
    TipErrorMujoco,
    EnginePeakDifference,
    EngineSettledDifference,
    PeakTorqueRatio,
    SettlingTime,
}

/// Description of a metric's column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MetricColumn {
    /// The metric.
    pub metric: Metric,
    /// Name of the column, with the unit.
    pub name: &'static str,
    /// What it is, with unit and definition.
    pub description: &'static str,
    /// Whether more is better; `None` where neither is.
    pub more_is_better: Option<bool>,
}

/// Number of metrics.
pub const METRIC_COUNT: usize = METRICS.len();

const fn column(
    metric: Metric,
    name: &'static str,
    more_is_better: Option<bool>,
    description: &'static str,
) -> MetricColumn {
    MetricColumn {
        metric,
        name,
        description,
        more_is_better,
    }
}

/// All metrics, each at the index that it is cast to, in the order of their columns.
pub const METRICS: [MetricColumn; 37] = [
    column(
        Metric::Roll,
        "roll_deg",
        None,
        "angle of the guide about the needle, deg",
    ),
    column(
        Metric::Joint1,
        "q1_deg",
        None,
        "final position of shoulder pan, deg",
    ),
    column(
        Metric::Joint2,
        "q2_deg",
        None,
        "final position of shoulder lift, deg",
    ),
    column(
        Metric::Joint3,
        "q3_deg",
        None,
        "final position of elbow, deg",
    ),
    column(
        Metric::Joint4,
        "q4_deg",
        None,
        "final position of wrist 1, deg",
    ),
    column(
        Metric::Joint5,
        "q5_deg",
        None,
        "final position of wrist 2, deg",
    ),
    column(
        Metric::Joint6,
        "q6_deg",
        None,
        "final position of wrist 3, deg",
    ),
    column(
        Metric::JointMargin,
        "joint_margin",
        Some(true),
        "1 in the middle of every joint's range, 0 at a limit",
    ),
    column(
        Metric::WristSine,
        "wrist_sine",
        Some(true),
        "|sin q5|; 0 is singular",
    ),
    column(
        Metric::ElbowSine,
        "elbow_sine",
        Some(true),
        "|sin q3|; 0 is singular",
    ),
    column(
        Metric::ShoulderMargin,
        "shoulder_margin_mm",
        Some(true),
        "sqrt(rho^2 - d4^2), mm; 0 is singular",
    ),
    column(
        Metric::Manipulability,
        "manipulability_m3",
        Some(true),
        "sqrt(det J J^T) of the flange, m^3",
    ),
    column(
        Metric::TipSensitivity,
        "tip_sensitivity_mm_mrad",
        Some(false),
        "root of the sum of the squared speeds of the needle's tip under each joint alone, mm/mrad",
    ),
    column(
        Metric::Surplus,
        "surplus_mm",
        Some(true),
        "distance of the posture from breaking a rule, negative where it breaks one, mm; sines and radians \
         count 100 mm",
    ),
    column(
        Metric::RobotPhantom,
        "robot_phantom_mm",
        Some(true),
        "clearance of arm from skin, mm",
    ),
    column(
        Metric::RobotTable,
        "robot_table_mm",
        Some(true),
        "clearance of arm and tool from table, mm",
    ),
    column(
        Metric::RobotGantry,
        "robot_gantry_mm",
        Some(true),
        "clearance of arm and tool from gantry, mm",
    ),
    column(
        Metric::RobotMount,
        "robot_mount_mm",
        Some(true),
        "clearance of arm and tool from mount, mm",
    ),
    column(
        Metric::SelfClearance,
        "self_mm",
        Some(true),
        "clearance of arm and tool from themselves, mm",
    ),
    column(
        Metric::ToolPhantom,
        "tool_phantom_mm",
        Some(true),
        "clearance of tool, without its guide tube, from skin, mm",
    ),
    column(
        Metric::GuideStandoff,
        "guide_standoff_mm",
        Some(true),
        "clearance of guide tube from skin, mm",
    ),
    column(
        Metric::NeedleCorridor,
        "needle_corridor_mm",
        Some(true),
        "clearance of the volume behind the guide that needle and hand need, mm",
    ),
    column(
        Metric::NeedleRoute,
        "needle_route_mm",
        Some(true),
        "clearance of the planned needle from bone, vessel and organ, mm; the same for all configurations",
    ),
    column(
        Metric::Clearance,
        "clearance_mm",
        Some(true),
        "least of the clearances from phantom, table, gantry and mount, without the guide's stand-off and the \
         arm's own, mm",
    ),
    column(
        Metric::CertifiedClearance,
        "certified_clearance_mm",
        Some(true),
        "proven lower bound of the same over the whole motion, mm; planned and dynamic cases",
    ),
    column(
        Metric::TipError,
        "tip_error_mm",
        Some(false),
        "distance of the settled needle tip from the target, mm: the larger of the engines in dynamic cases, \
         else predicted from the balance of torques; the residual of the inverse kinematics without \
         [imperfections]",
    ),
    column(
        Metric::TipLateral,
        "tip_lateral_mm",
        Some(false),
        "its part across the needle (normal distance), mm",
    ),
    column(
        Metric::TipAxial,
        "tip_axial_mm",
        None,
        "its part along the needle, deeper is positive, mm",
    ),
    column(
        Metric::NeedleAngle,
        "needle_angle_deg",
        Some(false),
        "settled angle between planned and actual needle, deg",
    ),
    column(
        Metric::TipRms,
        "tip_rms_mm",
        Some(false),
        "root mean square distance of the tip from the target over all draws of [imperfections], analytic, mm",
    ),
    column(
        Metric::MotionTime,
        "motion_time_s",
        Some(false),
        "time of the motion, without the hold, s; planned and dynamic cases",
    ),
    column(
        Metric::TipErrorRapier,
        "tip_error_rapier_mm",
        Some(false),
        "settled tip error in rapier, mm",
    ),
    column(
        Metric::TipErrorMujoco,
        "tip_error_mujoco_mm",
        Some(false),
        "settled tip error in MuJoCo, mm",
    ),
    column(
        Metric::EnginePeakDifference,
        "engine_difference_peak_um",
        Some(false),
        "largest difference of the engines' tips while moving, um",
    ),
    column(
        Metric::EngineSettledDifference,
        "engine_difference_settled_um",
        Some(false),
        "difference of the engines' settled tips, um",
    ),
    column(
        Metric::PeakTorqueRatio,
        "peak_torque_ratio",
        Some(false),
        "largest share of a joint's torque limit that is used, over the engines",
    ),
    column(
        Metric::SettlingTime,
        "settling_time_s",
        Some(false),
        "time from the end of the motion until the tip stays within its band, s, over the engines",
    ),
];

/// One configuration in one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Index of the configuration, 0 to 7, in the order of
    /// [`Configuration::ALL`](needlebench_kinematics::ik::Configuration::ALL).
    pub configuration: u8,
    /// What became of it.
    pub outcome: Outcome,
    /// The rule or criterion that it breaks, as `collision robot_phantom` or
    /// `max_tip_position_error_mm`; the key at fault of an invalid layout; empty if it is ok.
    pub detail: Cow<'static, str>,
    /// Values of [`METRICS`]; NaN where a row has none.
    pub metrics: [f32; METRIC_COUNT],
}

impl Row {
    /// A row without numbers.
    pub fn new(configuration: u8, outcome: Outcome, detail: impl Into<Cow<'static, str>>) -> Self {
        Self {
            configuration,
            outcome,
            detail: detail.into(),
            metrics: [f32::NAN; METRIC_COUNT],
        }
    }

    /// Value of a metric, if there is one.
    pub fn get(&self, metric: Metric) -> Option<f32> {
        Some(self.metrics[metric as usize]).filter(|value| !value.is_nan())
    }

    /// Sets a metric. Infinities have no place in a table: they become none.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a column has 24 bits of mantissa"
    )]
    pub fn set(&mut self, metric: Metric, value: f64) {
        self.metrics[metric as usize] = if value.is_finite() {
            value as f32
        } else {
            f32::NAN
        };
    }
}

/// All rows of a case, in the order of the configurations: always eight.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseResult {
    /// Number of the case.
    pub case: u64,
    /// One row per configuration.
    pub rows: [Row; 8],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_and_outcomes_stand_where_they_are_looked_up() {
        for (index, column) in METRICS.iter().enumerate() {
            assert_eq!(column.metric as usize, index);
        }
        for (index, outcome) in Outcome::ALL.into_iter().enumerate() {
            assert_eq!(outcome as usize, index);
        }
    }
}
