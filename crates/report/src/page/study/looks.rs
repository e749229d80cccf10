//! What the cases on a page look like: the arm's tool, and the things around it, each placed as in its
//! case.

use std::sync::Arc;

use needlebench_cell::Robot;
use needlebench_kinematics::{Chain, Pose};
use needlebench_phantom::{Phantom, PhantomPart};
use needlebench_scenario::fixtures::Fixture;
use needlebench_scenario::scenario::ToolSection;
use needlebench_scenario::{PlacedPhantom, ResolvedScenario};
use serde_json::{Value, json};

use crate::page::pack::Pack;
use crate::page::scene;

/// Tools, and things, of each at most: a page has a code of a byte for each.
const MOST_KINDS: usize = 200;
/// Bytes that they may take.
const MOST_BYTES: usize = 1_200_000;
/// Bytes that they and everything before them may take together.
const MOST_BYTES_IN_ALL: usize = 7_000_000;
/// Code of what is there and not on the page, or not known.
const ELSEWHERE: u8 = u8::MAX;
/// Code of a place without a thing.
const NOTHING: u8 = u8::MAX - 1;
/// Places and directions that rounding alone tells apart, m and 1.
const ROUNDING: f64 = 1e-9;

/// A thing in its own frame.
#[derive(Debug)]
enum Thing {
    /// The link of the arm that does not move.
    Base,
    /// The chest and what is in it.
    Patient(Arc<Phantom>),
    /// Head, or a part of an arm: they lie otherwise where the chest is turned.
    Limb(PhantomPart),
    /// Its frame is that of its first solid.
    Fixture(Fixture),
}

impl Thing {
    /// A limb, and its frame in the world.
    fn limb(placed: &PlacedPhantom, part: &PhantomPart) -> (Self, Pose) {
        let mut own = part.clone();
        let place = placed.world_from_phantom * own.solid.parent_from_shape;
        own.solid.parent_from_shape = Pose::identity();
        (Self::Limb(own), place)
    }

    /// A fixture, and its frame in the world.
    fn fixture(fixture: &Fixture) -> (Self, Pose) {
        let mut own = fixture.clone();
        let first = own.solids.first();
        let place = first.map_or_else(Pose::identity, |solid| solid.parent_from_shape);
        let own_from_world = place.inverse();
        for solid in &mut own.solids {
            solid.parent_from_shape = own_from_world * solid.parent_from_shape;
        }
        (Self::Fixture(own), place)
    }

    fn looks_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Base, Self::Base) => true,
            (Self::Patient(a), Self::Patient(b)) => Arc::ptr_eq(a, b) || a.parts == b.parts,
            (Self::Limb(a), Self::Limb(b)) => {
                a.tissue == b.tissue
                    && a.color_rgba == b.color_rgba
                    && a.solid.shape == b.solid.shape
            }
            (Self::Fixture(a), Self::Fixture(b)) => {
                a.kind == b.kind
                    && a.color_rgba == b.color_rgba
                    && a.solids.len() == b.solids.len()
                    && a.solids.iter().zip(&b.solids).all(|(a, b)| {
                        a.shape == b.shape
                            && is_same_place(&a.parent_from_shape, &b.parent_from_shape)
                    })
            }
            _ => false,
        }
    }

    /// Its surfaces.
    fn drawn(&self, robot: &Robot, pack: &mut Pack) -> Value {
        match self {
            Self::Base => scene::base(robot, pack),
            Self::Patient(phantom) => scene::tissues(&phantom.parts, pack),
            Self::Limb(part) => scene::tissues(std::slice::from_ref(part), pack),
            Self::Fixture(fixture) => scene::fixture(fixture, pack),
        }
    }
}

fn is_same_place(a: &Pose, b: &Pose) -> bool {
    let between = a.inverse() * b;
    between.translation.vector.norm() < ROUNDING && between.rotation.angle() < ROUNDING.sqrt()
}

/// The base of the arm, the patient, and all that stands about them, each with its place.
fn things(resolved: &ResolvedScenario) -> Vec<(Thing, Pose)> {
    let mut all = vec![(Thing::Base, resolved.cell.robot.world_from_base_link)];
    if let Some(placed) = &resolved.phantom {
        let patient = Thing::Patient(Arc::clone(&placed.phantom));
        all.push((patient, placed.world_from_phantom));
        all.extend(placed.limbs.iter().map(|part| Thing::limb(placed, part)));
    }
    all.extend(resolved.fixtures.iter().map(Thing::fixture));
    all
}

/// The looks of the cases so far.
pub(super) struct Looks {
    arm: Chain,
    tools: Vec<ToolSection>,
    tool_values: Vec<Value>,
    kinds: Vec<Thing>,
    kind_values: Vec<Value>,
    cases: Vec<CaseLook>,
    before: usize,
}

