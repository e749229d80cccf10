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
    /// Target currents of the controller.
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
    /// Voltage of the mains.
    MainVoltage,
}

/// What the numbers of a quantity are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Numbers {
    /// Times: s if nothing else is said.
    Times,
    /// Angles, or angles per time: rad if nothing else is said.
    Angles,
    /// In SI.
    Measured,
    /// Of the row itself: without them it is of as much use.
    OfTheRow,
}

/// All quantities in their order: name in UR's real-time data exchange (of what that has not, the word of a table of
/// columns), number of columns, and what their numbers are.
const HEADINGS: [(Quantity, &str, usize, Numbers); 21] = {
    use Numbers::{Angles, Measured, OfTheRow, Times};
    use Quantity::{
        ActualCurrent, ActualQ, ActualQd, ActualTcp, ActualTorque, JointMode, MainVoltage, Payload,
        PayloadCog, PayloadInertia, RobotCurrent, RobotMode, RobotStatusBits, SafetyMode,
        TargetCurrent, TargetMoment, TargetQ, TargetQd, TargetQdd, Temperature, Time,
    };
    [
        (Time, "timestamp", 1, Times),
        (TargetQ, "target_q", 6, Angles),
        (TargetQd, "target_qd", 6, Angles),
        (TargetQdd, "target_qdd", 6, Angles),
        (TargetMoment, "target_moment", 6, Measured),
        (TargetCurrent, "target_current", 6, Measured),
        (ActualQ, "actual_q", 6, Angles),
        (ActualQd, "actual_qd", 6, Angles),
        (ActualCurrent, "actual_current", 6, Measured),
        (ActualTorque, "actual_torque", 6, Measured),
        (ActualTcp, "actual_TCP_pose", 6, Measured),
        (Payload, "payload", 1, Measured),
        (PayloadCog, "payload_cog", 3, Measured),
        (PayloadInertia, "payload_inertia", 6, Measured),
        (RobotMode, "robot_mode", 1, OfTheRow),
        (SafetyMode, "safety_mode", 1, OfTheRow),
        (JointMode, "joint_mode", 6, OfTheRow),
        (RobotStatusBits, "robot_status_bits", 1, OfTheRow),
        (Temperature, "joint_temperatures", 6, OfTheRow),
        (RobotCurrent, "actual_robot_current", 1, OfTheRow),
        (MainVoltage, "actual_main_voltage", 1, OfTheRow),
    ]
};

impl Quantity {
    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        HEADINGS.into_iter().map(|(quantity, ..)| quantity)
    }

    /// Name in UR's real-time data exchange; of what that has not, the word of a table of columns.
    pub fn name(self) -> &'static str {
        HEADINGS[self as usize].1
    }

    /// Number of columns.
    pub fn width(self) -> usize {
        HEADINGS[self as usize].2
    }

    fn numbers(self) -> Numbers {
        HEADINGS[self as usize].3
    }

    /// Whether a row without it is of no use; the others tell of the row itself.
    pub fn is_measured(self) -> bool {
        self.numbers() != Numbers::OfTheRow
    }

    /// Whether its numbers are angles, or angles per time.
    pub(crate) fn is_angular(self) -> bool {
        self.numbers() == Numbers::Angles
    }

    /// The quantity of a key in a table of columns.
    pub fn of_key(key: &str) -> Option<Self> {
        match key {
            "time" => Some(Self::Time),
            _ => Self::all().find(|each| each.name() == key),
        }
    }

    /// The quantity and the index that a column's name says: `actual_q_0`, `actual_q[0]`,
    /// `actual_q.0`, `actual_q 0`; of one column the bare name. Letters count as lower case.
    pub fn of_column(name: &str) -> Option<(Self, usize)> {
        let name = name.trim().to_ascii_lowercase();
        if matches!(name.as_str(), "timestamp" | "time" | "t") {
            return Some((Self::Time, 0));
        }
        let whole = |name: &str| Self::all().find(|each| each.name().eq_ignore_ascii_case(name));
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
    fn headings_are_in_the_order_of_the_quantities() {
        for (place, quantity) in Quantity::all().enumerate() {
            assert_eq!(quantity as usize, place);
        }
    }

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
