//! Where an imperfect arm comes to rest.

use needlebench_engine::{JointFriction, Servo};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{Dynamics, JOINT_COUNT, JOINT_LABELS, Joints};

use crate::Truth;

/// Fixed-point steps: the change of the gravity torque with the sag contracts by 1e-3 a step.
const ITERATIONS: usize = 4;

/// Step in which the bristles of the friction follow the reference, s.
const BRISTLE_STEP_S: f64 = 1e-3;

/// Friction that joints keep when they have come to rest at the end of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestingFriction {
    /// Torque that the bent bristles hold at the end of the motion, believed friction, N m.
    pub held_nm: Joints,
    /// Compensation that the controller took away when the reference stopped, N m.
    pub compensated_nm: Joints,
}

/// Friction at the end of a motion whose reference is followed without error.
///
/// The bristles are those of [`JointFriction`], driven by the reference's speed.
pub fn resting_friction(friction: &JointFriction, trajectory: &JointTrajectory) -> RestingFriction {
    let mut bristles = Joints::zeros();
    let mut compensated_nm = Joints::zeros();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "durations are seconds"
    )]
    let steps = (trajectory.duration_s() / BRISTLE_STEP_S).ceil() as usize;
    for k in 0..=steps {
        let speed = trajectory.sample(k as f64 * BRISTLE_STEP_S).velocity;
        for i in 0..JOINT_COUNT {
            let v = speed[i];
            if v == 0.0 {
                continue;
            }
            let slip_nm = friction.stribeck_nm(i, v);
            let stiffness = friction.bristle_stiffness_nm_per_rad[i];
            if slip_nm > 0.0 {
                bristles[i] = (bristles[i] + BRISTLE_STEP_S * v)
                    / (1.0 + BRISTLE_STEP_S * stiffness * v.abs() / slip_nm);
            }
            compensated_nm[i] =
                friction.compensation * (slip_nm.copysign(v) + friction.viscous_nms_per_rad[i] * v);
        }
    }
    RestingFriction {
        held_nm: bristles.component_mul(&friction.bristle_stiffness_nm_per_rad),
        compensated_nm,
    }
}

/// Error of the joints at rest by friction, rad: reference minus position.
///
/// `kp`: position gains, N m/rad; `held_nm`: what the bristles held when the reference stopped,
/// `compensated_nm`: what the controller then took away.
pub(crate) fn friction_error(
    kp: &Joints,
    friction: &JointFriction,
    held_nm: &Joints,
    compensated_nm: &Joints,
) -> Joints {
    Joints::from_fn(|i, _| {
        let stiffness = friction.bristle_stiffness_nm_per_rad[i];
        let moving = (held_nm[i] - compensated_nm[i]) / kp[i];
        moving + spring_back_rad(held_nm[i], compensated_nm[i], kp[i], stiffness)
    })
}

/// How far a joint springs back, in the direction against its motion, when compensation is taken
/// away from bent bristles.
///
/// On the way back the bristles follow `dz/dx = 1 + z / z_ss`, so after a way `d` they hold
/// `F (2 exp(-d / z_ss) - 1)`: the balance is `2 F (1 - exp(-d / z_ss)) + kp d = c`.
fn spring_back_rad(held_nm: f64, compensated_nm: f64, kp: f64, stiffness: f64) -> f64 {
    /// Newton steps on a concave, increasing function from 0: quadratic from the first.
    const STEPS: usize = 8;
    let (held, compensated) = (held_nm.abs(), compensated_nm.abs());
    if held == 0.0 || compensated == 0.0 || held_nm.signum() != compensated_nm.signum() {
        return 0.0;
    }
    let slip_rad = held / stiffness;
    let mut way = 0.0;
    for _ in 0..STEPS {
        let left = libm::exp(-way / slip_rad);
        let torque = 2.0 * held * (1.0 - left) + kp * way - compensated;
        way -= torque / (2.0 * stiffness * left + kp);
    }
    way.copysign(held_nm)
}

