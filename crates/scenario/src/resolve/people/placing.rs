//! Checks people and finds the places where they stand.

use nalgebra::{Point3, Vector3};
use needlebench_cell::part_in_words;
use needlebench_geometry::Solid;
use needlebench_input::{Finding, TomlText};

use super::{
    BODY_RADIUS_M, DEFAULT_STATURES_M, PatientSides, People, PeopleSection, Person, PersonSection,
    Role, Side,
};
use crate::resolve::goals::Goal;
use crate::resolve::phantom::{Corners, PlacedPhantom};

/// What people have to stand beside.
pub(crate) struct Room<'a> {
    pub phantom: Option<&'a PlacedPhantom>,
    /// Body names with their solids, in the world.
    pub solids: &'a [(&'a str, &'a Solid)],
    pub robot_base_m: Point3<f64>,
    /// Length of the needle from hub to tip.
    pub needle_m: f64,
}

/// Places all people, for every goal.
pub(crate) fn resolve_people(
    toml: &TomlText<'_>,
    section: &PeopleSection,
    goals: &[Goal],
    room: &Room<'_>,
) -> Result<People, Finding> {
    let sides = room
        .phantom
        .and_then(|placed| PatientSides::new(&placed.world_from_phantom.rotation));
    check_sides(toml, section, sides.as_ref())?;
    let standard = [PersonSection::default()];
    let persons = persons_of(section, &standard);
    let obstacles = Obstacles::new(room);
    let in_words = PlaceWords::new(room, sides.as_ref());
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
            let (side, position_m) =
                place(toml, index, given, person, goal, sides.as_ref(), &obstacles)?;
            placed.push(Person {
                words: in_words.of(person.role, &position_m, goal),
                name,
                role: person.role,
                side,
                position_m,
                statures_m: statures_m(person),
                head_movement_m: person.head_movement_mm * 1e-3,
                handedness: person.handedness,
            });
        }
        tell_apart(&mut placed);
        by_goal.push(placed);
    }
    Ok(People {
        by_goal,
        prefer_side: section.prefer_side,
        prefer_elbow: section.prefer_elbow,
    })
}

/// What says where a person stands.
struct PlaceWords<'a> {
    sides: Option<&'a PatientSides>,
    robot_base_m: Point3<f64>,
    /// What lies between the robot and who stands opposite.
    between: &'static str,
}

impl<'a> PlaceWords<'a> {
    fn new(room: &Room<'_>, sides: Option<&'a PatientSides>) -> Self {
        let has_table = room.solids.iter().any(|(body, _)| *body == "table");
        Self {
            sides,
            robot_base_m: room.robot_base_m,
            between: match (has_table, sides) {
                (true, _) => "across the table",
                (false, Some(_)) => "across the patient",
                (false, None) => "across from the robot",
            },
        }
    }

    /// Role and place: at the head or the feet, else across the table from the robot or on its side.
    fn of(&self, role: Role, position: &Point3<f64>, goal: &Goal) -> String {
        let entry = goal.standing_place();
        let offset = position - entry;
        let away = entry - self.robot_base_m;
        let is_across = offset.x * away.x + offset.y * away.y > 0.0;
        let place = match self.sides.and_then(|sides| sides.nearest(&offset)) {
            Some(Side::Head) => "at the head",
            Some(Side::Feet) => "at the feet",
            _ if is_across => self.between,
            _ => "on the robot's side",
        };
        format!("{} {place}", part_in_words(role.name()))
    }
}

/// Numbers people whom role and place do not tell apart.
fn tell_apart(people: &mut [Person]) {
    let words: Vec<String> = people.iter().map(|each| each.words.clone()).collect();
    for (index, person) in people.iter_mut().enumerate() {
        let is_same = |each: &&String| **each == words[index];
        if words.iter().filter(is_same).count() > 1 {
            let number = words[..=index].iter().filter(is_same).count();
            person.words = format!("{} ({number})", words[index]);
        }
    }
}

