//! The people in the room: who stands where, and what the doctor prefers.
//!
//! Where a scenario says nothing, a doctor stands across the patient from the robot, as near to the
//! entry point as the furniture allows, in three statures.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::goal::solid_contains;
use crate::scenario::Scenario;
use crate::shape::Solid;
use crate::toml_text::TomlText;
use crate::{Finding, Goal, PlacedPhantom};

/// Height of the eyes of a standing adult as a share of the stature.
///
/// Drillis and Contini (1966). The medians of British adults in Pheasant, Bodyspace (1996), give
/// 1630/1740 = 0.937 for men and 1505/1610 = 0.935 for women; the 5th and 95th percentiles lie
/// between 0.932 and 0.942, which is 10 mm at most.
pub const EYE_HEIGHT_PER_STATURE: f64 = 0.936;

/// Half of the depth of a body with its clothes, m: how near the middle of a person comes to what
/// stands in the way. Assumed: abdominal depths of adults lie between 0.21 and 0.34 m.
pub const BODY_RADIUS_M: f64 = 0.15;

/// Statures where a person has none, m: from a small woman to a tall man.
const DEFAULT_STATURES_M: [f64; 3] = [1.60, 1.75, 1.90];

/// A side of the patient, in the level plane. A patient on the side has front and back there
/// instead of left and right.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Beyond the head.
    Head,
    /// Beyond the feet.
    Feet,
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
    /// The patient's front.
    Front,
    /// The patient's back.
    Back,
}

impl Side {
    /// Word in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Feet => "feet",
            Self::Left => "left",
            Self::Right => "right",
            Self::Front => "front",
            Self::Back => "back",
        }
    }
}

/// What a person does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Inserts the needle.
    #[default]
    Doctor,
    /// Helps.
    Assistant,
}

impl Role {
    /// Word in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Doctor => "doctor",
            Self::Assistant => "assistant",
        }
    }
}

/// The hand that does the fine work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Handedness {
    /// The left one.
    Left,
    /// The right one.
    #[default]
    Right,
}

/// Where an elbow is preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ElbowPreference {
    /// Above the line from shoulder to wrist, away from the patient.
    Up,
    /// Below that line, away from heads and lamps.
    Down,
}

/// Statures of adults by sex and percentile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StaturePercentile {
    /// 1505 mm.
    FemaleP5,
    /// 1610 mm.
    FemaleP50,
    /// 1710 mm.
    FemaleP95,
    /// 1625 mm.
    MaleP5,
    /// 1740 mm.
    MaleP50,
    /// 1855 mm.
    MaleP95,
}

impl StaturePercentile {
    /// Stature without shoes, m: British adults of 19 to 65 years, Pheasant, Bodyspace (1996).
    pub fn stature_m(self) -> f64 {
        match self {
            Self::FemaleP5 => 1.505,
            Self::FemaleP50 => 1.610,
            Self::FemaleP95 => 1.710,
            Self::MaleP5 => 1.625,
            Self::MaleP50 => 1.740,
            Self::MaleP95 => 1.855,
        }
    }
}

/// The people around the robot, and what they prefer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PeopleSection {
    /// Who stands where. Left out: one doctor across the patient from the robot, in three statures.
    pub persons: Vec<PersonSection>,
    /// Side of the patient on which the doctor likes to have room.
    pub prefer_side: Option<Side>,
    /// Where the doctor likes the robot's elbow: `up` or `down`.
    pub prefer_elbow: Option<ElbowPreference>,
}

/// One person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PersonSection {
    /// `doctor` or `assistant`.
    pub role: Role,
    /// Side of the patient: `head`, `feet`, `left`, `right`, and for a patient on the side `front`
    /// and `back` instead of the last two. Left out: across the patient from the robot.
    pub side: Option<Side>,
    /// Level distance from the entry point to the middle of the body, mm. Left out: as near as a
    /// body of 300 mm depth gets to what stands there.
    pub distance_mm: Option<f64>,
    /// Place in the world, mm, instead of `side` and `distance_mm`.
    pub position_mm: Option<[f64; 2]>,
    /// Height of what the person stands on over the floor, mm.
    pub step_height_mm: f64,
    /// Statures without shoes, mm; sight is measured for each. Left out, and no `stature` either:
    /// 1600, 1750 and 1900.
    pub statures_mm: Vec<f64>,
    /// Stature by sex and percentile instead: `female-p5` to `male-p95`.
    pub stature: Option<StaturePercentile>,
    /// How far the eyes may move from where an upright person has them, in any direction, mm.
    pub head_movement_mm: f64,
    /// The hand that holds the needle.
    pub handedness: Handedness,
}

impl Default for PersonSection {
    fn default() -> Self {
        Self {
            role: Role::default(),
            side: None,
            distance_mm: None,
            position_mm: None,
            step_height_mm: 0.0,
            statures_mm: Vec::new(),
            stature: None,
            head_movement_mm: 100.0,
            handedness: Handedness::default(),
        }
    }
}

