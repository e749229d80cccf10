//! A simulated motion as the controller of a UR arm would log it.

use needlebench_cell::{Cell, Robot};
use needlebench_engine::{Actuation, Recording, Servo};
use needlebench_evaluation::sample_indices;
use needlebench_kinematics::trajectory::{JointState, JointTrajectory};
use needlebench_kinematics::{Body, Chain, JOINT_COUNT, Joints, rotation_vector};

use crate::setup::Setup;

/// What is needed of a run to make logs of its recordings.
#[derive(Debug, Clone)]
pub struct RtdeSource {
    servo: Servo,
    actuation: Actuation,
    /// The real arm's, which its controller has as the manufacturer's calibration.
    chain: Chain,
    /// What the controller assumes to be at the flange.
    payload: Body,
    constants_nm_a: Option<[f64; JOINT_COUNT]>,
}

/// A log by the names of UR's real-time data exchange (RTDE).
///
/// Targets, torque and payload are what the controller assumes. `actual_q` is what the encoders read, and both poses
/// are of the *real* arm's lengths at such readings, since a controller has its arm's calibration: so what a log says
/// of lengths is how the real arm differs from the nominal one. The poses are of the flange (a TCP of zero), in the
/// controller's `base` frame.
#[derive(Debug, Clone, PartialEq)]
pub struct RtdeLog {
    /// Rows, in the order of time.
    pub rows: Vec<RtdeRow>,
    /// Mass at the flange that the controller assumes, kg.
    pub payload_kg: f64,
    /// Its centre in the flange frame, m.
    pub payload_cog_m: [f64; 3],
    /// Its inertia about its centre along the flange's axes, kg m^2: xx, yy, zz, xy, xz, yz.
    pub payload_inertia_kgm2: [f64; 6],
}

/// One row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RtdeRow {
    /// Time since the start of the motion, s.
    pub time_s: f64,
    /// What the servo follows.
    pub target: JointState,
    /// Rigid-body torque of the target, without friction, N m.
    pub target_moment_nm: Joints,
    /// That with the friction that is fed forward, over the torque constants, A; none without these.
    pub target_current_a: Option<Joints>,
    /// What the encoders read, rad.
    pub actual_q: Joints,
    /// Joint velocities, rad/s.
    pub actual_qd: Joints,
    /// Torque of the motors until then, over the torque constants, A.
    pub actual_current_a: Option<Joints>,
    /// Position (m) and rotation vector (rad) of the flange at the readings.
    pub actual_tcp: [f64; 6],
    /// The same at the target.
    pub target_tcp: [f64; 6],
}

impl RtdeSource {
    /// Of a run; `payload` is what the controller assumes to be at the flange.
    pub(crate) fn of(setup: &Setup<'_>) -> Self {
        let cell: &Cell = &setup.resolved.cell;
        let used = setup.resolved.robot_description.arm.as_ref();
        let motors = used.and_then(|used| used.arm.data.motors.as_ref());
        Self {
            servo: setup.servo,
            actuation: setup.real.actuation().clone(),
            chain: setup.real.cell().robot.chain,
            payload: cell.tool.body,
            constants_nm_a: motors.map(|motors| motors.torque_constant_nm_a),
        }
    }

    /// The same with other drives.
    pub(crate) fn driven_by(self, actuation: &Actuation) -> Self {
        Self {
            actuation: actuation.clone(),
            ..self
        }
    }

    /// The log of a recording of this run, a row every `period_s`.
    pub fn log(
        &self,
        recording: &Recording,
        trajectory: &JointTrajectory,
        period_s: f64,
    ) -> RtdeLog {
        let mut wanted = sample_indices(recording, period_s).into_iter().peekable();
        let mut rows = Vec::with_capacity(wanted.len());
        let readings = recording.readings(&self.servo, &self.actuation, trajectory);
        let amperes = |torque_nm: &Joints| {
            let constants = self.constants_nm_a?;
            Some(torque_nm.component_div(&Joints::from(constants)))
        };
        for (index, reading) in readings.enumerate() {
            if wanted.next_if_eq(&index).is_none() {
                continue;
            }
            let state = &recording.state[index];
            let until = recording.drive_nm.get(index.saturating_sub(1));
            rows.push(RtdeRow {
                time_s: recording.time_s[index],
                target: reading.target,
                target_moment_nm: reading.moment_nm,
                target_current_a: amperes(&(reading.moment_nm + reading.friction_nm)),
                actual_q: reading.position,
                actual_qd: state.velocity,
                actual_current_a: until.and_then(amperes),
                actual_tcp: self.flange(&reading.position),
                target_tcp: self.flange(&reading.target.position),
            });
        }
        RtdeLog {
            rows,
            payload_kg: self.payload.mass_kg,
            payload_cog_m: self.payload.com_m.into(),
            payload_inertia_kgm2: [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
                .map(|place| self.payload.inertia_kgm2[place]),
        }
    }

    fn flange(&self, q: &Joints) -> [f64; 6] {
        let pose = Robot::base_link_from_base().inverse() * self.chain.base_link_from_flange(q);
        let (place, turn) = (pose.translation.vector, rotation_vector(&pose.rotation));
        [place.x, place.y, place.z, turn.x, turn.y, turn.z]
    }
}
