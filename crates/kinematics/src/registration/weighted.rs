//! Registration of points whose errors differ from point to point and from direction to direction.

use nalgebra::{Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use super::{Layout, RegistrationError, displacement_covariance, register};
use crate::Pose;

/// Rounds after which a fit that has not settled will not: from the unweighted fit, five are usual.
const MOST_ROUNDS: usize = 100;

/// Step, as a share of the layout's size, below which the fit has settled: the rounding of its coordinates, times 100.
const SETTLED: f64 = 1e-13;

/// Smallest over largest eigenvalue of the scaled information below which a direction is not determined.
const UNDETERMINED: f64 = 1e-13;

/// A point and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Localised {
    /// Where it is thought to be.
    pub at_m: Point3<f64>,
    /// Covariance of its error, m^2, in the axes of its coordinates: symmetric, not negative, zero if exact.
    pub covariance_m2: Matrix3<f64>,
}

impl Localised {
    /// With the same standard deviation along every axis.
    pub fn isotropic(at_m: Point3<f64>, sigma_m: f64) -> Self {
        Self {
            at_m,
            covariance_m2: Matrix3::from_diagonal_element(sigma_m * sigma_m),
        }
    }
}

/// Residual of a fit at a pair of points, or of a fit to the other pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// `fitted * from - to`, m.
    pub error_m: Vector3<f64>,
    /// Covariance of that error if the stated covariances hold, m^2.
    pub covariance_m2: Matrix3<f64>,
    /// Of a residual, its share of the fit's chi-square. Of a prediction, its own, with three degrees of freedom.
    pub chi_square: f64,
}

/// A rigid transform, its covariance, and what it leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedFit {
    /// The transform.
    pub to_from_from: Pose,
    /// Centroid of the points, in `to`.
    pub about_m: Point3<f64>,
    /// Covariance of the transform's small error `(t, w)`, m and rad, in the axes of `to`: a point `p` of `to` is
    /// displaced by `t + w x (p - about_m)`.
    pub covariance: Matrix6<f64>,
    /// One for each pair of points.
    pub residuals: Vec<Residual>,
    /// Squares of the residuals in units of their points' covariances, summed.
    pub chi_square: f64,
}

impl WeightedFit {
    /// Degrees of freedom of the chi-square: what it is on average if the stated covariances hold.
    pub fn degrees_of_freedom(&self) -> usize {
        3 * self.residuals.len() - 6
    }

    /// Covariance, m^2, in the axes of `to`, of the error at a point given in `from`.
    pub fn tre_covariance(&self, at_m: &Point3<f64>) -> Matrix3<f64> {
        displacement_covariance(&self.covariance, &(self.to_from_from * at_m - self.about_m))
    }

    /// Fiducial registration error, rms, m, and what it is on average if the stated covariances hold.
    pub fn fre_rms_and_expected_m(&self) -> (f64, f64) {
        let count = self.residuals.len() as f64;
        let seen: f64 = self
            .residuals
            .iter()
            .map(|r| r.error_m.norm_squared())
            .sum();
        let expected: f64 = self.residuals.iter().map(|r| r.covariance_m2.trace()).sum();
        ((seen / count).sqrt(), (expected.max(0.0) / count).sqrt())
    }
}

/// The rigid transform that brings `from` nearest to `to` in units of the points' covariances.
///
/// Pairs count by the inverse of `R from R^T + to`, with the covariances of both and the fitted rotation `R`
/// (Balachandran and Fitzpatrick 2009, *Iterative solution for rigid-body point-based registration with anisotropic
/// weighting*), by Gauss-Newton from [`register`]. Its covariance is the inverse of the information (Danilchenko and
/// Fitzpatrick 2011, *General approach to first-order error prediction in rigid point registration*), of first order
/// in the errors over the size of the layout. With equal isotropic covariances it is [`register`].
///
/// # Errors
/// As [`register`]; a covariance that is negative or no number, or that is zero on both sides; covariances so wide
/// that they leave the transform open.
pub fn register_weighted(
    from: &[Localised],
    to: &[Localised],
) -> Result<WeightedFit, RegistrationError> {
    let places = |points: &[Localised]| points.iter().map(|p| p.at_m).collect::<Vec<_>>();
    let (from_m, to_m) = (places(from), places(to));
    let start = register(&from_m, &to_m)?;
    let layout = Layout::new(&to_m)?;
    check_covariances(from, to)?;
    let frame = Frame {
        about_m: layout.centroid,
        size_m: layout.spread_squared_m2.sum().sqrt(),
    };
    let mut pose = start;
    for _ in 0..MOST_ROUNDS {
        let normal = frame.normal_equations(&pose, from, to)?;
        let root = normal.information.cholesky();
        let step = root
            .ok_or(RegistrationError::Undetermined)?
            .solve(&normal.gradient);
        pose = frame.moved(&pose, &step);
        if step.amax() < SETTLED {
            return frame.fit(&pose, from, to);
        }
    }
    Err(RegistrationError::NotSettled)
}

/// Residual at each pair of the fit to all other pairs; `None` where the others do not determine a transform.
///
/// The error's covariance is that of the prediction and of the pair itself: a pair whose chi-square is far above three
/// is not where the others say.
pub fn leave_one_out(from: &[Localised], to: &[Localised]) -> Vec<Option<Residual>> {
    let without = |points: &[Localised], left: usize| -> Vec<Localised> {
        let mut others = points.to_vec();
        others.remove(left);
        others
    };
    (0..from.len().min(to.len()))
        .map(|left| {
            let fit = register_weighted(&without(from, left), &without(to, left)).ok()?;
            prediction(&fit, &from[left], &to[left])
        })
        .collect()
}

