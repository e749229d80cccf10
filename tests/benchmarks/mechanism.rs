//! Mechanisms with closed-form motion, made of an arm of six joints.
//!
//! All joint frames lie in the origin of `base_link`, so that a joint turns whatever its axis names
//! about that point. The first one or two joints are free. The others turn about the lever itself, where no
//! force has a moment but the friction of a ball, whose own turning changes nothing: they stay at
//! rest without being locked.

use nalgebra::{Matrix3, UnitVector3, Vector3};
use needlebench_cell::{
    BodyKind, Cell, CollisionBody, Frame, Link, Needle, NeedleCorridor, Robot, Tool,
};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::{
    Body, Chain, ChainJoint, JOINT_COUNT, JOINT_LABELS, JointLimit, JointLimits, Joints, Pose,
};

/// Armature of the joints that stay at rest, kg m^2: keeps the mass matrix regular. Far larger ones
/// (1e12) would spoil MuJoCo's contacts, whose solver measures its tolerance by the mean inertia.
pub const RESTING_KGM2: f64 = 1.0;

/// Gravity, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.81;

/// Radius of the ball at the lever's end, m.
pub const BALL_RADIUS_M: f64 = 0.02;

/// A ball on a massless lever.
pub struct Mechanism {
    /// Axes of the free joints at rest, one or two.
    pub free_joints: Vec<UnitVector3<f64>>,
    /// From the axes to the ball's centre, along x, m.
    pub lever_m: f64,
    /// The ball's mass, kg.
    pub ball_kg: f64,
    /// Gravity, m/s^2.
    pub gravity_m_s2: Vector3<f64>,
    /// Whether there is a table that the ball just touches at rest.
    pub has_table: bool,
    /// Armature of the joints that stay at rest, kg m^2.
    pub resting_kgm2: f64,
}

/// Mass and moment of inertia of the small body in the origin that each inner link is.
const HUB_KG: f64 = 0.1;
pub const HUB_KGM2: f64 = 1e-3;

fn ball(mass_kg: f64, com_m: Vector3<f64>, moment_kgm2: f64) -> Body {
    Body {
        mass_kg,
        com_m,
        inertia_kgm2: Matrix3::identity() * moment_kgm2,
    }
}

impl Mechanism {
    /// Moment of inertia of the ball about its own centre.
    fn ball_moment_kgm2(&self) -> f64 {
        0.4 * self.ball_kg * BALL_RADIUS_M.powi(2)
    }

    /// Moment of inertia about the first axis if the lever is square to it, kg m^2.
    pub fn moment_kgm2(&self) -> f64 {
        let hubs = 5.0 * HUB_KGM2;
        self.ball_kg * self.lever_m.powi(2) + self.ball_moment_kgm2() + hubs
    }

    /// The cell.
    pub fn cell(&self) -> Cell {
        let axis = |i: usize| {
            self.free_joints
                .get(i)
                .copied()
                .unwrap_or(Vector3::x_axis())
        };
        let chain = Chain {
            joints: std::array::from_fn(|i| ChainJoint {
                parent_from_joint: Pose::identity(),
                axis: axis(i),
            }),
            wrist_3_from_flange: Pose::translation(self.lever_m, 0.0, 0.0),
        };
        let mut bodies = [ball(HUB_KG, Vector3::zeros(), HUB_KGM2); JOINT_COUNT];
        let com_m = Vector3::x() * self.lever_m;
        bodies[JOINT_COUNT - 1] = ball(self.ball_kg, com_m, self.ball_moment_kgm2());
        let mut links = JOINT_LABELS.map(|name| link(name, Vec::new()));
        let mut surroundings = Vec::new();
        if self.has_table {
            links[JOINT_COUNT - 1].solids.push(Solid {
                name: "ball".into(),
                shape: Shape::Sphere {
                    radius_m: BALL_RADIUS_M,
                },
                parent_from_shape: Pose::translation(self.lever_m, 0.0, 0.0),
            });
            surroundings.push(table());
        }
        let is_free = |i: usize| i < self.free_joints.len();
        let armature = Joints::from_fn(|i, _| if is_free(i) { 0.0 } else { self.resting_kgm2 });
        let robot = Robot {
            unseen: Vec::new(),
            name: "mechanism".into(),
            world_from_base_link: Pose::identity(),
            chain,
            base: link("base", Vec::new()),
            links,
            bodies,
            limits: JointLimits(std::array::from_fn(|_| JointLimit {
                lower_rad: -100.0,
                upper_rad: 100.0,
                velocity_rad_s: 100.0,
                effort_nm: 1e3,
            })),
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
            armature,
            self.gravity_m_s2,
        )
    }
}

fn table() -> CollisionBody {
    const HALF_THICKNESS_M: f64 = 0.05;
    CollisionBody {
        name: "table".into(),
        kind: BodyKind::Table,
        frame: Frame::World,
        solids: vec![Solid {
            name: "table".into(),
            shape: Shape::Cuboid {
                half_extents_m: Vector3::new(2.0, 2.0, HALF_THICKNESS_M),
            },
            parent_from_shape: Pose::translation(0.0, 0.0, -BALL_RADIUS_M - HALF_THICKNESS_M),
        }],
    }
}

fn link(name: &str, solids: Vec<Solid>) -> Link {
    Link {
        name: name.into(),
        solids,
        visuals: Vec::new(),
    }
}

/// A tool without mass or shape: the flange is the ball's centre.
fn tool() -> Tool {
    Tool {
        unseen: Vec::new(),
        name: "none".into(),
        solids: Vec::new(),
        guide_solids: Vec::new(),
        visuals: Vec::new(),
        body: Body::massless(),
        flange_from_guide_entry: Pose::identity(),
        flange_from_guide_exit: Pose::identity(),
        bore_m: 1.8e-3,
        needle: Needle {
            gauge: 17,
            outer_diameter_m: 1.47e-3,
            length_m: 0.15,
        },
    }
}
