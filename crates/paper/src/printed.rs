//! Printed values of the paper: the pose of section 5, Table 3, and the results of its evaluation.

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

/// Labels of Table 3, in its order.
pub const LABELS: [&str; 8] = [
    "Right-Down-Fold",
    "Right-Up-Fold",
    "Left-Down-Fold",
    "Left-Up-Fold",
    "Right-Down-Unfold",
    "Right-Up-Unfold",
    "Left-Down-Unfold",
    "Left-Up-Unfold",
];

/// Joints of Table 3, rad.
#[rustfmt::skip]
pub const JOINTS_RAD: [[f64; 6]; 8] = [
    [-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862],
    [-0.73508, -2.21214, -1.88282, 6.381036, 1.274286, 0.113862],
    [-0.73508, 3.086748, 0.813237, -4.7555, -1.27429, -3.02773],
    [-0.73508, -2.44049, -0.81324, 2.398207, -1.27429, -3.02773],
    [1.756916, 0.776095, -1.87212, -1.22744, -1.42357, -0.36595],
    [1.756916, 5.367374, 1.872123, -9.56297, -1.42357, -0.36595],
    [1.756916, 0.054278, -0.82719, 1.591031, 1.423566, 2.775645],
    [1.756916, 5.568666, 0.827187, -5.57773, 1.423566, 2.775645],
];

/// Panels of Figure 6, `a` to `h`, by their labels.
pub const FIGURE_6: [(&str, &str); 8] = [
    ("a", "Left-Up-Unfold"),
    ("b", "Left-Up-Fold"),
    ("c", "Left-Down-Unfold"),
    ("d", "Left-Down-Fold"),
    ("e", "Right-Up-Unfold"),
    ("f", "Right-Up-Fold"),
    ("g", "Right-Down-Unfold"),
    ("h", "Right-Down-Fold"),
];

/// "Max absolute error" of the closed form; the unit is not stated.
pub const CLOSED_FORM_ERROR: f64 = 0.2e-7;
/// "Max absolute error" of the numerical method; the unit is not stated.
pub const NUMERICAL_ERROR: f64 = 0.6e-7;
/// Time of the closed form for one point, s, from and to.
pub const CLOSED_FORM_TIME_S: [f64; 2] = [1e-3, 2e-3];
/// Time of the numerical method for one point, s, from and to.
pub const NUMERICAL_TIME_S: [f64; 2] = [30e-3, 50e-3];
