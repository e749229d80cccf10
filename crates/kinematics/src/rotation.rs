//! Rotations as the UR controller writes them, and as matrices.

use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::Pose;

/// Pose from a position (m) and a UR rotation vector (rad): axis times angle.
pub fn pose_from_rotation_vector(position_m: Vector3<f64>, rotvec_rad: Vector3<f64>) -> Pose {
    Pose::from_parts(
        Translation3::from(position_m),
        UnitQuaternion::from_scaled_axis(rotvec_rad),
    )
}

/// Rotation vector of a rotation, rad, with an angle in `[0, pi]`.
///
/// Accurate to 2e-16 at every angle: the half angle comes from `atan2`, never from `acos`.
pub fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let imaginary = rotation.imag();
    let (imaginary, real) = if rotation.w < 0.0 {
        (-imaginary, -rotation.w)
    } else {
        (imaginary, rotation.w)
    };
    let sine = imaginary.norm();
    if sine < 1e-150 {
        return imaginary * 2.0;
    }
    imaginary * (2.0 * libm::atan2(sine, real) / sine)
}

/// Angle between two rotations, rad, in `[0, pi]`.
pub fn rotation_angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    rotation_vector(&(a.inverse() * b)).norm()
}

/// A matrix that is not a rotation.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the matrix is not a rotation: R^T R differs from the identity by up to {}, the determinant \
     is {determinant:.6}",
    two_digits(*defect)
)]
pub struct NotARotation {
    /// Largest element of `|R^T R - I|`; infinite if an element is not finite.
    pub defect: f64,
    /// Determinant: 1 for a rotation, negative for a mirrored frame.
    pub determinant: f64,
    /// The rotation that is nearest in the sum of squared element differences. `None` where there
    /// is none to speak of: elements that are not finite, a mirrored frame, columns that depend on
    /// one another.
    pub nearest: Option<UnitQuaternion<f64>>,
}

impl NotARotation {
    /// The determinant is negative: the frame is left-handed, such as after the sign of an axis
    /// was lost or two axes were swapped.
    pub fn is_mirrored(&self) -> bool {
        self.determinant < 0.0
    }
}

/// `8.5e-5` or `0.34`: the way in which people write it.
fn two_digits(value: f64) -> String {
    if value < 0.01 {
        format!("{value:.1e}")
    } else {
        format!("{value:.2}")
    }
}

/// A matrix is a rotation below this `|R^T R - I|`.
///
/// Rounding to single precision causes up to 3e-7, to four printed decimals some 8e-5.
const ORTHONORMALITY: f64 = 1e-6;

/// Least singular value, over the greatest, of a matrix that still says which rotation was meant.
const LEAST_SINGULAR_VALUE: f64 = 1e-3;

/// Pose from a rotation matrix and a position, m.
///
/// The rotation is the one nearest to the matrix, which the error bound allows to be off by
/// 5e-7 rad: single precision passes, printed decimals do not.
///
/// # Errors
/// [`NotARotation`] if `|R^T R - I|` exceeds 1e-6 or the determinant is negative.
pub fn pose_from_matrix(
    rotation: &Matrix3<f64>,
    position_m: Vector3<f64>,
) -> Result<Pose, NotARotation> {
    let pose = |rotation| Pose::from_parts(Translation3::from(position_m), rotation);
    if !rotation.iter().all(|element| element.is_finite()) {
        return Err(NotARotation {
            defect: f64::INFINITY,
            determinant: rotation.determinant(),
            nearest: None,
        });
    }
    let defect = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    let determinant = rotation.determinant();
    let nearest = nearest_rotation(rotation);
    match nearest {
        Some(nearest) if defect <= ORTHONORMALITY => Ok(pose(nearest)),
        _ => Err(NotARotation {
            defect,
            determinant,
            nearest,
        }),
    }
}

