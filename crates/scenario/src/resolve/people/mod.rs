//! The people in the room: their positions, and the physician's preferences.
//!
//! Where a scenario says nothing, a physician stands across the patient from the robot, as near to the
//! entry point as the furniture allows, in three statures.

mod body;
mod placing;

pub use crate::scenario::{ElbowPreference, Handedness, Role, Side, StaturePercentile};
use crate::scenario::{PeopleSection, PersonSection};
pub(crate) use body::drawn;
use nalgebra::{Point3, UnitQuaternion, Vector3};
pub(crate) use placing::{Room, check_sides, have_room_by_boxes, resolve_people};

/// Height of the eyes of a standing adult as a share of the stature.
///
/// Drillis and Contini (1966). The medians of British adults in Pheasant, Bodyspace (1996), give
/// 1630/1740 = 0.937 for men and 1505/1610 = 0.935 for women; the 5th and 95th percentiles lie
/// between 0.932 and 0.942, which is 10 mm at most.
pub(crate) const EYE_HEIGHT_PER_STATURE: f64 = 0.936;

/// Half of the depth of a body with its clothes, m: how near the middle of a person comes to what
/// stands in the way. Assumed: abdominal depths of adults lie between 0.21 and 0.34 m.
pub(crate) const BODY_RADIUS_M: f64 = 0.15;

/// Statures where a person has none, m: from a small woman to a tall man.
const DEFAULT_STATURES_M: [f64; 3] = [1.60, 1.75, 1.90];

/// A person at a place, for one goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// `doctor`, `assistant`; with a number from the second of its role on.
    pub name: String,
    /// The same in words, with the place: `physician across the table`.
    pub words: String,
    /// What the person does.
    pub role: Role,
    /// Side of the patient that was given, or on which the person stands; `None` without a
    /// patient.
    pub side: Option<Side>,
    /// Point between the feet, in the world.
    pub position_m: Point3<f64>,
    /// Statures, m.
    pub statures_m: Vec<f64>,
    /// Radius of the ball in which the eyes may be, m.
    pub head_movement_m: f64,
    /// The hand that holds the needle.
    pub handedness: Handedness,
}

impl Person {
    /// Who it is, if of this stature: `physician across the table, 1.75 m`.
    pub fn in_words(&self, stature_m: f64) -> String {
        format!("{}, {stature_m:.2} m", self.words)
    }

    /// Middle of the ball in which the eyes of this person may be, if of this stature.
    pub fn eyes_m(&self, stature_m: f64) -> Point3<f64> {
        self.position_m + Vector3::z() * (EYE_HEIGHT_PER_STATURE * stature_m)
    }
}

/// The people of a scenario, placed.
#[derive(Debug, Clone, PartialEq)]
pub struct People {
    /// By goal: who stands where while this needle is placed.
    pub by_goal: Vec<Vec<Person>>,
    /// Side of the patient on which the physician prefers free space.
    pub prefer_side: Option<Side>,
    /// Position of the robot's elbow that the physician prefers.
    pub prefer_elbow: Option<ElbowPreference>,
}

/// Level directions of the room as the patient's sides, unit vectors in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct PatientSides([(Side, Vector3<f64>); 4]);

impl PatientSides {
    /// Of a patient who lies: head, feet, and the two sides that are level. `None` if the long
    /// axis is not level enough to tell.
    pub fn new(world_from_phantom: &UnitQuaternion<f64>) -> Option<Self> {
        let level = |direction: Vector3<f64>| {
            let flat = Vector3::new(direction.x, direction.y, 0.0);
            flat.try_normalize(0.5)
        };
        let head = level(world_from_phantom * Vector3::z())?;
        let left_axis = world_from_phantom * Vector3::x();
        let back_axis = world_from_phantom * Vector3::y();
        // The more level of the two gives the sides their names.
        let (plus, minus, axis) = if left_axis.z.abs() <= back_axis.z.abs() {
            (Side::Left, Side::Right, left_axis)
        } else {
            (Side::Back, Side::Front, back_axis)
        };
        let across = Vector3::z().cross(&head);
        let across = if across.dot(&axis) >= 0.0 {
            across
        } else {
            -across
        };
        Some(Self([
            (Side::Head, head),
            (Side::Feet, -head),
            (plus, across),
            (minus, -across),
        ]))
    }

    /// All four, head and feet first.
    pub fn iter(&self) -> impl Iterator<Item = (Side, Vector3<f64>)> + '_ {
        self.0.iter().copied()
    }

    /// Direction of a side, or `None` for one that faces table or ceiling.
    pub fn direction(&self, side: Side) -> Option<Vector3<f64>> {
        self.iter()
            .find(|(each, _)| *each == side)
            .map(|(_, direction)| direction)
    }

    /// Side on which a level offset from the patient lies.
    pub fn nearest(&self, offset: &Vector3<f64>) -> Option<Side> {
        self.iter()
            .max_by(|(_, a), (_, b)| a.dot(offset).total_cmp(&b.dot(offset)))
            .map(|(side, _)| side)
    }

    /// All sides in the order in which a person looks for room: across the patient from the robot,
    /// on the robot's side, at the feet, at the head.
    fn by_preference(&self, robot_to_entry: &Vector3<f64>) -> Vec<(Option<Side>, Vector3<f64>)> {
        let [head, feet, a, b] = self.0;
        let (across, beside) = if a.1.dot(robot_to_entry) >= b.1.dot(robot_to_entry) {
            (a, b)
        } else {
            (b, a)
        };
        [across, beside, feet, head]
            .map(|(side, direction)| (Some(side), direction))
            .to_vec()
    }
}
