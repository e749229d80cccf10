//! Where the needle is: predicted, simulated, and over the arm and patient population.

use needlebench_scenario::scenario::CriteriaSection;
use needlebench_scenario::study::StudyMode::Dynamic;

use super::{ALL, MM, NEEDLE_RESOLUTION_M, UNSIMULATED};
use crate::metric::entry::Better::{Less, More};
use crate::metric::entry::Bound::Value;
use crate::metric::entry::Draw::{OverBudget, ThisDraw};
use crate::metric::entry::Precision::Fine;
use crate::metric::entry::Source::{Configuration, Engines};
use crate::metric::entry::Stage::{FinalPosture, Simulated};
use crate::metric::entry::{Metric, Missing, Role, Show, Statistics};
use crate::metric::quantity::Quantity::{Angle, Length, Ratio};
use crate::metric::readers::budget;

const NEEDLE_RESOLUTION_RAD: f64 = 1e-5;

/// Five of 1000 needles, assumed: what 10 000 draws of a count near 950 can tell.
const LESION_RESOLUTION: f64 = 5e-3;

/// One of 1000 needles, assumed.
const STRUCTURE_RESOLUTION: f64 = 1e-3;

/// How likely the needle comes close to what of one tissue it most likely does.
macro_rules! structure_probability {
    ($key:literal, $static_key:literal, $words:literal, $definition:literal, $criterion:literal, $tissue:ident) => {
        Metric::new(
            $key,
            $words,
            $definition,
            Ratio,
            Configuration(|each| each.probability.as_ref()?.value_of(stringify!($tissue))),
        )
        .probability()
        .known(Value, OverBudget, FinalPosture)
        .in_static_cases($static_key)
        .better(Less, STRUCTURE_RESOLUTION)
        .statistics(Statistics::SPREAD)
        .criterion($criterion, &[Dynamic], |criteria| {
            criteria.max_structure_probability.$tissue
        })
        .detail(|each, _, _| {
            let all = each.probability.as_ref();
            all.map_or_else(String::new, |all| all.words_of(stringify!($tissue)))
        })
    };
}

// Limits of what is judged by the prediction where nothing is simulated.

fn tip_limit_m(criteria: &CriteriaSection) -> Option<f64> {
    criteria.max_tip_position_error_mm.map(|mm| mm * MM)
}

fn angle_limit_rad(criteria: &CriteriaSection) -> Option<f64> {
    let limit_deg = criteria.max_needle_angle_error_deg;
    limit_deg.map(f64::to_radians)
}

fn true_target_limit_m(criteria: &CriteriaSection) -> Option<f64> {
    criteria.max_true_target_error_mm.map(|mm| mm * MM)
}

fn true_target_lateral_limit_m(criteria: &CriteriaSection) -> Option<f64> {
    criteria.max_true_target_lateral_mm.map(|mm| mm * MM)
}

fn guide_limit_m(criteria: &CriteriaSection) -> Option<f64> {
    criteria.max_guide_position_error_mm.map(|mm| mm * MM)
}