/// Rejects sides of the patient on which no person can stand in this patient position.
pub(crate) fn check_sides(
    toml: &TomlText<'_>,
    section: &PeopleSection,
    sides: Option<&PatientSides>,
) -> Result<(), Finding> {
    let check_side = |key: &str, side: Option<Side>| {
        let (Some(side), Some(sides)) = (side, sides) else {
            return match side {
                None => Ok(()),
                Some(side) => Err(toml
                    .finding(
                        key,
                        format!(
                            "`{}` is a side of the patient, but there is no patient",
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
                    "no person can stand on the patient's {}: in this patient position it faces the table \
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
    Ok(())
}

/// Whether boxes alone show that everybody has room where [`resolve_people`] would place them: otherwise it
/// has to be asked.
pub(crate) fn have_room_by_boxes(
    section: &PeopleSection,
    goal: &Goal,
    sides: Option<&PatientSides>,
    robot_base_m: &Point3<f64>,
    boxes: &[&Corners],
) -> bool {
    let is_clear = |spot: &Point3<f64>| !boxes.iter().any(|corners| is_within_body(corners, spot));
    let entry = goal.standing_place();
    let standard = [PersonSection::default()];
    persons_of(section, &standard).iter().all(|person| {
        if let Some([x_mm, y_mm]) = person.position_mm {
            return is_clear(&Point3::new(x_mm * 1e-3, y_mm * 1e-3, 0.0));
        }
        let directions = directions(person, &(entry - robot_base_m), sides);
        let at = |direction: &Vector3<f64>, distance_m: f64| entry + direction * distance_m;
        match person.distance_mm {
            Some(distance_mm) => is_clear(&at(&directions[0].1, distance_mm * 1e-3)),
            None => directions
                .iter()
                .any(|(_, direction)| is_clear(&at(direction, way_m(FARTHEST_STEPS - 1)))),
        }
    })
}

fn persons_of<'s>(
    section: &'s PeopleSection,
    standard: &'s [PersonSection],
) -> &'s [PersonSection] {
    if section.persons.is_empty() {
        standard
    } else {
        &section.persons
    }
}

/// Whether a body that stands at a spot may touch what is in a box, seen from above.
fn is_within_body((low, high): &Corners, spot: &Point3<f64>) -> bool {
    (0..2).all(|axis| {
        low[axis] <= spot[axis] + BODY_RADIUS_M && high[axis] >= spot[axis] - BODY_RADIUS_M
    })
}

/// Where a person looks for room, from the entry point on, the first way first; `away` is from the robot's
/// base to the entry point. Sides were checked.
fn directions(
    person: &PersonSection,
    away: &Vector3<f64>,
    sides: Option<&PatientSides>,
) -> Vec<(Option<Side>, Vector3<f64>)> {
    if let Some(sides) = sides {
        match person.side {
            Some(side) => vec![(
                Some(side),
                sides.direction(side).expect("sides were checked"),
            )],
            None => sides.by_preference(away),
        }
    } else {
        let level = Vector3::new(away.x, away.y, 0.0);
        let across = level.try_normalize(1e-6).unwrap_or_else(Vector3::x);
        let turned = Vector3::z().cross(&across);
        [across, turned, -turned].map(|each| (None, each)).to_vec()
    }
}

impl Goal {
    /// Where people stand about: the entry point, or the guide's exit where there is no patient.
    pub(super) fn standing_place(&self) -> Point3<f64> {
        self.entry_m
            .unwrap_or_else(|| self.world_from_guide_exit.translation.vector.into())
    }
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
    obstacles: &Obstacles<'_>,
) -> Result<(Option<Side>, Point3<f64>), Finding> {
    let floor_m = person.step_height_mm * 1e-3;
    let tallest_m = statures_m(person).into_iter().fold(0.0, f64::max);
    let entry = goal.standing_place();
    let key = |name: &str| {
        if given {
            format!("people.persons[{index}].{name}")
        } else {
            "people.persons".to_owned()
        }
    };
    let refuse = |name: &str, position: &Point3<f64>, body: &str| {
        toml.finding(
            &key(name),
            format!(
                "the {} would overlap the {body} at [{:.0}, {:.0}] mm for goal `{}`",
                part_in_words(person.role.name()),
                position.x * 1e3,
                position.y * 1e3,
                goal.name
            ),
        )
        .hint("a person is modelled as 300 mm deep; omit the distance for the closest possible position")
    };
    if let Some([x_mm, y_mm]) = person.position_mm {
        let position = Point3::new(x_mm * 1e-3, y_mm * 1e-3, floor_m);
        if let Some(body) = obstacles.hit(&position, tallest_m) {
            return Err(refuse("position_mm", &position, body));
        }
        let side = sides.and_then(|sides| sides.nearest(&(position - entry)));
        return Ok((side, position));
    }
    let away = entry - obstacles.robot_base_m;
    let directions = directions(person, &away, sides);
    let at = |direction: &Vector3<f64>, distance_m: f64| {
        let spot = entry + direction * distance_m;
        Point3::new(spot.x, spot.y, floor_m)
    };
    if let Some(distance_mm) = person.distance_mm {
        let (side, direction) = directions[0];
        let position = at(&direction, distance_mm * 1e-3);
        return match obstacles.hit(&position, tallest_m) {
            Some(body) => Err(refuse("distance_mm", &position, body)),
            None => Ok((side, position)),
        };
    }
    for (side, direction) in directions {
        for step in 0..FARTHEST_STEPS {
            let position = at(&direction, way_m(step));
            let is_ahead = obstacles.needle_ahead_m(goal, &position) >= BODY_RADIUS_M + HANDS_M;
            if is_ahead && obstacles.hit(&position, tallest_m).is_none() {
                return Ok((side, position));
            }
        }
    }
    Err(toml
        .finding(
            &key("side"),
            format!(
                "no free position for a person within {:.1} m of the entry point of goal `{}` on this side",
                way_m(FARTHEST_STEPS),
                goal.name
            ),
        )
        .hint("choose another side, or give `position_mm`"))
}

/// From a body's front to the hands that hold the needle, m, for who finds a place: between a forearm held close and a
/// comfortable reach (assumed; elbow to grip is 0.30 to 0.37 m of adults, Pheasant, Bodyspace, 1996).
const HANDS_M: f64 = 0.25;

/// Steps away from the patient until there is room to stand, and how many are tried.
const STEP_M: f64 = 0.01;
const FARTHEST_STEPS: u32 = 250;

/// Distance from the entry point after some steps, m.
fn way_m(step: u32) -> f64 {
    BODY_RADIUS_M + f64::from(step) * STEP_M
}

/// A solid of the room with a box around it, along the world's axes, m.
struct Obstacle<'a> {
    body: &'a str,
    solid: &'a Solid,
    corners: Corners,
}

/// What people cannot stand in.
struct Obstacles<'a> {
    solids: Vec<Obstacle<'a>>,
    robot_base_m: Point3<f64>,
    needle_m: f64,
}

impl<'a> Obstacles<'a> {
    fn new(room: &Room<'a>) -> Self {
        let solids = room.solids.iter().map(|&(body, solid)| Obstacle {
            body,
            solid,
            corners: solid.bounding_box(),
        });
        Self {
            solids: solids.collect(),
            robot_base_m: room.robot_base_m,
            needle_m: room.needle_m,
        }
    }

    /// Level distance of a place from the needle whose tip is on the skin.
    fn needle_ahead_m(&self, goal: &Goal, place: &Point3<f64>) -> f64 {
        let tip = goal.standing_place();
        let along = -goal.axis.into_inner() * self.needle_m;
        let (along, to_place) = (along.xy(), (place - tip).xy());
        let share = to_place.dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
        (to_place - along * share.clamp(0.0, 1.0)).norm()
    }

    /// What a body that stands here would be in, if anything: axis and rim are tried every 50 mm.
    fn hit(&self, position: &Point3<f64>, stature_m: f64) -> Option<&'a str> {
        const SLICE_M: f64 = 0.05;
        const RIM_POINTS: usize = 12;
        let near: Vec<&Obstacle<'_>> = self
            .solids
            .iter()
            .filter(|each| is_within_body(&each.corners, position))
            .collect();
        let offsets: [Vector3<f64>; RIM_POINTS + 1] = std::array::from_fn(|i| {
            if i == RIM_POINTS {
                return Vector3::zeros();
            }
            let angle = std::f64::consts::TAU * i as f64 / RIM_POINTS as f64;
            Vector3::new(libm::cos(angle), libm::sin(angle), 0.0) * BODY_RADIUS_M
        });
        let mut height_m = 0.5 * SLICE_M;
        while height_m < stature_m {
            let z_m = position.z + height_m;
            let at_this_height = |each: &&&Obstacle<'_>| {
                let (low, high) = &each.corners;
                (low.z..=high.z).contains(&z_m)
            };
            if near.iter().any(|each| at_this_height(&each)) {
                for offset in &offsets {
                    let point = position + offset + Vector3::z() * height_m;
                    let mut standing = near.iter().filter(at_this_height);
                    if let Some(found) = standing.find(|each| each.solid.contains(&point)) {
                        return Some(found.body);
                    }
                }
            }
            height_m += SLICE_M;
        }
        None
    }
}
