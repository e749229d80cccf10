//! What all stages of a run, and of a study's case, work with.

use needlebench_clearance::ClearanceModel;
use needlebench_engine::{Keep, Motion, MotionJob, MotionSettings, Servo};
use needlebench_kinematics::NotUrGeometry;
use needlebench_kinematics::registration::RegistrationError;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_planning::Planner;
use needlebench_scenario::ResolvedScenario;
use needlebench_uncertainty::servo_of;

use crate::real_cell::RealCell;

/// Why a scenario cannot be run at all.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The robot is not a UR arm.
    #[error(transparent)]
    Robot(#[from] NotUrGeometry),
    /// The markers of `[imperfections.registration]` determine no pose.
    #[error("imperfections.registration.markers_mm: {0}")]
    Registration(#[from] RegistrationError),
}

/// A scenario, ready to be planned and simulated.
pub(crate) struct Setup<'a> {
    pub resolved: &'a ResolvedScenario,
    /// Clearances of the nominal cell.
    pub model: &'a ClearanceModel,
    pub planner: Planner<'a>,
    /// The cell that is simulated and measured.
    pub real: RealCell<'a>,
    /// The servo as it assumes the robot to be.
    pub servo: Servo,
}

impl<'a> Setup<'a> {
    pub fn new(
        resolved: &'a ResolvedScenario,
        model: &'a ClearanceModel,
    ) -> Result<Self, SetupError> {
        Ok(Self {
            resolved,
            model,
            planner: Planner::new(resolved, model)?,
            real: RealCell::new(resolved, model)?,
            servo: servo_of(resolved),
        })
    }

    /// The real arm along a trajectory.
    pub fn motion<'m>(&'m self, trajectory: &'m JointTrajectory) -> Motion<'m> {
        Motion {
            servo: &self.servo,
            actuation: self.real.actuation(),
            trajectory,
            braking: None,
            keep: Keep::Steps,
        }
    }

    /// The same in the real cell.
    pub fn job<'m>(&'m self, trajectory: &'m JointTrajectory) -> MotionJob<'m> {
        MotionJob {
            cell: self.real.cell(),
            friction: None,
            motion: self.motion(trajectory),
        }
    }

    /// How motions are made.
    pub(crate) fn motion_settings(&self) -> MotionSettings {
        MotionSettings::new(&self.resolved.scenario.engines.settings())
    }
}