/// Residual of a fit at a pair that was not part of it.
pub fn prediction(fit: &WeightedFit, from: &Localised, to: &Localised) -> Option<Residual> {
    let error_m = fit.to_from_from * from.at_m - to.at_m;
    let covariance_m2 = combined(&fit.to_from_from, from, to) + fit.tre_covariance(&from.at_m);
    let chi_square = error_m.dot(&(covariance_m2.try_inverse()? * error_m));
    Some(Residual {
        error_m,
        covariance_m2,
        chi_square,
    })
}

/// Covariance of `pose * from - to` for a known pose.
fn combined(pose: &Pose, from: &Localised, to: &Localised) -> Matrix3<f64> {
    let rotation = pose.rotation.to_rotation_matrix();
    rotation * from.covariance_m2 * rotation.transpose() + to.covariance_m2
}

fn check_covariances(from: &[Localised], to: &[Localised]) -> Result<(), RegistrationError> {
    for (index, (a, b)) in from.iter().zip(to).enumerate() {
        let bad = |m: &Matrix3<f64>| {
            let size = m.amax();
            !m.iter().all(|value| value.is_finite())
                || (m - m.transpose()).amax() > 1e-9 * size
                || m.symmetric_eigenvalues().min() < -1e-9 * size
        };
        if bad(&a.covariance_m2) || bad(&b.covariance_m2) {
            return Err(RegistrationError::BadCovariance { index });
        }
    }
    Ok(())
}

/// Where small errors are counted from, and the length that makes turns and shifts comparable.
struct Frame {
    about_m: Point3<f64>,
    size_m: f64,
}

/// Information and gradient of a step `(t / size, w)`.
struct Normal {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
}

impl Normal {
    fn covariance(&self) -> Result<Matrix6<f64>, RegistrationError> {
        let eigenvalues = self.information.symmetric_eigenvalues();
        if !eigenvalues.iter().all(|value| value.is_finite())
            || eigenvalues.min() <= UNDETERMINED * eigenvalues.max()
        {
            return Err(RegistrationError::Undetermined);
        }
        self.information
            .try_inverse()
            .ok_or(RegistrationError::Undetermined)
    }
}

impl Frame {
    fn normal_equations(
        &self,
        pose: &Pose,
        from: &[Localised],
        to: &[Localised],
    ) -> Result<Normal, RegistrationError> {
        let mut information = Matrix6::zeros();
        let mut gradient = Vector6::zeros();
        for (index, (a, b)) in from.iter().zip(to).enumerate() {
            let placed = pose * a.at_m;
            // In units of the size: the covariances of points in micrometres and the layout in metres would
            // otherwise leave the information badly scaled.
            let weight = (combined(pose, a, b) / (self.size_m * self.size_m))
                .try_inverse()
                .filter(|weight| weight.iter().all(|value| value.is_finite()))
                .ok_or(RegistrationError::BadCovariance { index })?;
            let jacobian = self.jacobian(&placed);
            let gap = (b.at_m - placed) / self.size_m;
            information += jacobian.transpose() * weight * jacobian;
            gradient += jacobian.transpose() * weight * gap;
        }
        Ok(Normal {
            information,
            gradient,
        })
    }

    /// Displacement of a point over the size, per step.
    fn jacobian(&self, placed: &Point3<f64>) -> nalgebra::Matrix3x6<f64> {
        let mut jacobian = nalgebra::Matrix3x6::identity();
        let lever = (placed - self.about_m) / self.size_m;
        jacobian
            .fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&-lever.cross_matrix());
        jacobian
    }

    fn moved(&self, pose: &Pose, step: &Vector6<f64>) -> Pose {
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
        let shift = step.fixed_rows::<3>(0) * self.size_m;
        let origin = Point3::from(pose.translation.vector);
        let moved = self.about_m + shift + turn * (origin - self.about_m);
        let mut rotation = turn * pose.rotation;
        rotation.renormalize();
        Pose::from_parts(Translation3::from(moved.coords), rotation)
    }

    fn fit(
        &self,
        pose: &Pose,
        from: &[Localised],
        to: &[Localised],
    ) -> Result<WeightedFit, RegistrationError> {
        let scaled = self.normal_equations(pose, from, to)?.covariance()?;
        let unit = Vector6::from_fn(|k, _| if k < 3 { self.size_m } else { 1.0 });
        let covariance = Matrix6::from_fn(|r, c| scaled[(r, c)] * unit[r] * unit[c]);
        let mut residuals = Vec::with_capacity(from.len());
        for (index, (a, b)) in from.iter().zip(to).enumerate() {
            let placed = pose * a.at_m;
            let error_m = placed - b.at_m;
            let own = combined(pose, a, b);
            let weight = own
                .try_inverse()
                .ok_or(RegistrationError::BadCovariance { index })?;
            let explained = displacement_covariance(&covariance, &(placed - self.about_m));
            residuals.push(Residual {
                error_m,
                covariance_m2: own - explained,
                chi_square: error_m.dot(&(weight * error_m)),
            });
        }
        Ok(WeightedFit {
            to_from_from: *pose,
            about_m: self.about_m,
            covariance,
            chi_square: residuals.iter().map(|r| r.chi_square).sum(),
            residuals,
        })
    }
}

#[cfg(test)]
#[path = "weighted_tests.rs"]
mod tests;
