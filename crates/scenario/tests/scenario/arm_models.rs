//! The shipped arms' URDFs against what the maker publishes of each: lengths, masses and centres, total
//! mass. The published figures are typed in here from the maker's article, in its own frames.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Joints, Pose, rotation_angle_between};
use needlebench_robot::{ASSUMED_SHAPES, Arm, LoadedRobot};
use needlebench_scenario::{Overrides, load_robot};

/// Twists of the DH chain of every UR arm, rad.
const TWISTS: [f64; 6] = [FRAC_PI_2, 0.0, 0.0, FRAC_PI_2, -FRAC_PI_2, 0.0];

/// What Universal Robots publishes: *DH parameters for calculations of kinematics and dynamics*, and the
/// weight in the data sheet.
struct Published {
    arm: &'static str,
    /// Lengths `a` and `d` of the six rows of the standard DH chain, m.
    lengths_m: [(f64, f64); 6],
    /// Mass (kg) and centre of mass in the row's DH frame (m) of the six moving links.
    links: [(f64, [f64; 3]); 6],
    /// Weight of the arm, and by how much the URDF's masses may sum up to something else, kg. The
    /// UR3's base is the ROS description's, which is too light, and the UR10's likewise, which is too heavy.
    weight_kg: (f64, f64),
}

const PUBLISHED: [Published; 9] = [
    Published {
        arm: "ur3",
        lengths_m: [
            (0.0, 0.1519),
            (-0.24365, 0.0),
            (-0.21325, 0.0),
            (0.0, 0.11235),
            (0.0, 0.08535),
            (0.0, 0.0819),
        ],
        links: [
            (2.0, [0.0, -0.02, 0.0]),
            (3.42, [0.13, 0.0, 0.1157]),
            (1.26, [0.05, 0.0, 0.0238]),
            (0.8, [0.0, 0.0, 0.01]),
            (0.8, [0.0, 0.0, 0.01]),
            (0.35, [0.0, 0.0, -0.02]),
        ],
        weight_kg: (11.0, 0.4),
    },
    Published {
        arm: "ur3e",
        lengths_m: [
            (0.0, 0.15185),
            (-0.24355, 0.0),
            (-0.2132, 0.0),
            (0.0, 0.13105),
            (0.0, 0.08535),
            (0.0, 0.0921),
        ],
        links: [
            (1.98, [0.0, -0.02, 0.0]),
            (3.4445, [0.13, 0.0, 0.1157]),
            (1.437, [0.05, 0.0, 0.0238]),
            (0.871, [0.0, 0.0, 0.01]),
            (0.805, [0.0, 0.0, 0.01]),
            (0.261, [0.0, 0.0, -0.02]),
        ],
        weight_kg: (11.2, 1e-9),
    },
    Published {
        arm: "ur5e",
        lengths_m: [
            (0.0, 0.1625),
            (-0.425, 0.0),
            (-0.3922, 0.0),
            (0.0, 0.1333),
            (0.0, 0.0997),
            (0.0, 0.0996),
        ],
        links: [
            (3.761, [0.0, -0.02561, 0.00193]),
            (8.058, [0.2125, 0.0, 0.11336]),
            (2.846, [0.15, 0.0, 0.0265]),
            (1.37, [0.0, -0.0018, 0.01634]),
            (1.3, [0.0, 0.0018, 0.01634]),
            (0.365, [0.0, 0.0, -0.001159]),
        ],
        weight_kg: (20.6, 1e-9),
    },
    Published {
        arm: "ur5",
        lengths_m: [
            (0.0, 0.089159),
            (-0.425, 0.0),
            (-0.39225, 0.0),
            (0.0, 0.10915),
            (0.0, 0.09465),
            (0.0, 0.0823),
        ],
        links: [
            (3.7, [0.0, -0.02561, 0.00193]),
            (8.393, [0.2125, 0.0, 0.11336]),
            (2.33, [0.15, 0.0, 0.0265]),
            (1.219, [0.0, -0.0018, 0.01634]),
            (1.219, [0.0, 0.0018, 0.01634]),
            (0.1879, [0.0, 0.0, -0.001159]),
        ],
        weight_kg: (18.4, 1e-9),
    },
    Published {
        arm: "ur10",
        lengths_m: [
            (0.0, 0.1273),
            (-0.612, 0.0),
            (-0.5723, 0.0),
            (0.0, 0.163941),
            (0.0, 0.1157),
            (0.0, 0.0922),
        ],
        links: [
            (7.1, [0.021, 0.0, 0.027]),
            (12.7, [0.38, 0.0, 0.158]),
            (4.27, [0.24, 0.0, 0.068]),
            (2.0, [0.0, 0.007, 0.018]),
            (2.0, [0.0, 0.007, 0.018]),
            (0.365, [0.0, 0.0, -0.026]),
        ],
        weight_kg: (28.9, 3.6),
    },
    Published {
        arm: "ur10e",
        lengths_m: [
            (0.0, 0.1807),
            (-0.6127, 0.0),
            (-0.57155, 0.0),
            (0.0, 0.17415),
            (0.0, 0.11985),
            (0.0, 0.11655),
        ],
        links: [
            (7.369, [0.021, 0.0, 0.027]),
            (13.051, [0.38, 0.0, 0.158]),
            (3.989, [0.24, 0.0, 0.068]),
            (2.1, [0.0, 0.007, 0.018]),
            (1.98, [0.0, 0.007, 0.018]),
            (0.615, [0.0, 0.0, -0.026]),
        ],
        weight_kg: (33.5, 1e-9),
    },
    Published {
        arm: "ur16e",
        lengths_m: [
            (0.0, 0.1807),
            (-0.4784, 0.0),
            (-0.36, 0.0),
            (0.0, 0.17415),
            (0.0, 0.11985),
            (0.0, 0.11655),
        ],
        links: [
            (7.369, [0.0, -0.016, 0.03]),
            (10.45, [0.302, 0.0, 0.16]),
            (4.321, [0.194, 0.0, 0.065]),
            (2.18, [0.0, -0.009, 0.011]),
            (2.033, [0.0, 0.018, 0.012]),
            (0.907, [0.0, 0.0, -0.044]),
        ],
        weight_kg: (33.1, 1e-9),
    },
    Published {
        arm: "ur20",
        lengths_m: [
            (0.0, 0.2363),
            (-0.862, 0.0),
            (-0.7287, 0.0),
            (0.0, 0.201),
            (0.0, 0.1593),
            (0.0, 0.1543),
        ],
        links: [
            (16.343, [0.0, -0.061, 0.0062]),
            (29.632, [0.5226, 0.0, 0.2098]),
            (7.879, [0.3234, 0.0, 0.0604]),
            (3.054, [0.0, -0.0026, 0.0393]),
            (3.126, [0.0, 0.0024, 0.0379]),
            (0.846, [0.0, -0.0003, -0.0318]),
        ],
        weight_kg: (64.0, 1e-9),
    },
    Published {
        arm: "ur30",
        lengths_m: [
            (0.0, 0.2363),
            (-0.637, 0.0),
            (-0.5037, 0.0),
            (0.0, 0.201),
            (0.0, 0.1593),
            (0.0, 0.1543),
        ],
        links: [
            (16.343, [-0.0001, -0.06, 0.0069]),
            (28.542, [0.3894, 0.0, 0.2103]),
            (7.156, [0.2257, 0.0, 0.0629]),
            (3.054, [0.0, -0.0048, 0.0353]),
            (3.126, [0.0, 0.0046, 0.0341]),
            (0.926, [0.0, 0.0, -0.0293]),
        ],
        weight_kg: (63.5, 1e-9),
    },
];

