//! What can go wrong in a simulation.

use needlebench_cell::Cell;
use needlebench_kinematics::JOINT_LABELS;

use crate::{Recording, UnstableServo};

/// Errors of the engines and of the run loop.
#[derive(Debug, Clone, thiserror::Error)]
pub enum EngineError {
    /// What the engine needs could not be started.
    #[error("{reason}")]
    NotStarted {
        /// Why, and how to mend it.
        reason: String,
    },
    /// The engine could not make an arm of the cell.
    #[error("{error}")]
    NotMade {
        /// What it says of the cell or the settings.
        error: Box<EngineError>,
    },
    /// The servo would shake the arm to pieces; nothing was simulated.
    #[error("{0}")]
    UnstableServo(UnstableServo),
    /// The state left every sensible range: the simulation is unstable.
    #[error("{engine} diverged at {time_s:.4} s: {quantity} of {joint} is {value}")]
    Diverged {
        /// Name of the engine.
        engine: &'static str,
        /// Simulated time, s.
        time_s: f64,
        /// Label of the first joint concerned.
        joint: &'static str,
        /// `position` (rad), `velocity` (rad/s) or `torque` (N m).
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// The engine itself gave the simulation up.
    #[error("{engine} became unstable: {reason}")]
    Unstable {
        /// Name of the engine.
        engine: &'static str,
        /// The engine's own words.
        reason: String,
    },
    /// A motion that could not be carried on; what was recorded until then is kept.
    #[error("{error}")]
    Stopped {
        /// What happened.
        error: Box<EngineError>,
        /// The states until then, all of them sensible.
        recording: Box<Recording>,
    },
    /// The process that the engine runs in is of no further use.
    #[error("{reason}")]
    Lost {
        /// What happened to it.
        reason: String,
    },
    /// The engine did not do what it was asked, and is well.
    #[error("{reason}")]
    Refused {
        /// Its own words.
        reason: String,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// A step length that is no positive number.
    #[error("the time step is {timestep_s} s; a positive number is required")]
    BadTimestep {
        /// The step, s.
        timestep_s: f64,
    },
    /// A setting outside its range.
    #[error("{key} is {value}; required: {expected}")]
    BadSetting {
        /// Name of the setting.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// A link without mass, or with an inertia that no rigid body has.
    #[error(
        "{joint} moves a body of {mass_kg} kg with principal moments of inertia {principal_kgm2:?} \
         kg m^2: mass and moments must be positive, and no moment may exceed the sum of the other \
         two"
    )]
    BadBody {
        /// Label of the joint that moves the body.
        joint: &'static str,
        /// Mass, kg.
        mass_kg: f64,
        /// Principal moments of inertia, ascending, kg m^2.
        principal_kgm2: [f64; 3],
    },
    /// A shape that the engine cannot build, such as a flat convex mesh.
    #[error("collision solid `{solid}` is degenerate: {reason}")]
    BadSolid {
        /// Name of the solid.
        solid: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The pairs need more collision groups than the engines have bits.
    #[error("the cell's collision pairs require {groups} groups; the engines support {limit}")]
    TooManyContactGroups {
        /// Groups needed.
        groups: usize,
        /// Groups that there are.
        limit: usize,
    },
}

impl EngineError {
    /// Whether the engine itself is gone: it can make no further motion until it is started anew.
    pub fn is_fatal(&self) -> bool {
        matches!(self, Self::NotStarted { .. } | Self::Lost { .. })
    }
}

/// Moments of inertia may exceed the triangle inequality by this fraction: rounding of a thin disc.
const TRIANGLE_SLACK: f64 = 1e-9;

/// Refuses bodies that no engine can move; both engines would fail later and less clearly.
pub(crate) fn check_bodies(cell: &Cell) -> Result<(), EngineError> {
    for (body, joint) in cell.dynamics().bodies.iter().zip(JOINT_LABELS) {
        let mut principal_kgm2: [f64; 3] = body.inertia_kgm2.symmetric_eigenvalues().into();
        principal_kgm2.sort_by(f64::total_cmp);
        let [smallest, middle, largest] = principal_kgm2;
        // Written so that NaN fails.
        let sound = body.mass_kg > 0.0
            && body.mass_kg.is_finite()
            && smallest > 0.0
            && largest <= (smallest + middle) * (1.0 + TRIANGLE_SLACK);
        if !sound {
            return Err(EngineError::BadBody {
                joint,
                mass_kg: body.mass_kg,
                principal_kgm2,
            });
        }
    }
    Ok(())
}
