//! Rigid registration of point sets, and what its error is expected to be.
//!
//! Fiducials are localised with an error (FLE, fiducial localisation error); a rigid transform is
//! fitted to them; what matters is its error at a point that is no fiducial (TRE, target
//! registration error). How well the fit matches the fiducials themselves (FRE, fiducial
//! registration error) says nothing of a single TRE: the two are uncorrelated (Fitzpatrick 2009,
//! *Fiducial registration error and target registration error are uncorrelated*).
//!
//! The closed forms are those of Fitzpatrick, West and Maurer 1998, *Predicting error in
//! rigid-body point-based registration*, IEEE Trans. Med. Imaging 17(5). They are of first order in
//! FLE over the size of the marker layout, for an FLE that is the same at every fiducial, isotropic,
//! independent and without bias. Where both sets are localised, `fle_rms_m^2` is the sum of the two
//! squared errors.

use nalgebra::{Matrix3, Matrix4, Matrix6, Point3, Quaternion, UnitQuaternion, Vector3};

use crate::Pose;

mod weighted;

pub use weighted::{
    Localised, Residual, WeightedFit, leave_one_out, prediction, register_weighted,
};

/// Fewest points that determine a rotation.
pub const FEWEST_FIDUCIALS: usize = 3;

/// Points whose spread across a line is below this share of the spread along it are collinear.
///
/// Well above the rounding of coordinates that are 1000 times larger than the layout (1e-13), and
/// far below any layout that is of use: at this share the TRE is a million times the FLE.
const COLLINEAR_SPREAD: f64 = 1e-6;

/// Coordinates beyond this are none: nothing measured is as far, and their squares might overflow.
const FARTHEST_M: f64 = 1e9;

/// Gap of the two largest eigenvalues, as a share of the largest, below which two rotations fit
/// equally well: the rounding of the eigenvalues of a 4 x 4 matrix, times 100.
const AMBIGUOUS_GAP: f64 = 1e-13;

/// Why points cannot be registered.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RegistrationError {
    /// Fewer than three points.
    #[error("{count} fiducials do not determine a rotation; at least {FEWEST_FIDUCIALS} do")]
    TooFew {
        /// How many there are.
        count: usize,
    },
    /// Sets of different size.
    #[error("{from} fiducials cannot be matched to {to}: each requires a counterpart")]
    Unmatched {
        /// Points of the first set.
        from: usize,
        /// Points of the second set.
        to: usize,
    },
    /// A coordinate that is not a number, or too large.
    #[error("coordinate {axis} of fiducial {index} is {value}")]
    BadCoordinate {
        /// Which point, from 0.
        index: usize,
        /// `x`, `y` or `z`.
        axis: char,
        /// Its value, m.
        value: f64,
    },
    /// Points on one line, or in one place.
    #[error(
        "the fiducials lie on a line to within {across_m:.1e} m over {along_m:.1e} m: the rotation \
         about it is not determined"
    )]
    Collinear {
        /// Spread along the line, rms, m.
        along_m: f64,
        /// Largest spread across it, rms, m.
        across_m: f64,
    },
    /// Two rotations fit equally well, as for the mirror image of a regular tetrahedron.
    #[error(
        "more than one rotation fits the fiducials equally well; the sets are probably mirror \
         images or not in the same order"
    )]
    Ambiguous,
    /// A localisation error that is negative or not a number.
    #[error("the fiducial localisation error is {fle_rms_m} m; it must be finite and non-negative")]
    BadLocalisationError {
        /// The error, m.
        fle_rms_m: f64,
    },
    /// An invalid covariance, or a pair of points without any error.
    #[error(
        "the covariances of fiducial {index} must be finite, symmetric and positive semidefinite, and their sum \
         positive definite"
    )]
    BadCovariance {
        /// Which pair, from 0.
        index: usize,
    },
    /// Covariances so large that a translation or a rotation is not determined.
    #[error("the covariances are so large in one direction that the transform is not determined")]
    Undetermined,
    /// A weighted fit that does not converge.
    #[error("the weighted fit does not converge; the points are probably not in the same order")]
    NotSettled,
}

/// The rigid transform `to_from_from` that brings `from` nearest to `to`, in the sense of least
/// squares; points correspond by index, coordinates in m.
///
/// Always a proper rotation, also where a reflection would fit better. The rotation is the
/// eigenvector of Horn's 4 x 4 matrix (Horn 1987, *Closed-form solution of absolute orientation
/// using unit quaternions*, J. Opt. Soc. Am. A 4(4)). Its rounding error is about 1e-16 times the
/// layout's longest over its second spread.
///
/// # Errors
/// Fewer than three points, collinear points in either set, sets of different size, two rotations
/// that fit equally well, NaN.
pub fn register(from: &[Point3<f64>], to: &[Point3<f64>]) -> Result<Pose, RegistrationError> {
    if from.len() != to.len() {
        return Err(RegistrationError::Unmatched {
            from: from.len(),
            to: to.len(),
        });
    }
    let from_centre = Layout::new(from)?.centroid;
    let to_centre = Layout::new(to)?.centroid;
    let correlation = from.iter().zip(to).fold(Matrix3::zeros(), |sum, (a, b)| {
        sum + (a - from_centre) * (b - to_centre).transpose()
    });
    let rotation = best_rotation(&correlation).ok_or(RegistrationError::Ambiguous)?;
    let translation = to_centre - rotation * from_centre;
    Ok(Pose::from_parts(translation.into(), rotation))
}