/// Posture at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settled {
    /// Joint positions of the links, rad.
    pub position: Joints,
    /// Torque of the motors, N m.
    pub drive_nm: Joints,
}

/// Why an arm does not come to rest where it should.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SettleError {
    /// A drive cannot carry the arm.
    #[error(
        "the drive of {joint} has to hold {torque_nm:.2} N m and gives {limit_nm:.2} N m at most"
    )]
    Overloaded {
        /// Label of the joint.
        joint: &'static str,
        /// Torque that is needed, N m.
        torque_nm: f64,
        /// Torque that it gives, N m.
        limit_nm: f64,
    },
    /// A servo without position gain holds no place.
    #[error("the position gain of {joint} is 0: nothing holds it")]
    NoStiffness {
        /// Label of the joint.
        joint: &'static str,
    },
}

/// Where the arm rests at the end of a motion, with the friction that this leaves.
///
/// # Errors
/// As [`settle`].
pub fn settle_after(
    servo: &Servo,
    real: &Dynamics,
    truth: &Truth,
    motion: &JointTrajectory,
) -> Result<Settled, SettleError> {
    let friction = truth.actuation.friction.as_ref();
    let resting = friction.map(|friction| resting_friction(friction, motion));
    settle(servo, real, truth, resting.as_ref(), &motion.end())
}

/// Where the arm rests when its reference holds `target`.
///
/// The balance of one joint, with the believed gravity torque `g` at the reference, the true one `t` at
/// the posture, and the error `x = q_r - reading` of the encoder:
///
/// ```text
/// moving:   kp x0 + g + c - F = t          F friction, c its compensation
/// at rest:  kp x  + g - F' = t             c gone; the bristles hold F' after springing back
/// q = q_r - x - offset - rounding - twist(t)
/// ```
///
/// Agrees with the engines' settled postures; see `tests/uncertainty/settled.rs` of this crate for how well.
///
/// # Errors
/// [`SettleError`].
pub fn settle(
    servo: &Servo,
    real: &Dynamics,
    truth: &Truth,
    friction: Option<&RestingFriction>,
    target: &Joints,
) -> Result<Settled, SettleError> {
    let kp = Joints::from(servo.gains.kp_nm_per_rad);
    if let Some(i) = (0..JOINT_COUNT).find(|i| kp[*i] <= 0.0) {
        let joint = JOINT_LABELS[i];
        return Err(SettleError::NoStiffness { joint });
    }
    let believed = servo.dynamics.gravity_torque(target);
    let actuation = &truth.actuation;
    let mut error_of_friction = Joints::zeros();
    if let (Some(model), Some(resting)) = (&actuation.friction, friction) {
        let held_nm = resting.held_nm.component_mul(&model.true_over_nominal);
        error_of_friction = friction_error(&kp, model, &held_nm, &resting.compensated_nm);
    }
    let offset = actuation.encoder.map_or_else(Joints::zeros, |encoder| {
        encoder.offset_rad + encoder.resting_rounding_rad
    });
    let mut position = *target;
    let mut load = Joints::zeros();
    for _ in 0..ITERATIONS {
        load = real.gravity_torque(&position);
        let error = (load - believed).component_div(&kp) + error_of_friction;
        position = target - error - offset - actuation.gears.twist_rad(&load);
    }
    let drive_nm = load;
    let limit = actuation
        .drive_limit_nm
        .map_or(servo.effort_limit_nm, |limit| {
            limit.inf(&servo.effort_limit_nm)
        });
    if let Some(i) = (0..JOINT_COUNT).find(|i| drive_nm[*i].abs() > limit[*i]) {
        return Err(SettleError::Overloaded {
            joint: JOINT_LABELS[i],
            torque_nm: drive_nm[i].abs(),
            limit_nm: limit[i],
        });
    }
    Ok(Settled { position, drive_nm })
}
