//! What lies between the servo and the links of a real arm: commands, encoders, gears, friction.
//!
//! One implementation serves every plant, so that all engines get the same torques for the same
//! state. A joint is a motor and a link with a massless torsion spring between them (harmonic
//! drive); the rotor's inertia is the plant's armature and moves with the link. That holds below
//! the resonance of rotor and spring, which is above 20 Hz for every joint of a UR3.
//!
//! With the motor's torque `tau_m`, the friction `F` at the motor and the torque `tau` that reaches
//! the link:
//!
//! ```text
//! tau     = tau_m - F
//! theta   = q + twist(tau)                   motor angle, by the gear's stiffness, which grows with torque
//! reading = round(theta + offset) + noise    encoder at the motor
//! tau_m   = clamp(tau_ff + kp (q_r - reading) + kd (qd_r - qd))
//! ```
//!
//! `theta` and `tau` are solved for together, so that no step of delay lies in the spring. The servo's
//! speed `qd` is taken as measured exactly.

use std::collections::VecDeque;

use needlebench_cell::GearTwist;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints};
use needlebench_numerics::random::NormalPairs;

use crate::{EngineError, Reference, Servo};

/// Rounding of `t / period` that still counts as a whole number of periods.
const PERIOD_SLACK: f64 = 1e-9;

/// Imperfections of the drives. The default is none: ideal torques and measurements.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Actuation {
    /// Set-points that arrive at a fixed rate; continuous ones if none.
    pub commands: Option<CommandTiming>,
    /// Encoders; exact ones if none.
    pub encoder: Option<Encoder>,
    /// How each joint's gear twists; rigid ones by default.
    pub gears: GearTwist,
    /// Friction of the joints; none if none.
    pub friction: Option<JointFriction>,
    /// Torques that the drives can give, N m, where they are less than the servo assumes.
    pub drive_limit_nm: Option<Joints>,
    /// Delay from measurement to torque, s; whole steps are used, the next higher number.
    pub torque_delay_s: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Set-points at a fixed rate, joined by straight lines in joint space.
///
/// The servo follows the line between the last two set-points that have arrived, so it is a
/// period, and the delay, behind the trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandTiming {
    /// Time between two set-points, s.
    pub period_s: f64,
    /// Age of a set-point when it arrives, s.
    pub delay_s: f64,
}

/// Encoders of the motors.
///
/// Rounding is an error of its own, independent of the angle (Widrow, IRE Trans. Circuit Theory
/// 3(4), 1956): uniform within half a reading, new in every step while the joint's reference moves,
/// and a given one while it holds. A joint passes many readings in a step, so that the real error is
/// as good as that; and engines whose states differ by less than rounding get the same torques
/// instead of ones that differ by the gain times a whole reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Encoder {
    /// Angle between two readings, rad; 0 for none.
    pub resolution_rad: Joints,
    /// Standard deviation of a reading, rad, independent from step to step.
    pub noise_rad: Joints,
    /// Error of the zero, rad: reading minus angle.
    pub offset_rad: Joints,
    /// Rounding while the reference holds, rad: reading minus angle.
    pub resting_rounding_rad: Joints,
}

/// Friction of joints by the LuGre model (Canudas de Wit et al., IEEE Trans. Automatic Control
/// 40(3), 1995): bristles that bend, and slip beyond the Stribeck curve.
///
/// `dz/dt = v - sigma_0 |v| / g(v) z`, `F = sigma_0 z + sigma_1 dz/dt + sigma_2 v`,
/// `g(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2)`. The bristles are advanced by backward Euler,
/// which is stable for every step and speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFriction {
    /// Sliding friction `F_c`, N m.
    pub coulomb_nm: Joints,
    /// Break-away torque `F_s`, N m; at least the sliding friction.
    pub stiction_nm: Joints,
    /// Speed `v_s` at which the break-away torque has fallen off to 1/e, rad/s.
    pub stribeck_rad_s: Joints,
    /// Viscous friction `sigma_2`, N m s/rad.
    pub viscous_nms_per_rad: Joints,
    /// Stiffness of the bristles `sigma_0`, N m/rad.
    pub bristle_stiffness_nm_per_rad: Joints,
    /// Damping of the bristles `sigma_1`, N m s/rad.
    pub bristle_damping_nms_per_rad: Joints,
    /// Share of the *nominal* friction that the controller adds to its torque, by the sign of the
    /// reference's speed.
    pub compensation: f64,
    /// Factor from the friction that the controller assumes to the true one, per joint.
    pub true_over_nominal: Joints,
}

