//! Steps and sines that an engine's arm is made to follow.

use nalgebra::{Complex, ComplexField as _};
use needlebench_engine::{EngineError, Plant, Servo};
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints};
use serde::Serialize;

use super::linear::{Linear, polar};

/// Amplitude at which the loop is linear, rad: a torque of 1 to 3 N m at the default gains.
pub const SMALL_RAD: f64 = 1e-3;

/// A large step asks for this many times the torque that the joint has.
const BEYOND_LIMIT: f64 = 2.5;

/// Share of the torque beside gravity that a measured sine may ask for, so that no limit acts.
const SPARE_TORQUE_USED: f64 = 0.3;

/// Duration of a step's recording, s.
pub const STEP_S: f64 = 0.6;

/// Time after which a sine is taken to be steady, s: 20 time constants of the default gains.
const SETTLED_S: f64 = 0.8;

/// Least time over which gain and phase are fitted, s.
const FITTED_S: f64 = 0.25;

/// Frequencies that are measured, Hz, before they are rounded to whole steps per period.
const FREQUENCIES_HZ: [f64; 13] = [
    1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 40.0, 64.0, 100.0,
];

/// One recorded course of a joint.
#[derive(Debug, Clone, Serialize)]
pub struct Course {
    /// Set-point about the posture, rad, one per state.
    pub reference_rad: Vec<f64>,
    /// Motion about the posture, rad.
    pub motion_rad: Vec<f64>,
    /// Torque over each step, N m: one fewer.
    pub torque_nm: Vec<f64>,
    /// Steps in which the limit cut this joint's torque.
    pub saturated: Vec<bool>,
}

/// What a step shows.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct StepFigures {
    /// Height, rad.
    pub height_rad: f64,
    /// Time from a tenth to nine tenths of the height, s.
    pub rise_time_s: Option<f64>,
    /// Height beyond the set-point, as a share of the step.
    pub overshoot: f64,
    /// Time after which the joint stays within 2 % of the step, s.
    pub settling_time_s: Option<f64>,
    /// Steps at the torque limit.
    pub saturated_steps: usize,
    /// Largest torque over its limit.
    pub peak_torque_ratio: f64,
}

/// Response to one frequency.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FrequencyPoint {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the motion over that of the set-point.
    pub gain: f64,
    /// Phase of the motion after that of the set-point, rad: negative for a lag.
    pub phase_rad: f64,
    /// The linear closed loop's gain.
    pub linear_gain: f64,
    /// The linear closed loop's phase, rad.
    pub linear_phase_rad: f64,
}

/// Everything that one engine showed of one joint.
#[derive(Debug, Clone, Serialize)]
pub struct JointResponse {
    /// Name of the engine.
    pub engine: &'static str,
    /// What a small step does.
    pub small_step: StepFigures,
    /// What a step does that meets the torque limit.
    pub large_step: StepFigures,
    /// Largest distance of the small step from the linear closed loop, as a share of the step.
    pub step_deviation: f64,
    /// Gain and phase by frequency.
    pub frequencies: Vec<FrequencyPoint>,
    /// Course of the small step.
    #[serde(skip)]
    pub small: Course,
    /// Course of the large step.
    #[serde(skip)]
    pub large: Course,
    /// A sine at the natural frequency, the servo alone.
    #[serde(skip)]
    pub sine: Course,
    /// The same with the reference's inverse dynamics fed forward, as in every run.
    #[serde(skip)]
    pub tracked: Course,
}

/// An arm in an engine at a posture.
pub struct Bench<'a> {
    /// The engine's arm.
    pub plant: &'a mut dyn Plant,
    /// The servo under test.
    pub servo: &'a Servo,
    /// Its linear closed loop.
    pub linear: &'a Linear,
    /// Where the arm stands.
    pub posture: Joints,
    /// Gravity's torque there, N m.
    pub held_nm: Joints,
}

