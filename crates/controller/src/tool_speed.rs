//! `speedl` and `stopl`: velocities of the tool's point.

use nalgebra::{UnitQuaternion, Vector3, Vector6};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{Joints, Pose};

use crate::course::{NoSolution, joint_rates, joints_near, stacked};
use crate::ramp::Ramps;

/// The tool's point changes its velocity along a line in the space of velocities.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ToolSpeed {
    base_link_from_tcp: Pose,
    tcp_from_flange: Pose,
    ramps: Ramps<6>,
    elapsed_s: f64,
}

impl ToolSpeed {
    /// To a velocity of the tool's point (m/s) and of the tool's rotation (rad/s), in `base_link`; with one acceleration
    /// (m/s^2 and rad/s^2) for what changes more, as the script manual has it where `aRot` is not given.
    pub fn new(
        kinematics: &Kinematics,
        from: &JointState,
        flange_from_tcp: &Pose,
        to: &Vector6<f64>,
        pace: (f64, f64),
    ) -> Self {
        let chain = &kinematics.chain;
        let base_link_from_flange = kinematics.base_link_from_flange(&from.position);
        let base_link_from_tcp = base_link_from_flange * flange_from_tcp;
        let (q, qd) = (&from.position, &from.velocity);
        let jacobian = chain.jacobian(q);
        let of_flange = jacobian * qd;
        let rate = jacobian * from.acceleration + chain.flange_bias_acceleration(q, qd);
        let lever =
            base_link_from_tcp.translation.vector - base_link_from_flange.translation.vector;
        let [(linear, turning), (linear_rate, turning_rate)] = [of_flange, rate].map(|twist| {
            let [linear, angular] = [0, 3].map(|row| Vector3::from_fn(|i, _| twist[row + i]));
            (linear, angular)
        });
        let swing = turning.cross(&lever);
        let twist = stacked(&(linear + swing), &turning);
        let twist_rate = stacked(
            &(linear_rate + turning_rate.cross(&lever) + turning.cross(&swing)),
            &turning_rate,
        );
        let lead = |change: &Vector6<f64>| {
            let [linear, angular] = [0, 3].map(|row| change.fixed_rows::<3>(row).norm());
            linear.max(angular)
        };
        Self {
            base_link_from_tcp,
            tcp_from_flange: flange_from_tcp.inverse(),
            ramps: Ramps::new(&twist, &twist_rate, to, pace, lead),
            elapsed_s: 0.0,
        }
    }

    pub fn is_reached(&self) -> bool {
        self.elapsed_s >= self.ramps.duration_s()
    }

    pub fn advance(
        &mut self,
        kinematics: &Kinematics,
        from: &JointState,
        period_s: f64,
    ) -> Result<JointState, NoSolution> {
        let [before, ..] = self.ramps.sample(self.elapsed_s);
        self.elapsed_s += period_s;
        let [way, twist, twist_rate] = self.ramps.sample(self.elapsed_s);
        let step = way - before;
        let [moved, turned] = [0, 3].map(|row| Vector3::from_fn(|i, _| step[row + i]));
        let tcp = &mut self.base_link_from_tcp;
        tcp.translation.vector += moved;
        tcp.rotation = UnitQuaternion::from_scaled_axis(turned) * tcp.rotation;
        // Products of rotations drift off unit length by rounding.
        tcp.rotation.renormalize_fast();
        let flange = *tcp * self.tcp_from_flange;
        let lever_m = flange.translation.vector - tcp.translation.vector;
        let guess: Joints =
            from.position + (from.velocity + from.acceleration * (0.5 * period_s)) * period_s;
        let joints = joints_near(kinematics, &flange, &guess)?;
        if self.is_reached() && twist.amax() <= 0.0 {
            return Ok(JointState::at_rest(joints));
        }
        let [velocity, acceleration] =
            joint_rates(kinematics, &joints, &lever_m, &twist, &twist_rate)?;
        Ok(JointState {
            position: joints,
            velocity,
            acceleration,
        })
    }
}
