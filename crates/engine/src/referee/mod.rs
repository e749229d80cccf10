//! The arm by our own equations of motion, integrated to rounding: the reference integrator of the engines.

mod engine;
mod held;

use nalgebra::SVector;
use needlebench_cell::Cell;
use needlebench_kinematics::{Dynamics, JOINT_COUNT, JOINT_LABELS, Joints, Pose, integrate};
use serde::{Deserialize, Serialize};

pub use engine::REFEREE;
pub use held::HeldWindow;

use crate::error::check_bodies;
use crate::plant::checked_timestep_s;
use crate::{Contact, EngineError, EngineIdentity, Plant, PlantState};

/// When the torque of a step acts.
///
/// The engines advance by semi-implicit Euler, which is leapfrog in disguise: they compute the
/// velocity in the middle of a step from the torque at its start, so that to second order in the
/// step a torque acts from half a step before its sample to half a step after it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TorqueHold {
    /// From half a step before the sample to half a step after it, the first one from the reset to
    /// half a step: what the engines approach to second order. Velocities belong half a step
    /// before their state's time, as in the engines.
    ///
    /// The position of a state lies half a step ahead of the last torque; it is what this torque,
    /// held on, would lead to. The next step takes the half step back and does it again with its own
    /// torque: the state itself never depends on the look ahead.
    #[default]
    AroundSample,
    /// From the sample to the next one, as a real drive holds it; velocities belong to their
    /// state's time. The engines approach this to first order only.
    FromSample,
}

impl TorqueHold {
    fn name(self) -> &'static str {
        match self {
            Self::AroundSample => "around_sample",
            Self::FromSample => "from_sample",
        }
    }
}

/// Settings of the reference integrator, beside the step length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RefereeSettings {
    /// When the torque of a step acts.
    pub hold: TorqueHold,
    /// Bound of the estimated error of a position (rad) or velocity (rad/s) in each step; see
    /// [`integrate`].
    pub tolerance: f64,
}

impl Default for RefereeSettings {
    /// A tolerance of 1e-12: four digits above rounding, and far below the engines' errors.
    fn default() -> Self {
        Self {
            hold: TorqueHold::default(),
            tolerance: 1e-12,
        }
    }
}

/// The finest and the coarsest tolerance: some roundings of a radian, and a milliradian.
const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-14..=1e-3;

/// Joint positions, then velocities.
type Phase = SVector<f64, 12>;

/// The arm by our own rigid-body dynamics, for motion without contact.
///
/// Positions and velocities solve the equations of motion under held torques to rounding (see
/// [`integrate`]), so that what an engine's motion differs by is the engine's. There are no contacts:
/// the arm passes through whatever it meets, and a recording in which an engine saw contact says
/// nothing beside this one. A free swing of the arm is chaotic: small errors grow by `e` every 0.2 s
/// or so, and no comparison beyond the first second means anything.
///
/// Energy, work and momentum balance to 1e-12 over 10 s
/// (`energy_work_and_momentum_balance_over_ten_seconds` in `needlebench-kinematics`).
#[derive(Debug, Clone)]
pub struct RefereePlant {
    dynamics: Dynamics,
    world_from_base_link: Pose,
    settings: RefereeSettings,
    timestep_s: f64,
    /// State that all torques so far led to: at the time of the last returned state, or half a step
    /// before it.
    settled: Phase,
    /// How far the next torque carries `settled`, s.
    next_interval_s: f64,
    position: Joints,
    time_s: f64,
}

impl RefereePlant {
    /// The cell's arm.
    pub fn new(
        cell: &Cell,
        timestep_s: f64,
        settings: &RefereeSettings,
    ) -> Result<Self, EngineError> {
        check_bodies(cell)?;
        let timestep_s = checked_timestep_s(timestep_s)?;
        if !TOLERANCES.contains(&settings.tolerance) {
            return Err(EngineError::BadSetting {
                key: "tolerance",
                value: settings.tolerance,
                expected: "between 1e-14 and 1e-3",
            });
        }
        let mut plant = Self {
            dynamics: cell.dynamics(),
            world_from_base_link: cell.robot.world_from_base_link,
            settings: *settings,
            timestep_s,
            settled: Phase::zeros(),
            next_interval_s: 0.0,
            position: Joints::zeros(),
            time_s: 0.0,
        };
        plant.place(&Joints::zeros(), &Joints::zeros());
        Ok(plant)
    }

