//! What a log can have, and under which names.

/// A quantity of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// Time of the row.
    Time,
    /// Set-points of the joints.
    TargetQ,
    /// Their speeds.
    TargetQd,
    /// Their accelerations.
    TargetQdd,
    /// The controller's rigid-body torques, without friction.
    TargetMoment,
    /// Currents that the controller asks for.
    TargetCurrent,
    /// Joint angles as measured.
    ActualQ,
    /// Joint speeds as measured.
    ActualQd,
    /// Currents as measured.
    ActualCurrent,
    /// Torques at the joints as measured.
    ActualTorque,
    /// Pose of the tool's point: position and rotation vector, `base` frame.
    ActualTcp,
    /// Mass of the load that the controller believes in.
    Payload,
    /// Its centre in the flange frame.
    PayloadCog,
    /// Its inertia about its centre, flange axes: xx, yy, zz, xy, xz, yz.
    PayloadInertia,
    /// The controller's mode.
    RobotMode,
    /// The controller's safety mode.
    SafetyMode,
    /// The joints' modes.
    JointMode,
    /// Bits: power, program, teach button, power button.
    RobotStatusBits,
    /// Temperatures of the joints, degrees C.
    Temperature,
    /// Current of the whole robot.
    RobotCurrent,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 20] = [
        Self::Time,
        Self::TargetQ,
        Self::TargetQd,
        Self::TargetQdd,
        Self::TargetMoment,
        Self::TargetCurrent,
        Self::ActualQ,
        Self::ActualQd,
        Self::ActualCurrent,
        Self::ActualTorque,
        Self::ActualTcp,
        Self::Payload,
        Self::PayloadCog,
        Self::PayloadInertia,
        Self::RobotMode,
        Self::SafetyMode,
        Self::JointMode,
        Self::RobotStatusBits,
        Self::Temperature,
        Self::RobotCurrent,
    ];

    /// Name in UR's real-time data exchange; of what that has not, the word of a table of columns.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "timestamp",
            Self::TargetQ => "target_q",
            Self::TargetQd => "target_qd",
            Self::TargetQdd => "target_qdd",
            Self::TargetMoment => "target_moment",
            Self::TargetCurrent => "target_current",
            Self::ActualQ => "actual_q",
            Self::ActualQd => "actual_qd",
            Self::ActualCurrent => "actual_current",
            Self::ActualTorque => "actual_torque",
            Self::ActualTcp => "actual_TCP_pose",
            Self::Payload => "payload",
            Self::PayloadCog => "payload_cog",
            Self::PayloadInertia => "payload_inertia",
            Self::RobotMode => "robot_mode",
            Self::SafetyMode => "safety_mode",
            Self::JointMode => "joint_mode",
            Self::RobotStatusBits => "robot_status_bits",
            Self::Temperature => "joint_temperatures",
            Self::RobotCurrent => "actual_robot_current",
        }
    }

    /// Number of columns.
    pub fn width(self) -> usize {
        match self {
            Self::Time
            | Self::Payload
            | Self::RobotMode
            | Self::SafetyMode
            | Self::RobotStatusBits
            | Self::RobotCurrent => 1,
            Self::PayloadCog => 3,
            _ => 6,
        }
    }

    /// Whether a row without it is of no use; the others tell of the row itself.
    pub fn is_measured(self) -> bool {
        !matches!(
            self,
            Self::RobotMode
                | Self::SafetyMode
                | Self::JointMode
                | Self::RobotStatusBits
                | Self::Temperature
                | Self::RobotCurrent
        )
    }

    /// Whether its numbers are angles, or angles per time.
    pub fn is_angular(self) -> bool {
        matches!(
            self,
            Self::TargetQ | Self::TargetQd | Self::TargetQdd | Self::ActualQ | Self::ActualQd
        )
    }

    /// The quantity of a key in a table of columns.
    pub fn of_key(key: &str) -> Option<Self> {
        match key {
            "time" => Some(Self::Time),
            _ => Self::ALL.into_iter().find(|each| each.name() == key),
        }
    }

    /// The quantity and the index that a column's name says: `actual_q_0`, `actual_q[0]`,
    /// `actual_q.0`, `actual_q 0`; of one column the bare name. Letters count as lower case.
    pub fn of_column(name: &str) -> Option<(Self, usize)> {
        let name = name.trim().to_ascii_lowercase();
        if matches!(name.as_str(), "timestamp" | "time" | "t") {
            return Some((Self::Time, 0));
        }
        let whole = |name: &str| {
            let mut all = Self::ALL.into_iter();
            all.find(|each| each.name().eq_ignore_ascii_case(name))
        };
        if let Some(quantity) = whole(&name).filter(|each| each.width() == 1) {
            return Some((quantity, 0));
        }
        let inner = name.strip_suffix(']').unwrap_or(&name);
        let (stem, index) = inner.rsplit_once(['_', '[', '.', ' '])?;
        let quantity = whole(stem)?;
        Some((quantity, index.parse().ok()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_known_however_their_index_is_written() {
        for name in ["actual_q_3", "actual_q[3]", "actual_q.3", "Actual_Q 3"] {
            assert_eq!(Quantity::of_column(name), Some((Quantity::ActualQ, 3)));
        }
        assert_eq!(Quantity::of_column("time"), Some((Quantity::Time, 0)));
        assert_eq!(Quantity::of_column("payload"), Some((Quantity::Payload, 0)));
        let tcp = Quantity::of_column("actual_TCP_pose_5");
        assert_eq!(tcp, Some((Quantity::ActualTcp, 5)));
        assert_eq!(Quantity::of_column("actual_TCP_force_5"), None);
        assert_eq!(Quantity::of_column("payload_cog"), None);
    }
}
