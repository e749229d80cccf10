//! Why a law is none.

/// Why a law is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LawError {
    /// A mean or a covariance has NaN or infinity.
    #[error("{what} is not finite")]
    NotFinite {
        /// Name of the part, or the mean.
        what: String,
    },
    /// A covariance is not symmetric.
    #[error(
        "covariance {part}: rows {row} and {column} differ by {difference_m2:.3e} m^2 from their mirror image, \
         so it is not symmetric"
    )]
    NotSymmetric {
        /// Name of the part.
        part: String,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// Entry less its mirror image, m^2.
        difference_m2: f64,
    },
    /// A covariance has a negative variance along some axis.
    #[error(
        "covariance {part} is not positive: variance {variance_m2:.3e} m^2 along one axis; \
         hint: entry and tip cannot correlate by more than 1"
    )]
    NotPositive {
        /// Name of the part.
        part: String,
        /// Least variance along an axis, m^2.
        variance_m2: f64,
    },
    /// A standard deviation that no needle has.
    #[error(
        "standard deviation {sd_m:.3} m is beyond {limit_m} m; hint: covariances are in m^2, not mm^2"
    )]
    TooWide {
        /// Largest standard deviation along an axis, m.
        sd_m: f64,
        /// Largest that is accepted, m.
        limit_m: f64,
    },
    /// Nothing varies.
    #[error("nothing varies: of a perfect arm every probability is 0 or 1")]
    NoSpread,
    /// Depths of a bend.
    #[error("fractions of a bend must begin with 0, rise, and end at 1 or beyond")]
    Fractions,
    /// One curve of a bend.
    #[error("curve {curve} of the bend must have a finite value for every fraction")]
    Curve {
        /// Its number, from 0.
        curve: usize,
    },
    /// Turn of a bend.
    #[error("standard deviation of the bend's direction is {spread_rad} rad; must be 0 or more")]
    Turn {
        /// As given, rad.
        spread_rad: f64,
    },
    /// Weight of one state of the breath.
    #[error(
        "weight of state {state} of the breath is {weight}, outside 0 to 1; hint: 0.05 for 5 %"
    )]
    Weight {
        /// Its number, from 0.
        state: usize,
        /// As given.
        weight: f64,
    },
    /// Weights of the states of the breath together.
    #[error("weights of the states of the breath sum to {sum}, not to 1")]
    Weights {
        /// Their sum.
        sum: f64,
    },
    /// Displacements of one state of the breath.
    #[error("a displacement of state {state} of the breath is not finite")]
    Breath {
        /// Its number, from 0.
        state: usize,
    },
}
