//! Which pairs of bodies matter, and for which class of clearance.

use crate::bodies::{BodyKind, ClearanceClass, CollisionBody, Frame};

/// Why the distance of two bodies is not measured: it follows from how the cell is built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftOut {
    /// They never move against each other: both stand in the world, or are bolted together.
    Fixed,
    /// They share a joint, so that they touch by design.
    Adjacent,
    /// The hand that belongs there is a person's.
    Hand,
}

/// What becomes of a pair of bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PairRule {
    /// Its distance is measured, for this class.
    Measured(ClearanceClass),
    /// Its distance means nothing.
    LeftOut(LeftOut),
}

/// The rule for two different bodies, in either order.
///
/// Every pair that can move is measured, except links that share a joint. One pair that cannot move is measured too:
/// the access zone against wrist 3. Its distance is constant, and shows a tool that is mounted so that the wrist is in
/// the access zone.
pub fn pair_rule(a: &CollisionBody, b: &CollisionBody) -> PairRule {
    use BodyKind::{
        Base, Gantry, GuideTube, Link, Mount, NeedleCorridor, Obstacle, Person, Phantom, Table,
        Tool,
    };
    let (first, second) = if a.kind <= b.kind { (a, b) } else { (b, a) };
    let wrist_behind_guide = second.kind == NeedleCorridor && first.kind == Link;
    if a.frame == b.frame && !wrist_behind_guide {
        return PairRule::LeftOut(LeftOut::Fixed);
    }
    PairRule::Measured(match (first.kind, second.kind) {
        (Base | Link, Base | Link) => {
            if place_in_chain(first.frame).abs_diff(place_in_chain(second.frame)) == 1 {
                return PairRule::LeftOut(LeftOut::Adjacent);
            }
            ClearanceClass::SelfCollision
        }
        (Base | Link, Tool | GuideTube) => ClearanceClass::SelfCollision,
        (NeedleCorridor, Person) => return PairRule::LeftOut(LeftOut::Hand),
        (_, NeedleCorridor) | (NeedleCorridor, Phantom | Table | Gantry | Mount | Obstacle) => {
            ClearanceClass::NeedleCorridor
        }
        (Link, Phantom) => ClearanceClass::RobotPhantom,
        (Tool, Phantom) => ClearanceClass::ToolPhantom,
        (GuideTube, Phantom) => ClearanceClass::GuideStandoff,
        (Link | Tool | GuideTube, Table) => ClearanceClass::RobotTable,
        (Link | Tool | GuideTube, Gantry) => ClearanceClass::RobotGantry,
        (Link | Tool | GuideTube, Mount) => ClearanceClass::RobotMount,
        (Link | Tool | GuideTube, Obstacle) => ClearanceClass::RobotObstacle,
        (Link | Tool | GuideTube, Person) => ClearanceClass::RobotPerson,
        // Two parts of the tool, or two that stand still: they share a frame.
        _ => return PairRule::LeftOut(LeftOut::Fixed),
    })
}

/// Moving links before and with this frame: 0 for the world, 6 for wrist 3.
pub fn place_in_chain(frame: Frame) -> usize {
    match frame {
        Frame::World => 0,
        Frame::Link(i) => i + 1,
    }
}
