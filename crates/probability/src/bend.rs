//! How a needle bends on its way, as curves that were drawn elsewhere.

use nalgebra::Vector2;

use crate::error::LawError;

/// To which side the curves of a [`Bend`] are turned about the needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BendDirection {
    /// They are where they were given, but for a turn about x that is normal with this standard deviation, rad.
    Known {
        /// Standard deviation of the turn, rad; 0 for none.
        spread_rad: f64,
    },
    /// Any turn about x is as likely.
    Unknown,
}

/// Lateral bends of many needles along their paths, each as likely as the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Bend {
    fractions: Vec<f64>,
    /// The least bent tip first: a larger normal variable is a larger bend.
    curves_m: Vec<Vec<Vector2<f64>>>,
    direction: BendDirection,
}

impl Bend {
    /// `curves_m[i][k]` is how far needle i is off its straight line, along y and z, m, at `fractions[k]` of the
    /// planned depth. Fractions begin with 0, rise, and end at 1 or beyond; in between curves are straight, and beyond
    /// the last fraction they go on straight.
    ///
    /// # Errors
    /// [`LawError::Fractions`], [`LawError::Curve`] or [`LawError::Turn`].
    pub fn new(
        fractions: Vec<f64>,
        mut curves_m: Vec<Vec<Vector2<f64>>>,
        direction: BendDirection,
    ) -> Result<Self, LawError> {
        let rising = fractions.windows(2).all(|pair| pair[0] < pair[1]);
        let [first, last] = [fractions.first(), fractions.last()].map(Option::<&f64>::copied);
        let spans = first == Some(0.0) && last.is_some_and(|last| (1.0..1e3).contains(&last));
        if !rising || !spans {
            return Err(LawError::Fractions);
        }
        if curves_m.is_empty() {
            return Err(LawError::Curve { curve: 0 });
        }
        for (curve, values_m) in curves_m.iter().enumerate() {
            let is_finite = values_m
                .iter()
                .all(|value| value.iter().all(|each| each.is_finite()));
            if !is_finite || values_m.len() != fractions.len() {
                return Err(LawError::Curve { curve });
            }
        }
        if let BendDirection::Known { spread_rad } = direction
            && (spread_rad < 0.0 || !spread_rad.is_finite())
        {
            return Err(LawError::Turn { spread_rad });
        }
        let tip = |curve: &Vec<Vector2<f64>>| interpolate(&fractions, curve, 1.0).norm();
        curves_m.sort_by(|a, b| tip(a).total_cmp(&tip(b)));
        Ok(Self {
            fractions,
            curves_m,
            direction,
        })
    }

    /// Fractions of the planned depth at which the curves were given.
    pub fn fractions(&self) -> &[f64] {
        &self.fractions
    }

    /// How the curves are turned.
    pub fn direction(&self) -> BendDirection {
        self.direction
    }

    /// How many curves there are.
    pub(crate) fn count(&self) -> usize {
        self.curves_m.len()
    }

    /// Curve `index` at a fraction of the planned depth, before it is turned, m.
    pub(crate) fn at(&self, index: usize, fraction: f64) -> Vector2<f64> {
        interpolate(&self.fractions, &self.curves_m[index], fraction)
    }

    /// Curves that differ so many times as much from their mean, or from the straight line where any turn is as likely.
    pub(crate) fn larger(&self, factor: f64) -> Self {
        let count = self.curves_m.len() as f64;
        let middle = |station: usize| match self.direction {
            BendDirection::Known { .. } => {
                let all = self.curves_m.iter().map(|curve| curve[station]);
                all.fold(Vector2::zeros(), |sum, each| sum + each) / count
            }
            BendDirection::Unknown => Vector2::zeros(),
        };
        let middle: Vec<Vector2<f64>> = (0..self.fractions.len()).map(middle).collect();
        let curve = |curve: &Vec<Vector2<f64>>| {
            let both = curve.iter().zip(&middle);
            both.map(|(value, middle)| middle + (value - middle) * factor)
                .collect()
        };
        // In their order: a larger normal variable is a larger bend of the same needle.
        Self {
            fractions: self.fractions.clone(),
            curves_m: self.curves_m.iter().map(curve).collect(),
            direction: match self.direction {
                BendDirection::Known { spread_rad } => BendDirection::Known {
                    spread_rad: spread_rad * factor,
                },
                BendDirection::Unknown => BendDirection::Unknown,
            },
        }
    }

    /// Whether two draws can differ.
    pub(crate) fn has_spread(&self) -> bool {
        let is_turned = match self.direction {
            BendDirection::Known { spread_rad } => spread_rad > 0.0,
            BendDirection::Unknown => true,
        };
        let is_bent = |curve: &Vec<Vector2<f64>>| curve.iter().any(|each| each.norm() > 0.0);
        let differ = self.curves_m.windows(2).any(|pair| pair[0] != pair[1]);
        differ || is_turned && self.curves_m.iter().any(is_bent)
    }
}

fn interpolate(fractions: &[f64], curve: &[Vector2<f64>], fraction: f64) -> Vector2<f64> {
    let next = fractions.partition_point(|each| *each < fraction);
    let next = next.clamp(1, fractions.len() - 1);
    let (from, to) = (fractions[next - 1], fractions[next]);
    let share = (fraction - from) / (to - from);
    curve[next - 1] * (1.0 - share) + curve[next] * share
}

/// A lateral vector turned about x by an angle with this cosine and sine.
pub(crate) fn turned(vector: Vector2<f64>, [cosine, sine]: [f64; 2]) -> Vector2<f64> {
    Vector2::new(
        cosine * vector.x - sine * vector.y,
        sine * vector.x + cosine * vector.y,
    )
}
