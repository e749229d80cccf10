//! The arm as the paper writes it: products of Denavit-Hartenberg matrices.
//!
//! Independent of the library's kinematics, which use quaternions, so that each verifies the other; generic in
//! the number type, for single precision.

use nalgebra::{Matrix3, Matrix4, RealField, RowVector4, Vector3};
use needlebench_kinematics::UrGeometry;

/// Lengths of Table 1, m, with the `d6` that the table omits.
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
const TWISTS: [[f64; 6]; 2] = [
    [1.0, 0.0, 0.0, 1.0, -1.0, 0.0],
    [0.0, 1.0, 1.0, 0.0, 0.0, 1.0],
];

impl<T: RealField + Copy> Arm<T> {
    /// The nominal UR3, rounded to the number type.
    pub fn ur3() -> Self {
        let (ur3, number) = (UrGeometry::UR3, nalgebra::convert::<f64, T>);
        Self {
            d1: number(ur3.d1),
            a2: number(ur3.a2),
            a3: number(ur3.a3),
            d4: number(ur3.d4),
            d5: number(ur3.d5),
            d6: number(ur3.d6),
        }
    }

    /// The six matrices of equation 2, second line: frame `i` in frame `i - 1`.
    pub fn links(&self, q: &[T; 6]) -> [Matrix4<T>; 6] {
        let (zero, one) = (T::zero(), T::one());
        let d = [self.d1, zero, zero, self.d4, self.d5, self.d6];
        let a = [zero, self.a2, self.a3, zero, zero, zero];
        std::array::from_fn(|i| {
            let (s, c) = q[i].sin_cos();
            let [sa, ca] = TWISTS.map(|of_links| nalgebra::convert::<f64, T>(of_links[i]));
            Matrix4::from_rows(&[
                RowVector4::new(c, -ca * s, sa * s, a[i] * c),
                RowVector4::new(s, ca * c, -sa * c, a[i] * s),
                RowVector4::new(zero, sa, ca, d[i]),
                RowVector4::new(zero, zero, zero, one),
            ])
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
        self.frames(q)[6]
    }
}

impl Arm<f64> {
    /// As one may read Table 1, which states no signs.
    pub fn with_positive_lengths(self) -> Self {
        let (a2, a3) = (self.a2.abs(), self.a3.abs());
        Self { a2, a3, ..self }
    }
}

/// A target pose of the flange, by the columns of equation 4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target<T: RealField> {
    pub n: Vector3<T>,
    pub o: Vector3<T>,
    pub a: Vector3<T>,
    pub p: Vector3<T>,
}

impl<T: RealField + Copy> Target<T> {
    pub fn of(base_from_flange: &Matrix4<T>) -> Self {
        let [n, o, a, p] =
            std::array::from_fn(|i| base_from_flange.fixed_view::<3, 1>(0, i).into_owned());
        Self { n, o, a, p }
    }
}

/// Inverse of a rigid transform.
pub fn inverse(frame: &Matrix4<f64>) -> Matrix4<f64> {
    let turned_back = rotation(frame).transpose();
    let mut inverse = turned_back.to_homogeneous();
    let moved_back = -(turned_back * origin(frame));
    inverse.fixed_view_mut::<3, 1>(0, 3).copy_from(&moved_back);
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
    // `max` drops a NaN, but a NaN is an error.
    let entries = (a - b).map(|entry| {
        if entry.is_nan() {
            f64::INFINITY
        } else {
            entry.abs()
        }
    });
    entries.max()
}