/// Sums of a few numbers of order one.
const ROUNDING: f64 = 1e-14;

/// The shipped arm and what is published of it.
fn arms() -> impl Iterator<Item = (LoadedRobot, &'static Published)> {
    PUBLISHED.iter().map(|published| {
        let overrides = Overrides {
            arm: Some(published.arm.to_owned()),
            ..Overrides::default()
        };
        (load_robot(&overrides).unwrap(), published)
    })
}

fn about_z(angle_rad: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad)
}

/// From the frame of the link that a row's joint turns (turn and offset done) to the row's DH frame.
fn link_from_row(a_m: f64, twist_rad: f64) -> Isometry3<f64> {
    let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), twist_rad);
    Isometry3::from_parts(Translation3::new(a_m, 0.0, 0.0), twist)
}

#[test]
fn the_joint_origins_multiply_to_the_published_dh_chain() {
    /// Products of a dozen transforms over a metre.
    const CHAIN: f64 = 1e-12;
    for (robot, published) in arms() {
        for i in 0..500_u32 {
            let q = Joints::from_fn(|joint, _| {
                libm::sin(f64::from(i) * 1.7 + joint as f64 * 2.9) * 2.0 * PI
            });
            let rows = q.iter().zip(published.lengths_m).zip(TWISTS);
            // The controller's base is `base_link` turned by half a turn.
            let base_link_from_base = Pose::from_parts(Translation3::identity(), about_z(PI));
            let expected = rows.fold(base_link_from_base, |pose, ((angle, (a_m, d_m)), twist)| {
                let turned = Pose::from_parts(Translation3::new(0.0, 0.0, d_m), about_z(*angle));
                pose * turned * link_from_row(a_m, twist)
            });
            let flange = robot.chain.base_link_from_flange(&q);
            let off_m = (flange.translation.vector - expected.translation.vector).norm();
            let off_rad = rotation_angle_between(&flange.rotation, &expected.rotation);
            assert!(off_m < CHAIN && off_rad < CHAIN, "{}: {q}", published.arm);
        }
    }
}

