//! What the paper prints: the pose of section 5, Table 3, and the figures of its evaluation.

use nalgebra::Matrix4;

/// `T_desired`, four decimals.
pub const T_DESIRED: Matrix4<f64> = Matrix4::new(
    -0.8421, -0.4673, 0.2693, 0.1942, //
    -0.5196, 0.5690, -0.6374, -0.3593, //
    0.1446, -0.6766, -0.7220, 0.1701, //
    0.0, 0.0, 0.0, 1.0,
);

/// Rotation vector of `X_desired`, rad.
pub const ROTATION_VECTOR_RAD: [f64; 3] = [-0.8567, 2.7197, -1.1407];

/// A row of Table 3.
pub struct Row {
    /// As printed.
    pub label: &'static str,
    /// As printed, rad.
    pub joints_rad: [f64; 6],
}

/// Table 3, in its order and with its labels.
pub const TABLE_3: [Row; 8] = [
    row(
        "Right-Down-Fold",
        [-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862],
    ),
    row(
        "Right-Up-Fold",
        [-0.73508, -2.21214, -1.88282, 6.381036, 1.274286, 0.113862],
    ),
    row(
        "Left-Down-Fold",
        [-0.73508, 3.086748, 0.813237, -4.7555, -1.27429, -3.02773],
    ),
    row(
        "Left-Up-Fold",
        [-0.73508, -2.44049, -0.81324, 2.398207, -1.27429, -3.02773],
    ),
    row(
        "Right-Down-Unfold",
        [1.756916, 0.776095, -1.87212, -1.22744, -1.42357, -0.36595],
    ),
    row(
        "Right-Up-Unfold",
        [1.756916, 5.367374, 1.872123, -9.56297, -1.42357, -0.36595],
    ),
    row(
        "Left-Down-Unfold",
        [1.756916, 0.054278, -0.82719, 1.591031, 1.423566, 2.775645],
    ),
    row(
        "Left-Up-Unfold",
        [1.756916, 5.568666, 0.827187, -5.57773, 1.423566, 2.775645],
    ),
];

const fn row(label: &'static str, joints_rad: [f64; 6]) -> Row {
    Row { label, joints_rad }
}

/// "Max absolute error" of the closed form; the unit is not stated.
pub const CLOSED_FORM_ERROR: f64 = 0.2e-7;
/// "Max absolute error" of the numerical method; the unit is not stated.
pub const NUMERICAL_ERROR: f64 = 0.6e-7;
/// Time of the closed form for one point, s, from and to.
pub const CLOSED_FORM_TIME_S: [f64; 2] = [1e-3, 2e-3];
/// Time of the numerical method for one point, s, from and to.
pub const NUMERICAL_TIME_S: [f64; 2] = [30e-3, 50e-3];
