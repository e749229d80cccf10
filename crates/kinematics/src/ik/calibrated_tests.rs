//! A calibrated arm against numerical solutions from many starts.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3};

use super::numerical::pose_error;
use super::*;
use crate::pose_sets::PoseSet;
use crate::random::SplitMix64;
use crate::{Chain, Joints, Pose, UrGeometry};

/// Share of branches that must be found; 99.93 % were over 9 calibrations and 9000 poses.
const RECOVERED: f64 = 0.999;

/// A row solves the pose on the calibrated chain: 10 times the worst seen, m and rad.
const RESIDUAL: f64 = 1e-12;

/// Joint origins (x, y, z in m; roll, pitch, yaw in rad) that factories measured, from public
/// repositories: `ur_calibration` files.
const CALIBRATIONS: [[[f64; 6]; 6]; 3] = [
    // ur3: cmm-mechatronics-automation/ur3_ros config/my_robot_calibration.yaml calib_336188160809596540
    [
        [
            0.0,
            0.0,
            0.1519720094709559,
            0.0,
            0.0,
            -4.075256111406821e-05,
        ],
        [
            -0.0001741724221020971,
            0.0,
            0.0,
            1.571184458807471,
            0.0,
            -3.780630864733933e-05,
        ],
        [
            -0.2434794139874107,
            0.0,
            0.0,
            3.140880702024851,
            -3.1397251889124,
            -3.141567687120497,
        ],
        [
            -0.2132902672678847,
            -0.0004769510176471754,
            0.1120255518791114,
            0.004257494186500489,
            0.0004972331629163765,
            -0.0001312863638311196,
        ],
        [
            6.822933753254518e-05,
            -0.08540737301934301,
            -7.515235900994237e-05,
            1.571676254802948,
            0.0,
            6.512858624217049e-06,
        ],
        [
            -3.708396587953634e-05,
            0.08227790421633105,
            -4.640002031357174e-05,
            1.57023238419285,
            PI,
            -3.141566807022587,
        ],
    ],
    // ur3: ycyc0926/UR3-magnetic-control config/ur3_calibration.yaml calib_18089309548208516197
    [
        [
            0.0,
            0.0,
            0.15181470228501504,
            0.0,
            0.0,
            1.0359874797582179e-05,
        ],
        [
            4.6633684364371155e-05,
            0.0,
            0.0,
            1.5712907199761768,
            0.0,
            -0.00010863910350522586,
        ],
        [
            -0.24350042966804342,
            0.0,
            0.0,
            0.002324984862296544,
            -0.0006311015154543339,
            -2.4313656914188972e-05,
        ],
        [
            -0.21304527932072553,
            -0.0004516603878537212,
            0.112605368922836,
            0.0040109807380638,
            0.00243559784467332,
            1.1020493681475181e-06,
        ],
        [
            -4.222945588765982e-05,
            -0.0853426486954791,
            -8.533986213256985e-05,
            1.5717962938101264,
            0.0,
            3.0287717284432303e-05,
        ],
        [
            -3.398379344497694e-05,
            0.08247218726408759,
            -9.308818010683002e-05,
            1.5696676051777905,
            PI,
            -3.1415918908424527,
        ],
    ],
    // ur3e: RIVeR-Lab/gentle_pick_and_place config/ur3e_calibration.yaml calib_1893987723246429911
    [
        [
            0.0,
            0.0,
            0.1520336127904309,
            0.0,
            0.0,
            -1.00298204212465e-07,
        ],
        [
            -0.0001455305524053324,
            0.0,
            0.0,
            1.570035683196426,
            0.0,
            3.41152115577468e-06,
        ],
        [
            -0.2441430438501275,
            0.0,
            0.0,
            3.139321807658339,
            3.139105702545978,
            3.141588107676964,
        ],
        [
            -0.2132857599784136,
            -0.0002354479876214674,
            0.1314867933072333,
            0.001790656917310005,
            0.0007655884436570007,
            1.522848225207421e-06,
        ],
        [
            0.0001069072062085512,
            -0.08541073660094806,
            -7.078630009440088e-05,
            1.571625101802636,
            0.0,
            -1.219060889019741e-06,
        ],
        [
            -0.0001665588561359234,
            0.0922645024121747,
            -0.0001187195865114459,
            1.569509596601948,
            PI,
            3.141592524154565,
        ],
    ],
];

fn chain(origins: &[[f64; 6]; 6]) -> Chain {
    let mut chain = UrGeometry::UR3.chain();
    for (joint, [x, y, z, roll, pitch, yaw]) in chain.joints.iter_mut().zip(origins) {
        joint.parent_from_joint = Isometry3::from_parts(
            Translation3::new(*x, *y, *z),
            UnitQuaternion::from_euler_angles(*roll, *pitch, *yaw),
        );
    }
    let base = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI);
    chain.joints[0].parent_from_joint = base * chain.joints[0].parent_from_joint;
    chain
}

fn apart(a: &Joints, b: &Joints) -> f64 {
    (a - b).map(|d| wrap_angle(d).abs()).max()
}