/// The needle in static equilibrium, without any engine; without
/// imperfections where the arm is commanded to, which leaves the residual of the inverse kinematics.
pub(super) const PREDICTED: &[Metric] = &[
    Metric::new(
        "tip_error_predicted",
        "predicted tip error",
        "distance of the needle tip from the target, in static equilibrium",
        Length,
        Configuration(|each| Some(each.predicted?.tip_position_error_m)),
    )
    .family("tip_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("tip_error_static")
    .case(3, "tip\nmm")
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .criterion("max_tip_position_error_mm", UNSIMULATED, tip_limit_m)
    .missing(Missing::Skips)
    .statistics(
        Statistics::BY_CASE
            .role(Role::TipError)
            .criterion("max_tip_error_mm")
            .page(Fine),
    ),
    Metric::new(
        "needle_angle_error_predicted",
        "predicted needle angle error",
        "angle between planned and actual needle, in static equilibrium",
        Angle,
        Configuration(|each| Some(each.predicted?.needle_angle_error_rad)),
    )
    .family("needle_angle_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("needle_angle_error_static")
    .better(Less, NEEDLE_RESOLUTION_RAD)
    .criterion("max_needle_angle_error_deg", UNSIMULATED, angle_limit_rad)
    .missing(Missing::Skips),
    Metric::new(
        "guide_position_error_predicted",
        "predicted guide position error",
        "distance of the guide exit from its planned position, in static equilibrium",
        Length,
        Configuration(|each| Some(each.predicted?.guide_position_error_m)),
    )
    .family("guide_position_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("guide_position_error_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .criterion("max_guide_position_error_mm", UNSIMULATED, guide_limit_m)
    .missing(Missing::Skips),
    Metric::new(
        "lateral_error_predicted",
        "predicted lateral error",
        "distance of the target from the needle axis, in static equilibrium",
        Length,
        Configuration(|each| Some(each.predicted?.lateral_error_m)),
    )
    .family("lateral_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("lateral_error_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .statistics(Statistics::BY_CASE.criterion("max_tip_lateral_mm")),
    Metric::new(
        "depth_error_predicted",
        "predicted depth error",
        "distance of the needle tip from the target along the needle axis, positive when too deep, \
         in static equilibrium",
        Length,
        Configuration(|each| Some(each.predicted?.depth_error_m)),
    )
    .family("depth_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("depth_error_static")
    .show(Show::SmallLength),
    Metric::new(
        "entry_error_predicted",
        "predicted entry error",
        "distance of the needle axis's intersection with the skin from the planned entry point, in \
         static equilibrium",
        Length,
        Configuration(|each| each.predicted?.entry_point_error_m),
    )
    .family("entry_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("entry_error_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength),
    Metric::new(
        "entry_lateral_error_predicted",
        "predicted lateral error at the entry",
        "distance of the planned entry point from the needle axis, in static equilibrium",
        Length,
        Configuration(|each| each.predicted?.entry_lateral_error_m),
    )
    .family("entry_lateral_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("entry_lateral_error_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength),
    Metric::new(
        "needle_angle_axial_predicted",
        "predicted needle angle error, axial",
        "angle between planned and actual needle, projected onto the patient's axial plane, in \
         static equilibrium; absent if the needle is more than 60 deg out of that plane",
        Angle,
        Configuration(|each| each.predicted?.axial_angle_error_rad),
    )
    .family("needle_angle_axial")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("needle_angle_axial_static")
    .better(Less, NEEDLE_RESOLUTION_RAD),
    Metric::new(
        "needle_angle_sagittal_predicted",
        "predicted needle angle error, sagittal",
        "angle between planned and actual needle, projected onto the patient's sagittal plane, in \
         static equilibrium; absent if the needle is more than 60 deg out of that plane",
        Angle,
        Configuration(|each| each.predicted?.sagittal_angle_error_rad),
    )
    .family("needle_angle_sagittal")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("needle_angle_sagittal_static")
    .better(Less, NEEDLE_RESOLUTION_RAD),
    Metric::new(
        "true_target_error_predicted",
        "predicted distance from the true target",
        "distance of the needle tip from the true lesion position (`true_target_mm`), in static \
         equilibrium; absent if that position is unknown",
        Length,
        Configuration(|each| each.predicted?.true_target_error_m),
    )
    .of_true_target()
    .family("true_target_error")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("true_target_error_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .criterion("max_true_target_error_mm", UNSIMULATED, true_target_limit_m)
    .missing(Missing::Skips)
    .statistics(Statistics::BY_CASE),
    Metric::new(
        "true_target_lateral_predicted",
        "predicted lateral distance from the true target",
        "distance of the true lesion position (`true_target_mm`) from the needle axis, in static \
         equilibrium; absent if that position is unknown",
        Length,
        Configuration(|each| each.predicted?.true_target_lateral_m),
    )
    .of_true_target()
    .family("true_target_lateral")
    .known(Value, ThisDraw, FinalPosture)
    .in_static_cases("true_target_lateral_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .criterion(
        "max_true_target_lateral_mm",
        UNSIMULATED,
        true_target_lateral_limit_m,
    )
    .missing(Missing::Skips)
    .statistics(Statistics::BY_CASE),
    Metric::new(
        "entry_target_length",
        "entry-target length",
        "length of the planned needle from the skin to the target",
        Length,
        Configuration(|each| each.entry_to_target_m),
    )
    .in_static_cases("entry_target_length"),
];

/// The needle as it settles in the engines.
pub(super) const SIMULATED: &[Metric] = &[
    Metric::new(
        "tip_error",
        "tip error",
        "distance of the settled needle tip from the target",
        Length,
        Engines(|each| Some(each.needle.tip_position_error_m)),
    )
    .known(Value, ThisDraw, Simulated)
    .each_engine()
    .better(Less, NEEDLE_RESOLUTION_M)
    .ranked("tip_error_mm")
    .pareto()
    .show(Show::SmallLength)
    .case(3, "tip\nmm")
    .engines(0, "residual\n{engine}")
    .summary(5, "Residual {engine}")
    .page(20, "Residual {engine}")
    .page_side(4, "Residual")
    .criterion("max_tip_position_error_mm", &[Dynamic], tip_limit_m)
    .statistics(
        Statistics::BY_CASE
            .role(Role::TipError)
            .criterion("max_tip_error_mm")
            .page(Fine),
    ),
    Metric::new(
        "needle_angle_error",
        "needle angle error",
        "settled angle between planned and actual needle",
        Angle,
        Engines(|each| Some(each.needle.needle_angle_error_rad)),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_RAD)
    .criterion("max_needle_angle_error_deg", &[Dynamic], angle_limit_rad),
    Metric::new(
        "guide_position_error",
        "guide position error",
        "settled distance of the guide exit from its planned position",
        Length,
        Engines(|each| Some(each.needle.guide_position_error_m)),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .criterion("max_guide_position_error_mm", &[Dynamic], guide_limit_m),
    Metric::new(
        "lateral_error",
        "lateral error",
        "settled distance of the target from the needle axis",
        Length,
        Engines(|each| Some(each.needle.lateral_error_m)),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .statistics(Statistics::BY_CASE.criterion("max_tip_lateral_mm")),
    Metric::new(
        "depth_error",
        "depth error",
        "settled distance of the needle tip from the target along the needle axis, positive when \
         too deep",
        Length,
        Engines(|each| Some(each.needle.depth_error_m)),
    )
    .known(Value, ThisDraw, Simulated)
    .show(Show::SmallLength),
    Metric::new(
        "true_target_error",
        "distance from the true target",
        "distance of the settled needle tip from the true lesion position (`true_target_mm`); \
         absent if that position is unknown",
        Length,
        Engines(|each| each.needle.true_target_error_m),
    )
    .of_true_target()
    .known(Value, ThisDraw, Simulated)
    .each_engine()
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .engines(5, "true lesion\n{engine}")
    .summary(8, "Distance to true lesion, {engine}")
    .page(22, "Distance to true lesion, {engine}")
    .page_side(5, "Distance to true lesion")
    .criterion("max_true_target_error_mm", &[Dynamic], true_target_limit_m)
    .missing(Missing::Skips)
    .statistics(Statistics::BY_CASE.page(Fine)),
    Metric::new(
        "true_target_lateral",
        "lateral distance from the true target",
        "settled distance of the true lesion position (`true_target_mm`) from the needle axis; \
         absent if that position is unknown",
        Length,
        Engines(|each| each.needle.true_target_lateral_m),
    )
    .of_true_target()
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .engines(6, "true lesion\nlateral")
    .summary(9, "Lateral distance to true lesion")
    .page(23, "Lateral distance to true lesion")
    .criterion(
        "max_true_target_lateral_mm",
        &[Dynamic],
        true_target_lateral_limit_m,
    )
    .missing(Missing::Skips)
    .statistics(Statistics::BY_CASE.page(Fine)),
    Metric::new(
        "entry_error",
        "entry error",
        "settled distance of the needle axis's intersection with the skin from the planned entry \
         point",
        Length,
        Engines(|each| each.needle.entry_point_error_m),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength),
    Metric::new(
        "entry_lateral_error",
        "lateral error at the entry",
        "settled distance of the planned entry point from the needle axis",
        Length,
        Engines(|each| each.needle.entry_lateral_error_m),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength),
    Metric::new(
        "needle_angle_axial",
        "needle angle error, axial",
        "settled angle between planned and actual needle, projected onto the patient's axial \
         plane; absent if the needle is more than 60 deg out of that plane",
        Angle,
        Engines(|each| each.needle.axial_angle_error_rad),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_RAD),
    Metric::new(
        "needle_angle_sagittal",
        "needle angle error, sagittal",
        "settled angle between planned and actual needle, projected onto the patient's sagittal \
         plane; absent if the needle is more than 60 deg out of that plane",
        Angle,
        Engines(|each| each.needle.sagittal_angle_error_rad),
    )
    .known(Value, ThisDraw, Simulated)
    .better(Less, NEEDLE_RESOLUTION_RAD),
];

/// The needle over the arm and patient population.
pub(super) const BUDGET: &[Metric] = &[
    Metric::new(
        "tip_rms",
        "RMS tip error",
        "root-mean-square distance of the needle tip from the target, analytic",
        Length,
        Configuration(|each| Some(budget(each)?.rms_m)),
    )
    .known(Value, OverBudget, FinalPosture)
    .in_static_cases("tip_rms_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .ranked("tip_error_mm")
    .pareto()
    .show(Show::SmallLength)
    .table(0, "RMS tip\nerror")
    .summary(0, "RMS tip error")
    .page(0, "RMS tip error")
    .page_side(0, "RMS tip error")
    .criterion("max_tip_rms_mm", ALL, |criteria| {
        criteria.max_tip_rms_mm.map(|mm| mm * MM)
    })
    .detail(|each, _, _| each.budget_failure.clone().unwrap_or_default())
    .statistics(Statistics::BY_CASE.criterion("max_tip_rms_mm")),
    Metric::new(
        "tip_within_95",
        "P95 tip error",
        "95th percentile of the distance of the needle tip from the target, over the arm and \
         patient population",
        Length,
        Configuration(|each| each.budget.as_ref()?.total.at_target.radius_95_m),
    )
    .only_in(&[Dynamic])
    .known(Value, OverBudget, FinalPosture)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .table(1, "P95 tip\nerror")
    .summary(1, "P95 tip error")
    .page(1, "P95 tip error")
    .page_side(1, "P95 tip error"),
    Metric::new(
        "lesion_probability",
        "tip in the lesion",
        "probability that the needle tip is in the lesion, over the arm and patient population: estimate by draws",
        Ratio,
        Configuration(|each| each.probability.as_ref()?.in_lesion.as_ref()?.event.probability),
    )
    .probability()
    .known(Value, OverBudget, FinalPosture)
    .in_static_cases("lesion_probability_static")
    .better(More, LESION_RESOLUTION)
    .statistics(Statistics::SPREAD)
    .criterion("min_lesion_probability", &[Dynamic], |criteria| {
        criteria.min_lesion_probability
    })
    .detail(|each, _, _| {
        let lesion = each.probability.as_ref().and_then(|all| all.in_lesion.as_ref());
        lesion.map_or_else(String::new, |lesion| lesion.event.in_words())
    }),
    structure_probability!(
        "bone_probability",
        "bone_probability_static",
        "needle close to bone",
        "probability that the needle comes closer than 1 mm to the bone that it most likely does",
        "max_structure_probability.bone",
        bone
    ),
    structure_probability!(
        "vessel_probability",
        "vessel_probability_static",
        "needle close to a vessel",
        "probability that the needle comes closer than 1 mm to the vessel that it most likely does",
        "max_structure_probability.vessel",
        vessel
    ),
    structure_probability!(
        "organ_probability",
        "organ_probability_static",
        "needle close to an organ",
        "probability that the needle comes closer than 1 mm to the organ that it most likely does, without that of the target",
        "max_structure_probability.organ",
        organ
    ),
    Metric::new(
        "tip_bias",
        "tip bias",
        "length of the mean error vector of the needle tip, analytic",
        Length,
        Configuration(|each| Some(budget(each)?.bias().norm())),
    )
    .known(Value, OverBudget, FinalPosture)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .table(2, "tip\nbias")
    .page(2, "Tip bias"),
    Metric::new(
        "tip_rms_breathing_freely",
        "RMS tip error, free breathing",
        "as `tip_rms`, for a freely breathing patient, analytic",
        Length,
        Configuration(|each| Some(each.budget.as_ref()?.breathing_freely?.rms_m)),
    )
    .known(Value, OverBudget, FinalPosture)
    .better(Less, NEEDLE_RESOLUTION_M)
    .show(Show::SmallLength)
    .table(3, "free-breathing\nRMS tip error"),
    Metric::new(
        "tip_lateral_rms_before_insertion",
        "RMS lateral error before insertion",
        "root-mean-square distance of the target from the needle axis before insertion, in a \
         motionless phantom, analytic: the accuracy that robots report without needle deployment",
        Length,
        Configuration(|each| Some(each.budget.as_ref()?.before_insertion?.lateral_rms_m)),
    )
    .known(Value, OverBudget, FinalPosture)
    .better(Less, NEEDLE_RESOLUTION_M),
    Metric::new(
        "tip_lateral_rms",
        "RMS lateral tip error",
        "root-mean-square lateral distance of the needle tip from the target, analytic",
        Length,
        Configuration(|each| Some(budget(each)?.lateral_rms_m)),
    )
    .known(Value, OverBudget, FinalPosture)
    .in_static_cases("tip_lateral_rms_static")
    .better(Less, NEEDLE_RESOLUTION_M)
    .criterion("max_tip_lateral_rms_mm", ALL, |criteria| {
        criteria.max_tip_lateral_rms_mm.map(|mm| mm * MM)
    })
    .detail(|each, _, _| each.budget_failure.clone().unwrap_or_default()),
];
