//! The law of a needle: entry and tip together, its bend, and the breath.

use nalgebra::{Matrix6, Vector6};

use crate::bend::Bend;
use crate::breath::{self, Hold};
use crate::error::LawError;

/// One source of normal errors: its share of the covariance of entry and tip.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name, as the caller prints it.
    pub name: String,
    /// Covariance of (entry x, y, z, tip x, y, z), m^2.
    pub covariance_m2: Matrix6<f64>,
}

/// How the real path of a needle is distributed about the planned one, in the frame of the needle.
#[derive(Debug, Clone, PartialEq)]
pub struct Law {
    mean_m: Vector6<f64>,
    parts: Vec<Part>,
    covariance_m2: Matrix6<f64>,
    /// Symmetric: it follows a covariance without leaps, so that draws of similar laws are similar.
    root_m: Matrix6<f64>,
    inverse_root: Matrix6<f64>,
    bend: Option<Bend>,
    holds: Vec<Hold>,
    breathes: bool,
}

/// Errors whose deviations are taken to be larger.
pub struct Larger<'a> {
    /// How many times as large.
    pub factor: f64,
    /// Whether a source of normal errors is, by its name.
    pub part: &'a dyn Fn(&str) -> bool,
    /// Whether the bend is: about its mean curve, or about the straight needle where its direction is not known.
    pub bend: bool,
    /// Whether the breath is: level, drift about its mean, and how far a failed hold moves.
    pub breath: bool,
}

/// Of products of Jacobians, relative to the largest variance.
const ROUNDING: f64 = 1e-9;

/// Far beyond any needle, and below a millimetre that was taken for a metre.
const WIDEST_M: f64 = 0.1;

impl Law {
    /// Of errors of entry and tip that are normal with this mean, (entry x, y, z, tip x, y, z), m, and covariances that
    /// sum up; of a bend, if the needle bends; and of states of the breath, none if nothing moves.
    ///
    /// Errors of the target in the image belong to the tip, as real minus planned of the needle relative to the lesion.
    ///
    /// # Errors
    /// [`LawError`].
    pub fn new(
        mean_m: Vector6<f64>,
        parts: Vec<Part>,
        bend: Option<Bend>,
        holds: Vec<Hold>,
    ) -> Result<Self, LawError> {
        if !mean_m.iter().all(|each| each.is_finite()) {
            return Err(LawError::NotFinite {
                what: "mean of entry and tip".to_owned(),
            });
        }
        for part in &parts {
            check(&part.name, &part.covariance_m2)?;
        }
        let covariance_m2 = parts
            .iter()
            .fold(Matrix6::zeros(), |sum, part| sum + part.covariance_m2);
        let eigen = covariance_m2.symmetric_eigen();
        let largest = eigen.eigenvalues.max().max(0.0);
        if largest.sqrt() > WIDEST_M {
            return Err(LawError::TooWide {
                sd_m: largest.sqrt(),
                limit_m: WIDEST_M,
            });
        }
        let along = |value: fn(f64) -> f64| {
            let diagonal = eigen.eigenvalues.map(|each| {
                if each > ROUNDING * ROUNDING * largest {
                    value(each)
                } else {
                    0.0
                }
            });
            eigen.eigenvectors * Matrix6::from_diagonal(&diagonal) * eigen.eigenvectors.transpose()
        };
        let breathes = !holds.is_empty();
        let holds = if breathes {
            holds
        } else {
            vec![Hold::still(1.0)]
        };
        breath::check(&holds)?;
        let bends = bend.as_ref().is_some_and(Bend::has_spread);
        let moves = holds.len() > 1 || holds.iter().any(Hold::has_spread);
        if largest <= 0.0 && !bends && !moves {
            return Err(LawError::NoSpread);
        }
        Ok(Self {
            mean_m,
            root_m: along(f64::sqrt),
            inverse_root: along(|each| each.sqrt().recip()),
            parts,
            covariance_m2,
            bend,
            holds,
            breathes,
        })
    }

    /// The same law with larger deviations; the mean of the normal errors stays.
    ///
    /// # Errors
    /// [`LawError`], where they become too large.
    pub fn with(&self, larger: &Larger<'_>) -> Result<Self, LawError> {
        let Larger {
            factor,
            part: is_larger,
            bend,
            breath,
        } = *larger;
        let parts = self.parts.iter().map(|part| Part {
            name: part.name.clone(),
            covariance_m2: if is_larger(&part.name) {
                part.covariance_m2 * factor.powi(2)
            } else {
                part.covariance_m2
            },
        });
        let bends = self.bend.as_ref();
        let holds = if self.breathes {
            self.holds.clone()
        } else {
            Vec::new()
        };
        let holds = holds.into_iter();
        Self::new(
            self.mean_m,
            parts.collect(),
            bends.map(|own| {
                if bend {
                    own.larger(factor)
                } else {
                    own.clone()
                }
            }),
            holds
                .map(|own| if breath { own.larger(factor) } else { own })
                .collect(),
        )
    }

    /// Mean of (entry x, y, z, tip x, y, z), m: of the normal errors alone.
    pub fn mean_m(&self) -> &Vector6<f64> {
        &self.mean_m
    }

    /// Their covariance, m^2: the sum of all parts.
    pub fn covariance_m2(&self) -> &Matrix6<f64> {
        &self.covariance_m2
    }

    /// Sources of the normal errors.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The bend, if there is one.
    pub fn bend(&self) -> Option<&Bend> {
        self.bend.as_ref()
    }

    /// States of the breath; one in which nothing moves if none were given.
    pub fn holds(&self) -> &[Hold] {
        &self.holds
    }

    pub(crate) fn breathes(&self) -> bool {
        self.breathes
    }

    /// Takes six standard normal variables to (entry, tip) less their mean.
    pub(crate) fn root_m(&self) -> &Matrix6<f64> {
        &self.root_m
    }

    /// Pseudo-inverse of the root, 1/m.
    pub(crate) fn inverse_root(&self) -> &Matrix6<f64> {
        &self.inverse_root
    }
}

fn check(part: &str, covariance_m2: &Matrix6<f64>) -> Result<(), LawError> {
    if !covariance_m2.iter().all(|each| each.is_finite()) {
        return Err(LawError::NotFinite {
            what: format!("covariance {part}"),
        });
    }
    let scale = covariance_m2.amax();
    for row in 0..6 {
        for column in 0..row {
            let difference_m2 = covariance_m2[(row, column)] - covariance_m2[(column, row)];
            if difference_m2.abs() > ROUNDING * scale {
                return Err(LawError::NotSymmetric {
                    part: part.to_owned(),
                    row,
                    column,
                    difference_m2,
                });
            }
        }
    }
    let least = covariance_m2.symmetric_eigenvalues().min();
    if least < -ROUNDING * scale {
        return Err(LawError::NotPositive {
            part: part.to_owned(),
            variance_m2: least,
        });
    }
    Ok(())
}
