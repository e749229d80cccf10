//! URDF files of every UR arm with link frames of another house: turned and moved along their joints' axes, fixed joints
//! between, a prefix of all names. Their forward kinematics is that of the published DH chain, multiplied here.

use std::f64::consts::PI;
use std::fmt::Write as _;

use nalgebra::{Matrix4, Vector3};
use needlebench_kinematics::{Joints, UrGeometry, UrModel};
use needlebench_scenario::{Overrides, load_robot};

/// Products of two dozen transforms over two metres, with angles of 17 digits.
const CHAIN: f64 = 1e-13;
/// Files of each arm.
const FILES: u32 = 8;

const JOINTS: [&str; 6] = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
];

/// Numbers without an order, the same in every run (splitmix64).
pub struct Draws(pub u64);

impl Draws {
    /// Between -1 and 1.
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        f64::from(u32::try_from((z ^ (z >> 31)) >> 32).unwrap()) / f64::from(u32::MAX) * 2.0 - 1.0
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        let share = 0.5 * (self.next() + 1.0);
        (0..end)
            .rev()
            .find(|k| share * end as f64 >= *k as f64)
            .unwrap_or(0)
    }

    pub fn turn(&mut self) -> Matrix4<f64> {
        let [roll, pitch, yaw] = [self.next(), self.next(), self.next()];
        about_z(yaw * PI) * about_y(pitch * 0.5 * PI) * about_x(roll * PI)
    }
}

#[rustfmt::skip]
pub fn about_x(angle: f64) -> Matrix4<f64> {
    let (s, c) = libm::sincos(angle);
    Matrix4::new(
        1.0, 0.0, 0.0, 0.0,
        0.0, c, -s, 0.0,
        0.0, s, c, 0.0,
        0.0, 0.0, 0.0, 1.0,
    )
}

#[rustfmt::skip]
pub fn about_y(angle: f64) -> Matrix4<f64> {
    let (s, c) = libm::sincos(angle);
    Matrix4::new(
        c, 0.0, s, 0.0,
        0.0, 1.0, 0.0, 0.0,
        -s, 0.0, c, 0.0,
        0.0, 0.0, 0.0, 1.0,
    )
}

#[rustfmt::skip]
pub fn about_z(angle: f64) -> Matrix4<f64> {
    let (s, c) = libm::sincos(angle);
    Matrix4::new(
        c, -s, 0.0, 0.0,
        s, c, 0.0, 0.0,
        0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 1.0,
    )
}

pub fn along(x: f64, y: f64, z: f64) -> Matrix4<f64> {
    Matrix4::new_translation(&Vector3::new(x, y, z))
}

/// The inverse of a rotation and a translation.
pub fn back(pose: &Matrix4<f64>) -> Matrix4<f64> {
    let turn = pose.fixed_view::<3, 3>(0, 0).transpose();
    let moved = -(turn * pose.fixed_view::<3, 1>(0, 3));
    let mut inverse = Matrix4::identity();
    inverse.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    inverse.fixed_view_mut::<3, 1>(0, 3).copy_from(&moved);
    inverse
}

/// `<origin>` of a URDF: roll, pitch and yaw about the fixed axes.
pub fn origin(pose: &Matrix4<f64>) -> String {
    let m = |row: usize, column: usize| pose[(row, column)];
    let roll = libm::atan2(m(2, 1), m(2, 2));
    let pitch = libm::atan2(-m(2, 0), libm::sqrt(m(0, 0) * m(0, 0) + m(1, 0) * m(1, 0)));
    let yaw = libm::atan2(m(1, 0), m(0, 0));
    format!(
        "<origin xyz=\"{:e} {:e} {:e}\" rpy=\"{roll:e} {pitch:e} {yaw:e}\"/>",
        m(0, 3),
        m(1, 3),
        m(2, 3)
    )
}

/// What follows a joint's turn in the standard DH chain, row by row.
fn rows(arm: &UrGeometry) -> [Matrix4<f64>; 6] {
    [
        (0.0, arm.d1, 0.5 * PI),
        (arm.a2, 0.0, 0.0),
        (arm.a3, 0.0, 0.0),
        (0.0, arm.d4, 0.5 * PI),
        (0.0, arm.d5, -0.5 * PI),
        (0.0, arm.d6, 0.0),
    ]
    .map(|(a, d, twist)| along(a, 0.0, d) * about_x(twist))
}

