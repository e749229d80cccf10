//! A cell as large as a real one, put together by hand, and a deterministic source of variety.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use needlebench_cell::{
    BodyKind, Cell, CollisionBody, Frame, Link, Needle, NeedleCorridor, Robot, Tool,
};
use needlebench_geometry::sample_solids::ellipsoid;
use needlebench_geometry::{ConvexMesh, Shape, Solid, TriangleMesh};
use needlebench_kinematics::{
    Body, Chain, ChainJoint, JOINT_COUNT, JointLimit, JointLimits, Joints, Pose,
};
use needlebench_numerics::random::SplitMix64;

/// Numbers that look random and are the same every time.
pub struct Variety(SplitMix64);

impl Variety {
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.uniform(low, high)
    }

    pub fn joints(&mut self) -> Joints {
        Joints::from_fn(|_, _| self.between(-PI, PI))
    }
}

/// A piece of a ring about z: eight corners and twelve triangles.
fn wedge(inner_m: f64, outer_m: f64, half_length_m: f64, half_angle_rad: f64) -> Shape {
    let mut vertices_m = Vec::new();
    for radius in [inner_m, outer_m] {
        for angle in [-half_angle_rad, half_angle_rad] {
            for z in [-half_length_m, half_length_m] {
                vertices_m.push(Point3::new(
                    radius * libm::cos(angle),
                    radius * libm::sin(angle),
                    z,
                ));
            }
        }
    }
    let triangles = vec![
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    Shape::Convex(Arc::new(ConvexMesh(TriangleMesh {
        vertices_m,
        triangles,
    })))
}

fn solid(name: &str, shape: Shape, parent_from_shape: Pose) -> Solid {
    Solid {
        name: name.into(),
        shape,
        parent_from_shape,
    }
}

/// A cylinder from one point to another.
fn tube(name: &str, from: [f64; 3], to: [f64; 3], radius_m: f64) -> Solid {
    let (from, to) = (Vector3::from(from), Vector3::from(to));
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &(to - from))
        .unwrap_or_else(|| UnitQuaternion::new(Vector3::x() * PI));
    solid(
        name,
        Shape::Cylinder {
            radius_m,
            half_length_m: 0.5 * (to - from).norm(),
        },
        Pose::from_parts(Translation3::from((from + to) * 0.5), rotation),
    )
}

fn cuboid(name: &str, centre: [f64; 3], half: [f64; 3]) -> Solid {
    let shape = Shape::Cuboid {
        half_extents_m: Vector3::from(half),
    };
    solid(
        name,
        shape,
        Pose::translation(centre[0], centre[1], centre[2]),
    )
}

fn link(name: &str, solids: Vec<Solid>) -> Link {
    Link {
        name: name.into(),
        solids,
        visuals: Vec::new(),
    }
}

/// The UR3's chain; each joint turns about the z axis of its child.
fn chain() -> Chain {
    let joint = |x: f64, y: f64, z: f64, about_x: f64| ChainJoint {
        parent_from_joint: Pose::new(Vector3::new(x, y, z), Vector3::x() * about_x),
        axis: Unit::new_unchecked(Vector3::z()),
    };
    Chain {
        joints: [
            joint(0.0, 0.0, 0.1519, 0.0),
            joint(0.0, 0.0, 0.0, FRAC_PI_2),
            joint(-0.24365, 0.0, 0.0, 0.0),
            joint(-0.21325, 0.0, 0.11235, 0.0),
            joint(0.0, -0.08535, 0.0, FRAC_PI_2),
            joint(0.0, 0.0819, 0.0, -FRAC_PI_2),
        ],
        wrist_3_from_flange: Pose::identity(),
    }
}

fn robot() -> Robot {
    let links = [
        link(
            "shoulder",
            vec![
                tube("shoulder.1", [0.0, 0.0, -0.06], [0.0, 0.0, 0.06], 0.046),
                tube("shoulder.2", [0.0, -0.06, 0.0], [0.0, 0.04, 0.0], 0.046),
                tube("shoulder.3", [0.0, -0.07, 0.0], [0.0, -0.06, 0.0], 0.04),
            ],
        ),
        link(
            "upper_arm",
            vec![
                tube("upper_arm.1", [0.0, 0.0, 0.06], [0.0, 0.0, 0.17], 0.047),
                tube("upper_arm.2", [0.0, 0.0, 0.12], [-0.24, 0.0, 0.12], 0.036),
                tube("upper_arm.3", [-0.24, 0.0, 0.07], [-0.24, 0.0, 0.16], 0.04),
                tube("upper_arm.4", [-0.24, 0.0, 0.16], [-0.24, 0.0, 0.17], 0.035),
            ],
        ),
        link(
            "forearm",
            vec![
                tube("forearm.1", [0.0, 0.0, -0.02], [0.0, 0.0, 0.06], 0.036),
                tube("forearm.2", [0.0, 0.0, 0.03], [-0.213, 0.0, 0.03], 0.03),
                tube(
                    "forearm.3",
                    [-0.213, 0.0, -0.01],
                    [-0.213, 0.0, 0.07],
                    0.033,
                ),
                tube("forearm.4", [-0.1, 0.0, 0.03], [-0.2, 0.0, 0.03], 0.032),
            ],
        ),
        link(
            "wrist_1",
            vec![
                tube("wrist_1.1", [0.0, 0.0, -0.04], [0.0, 0.0, 0.04], 0.032),
                tube("wrist_1.2", [0.0, -0.05, 0.0], [0.0, 0.03, 0.0], 0.032),
                tube("wrist_1.3", [0.0, 0.03, 0.0], [0.0, 0.04, 0.0], 0.03),
            ],
        ),
        link(
            "wrist_2",
            vec![
                tube("wrist_2.1", [0.0, 0.0, -0.04], [0.0, 0.0, 0.04], 0.032),
                tube("wrist_2.2", [0.0, -0.03, 0.0], [0.0, 0.05, 0.0], 0.032),
                tube("wrist_2.3", [0.0, -0.04, 0.0], [0.0, -0.03, 0.0], 0.03),
            ],
        ),
        link(
            "wrist_3",
            vec![tube("wrist_3.1", [0.0, 0.0, -0.03], [0.0, 0.0, 0.0], 0.032)],
        ),
    ];
    Robot {
        name: "ur3".into(),
        world_from_base_link: Pose::translation(0.0, 0.0, 0.0),
        chain: chain(),
        base: link(
            "base",
            vec![
                tube("base.1", [0.0, 0.0, 0.0], [0.0, 0.0, 0.04], 0.064),
                tube("base.2", [0.0, 0.0, 0.04], [0.0, 0.0, 0.09], 0.05),
            ],
        ),
        links,
        unseen: Vec::new(),
        bodies: [Body::massless(); JOINT_COUNT],
        limits: JointLimits(
            [JointLimit {
                lower_rad: -TAU,
                upper_rad: TAU,
                velocity_rad_s: PI,
                effort_nm: 50.0,
            }; JOINT_COUNT],
        ),
    }
}