/// Orthogonal polar factor, if the matrix has a clear one and is not mirrored.
fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let scale = matrix.amax();
    // Scaled so that no product of elements overflows.
    let svd = (matrix / scale).try_svd(true, true, f64::EPSILON, 1000)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let clear = svd.singular_values.min() > LEAST_SINGULAR_VALUE * svd.singular_values.max();
    let factor = u * v_t;
    (clear && factor.determinant() > 0.0).then(|| {
        let mut rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(factor));
        rotation.renormalize();
        rotation
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    /// Ten times the worst rounding over the cases below, rad.
    const ROTATION_RAD: f64 = 2e-14;

    /// The pose that the paper prints, rounded to four decimals as there.
    fn printed_pose() -> Matrix3<f64> {
        let exact = UnitQuaternion::from_scaled_axis(Vector3::new(-0.8567, 2.7197, -1.1407));
        exact
            .to_rotation_matrix()
            .into_inner()
            .map(|element: f64| (element * 1e4).round() * 1e-4)
    }

    #[test]
    fn four_decimals_are_refused_with_their_defect_and_the_nearest_rotation() {
        let printed = printed_pose();
        let error = pose_from_matrix(&printed, Vector3::zeros()).unwrap_err();
        // Half a unit of the fourth decimal in three products of two elements.
        assert!(error.defect > 1e-6 && error.defect < 3e-4, "{error}");
        assert!((error.determinant - 1.0).abs() < 3e-4 && !error.is_mirrored());
        let exact = UnitQuaternion::from_scaled_axis(Vector3::new(-0.8567, 2.7197, -1.1407));
        let nearest = error.nearest.unwrap();
        assert!(rotation_angle_between(&exact, &nearest) < 2e-4);
        // The polar factor: its product with the matrix is symmetric.
        let stretch = nearest.to_rotation_matrix().into_inner().transpose() * printed;
        assert!((stretch - stretch.transpose()).amax() < ROTATION_RAD);
    }

    #[test]
    fn mirrored_frames_have_no_nearest_rotation() {
        let mut mirrored = printed_pose();
        mirrored.column_mut(0).neg_mut();
        let error = pose_from_matrix(&mirrored, Vector3::zeros()).unwrap_err();
        assert!(error.is_mirrored() && error.nearest.is_none());
        let exact = pose_from_matrix(&-Matrix3::identity(), Vector3::zeros()).unwrap_err();
        assert!(exact.is_mirrored() && exact.nearest.is_none());
        assert_eq!(exact.defect, 0.0);
    }

    #[test]
    fn matrices_without_three_directions_have_no_nearest_rotation() {
        for matrix in [
            Matrix3::zeros(),
            Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)),
            Matrix3::repeat(0.5),
            Matrix3::from_diagonal(&Vector3::new(1.0, f64::NAN, 1.0)),
            Matrix3::from_diagonal(&Vector3::new(1.0, f64::INFINITY, 1.0)),
        ] {
            let error = pose_from_matrix(&matrix, Vector3::zeros()).unwrap_err();
            assert!(error.nearest.is_none() && error.defect > 0.7, "{matrix}");
        }
    }

    #[test]
    fn stretched_frames_say_which_rotation_is_nearest() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -1.2, 2.0));
        for factor in [1e-200, 0.9, 1000.0, 1e160] {
            let stretched = rotation.to_rotation_matrix().into_inner() * factor;
            let error = pose_from_matrix(&stretched, Vector3::zeros()).unwrap_err();
            let nearest = error.nearest.unwrap();
            assert!(rotation_angle_between(&rotation, &nearest) < ROTATION_RAD);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 2000, failure_persistence: None, rng_seed: RngSeed::Fixed(11),
            ..ProptestConfig::default()
        })]

        #[test]
        fn rotations_come_back_from_their_matrices(
            axis in proptest::array::uniform3(-4.0..4.0), single in any::<bool>(),
        ) {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(axis));
            let position_m = Vector3::new(0.1, -0.2, 0.3);
            let mut matrix = rotation.to_rotation_matrix().into_inner();
            let mut tolerance_rad = ROTATION_RAD;
            if single {
                #[expect(clippy::cast_possible_truncation, reason = "rounds to single precision")]
                let rounded = matrix.map(|element| f64::from(element as f32));
                matrix = rounded;
                // Elements are off by up to 2^-25.
                tolerance_rad = 2e-7;
            }
            let pose = pose_from_matrix(&matrix, position_m).unwrap();
            prop_assert_eq!(pose.translation.vector, position_m);
            let angle_rad = rotation_angle_between(&rotation, &pose.rotation);
            prop_assert!(angle_rad < tolerance_rad, "{angle_rad:e}");
        }
    }
}
