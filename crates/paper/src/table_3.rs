//! Table 3: the eight configurations of the paper's pose, under their true labels.

use nalgebra::{Matrix3, Matrix4};
use needlebench_kinematics::ik::{Configuration, closed_form, wrap_angle};
use needlebench_kinematics::{Joints, UrGeometry, rotation_vector};
use serde::Serialize;

use super::dh::{Arm, Target, largest_entry, origin, rotation};
use super::equations::angle_error;
use super::equations::differential::turn;
use super::equations::side::Mended;
use super::printed::{ROTATION_VECTOR_RAD, T_DESIRED, TABLE_3};
use super::solver::solve;

/// One configuration beside the printed row that it is.
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
    /// Joints printed outside the robot's range of two turns either way, counted from 1.
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
    /// Distance by which row 1 misses the printed pose with the `d6 = 0` of Table 1, m.
    pub without_d6_m: f64,
    /// Largest coordinate of that, m.
    pub without_d6_largest_coordinate_m: f64,
    /// Distance by which it misses with positive `a2` and `a3`, m.
    pub with_positive_lengths_m: f64,
    /// Largest component by which the printed rotation vector is off the printed matrix's, rad.
    pub rotation_vector_difference_rad: f64,
}

#[derive(Debug, Clone, Serialize)]
pub struct Table3Report {
    pub rows: Vec<RowReport>,
    /// Printed rows whose label is another configuration's.
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

/// Reproduces the table.
pub(super) fn reproduce() -> Table3Report {
    let geometry = UrGeometry::UR3;
    let arm = Arm::<f64>::of(&geometry);
    let exact = arm.base_from_flange(&TABLE_3[0].joints_rad);
    let solutions = solve(&arm, &Target::of(&exact), Mended::ALL);
    let mut rows = Vec::new();
    for joints in solutions.iter().flatten() {
        let joints_rad = joints.map(wrap_angle);
        let label = Configuration::of(&geometry, &Joints::from(joints_rad)).label();
        let (index, printed) = TABLE_3
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| {
                let distance = |row: &[f64; 6]| largest(&differences(row, &joints_rad));
                distance(&a.joints_rad).total_cmp(&distance(&b.joints_rad))
            })
            .expect("Table 3 has rows");
        let reached = arm.base_from_flange(&printed.joints_rad);
        let angle = |wanted: &Matrix4<f64>| {
            turn(&nearest_rotation(&rotation(wanted)), &rotation(&reached)).norm()
        };
        let distance = |wanted: &Matrix4<f64>| (origin(wanted) - origin(&reached)).norm();
        rows.push(RowReport {
            label,
            joints_rad,
            printed_row: index + 1,
            printed_label: printed.label,
            label_is_right: printed.label == label,
            printed_joints_rad: printed.joints_rad,
            printed_joints_wrapped_rad: printed.joints_rad.map(wrap_angle),
            printed_outside_two_turns: (1..=6)
                .filter(|joint| printed.joints_rad[joint - 1].abs() > std::f64::consts::TAU)
                .collect(),
            difference_rad: differences(&printed.joints_rad, &joints_rad),
            residual_to_printed_pose_m: distance(&T_DESIRED),
            residual_to_printed_pose_rad: angle(&T_DESIRED),
            residual_to_exact_pose_m: distance(&exact),
            residual_to_exact_pose_rad: angle(&exact),
            our_residual: largest_entry(&arm.base_from_flange(joints), &exact),
        });
    }
    let mut swapped_rows: Vec<usize> = rows
        .iter()
        .filter(|row| !row.label_is_right)
        .map(|row| row.printed_row)
        .collect();
    swapped_rows.sort_unstable();
    let largest_difference_rad = rows
        .iter()
        .map(|row| largest(&row.difference_rad))
        .fold(0.0, f64::max);
    let mut found: Vec<usize> = rows.iter().map(|row| row.printed_row).collect();
    found.sort_unstable();
    Table3Report {
        matches: found == [1, 2, 3, 4, 5, 6, 7, 8] && largest_difference_rad <= TOLERANCE_RAD,
        rows,
        swapped_rows,
        largest_difference_rad,
        tolerance_rad: TOLERANCE_RAD,
        pose: pose_report(&geometry, &exact),
    }
}

/// Printed minus ours, on the circle, rad.
fn differences(printed: &[f64; 6], ours: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| wrap_angle(printed[i] - ours[i]))
}

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

fn pose_report(geometry: &UrGeometry, exact: &Matrix4<f64>) -> PoseReport {
    let printed = rotation(&T_DESIRED);
    let nearest = nearest_rotation(&printed);
    let as_pose = |orientation: &Matrix3<f64>, position: &Matrix4<f64>| {
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(*orientation);
        nalgebra::Isometry3::from_parts(
            origin(position).into(),
            nalgebra::UnitQuaternion::from_rotation_matrix(&rotation),
        )
    };
    let projected = as_pose(&nearest, &T_DESIRED);
    let of_exact = closed_form(geometry, &as_pose(&rotation(exact), exact), None);
    let of_projected = closed_form(geometry, &projected, None);
    let moved = Configuration::ALL
        .iter()
        .filter_map(|configuration| {
            let (a, b) = (
                of_exact.solution(*configuration)?.joints,
                of_projected.solution(*configuration)?.joints,
            );
            let moved = (0..6).map(|joint| angle_error(a[joint], b[joint]));
            moved.reduce(f64::max)
        })
        .fold(0.0, f64::max);
    let arm = Arm::<f64>::of(geometry);
    let missed = |other: Arm<f64>| {
        let reached = other.base_from_flange(&TABLE_3[0].joints_rad);
        origin(&reached) - origin(&T_DESIRED)
    };
    let without_d6 = missed(Arm { d6: 0.0, ..arm });
    let unprojected = solve(&arm, &Target::of(&T_DESIRED), Mended::ALL);
    let unprojected_moves_joints_rad = solve(&arm, &Target::of(exact), Mended::ALL)
        .iter()
        .zip(&unprojected)
        .filter_map(|(a, b)| Some(largest(&differences(&(*a)?, &(*b)?))))
        .fold(0.0, f64::max);
    let rotvec = rotation_vector(&projected.rotation);
    let components = ROTATION_VECTOR_RAD.iter().zip(rotvec.iter());
    PoseReport {
        exact: rows_of(exact),
        printed: rows_of(&T_DESIRED),
        orthonormality_defect: (printed.transpose() * printed - Matrix3::identity()).amax(),
        angle_to_exact_rad: turn(&nearest, &rotation(exact)).norm(),
        distance_to_exact_m: (origin(&T_DESIRED) - origin(exact)).norm(),
        projection_moves_joints_rad: moved,
        unprojected_moves_joints_rad,
        without_d6_m: without_d6.norm(),
        without_d6_largest_coordinate_m: without_d6.amax(),
        with_positive_lengths_m: missed(Arm {
            a2: arm.a2.abs(),
            a3: arm.a3.abs(),
            ..arm
        })
        .norm(),
        rotation_vector_difference_rad: components.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
    }
}

fn rows_of(matrix: &Matrix4<f64>) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
