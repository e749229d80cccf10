//! The shipped arms' URDFs against what the maker publishes of each: lengths, masses and centres, total
//! mass. The published figures are typed in here from the maker's article, in its own frames.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_kinematics::{Joints, Pose, rotation_angle_between};
use needlebench_robot::LoadedRobot;
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
    /// UR3's base is the ROS description's, which is too light.
    weight_kg: (f64, f64),
}

const PUBLISHED: [Published; 3] = [
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
