//! Building and stepping a rapier world.

use needlebench_cell::Cell;
use needlebench_kinematics::{Chain, JOINT_COUNT, Joints, Pose};
use rapier3d_f64::dynamics::{
    FrictionModel, GenericJoint, GenericJointBuilder, IntegrationParameters, JointAxesMask,
    Multibody, MultibodyJointHandle, RigidBodyBuilder, RigidBodyHandle, SpringCoefficients,
};
use rapier3d_f64::geometry::{
    Collider, ColliderBuilder, ColliderHandle, ContactPair, Group, InteractionGroups,
    InteractionTestMode,
};
use rapier3d_f64::math::Vector;
use rapier3d_f64::parry::mass_properties::MassProperties;
use rapier3d_f64::pipeline::{ActiveHooks, PhysicsWorld};

use super::RapierSettings;
use super::hooks::Hooks;
use crate::EngineError;
use crate::broad_phase::{BroadPhase, Part};
use crate::convert::{UNITS_PER_M, mass_properties, pose, pose_m, rotation_from_x, vector};
use crate::error::check_bodies;

/// Index of a revolute joint's angle among a joint's six coordinates.
const ANGLE: usize = 3;

/// Speed at which penetrating bodies are pushed apart at most, m/s.
///
/// Contacts of the cell penetrate by micrometres, which takes millimetres per second. The limit
/// acts only on a posture that starts in deep collision, which would burst apart without it.
const RECOVERY_SPEED_M_S: f64 = 0.1;

/// Everything that a world is built from.
pub(super) struct Blueprint {
    pub chain: Chain,
    world_from_base_link: Pose,
    joints: [GenericJoint; JOINT_COUNT],
    masses: [MassProperties; JOINT_COUNT],
    armature_kgm2: Joints,
    broad_phase: BroadPhase,
    /// Colliders of the parts that may touch.
    colliders: Vec<Collider>,
    gravity: Vector,
    parameters: IntegrationParameters,
}

impl Blueprint {
    pub(super) fn new(
        cell: &Cell,
        timestep_s: f64,
        settings: &RapierSettings,
    ) -> Result<Self, EngineError> {
        check_bodies(cell)?;
        let broad_phase = BroadPhase::new(cell)?;
        let parts = broad_phase.parts().iter();
        let colliders = parts.map(|part| collider(part, settings)).collect();
        let dynamics = cell.dynamics();
        Ok(Self {
            chain: dynamics.chain,
            world_from_base_link: cell.robot.world_from_base_link,
            joints: dynamics.chain.joints.map(|joint| {
                let joint_from_rapier = rotation_from_x(&joint.axis);
                GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
                    .local_frame1(pose(&(joint.parent_from_joint * joint_from_rapier)))
                    .local_frame2(pose(&joint_from_rapier))
                    .build()
            }),
            masses: dynamics.bodies.map(|body| mass_properties(&body)),
            armature_kgm2: dynamics.armature_kgm2,
            broad_phase,
            colliders,
            gravity: vector(&cell.gravity_m_s2),
            parameters: parameters(timestep_s, settings),
        })
    }
}

fn collider(part: &Part, settings: &RapierSettings) -> Collider {
    let groups = InteractionGroups::new(
        Group::from_bits_retain(part.bits.member),
        Group::from_bits_retain(part.bits.mask),
        InteractionTestMode::And,
    );
    ColliderBuilder::new(part.shape.clone())
        .position(pose(&part.parent_from_shape))
        .density(0.0)
        .friction(settings.friction)
        .restitution(0.0)
        .collision_groups(groups)
        .active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS)
        .user_data(part.body as u128)
        .build()
}

fn parameters(timestep_s: f64, settings: &RapierSettings) -> IntegrationParameters {
    let softness = SpringCoefficients::new(
        settings.contact_natural_frequency_hz,
        settings.contact_damping_ratio,
    );
    IntegrationParameters {
        dt: timestep_s,
        length_unit: UNITS_PER_M,
        contact_softness: softness,
        static_contact_softness: softness,
        // Substeps would freeze the torques.
        num_solver_iterations: 1,
        num_internal_pgs_iterations: settings.contact_sweeps,
        max_ccd_substeps: 0,
        normalized_prediction_distance: settings.prediction_distance_m,
        normalized_max_corrective_velocity: RECOVERY_SPEED_M_S,
        // Both would leave `dist` of a contact point stale.
        contact_recycling: false,
        contact_clustering: false,
        friction_model: FrictionModel::Coulomb,
        ..IntegrationParameters::default()
    }
}

/// A rapier world with the arm at some posture.
///
/// A part gets its collider when it first comes near to something that it may touch: most parts
/// never do, and moving the colliders of all of them would take longer than moving the arm.
pub(super) struct World {
    physics: PhysicsWorld,
    broad_phase: BroadPhase,
    /// Colliders of the parts that have not come near yet.
    colliders: Vec<Option<Collider>>,
    links: [RigidBodyHandle; JOINT_COUNT],
    joints: [MultibodyJointHandle; JOINT_COUNT],
    hooks: Hooks,
}