fn tool() -> Tool {
    Tool {
        name: "offset".into(),
        solids: vec![
            cuboid("tool.plate", [0.0, 0.0, 0.005], [0.035, 0.035, 0.005]),
            cuboid("tool.arm", [0.06, 0.0, 0.01], [0.05, 0.012, 0.005]),
            tube("tool.boss", [0.1, 0.0, 0.0], [0.1, 0.0, 0.02], 0.012),
        ],
        unseen: Vec::new(),
        guide_solids: vec![solid(
            "guide_tube.1",
            Shape::Capsule {
                radius_m: 0.006,
                half_length_m: 0.03,
            },
            Pose::translation(0.1, 0.0, 0.05),
        )],
        visuals: Vec::new(),
        body: Body {
            mass_kg: 0.2,
            com_m: Vector3::zeros(),
            inertia_kgm2: Matrix3::identity() * 1e-4,
        },
        flange_from_guide_entry: Pose::translation(0.1, 0.0, 0.02),
        flange_from_guide_exit: Pose::translation(0.1, 0.0, 0.08),
        bore_m: 0.0013,
        needle: Needle {
            gauge: 18,
            outer_diameter_m: 0.00127,
            length_m: 0.15,
        },
    }
}

pub fn fixed(name: &str, kind: BodyKind, solids: Vec<Solid>) -> CollisionBody {
    CollisionBody {
        name: name.into(),
        kind,
        frame: Frame::World,
        solids,
    }
}

/// An arm of 24 solids beside a patient on a table in a gantry: 46 fixed pieces, of which the
/// skin has 402 vertices.
pub fn cell() -> Cell {
    cell_among(Vec::new())
}

/// The same among obstacles.
pub fn cell_among(obstacles: Vec<CollisionBody>) -> Cell {
    let skin = ellipsoid(21, 20, Vector3::new(0.17, 0.11, 0.28));
    let skin = Shape::Convex(Arc::new(ConvexMesh(skin)));
    let along_y = UnitQuaternion::new(Vector3::x() * FRAC_PI_2);
    let phantom = vec![solid(
        "skin",
        skin,
        Pose::from_parts(Translation3::new(0.42, 0.0, 0.12), along_y),
    )];
    let table = vec![
        cuboid("table.top", [0.42, 0.0, -0.02], [0.22, 1.0, 0.02]),
        cuboid("table.left", [0.21, 0.0, 0.0], [0.01, 1.0, 0.02]),
        cuboid("table.right", [0.63, 0.0, 0.0], [0.01, 1.0, 0.02]),
        cuboid("table.foot", [0.42, 0.8, -0.4], [0.2, 0.15, 0.35]),
    ];
    let gantry = (0..30)
        .map(|i| {
            let turn = TAU * f64::from(i) / 30.0;
            let about_bore = along_y * UnitQuaternion::new(Vector3::z() * turn);
            solid(
                &format!("gantry.{i}"),
                wedge(0.35, 0.6, 0.15, TAU / 60.0),
                Pose::from_parts(Translation3::new(0.42, 0.55, 0.15), about_bore),
            )
        })
        .collect();
    let mount = (0..11)
        .map(|i| {
            let z = -0.04 - 0.05 * f64::from(i);
            cuboid(&format!("mount.{i}"), [0.0, 0.0, z], [0.07, 0.07, 0.02])
        })
        .collect();
    Cell::assemble(
        robot(),
        tool(),
        NeedleCorridor {
            radius_m: 0.04,
            length_m: 0.2,
            hand_cone_half_angle_rad: 0.0,
        },
        [
            vec![
                fixed("phantom", BodyKind::Phantom, phantom),
                fixed("table", BodyKind::Table, table),
                fixed("gantry", BodyKind::Gantry, gantry),
                fixed("mount", BodyKind::Mount, mount),
            ],
            obstacles,
        ]
        .concat(),
        Joints::repeat(0.1),
        Vector3::new(0.0, 0.0, -9.80665),
    )
}
