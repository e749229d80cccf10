//! A UR3 with a small tool, built in code, for this crate's tests.
//!
//! Origins, masses and centres of mass are those of Universal_Robots_ROS2_Description 2.4.5
//! (`config/ur3`); the inertia tensors are uniform-density ones of the links' meshes.

#![allow(dead_code, reason = "every test file uses a part of it")]

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_cell::{
    BrakeFigures, Cell, CollisionBody, Link, Needle, NeedleCorridor, Robot, Tool,
};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::{
    Body, Chain, ChainJoint, JOINT_COUNT, JOINT_LABELS, JointLimit, JointLimits, Joints, Pose,
};
use needlebench_scenario::{Overrides, load_robot};

/// Pose from a URDF origin: position (m) and roll, pitch, yaw (rad).
pub fn origin(xyz: [f64; 3], rpy: [f64; 3]) -> Pose {
    Pose::from_parts(
        Translation3::new(xyz[0], xyz[1], xyz[2]),
        UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]),
    )
}

/// A UR3's nominal joint origins.
pub fn chain() -> Chain {
    let joint = |xyz, rpy| ChainJoint {
        parent_from_joint: origin(xyz, rpy),
        axis: Vector3::z_axis(),
    };
    let mut joints = [
        joint([0.0, 0.0, 0.1519], [0.0; 3]),
        joint([0.0; 3], [FRAC_PI_2, 0.0, 0.0]),
        joint([-0.24365, 0.0, 0.0], [0.0; 3]),
        joint([-0.21325, 0.0, 0.11235], [0.0; 3]),
        joint([0.0, -0.08535, 0.0], [FRAC_PI_2, 0.0, 0.0]),
        joint([0.0, 0.0819, 0.0], [FRAC_PI_2, PI, PI]),
    ];
    joints[0].parent_from_joint = Robot::base_link_from_base() * joints[0].parent_from_joint;
    Chain {
        joints,
        wrist_3_from_flange: Pose::identity(),
    }
}

/// Mass properties of a UR3's moving links.
pub fn link_bodies() -> [Body; JOINT_COUNT] {
    let body = |mass_kg, com: [f64; 3], [xx, yy, zz, xy, xz, yz]: [f64; 6]| Body {
        mass_kg,
        com_m: Vector3::from(com),
        inertia_kgm2: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    };
    [
        body(
            2.0,
            [0.0, 0.0, -0.02],
            [
                3.70719e-3,
                3.47494e-3,
                2.48130e-3,
                -2.75082e-6,
                -1.31174e-6,
                3.33743e-5,
            ],
        ),
        body(
            3.42,
            [-0.11365, 0.0, 0.1157],
            [
                4.66881e-3,
                3.95086e-2,
                3.80886e-2,
                -2.33184e-5,
                1.01464e-3,
                9.36586e-6,
            ],
        ),
        body(
            1.26,
            [-0.16325, 0.0, 0.0238],
            [
                9.81572e-4,
                9.47704e-3,
                9.24821e-3,
                -1.70344e-6,
                -7.37320e-4,
                -4.11318e-6,
            ],
        ),
        body(
            0.8,
            [0.0, -0.01, 0.0],
            [
                7.89098e-4,
                5.36994e-4,
                6.91024e-4,
                7.98757e-7,
                7.54149e-7,
                -5.92827e-6,
            ],
        ),
        body(
            0.8,
            [0.0, 0.01, 0.0],
            [
                7.89431e-4, 5.36586e-4, 6.90885e-4, 9.03206e-7, 1.35327e-6, 7.03657e-6,
            ],
        ),
        body(
            0.35,
            [0.0, 0.0, -0.02],
            [
                1.38683e-4, 1.34522e-4, 1.80713e-4, 1.29832e-7, 2.02497e-7, 8.34780e-7,
            ],
        ),
    ]
}

/// A cylinder about an axis through `center`, m.
pub fn cylinder(
    name: &str,
    center: [f64; 3],
    axis: UnitVector3<f64>,
    radius_m: f64,
    length_m: f64,
) -> Solid {
    let rotation =
        UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), &axis).expect("not opposite");
    Solid {
        name: name.into(),
        shape: Shape::Cylinder {
            radius_m,
            half_length_m: 0.5 * length_m,
        },
        parent_from_shape: Pose::from_parts(Translation3::from(center), rotation),
    }
}

/// A box along the axes of the world, from its centre and its full edge lengths, m.
pub fn cuboid(name: &str, center: [f64; 3], edges: [f64; 3]) -> Solid {
    Solid {
        name: name.into(),
        shape: Shape::Cuboid {
            half_extents_m: Vector3::from(edges) * 0.5,
        },
        parent_from_shape: Pose::translation(center[0], center[1], center[2]),
    }
}