/// What a case looks like.
#[derive(Default)]
struct CaseLook {
    /// Whether the arm is the base scenario's, whose links are on the page.
    has_arm: bool,
    tool: u8,
    things: Vec<(u8, Pose)>,
    base: Option<Pose>,
    target_m: Option<[f64; 3]>,
}

impl Looks {
    pub fn new(base: &ResolvedScenario, pack: &Pack) -> Self {
        Self {
            arm: base.cell.robot.chain,
            tools: Vec::new(),
            tool_values: Vec::new(),
            kinds: Vec::new(),
            kind_values: Vec::new(),
            cases: Vec::new(),
            before: pack.len(),
        }
    }

    /// Adds a case; none of an invalid layout.
    pub fn push(&mut self, case: Option<&ResolvedScenario>, pack: &mut Pack) {
        let look = case.map_or_else(
            || CaseLook {
                tool: ELSEWHERE,
                ..CaseLook::default()
            },
            |case| self.look(case, pack),
        );
        self.cases.push(look);
    }

    fn look(&mut self, case: &ResolvedScenario, pack: &mut Pack) -> CaseLook {
        let robot = &case.cell.robot;
        CaseLook {
            has_arm: robot.chain == self.arm,
            tool: self.tool(case, pack),
            things: things(case)
                .into_iter()
                .map(|(thing, place)| (self.kind(thing, robot, pack), place))
                .collect(),
            base: Some(robot.world_from_base_link),
            target_m: case.goals.first().map(|goal| goal.target_m.coords.into()),
        }
    }

    fn is_full(&self, count: usize, pack: &Pack) -> bool {
        count >= MOST_KINDS
            || pack.len() - self.before > MOST_BYTES
            || pack.len() > MOST_BYTES_IN_ALL
    }

    fn tool(&mut self, case: &ResolvedScenario, pack: &mut Pack) -> u8 {
        let section = &case.scenario.tool;
        let known = self.tools.iter().position(|known| known == section);
        let at = known.unwrap_or_else(|| {
            if self.is_full(self.tools.len(), pack) {
                return usize::from(ELSEWHERE);
            }
            self.tool_values.push(scene::tool(&case.cell.tool, pack));
            self.tools.push(section.clone());
            self.tools.len() - 1
        });
        u8::try_from(at).expect("200 at most, or elsewhere")
    }

    fn kind(&mut self, thing: Thing, robot: &Robot, pack: &mut Pack) -> u8 {
        let known = self.kinds.iter().position(|known| known.looks_like(&thing));
        let code = known.unwrap_or_else(|| {
            if self.is_full(self.kinds.len(), pack) {
                return usize::from(ELSEWHERE);
            }
            self.kind_values.push(thing.drawn(robot, pack));
            self.kinds.push(thing);
            self.kinds.len() - 1
        });
        u8::try_from(code).expect("200 at most, or elsewhere")
    }

    /// The document's part: kinds of tools and things, and which of them each case has, and where.
    pub fn finish(self, pack: &mut Pack) -> Value {
        let slots = self
            .cases
            .iter()
            .map(|case| case.things.len())
            .max()
            .unwrap_or(0);
        let arms: Vec<u8> = self
            .cases
            .iter()
            .map(|case| u8::from(case.has_arm))
            .collect();
        let tools: Vec<u8> = self.cases.iter().map(|case| case.tool).collect();
        let mut codes = Vec::new();
        let mut places = Vec::new();
        let mut bases = Vec::new();
        let mut targets = Vec::new();
        for case in &self.cases {
            bases.extend(numbers(case.base.as_ref()));
            targets.extend(case.target_m.unwrap_or([f64::NAN; 3]));
            for slot in 0..slots {
                let thing = case.things.get(slot);
                codes.push(thing.map_or(NOTHING, |(code, _)| *code));
                places.extend(numbers(thing.map(|(_, place)| place)));
            }
        }
        json!({
            "slots": slots,
            "arms": pack.u8s(&arms),
            "toolOf": pack.u8s(&tools),
            "things": pack.u8s(&codes),
            "places": pack.f32s(places),
            "bases": pack.f32s(bases),
            "targets": pack.f32s(targets),
            "tools": self.tool_values,
            "kinds": self.kind_values,
        })
    }
}

/// A place as seven numbers; NaN of none.
fn numbers(place: Option<&Pose>) -> [f64; 7] {
    place.map_or([f64::NAN; 7], |place| {
        let (t, q) = (place.translation.vector, place.rotation);
        [t.x, t.y, t.z, q.i, q.j, q.k, q.w]
    })
}