/// The rotation that maximises `trace(R C)`, `C` the sum of `from * to^T`.
fn best_rotation(c: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let (yz, zx, xy) = (
        c[(1, 2)] - c[(2, 1)],
        c[(2, 0)] - c[(0, 2)],
        c[(0, 1)] - c[(1, 0)],
    );
    let symmetric = c + c.transpose();
    let (sxy, syz, szx) = (symmetric[(0, 1)], symmetric[(1, 2)], symmetric[(2, 0)]);
    let (x, y, z) = (c[(0, 0)], c[(1, 1)], c[(2, 2)]);
    let horn = Matrix4::new(
        x + y + z,
        yz,
        zx,
        xy, //
        yz,
        x - y - z,
        sxy,
        szx, //
        zx,
        sxy,
        y - z - x,
        syz, //
        xy,
        szx,
        syz,
        z - x - y,
    );
    let eigen = horn.symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    let gap = (0..4)
        .filter(|&other| other != largest)
        .map(|other| eigen.eigenvalues[largest] - eigen.eigenvalues[other])
        .fold(f64::INFINITY, f64::min);
    if gap <= AMBIGUOUS_GAP * eigen.eigenvalues.amax() {
        return None;
    }
    let q = eigen.eigenvectors.column(largest);
    UnitQuaternion::try_new(Quaternion::new(q[0], q[1], q[2], q[3]), 0.0)
}

/// Fiducial registration error: root mean square distance, m, between `fitted * from` and `to`.
///
/// 0 for no points. A measure of FLE ([`fle_rms_from_fre_m`]), never of TRE.
pub fn fre_rms_m(fitted: &Pose, from: &[Point3<f64>], to: &[Point3<f64>]) -> f64 {
    let count = from.len().min(to.len());
    if count == 0 {
        return 0.0;
    }
    let sum: f64 = from
        .iter()
        .zip(to)
        .map(|(a, b)| (fitted * a - b).norm_squared())
        .sum();
    (sum / count as f64).sqrt()
}

/// Target registration error: the vector, m, in the fit's destination frame, from where a point
/// really is to where the fitted transform puts it. `at_m` is in the source frame.
pub fn target_registration_error_m(
    fitted: &Pose,
    truth: &Pose,
    at_m: &Point3<f64>,
) -> Vector3<f64> {
    fitted * at_m - truth * at_m
}

/// Expected FRE, rms, m: `<FRE^2> = (1 - 2/N) <FLE^2>` (Sibson 1979).
///
/// # Errors
/// Fewer than three fiducials, or an FLE that is negative or not finite.
pub fn expected_fre_rms_m(fiducials: usize, fle_rms_m: f64) -> Result<f64, RegistrationError> {
    check_count(fiducials)?;
    check_fle(fle_rms_m)?;
    Ok(fle_rms_m * (1.0 - 2.0 / fiducials as f64).sqrt())
}

/// FLE, rms, m, that is expected from an FRE (rms over many registrations): the inverse of
/// [`expected_fre_rms_m`].
///
/// # Errors
/// Fewer than three fiducials, or an FRE that is negative or not finite.
pub fn fle_rms_from_fre_m(fiducials: usize, fre_rms_m: f64) -> Result<f64, RegistrationError> {
    check_count(fiducials)?;
    check_fle(fre_rms_m)?;
    Ok(fre_rms_m / (1.0 - 2.0 / fiducials as f64).sqrt())
}

/// Expected TRE, rms, m, at a point: `<TRE^2> = <FLE^2>/N (1 + 1/3 sum_k d_k^2/f_k^2)`, with `d_k`
/// the distance of the point from principal axis `k` of the fiducials and `f_k` the fiducials' own
/// rms distance from it.
///
/// Points in m, all in one frame.
///
/// # Errors
/// As [`register`], and an FLE that is negative or not finite.
pub fn expected_tre_rms_m(
    fiducials_m: &[Point3<f64>],
    at_m: &Point3<f64>,
    fle_rms_m: f64,
) -> Result<f64, RegistrationError> {
    check_fle(fle_rms_m)?;
    let layout = Layout::new(fiducials_m)?;
    let offset_m = at_m - layout.centroid;
    let ratios: f64 = (0..3)
        .map(|k| {
            let along_m = layout.axes.column(k).dot(&offset_m);
            let distance_squared_m2 = offset_m.norm_squared() - along_m * along_m;
            distance_squared_m2 / layout.distance_squared_m2(k)
        })
        .sum();
    Ok(fle_rms_m * ((1.0 + ratios / 3.0) / layout.count).sqrt())
}

