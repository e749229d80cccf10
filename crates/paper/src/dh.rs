//! The arm as the paper writes it: products of Denavit-Hartenberg matrices.
//!
//! Written apart from the library's kinematics, which use quaternions, so that each checks the
//! other; generic in the number type, so that single precision can be looked at too.

use nalgebra::{Matrix3, Matrix4, RealField, Vector3};
use needlebench_kinematics::UrGeometry;

/// Lengths of Table 1, m, with the `d6` that the table leaves out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arm<T> {
    pub d1: T,
    pub a2: T,
    pub a3: T,
    pub d4: T,
    pub d5: T,
    pub d6: T,
}

/// Sine and cosine of the link twists `alpha`: exact, where those of a rounded `pi/2` are not.
const TWISTS: [(f64, f64); 6] = [
    (1.0, 0.0),
    (0.0, 1.0),
    (0.0, 1.0),
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
];

impl<T: RealField + Copy> Arm<T> {
    /// The nominal UR3.
    pub fn ur3() -> Self {
        Self::of(&UrGeometry::UR3)
    }

    /// The lengths of a geometry, rounded to the number type.
    pub fn of(geometry: &UrGeometry) -> Self {
        let number = nalgebra::convert::<f64, T>;
        Self {
            d1: number(geometry.d1),
            a2: number(geometry.a2),
            a3: number(geometry.a3),
            d4: number(geometry.d4),
            d5: number(geometry.d5),
            d6: number(geometry.d6),
        }
    }

    /// `d` and `a` of the six links, m.
    fn lengths(&self) -> [(T, T); 6] {
        let zero = T::zero();
        [
            (self.d1, zero),
            (zero, self.a2),
            (zero, self.a3),
            (self.d4, zero),
            (self.d5, zero),
            (self.d6, zero),
        ]
    }

    /// The six matrices of equation 2, frame `i` in frame `i - 1`.
    pub fn links(&self, q: &[T; 6]) -> [Matrix4<T>; 6] {
        let lengths = self.lengths();
        std::array::from_fn(|i| {
            let (d, a) = lengths[i];
            let (sine, cosine) = TWISTS[i];
            link_matrix(
                q[i],
                d,
                a,
                nalgebra::convert(sine),
                nalgebra::convert(cosine),
            )
        })
    }

    /// Frames 0 to 6 in the base frame.
    pub fn frames(&self, q: &[T; 6]) -> [Matrix4<T>; 7] {
        let mut frames = [Matrix4::identity(); 7];
        for (i, link) in self.links(q).iter().enumerate() {
            frames[i + 1] = frames[i] * link;
        }
        frames
    }

    /// Equation 3: the flange in the base frame.
    pub fn base_from_flange(&self, q: &[T; 6]) -> Matrix4<T> {
        self.links(q)
            .iter()
            .fold(Matrix4::identity(), |product, link| product * link)
    }
}

/// The second line of equation 2.
fn link_matrix<T: RealField + Copy>(
    theta: T,
    d: T,
    a: T,
    sin_alpha: T,
    cos_alpha: T,
) -> Matrix4<T> {
    let (s, c) = theta.sin_cos();
    let (zero, one) = (T::zero(), T::one());
    Matrix4::new(
        c,
        -cos_alpha * s,
        sin_alpha * s,
        a * c,
        s,
        cos_alpha * c,
        -sin_alpha * c,
        a * s,
        zero,
        sin_alpha,
        cos_alpha,
        d,
        zero,
        zero,
        zero,
        one,
    )
}

/// A wanted pose of the flange, by the columns of equation 4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target<T: RealField> {
    pub n: Vector3<T>,
    pub o: Vector3<T>,
    pub a: Vector3<T>,
    pub p: Vector3<T>,
}

impl<T: RealField + Copy> Target<T> {
    pub fn of(base_from_flange: &Matrix4<T>) -> Self {
        let column = |i: usize| base_from_flange.fixed_view::<3, 1>(0, i).into_owned();
        Self {
            n: column(0),
            o: column(1),
            a: column(2),
            p: column(3),
        }
    }
}

/// Inverse of a rigid transform.
pub fn inverse(frame: &Matrix4<f64>) -> Matrix4<f64> {
    let turned_back = rotation(frame).transpose();
    let mut inverse = turned_back.to_homogeneous();
    inverse
        .fixed_view_mut::<3, 1>(0, 3)
        .copy_from(&(-(turned_back * origin(frame))));
    inverse
}

/// Orientation part of a frame.
pub fn rotation(frame: &Matrix4<f64>) -> Matrix3<f64> {
    frame.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Origin of a frame, m.
pub fn origin(frame: &Matrix4<f64>) -> Vector3<f64> {
    frame.fixed_view::<3, 1>(0, 3).into_owned()
}

/// Largest entry of a difference of two poses: m and 1 alike, the paper's "max absolute error".
pub fn largest_entry(a: &Matrix4<f64>, b: &Matrix4<f64>) -> f64 {
    (a - b).iter().fold(0.0, |largest: f64, entry| {
        // `max` would drop a NaN.
        if entry.is_nan() {
            f64::NAN
        } else {
            largest.max(entry.abs())
        }
    })
}
