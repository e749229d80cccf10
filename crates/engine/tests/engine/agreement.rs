//! rapier against MuJoCo: one cell, one servo, one trajectory.

use crate::process as harness;
use nalgebra::{Point3, Vector3, Vector6};
use needlebench_cell::{BodyKind, Cell, CollisionBody, Frame};
use needlebench_engine::{
    Actuation, Hooks, MujocoPlant, MujocoSettings, Plant, PlantState, RapierPlant, RapierSettings,
    Recording, Servo, ServoGains, simulate,
};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};
use needlebench_kinematics::{Joints, Pose};

const TIMESTEP_S: f64 = 1e-3;

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> MotionLimits {
    MotionLimits {
        velocity: Joints::repeat(velocity),
        acceleration: Joints::repeat(acceleration),
        jerk: Joints::repeat(jerk),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 0.5,
            jerk: 5.0,
        },
    }
}

fn servo(cell: &Cell) -> Servo {
    Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    }
}

/// Recordings of both engines, rapier's first.
fn both(cell: &Cell, trajectory: &JointTrajectory) -> [Recording; 2] {
    let servo = servo(cell);
    let mut harness = harness::harness();
    let mut rapier = RapierPlant::new(cell, TIMESTEP_S, &RapierSettings::default()).unwrap();
    let mut mujoco =
        MujocoPlant::new(&mut harness, cell, TIMESTEP_S, &MujocoSettings::default()).unwrap();
    let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
    plants.map(|plant| {
        simulate(
            plant,
            &servo,
            &Actuation::default(),
            trajectory,
            Hooks::default(),
        )
        .unwrap()
    })
}

/// A point 0.25 m before the flange, where the tip of a long needle may be.
fn tip(state: &PlantState) -> Vector3<f64> {
    (state.world_from_flange * Point3::new(0.0, 0.06, 0.25)).coords
}

fn tip_differences([a, b]: &[Recording; 2]) -> Vec<f64> {
    a.state
        .iter()
        .zip(&b.state)
        .map(|(a, b)| (tip(a) - tip(b)).norm())
        .collect()
}

/// 0.07 um is seen at up to 1.5 rad/s and 4 rad/s^2. The engines' integrators agree to second
/// order in the step; 0.1 ms steps give a tenth of it.
const PEAK_TIP_M: f64 = 0.2e-6;

/// 3e-16 m is seen: both rest where the torque is exactly gravity's.
const SETTLED_TIP_M: f64 = 1e-12;

/// Explicit Coriolis forces in the feed-forward against implicit ones in the engines: 0.9 um seen.
const TRACKING_M: f64 = 2e-6;

#[test]
fn engines_agree_on_a_motion_through_free_space() {
    let cell = crate::common::ur3(Vec::new());
    let start = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);
    let end = Joints::new(1.4, -1.0, 0.9, -2.0, -0.4, 1.3);
    let trajectory = JointTrajectory::starting_at(start)
        .then_straight_to(Phase::Transfer, end, &limits(1.5, 4.0, 40.0))
        .then_hold(Phase::Hold, 0.8);
    let recordings = both(&cell, &trajectory);
    let differences = tip_differences(&recordings);
    let peak = differences.iter().copied().fold(0.0, f64::max);
    let settled = differences[differences.len() - 1];
    println!("tip difference: peak {peak:e} m, settled {settled:e} m");
    assert!(peak < PEAK_TIP_M, "{peak:e}");
    assert!(settled < SETTLED_TIP_M, "{settled:e}");
    for recording in &recordings {
        let tracking = recording
            .state
            .iter()
            .zip(&recording.reference)
            .map(|(state, reference)| {
                let flange = cell.robot.world_from_flange(&reference.position);
                (tip(state)
                    - tip(&PlantState {
                        world_from_flange: flange,
                        ..*state
                    }))
                .norm()
            })
            .fold(0.0, f64::max);
        println!(
            "{}: tip leaves the trajectory by {tracking:e} m",
            recording.engine.name
        );
        assert!(
            tracking < TRACKING_M,
            "{}: {tracking:e}",
            recording.engine.name
        );
        assert_eq!(recording.saturated_steps, 0);
        assert!(recording.state.iter().all(|state| state.contact.count == 0));
    }
}

/// 3e-15 rad is seen: rounding.
const STANDING_RAD: f64 = 1e-11;

/// Gravity's torque changes with the standing error itself, by its gradient over the position gain: 1 %.
const FIRST_ORDER: f64 = 0.015;

