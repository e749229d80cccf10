//! The budget by many draws: each one an arm and a patient, settled and measured as in a run.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use needlebench_kinematics::Joints;
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::imperfections::Imperfections;

use super::{BudgetCase, BudgetError, Moments};
use crate::jitter::Jitter;
use crate::{Bending, Draw, DrawnNeedle, Layout, Source, Truth, settle};

/// What many draws say.
pub(super) struct Drawn {
    /// At skin and target: moments, and the two distances, m, between which the one is that 95 % of all draws stay within,
    /// with a confidence of 95 %.
    pub points: [(Moments, [f64; 2]); 2],
    /// Covariance of what is off at the skin with what is off at the target, m^2.
    pub cross_m2: Matrix3<f64>,
}

/// Moments at skin and target, and the two distances, m, between which the one is that 95 % of all draws stay within,
/// with a confidence of 95 %.
pub(super) fn moments(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    samples: usize,
    seed: u64,
) -> Result<Drawn, BudgetError> {
    let layout = Layout::new(imperfections);
    let mut random = SplitMix64::new(seed);
    let draws = layout.hypercube(samples, &mut random);
    let friction = case.friction(imperfections);
    let target = case.target();
    let planned = case.planned();
    let depths_m = case.depths_m();
    let from_world = case.axes_from_world();

    let middle = Draw(vec![0.0; layout.len()]);
    let typical = Truth::new(case.cell, case.place, imperfections, &layout, &middle, 0)?;
    let jitter = Jitter::new(
        case.servo,
        &typical.dynamics(case.cell),
        &typical,
        &target,
        case.timestep_s,
    )
    .map_or_else(
        || vec![Joints::zeros(); samples],
        |jitter| jitter.samples(samples, &mut random),
    );

    let mut errors: [Vec<Vector3<f64>>; 2] = std::array::from_fn(|_| Vec::with_capacity(samples));
    let bends_m = bends_m(case, imperfections, &layout, &draws);
    for (index, (draw, trembling)) in draws.iter().zip(&jitter).enumerate() {
        let mut truth = Truth::new(case.cell, case.place, imperfections, &layout, draw, 0)?;
        if let (Some(bends_m), Bending::Tissue(needle)) = (&bends_m, &mut truth.bending) {
            needle.know(bends_m[index]);
        }
        let real = truth.dynamics(case.cell);
        let settled = settle(case.servo, &real, &truth, friction.as_ref(), &target)?;
        let position = settled.position + trembling;
        let needle = truth.needle_points(case.cell, &position, depths_m);
        let wanted = truth.wanted(case.goal, &planned);
        let off_m = case.held_off_m.iter().zip(needle).zip(wanted);
        for (errors, ((held_off_m, needle), wanted)) in errors.iter_mut().zip(off_m) {
            errors.push(from_world * (needle - wanted + held_off_m));
        }
    }
    let count = samples as f64;
    let means = errors
        .each_ref()
        .map(|errors| errors.iter().sum::<Vector3<f64>>() / count);
    let both = errors[0].iter().zip(&errors[1]);
    let cross: Matrix3<f64> = both
        .map(|(skin, target)| (skin - means[0]) * (target - means[1]).transpose())
        .sum();
    let cross_m2 = cross / (count - 1.0);
    let points = errors.map(|errors| {
        let mean = errors.iter().sum::<Vector3<f64>>() / count;
        let scatter: Matrix3<f64> = errors
            .iter()
            .map(|error| (error - mean) * (error - mean).transpose())
            .sum();
        let mut distances: Vec<f64> = errors.iter().map(Vector3::norm).collect();
        distances.sort_by(f64::total_cmp);
        (
            Moments::new(&mean, &(scatter / (count - 1.0))),
            between(&distances, 0.95),
        )
    });
    Ok(Drawn { points, cross_m2 })
}

/// How far the needle of each draw is off the goal's axis, m: the same in all configurations. None for one that does not bend
/// in tissue.
fn bends_m(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    layout: &Layout,
    draws: &[Draw],
) -> Option<Arc<[[f64; 2]]>> {
    let (needle, goal) = (imperfections.tissue()?, case.goal);
    let values = |draw| layout.of(Source::Needle, draw);
    let first = values(draws.first()?);
    let solve = || {
        let each = draws
            .iter()
            .map(|draw| DrawnNeedle::new(needle, values(draw)));
        each.map(|drawn| drawn.sizes_m(goal)).collect()
    };
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    let path = goal.needle_path.as_ref()?;
    Some(path.drawn_m(needle, stand_off_m, (first, draws.len()), solve))
}

/// The order statistics between which a quantile is with a confidence of 95 %: how many of independent draws are below it
/// is binomial, here as a normal.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a rank is between 0 and the number of draws"
)]
fn between(sorted: &[f64], share: f64) -> [f64; 2] {
    const TWO_SIDED_95: f64 = 1.959_963_984_540_054;
    let count = sorted.len() as f64;
    let (middle, half) = (
        share * count,
        TWO_SIDED_95 * (count * share * (1.0 - share)).sqrt(),
    );
    [middle - half - 1.0, middle + half].map(|rank| {
        let last = sorted.len() - 1;
        sorted[(rank.max(0.0).round() as usize).min(last)]
    })
}
