//! Time and effort, contact, and differences between engines.

use needlebench_scenario::study::StudyMode::Dynamic;

use super::{MM, NEEDLE_RESOLUTION_M, SHARE_RESOLUTION};
use crate::metric::entry::Better::Less;
use crate::metric::entry::Bound::Value;
use crate::metric::entry::Draw::{Nominal, ThisDraw};
use crate::metric::entry::Source::{Configuration, Engines};
use crate::metric::entry::Stage::{PlannedMotion, Simulated};
use crate::metric::entry::{Metric, Missing, Show};
use crate::metric::quantity::Quantity::{Force, Length, Ratio, Time};
use crate::metric::quantity::Unit;
use crate::metric::readers::{arrival_s, contact_force, first_contact};

/// Shortest time that people at the table would notice.
const TIME_RESOLUTION_S: f64 = 0.05;

/// Time and effort.
pub(super) const EFFORT: &[Metric] = &[
    Metric::new(
        "motion_time",
        "motion time",
        "time until the arm reaches its final posture, without the hold",
        Time,
        Configuration(arrival_s),
    )
    .known(Value, Nominal, PlannedMotion)
    .better(Less, TIME_RESOLUTION_S)
    .ranked("motion_time_s")
    .pareto()
    .table(10, "motion\n(s)")
    .page(13, "Motion"),
    Metric::new(
        "settling_time",
        "settling time",
        "time from the end of the motion until the tip remains within the settling band",
        Time,
        Engines(|each| each.motion.settling_time_s),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, TIME_RESOLUTION_S)
    .criterion("max_settling_time_s", &[Dynamic], |criteria| {
        criteria.max_settling_time_s
    })
    .missing(Missing::Never)
    .detail(|_, _, criteria| format!("into a band of {:.4} mm", criteria.settling_band_mm)),
    Metric::new(
        "peak_torque",
        "peak torque ratio",
        "largest ratio of a joint's torque to its limit",
        Ratio,
        Engines(|each| Some(each.motion.peak_torque_ratio)),
    )
    .unit(Unit::RATIO)
    .known(Value, ThisDraw, Simulated)
    .better(Less, SHARE_RESOLUTION)
    .ranked("peak_torque_ratio")
    .show(Show::Percent)
    .engines(4, "peak torque\nratio")
    .criterion("max_peak_torque_ratio", &[Dynamic], |criteria| {
        criteria.max_peak_torque_ratio
    }),
    Metric::new(
        "peak_speed",
        "peak speed ratio",
        "largest ratio of a joint's speed to its limit",
        Ratio,
        Engines(|each| Some(each.motion.peak_speed_ratio)),
    )
    .unit(Unit::RATIO)
    .known(Value, ThisDraw, Simulated)
    .better(Less, SHARE_RESOLUTION)
    .show(Show::Percent),
    Metric::new(
        "contact_force",
        "peak contact force",
        "largest sum of normal contact forces between arm and tool and their surroundings, all \
         rigid; not the force on a patient",
        Force,
        Engines(|each| Some(contact_force(each))),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, 0.1)
    .criterion("allow_contact", &[Dynamic], |criteria| {
        (!criteria.allow_contact).then_some(0.0)
    })
    .detail(|_, engine, _| first_contact(engine)),
    Metric::new(
        "tracking_error",
        "peak tracking error",
        "largest distance of the needle tip from its reference at the same time",
        Length,
        Engines(|each| Some(each.motion.peak_tracking_error_m)),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .engines(3, "tracking\npeak"),
];

/// Differences between engines.
pub(super) const ENGINES_COMPARED: &[Metric] = &[
    Metric::new(
        "engine_difference_peak",
        "engine difference, peak",
        "largest distance between the engines' needle tips during the motion",
        Length,
        Configuration(|each| Some(each.engine_difference?.peak_tip_m)),
    )
    .unit(Unit::MICROMETRE)
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .engines(1, "engine difference\npeak")
    .page(21, "Engine difference")
    .criterion("max_engine_difference_peak_mm", &[Dynamic], |criteria| {
        criteria.max_engine_difference_peak_mm.map(|mm| mm * MM)
    })
    .missing(Missing::UnjudgedIfCompared),
    Metric::new(
        "engine_difference_settled",
        "engine difference, settled",
        "distance between the engines' settled needle tips",
        Length,
        Configuration(|each| Some(each.engine_difference?.settled_tip_m)),
    )
    .unit(Unit::MICROMETRE)
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .engines(2, "\nsettled")
    .summary(6, "Engine difference, settled")
    .criterion("max_engine_difference_settled_mm", &[Dynamic], |criteria| {
        criteria.max_engine_difference_settled_mm.map(|mm| mm * MM)
    })
    .missing(Missing::UnjudgedIfCompared),
];
