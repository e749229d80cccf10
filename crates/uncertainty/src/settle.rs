//! Where an imperfect arm comes to rest.

use needlebench_engine::{JointFriction, Servo};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{Dynamics, JOINT_COUNT, JOINT_LABELS, Joints};

use crate::Truth;

/// Fixed-point steps: the change of the gravity torque with the sag contracts by 1e-3 a step.
const ITERATIONS: usize = 4;

/// Step in which the bristles of the friction follow the reference, s.
const BRISTLE_STEP_S: f64 = 1e-3;

/// Ways over which bristles bend, that a joint has to go on after turning back until nothing is left of that: the
/// rest is `exp(-10)`.
const FORGOTTEN_WAYS: f64 = 10.0;

/// Nats by which a bend has decayed before what is left of it is below the last bit of a double.
const UNFELT_NATS: f64 = 40.0;

/// Share of the way over which bristles bend that is one step: steps of one direction are taken together up to that.
const FINE: f64 = 1.0 / 16.0;

/// Friction that joints keep when they have come to rest at the end of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct RestingFriction {
    /// Torque that the bent bristles hold at the end of the motion, believed friction, N m.
    held_nm: Joints,
    /// Compensation that the controller took away when the reference stopped, N m.
    compensated_nm: Joints,
    /// Of joints that turn back, or begin, so shortly before the end that their bristles still know it: how they came
    /// there.
    late: [Option<LateTurn>; JOINT_COUNT],
}

/// The last part of a joint's way, from where its bristles are bent in one direction, or from rest.
#[derive(Debug, Clone, PartialEq)]
struct LateTurn {
    /// The direction in which they are bent before; 0 at rest.
    before: f64,
    steps: Vec<LateStep>,
}

/// A step of a joint's reference.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LateStep {
    way_rad: f64,
    /// Torque at which the bristles slip, N m.
    slip_nm: f64,
    /// What the controller adds, N m.
    compensated_nm: f64,
}

/// Friction at the end of a motion.
///
/// The bristles are those of [`JointFriction`]. Where a joint goes on in one direction until their bend is complete,
/// they are driven by the reference's speed: the servo's error is constant then. A joint that turns back shortly before
/// is followed with its servo, step by step.
pub fn resting_friction(friction: &JointFriction, trajectory: &JointTrajectory) -> RestingFriction {
    let mut bristles = Joints::zeros();
    let mut compensated_nm = Joints::zeros();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "durations are seconds"
    )]
    let steps = (trajectory.duration_s() / BRISTLE_STEP_S).ceil() as usize;
    for speed in felt_velocities(friction, trajectory, steps) {
        for i in 0..JOINT_COUNT {
            let v = speed[i];
            if JointFriction::direction(v) == 0.0 {
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
    let mut positions = Positions {
        trajectory,
        steps,
        backwards: Vec::new(),
    };
    RestingFriction {
        held_nm: bristles.component_mul(&friction.bristle_stiffness_nm_per_rad),
        compensated_nm,
        late: std::array::from_fn(|joint| LateTurn::of(friction, &mut positions, joint)),
    }
}

/// Velocities of the steps that the bristles still feel at the end of the motion: what they held before has decayed by
/// [`UNFELT_NATS`] in every joint.
fn felt_velocities(
    friction: &JointFriction,
    trajectory: &JointTrajectory,
    steps: usize,
) -> impl Iterator<Item = Joints> {
    // A step of `v` leaves `1 / (1 + v dt k / F(v))` of a bend.
    let most_nm = friction.stiction_nm.sup(&friction.coulomb_nm);
    let mut left_nats = [UNFELT_NATS; JOINT_COUNT];
    let mut backwards = Vec::new();
    for k in (0..=steps).rev() {
        let speed = trajectory.sample(k as f64 * BRISTLE_STEP_S).velocity;
        backwards.push(speed);
        for (i, left) in left_nats.iter_mut().enumerate() {
            if JointFriction::direction(speed[i]) != 0.0 {
                let stiffness = friction.bristle_stiffness_nm_per_rad[i];
                let bends = BRISTLE_STEP_S * stiffness * speed[i].abs() / most_nm[i];
                *left -= libm::log1p(bends);
            }
        }
        if left_nats.iter().all(|&left| left <= 0.0) {
            break;
        }
    }
    backwards.into_iter().rev()
}

/// Positions of the reference step by step, sampled from the end as far as they are asked for.
struct Positions<'t> {
    trajectory: &'t JointTrajectory,
    steps: usize,
    backwards: Vec<Joints>,
}

impl Positions<'_> {
    fn at(&mut self, k: usize, joint: usize) -> f64 {
        while self.backwards.len() <= self.steps - k {
            let k = self.steps - self.backwards.len();
            let time_s = (k as f64 * BRISTLE_STEP_S).min(self.trajectory.duration_s());
            self.backwards.push(self.trajectory.sample(time_s).position);
        }
        self.backwards[self.steps - k][joint]
    }
}