/// A person at a place, for one goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// `doctor`, `assistant`; with a number from the second of its role on.
    pub name: String,
    /// What the person does.
    pub role: Role,
    /// Side of the patient that was asked for, or on which the person stands; `None` without a
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
    /// Side of the patient on which the doctor likes to have room.
    pub prefer_side: Option<Side>,
    /// Where the doctor likes the robot's elbow.
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
    fn from_across(&self, robot_to_entry: &Vector3<f64>) -> Vec<(Option<Side>, Vector3<f64>)> {
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

/// What people have to stand beside.
pub(crate) struct Room<'a> {
    pub phantom: Option<&'a PlacedPhantom>,
    /// Body names with their solids, in the world.
    pub solids: &'a [(&'a str, &'a Solid)],
    pub robot_base_m: Point3<f64>,
}

/// Numbers out of range.
pub(crate) fn check_people(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, person) in scenario.people.persons.iter().enumerate() {
        let key = |name: &str| format!("people.persons[{index}].{name}");
        let mut range = |key: String, value: f64, least: f64, most: f64| {
            if !(least..=most).contains(&value) {
                let message = format!("`{key}` is {value} mm, outside {least} to {most}");
                findings.push(toml.finding(&key, message).hint("the value is in mm"));
            }
        };
        for (at, stature_mm) in person.statures_mm.iter().enumerate() {
            range(
                format!("{}[{at}]", key("statures_mm")),
                *stature_mm,
                1300.0,
                2300.0,
            );
        }
        if let Some(distance_mm) = person.distance_mm {
            range(key("distance_mm"), distance_mm, 50.0, 3000.0);
        }
        for (at, value) in person.position_mm.iter().flatten().enumerate() {
            range(
                format!("{}[{at}]", key("position_mm")),
                *value,
                -5000.0,
                5000.0,
            );
        }
        range(key("step_height_mm"), person.step_height_mm, 0.0, 600.0);
        range(key("head_movement_mm"), person.head_movement_mm, 0.0, 400.0);
        if person.stature.is_some() && !person.statures_mm.is_empty() {
            findings.push(
                toml.finding(
                    &key("stature"),
                    "`stature` and `statures_mm` are both given",
                )
                .hint("leave one of them out"),
            );
        }
        if person.position_mm.is_some() && (person.side.is_some() || person.distance_mm.is_some()) {
            findings.push(
                toml.finding(
                    &key("position_mm"),
                    "`position_mm` is given together with `side` or `distance_mm`",
                )
                .hint("a place in the world needs neither; leave one of them out"),
            );
        }
    }
    findings
}

/// Places everybody, for every goal.
pub(crate) fn resolve_people(
    toml: &TomlText<'_>,
    section: &PeopleSection,
    goals: &[Goal],
    room: &Room<'_>,
) -> Result<People, Finding> {
    let sides = room
        .phantom
        .and_then(|placed| PatientSides::new(&placed.world_from_phantom.rotation));
    let check_side = |key: &str, side: Option<Side>| {
        let (Some(side), Some(sides)) = (side, &sides) else {
            return match side {
                None => Ok(()),
                Some(side) => Err(toml
                    .finding(
                        key,
                        format!(
                            "`{}` is a side of the patient, and there is none",
                            side.name()
                        ),
                    )
                    .hint("add a [phantom], or give `position_mm`")),
            };
        };
        if sides.direction(side).is_some() {
            return Ok(());
        }
        let names: Vec<&str> = sides.iter().map(|(side, _)| side.name()).collect();
        Err(toml
            .finding(
                key,
                format!(
                    "nobody can stand on the patient's {}: as the patient lies, it faces the table \
                     or the ceiling",
                    side.name()
                ),
            )
            .hint(format!("one of {}", names.join(", "))))
    };
    check_side("people.prefer_side", section.prefer_side)?;
    for (index, person) in section.persons.iter().enumerate() {
        check_side(&format!("people.persons[{index}].side"), person.side)?;
    }
    let standard = [PersonSection::default()];
    let persons = if section.persons.is_empty() {
        &standard[..]
    } else {
        &section.persons
    };
    let mut by_goal = Vec::new();
    for goal in goals {
        let mut placed: Vec<Person> = Vec::new();
        for (index, person) in persons.iter().enumerate() {
            let same = persons[..index]
                .iter()
                .filter(|each| each.role == person.role)
                .count();
            let name = match same {
                0 => person.role.name().to_owned(),
                earlier => format!("{}_{}", person.role.name(), earlier + 1),
            };
            let given = !section.persons.is_empty();
            let (side, position_m) = place(toml, index, given, person, goal, sides.as_ref(), room)?;
            placed.push(Person {
                name,
                role: person.role,
                side,
                position_m,
                statures_m: statures_m(person),
                head_movement_m: person.head_movement_mm * 1e-3,
                handedness: person.handedness,
            });
        }
        by_goal.push(placed);
    }
    Ok(People {
        by_goal,
        prefer_side: section.prefer_side,
        prefer_elbow: section.prefer_elbow,
    })
}

