//! What the controller had of a motion that was recorded.

use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointTrajectory;

use crate::actuation::Drives;
use crate::{Actuation, Reading, Recording, Servo};

impl Recording {
    /// What the controller had of every state, of a motion that was made with this servo, these drives and this
    /// trajectory: the noise of its encoders is drawn again as it was.
    ///
    /// The twist of the gears is that under the torque of the step that begins with the state; under that of the
    /// last step at the end.
    pub fn readings<'a>(
        &'a self,
        servo: &'a Servo,
        actuation: &'a Actuation,
        trajectory: &'a JointTrajectory,
    ) -> impl Iterator<Item = Reading> + 'a {
        let mut drives = Drives::new(servo, actuation, self.timestep_s, self.velocity_age_s);
        let last = self.steps().saturating_sub(1);
        (0..self.state.len()).map(move |index| {
            let link_nm = self.torque_nm.get(index.min(last));
            drives.reading(
                trajectory,
                self.time_s[index],
                &self.reference[index],
                &self.state[index].position,
                link_nm.unwrap_or(&Joints::zeros()),
            )
        })
    }
}
