//! The final posture by itself.

use super::{CLEARANCE_RESOLUTION_M, SHARE_RESOLUTION};
use crate::metric::entry::Better::{Less, More};
use crate::metric::entry::Precision::Coarse;
use crate::metric::entry::Source::Configuration;
use crate::metric::entry::{Metric, Statistics};
use crate::metric::quantity::Quantity::{Angle, Length, LengthPerAngle, Ratio, Volume};
use crate::metric::readers::{joint, singularity};

pub(super) const POSTURE: &[Metric] = &[
    Metric::new(
        "roll",
        "roll",
        "angle of the guide about the needle",
        Angle,
        Configuration(|each| each.roll_rad),
    )
    .in_static_cases("roll_static")
    .case(7, "roll\ndeg"),
    Metric::new(
        "q1",
        "shoulder pan",
        "position of shoulder pan",
        Angle,
        Configuration(|each| joint(each, 0)),
    )
    .in_static_cases("q1_static"),
    Metric::new(
        "q2",
        "shoulder lift",
        "position of shoulder lift",
        Angle,
        Configuration(|each| joint(each, 1)),
    )
    .in_static_cases("q2_static"),
    Metric::new(
        "q3",
        "elbow",
        "position of elbow",
        Angle,
        Configuration(|each| joint(each, 2)),
    )
    .in_static_cases("q3_static"),
    Metric::new(
        "q4",
        "wrist 1",
        "position of wrist 1",
        Angle,
        Configuration(|each| joint(each, 3)),
    )
    .in_static_cases("q4_static"),
    Metric::new(
        "q5",
        "wrist 2",
        "position of wrist 2",
        Angle,
        Configuration(|each| joint(each, 4)),
    )
    .in_static_cases("q5_static"),
    Metric::new(
        "q6",
        "wrist 3",
        "position of wrist 3",
        Angle,
        Configuration(|each| joint(each, 5)),
    )
    .in_static_cases("q6_static"),
    Metric::new(
        "joint_margin",
        "joint-limit margin",
        "1 in the middle of every joint's range, 0 at a limit",
        Ratio,
        Configuration(|each| Some(each.margins?.joint_limit)),
    )
    .in_static_cases("joint_margin_static")
    .case(5, "joint\nmargin")
    .better(More, SHARE_RESOLUTION)
    .ranked("joint_margin")
    .pareto(),
    Metric::new(
        "wrist_sine",
        "sine of wrist 2",
        "|sin q5|; 0 is singular",
        Ratio,
        Configuration(|each| Some(each.margins?.wrist_sine)),
    )
    .in_static_cases("wrist_sine_static")
    .better(More, SHARE_RESOLUTION),
    Metric::new(
        "elbow_sine",
        "sine of the elbow",
        "|sin q3|; 0 is singular",
        Ratio,
        Configuration(|each| Some(each.margins?.elbow_sine)),
    )
    .in_static_cases("elbow_sine_static")
    .better(More, SHARE_RESOLUTION),
    Metric::new(
        "singularity_margin",
        "singularity margin",
        "smaller of |sin q5| and |sin q3|; 0 is singular",
        Ratio,
        Configuration(singularity),
    )
    .in_static_cases("singularity_margin_static")
    .better(More, SHARE_RESOLUTION)
    .ranked("singularity_margin")
    .pareto(),
    Metric::new(
        "shoulder_margin",
        "distance from the shoulder singularity",
        "sqrt(rho^2 - d4^2); 0 is singular",
        Length,
        Configuration(|each| Some(each.margins?.shoulder_m)),
    )
    .in_static_cases("shoulder_margin_static")
    .better(More, 1e-3)
    .ranked("shoulder_margin_mm")
    .pareto(),
    Metric::new(
        "manipulability",
        "manipulability",
        "sqrt(det J J^T) of the flange",
        Volume,
        Configuration(|each| Some(each.margins?.manipulability_m3)),
    )
    .in_static_cases("manipulability_static")
    .better(More, 1e-4),
    Metric::new(
        "tip_sensitivity",
        "tip sensitivity",
        "Frobenius norm of the tip position Jacobian",
        LengthPerAngle,
        Configuration(|each| each.tip_sensitivity_m_per_rad),
    )
    .in_static_cases("tip_sensitivity_static")
    .case(4, "tip\nmm/mrad")
    .better(Less, SHARE_RESOLUTION)
    .ranked("tip_sensitivity_mm_mrad")
    .pareto()
    .statistics(Statistics::SPREAD),
    Metric::new(
        "surplus",
        "constraint margin",
        "distance of the posture from violating a planning rule, negative if it violates one; \
         sines and radians count as 100 mm each",
        Length,
        Configuration(|each| each.surplus_m),
    )
    .in_static_cases("surplus_static")
    .case(6, "margin\nmm")
    .better(More, CLEARANCE_RESOLUTION_M)
    .statistics(Statistics::SPREAD.page(Coarse)),
];
