//! The bend of a needle in tissue: one draw of it, and its distribution.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector2, Vector3};
use needlebench_insertion::{Factor, MODEL};
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::Goal;
use needlebench_scenario::imperfections::{
    Bends as DrawnBends, NeedleDraw, TissueError, TissueNeedle, bend_at_m,
};

use crate::distribution::{Variable, hypercube};

/// Relative standard deviation of Young's modulus from one alloy to another.
const YOUNG_SPREAD: f64 = 0.05;

/// One needle in one patient.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnNeedle {
    needle: TissueNeedle,
    draw: NeedleDraw,
    /// How much more it bends than the model says.
    model: f64,
    /// Of the bevel: from where it is known to be, as a standard normal value, and where it is if that is not known, uniform in
    /// (-1, 1).
    turned: [f64; 2],
    /// What [`DrawnNeedle::sizes_m`] are, once they are known.
    sizes_m: Option<[f64; 2]>,
}

impl DrawnNeedle {
    /// Standard normal variables that it is made of: Young's modulus, a stiffness and a share of the force for each tissue,
    /// the force, the model, the direction. A uniform one follows.
    pub(crate) const NORMALS: usize = 4 + 2 * TissueNeedle::KINDS.len();

    /// From the values of its variables.
    pub(crate) fn new(needle: &TissueNeedle, values: &[f64]) -> Self {
        let kinds = TissueNeedle::KINDS.len();
        let lognormal = |factor: &Factor, value: f64| {
            factor.median * libm::exp(libm::log(factor.spread) * value)
        };
        let of = |factors: &[Factor; TissueNeedle::KINDS.len()], values: &[f64]| {
            std::array::from_fn(|index| lognormal(&factors[index], values[index]))
        };
        let (stiffnesses, rest) = values[4..].split_at(kinds);
        let mut draw = NeedleDraw {
            needle: needle.needle,
            stiffness_n_m2: of(&needle.stiffness_n_m2, stiffnesses),
            force_shares: of(&needle.force_shares, rest),
            wall_force_n: lognormal(&needle.wall_force_n, values[1]),
        };
        draw.needle.young_pa *= libm::exp(YOUNG_SPREAD * values[0]);
        Self {
            needle: needle.clone(),
            draw,
            model: lognormal(&MODEL, values[2]),
            turned: [values[3], rest[kinds]],
            sizes_m: None,
        }
    }

    /// With sizes that were found before, for the goal that it is asked of from here on.
    pub(crate) fn know(&mut self, sizes_m: [f64; 2]) {
        self.sizes_m = Some(sizes_m);
    }

    /// How far it is off a goal's axis at skin and tip, m, towards where its bevel pushes it.
    pub(crate) fn sizes_m(&self, goal: &Goal) -> [f64; 2] {
        if let Some(sizes_m) = self.sizes_m {
            return sizes_m;
        }
        // A goal that is refused for the bone in its way has no needle; what can be inserted was tried with the medians.
        let bends_m = goal.needle_path.as_ref().and_then(|path| {
            let stand_off_m = goal.standoff_m.unwrap_or(0.0);
            self.needle.bends_m(&self.draw, path, stand_off_m).ok()
        });
        bends_m.map_or([0.0; 2], |[at_skin, at_tip]| [at_skin, at_tip * self.model])
    }

    /// The same across the guide's exit at roll 0, m.
    pub(crate) fn bent_m(&self, goal: &Goal) -> [Vector2<f64>; 2] {
        let [known, anywhere] = self.turned;
        let (from, angle_rad) = match direction(&self.needle, goal) {
            Some(towards) => (towards, self.needle.bevel_spread_rad * known),
            None => (Vector2::x(), PI * anywhere),
        };
        let (sine, cosine) = libm::sincos(angle_rad);
        let towards = from * cosine + across(&from) * sine;
        self.sizes_m(goal).map(|size_m| towards * size_m)
    }
}

/// Where a goal's needle is pushed, if that is known.
fn direction(needle: &TissueNeedle, goal: &Goal) -> Option<Vector2<f64>> {
    let towards = needle.pushed_towards(goal.needle_path.as_ref()?)?;
    Some(Vector2::from(towards))
}