/// Covariance, m^2, of the TRE at a point, in the axes of the fiducials' coordinates.
///
/// Its trace is the square of [`expected_tre_rms_m`]. The error has no bias to first order.
///
/// # Errors
/// As [`register`], and an FLE that is negative or not finite.
pub fn tre_covariance(
    fiducials_m: &[Point3<f64>],
    at_m: &Point3<f64>,
    fle_rms_m: f64,
) -> Result<Matrix3<f64>, RegistrationError> {
    let (centroid, covariance) = transform_covariance(fiducials_m, fle_rms_m)?;
    Ok(displacement_covariance(&covariance, &(at_m - centroid)))
}

/// Covariance, m^2, of the displacement `t + w x r` of a point at `r` from where `(t, w)` is counted.
pub fn displacement_covariance(covariance: &Matrix6<f64>, lever_m: &Vector3<f64>) -> Matrix3<f64> {
    // A small rotation w moves the point by w x r = -[r] w.
    let lever = lever_m.cross_matrix();
    let translation = covariance.fixed_view::<3, 3>(0, 0);
    let rotation = covariance.fixed_view::<3, 3>(3, 3);
    let crossed = lever * covariance.fixed_view::<3, 3>(3, 0);
    translation + lever * rotation * lever.transpose() - crossed - crossed.transpose()
}

/// Centroid of the fiducials and covariance of the fitted transform's small error there.
///
/// The error is `(translation of the centroid in m, rotation vector in rad)`, in the axes of the
/// fiducials' coordinates: a point `p` is displaced by `t + w x (p - centroid)`. Translation and
/// rotation are uncorrelated at the centroid and nowhere else. Blocks in m^2 and rad^2.
///
/// # Errors
/// As [`register`], and an FLE that is negative or not finite.
pub fn transform_covariance(
    fiducials_m: &[Point3<f64>],
    fle_rms_m: f64,
) -> Result<(Point3<f64>, Matrix6<f64>), RegistrationError> {
    check_fle(fle_rms_m)?;
    let layout = Layout::new(fiducials_m)?;
    // Least squares: the inverse of sum J^T J, J = [I, -[p]], times the variance of one coordinate.
    let variance_m2 = fle_rms_m * fle_rms_m / 3.0 / layout.count;
    let inverse = Vector3::from_fn(|k, _| variance_m2 / layout.distance_squared_m2(k));
    let rotation = layout.axes * Matrix3::from_diagonal(&inverse) * layout.axes.transpose();
    let mut covariance = Matrix6::zeros();
    covariance
        .fixed_view_mut::<3, 3>(0, 0)
        .fill_diagonal(variance_m2);
    covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    Ok((layout.centroid, covariance))
}

/// Where points lie: centroid, principal axes and mean squares along them.
struct Layout {
    count: f64,
    centroid: Point3<f64>,
    /// Columns: unit principal axes.
    axes: Matrix3<f64>,
    /// Mean square of the coordinates along each axis, m^2.
    spread_squared_m2: Vector3<f64>,
}

impl Layout {
    fn new(points: &[Point3<f64>]) -> Result<Self, RegistrationError> {
        check_count(points.len())?;
        for (index, point) in points.iter().enumerate() {
            for (&value, axis) in point.iter().zip(['x', 'y', 'z']) {
                if value.is_nan() || value.abs() > FARTHEST_M {
                    return Err(RegistrationError::BadCoordinate { index, axis, value });
                }
            }
        }
        let count = points.len() as f64;
        let centroid = points
            .iter()
            .fold(Point3::origin(), |sum, point| sum + point.coords / count);
        let scatter = points.iter().fold(Matrix3::zeros(), |sum, point| {
            let offset = point - centroid;
            sum + offset * offset.transpose() / count
        });
        let eigen = scatter.symmetric_eigen();
        // Rounding can leave the smallest a little below zero.
        let spread_squared_m2 = eigen.eigenvalues.map(|value| value.max(0.0));
        let along_m = spread_squared_m2.max().sqrt();
        let across_m = median(&spread_squared_m2).sqrt();
        if across_m <= COLLINEAR_SPREAD * along_m {
            return Err(RegistrationError::Collinear { along_m, across_m });
        }
        Ok(Self {
            count,
            centroid,
            axes: eigen.eigenvectors,
            spread_squared_m2,
        })
    }

    /// Mean square distance of the points from principal axis `k`, m^2.
    fn distance_squared_m2(&self, k: usize) -> f64 {
        self.spread_squared_m2[(k + 1) % 3] + self.spread_squared_m2[(k + 2) % 3]
    }
}

fn median(values: &Vector3<f64>) -> f64 {
    let mut sorted: [f64; 3] = (*values).into();
    sorted.sort_by(f64::total_cmp);
    sorted[1]
}

fn check_count(count: usize) -> Result<(), RegistrationError> {
    if count < FEWEST_FIDUCIALS {
        return Err(RegistrationError::TooFew { count });
    }
    Ok(())
}

fn check_fle(fle_rms_m: f64) -> Result<(), RegistrationError> {
    if fle_rms_m >= 0.0 && fle_rms_m.is_finite() {
        Ok(())
    } else {
        Err(RegistrationError::BadLocalisationError { fle_rms_m })
    }
}

#[cfg(test)]
#[path = "registration_tests.rs"]
mod tests;