impl Bench<'_> {
    /// Puts one joint through all experiments.
    pub fn joint(&mut self, joint: usize) -> Result<JointResponse, EngineError> {
        let timestep_s = self.plant.timestep_s();
        let steps = whole(STEP_S / timestep_s);
        let limit_nm = self.servo.effort_limit_nm[joint];
        let large_rad = BEYOND_LIMIT * limit_nm / self.servo.gains.kp_nm_per_rad[joint];
        let small = self.step(joint, SMALL_RAD, steps)?;
        let large = self.step(joint, large_rad, steps)?;
        let linear = self.linear.step_response(joint, steps);
        let step_deviation = small.motion_rad.iter().zip(&linear);
        let step_deviation = step_deviation
            .map(|(motion, linear)| (motion / SMALL_RAD - linear).abs())
            .fold(0.0, f64::max);
        let natural_hz = self.linear.joint(joint).natural_frequency_hz;
        let period = whole(1.0 / (natural_hz * timestep_s)).max(4);
        let sine = self.sine(joint, SMALL_RAD, period, 4 * period, false)?;
        let tracked = self.sine(joint, SMALL_RAD, period, 4 * period, true)?;
        let mut frequencies = Vec::new();
        for hz in FREQUENCIES_HZ {
            let period = whole(1.0 / (hz * timestep_s));
            if period >= 4 {
                frequencies.push(self.frequency(joint, period)?);
            }
        }
        Ok(JointResponse {
            engine: self.plant.identity().name,
            small_step: figures(&small, SMALL_RAD, timestep_s, limit_nm),
            large_step: figures(&large, large_rad, timestep_s, limit_nm),
            step_deviation,
            frequencies,
            small,
            large,
            sine,
            tracked,
        })
    }

    fn step(&mut self, joint: usize, height_rad: f64, steps: usize) -> Result<Course, EngineError> {
        let servo = self.servo;
        let mut target = JointState::at_rest(self.posture);
        target.position[joint] += height_rad;
        self.run(
            joint,
            steps,
            |_| height_rad,
            |_, position, velocity| {
                let output = servo.torque(&target, position, velocity);
                (output.torque_nm, output.saturated)
            },
        )
    }

    /// A sine of `period` time steps; `fed` with the reference's inverse dynamics, or with the
    /// posture's gravity alone.
    fn sine(
        &mut self,
        joint: usize,
        amplitude_rad: f64,
        period: usize,
        steps: usize,
        fed: bool,
    ) -> Result<Course, EngineError> {
        let timestep_s = self.plant.timestep_s();
        let omega = std::f64::consts::TAU / (period as f64 * timestep_s);
        let (servo, posture, held_nm) = (self.servo, self.posture, self.held_nm);
        let at = move |step: f64| amplitude_rad * libm::sin(omega * step * timestep_s);
        self.run(
            joint,
            steps,
            |step| at(step as f64),
            move |step, position, velocity| {
                let step = step as f64;
                let mut reference = JointState::at_rest(posture);
                reference.position[joint] += at(step);
                // The velocity that an engine reports belongs half a step earlier.
                let late = omega * (step - 0.5) * timestep_s;
                reference.velocity[joint] = amplitude_rad * omega * libm::cos(late);
                if fed {
                    reference.acceleration[joint] = -omega * omega * at(step);
                    let output = servo.torque(&reference, position, velocity);
                    return (output.torque_nm, output.saturated);
                }
                let kp = Joints::from(servo.gains.kp_nm_per_rad);
                let kd = Joints::from(servo.gains.kd_nms_per_rad);
                let wanted = held_nm
                    + kp.component_mul(&(reference.position - position))
                    + kd.component_mul(&(reference.velocity - velocity));
                let torque = wanted.zip_map(&servo.effort_limit_nm, |torque, limit| {
                    torque.clamp(-limit, limit)
                });
                (torque, std::array::from_fn(|i| torque[i] != wanted[i]))
            },
        )
    }

    fn run(
        &mut self,
        joint: usize,
        steps: usize,
        reference_rad: impl Fn(usize) -> f64,
        torque: impl Fn(usize, &Joints, &Joints) -> (Joints, [bool; JOINT_COUNT]),
    ) -> Result<Course, EngineError> {
        let mut state = self.plant.reset(&self.posture)?;
        let mut course = Course {
            reference_rad: vec![reference_rad(0)],
            motion_rad: vec![0.0],
            torque_nm: Vec::with_capacity(steps),
            saturated: Vec::with_capacity(steps),
        };
        for step in 0..steps {
            let (torque_nm, saturated) = torque(step, &state.position, &state.velocity);
            state = self.plant.step(&torque_nm)?;
            course.reference_rad.push(reference_rad(step + 1));
            course
                .motion_rad
                .push(state.position[joint] - self.posture[joint]);
            course.torque_nm.push(torque_nm[joint]);
            course.saturated.push(saturated[joint]);
        }
        Ok(course)
    }

    fn frequency(&mut self, joint: usize, period: usize) -> Result<FrequencyPoint, EngineError> {
        let timestep_s = self.plant.timestep_s();
        let frequency_hz = 1.0 / (period as f64 * timestep_s);
        let settled = whole(SETTLED_S / timestep_s).div_ceil(period) * period;
        let fitted = whole(FITTED_S / timestep_s).div_ceil(period).max(2) * period;
        let omega = std::f64::consts::TAU * frequency_hz;
        let gains = &self.servo.gains;
        let stiffness = libm::hypot(
            gains.kp_nm_per_rad[joint],
            omega * gains.kd_nms_per_rad[joint],
        );
        let spare_nm = self.servo.effort_limit_nm[joint] - self.held_nm[joint].abs();
        let amplitude_rad = SMALL_RAD.min(SPARE_TORQUE_USED * spare_nm.max(0.0) / stiffness);
        let course = self.sine(joint, amplitude_rad, period, settled + fitted, false)?;
        // Whole periods of whole steps: the sums are the least-squares fit.
        let mut sum = Complex::new(0.0, 0.0);
        for (step, motion) in course
            .motion_rad
            .iter()
            .enumerate()
            .skip(settled)
            .take(fitted)
        {
            let angle = std::f64::consts::TAU * (step % period) as f64 / period as f64;
            sum += polar(*motion, -angle);
        }
        // sin = Im exp: turn by a quarter.
        let found = sum * Complex::i() * (2.0 / (fitted as f64 * amplitude_rad));
        let linear = self.linear.response(joint, frequency_hz);
        Ok(FrequencyPoint {
            frequency_hz,
            gain: found.modulus(),
            phase_rad: found.argument(),
            linear_gain: linear.modulus(),
            linear_phase_rad: linear.argument(),
        })
    }
}

