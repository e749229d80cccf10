//! Which origin of variance moves a probability most: halved one at a time, by reweighting the same draws.

use nalgebra::{Matrix6, Vector6};

use crate::draw::Values;
use crate::law::Law;

/// Where variance comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A part of the covariance, by its number.
    Part(usize),
    /// Level of the breath.
    Level,
    /// Drift of the breath.
    Drift,
    /// Failed holds: how likely they are.
    FailedHolds,
    /// Boundary of the structure that the event is of.
    Boundary,
}

/// What a probability becomes if the variance from one origin, or the weight of failed holds, is halved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Influence {
    /// Of what.
    pub origin: Origin,
    /// The probability then.
    pub halved: f64,
}

/// Densities of draws under laws with less variance, relative to the one that they were drawn from.
pub(crate) struct Reweighting {
    /// Of each part: exponent of the ratio, and its factor.
    parts: Vec<(Matrix6<f64>, f64)>,
    level: bool,
    drift: bool,
    /// Probability of failed holds, if there are some and others.
    failed: Option<f64>,
    fails: Vec<bool>,
}

impl Reweighting {
    pub fn new(law: &Law) -> Self {
        let whitening = law.inverse_root();
        let halved = |covariance_m2: &Matrix6<f64>| {
            // In standard normal space the covariance is 1 - M/2, and M is at most 1: nothing here is near singular.
            let share = whitening * covariance_m2 * whitening;
            let share = 0.5 * (share + share.transpose());
            let eigen = share.symmetric_eigen();
            let left = eigen
                .eigenvalues
                .map(|value| 1.0 - 0.5 * value.clamp(0.0, 1.0));
            let exponent = left.map(|value| -0.5 * (value.recip() - 1.0));
            let factor = left.iter().map(|value| value.sqrt().recip()).product();
            let turned = eigen.eigenvectors * Matrix6::from_diagonal(&exponent);
            (turned * eigen.eigenvectors.transpose(), factor)
        };
        let any = |of: fn(&crate::breath::Hold) -> bool| law.holds().iter().any(of);
        let fails: Vec<bool> = law
            .holds()
            .iter()
            .map(|hold| hold.failed_m.is_some())
            .collect();
        let failed: f64 = law
            .holds()
            .iter()
            .filter(|hold| hold.failed_m.is_some())
            .map(|hold| hold.weight)
            .sum();
        Self {
            parts: law
                .parts()
                .iter()
                .map(|part| halved(&part.covariance_m2))
                .collect(),
            level: any(|hold| hold.level_sd_m.iter().any(|each| each.norm() > 0.0)),
            drift: any(|hold| hold.drift_sd_m.iter().any(|each| each.norm() > 0.0)),
            failed: (failed > 0.0 && failed < 1.0).then_some(failed),
            fails,
        }
    }

    /// Origins, in the order of the ratios; `has_boundary` is whether the event is of one structure with a boundary.
    pub fn origins(&self, has_boundary: bool) -> Vec<Origin> {
        let mut origins: Vec<Origin> = (0..self.parts.len()).map(Origin::Part).collect();
        origins.extend(self.level.then_some(Origin::Level));
        origins.extend(self.drift.then_some(Origin::Drift));
        origins.extend(self.failed.map(|_| Origin::FailedHolds));
        origins.extend(has_boundary.then_some(Origin::Boundary));
        origins
    }

    /// Adds the weight of a draw, times each ratio, to sums in the order of the origins.
    pub fn add(&self, values: &Values, boundary: Option<f64>, weight: f64, sums: &mut [f64]) {
        let linear = Vector6::from(values.linear);
        let parts = self
            .parts
            .iter()
            .map(|(exponent, factor)| factor * libm::exp(linear.dot(&(exponent * linear))));
        // Half the variance of one standard normal variable.
        let half = |value: f64| std::f64::consts::SQRT_2 * libm::exp(-0.5 * value * value);
        let level = self.level.then(|| half(values.level));
        let drift = self.drift.then(|| half(values.drift));
        let failed = self.failed.map(|failed| {
            if self.fails[values.hold] {
                0.5
            } else {
                (1.0 - 0.5 * failed) / (1.0 - failed)
            }
        });
        let boundary = boundary.map(half);
        let others = [level, drift, failed, boundary];
        let ratios = parts.chain(others.into_iter().flatten());
        for (sum, ratio) in sums.iter_mut().zip(ratios) {
            *sum += weight * ratio;
        }
    }
}