/// A quarter further.
pub(crate) fn across(towards: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-towards.y, towards.x)
}

/// Draws that the distribution of a bend is known by: its mean to 0.5 %, its standard deviation to 4 % (20 000 others).
const DRAWS: usize = 512;

/// How far needles are off a goal's axis where they pierce the skin and at their tips, m, towards where their bevel pushes
/// them: the same draws of patients and needles for every needle and goal.
pub fn drawn_bends_m(needle: &TissueNeedle, goal: &Goal) -> Vec<[f64; 2]> {
    let sizes_m = |row: Vec<f64>| DrawnNeedle::new(needle, &row).sizes_m(goal);
    rows().into_iter().map(sizes_m).collect()
}

/// Values of the variables of each draw.
fn rows() -> Vec<Vec<f64>> {
    let mut variables = vec![Variable::Normal; DrawnNeedle::NORMALS];
    variables.push(Variable::Uniform);
    hypercube(&variables, DRAWS, &mut SplitMix64::new(0))
}

/// Bends of many needles along their way.
#[derive(Debug, Clone)]
pub(crate) struct DrawnCurves {
    /// Fractions of the way from skin to tip.
    pub fractions: Vec<f64>,
    /// How far each needle is off its axis there, m, towards where its bevel pushes it.
    pub curves_m: Vec<Vec<f64>>,
    /// Towards where, x and y of the guide's exit at roll 0; none where that is not known.
    pub towards: Option<Vector2<f64>>,
}

/// Fractions of a way that a curve is known at.
const FRACTIONS: u32 = 16;

/// The draws of [`drawn_bends_m`], along the whole way: the model's own factor is 1 at the skin and grows with the depth.
///
/// # Errors
/// [`NoBend`].
pub(crate) fn drawn_curves(needle: &TissueNeedle, goal: &Goal) -> Result<DrawnCurves, NoBend> {
    let path = goal.needle_path.as_ref().ok_or(NoBend::Unknown)?;
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    needle.bends_m(&needle.medians(), path, stand_off_m)?;
    let fractions: Vec<f64> = (0..=FRACTIONS)
        .map(|step| f64::from(step) / f64::from(FRACTIONS))
        .collect();
    let curves_m = rows().into_iter().filter_map(|row| {
        let drawn = DrawnNeedle::new(needle, &row);
        let inserted = needle.insert(&drawn.draw, path, stand_off_m).ok()?;
        let depth_m = path.depth_m();
        let at = fractions.iter().map(|fraction| {
            let more = 1.0 + (drawn.model - 1.0) * fraction;
            bend_at_m(&inserted, fraction * depth_m) * more
        });
        Some(at.collect())
    });
    Ok(DrawnCurves {
        curves_m: curves_m.collect(),
        fractions,
        towards: direction(needle, goal),
    })
}

/// Why it is not known how a needle bends.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoBend {
    /// What it passes.
    #[error("it is not known what tissue the needle passes: there is bone in its way")]
    Unknown,
    /// The needle, its guide or the layers.
    #[error(transparent)]
    Needle(#[from] TissueError),
}

/// Bends of many needles in many patients at one goal.
#[derive(Debug, Clone)]
pub(crate) struct Bends {
    drawn: Arc<DrawnBends>,
    /// The mean direction and, a quarter further, the one across it, guide's exit at roll 0; and the standard deviation of
    /// the angle, rad, or none where any angle is as likely.
    axes: [Vector2<f64>; 2],
    spread_rad: Option<f64>,
    /// How far the axis is aimed off the target, the same axes, m.
    aim_m: Vector2<f64>,
}

impl Bends {
    /// Of a needle at a goal: the same draws for every one.
    ///
    /// # Errors
    /// [`NoBend`].
    pub fn new(needle: &TissueNeedle, goal: &Goal) -> Result<Self, NoBend> {
        let path = goal.needle_path.as_ref().ok_or(NoBend::Unknown)?;
        let stand_off_m = goal.standoff_m.unwrap_or(0.0);
        needle.bends_m(&needle.medians(), path, stand_off_m)?;
        let drawn = path.bends(needle, stand_off_m, || {
            DrawnBends::new(&drawn_bends_m(needle, goal))
        });
        let towards = direction(needle, goal);
        let from = towards.unwrap_or_else(Vector2::x);
        Ok(Self {
            drawn,
            axes: [from, across(&from)],
            spread_rad: towards.map(|_| needle.bevel_spread_rad),
            aim_m: (goal.world_from_guide_exit.rotation.inverse() * goal.aim_m).xy(),
        })
    }

