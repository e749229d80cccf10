//! The fit by which the controller registers the phantom, and what errors of its markers do to it.

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Matrix6x3, Point3, Vector3, Vector6};
use needlebench_kinematics::Pose;
use needlebench_kinematics::registration::{
    Localised, RegistrationError, register, register_weighted, transform_covariance,
};
use needlebench_scenario::imperfections::{Localisation, Markers};

/// The pose that the controller's fit gives the markers where they are seen at `places_m`: all alike, or each by
/// the inverse of its measured covariance.
pub(crate) fn fitted(
    markers: &Markers,
    places_m: &[Point3<f64>],
) -> Result<Pose, RegistrationError> {
    let Localisation::Measured { covariances_m2 } = &markers.localisation else {
        return register(&markers.places_m, places_m);
    };
    let own = markers.places_m.iter();
    let own: Vec<Localised> = own.map(|at_m| Localised::isotropic(*at_m, 0.0)).collect();
    let seen = places_m.iter().zip(covariances_m2);
    let seen: Vec<Localised> = seen
        .map(|(&at_m, &covariance_m2)| Localised {
            at_m,
            covariance_m2,
        })
        .collect();
    Ok(register_weighted(&own, &seen)?.to_from_from)
}

/// How far each marker is seen from where it is, phantom frame, m, for three standard variables of each.
pub(crate) fn seen_off_m(markers: &Markers, values: &[f64]) -> Vec<Vector3<f64>> {
    let each = values.chunks_exact(3).map(Vector3::from_column_slice);
    match &markers.localisation {
        Localisation::Assumed { rms_m } => {
            let spread_m = rms_m / 3.0_f64.sqrt();
            each.map(|values| values * spread_m).collect()
        }
        Localisation::Measured { covariances_m2 } => each
            .zip(covariances_m2)
            .map(|(values, covariance)| {
                let root = covariance.cholesky().expect("checked with the scenario");
                root.l() * values
            })
            .collect(),
    }
}

/// Error of the fitted pose: a point `p` is displaced by `t + w x (p - about)`, phantom frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FitError {
    about_m: Point3<f64>,
    /// Of `(t, w)`, m and rad; of first order in the markers' errors over the size of their layout.
    covariance: Matrix6<f64>,
    /// Mean of `(t, w)`, of second order.
    mean: Vector6<f64>,
}

impl FitError {
    /// By markers that are seen as well as their localisation says.
    pub(crate) fn of_localisation(markers: &Markers) -> Result<Self, RegistrationError> {
        match &markers.localisation {
            Localisation::Assumed { rms_m } => Self::unweighted(markers, *rms_m),
            Localisation::Measured { covariances_m2 } => {
                Self::weighted(markers, covariances_m2, covariances_m2)
            }
        }
    }

    /// By markers that have moved by this standard deviation along each axis, of which the fit knows nothing.
    pub(crate) fn of_shifts(markers: &Markers, shift_m: f64) -> Result<Self, RegistrationError> {
        match &markers.localisation {
            Localisation::Assumed { .. } => Self::unweighted(markers, shift_m * 3.0_f64.sqrt()),
            Localisation::Measured { covariances_m2 } => {
                let shifts = Matrix3::from_diagonal_element(shift_m * shift_m);
                Self::weighted(
                    markers,
                    covariances_m2,
                    &vec![shifts; markers.places_m.len()],
                )
            }
        }
    }

    /// All markers alike, of one error in all directions: the closed form, without a mean of second order.
    fn unweighted(markers: &Markers, rms_m: f64) -> Result<Self, RegistrationError> {
        let (about_m, covariance) = transform_covariance(&markers.places_m, rms_m)?;
        Ok(Self {
            about_m,
            covariance,
            mean: Vector6::zeros(),
        })
    }

