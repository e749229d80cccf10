//! Table 3: the eight configurations of the paper's pose, with their correct labels.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector3};
use needlebench_kinematics::ik::{Configuration, closed_form, wrap_angle};
use needlebench_kinematics::{Joints, Pose, UrGeometry, rotation_vector};
use serde::Serialize;

use super::closed_form::{Mended, solve};
use super::dh::{Arm, Target, largest_entry, origin, rotation};
use super::numerical::turn;
use super::printed::{JOINTS_RAD, LABELS, ROTATION_VECTOR_RAD, T_DESIRED};

/// One configuration with its printed row.
#[derive(Debug, Clone, Serialize)]
pub struct RowReport {
    /// True label, by Table 2.
    pub label: &'static str,
    /// Joint positions at the exact pose, rad, wrapped.
    pub joints_rad: [f64; 6],
    /// Number of the printed row, 1 to 8.
    pub printed_row: usize,
    pub printed_label: &'static str,
    pub label_is_right: bool,
    pub printed_joints_rad: [f64; 6],
    pub printed_joints_wrapped_rad: [f64; 6],
    /// Joints printed outside the robot's range of ±2π, counted from 1.
    pub printed_outside_two_turns: Vec<usize>,
    pub difference_rad: [f64; 6],
    /// Pose of the printed row against the printed pose.
    pub residual_to_printed_pose_m: f64,
    pub residual_to_printed_pose_rad: f64,
    /// Pose of the printed row against the exact pose.
    pub residual_to_exact_pose_m: f64,
    pub residual_to_exact_pose_rad: f64,
    /// Pose of our row against the exact pose.
    pub our_residual: f64,
}

/// The four decimals of the printed pose.
#[derive(Debug, Clone, Serialize)]
pub struct PoseReport {
    /// Row by row, from the joints of row 1.
    pub exact: [[f64; 4]; 4],
    pub printed: [[f64; 4]; 4],
    /// Largest entry of `R^T R - 1`.
    pub orthonormality_defect: f64,
    /// Angle from the nearest rotation of the printed pose to the exact one, rad.
    pub angle_to_exact_rad: f64,
    pub distance_to_exact_m: f64,
    /// Largest joint change from the exact pose to the printed one made a rotation, rad.
    pub projection_moves_joints_rad: f64,
    /// Largest joint change from the exact pose to the printed one as it stands, rad.
    pub unprojected_moves_joints_rad: f64,
    /// Position error of row 1 to the printed pose with the `d6 = 0` of Table 1, m.
    pub without_d6_m: f64,
    /// Largest coordinate of that, m.
    pub without_d6_largest_coordinate_m: f64,
    /// The same with positive `a2` and `a3`, m.
    pub with_positive_lengths_m: f64,
    /// Largest component of the difference between the printed rotation vector and that of the printed matrix, rad.
    pub rotation_vector_difference_rad: f64,
}

#[derive(Debug, Clone, Serialize)]
pub struct Table3Report {
    pub rows: Vec<RowReport>,
    /// Printed rows with the label of another configuration.
    pub swapped_rows: Vec<usize>,
    pub largest_difference_rad: f64,
    /// Bound on the difference.
    pub tolerance_rad: f64,
    pub pose: PoseReport,
    /// Every row is found, once, within the bound.
    pub matches: bool,
}

/// Row 1, from which the pose is made, is printed to 5e-6 rad, and so are others; errors add up
/// over the joints.
const TOLERANCE_RAD: f64 = 3e-5;

/// The pose that row 1 makes: the printed one before it was rounded.
pub fn exact_pose() -> Matrix4<f64> {
    Arm::ur3().base_from_flange(&JOINTS_RAD[0])
}

/// A matrix as a pose.
pub fn pose_of(base_from_flange: &Matrix4<f64>) -> Pose {
    let turn = Rotation3::from_matrix_unchecked(rotation(base_from_flange));
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    Isometry3::from_parts(origin(base_from_flange).into(), turn)
}

/// Reproduces the table.
pub fn reproduce() -> Table3Report {
    let (arm, exact) = (Arm::<f64>::ur3(), exact_pose());
    let solutions = solve(&arm, &Target::of(&exact), Mended::ALL);
    let rows: Vec<RowReport> = solutions
        .iter()
        .flatten()
        .map(|joints| row(&arm, &exact, joints))
        .collect();
    let mut found: Vec<usize> = rows.iter().map(|row| row.printed_row).collect();
    found.sort_unstable();
    let is_swapped = |number: &usize| {
        rows.iter()
            .any(|row| row.printed_row == *number && !row.label_is_right)
    };
    let largest_difference_rad = rows
        .iter()
        .map(|row| largest(&row.difference_rad))
        .fold(0.0, f64::max);
    Table3Report {
        matches: found == [1, 2, 3, 4, 5, 6, 7, 8] && largest_difference_rad <= TOLERANCE_RAD,
        swapped_rows: found.into_iter().filter(is_swapped).collect(),
        rows,
        largest_difference_rad,
        tolerance_rad: TOLERANCE_RAD,
        pose: pose_report(&arm, &exact),
    }
}