impl JointFriction {
    /// Stribeck curve of the nominal friction at one joint, N m.
    pub fn stribeck_nm(&self, joint: usize, speed_rad_s: f64) -> f64 {
        let (coulomb, stiction) = (self.coulomb_nm[joint], self.stiction_nm[joint]);
        let ratio = speed_rad_s / self.stribeck_rad_s[joint];
        coulomb + (stiction - coulomb) * libm::exp(-ratio * ratio)
    }

    /// What the controller adds for a reference of this speed, N m.
    fn compensation_nm(&self, velocity_rad_s: &Joints) -> Joints {
        Joints::from_fn(|i, _| {
            let v = velocity_rad_s[i];
            let sliding = self.stribeck_nm(i, v) * Self::direction(v);
            self.compensation * (sliding + self.viscous_nms_per_rad[i] * v)
        })
    }

    /// The direction in which a controller compensates friction for a reference of this speed, rad/s: 1, -1, or 0 at
    /// rest.
    ///
    /// A joint that a straight line leaves where it is has a reference that trembles by rounding: 1e-13 rad/s, at which
    /// the whole friction would change its sign at every step.
    pub fn direction(speed_rad_s: f64) -> f64 {
        const REST_RAD_S: f64 = 1e-10;
        if speed_rad_s.abs() < REST_RAD_S {
            0.0
        } else {
            speed_rad_s.signum()
        }
    }
}

impl Actuation {
    /// Whether nothing is imperfect.
    pub(crate) fn is_ideal(&self) -> bool {
        *self
            == Self {
                seed: self.seed,
                ..Self::default()
            }
    }

    /// Steps of delay for a step length.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked: not negative, and far below 2^52 steps"
    )]
    pub(crate) fn delay_steps(&self, timestep_s: f64) -> usize {
        (self.torque_delay_s / timestep_s - PERIOD_SLACK)
            .ceil()
            .max(0.0) as usize
    }

    /// Refuses numbers that are negative or not finite.
    pub(crate) fn check(&self) -> Result<(), EngineError> {
        let not_negative = |key, value: f64| {
            if value >= 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(EngineError::BadSetting {
                    key,
                    value,
                    expected: "finite and not negative",
                })
            }
        };
        let positive = |key, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(EngineError::BadSetting {
                    key,
                    value,
                    expected: "finite and positive",
                })
            }
        };
        not_negative("torque_delay_s", self.torque_delay_s)?;
        for value in self.gears.compliance_rad_per_nm.iter().flatten() {
            not_negative("compliance_rad_per_nm", *value)?;
        }
        if let Some(commands) = &self.commands {
            positive("command period_s", commands.period_s)?;
            not_negative("command delay_s", commands.delay_s)?;
        }
        if let Some(encoder) = &self.encoder {
            for value in encoder.resolution_rad.iter().chain(&encoder.noise_rad) {
                not_negative("encoder resolution or noise", *value)?;
            }
        }
        if let Some(limit) = &self.drive_limit_nm {
            for value in limit {
                positive("drive_limit_nm", *value)?;
            }
        }
        if let Some(friction) = &self.friction {
            not_negative("friction compensation", friction.compensation)?;
            for joint in 0..JOINT_COUNT {
                not_negative("friction coulomb_nm", friction.coulomb_nm[joint])?;
                if friction.stiction_nm[joint].is_nan()
                    || friction.stiction_nm[joint] < friction.coulomb_nm[joint]
                {
                    return Err(EngineError::BadSetting {
                        key: "friction stiction_nm",
                        value: friction.stiction_nm[joint],
                        expected: "at least the Coulomb friction",
                    });
                }
                positive("friction stribeck_rad_s", friction.stribeck_rad_s[joint])?;
                not_negative("viscous friction", friction.viscous_nms_per_rad[joint])?;
                positive(
                    "bristle stiffness",
                    friction.bristle_stiffness_nm_per_rad[joint],
                )?;
                not_negative(
                    "bristle damping",
                    friction.bristle_damping_nms_per_rad[joint],
                )?;
                not_negative(
                    "friction true_over_nominal",
                    friction.true_over_nominal[joint],
                )?;
            }
        }
        Ok(())
    }
}