    /// Markers that the fit weighs by the inverses of some covariances, and whose errors have others.
    ///
    /// The fit minimises `sum (g - e)^T W (g - e)` with `g = t + w x r + w x (w x r) / 2` and `J = [1, -[r]]`. Its first
    /// order is `sum G e`, `G = A^-1 J^T W`, `A = sum J^T W J`; what is of second order, on average, makes the
    /// gradient's mean vanish.
    fn weighted(
        markers: &Markers,
        weighed_by: &[Matrix3<f64>],
        errors: &[Matrix3<f64>],
    ) -> Result<Self, RegistrationError> {
        let (about_m, _) = transform_covariance(&markers.places_m, 0.0)?;
        let arms = markers.places_m.iter().map(|at| at - about_m);
        let pairs: Vec<(Vector3<f64>, Matrix3<f64>)> = arms
            .zip(weighed_by)
            .enumerate()
            .map(|(index, (arm, covariance))| {
                let weight = covariance.try_inverse();
                Ok((
                    arm,
                    weight.ok_or(RegistrationError::BadCovariance { index })?,
                ))
            })
            .collect::<Result<_, _>>()?;
        let information = pairs.iter().map(|(arm, weight)| {
            let moves = displacement(arm);
            moves.transpose() * weight * moves
        });
        let information: Matrix6<f64> = information.sum();
        let inverse = information
            .cholesky()
            .ok_or(RegistrationError::Undetermined)?
            .inverse();
        let gain = |arm: &Vector3<f64>, weight: &Matrix3<f64>| -> Matrix6x3<f64> {
            inverse * displacement(arm).transpose() * weight
        };
        let of_each = pairs.iter().zip(errors).map(|((arm, weight), error)| {
            let gain = gain(arm, weight);
            gain * error * gain.transpose()
        });
        let covariance: Matrix6<f64> = of_each.sum();
        let turned = half_turned_twice(&covariance);
        let mut gradient = Vector6::zeros();
        for ((arm, weight), error) in pairs.iter().zip(errors) {
            let moves = displacement(arm);
            gradient += moves.transpose() * (weight * (turned * arm));
            // What the turn shares with what the fit leaves of this marker, weighted: nothing, where errors are as
            // they are weighed.
            let left = covariance * moves.transpose() - gain(arm, weight) * error;
            let shared: Matrix3<f64> = left.fixed_rows::<3>(3) * weight;
            let bent = arm * shared.trace() - shared * arm * 2.0 + shared.transpose() * arm;
            let mut turn = gradient.fixed_rows_mut::<3>(3);
            turn += bent * 0.5;
        }
        Ok(Self {
            about_m,
            covariance,
            mean: -(inverse * gradient),
        })
    }

    /// Of how the fit slides, m, and turns, rad.
    pub(crate) fn covariance(&self) -> &Matrix6<f64> {
        &self.covariance
    }

    /// How it moves a point (target registration error).
    pub(crate) fn moves_at(&self, point: &Point3<f64>) -> Matrix3x6<f64> {
        displacement(&(point - self.about_m))
    }

    /// Mean of where a point is planned, less where it is by the inverse of the fit; of second order, m.
    ///
    /// The inverse moves a point at `r` by `-t - w x r + w x (w x r) / 2 + w x t`.
    pub(crate) fn mean_at(&self, point: &Point3<f64>) -> Vector3<f64> {
        let arm = point - self.about_m;
        let [slid, turned] = [0, 3].map(|at| self.mean.fixed_rows::<3>(at).into_owned());
        let shared = self.covariance.fixed_view::<3, 3>(3, 0);
        let crossed = Vector3::new(
            shared[(1, 2)] - shared[(2, 1)],
            shared[(2, 0)] - shared[(0, 2)],
            shared[(0, 1)] - shared[(1, 0)],
        );
        slid + turned.cross(&arm) - crossed - half_turned_twice(&self.covariance) * arm
    }
}

/// How a point at `arm` is moved by `(t, w)`.
fn displacement(arm: &Vector3<f64>) -> Matrix3x6<f64> {
    let mut moves = Matrix3x6::identity();
    moves
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&-arm.cross_matrix());
    moves
}

/// Mean of `w x (w x r) / 2` as a matrix times `r`.
fn half_turned_twice(covariance: &Matrix6<f64>) -> Matrix3<f64> {
    let rotation = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    0.5 * (rotation - Matrix3::identity() * rotation.trace())
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
