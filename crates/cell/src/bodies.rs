//! Bodies that can be hit, and the classes of clearance between them.

use needlebench_geometry::Solid;
use serde::{Deserialize, Serialize};

/// What a collision body is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyKind {
    /// The arm's fixed link.
    Base,
    /// A moving link of the arm.
    Link,
    /// The tool, but for its guide tube.
    Tool,
    /// The guide tube.
    GuideTube,
    /// Volume behind the guide that needle and hand need; not a physical body.
    NeedleCorridor,
    /// The patient: the phantom's skin, head and arms.
    Phantom,
    /// CT table.
    Table,
    /// CT gantry.
    Gantry,
    /// The robot's mount.
    Mount,
    /// One of the scenario's obstacles.
    Obstacle,
    /// Somebody who stands in the room.
    Person,
}

/// What a collision body moves with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Frame {
    /// Fixed; solids are given in the world.
    World,
    /// Moves with moving link 0..6; solids are given in that link's frame.
    Link(usize),
}

/// A rigid group of solids.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CollisionBody {
    /// Unique name: `upper_arm`, `tool`, `guide_tube`, `phantom`, `table` ...
    pub name: String,
    /// What it is.
    pub kind: BodyKind,
    /// What it moves with.
    pub frame: Frame,
    /// Its geometry in that frame.
    pub solids: Vec<Solid>,
}

/// Classes of clearance, as reports name them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ClearanceClass {
    /// Moving links against the patient's skin, head and arms included.
    RobotPhantom,
    /// Links and tool against the table.
    RobotTable,
    /// Links and tool against the gantry.
    RobotGantry,
    /// Links and tool against the mount.
    RobotMount,
    /// Links and tool against the scenario's obstacles.
    RobotObstacle,
    /// Links and tool against the people in the room.
    RobotPerson,
    /// The arm and its tool against themselves.
    #[serde(rename = "self")]
    SelfCollision,
    /// The tool, without its guide tube, against the skin.
    ToolPhantom,
    /// The guide tube against the skin: the intended stand-off.
    GuideStandoff,
    /// The needle's and hand's volume behind the guide against everything it does not belong to.
    NeedleCorridor,
    /// The planned needle line against bone, vessel and organ.
    NeedleRoute,
}

impl ClearanceClass {
    /// All of them, in the order of reports; each at the index that it is cast to.
    pub const ALL: [Self; 11] = [
        Self::RobotPhantom,
        Self::RobotTable,
        Self::RobotGantry,
        Self::RobotMount,
        Self::RobotObstacle,
        Self::RobotPerson,
        Self::SelfCollision,
        Self::ToolPhantom,
        Self::GuideStandoff,
        Self::NeedleCorridor,
        Self::NeedleRoute,
    ];

    /// The class of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.name() == name)
    }

    /// Name as in reports and scenario files.
    pub fn name(self) -> &'static str {
        match self {
            Self::RobotPhantom => "robot_phantom",
            Self::RobotTable => "robot_table",
            Self::RobotGantry => "robot_gantry",
            Self::RobotMount => "robot_mount",
            Self::RobotObstacle => "robot_obstacle",
            Self::RobotPerson => "robot_person",
            Self::SelfCollision => "self",
            Self::ToolPhantom => "tool_phantom",
            Self::GuideStandoff => "guide_standoff",
            Self::NeedleCorridor => "needle_corridor",
            Self::NeedleRoute => "needle_route",
        }
    }

    /// Whether touching in this class is a collision of physical bodies.
    pub fn is_physical(self) -> bool {
        !matches!(self, Self::NeedleCorridor | Self::NeedleRoute)
    }

    /// Whether nobody wants these bodies to come near each other: physical ones, but for the guide's
    /// intended stand-off from the skin.
    pub fn is_unwanted(self) -> bool {
        self.is_physical() && self != Self::GuideStandoff
    }

    /// Whether it is of arm and tool against what stands around them: what is called the clearance.
    pub fn is_surroundings(self) -> bool {
        self.is_unwanted() && self != Self::SelfCollision
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_is_at_its_index_and_goes_by_its_name() {
        for (index, class) in ClearanceClass::ALL.into_iter().enumerate() {
            assert_eq!(class as usize, index);
            assert_eq!(ClearanceClass::named(class.name()), Some(class));
        }
    }
}