fn figures(course: &Course, height_rad: f64, timestep_s: f64, limit_nm: f64) -> StepFigures {
    let shares: Vec<f64> = course
        .motion_rad
        .iter()
        .map(|motion| motion / height_rad)
        .collect();
    let first = |level: f64| shares.iter().position(|share| *share >= level);
    let outside = shares.iter().rposition(|share| (share - 1.0).abs() > 0.02);
    let settled = outside.map_or(0, |last| last + 1);
    let peak_nm = course
        .torque_nm
        .iter()
        .fold(0.0, |peak: f64, torque| peak.max(torque.abs()));
    StepFigures {
        height_rad,
        rise_time_s: first(0.1)
            .zip(first(0.9))
            .map(|(low, high)| (high - low) as f64 * timestep_s),
        overshoot: shares.iter().copied().fold(0.0, f64::max).max(1.0) - 1.0,
        settling_time_s: (settled < shares.len()).then_some(settled as f64 * timestep_s),
        saturated_steps: course.saturated.iter().filter(|cut| **cut).count(),
        peak_torque_ratio: peak_nm / limit_nm,
    }
}

/// Time steps of a step's recording.
pub fn steps_shown(timestep_s: f64) -> usize {
    whole(STEP_S / timestep_s)
}

/// The nearest whole number of steps.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "positive, and far below 2^52"
)]
pub fn whole(value: f64) -> usize {
    value.round() as usize
}

#[cfg(test)]
mod tests {
    use needlebench_engine::{RapierPlant, RapierSettings, ServoGains};
    use needlebench_scenario::{Overrides, load_scenario};

    use super::*;

    /// Share of the amplitude; the engine's arm is not linear, by 1e-5 of a milliradian's motion.
    const LINEAR_GAIN: f64 = 1e-3;

    #[test]
    fn an_engine_answers_as_the_linear_loop_does() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/table3.toml");
        let scenario = load_scenario(path.as_ref(), &Overrides::default()).unwrap();
        let servo = Servo {
            dynamics: scenario.cell.dynamics(),
            gains: ServoGains::default(),
            effort_limit_nm: scenario.cell.robot.limits.efforts_nm(),
        };
        let timestep_s = 1e-3;
        let posture = scenario.start;
        let linear = Linear::new(&servo, &posture, timestep_s);
        let settings = RapierSettings::default();
        let mut plant = RapierPlant::new(&scenario.cell, timestep_s, &settings).unwrap();
        let mut bench = Bench {
            plant: &mut plant,
            servo: &servo,
            linear: &linear,
            posture,
            held_nm: servo.dynamics.gravity_torque(&posture),
        };
        let response = bench.joint(2).unwrap();
        assert!(
            response.step_deviation < LINEAR_GAIN,
            "{}",
            response.step_deviation
        );
        assert!(response.frequencies.len() > 10);
        for point in &response.frequencies {
            let linear = polar(point.linear_gain, point.linear_phase_rad);
            let error = (polar(point.gain, point.phase_rad) - linear).modulus();
            assert!(error < LINEAR_GAIN, "{point:?}");
        }
        // The small step stays within the torque, the large one is cut.
        assert_eq!(response.small_step.saturated_steps, 0);
        assert!(response.large_step.saturated_steps > 0);
        assert!((response.large_step.peak_torque_ratio - 1.0).abs() < 1e-12);
    }
}