#[test]
fn masses_and_centres_are_the_published_ones() {
    for (robot, published) in arms() {
        for (joint, body) in robot.bodies.iter().enumerate() {
            let (mass_kg, [x, y, z]) = published.links[joint];
            let row = link_from_row(published.lengths_m[joint].0, TWISTS[joint]);
            let off_m = (row * Point3::new(x, y, z)).coords - body.com_m;
            assert!(off_m.norm() < ROUNDING, "{} {joint}", published.arm);
            assert_eq!(body.mass_kg, mass_kg, "{} {joint}", published.arm);
        }
    }
}

#[test]
fn the_masses_sum_up_to_the_data_sheets_weight() {
    for published in &PUBLISHED {
        let file = format!("../../models/{0}/{0}.urdf", published.arm);
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        let urdf = std::fs::read_to_string(file).unwrap();
        let total_kg: f64 = urdf
            .split("<mass value=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap().parse::<f64>().unwrap())
            .sum();
        let (weight_kg, within_kg) = published.weight_kg;
        assert!(
            (total_kg - weight_kg).abs() < within_kg,
            "{}: {total_kg} kg",
            published.arm
        );
    }
}

/// A body of positive density everywhere has principal moments of which none exceeds the sum of the
/// others.
#[test]
fn inertia_tensors_are_those_of_bodies_that_can_be() {
    for (robot, published) in arms() {
        for (joint, body) in robot.bodies.iter().enumerate() {
            let mut moments = body.inertia_kgm2.symmetric_eigenvalues();
            moments.as_mut_slice().sort_by(f64::total_cmp);
            assert!(moments[0] > 0.0, "{} {joint}", published.arm);
            assert!(
                moments[2] < moments[0] + moments[1],
                "{} {joint}: {moments}",
                published.arm
            );
        }
    }
}

/// Every shipped arm is among the published ones here, and the other way round.
#[test]
fn no_shipped_arm_is_missing_here() {
    let mut here: Vec<&str> = PUBLISHED.iter().map(|published| published.arm).collect();
    here.sort_unstable();
    let mut shipped: Vec<&str> = Arm::shipped_names().collect();
    shipped.sort_unstable();
    assert_eq!(here, shipped);
}

/// Postures of joints anywhere within a turn, none near a singularity of their wrist or elbow.
fn postures() -> impl Iterator<Item = Joints> {
    let postures = (0..400_u32).map(|i| {
        Joints::from_fn(|joint, _| libm::sin(f64::from(i) * 1.3 + joint as f64 * 2.1) * PI)
    });
    postures.filter(|q| libm::sin(q[4]).abs() > 0.1 && libm::sin(q[2]).abs() > 0.1)
}

/// Closed form and iteration are two ways to the same posture, and forward kinematics judges both.
#[test]
fn inverse_kinematics_of_every_shipped_arm_gives_postures_with_the_pose() {
    const POSE: f64 = 1e-10;
    /// The elbow's angle follows from a cosine, which loses digits near a stretched arm.
    const POSTURE_RAD: f64 = 1e-8;
    for arm in Arm::shipped() {
        let overrides = Overrides {
            arm: Some(arm.key.clone()),
            ..Overrides::default()
        };
        let robot = load_robot(&overrides).unwrap();
        let kinematics = Kinematics::new(robot.chain).unwrap();
        let mut with_eight = 0;
        for q in postures() {
            let pose = robot.chain.base_link_from_flange(&q);
            let answer = kinematics.solve(&pose, None);
            let count = answer.solutions.len();
            assert!((1..=8).contains(&count), "{}: {count} of {q}", arm.key);
            with_eight += usize::from(count == 8);
            let turn = |a: f64, b: f64| libm::remainder(a - b, 2.0 * PI).abs();
            let apart = |a: &Joints| {
                a.iter()
                    .zip(&q)
                    .map(|(a, b)| turn(*a, *b))
                    .fold(0.0, f64::max)
            };
            let mut nearest = f64::INFINITY;
            for row in &answer.solutions {
                let again = robot.chain.base_link_from_flange(&row.joints);
                let off_m = (again.translation.vector - pose.translation.vector).norm();
                let off_rad = rotation_angle_between(&again.rotation, &pose.rotation);
                assert!(
                    off_m < POSE && off_rad < POSE,
                    "{}: {off_m:e} {off_rad:e}",
                    arm.key
                );
                nearest = nearest.min(apart(&row.joints));
            }
            assert!(nearest < POSTURE_RAD, "{}: {nearest:e} of {q}", arm.key);
        }
        assert!(with_eight > 100, "{}: {with_eight}", arm.key);
    }
}

/// Clearances of shapes that were compared with nothing are not to pass for measured ones.
#[test]
fn arms_with_assumed_shapes_say_so_and_others_do_not() {
    for arm in Arm::shipped() {
        let overrides = Overrides {
            arm: Some(arm.key.clone()),
            ..Overrides::default()
        };
        let robot = load_robot(&overrides).unwrap();
        let notes = &robot.description.notes;
        let is_told = notes.iter().any(|note| note.starts_with(ASSUMED_SHAPES));
        assert_eq!(
            is_told,
            ["ur20", "ur30"].contains(&arm.key.as_str()),
            "{notes:?}"
        );
    }
}