/// From `base_link` to the flange by the DH chain: the controller's base is turned by half a turn.
fn expected(arm: &UrGeometry, q: &Joints) -> Matrix4<f64> {
    let rows = rows(arm);
    let turned = q.iter().zip(rows).map(|(angle, row)| about_z(*angle) * row);
    turned.fold(about_z(PI), |pose, each| pose * each)
}

/// The arm's URDF with frames of its own in every link.
fn foreign(arm: &UrGeometry, draws: &mut Draws, prefix: &str) -> String {
    let mut text = format!("<robot name=\"theirs\">\n<link name=\"{prefix}base_link\"/>\n");
    let fixed = |text: &mut String,
                 number: usize,
                 parent: &str,
                 child: &str,
                 pose: &Matrix4<f64>| {
        writeln!(
            text,
            "<link name=\"{child}\"/><joint name=\"{prefix}fixed_{number}\" type=\"fixed\"><parent link=\"{parent}\"/>\
             <child link=\"{child}\"/>{}</joint>",
            origin(pose)
        )
        .unwrap();
    };
    let mut parent = format!("{prefix}base_link");
    // From where the parent's frame would be by DH, after its row.
    let mut before = about_z(PI);
    for (index, (joint, row)) in JOINTS.into_iter().zip(rows(arm)).enumerate() {
        let turn = draws.turn();
        let own = along(0.0, 0.0, 0.2 * draws.next()) * turn;
        let mut pose = before * own;
        if draws.next() > 0.0 {
            let [x, y, z] = [draws.next(), draws.next(), draws.next()].map(|share| 0.15 * share);
            let spacer = along(x, y, z) * draws.turn();
            let child = format!("{prefix}spacer_{index}");
            fixed(&mut text, index, &parent, &child, &spacer);
            parent = child;
            pose = back(&spacer) * pose;
        }
        let axis = back(&turn).fixed_view::<3, 1>(0, 2).into_owned();
        let child = format!("{prefix}part_{index}");
        writeln!(
            text,
            "<link name=\"{child}\"><inertial><mass value=\"1\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" \
             iyz=\"0\" izz=\"0.01\"/></inertial></link>\n\
             <joint name=\"{prefix}{joint}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{}\
             <axis xyz=\"{:e} {:e} {:e}\"/><limit lower=\"-6\" upper=\"6\" effort=\"50\" velocity=\"2\"/></joint>",
            origin(&pose),
            axis.x,
            axis.y,
            axis.z
        )
        .unwrap();
        parent = child;
        before = back(&own) * row;
    }
    fixed(&mut text, 6, &parent, &format!("{prefix}tool0"), &before);
    text + "</robot>\n"
}

#[test]
fn a_urdf_with_any_frames_has_the_forward_kinematics_of_its_dh_chain() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("theirs.urdf");
    let mut worst = 0.0_f64;
    for (number, model) in UrModel::ALL.into_iter().enumerate() {
        let arm = model.geometry();
        for variant in 0..FILES {
            let mut draws = Draws(u64::from(variant) + 1000 * number as u64);
            let prefix = ["", "left_", "cell_2_"][variant as usize % 3];
            std::fs::write(&file, foreign(&arm, &mut draws, prefix)).unwrap();
            let overrides = Overrides {
                robot_urdf: Some(file.clone()),
                ..Overrides::default()
            };
            let robot = load_robot(&overrides)
                .unwrap_or_else(|finding| panic!("{model} {variant}: {finding:?}"));
            for _ in 0..40 {
                let q = Joints::from_fn(|_, _| 2.0 * PI * draws.next());
                let off =
                    robot.chain.base_link_from_flange(&q).to_homogeneous() - expected(&arm, &q);
                worst = worst.max(off.amax());
                assert!(
                    off.amax() < CHAIN,
                    "{model} {variant}: {:e} at {q}",
                    off.amax()
                );
            }
            // A frame that is off by a tenth of a millimetre is seen.
            let moved = UrGeometry {
                d4: arm.d4 + 1e-4,
                ..arm
            };
            let off = robot
                .chain
                .base_link_from_flange(&Joints::zeros())
                .to_homogeneous();
            assert!((off - expected(&moved, &Joints::zeros())).amax() > 0.9e-4);
        }
    }
    println!("worst deviation {worst:e}");
}
