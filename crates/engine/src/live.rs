//! An arm that follows a reference which is not known to its end.

use needlebench_kinematics::Joints;

use crate::drive::{Drive, Keep};
use crate::{Actuation, EngineError, Plant, PlantState, Recording, Reference, Servo};

/// An arm under the servo, stepped by its caller, who extends the reference meanwhile.
///
/// Followed again to the same time as a whole, by [`run_motions`](crate::run_motions), the reference gives the same
/// recording bit for bit.
pub struct LiveArm<'a> {
    plant: &'a mut dyn Plant,
    drive: Drive<'a>,
    state: PlantState,
}

impl<'a> LiveArm<'a> {
    /// At rest in a posture.
    ///
    /// # Errors
    /// [`EngineError::BadSetting`] for gains, limits and imperfections out of range, and what the plant reports.
    pub fn new(
        plant: &'a mut dyn Plant,
        servo: &'a Servo,
        actuation: &'a Actuation,
        keep: Keep<'a>,
        start: &Joints,
    ) -> Result<Self, EngineError> {
        let state = plant.reset(start)?;
        let mut drive = Drive::unbounded(
            (servo, actuation, keep),
            plant.identity(),
            plant.timestep_s(),
            plant.velocity_age_s(),
        )?;
        drive.record(state)?;
        Ok(Self {
            plant,
            drive,
            state,
        })
    }

    /// State after the last step.
    pub fn state(&self) -> &PlantState {
        &self.state
    }

    /// Advances by one step, and gives the state after it.
    ///
    /// # Errors
    /// [`EngineError::Diverged`], and what the plant reports.
    pub fn step(&mut self, reference: &dyn Reference) -> Result<&PlantState, EngineError> {
        if let Some(torque_nm) = self.drive.torque(reference)? {
            self.state = self.plant.step(&torque_nm)?;
            self.drive.record(self.state)?;
        }
        Ok(&self.state)
    }

    /// What was kept.
    pub fn finish(self, reference: &dyn Reference) -> Recording {
        self.drive.finish(reference)
    }
}