/// Torques of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatedTorque {
    /// Torque that reaches the links, N m: what the plant gets.
    pub link_nm: Joints,
    /// Torque of the motors, N m, within their limits.
    pub drive_nm: Joints,
    /// Whether a limit cut the torque, per joint.
    pub saturated: [bool; JOINT_COUNT],
}

/// What a controller has of one moment of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// What the servo is told to follow.
    pub target: JointState,
    /// Torque that the controller's model of arm and payload needs for it, N m, without friction.
    pub moment_nm: Joints,
    /// Friction that the controller adds to it, N m.
    pub friction_nm: Joints,
    /// Joint positions that the encoders read, rad: at the motors, so with the twist of the gears.
    pub position: Joints,
}

/// The drives of one run: their settings, and what they remember.
#[derive(Debug, Clone)]
pub(crate) struct Drives<'a> {
    servo: &'a Servo,
    actuation: &'a Actuation,
    timestep_s: f64,
    velocity_age_s: f64,
    ideal: bool,
    delay_steps: usize,
    limit_nm: Joints,
    /// Deflection of the bristles, rad.
    bristles_rad: Joints,
    /// Commanded torques that have not yet reached the motors, oldest first.
    on_the_way: VecDeque<Joints>,
    noise: NormalPairs,
    /// The last reference, and the torque that the model says it needs, N m.
    fed_forward: Option<(JointState, Joints)>,
}

impl<'a> Drives<'a> {
    pub(crate) fn new(
        servo: &'a Servo,
        actuation: &'a Actuation,
        timestep_s: f64,
        velocity_age_s: f64,
    ) -> Self {
        Self {
            servo,
            actuation,
            timestep_s,
            velocity_age_s,
            ideal: actuation.is_ideal(),
            delay_steps: actuation.delay_steps(timestep_s),
            limit_nm: actuation
                .drive_limit_nm
                .map_or(servo.effort_limit_nm, |limit| {
                    limit.inf(&servo.effort_limit_nm)
                }),
            bristles_rad: Joints::zeros(),
            on_the_way: VecDeque::new(),
            noise: NormalPairs::new(actuation.seed),
            fed_forward: None,
        }
    }

    /// Torques of the step that starts at `time_s` with the arm at `position`, `velocity`; `planned`
    /// is what is followed at that time.
    pub(crate) fn torque(
        &mut self,
        followed: &dyn Reference,
        time_s: f64,
        planned: &JointState,
        position: &Joints,
        velocity: &Joints,
    ) -> ActuatedTorque {
        let reference = self.reference(followed, time_s, planned);
        let forward_nm = self.forward_nm(&reference);
        let wanted = self
            .servo
            .wanted_nm(forward_nm, &reference, position, velocity);
        if self.ideal {
            let output = self.servo.limited(&wanted);
            return ActuatedTorque {
                link_nm: output.torque_nm,
                drive_nm: output.torque_nm,
                saturated: output.saturated,
            };
        }
        let kp = Joints::from(self.servo.gains.kp_nm_per_rad);
        let friction = self.friction_nm(velocity);
        let mut wanted = wanted;
        if let Some(friction) = &self.actuation.friction {
            wanted += friction.compensation_nm(&reference.velocity);
        }
        wanted -= kp.component_mul(&self.encoder_error(&reference.velocity));
        self.on_the_way.push_back(wanted);
        if self.on_the_way.len() > self.delay_steps + 1 {
            self.on_the_way.pop_front();
        }
        // Until the first one has arrived, the first one holds.
        let wanted = self.on_the_way[0];
        let link_nm = self.actuation.gears.in_series(&kp, &(wanted - friction));
        let unlimited = link_nm + friction;
        // NaN passes the clamp unchanged, so that the run loop sees the divergence.
        let drive_nm =
            unlimited.zip_map(&self.limit_nm, |torque, limit| torque.clamp(-limit, limit));
        ActuatedTorque {
            link_nm: drive_nm - friction,
            drive_nm,
            saturated: std::array::from_fn(|i| {
                drive_nm[i].total_cmp(&unlimited[i]) != std::cmp::Ordering::Equal
            }),
        }
    }

