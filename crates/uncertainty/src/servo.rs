//! The servo that an arm is assumed to have.

use needlebench_engine::{Servo, ServoGains};
use needlebench_scenario::ResolvedScenario;

/// The servo as it assumes the robot, and gravity, to be.
pub fn servo_of(resolved: &ResolvedScenario) -> Servo {
    let settings = &resolved.servo;
    let believed = resolved.gravity.believed();
    Servo {
        dynamics: resolved.cell.dynamics_under(&believed),
        gains: ServoGains {
            kp_nm_per_rad: settings.stiffness_nm_rad,
            kd_nms_per_rad: settings.damping_nms_rad,
        },
        effort_limit_nm: resolved.cell.robot.limits.efforts_nm(),
    }
}
