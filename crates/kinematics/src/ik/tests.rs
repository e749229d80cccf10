//! Inverse kinematics against forward kinematics and the paper's Table 3.

use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;
use crate::{Joints, Pose, UrGeometry, pose_from_rotation_vector};

/// Ten times the worst residual of the closed form over 1e5 random postures, m and rad.
const RESIDUAL: f64 = 1e-13;

/// Table 3 prints six decimals of angles that were computed from a pose of four.
const TABLE_3_RAD: f64 = 2e-4;

/// The eight rows of Table 3 under their true labels, wrapped to (-pi, pi].
const TABLE_3: [(&str, [f64; 6]); 8] = [
    (
        "Right-Down-Fold",
        [-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862],
    ),
    (
        "Right-Up-Fold",
        [-0.73508, -2.212137, -1.882823, 0.097853, 1.274286, 0.113862],
    ),
    (
        "Right-Down-Unfold",
        [-0.73508, 3.086748, 0.81324, 1.527683, -1.274286, -3.027731],
    ),
    (
        "Right-Up-Unfold",
        [-0.73508, -2.440485, -0.81324, 2.39821, -1.274286, -3.027731],
    ),
    (
        "Left-Down-Fold",
        [
            1.75692, 0.776095, -1.872123, -1.227444, -1.423564, -0.365947,
        ],
    ),
    (
        "Left-Up-Fold",
        [1.75692, -0.915811, 1.872123, 3.003401, -1.423564, -0.365947],
    ),
    (
        "Left-Down-Unfold",
        [1.75692, 0.054278, -0.827189, 1.591031, 1.423564, 2.775646],
    ),
    (
        "Left-Up-Unfold",
        [1.75692, -0.714521, 0.827189, 0.705453, 1.423564, 2.775646],
    ),
];

fn ur3() -> Kinematics {
    Kinematics::new(UrGeometry::UR3.chain()).unwrap()
}

fn angle_difference(a: &Joints, b: &Joints) -> f64 {
    (a - b).map(|d| wrap_angle(d).abs()).max()
}

#[test]
fn table_3_comes_out_under_its_true_labels() {
    let first = Joints::from_column_slice(&TABLE_3[0].1);
    let pose = UrGeometry::UR3.base_from_flange(&first);
    let found = closed_form(&UrGeometry::UR3, &pose, None);
    assert_eq!(found.solutions().count(), 8);
    for (label, row) in TABLE_3 {
        let solution = found
            .solutions()
            .find(|solution| solution.configuration.label() == label)
            .expect("the label exists");
        let difference = angle_difference(&solution.joints, &Joints::from_column_slice(&row));
        assert!(difference < 5e-6, "{label}: {difference:e}");
    }
}

#[test]
fn the_printed_pose_gives_table_3_within_its_rounding() {
    let pose = pose_from_rotation_vector(
        nalgebra::Vector3::new(0.1942, -0.3593, 0.1701),
        nalgebra::Vector3::new(-0.8567, 2.7197, -1.1407),
    );
    let found = closed_form(&UrGeometry::UR3, &pose, None);
    for (solution, (label, row)) in found.solutions().zip(TABLE_3) {
        assert_eq!(solution.configuration.label(), label);
        assert!(angle_difference(&solution.joints, &Joints::from_column_slice(&row)) < TABLE_3_RAD);
    }
}

fn posture() -> impl Strategy<Value = Joints> {
    proptest::array::uniform6(-PI..PI).prop_map(|q| Joints::from_column_slice(&q))
}

/// Postures with any joints at multiples of 90 degrees, so that all singularities occur.
fn axis_aligned_posture() -> impl Strategy<Value = Joints> {
    proptest::array::uniform6(-2_i8..=2)
        .prop_map(|q| Joints::from_column_slice(&q.map(|turns| f64::from(turns) * FRAC_PI_2)))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5000, max_global_rejects: 1_000_000, failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..ProptestConfig::default() })]

    #[test]
    fn every_solution_reproduces_the_pose(q in posture()) {
        let pose = ur3().base_link_from_flange(&q);
        let found = ur3().solve(&pose, None);
        for solution in &found.solutions {
            prop_assert!(solution.residual_m <= RESIDUAL && solution.residual_rad <= RESIDUAL);
            prop_assert_eq!(
                Configuration::of(&UrGeometry::UR3, &solution.joints), solution.configuration
            );
        }
        prop_assert_eq!(found.solutions.len() + found.unreachable.len(), 8);
    }

    #[test]
    fn the_posture_that_made_the_pose_is_among_the_solutions(q in posture()) {
        // Next to a singularity a rounding of the pose moves the joints by its square root.
        prop_assume!(libm::sin(q[2]).abs() > 1e-3 && libm::sin(q[4]).abs() > 1e-3);
        let pose = ur3().base_link_from_flange(&q);
        let nearest = ur3().solve(&pose, None).solutions.iter()
            .map(|solution| angle_difference(&solution.joints, &q))
            .fold(f64::INFINITY, f64::min);
        prop_assert!(nearest < 1e-6, "{nearest:e}");
    }

    #[test]
    fn singular_poses_are_answered_and_every_answer_is_right(q in axis_aligned_posture()) {
        let pose = ur3().base_link_from_flange(&q);
        let found = ur3().solve(&pose, Some(&q));
        prop_assert!(!found.solutions.is_empty());
        for solution in &found.solutions {
            prop_assert_eq!(solution.kind, SolutionKind::Exact);
            prop_assert!(solution.residual_m <= 1e-14 && solution.residual_rad <= 1e-14,
                "{:e} {:e}", solution.residual_m, solution.residual_rad);
        }
    }
}