fn statures_m(person: &PersonSection) -> Vec<f64> {
    match person.stature {
        Some(percentile) => vec![percentile.stature_m()],
        None if person.statures_mm.is_empty() => DEFAULT_STATURES_M.to_vec(),
        None => person.statures_mm.iter().map(|mm| mm * 1e-3).collect(),
    }
}

/// Side and place on the floor.
///
/// A person whose side the scenario does not name stands across from the robot, or on the next side
/// on which there is room.
fn place(
    toml: &TomlText<'_>,
    index: usize,
    given: bool,
    person: &PersonSection,
    goal: &Goal,
    sides: Option<&PatientSides>,
    room: &Room<'_>,
) -> Result<(Option<Side>, Point3<f64>), Finding> {
    let floor_m = person.step_height_mm * 1e-3;
    let tallest_m = statures_m(person).into_iter().fold(0.0, f64::max);
    let entry = goal
        .entry_m
        .unwrap_or_else(|| goal.world_from_guide_exit.translation.vector.into());
    let key = |name: &str| match given {
        true => format!("people.persons[{index}].{name}"),
        false => "people.persons".to_owned(),
    };
    let refuse = |name: &str, position: &Point3<f64>, body: &str| {
        toml.finding(
            &key(name),
            format!(
                "the {} would stand inside the {body} at [{:.0}, {:.0}] mm for goal `{}`",
                person.role.name(),
                position.x * 1e3,
                position.y * 1e3,
                goal.name
            ),
        )
        .hint("a body is taken as 300 mm deep; leave the distance out to stand as near as it gets")
    };
    if let Some([x_mm, y_mm]) = person.position_mm {
        let position = Point3::new(x_mm * 1e-3, y_mm * 1e-3, floor_m);
        if let Some(body) = stands_in(&position, tallest_m, room) {
            return Err(refuse("position_mm", &position, body));
        }
        let side = sides.and_then(|sides| sides.nearest(&(position - entry)));
        return Ok((side, position));
    }
    let away = entry - room.robot_base_m;
    let directions = match sides {
        Some(sides) => match person.side {
            Some(side) => vec![(
                Some(side),
                sides.direction(side).expect("sides were checked"),
            )],
            None => sides.from_across(&away),
        },
        None => {
            let level = Vector3::new(away.x, away.y, 0.0);
            let across = level.try_normalize(1e-6).unwrap_or_else(Vector3::x);
            let turned = Vector3::z().cross(&across);
            [across, turned, -turned].map(|each| (None, each)).to_vec()
        }
    };
    let at = |direction: &Vector3<f64>, distance_m: f64| {
        let spot = entry + direction * distance_m;
        Point3::new(spot.x, spot.y, floor_m)
    };
    if let Some(distance_mm) = person.distance_mm {
        let (side, direction) = directions[0];
        let position = at(&direction, distance_mm * 1e-3);
        return match stands_in(&position, tallest_m, room) {
            Some(body) => Err(refuse("distance_mm", &position, body)),
            None => Ok((side, position)),
        };
    }
    for (side, direction) in directions {
        for step in 0..FARTHEST_STEPS {
            let position = at(&direction, BODY_RADIUS_M + f64::from(step) * STEP_M);
            if stands_in(&position, tallest_m, room).is_none() {
                return Ok((side, position));
            }
        }
    }
    Err(toml
        .finding(
            &key("side"),
            format!(
                "nobody can stand within {:.1} m of the entry point of goal `{}` there",
                BODY_RADIUS_M + f64::from(FARTHEST_STEPS) * STEP_M,
                goal.name
            ),
        )
        .hint("choose another side, or give `position_mm`"))
}

/// Steps away from the patient until there is room to stand, and how many are tried.
const STEP_M: f64 = 0.01;
const FARTHEST_STEPS: u32 = 250;

/// What a body that stands here would be in, if anything: axis and rim are tried every 50 mm.
fn stands_in<'a>(position: &Point3<f64>, stature_m: f64, room: &Room<'a>) -> Option<&'a str> {
    const SLICE_M: f64 = 0.05;
    const RIM_POINTS: u32 = 12;
    let offsets: Vec<Vector3<f64>> = (0..RIM_POINTS)
        .map(|i| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(RIM_POINTS);
            Vector3::new(angle.cos(), angle.sin(), 0.0) * BODY_RADIUS_M
        })
        .chain([Vector3::zeros()])
        .collect();
    let mut height_m = 0.5 * SLICE_M;
    while height_m < stature_m {
        for offset in &offsets {
            let point = position + offset + Vector3::z() * height_m;
            let found = room
                .solids
                .iter()
                .find(|(_, solid)| solid_contains(solid, &point));
            if let Some((name, _)) = found {
                return Some(name);
            }
        }
        height_m += SLICE_M;
    }
    None
}
