//! The referee under the torques that an engine's run recorded.

use needlebench_kinematics::Joints;

use super::RefereePlant;
use crate::{EngineError, Plant, PlantState, Recording, ServoGains};

/// Motion of the referee under recorded torques, for the first `steps` of them: the states that
/// belong to those of the recording, the starting one included.
///
/// Alone, an arm under torques that were meant for another is not held: gravity pulls a raised arm
/// away from any small difference, a hundredfold and more within 2 s. With `hold_back`, the
/// difference to the recorded motion is pulled back with these gains,
/// `torque + kp (q_engine - q) + kd (qd_engine - qd)`, velocities as each plant gives them. With the
/// gains of the servo that made the recording, the difference then obeys the servo's own closed loop:
/// what is left is the error of the engine's integration as a servo in that place would feel it.
pub fn retrace(
    plant: &mut RefereePlant,
    recording: &Recording,
    steps: usize,
    hold_back: Option<&ServoGains>,
) -> Result<Vec<PlantState>, EngineError> {
    let (kp, kd) = hold_back.map_or((Joints::zeros(), Joints::zeros()), |gains| {
        (
            Joints::from(gains.kp_nm_per_rad),
            Joints::from(gains.kd_nms_per_rad),
        )
    });
    let Some(start) = recording.state.first() else {
        return Ok(Vec::new());
    };
    let mut state = plant.reset_in_motion(&start.position, &start.velocity);
    let mut states = vec![state];
    for (torque_nm, engine) in recording.torque_nm.iter().zip(&recording.state).take(steps) {
        let torque_nm = torque_nm
            + kp.component_mul(&(engine.position - state.position))
            + kd.component_mul(&(engine.velocity - state.velocity));
        state = plant.step(&torque_nm)?;
        states.push(state);
    }
    Ok(states)
}
