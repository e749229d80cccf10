//! The force across a tip from bends that were recorded.

use needlebench_numerics::student;

use crate::guide::Holder;
use crate::insertion::{Bevel, InsertionError, insert};
use crate::layers::{Layer, Layers};
use crate::needle::Needle;

/// A recorded bend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Depth of the tip behind the skin, m.
    pub depth_m: f64,
    /// How far the tip was off the axis then, m, towards the bevel's long side.
    pub bend_m: f64,
}

/// How much stronger the forces of layers are than they were taken to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedForce {
    /// Factor.
    pub factor: f64,
    /// Its 95 % interval: normal errors of the bends that are alike and independent, all else known.
    pub interval: [f64; 2],
    /// Standard deviation of what is left, m.
    pub residual_m: f64,
}

/// Why nothing is fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// There is no insertion.
    #[error(transparent)]
    Insertion(#[from] InsertionError),
    /// Too few for an interval.
    #[error("{0} bends: at least 5 give an interval")]
    Few(usize),
    /// A depth.
    #[error(
        "bend {number} is at a depth of {depth_m} m: depths rise, from above 0 to the layers' end"
    )]
    Depth {
        /// From 1.
        number: usize,
        /// Depth, m.
        depth_m: f64,
    },
    /// Nothing depends on the force.
    #[error("the bends do not tell the force: not identifiable")]
    NotIdentifiable,
}

/// Bends at least.
const LEAST: usize = 5;

/// Steps of Newton's method: bends are linear in the force but for the guide's play.
const STEPS: usize = 30;

/// The factor on all forces of the layers by which the bends of one insertion are met best, in the least-squares sense.
///
/// # Errors
/// [`FitError`].
pub fn fit_force(
    needle: &Needle,
    holder: &Holder,
    stand_off_m: f64,
    layers: &Layers,
    bevel: &Bevel,
    bends: &[Bend],
) -> Result<FittedForce, FitError> {
    if bends.len() < LEAST {
        return Err(FitError::Few(bends.len()));
    }
    let mut before_m = 0.0;
    for (index, bend) in bends.iter().enumerate() {
        let depth_m = bend.depth_m;
        if !(depth_m > before_m && depth_m <= layers.depth_m()) {
            let number = index + 1;
            return Err(FitError::Depth { number, depth_m });
        }
        before_m = depth_m;
    }
    let along = bevel
        .towards
        .iter()
        .map(|each| each * each)
        .sum::<f64>()
        .sqrt();
    let of = |factor: f64| -> Result<Vec<f64>, FitError> {
        let scaled = layers.all().iter().map(|layer| Layer {
            force_n: layer.force_n * factor,
            ..*layer
        });
        let scaled = Layers::from_checked(scaled.collect());
        let done = insert(needle, holder, stand_off_m, &scaled, bevel)?;
        let at = |depth_m: f64| {
            let next = done.depths_m.partition_point(|&each| each < depth_m);
            let next = next.clamp(1, done.depths_m.len() - 1);
            let [from_m, to_m] = [next - 1, next].map(|node| done.depths_m[node]);
            let share = (depth_m - from_m) / (to_m - from_m);
            let bend = |node: usize| {
                let [y, z] = done.path_m[node];
                (y * bevel.towards[0] + z * bevel.towards[1]) / along
            };
            (1.0 - share) * bend(next - 1) + share * bend(next)
        };
        Ok(bends.iter().map(|bend| at(bend.depth_m)).collect())
    };
    let mut factor = 1.0_f64;
    let mut slopes = Vec::new();
    let mut is_found = false;
    for _ in 0..STEPS {
        let step = 1e-4 * factor.abs().max(1e-3);
        let (here, there) = (of(factor)?, of(factor + step)?);
        slopes = here
            .iter()
            .zip(&there)
            .map(|(a, b)| (b - a) / step)
            .collect();
        let steep: f64 = slopes.iter().map(|slope: &f64| slope * slope).sum();
        if steep.is_nan() || steep <= 0.0 {
            return Err(FitError::NotIdentifiable);
        }
        let off = here
            .iter()
            .zip(bends)
            .map(|(found, bend)| bend.bend_m - found);
        let change = off
            .zip(&slopes)
            .map(|(off, slope)| off * slope)
            .sum::<f64>()
            / steep;
        factor += change;
        is_found = change.abs() <= 1e-9 * factor.abs();
        if is_found {
            break;
        }
    }
    // With play, bends jump where the force changes its sign: there may be no factor between.
    if !is_found {
        return Err(FitError::NotIdentifiable);
    }
    let freedom = bends.len() - 1;
    let off = of(factor)?
        .into_iter()
        .zip(bends)
        .map(|(found, bend)| bend.bend_m - found);
    let residual_m = (off.map(|off| off * off).sum::<f64>() / freedom as f64).sqrt();
    let steep: f64 = slopes.iter().map(|slope| slope * slope).sum();
    let half = student::exceeded_with(0.025, freedom as f64) * residual_m / steep.sqrt();
    Ok(FittedForce {
        factor,
        interval: [factor - half, factor + half],
        residual_m,
    })
}