impl LateTurn {
    /// The last part of a joint's way, if it did not go on in one direction until its bristles' bend was complete.
    fn of(friction: &JointFriction, positions: &mut Positions<'_>, joint: usize) -> Option<Self> {
        let Positions {
            trajectory, steps, ..
        } = *positions;
        let stiffness = friction.bristle_stiffness_nm_per_rad[joint];
        let bend_rad = friction.stiction_nm[joint] / stiffness;
        if !(bend_rad > 0.0 && bend_rad.is_finite()) {
            return None;
        }
        let mut position = |k: usize| positions.at(k, joint);
        // Backwards to where it had gone on in one direction for long enough.
        let enough_rad = FORGOTTEN_WAYS * bend_rad;
        let (mut from, mut after, mut gone_rad) = (steps, position(steps), 0.0_f64);
        let mut turns = 0;
        while from > 0 {
            let before = position(from - 1);
            let speed = (after - before) / BRISTLE_STEP_S;
            let way_rad = (after - before) * JointFriction::direction(speed).abs();
            if way_rad != 0.0 && way_rad.signum() != gone_rad.signum() && gone_rad != 0.0 {
                turns += 1;
                gone_rad = 0.0;
            }
            gone_rad += way_rad;
            from -= 1;
            after = before;
            if gone_rad.abs() >= enough_rad {
                break;
            }
        }
        if gone_rad == 0.0 || (turns == 0 && gone_rad.abs() >= enough_rad) {
            return None;
        }
        let before = if gone_rad.abs() >= enough_rad {
            gone_rad.signum()
        } else {
            0.0
        };
        let mut all: Vec<LateStep> = Vec::new();
        let mut sign = f64::NAN;
        for k in from..steps {
            // The controller asks for the sign of the reference's speed, however slow.
            let middle_s = (k as f64 + 0.5) * BRISTLE_STEP_S;
            let middle = trajectory.sample(middle_s.min(trajectory.duration_s()));
            let speed = middle.velocity[joint];
            let slip_nm = friction.stribeck_nm(joint, speed);
            let now = JointFriction::direction(speed);
            let step = LateStep {
                way_rad: position(k + 1) - position(k),
                slip_nm,
                compensated_nm: friction.compensation * slip_nm * now,
            };
            match all.last_mut() {
                Some(last) if now == sign && last.way_rad.abs() < FINE * bend_rad => {
                    last.way_rad += step.way_rad;
                    last.slip_nm = step.slip_nm;
                    last.compensated_nm = step.compensated_nm;
                }
                _ => all.push(step),
            }
            sign = now;
        }
        Some(Self { before, steps: all })
    }