/// `kp (q_r - q) + g'(q_r) = g(q)`: to first order `q - q_r = (g' - g) / g * torque of gravity / kp`.
#[test]
fn an_arm_under_another_gravity_than_its_controllers_stands_off_by_the_balance_of_torques() {
    let posture = Joints::new(0.2, -1.1, 0.9, -1.2, -1.4, 0.3);
    let trajectory = JointTrajectory::starting_at(posture).then_hold(Phase::Hold, 2.0);
    let mut harness = harness::harness();
    for (world_m_s2, believed_m_s2) in [
        (9.80665, 9.82),
        (9.80665, 9.5),
        (1.62, 9.80665),
        (1.62, 1.62),
    ] {
        let mut cell = crate::common::ur3(Vec::new());
        cell.gravity_m_s2 = Vector3::new(0.0, 0.0, -world_m_s2);
        let mut servo = servo(&cell);
        servo.dynamics = cell.dynamics_under(&Vector3::new(0.0, 0.0, -believed_m_s2));
        let kp = Joints::from(servo.gains.kp_nm_per_rad);
        let real = cell.dynamics();
        let held = servo.dynamics.gravity_torque(&posture);
        let mut expected = posture;
        for _ in 0..20 {
            expected = posture + (held - real.gravity_torque(&expected)).component_div(&kp);
        }
        let share = (believed_m_s2 - world_m_s2) / world_m_s2;
        let first_order = (real.gravity_torque(&posture) * share).component_div(&kp);
        let off = expected - posture;
        assert!((off - first_order).amax() <= FIRST_ORDER * off.amax());
        let mut rapier = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default()).unwrap();
        let mut mujoco =
            MujocoPlant::new(&mut harness, &cell, TIMESTEP_S, &MujocoSettings::default()).unwrap();
        let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
        for plant in plants {
            let name = plant.identity().name;
            let actuation = Actuation::default();
            let hooks = Hooks::default();
            let recording = simulate(plant, &servo, &actuation, &trajectory, hooks).unwrap();
            let rested = recording.state.last().unwrap().position;
            let apart_rad = (rested - expected).amax();
            let off_rad = off.amax();
            println!("{name}: {world_m_s2} {believed_m_s2}: off {off_rad:e}, apart {apart_rad:e}");
            assert!(apart_rad < STANDING_RAD, "{name}: {apart_rad:e}");
        }
    }
}

/// Posture from which the guide is pushed against the wall.
const BEFORE_WALL: Joints = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);

/// A small slab that faces the guide's exit, `gap_m` before it, tilted.
fn wall(free: &Cell, gap_m: f64) -> CollisionBody {
    let facing = free.world_from_guide_exit(&BEFORE_WALL) * Pose::translation(0.0, 0.0, gap_m);
    let tilted = facing * Pose::rotation(Vector3::new(0.3, 0.0, 0.0));
    CollisionBody {
        name: "wall".into(),
        kind: BodyKind::Table,
        frame: Frame::World,
        solids: vec![Solid {
            name: "wall".into(),
            shape: Shape::Cuboid {
                half_extents_m: Vector3::new(0.03, 0.03, 0.01),
            },
            parent_from_shape: tilted * Pose::translation(0.0, 0.0, 0.01),
        }],
    }
}

/// Tuned contacts of both engines settle below 2 um under 145 N.
const PENETRATION_M: f64 = 5e-6;

/// 2e-4 is seen: one engine lets the other's contact point sink 1 um deeper.
const FORCE_RATIO: f64 = 1e-3;

/// 5e-3 N of 177 N is seen.
const CONTACT_FORCE_N: f64 = 1e-2;

/// 1.8 um is seen at the needle's tip; engine defaults are 0.5 to 0.8 mm apart.
const CONTACT_TIP_M: f64 = 5e-6;