    /// Places the arm in motion at `position` with `velocity`, as [`Plant::reset`] does at rest.
    pub(crate) fn reset_in_motion(&mut self, position: &Joints, velocity: &Joints) -> PlantState {
        self.place(position, velocity);
        self.observe(*position, *velocity)
    }

    /// The equations of motion.
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    fn place(&mut self, position: &Joints, velocity: &Joints) {
        self.settled = phase(position, velocity);
        self.next_interval_s = match self.settings.hold {
            TorqueHold::AroundSample => 0.5 * self.timestep_s,
            TorqueHold::FromSample => self.timestep_s,
        };
        self.position = *position;
        self.time_s = 0.0;
    }

    fn advanced(
        &self,
        from: &Phase,
        interval_s: f64,
        torque_nm: &Joints,
    ) -> Result<Phase, EngineError> {
        let slope = |state: &Phase| {
            let (position, velocity) = halves(state);
            let acceleration = self
                .dynamics
                .forward_dynamics(&position, &velocity, torque_nm);
            phase(&velocity, &acceleration)
        };
        integrate(slope, from, interval_s, self.settings.tolerance).map_err(|error| {
            EngineError::Unstable {
                engine: "referee",
                reason: format!("after {} s of motion {error}", self.time_s),
            }
        })
    }

    fn observe(&self, position: Joints, velocity: Joints) -> PlantState {
        PlantState {
            position,
            velocity,
            world_from_flange: self.world_from_base_link
                * self.dynamics.chain.base_link_from_flange(&position),
            contact: Contact::default(),
        }
    }
}

fn phase(upper: &Joints, lower: &Joints) -> Phase {
    let mut phase = Phase::zeros();
    phase.fixed_rows_mut::<6>(0).copy_from(upper);
    phase.fixed_rows_mut::<6>(6).copy_from(lower);
    phase
}

fn halves(phase: &Phase) -> (Joints, Joints) {
    (
        phase.fixed_rows::<6>(0).into_owned(),
        phase.fixed_rows::<6>(6).into_owned(),
    )
}

impl Plant for RefereePlant {
    fn identity(&self) -> EngineIdentity {
        EngineIdentity {
            name: "referee",
            version: env!("CARGO_PKG_VERSION").into(),
            settings: vec![
                ("timestep_s".to_owned(), self.timestep_s.to_string()),
                ("hold".to_owned(), self.settings.hold.name().to_owned()),
                ("integrator".to_owned(), "DOP853".to_owned()),
                ("tolerance".to_owned(), self.settings.tolerance.to_string()),
            ],
        }
    }

    fn reset(&mut self, position: &Joints) -> Result<PlantState, EngineError> {
        Ok(self.reset_in_motion(position, &Joints::zeros()))
    }

    fn step(&mut self, torque_nm: &Joints) -> Result<PlantState, EngineError> {
        for (&value, joint) in torque_nm.iter().zip(JOINT_LABELS) {
            if !value.is_finite() {
                return Err(EngineError::Diverged {
                    engine: "referee",
                    time_s: self.time_s,
                    joint,
                    quantity: "torque",
                    value,
                });
            }
        }
        self.settled = self.advanced(&self.settled, self.next_interval_s, torque_nm)?;
        self.next_interval_s = self.timestep_s;
        self.time_s += self.timestep_s;
        let (position, velocity) = halves(&self.settled);
        self.position = match self.settings.hold {
            TorqueHold::FromSample => position,
            TorqueHold::AroundSample => {
                halves(&self.advanced(&self.settled, 0.5 * self.timestep_s, torque_nm)?).0
            }
        };
        Ok(self.observe(self.position, velocity))
    }

    fn timestep_s(&self) -> f64 {
        self.timestep_s
    }

    fn velocity_age_s(&self) -> f64 {
        match self.settings.hold {
            TorqueHold::AroundSample => 0.5 * self.timestep_s,
            TorqueHold::FromSample => 0.0,
        }
    }

    fn link_poses(&mut self) -> Result<[Pose; JOINT_COUNT], EngineError> {
        let links = self.dynamics.chain.link_poses(&self.position);
        Ok(links.map(|link| self.world_from_base_link * link))
    }
}
