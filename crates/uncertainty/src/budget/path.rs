//! How likely each path of a needle is: what the budget's sources do to entry and tip together.

use nalgebra::{Matrix6, Rotation3, Vector2, Vector3, Vector6};
use needlebench_numerics::normal;
use needlebench_probability::{Bend, BendDirection, Hold, Law, LawError, Part};
use needlebench_scenario::imperfections::{Breathing, Imperfections};

use super::breath::breath_moments;
use super::{BudgetCase, BudgetError, analytic};
use crate::Source;
use crate::bend::drawn_curves;
use crate::truth::{breath, only};

/// Phases that a held breath without a level is taken at, each as likely: its phase is normal, and what it moves by is
/// not.
const PHASES: u32 = 16;

/// Why there is no law.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PathError {
    /// The budget.
    #[error(transparent)]
    Budget(#[from] BudgetError),
    /// The law itself.
    #[error(transparent)]
    Law(#[from] LawError),
}

/// The law of a needle's path in one configuration, frame of the needle: x along the guide's axis from the planned entry
/// point, y and z along x and y of the goal's guide exit at roll 0, m.
///
/// Of first order in all that is linear, with play as its normal of the same covariance, one part for each source; the bend in
/// tissue as its drawn curves, the breath as its states, whose level and drift are exact. Where the guide is aimed against the bend, the path is about its axis
/// all the same. Against draws that are settled and measured as in a run, quantiles of how far entry and tip are off, and of
/// how much farther the one than the other, are within 5 % (tests).
///
/// # Errors
/// [`PathError`]; among them a perfect arm, whose path is known.
pub fn path_law(case: &BudgetCase<'_>) -> Result<Law, PathError> {
    let all = case.imperfections;
    let rotation = needle_from_budget();
    let (mut mean_m, _) = analytic::joint(case, all)?;
    let mut parts = Vec::new();
    for source in Source::ALL.into_iter().filter(|source| source.is_in(all)) {
        let (_, covariance_m2) = analytic::joint(case, &only(all, |each| each == source))?;
        if covariance_m2.norm() > 0.0 {
            parts.push(Part {
                name: source.name().to_owned(),
                covariance_m2: rotation * covariance_m2 * rotation.transpose(),
            });
        }
    }
    if let Some(skin) = &all.skin_markers {
        // The phantom is believed to be where its markers have risen to.
        let risen_m = in_budget(case, &skin.breathing.skin_m);
        let (share, variance) = breath_moments(&skin.breathing);
        let both_m = stack([risen_m; 2]);
        mean_m += both_m * share;
        let both_m = rotation * both_m;
        parts.push(Part {
            name: Source::SkinMarkers.name().to_owned(),
            covariance_m2: both_m * both_m.transpose() * variance,
        });
    }
    let holds = all
        .breathing
        .as_ref()
        .map(|breathing| holds(case, breathing));
    let law = Law::new(
        rotation * mean_m,
        parts,
        bend(case, all)?,
        holds.unwrap_or_default(),
    );
    Ok(law?)
}

/// From the budget's axes, the needle along z, to the needle's, along x.
fn axes() -> Rotation3<f64> {
    let columns = [Vector3::y(), Vector3::z(), Vector3::x()];
    Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&columns))
}

fn needle_from_budget() -> Matrix6<f64> {
    let mut both = Matrix6::zeros();
    for at in [0, 3] {
        both.fixed_view_mut::<3, 3>(at, at)
            .copy_from(axes().matrix());
    }
    both
}

fn stack([skin, target]: [Vector3<f64>; 2]) -> Vector6<f64> {
    Vector6::new(skin.x, skin.y, skin.z, target.x, target.y, target.z)
}

/// A motion of the phantom frame in the budget's axes.
fn in_budget(case: &BudgetCase<'_>, moved_m: &Vector3<f64>) -> Vector3<f64> {
    let place = case
        .place
        .map_or_else(|| *moved_m, |place| place.rotation * moved_m);
    case.axes_from_world() * place
}

/// States of the breath: held, and holds that fail.
fn holds(case: &BudgetCase<'_>, breathing: &Breathing) -> Vec<Hold> {
    let turned = |moved_m: &Vector3<f64>| axes() * in_budget(case, moved_m);
    let full_m = [breathing.skin_m, breathing.target_m].map(|moved_m| turned(&moved_m));
    let drift_m = breathing.drift_m.map_or_else(
        || [Vector3::zeros(); 2],
        |drift_m| drift_m.map(|each| turned(&each)),
    );
    let level_sd_m = full_m.map(|full_m| full_m * breathing.level_sd.unwrap_or(0.0));
    let held = |weight: f64, fullness: f64| Hold {
        level_sd_m,
        drift_m: [0, 1].map(|body| full_m[body] * fullness + drift_m[body]),
        ..Hold::still(weight)
    };
    let failing = |weight: f64| Hold {
        failed_m: Some(full_m),
        ..held(weight, 0.0)
    };
    let Some(spread) = breathing.phase_spread else {
        return vec![failing(1.0)];
    };
    let failure = breathing.hold_failure;
    let mut holds: Vec<Hold> = if breathing.level_sd.is_some() {
        vec![held(1.0 - failure, breath(breathing.phase))]
    } else {
        let strata = (0..PHASES).map(|stratum| {
            let share = (f64::from(stratum) + 0.5) / f64::from(PHASES);
            let fullness = breath(breathing.phase + spread * normal::quantile(share));
            held((1.0 - failure) / f64::from(PHASES), fullness)
        });
        strata.collect()
    };
    if failure > 0.0 {
        holds.push(failing(failure));
    }
    holds
}

/// The bend in tissue; none for a needle that bends in air, which is normal.
fn bend(case: &BudgetCase<'_>, all: &Imperfections) -> Result<Option<Bend>, PathError> {
    let Some(needle) = all.tissue() else {
        return Ok(None);
    };
    let drawn = drawn_curves(needle, case.goal).map_err(BudgetError::from)?;
    let towards = drawn.towards.unwrap_or_else(Vector2::x);
    let curves_m = drawn.curves_m.into_iter().map(|curve_m| {
        let along = curve_m.into_iter().map(|off_m| towards * off_m);
        along.collect()
    });
    let direction = match drawn.towards {
        Some(_) => BendDirection::Known {
            spread_rad: needle.bevel_spread_rad,
        },
        None => BendDirection::Unknown,
    };
    Ok(Some(Bend::new(
        drawn.fractions,
        curves_m.collect(),
        direction,
    )?))
}