fn row(arm: &Arm<f64>, exact: &Matrix4<f64>, joints: &[f64; 6]) -> RowReport {
    let joints_rad = joints.map(wrap_angle);
    let label = Configuration::of(&UrGeometry::UR3, &Joints::from(joints_rad)).label();
    let off = |row: &usize| largest(&differences(&JOINTS_RAD[*row], &joints_rad));
    let nearest = (0..8).min_by(|a, b| off(a).total_cmp(&off(b)));
    let index = nearest.expect("Table 3 has rows");
    let printed = JOINTS_RAD[index];
    let reached = arm.base_from_flange(&printed);
    let angle = |wanted: &Matrix4<f64>| {
        turn(&nearest_rotation(&rotation(wanted)), &rotation(&reached)).norm()
    };
    let distance = |wanted: &Matrix4<f64>| (origin(wanted) - origin(&reached)).norm();
    RowReport {
        label,
        joints_rad,
        printed_row: index + 1,
        printed_label: LABELS[index],
        label_is_right: LABELS[index] == label,
        printed_joints_rad: printed,
        printed_joints_wrapped_rad: printed.map(wrap_angle),
        printed_outside_two_turns: (1..=6)
            .filter(|joint| printed[joint - 1].abs() > TAU)
            .collect(),
        difference_rad: differences(&printed, &joints_rad),
        residual_to_printed_pose_m: distance(&T_DESIRED),
        residual_to_printed_pose_rad: angle(&T_DESIRED),
        residual_to_exact_pose_m: distance(exact),
        residual_to_exact_pose_rad: angle(exact),
        our_residual: largest_entry(&arm.base_from_flange(joints), exact),
    }
}

/// Printed minus ours, on the circle, rad.
fn differences(printed: &[f64; 6], ours: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| wrap_angle(printed[i] - ours[i]))
}

/// Largest absolute value.
fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .fold(0.0, |most: f64, each| most.max(each.abs()))
}

/// Nearest rotation in the Frobenius norm: the orthogonal polar factor.
fn nearest_rotation(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = matrix.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => *matrix,
    }
}

fn pose_report(arm: &Arm<f64>, exact: &Matrix4<f64>) -> PoseReport {
    let printed = rotation(&T_DESIRED);
    let nearest = nearest_rotation(&printed);
    let mut projected = T_DESIRED;
    projected.fixed_view_mut::<3, 3>(0, 0).copy_from(&nearest);
    let projected = pose_of(&projected);
    let [of_exact, of_projected] =
        [pose_of(exact), projected].map(|pose| closed_form(&UrGeometry::UR3, &pose, None));
    let projection_moves_joints_rad = Configuration::ALL
        .iter()
        .filter_map(|configuration| {
            let [a, b] = [of_exact, of_projected].map(|of| of.solution(*configuration));
            Some(largest(&differences(&a?.joints.into(), &b?.joints.into())))
        })
        .fold(0.0, f64::max);
    let [of_exact, of_printed] =
        [exact, &T_DESIRED].map(|pose| solve(arm, &Target::of(pose), Mended::ALL));
    let unprojected_moves_joints_rad = of_exact
        .iter()
        .zip(&of_printed)
        .filter_map(|(a, b)| Some(largest(&differences(&(*a)?, &(*b)?))))
        .fold(0.0, f64::max);
    let missed = |arm: Arm<f64>| origin(&arm.base_from_flange(&JOINTS_RAD[0])) - origin(&T_DESIRED);
    let without_d6 = missed(Arm { d6: 0.0, ..*arm });
    let positive = arm.with_positive_lengths();
    let rotvec = rotation_vector(&projected.rotation);
    PoseReport {
        exact: rows_of(exact),
        printed: rows_of(&T_DESIRED),
        orthonormality_defect: (printed.transpose() * printed - Matrix3::identity()).amax(),
        angle_to_exact_rad: turn(&nearest, &rotation(exact)).norm(),
        distance_to_exact_m: (origin(&T_DESIRED) - origin(exact)).norm(),
        projection_moves_joints_rad,
        unprojected_moves_joints_rad,
        without_d6_m: without_d6.norm(),
        without_d6_largest_coordinate_m: without_d6.amax(),
        with_positive_lengths_m: missed(positive).norm(),
        rotation_vector_difference_rad: (rotvec - Vector3::from(ROTATION_VECTOR_RAD)).amax(),
    }
}

fn rows_of(matrix: &Matrix4<f64>) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