fn link_solids() -> [Vec<Solid>; JOINT_COUNT] {
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    [
        vec![cylinder("shoulder", [0.0, 0.0, 0.0], z, 0.055, 0.13)],
        vec![
            cylinder("upper_arm.1", [0.0, 0.0, 0.1], z, 0.055, 0.12),
            cylinder("upper_arm.2", [-0.122, 0.0, 0.12], x, 0.04, 0.2),
        ],
        vec![
            cylinder("forearm.1", [0.0, 0.0, 0.03], z, 0.045, 0.1),
            cylinder("forearm.2", [-0.107, 0.0, 0.0275], x, 0.035, 0.18),
        ],
        vec![cylinder("wrist_1", [0.0, 0.0, 0.0], y, 0.033, 0.09)],
        vec![cylinder("wrist_2", [0.0, 0.0, 0.0], y, 0.033, 0.09)],
        vec![cylinder("wrist_3", [0.0, 0.0, -0.02], z, 0.032, 0.04)],
    ]
}

fn tool() -> Tool {
    let guide_entry = Pose::translation(0.0, 0.06, 0.02);
    Tool {
        name: "test".into(),
        solids: vec![cuboid("tool.1", [0.0, 0.03, 0.01], [0.04, 0.08, 0.02])],
        unseen: Vec::new(),
        guide_solids: vec![cylinder(
            "guide",
            [0.0, 0.06, 0.06],
            Vector3::z_axis(),
            0.006,
            0.08,
        )],
        visuals: Vec::new(),
        body: Body {
            mass_kg: 0.15,
            com_m: Vector3::new(0.002, 0.035, 0.03),
            inertia_kgm2: Matrix3::new(
                2.1e-4, 1e-6, -2e-6, 1e-6, 1.2e-4, 3e-6, -2e-6, 3e-6, 1.3e-4,
            ),
        },
        flange_from_guide_entry: guide_entry,
        flange_from_guide_exit: guide_entry * Pose::translation(0.0, 0.0, 0.08),
        bore_m: 1.8e-3,
        needle: Needle {
            gauge: 17,
            outer_diameter_m: 1.47e-3,
            length_m: 0.15,
        },
    }
}

fn limits() -> JointLimits {
    let limit = |velocity_rad_s, effort_nm| JointLimit {
        lower_rad: -2.0 * PI,
        upper_rad: 2.0 * PI,
        velocity_rad_s,
        effort_nm,
    };
    JointLimits([
        limit(PI, 56.0),
        limit(PI, 56.0),
        limit(PI, 28.0),
        limit(2.0 * PI, 12.0),
        limit(2.0 * PI, 12.0),
        limit(2.0 * PI, 12.0),
    ])
}

/// The published stops of an arm that ships.
pub fn brake_figures(arm: &str) -> BrakeFigures {
    let overrides = Overrides {
        arm: Some(arm.to_owned()),
        ..Overrides::default()
    };
    let robot = load_robot(&overrides).expect("shipped arms are sound");
    let used = robot.description.arm.expect("it is the arm's own URDF");
    used.brakes().expect("it has figures of its brakes")
}

/// A UR3, tilted and turned on its mount, among `surroundings`.
pub fn ur3(surroundings: Vec<CollisionBody>) -> Cell {
    let link = |name: &str, solids| Link {
        name: name.into(),
        solids,
        visuals: Vec::new(),
    };
    let mut solids = link_solids().into_iter();
    let base_solid = cylinder("base", [0.0, 0.0, 0.045], Vector3::z_axis(), 0.06, 0.09);
    let robot = Robot {
        name: "ur3".into(),
        world_from_base_link: origin([0.3, -0.2, 0.5], [0.1, -0.2, 0.7]),
        chain: chain(),
        base: link("base", vec![base_solid]),
        links: JOINT_LABELS.map(|name| link(name, solids.next().expect("six links"))),
        unseen: Vec::new(),
        bodies: link_bodies(),
        limits: limits(),
    };
    Cell::assemble(
        robot,
        tool(),
        NeedleCorridor {
            radius_m: 0.02,
            length_m: 0.2,
            hand_cone_half_angle_rad: 0.0,
        },
        surroundings,
        Joints::new(0.612, 0.612, 0.212, 0.0714, 0.0714, 0.0716),
        Vector3::new(0.0, 0.0, -9.81),
    )
}

/// Numbers in [0, 1), the same on every machine (SplitMix64).
pub struct Random(pub u64);

impl Random {
    /// The next number.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Joint values within `+-amplitude`.
    pub fn joints(&mut self, amplitude: f64) -> Joints {
        Joints::from_fn(|_, _| amplitude * (2.0 * self.unit() - 1.0))
    }
}