    /// At skin (0) or tip (1), along the axes of the guide's exit turned by `turn`.
    pub fn at(&self, index: usize, turn: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Bend {
        let aim_m = [Vector2::zeros(), self.aim_m][index];
        Bend {
            aim_m: turn(Vector3::new(aim_m.x, aim_m.y, 0.0)),
            drawn: Arc::clone(&self.drawn),
            index,
            axes: self
                .axes
                .map(|axis| turn(Vector3::new(axis.x, axis.y, 0.0))),
            spread_rad: self.spread_rad,
        }
    }
}

/// Bends at one place.
#[derive(Debug, Clone)]
pub(crate) struct Bend {
    drawn: Arc<DrawnBends>,
    /// At skin (0) or tip (1).
    index: usize,
    axes: [Vector3<f64>; 2],
    spread_rad: Option<f64>,
    /// How far the axis is aimed off the place, m.
    aim_m: Vector3<f64>,
}

impl Bend {
    /// The same along other axes.
    pub fn turned(self, turn: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            axes: self.axes.map(&turn),
            aim_m: turn(self.aim_m),
            ..self
        }
    }

    /// Mean and covariance, m, m^2.
    pub fn moments(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let sizes_m = &self.drawn.sorted_m[self.index];
        let square_m2 = sizes_m.iter().map(|size| size * size).sum::<f64>() / sizes_m.len() as f64;
        let mean = self.mean();
        (
            self.aim_m + mean,
            self.second() * square_m2 - mean * mean.transpose(),
        )
    }

    /// Mean of the bend itself, m: of a normal angle E cos; none of any angle.
    fn mean(&self) -> Vector3<f64> {
        let Some(spread_rad) = self.spread_rad else {
            return Vector3::zeros();
        };
        let sizes_m = &self.drawn.sorted_m[self.index];
        let mean_m = sizes_m.iter().sum::<f64>() / sizes_m.len() as f64;
        self.axes[0] * (mean_m * libm::exp(-0.5 * spread_rad * spread_rad))
    }

    /// Mean square of its direction: of a normal angle E cos^2 and E sin^2.
    fn second(&self) -> Matrix3<f64> {
        let squares = self.axes.map(|axis| axis * axis.transpose());
        let twice = self
            .spread_rad
            .map_or(0.0, |spread_rad| libm::exp(-2.0 * spread_rad * spread_rad));
        squares[0] * (0.5 * (1.0 + twice)) + squares[1] * (0.5 * (1.0 - twice))
    }

    /// Covariance of the bend at the skin with that at the tip, m^2: one needle, one direction.
    pub fn with_tip(&self, tip: &Self) -> Matrix3<f64> {
        self.second() * self.drawn.product_m2 - self.mean() * tip.mean().transpose()
    }

    /// The bend at two shares of all, each in (0, 1): of its size, and of its direction.
    pub fn quantile(&self, [size, angle]: [f64; 2]) -> Vector3<f64> {
        let sizes_m = &self.drawn.sorted_m[self.index];
        let at = size * sizes_m.len() as f64 - 0.5;
        let last = sizes_m.len() - 1;
        let below = at.clamp(0.0, last as f64);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the number of draws"
        )]
        let index = (below as usize).min(last.saturating_sub(1));
        let next = (index + 1).min(last);
        let share = below - index as f64;
        let size_m = sizes_m[index] * (1.0 - share) + sizes_m[next] * share;
        let angle_rad = match self.spread_rad {
            None => PI * (2.0 * angle - 1.0),
            Some(spread_rad) => spread_rad * needlebench_numerics::normal::quantile(angle),
        };
        let (sine, cosine) = libm::sincos(angle_rad);
        self.aim_m + (self.axes[0] * cosine + self.axes[1] * sine) * size_m
    }
}