    /// Error of the joint at rest, rad: reference minus position, with a servo of `kp`, bristles of `stiffness`, and
    /// friction that is `factor` of what the controller assumes.
    ///
    /// Slow: at every step the servo, the controller's compensation and the bristles are in balance,
    /// `kp x + c = h`, while the bristles follow the joint, `dh/dq = stiffness (1 - h sign(dq) / F)`. Viscous
    /// friction, and what the joint's inertia would make of a step in the compensation, are left out.
    fn error_rad(&self, kp: f64, stiffness: f64, factor: f64) -> f64 {
        let Some(first) = self.steps.first() else {
            return 0.0;
        };
        let mut held_nm = self.before * first.slip_nm;
        let mut error_rad = match self.before {
            0.0 => 0.0,
            _ => (factor * held_nm - first.compensated_nm) / kp,
        };
        // At the end the controller takes its compensation away.
        let slip_nm = self.steps.last().map_or(0.0, |last| last.slip_nm);
        let end = LateStep {
            way_rad: 0.0,
            slip_nm,
            compensated_nm: 0.0,
        };
        for step in self.steps.iter().chain([&end]) {
            let free_rad = error_rad + step.way_rad;
            let wanted_nm = kp * free_rad + step.compensated_nm;
            let (moved_rad, bent_nm) =
                balance(held_nm, step.slip_nm, stiffness, factor, kp, wanted_nm);
            held_nm = bent_nm;
            error_rad = free_rad - moved_rad;
        }
        error_rad
    }
}

/// How far a joint moves until `factor h + kp q` is `wanted_nm`, and what its bristles hold then: they begin with
/// `held_nm` and slip at `slip_nm`.
fn balance(
    held_nm: f64,
    slip_nm: f64,
    stiffness: f64,
    factor: f64,
    kp: f64,
    wanted_nm: f64,
) -> (f64, f64) {
    /// Newton steps on a concave, increasing function from 0: quadratic from the first.
    const STEPS: usize = 8;
    let held_nm = held_nm.clamp(-slip_nm, slip_nm);
    let missing_nm = wanted_nm - factor * held_nm;
    // In the direction in which it moves.
    let sign = 1.0_f64.copysign(missing_nm);
    let (missing_nm, room_nm) = (missing_nm.abs(), slip_nm - sign * held_nm);
    let mut way = 0.0;
    for _ in 0..STEPS {
        let left = libm::exp(-way * stiffness / slip_nm);
        let torque = factor * room_nm * (1.0 - left) + kp * way - missing_nm;
        way -= torque / (factor * room_nm * left * stiffness / slip_nm + kp);
    }
    let left = libm::exp(-way * stiffness / slip_nm);
    (sign * way, sign * (slip_nm - room_nm * left))
}

/// Error of the joints at rest by friction, rad: reference minus position.
///
/// `kp`: position gains, N m/rad; `factor`: from the friction that the controller assumes to the true one.
pub(crate) fn friction_error(
    kp: &Joints,
    friction: &JointFriction,
    factor: &Joints,
    resting: &RestingFriction,
) -> Joints {
    let held_nm = resting.held_nm.component_mul(factor);
    let compensated_nm = &resting.compensated_nm;
    Joints::from_fn(|i, _| {
        let stiffness = friction.bristle_stiffness_nm_per_rad[i];
        if let Some(late) = &resting.late[i] {
            return late.error_rad(kp[i], stiffness, factor[i]);
        }
        let moving = (held_nm[i] - compensated_nm[i]) / kp[i];
        moving + spring_back_rad(held_nm[i], compensated_nm[i], kp[i], stiffness)
    })
}

/// How far a joint springs back, in the direction against its motion, when compensation is taken
/// away from bent bristles.
///
/// As the joint springs back the bristles follow `dz/dx = 1 + z / z_ss`, so after a way `d` they hold
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
    #[error("the drive of {joint} must hold {torque_nm:.2} N m, its limit is {limit_nm:.2} N m")]
    Overloaded {
        /// Label of the joint.
        joint: &'static str,
        /// Torque that is needed, N m.
        torque_nm: f64,
        /// Torque that it gives, N m.
        limit_nm: f64,
    },
    /// A servo without position gain holds no place.
    #[error("the position gain of {joint} is 0: the joint is not held")]
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
        error_of_friction = friction_error(&kp, model, &model.true_over_nominal, resting);
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