#[test]
fn a_free_wrist_3_follows_the_seed_where_the_elbow_allows() {
    let q = Joints::from_column_slice(&[0.3, -1.2, 1.4, -0.5, 0.0, 0.8]);
    let pose = ur3().base_link_from_flange(&q);
    let found = ur3().solve(&pose, Some(&q));
    assert!(
        found
            .solutions
            .iter()
            .any(|solution| solution.wrist_3_is_free
                && (solution.joints[5] - 0.8).abs() < 1e-9
                && solution.residual_m < 1e-12)
    );
}

#[test]
fn an_unreachable_pose_says_by_how_much() {
    let pose = pose_from_rotation_vector(
        nalgebra::Vector3::new(0.9, 0.0, 0.1519),
        nalgebra::Vector3::zeros(),
    );
    let found = closed_form(&UrGeometry::UR3, &pose, None);
    assert_eq!(found.solutions().count(), 0);
    assert_eq!(found.unreachable(&UrGeometry::UR3, &pose).count(), 8);
    assert!(
        found
            .unreachable(&UrGeometry::UR3, &pose)
            .all(|(_, reason)| reason.missing_m() > 0.2)
    );
    let inside = pose_from_rotation_vector(
        nalgebra::Vector3::new(0.02, 0.0, 0.5),
        nalgebra::Vector3::zeros(),
    );
    let found = closed_form(&UrGeometry::UR3, &inside, None);
    assert!(
        matches!(found.unreachable(&UrGeometry::UR3, &inside).next(), Some((_, Unreachable::WristTooNear { missing_m })) if missing_m > 0.09)
    );
}

#[test]
fn a_calibrated_chain_is_solved_exactly() {
    let mut chain = UrGeometry::UR3.chain();
    for (i, joint) in chain.joints.iter_mut().enumerate() {
        joint.parent_from_joint.translation.vector.x += 3e-4 * (i as f64 - 2.0);
        joint.parent_from_joint.rotation *=
            nalgebra::UnitQuaternion::from_euler_angles(1e-3, -8e-4, 5e-4);
    }
    let kinematics = Kinematics::new(chain).unwrap();
    let q = Joints::from_column_slice(&TABLE_3[1].1);
    let found = kinematics.solve(&kinematics.base_link_from_flange(&q), None);
    assert!(found.solutions.len() == 8);
    for solution in &found.solutions {
        assert!(solution.residual_m <= RESIDUAL && solution.residual_rad <= RESIDUAL);
    }
    assert!(
        found
            .solutions
            .iter()
            .any(|s| angle_difference(&s.joints, &q) < 1e-9)
    );
}

#[test]
fn angles_wrap_to_the_half_open_circle() {
    assert_eq!(wrap_angle(PI), PI);
    assert_eq!(wrap_angle(-PI), PI);
    assert!((wrap_angle(6.381036) - 0.097850693).abs() < 1e-8);
    assert!((wrap_angle(-9.56297) - 3.003400614).abs() < 1e-8);
}

#[test]
fn the_jacobian_is_the_derivative_of_the_pose() {
    let chain = UrGeometry::UR3.chain();
    let q = Joints::from_column_slice(&[0.4, -1.1, 0.9, -2.0, 1.2, 0.3]);
    let jacobian = chain.jacobian(&q);
    let h = 1e-6;
    for i in 0..6 {
        let mut step = Joints::zeros();
        step[i] = h;
        let forward = chain.base_link_from_flange(&(q + step));
        let backward = chain.base_link_from_flange(&(q - step));
        let difference = super::numerical::pose_error(&forward, &backward) / (2.0 * h);
        assert!((difference - jacobian.column(i)).amax() < 1e-9);
    }
}

/// A pose as it comes out of a message of single precision.
#[expect(clippy::cast_possible_truncation, reason = "that is what it is for")]
fn single_precision(pose: &Pose) -> Pose {
    let rounded = |value: f64| f64::from(value as f32);
    Pose::from_parts(
        pose.translation.vector.map(rounded).into(),
        nalgebra::Unit::new_unchecked(nalgebra::Quaternion::from(
            pose.rotation.coords.map(rounded),
        )),
    )
}

#[test]
fn every_branch_of_the_closed_form_is_a_branch_of_the_arm() {
    let (arm, mut random) = (ur3(), needlebench_numerics::random::SplitMix64::new(5));
    let turn = crate::geometry::base_from_base_link();
    let mut lost = Vec::new();
    for index in 0..12_000 {
        let mut q = Joints::from_fn(|_, _| PI * (2.0 * random.open_unit() - 1.0));
        let is_singular = index % 3 != 0;
        if is_singular {
            // Wrist, elbow, or both, as far as numbers have it.
            if index % 3 == 1 {
                q[4] = [0.0, PI][index % 2];
            } else {
                q[2] = 1e-9 * random.open_unit();
            }
        }
        let exact = arm.base_link_from_flange(&q);
        for pose in [exact, single_precision(&exact)] {
            let listed = closed_form(&arm.geometry, &(turn * pose), None);
            let found = arm.branches(&pose, None).solutions;
            for row in listed.solutions() {
                if found
                    .iter()
                    .all(|other| other.configuration != row.configuration)
                {
                    lost.push((index, row.configuration.label()));
                }
            }
        }
    }
    assert!(lost.is_empty(), "{} {lost:?}", lost.len());
}