/// Damped Newton from anywhere, written for this test alone.
fn descend(chain: &Chain, target: &Pose, start: &Joints) -> Option<Joints> {
    let mut q = *start;
    let mut error = pose_error(target, &chain.base_link_from_flange(&q));
    let mut damping = 1e-2;
    for _ in 0..60 {
        if error.norm() < 1e-13 {
            return Some(q.map(wrap_angle));
        }
        let jacobian = chain.jacobian(&q);
        let normal = jacobian.tr_mul(&jacobian)
            + Matrix6::identity() * (damping * error.norm_squared().min(1.0));
        let step = normal.cholesky()?.solve(&jacobian.tr_mul(&error));
        let next = pose_error(target, &chain.base_link_from_flange(&(q + step)));
        if next.norm() < error.norm() {
            (q, error) = (q + step, next);
            damping *= 0.3;
        } else {
            damping = (damping * 8.0).max(1e-3);
        }
    }
    (error.norm() < 1e-11).then(|| q.map(wrap_angle))
}

#[test]
fn a_calibrated_arm_keeps_its_branches() {
    let mut random = SplitMix64::new(31);
    let (mut branches, mut found) = (0, 0);
    for origins in &CALIBRATIONS {
        let kinematics = Kinematics::new(chain(origins)).unwrap();
        assert!(!kinematics.is_nominal());
        for _ in 0..120 {
            let q = PoseSet::Generic.sample(&UrGeometry::UR3, &mut random, 0.0);
            let pose = kinematics.base_link_from_flange(&q);
            let answer = kinematics.solve(&pose, None);
            assert_eq!(answer.certificate, Certificate::Refined);
            for row in &answer.solutions {
                assert!(row.residual_m.max(row.residual_rad) <= RESIDUAL);
            }
            let mut reference = vec![q];
            for _ in 0..100 {
                let start = PoseSet::Generic.sample(&UrGeometry::UR3, &mut random, 0.0);
                if let Some(solution) = descend(&kinematics.chain, &pose, &start)
                    && reference.iter().all(|other| apart(other, &solution) > 1e-5)
                {
                    reference.push(solution);
                }
            }
            branches += reference.len();
            found += reference
                .iter()
                .filter(|q| {
                    answer
                        .solutions
                        .iter()
                        .any(|row| apart(&row.joints, q) < 1e-5)
                })
                .count();
        }
    }
    assert!(
        found as f64 >= RECOVERED * branches as f64,
        "{found} of {branches}"
    );
}

#[test]
fn every_branch_of_a_calibrated_arm_has_one_name() {
    let kinematics = Kinematics::new(chain(&CALIBRATIONS[1])).unwrap();
    let mut random = SplitMix64::new(32);
    for _ in 0..300 {
        let q = PoseSet::Elbow.sample(&UrGeometry::UR3, &mut random, 0.05);
        let answer = kinematics.solve(&kinematics.base_link_from_flange(&q), None);
        let names: Vec<usize> = answer
            .solutions
            .iter()
            .map(|row| row.configuration.index())
            .collect();
        assert!(names.is_sorted_by(|a, b| a < b), "{names:?}");
        // A name is either that of a row or of a branch that does not exist.
        for (name, _) in &answer.unreachable {
            assert!(!names.contains(&name.index()));
        }
    }
}

#[test]
fn a_branch_that_calibration_unmakes_is_reported() {
    let nominal = Kinematics::new(UrGeometry::UR3.chain()).unwrap();
    let calibrated = Kinematics::new(chain(&CALIBRATIONS[1])).unwrap();
    let mut random = SplitMix64::new(33);
    let mut lost = 0;
    for _ in 0..400 {
        let q = PoseSet::Elbow.sample(&calibrated.geometry, &mut random, 0.01);
        let pose = nominal.base_link_from_flange(&q);
        let answer = calibrated.solve(&pose, None);
        for (_, reason) in &answer.unreachable {
            if let Unreachable::NoCounterpart {
                missing_m,
                missing_rad,
            } = reason
            {
                lost += 1;
                // It comes near, but not onto the pose.
                assert!(missing_m.max(*missing_rad) > RESIDUAL && *missing_m < 0.01);
            }
        }
    }
    assert!(lost > 10, "{lost}");
}

#[test]
fn a_pose_out_of_reach_has_nearest_postures() {
    for kinematics in [
        Kinematics::new(UrGeometry::UR3.chain()).unwrap(),
        Kinematics::new(chain(&CALIBRATIONS[0])).unwrap(),
    ] {
        let pose = crate::pose_from_rotation_vector(
            Vector3::new(0.7, 0.1, 0.3),
            Vector3::new(0.3, 1.2, -0.4),
        );
        let answer = kinematics.solve(&pose, None);
        assert_eq!(answer.certificate, Certificate::NearestOnly);
        assert!(answer.solutions.is_empty() && !answer.nearest.is_empty());
        let best = &answer.nearest[0];
        assert_eq!(best.kind, SolutionKind::Nearest);
        // No small step comes nearer, metres counting as two radians.
        let cost = |q: &Joints| {
            let mut error = pose_error(&pose, &kinematics.base_link_from_flange(q));
            error.fixed_rows_mut::<3>(0).scale_mut(2.0);
            error.norm()
        };
        let least = cost(&best.joints);
        for joint in 0..6 {
            for step in [1e-4, -1e-4] {
                let mut moved = best.joints;
                moved[joint] += step;
                assert!(cost(&moved) > least - 1e-12);
            }
        }
    }
}