    /// Reference for the torque of the step that starts at `time_s`.
    ///
    /// Semi-implicit Euler is leapfrog in disguise: with the acceleration of the step's start, the
    /// positions follow the trajectory to second order, while the velocities belong half a step
    /// earlier (the plant says how old its velocities are). Taking the velocity there removes a bias of `kd * h / 2 * qdd`, which is 0.3 N m at
    /// 10 rad/s^2 and 1 ms.
    fn reference(&self, followed: &dyn Reference, time_s: f64, planned: &JointState) -> JointState {
        let velocity_s = (time_s - self.velocity_age_s).max(0.0);
        match self.actuation.commands {
            None => JointState {
                velocity: followed.sample(velocity_s).velocity,
                ..*planned
            },
            Some(timing) => JointState {
                velocity: timing.at(followed, velocity_s).velocity,
                ..timing.at(followed, time_s)
            },
        }
    }

    /// What the controller is told, assumes and reads of a state of a recording: states in their order, each once, as
    /// in the run itself.
    pub(crate) fn reading(
        &mut self,
        followed: &dyn Reference,
        time_s: f64,
        planned: &JointState,
        position: &Joints,
        link_nm: &Joints,
    ) -> Reading {
        let target = self
            .actuation
            .commands
            .map_or(*planned, |timing| timing.at(followed, time_s));
        let reference = self.reference(followed, time_s, planned);
        let error = if self.ideal {
            Joints::zeros()
        } else {
            self.encoder_error(&reference.velocity)
        };
        Reading {
            target,
            moment_nm: self.servo.forward_nm(&target),
            friction_nm: self
                .actuation
                .friction
                .map_or_else(Joints::zeros, |friction| {
                    friction.compensation_nm(&target.velocity)
                }),
            position: position + self.actuation.gears.twist_rad(link_nm) + error,
        }
    }

    /// Torque that the model says a reference needs, N m. While the arm holds its place, and between
    /// commands, the reference stays the same.
    fn forward_nm(&mut self, reference: &JointState) -> Joints {
        match &self.fed_forward {
            Some((known, torque_nm)) if known == reference => *torque_nm,
            _ => {
                let torque_nm = self.servo.forward_nm(reference);
                self.fed_forward = Some((*reference, torque_nm));
                torque_nm
            }
        }
    }

    /// Friction of the motors at a speed, N m; advances the bristles by one step.
    fn friction_nm(&mut self, velocity: &Joints) -> Joints {
        let Some(friction) = &self.actuation.friction else {
            return Joints::zeros();
        };
        let h = self.timestep_s;
        Joints::from_fn(|i, _| {
            let v = velocity[i];
            let scale = friction.true_over_nominal[i];
            let slip_nm = scale * friction.stribeck_nm(i, v);
            let stiffness = friction.bristle_stiffness_nm_per_rad[i];
            let before = self.bristles_rad[i];
            let after = if slip_nm > 0.0 {
                (before + h * v) / (1.0 + h * stiffness * v.abs() / slip_nm)
            } else {
                0.0
            };
            self.bristles_rad[i] = after;
            stiffness * after
                + friction.bristle_damping_nms_per_rad[i] * (after - before) / h
                + scale * friction.viscous_nms_per_rad[i] * v
        })
    }

    /// What the encoders read beyond a motor's angle, rad, while the reference has this speed.
    fn encoder_error(&mut self, reference_rad_s: &Joints) -> Joints {
        let Some(encoder) = self.actuation.encoder else {
            return Joints::zeros();
        };
        // Drawn for every joint in every step, so that one does not depend on another's motion.
        Joints::from_fn(|i, _| {
            let passing = 0.5 * encoder.resolution_rad[i] * self.noise.uniform(-1.0, 1.0);
            let rounding = if reference_rad_s[i] == 0.0 {
                encoder.resting_rounding_rad[i]
            } else {
                passing
            };
            encoder.offset_rad[i] + rounding + encoder.noise_rad[i] * self.noise.next_normal()
        })
    }
}

impl CommandTiming {
    /// What the servo follows at a time.
    fn at(&self, followed: &dyn Reference, time_s: f64) -> JointState {
        let arrived_s = time_s - self.delay_s;
        if arrived_s < 0.0 {
            return JointState::at_rest(followed.sample(0.0).position);
        }
        let periods = (arrived_s / self.period_s + PERIOD_SLACK).floor();
        let newest = followed.sample(periods * self.period_s);
        let before = followed.sample((periods - 1.0).max(0.0) * self.period_s);
        let share = (arrived_s / self.period_s - periods).clamp(0.0, 1.0);
        JointState {
            position: before.position.lerp(&newest.position, share),
            velocity: (newest.position - before.position) / self.period_s,
            acceleration: before.acceleration.lerp(&newest.acceleration, share),
        }
    }
}