impl World {
    /// The arm at rest at `position`, contacts already detected.
    pub(super) fn new(blueprint: &Blueprint, position: &Joints) -> Self {
        let mut physics = PhysicsWorld {
            gravity: blueprint.gravity,
            integration_parameters: blueprint.parameters,
            ..PhysicsWorld::default()
        };
        let base = physics.insert_body(
            RigidBodyBuilder::fixed()
                .pose(pose(&blueprint.world_from_base_link))
                .can_sleep(false),
        );
        let links = blueprint.masses.map(|mass_properties| {
            physics.insert_body(
                RigidBodyBuilder::dynamic()
                    .additional_mass_properties(mass_properties)
                    .linear_damping(0.0)
                    .angular_damping(0.0)
                    .can_sleep(false),
            )
        });
        let joints = std::array::from_fn(|i| {
            let parent = if i == 0 { base } else { links[i - 1] };
            physics
                .insert_multibody_joint(parent, links[i], blueprint.joints[i])
                .expect("a chain has no loops")
        });
        // Mass properties are lazy: before the first step they would read as zero.
        for link in links {
            physics.bodies[link].recompute_mass_properties_from_colliders(&physics.colliders);
        }
        let hooks = Hooks {
            links,
            axes: blueprint
                .joints
                .map(|joint| joint.local_frame2.rotation * Vector::X),
        };
        let mut world = Self {
            physics,
            broad_phase: blueprint.broad_phase.clone(),
            colliders: blueprint.colliders.iter().cloned().map(Some).collect(),
            links,
            joints,
            hooks,
        };
        let PhysicsWorld {
            bodies,
            multibody_joints,
            ..
        } = &mut world.physics;
        let (arm, _) = multibody_joints
            .get_mut(world.joints[0])
            .expect("inserted above");
        // Ensures that the root is fixed, which sets the number of degrees of freedom.
        arm.forward_kinematics(bodies, true);
        arm.damping_mut().fill(0.0);
        arm.armature_mut()
            .copy_from(&(blueprint.armature_kgm2 * UNITS_PER_M.powi(2)));
        arm.apply_displacements(position.as_slice());
        arm.forward_kinematics(bodies, false);
        arm.update_rigid_bodies(bodies, true);
        world.broad_phase.reset(position);
        world.insert_near_colliders();
        // A step without duration: only user changes and collision detection.
        world.physics.integration_parameters.dt = 0.0;
        world.physics.step_with_events(&world.hooks, &());
        world.physics.integration_parameters.dt = blueprint.parameters.dt;
        world
    }

    /// Advances one step under joint torques, N m.
    pub(super) fn step(&mut self, torque_nm: &Joints) {
        // What turns the child turns the parent back.
        let mut beyond = Vector::ZERO;
        for i in (0..JOINT_COUNT).rev() {
            let link = &mut self.physics.bodies[self.links[i]];
            let torque =
                link.rotation() * self.hooks.axes[i] * (torque_nm[i] * UNITS_PER_M.powi(2));
            link.reset_torques(false);
            link.add_torque(torque - beyond, false);
            beyond = torque;
        }
        let (position, _) = self.joint_state();
        self.broad_phase.move_to(&position);
        if self.broad_phase.has_news() {
            self.insert_near_colliders();
        }
        self.physics.step_with_events(&self.hooks, &());
    }

    fn insert_near_colliders(&mut self) {
        for part in self.broad_phase.near_pairs().flatten() {
            if let Some(collider) = self.colliders[part].take() {
                let link = self.broad_phase.parts()[part].link;
                let body = link.map(|link| self.links[link]);
                self.physics.insert_collider(collider, body);
            }
        }
    }

    /// Whether rapier switched a body off in the last step because its state was not finite.
    pub(super) fn has_non_finite_bodies(&self) -> bool {
        !self.physics.quarantine().bodies().is_empty()
    }

    /// Joint positions (rad) and velocities (rad/s).
    pub(super) fn joint_state(&self) -> (Joints, Joints) {
        let mut position = Joints::zeros();
        let mut velocity = Joints::zeros();
        for i in 0..JOINT_COUNT {
            let (arm, id) = self.arm_link(i);
            let link = arm.link(id).expect("the handle is of this multibody");
            position[i] = link.joint().coords()[ANGLE];
            velocity[i] = arm.joint_velocity(link)[0];
        }
        (position, velocity)
    }

    /// Pose of a moving link in the world.
    pub(super) fn link_pose(&self, link: usize) -> Pose {
        pose_m(self.physics.bodies[self.links[link]].position())
    }

    pub(super) fn contact_pairs(&self) -> impl Iterator<Item = &ContactPair> {
        self.physics.contact_pairs()
    }

    /// Index of a collider's body in `Cell::bodies`.
    pub(super) fn body_index(&self, collider: ColliderHandle) -> u32 {
        let index = self.physics.colliders[collider].user_data;
        u32::try_from(index).expect("set from the index of a body")
    }

    /// Joint-space mass matrix at the present posture, kg m^2.
    pub(super) fn mass_matrix(&mut self) -> nalgebra::Matrix6<f64> {
        let PhysicsWorld {
            bodies,
            multibody_joints,
            ..
        } = &mut self.physics;
        let (arm, _) = multibody_joints
            .get_mut(self.joints[0])
            .expect("inserted by `new`");
        // Assembles and factorizes the matrix as a side effect.
        arm.dof_inverse_inertia(bodies);
        let factors = arm.inv_augmented_mass();
        let mut product = factors.l() * factors.u();
        factors.p().inv_permute_rows(&mut product);
        nalgebra::Matrix6::from_fn(|row, column| product[(row, column)]) / UNITS_PER_M.powi(2)
    }

    fn arm_link(&self, joint: usize) -> (&Multibody, usize) {
        self.physics
            .multibody_joints
            .get(self.joints[joint])
            .expect("inserted by `new`")
    }
}
