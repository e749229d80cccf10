//! What makes the set-points.

use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints};

use crate::arm::ArmData;
use crate::course::NoSolution;
use crate::event::Trip;
use crate::legs::Legs;
use crate::ramp::Ramps;
use crate::request::Origin;
use crate::servo::Servo;
use crate::tool_speed::ToolSpeed;

/// Shares of the limits of speed and acceleration with which the set-point moves to where the arm is.
const SETTLING_SHARE: f64 = 0.2;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Mover {
    Still,
    Legs(Legs),
    Ramp(JointSpeed),
    Tool(ToolSpeed),
    Servo(Servo),
    Settle(Settle),
}

/// Joints change their velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct JointSpeed {
    from: Joints,
    pub ramps: Ramps<JOINT_COUNT>,
    elapsed_s: f64,
    /// A stop of the controller's own, which no limit stops.
    pub is_stop: bool,
}

impl JointSpeed {
    pub fn new(from: &JointState, to: &Joints, pace: (f64, f64)) -> Self {
        Self {
            from: from.position,
            ramps: ramps(from, to, pace),
            elapsed_s: 0.0,
            is_stop: false,
        }
    }

    pub fn is_reached(&self) -> bool {
        self.elapsed_s >= self.ramps.duration_s()
    }

    /// State one period later, and whether the arm stands from then on.
    pub fn advance(&mut self, period_s: f64) -> (JointState, bool) {
        self.elapsed_s += period_s;
        let [way, velocity, acceleration] = self.ramps.sample(self.elapsed_s);
        let state = JointState {
            position: self.from + way,
            velocity,
            acceleration,
        };
        (state, self.is_reached() && velocity.amax() <= 0.0)
    }
}

fn ramps(from: &JointState, to: &Joints, pace: (f64, f64)) -> Ramps<JOINT_COUNT> {
    Ramps::new(&from.velocity, &from.acceleration, to, pace, |change| {
        change.amax()
    })
}

/// A stop from a state on.
pub(crate) fn stop_from(arm: &ArmData, from: &JointState) -> JointSpeed {
    let pace = (arm.stop.deceleration_rad_s2, arm.stop.ramp_s);
    JointSpeed {
        is_stop: true,
        ..JointSpeed::new(from, &Joints::zeros(), pace)
    }
}

/// The set-point moves to where a braked arm is, from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settle {
    from: Joints,
    delta: Joints,
    duration_s: f64,
    elapsed_s: f64,
}

impl Settle {
    /// In a time, or longer where joints would be too fast.
    pub fn new(arm: &ArmData, from: Joints, measured: &Joints, least_s: f64) -> Self {
        let mut duration_s = least_s;
        let mut delta = Joints::zeros();
        for i in 0..JOINT_COUNT {
            if !measured[i].is_finite() {
                continue;
            }
            let limit = &arm.limits.0[i];
            delta[i] = measured[i].clamp(limit.lower_rad, limit.upper_rad) - from[i];
            // Peaks of 10 u^3 - 15 u^4 + 6 u^5.
            let speed = SETTLING_SHARE * limit.velocity_rad_s;
            let acceleration = SETTLING_SHARE * arm.acceleration_rad_s2[i];
            let way = delta[i].abs();
            duration_s = duration_s
                .max(1.875 * way / speed)
                .max((10.0 / 3.0_f64.sqrt() * way / acceleration).sqrt());
        }
        Self {
            from,
            delta,
            duration_s,
            elapsed_s: 0.0,
        }
    }

    fn advance(&mut self, period_s: f64) -> (JointState, bool) {
        self.elapsed_s += period_s;
        if self.elapsed_s >= self.duration_s {
            return (JointState::at_rest(self.from + self.delta), true);
        }
        let u = self.elapsed_s / self.duration_s;
        let way = u.powi(3) * (10.0 + u * (-15.0 + 6.0 * u));
        let speed = 30.0 * u * u * (1.0 + u * (u - 2.0)) / self.duration_s;
        let acceleration = 60.0 * u * (1.0 + u * (2.0 * u - 3.0)) / self.duration_s.powi(2);
        let state = JointState {
            position: self.from + self.delta * way,
            velocity: self.delta * speed,
            acceleration: self.delta * acceleration,
        };
        (state, false)
    }
}

impl Mover {
    /// Goes along the way of a tool.
    pub fn follows_a_tool(&self) -> bool {
        matches!(self, Self::Legs(_) | Self::Tool(_))
    }

    /// State one period later, and whether the arm stands from then on; tells which moves are done.
    pub fn advance(
        &mut self,
        arm: &ArmData,
        from: &JointState,
        done: impl FnMut(Origin),
    ) -> Result<(JointState, bool), Trip> {
        let period_s = arm.period_s;
        let no_solution = |_: NoSolution| Trip::NoSolution;
        let (state, stands) = match self {
            Self::Still => return Ok((*from, true)),
            Self::Settle(settle) => return Ok(settle.advance(period_s)),
            Self::Ramp(ramp) if ramp.is_stop => return Ok(ramp.advance(period_s)),
            Self::Ramp(ramp) => ramp.advance(period_s),
            Self::Legs(legs) => legs
                .advance(&arm.kinematics, period_s, done)
                .map_err(no_solution)?,
            Self::Tool(tool) => {
                let state = tool
                    .advance(&arm.kinematics, from, period_s)
                    .map_err(no_solution)?;
                (state, tool.is_reached() && state.velocity.amax() <= 0.0)
            }
            Self::Servo(servo) => (
                servo.advance(from, period_s, &arm.acceleration_rad_s2),
                false,
            ),
        };
        check(arm, &state)?;
        Ok((state, stands))
    }
}

/// Rounding of positions, of shares of speeds and of accelerations.
const ROUNDING: f64 = 1e-9;

/// Whether a set-point is within the limits, and a stop from there on too.
fn check(arm: &ArmData, state: &JointState) -> Result<(), Trip> {
    let stop = ramps(
        state,
        &Joints::zeros(),
        (arm.stop.deceleration_rad_s2, arm.stop.ramp_s),
    );
    for joint in 0..JOINT_COUNT {
        let limit = &arm.limits.0[joint];
        let (position, acceleration) = (state.position[joint], state.acceleration[joint]);
        let sum = position + state.velocity[joint] + acceleration;
        if !sum.is_finite() {
            return Err(Trip::NotFinite { joint });
        }
        let most = arm.acceleration_rad_s2[joint];
        if acceleration.abs() > most * (1.0 + ROUNDING) {
            return Err(Trip::Acceleration {
                joint,
                value_rad_s2: acceleration.abs(),
                limit_rad_s2: most,
            });
        }
        let fastest = stop.0[joint].fastest();
        if fastest > limit.velocity_rad_s * (1.0 + ROUNDING) {
            return Err(Trip::Speed {
                joint,
                value_rad_s: fastest,
                limit_rad_s: limit.velocity_rad_s,
            });
        }
        let [least, most] = stop.0[joint].ways().map(|way| position + way);
        let beyond = [
            (least, limit.lower_rad, least < limit.lower_rad - ROUNDING),
            (most, limit.upper_rad, most > limit.upper_rad + ROUNDING),
        ];
        for (value_rad, limit_rad, is_beyond) in beyond {
            if is_beyond {
                return Err(Trip::Position {
                    joint,
                    value_rad,
                    limit_rad,
                });
            }
        }
    }
    Ok(())
}