#[test]
fn engines_agree_on_a_guide_pressed_against_a_wall() {
    let free = crate::common::ur3(Vec::new());
    let cell = crate::common::ur3(vec![wall(&free, 0.004)]);
    let forward = free.world_from_guide_exit(&BEFORE_WALL).rotation * Vector3::z() * 0.008;
    let step = free.robot.world_from_base_link.rotation.inverse() * forward;
    let towards = free
        .robot
        .chain
        .jacobian(&BEFORE_WALL)
        .try_inverse()
        .unwrap()
        * Vector6::new(step.x, step.y, step.z, 0.0, 0.0, 0.0);
    let trajectory = JointTrajectory::starting_at(BEFORE_WALL)
        .then_straight_to(
            Phase::Approach,
            BEFORE_WALL + towards,
            &limits(0.05, 1.0, 50.0),
        )
        .then_hold(Phase::Hold, 0.5);
    let recordings = both(&cell, &trajectory);

    let wall = &cell.bodies[cell.bodies.len() - 1].solids[0];
    let into_wall = wall.parent_from_shape * Vector3::z();
    let index = |name| {
        cell.bodies
            .iter()
            .position(|body| body.name == name)
            .unwrap()
    };
    let touching = [index("guide_tube"), index("wall")].map(|i| u32::try_from(i).unwrap());
    let contacts = recordings.each_ref().map(|recording| {
        assert_eq!(
            recording.state[0].contact.count, 0,
            "{}",
            recording.engine.name
        );
        let contact = recording.state[recording.steps()].contact;
        println!("{}: {contact:?}", recording.engine.name);
        assert_eq!(
            contact.pair,
            Some((touching[0], touching[1])),
            "{}",
            recording.engine.name
        );
        assert!(contact.count > 0 && contact.deepest_penetration_m < PENETRATION_M);
        let missing = contact_force_n(&cell, recording) - into_wall * -contact.normal_force_n;
        assert!(
            missing.norm() < CONTACT_FORCE_N,
            "{}: {missing}",
            recording.engine.name
        );
        contact
    });
    let ratio = contacts[0].normal_force_n / contacts[1].normal_force_n;
    assert!(
        (ratio - 1.0).abs() < FORCE_RATIO,
        "forces differ by a factor of {ratio}"
    );
    let differences = tip_differences(&recordings);
    let settled = differences[differences.len() - 1];
    println!("settled tip difference {settled:e} m");
    assert!(settled < CONTACT_TIP_M, "{settled:e}");
}

/// Force that the surroundings exert on the arm at rest, from the torque that holds it, in world.
fn contact_force_n(cell: &Cell, recording: &Recording) -> Vector3<f64> {
    let steps = recording.steps();
    let q = recording.state[steps].position;
    let borne = cell.dynamics().gravity_torque(&q) - recording.torque_nm[steps - 1];
    let wrench = cell
        .robot
        .chain
        .jacobian(&q)
        .transpose()
        .try_inverse()
        .unwrap()
        * borne;
    cell.robot.world_from_base_link.rotation * wrench.fixed_rows::<3>(0).into_owned()
}

/// Shapes of all kinds, in both engines, at the same place: first contact within one step.
#[test]
fn engines_see_every_shape_at_the_same_place() {
    let free = crate::common::ur3(Vec::new());
    let exit = free.world_from_guide_exit(&BEFORE_WALL);
    let corner = |i: u32| {
        let sign = |bit: u32| if i & bit == 0 { -0.02 } else { 0.02 };
        Point3::new(sign(1), sign(2), sign(4))
    };
    let box_hull = needlebench_geometry::ConvexMesh(needlebench_geometry::TriangleMesh {
        vertices_m: (0..8).map(corner).collect(),
        triangles: Vec::new(),
    });
    let shapes = [
        Shape::Sphere { radius_m: 0.02 },
        Shape::Cylinder {
            radius_m: 0.03,
            half_length_m: 0.02,
        },
        Shape::Capsule {
            radius_m: 0.01,
            half_length_m: 0.01,
        },
        Shape::Cuboid {
            half_extents_m: Vector3::repeat(0.02),
        },
        Shape::Convex(std::sync::Arc::new(box_hull)),
    ];
    let mut harness = harness::harness();
    for shape in shapes {
        // All shapes reach 20 mm along their z.
        for (gap_m, touches) in [(1e-5, false), (-1e-5, true)] {
            let body = CollisionBody {
                name: "obstacle".into(),
                kind: BodyKind::Phantom,
                frame: Frame::World,
                solids: vec![Solid {
                    name: "obstacle".into(),
                    shape: shape.clone(),
                    parent_from_shape: exit * Pose::translation(0.0, 0.0, 0.02 + gap_m),
                }],
            };
            let cell = crate::common::ur3(vec![body]);
            let mut rapier =
                RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default()).unwrap();
            let mut mujoco =
                MujocoPlant::new(&mut harness, &cell, TIMESTEP_S, &MujocoSettings::default())
                    .unwrap();
            let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
            for plant in plants {
                let contact = plant.reset(&BEFORE_WALL).unwrap().contact;
                let name = plant.identity().name;
                assert_eq!(contact.count > 0, touches, "{name}: {shape:?} at {gap_m}");
                if touches {
                    let error = (contact.deepest_penetration_m - 1e-5).abs();
                    assert!(error < 1e-6, "{name}: {shape:?} penetrates {contact:?}");
                }
            }
        }
    }
}
