//! The phantom of one layout, moved about.

use needlebench_input::Finding;
use needlebench_input::schema::{Node, Path};
use toml::Value;

use super::ScenarioFamily;
use super::key_path::{KeyPath, section};
use super::setting::Change;
use crate::resolve::StillLayout;
use crate::scenario::PhantomSection;
use crate::{Goal, PlacedPhantom, ResolvedScenario};

/// Keys that a shift adds to.
pub const SHIFT_KEYS: [&str; 3] = [
    "phantom.position_mm[0]",
    "phantom.position_mm[1]",
    "phantom.position_mm[2]",
];

/// Keys that a turn adds to.
pub const TURN_KEYS: [&str; 2] = ["phantom.head_yaw_deg", "phantom.body_roll_deg"];

/// A move of the phantom by the keys that place it in a scenario.
///
/// With `rest_on_table` a turned phantom rests on the table again, and a vertical shift is a change of its
/// cushion's height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PhantomMove {
    /// What is added to [`SHIFT_KEYS`], mm.
    Shift([f64; 3]),
    /// What is added to [`TURN_KEYS`], deg.
    Turn([f64; 2]),
}

impl PhantomMove {
    /// The keys that it adds to.
    pub fn keys(&self) -> &'static [&'static str] {
        match self {
            Self::Shift(_) => &SHIFT_KEYS,
            Self::Turn(_) => &TURN_KEYS,
        }
    }

    /// As changes of the keys.
    pub fn changes(&self) -> Vec<(KeyPath, Change)> {
        let by: &[f64] = match self {
            Self::Shift(by) => by,
            Self::Turn(by) => by,
        };
        let adds = self.keys().iter().zip(by);
        adds.map(|(key, by)| (KeyPath::parse(key).expect("a path"), Change::Add(*by)))
            .collect()
    }

    /// Lays a phantom elsewhere.
    fn apply(&self, section: &mut PhantomSection) {
        match self {
            Self::Shift(by) => {
                for (value, by) in section.position_mm.iter_mut().zip(by) {
                    *value += by;
                }
            }
            Self::Turn([yaw, roll]) => {
                section.head_yaw_deg += yaw;
                section.body_roll_deg += roll;
            }
        }
    }
}

/// Phantom and goal of a layout after a move: all else is as it was.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedPhantom {
    /// The phantom at its place.
    pub phantom: PlacedPhantom,
    /// The goal, which goes with it or not.
    pub goal: Goal,
    /// The patient's limbs lie beside the chest as they did, so that all of him was moved as one: they may not
    /// where the chest is rolled on what it rests on.
    pub is_moved_as_one: bool,
}

/// One layout of a family of which the phantom alone is moved.
///
/// What it says of a place is what [`ScenarioFamily::vary`] says, bit for bit, but that an entry that the scenario leaves
/// open stays as it was chosen; what stays where it is is not looked at again.
#[derive(Debug)]
pub struct PhantomMoves<'f> {
    family: &'f ScenarioFamily,
    goal: &'f str,
    changes: &'f [(KeyPath, Change)],
    /// Of a goal that the scenario leaves open, deg.
    entry: Option<[f64; 2]>,
    still: StillLayout,
    ranges: Ranges,
}

impl ScenarioFamily {
    /// A layout as [`ScenarioFamily::vary`] makes it, its phantom ready to be moved. An entry that was planned or proposed
    /// goes with the patient, and is not sought anew.
    ///
    /// # Errors
    /// As [`ScenarioFamily::vary`], and for a layout without a phantom.
    pub fn phantom_moves<'f>(
        &'f self,
        goal: &'f str,
        changes: &'f [(KeyPath, Change)],
    ) -> Result<PhantomMoves<'f>, Vec<Finding>> {
        let (resolved, chosen) = self.varied(goal, changes, None)?;
        let section = resolved.scenario.goals.first();
        let section = section.filter(|_| !chosen.is_empty());
        let entry = section.and_then(|section| section.entry_direction_deg);
        let file = resolved.source.file.clone();
        let ranges = Ranges::new().map_err(|why| vec![Finding::new(&file, why)])?;
        let still = StillLayout::new(resolved, &self.folder, &self.library)?;
        let Some(still) = still else {
            let finding = Finding::new(file, "there is no phantom to move");
            return Err(vec![finding.key("phantom")]);
        };
        Ok(PhantomMoves {
            family: self,
            goal,
            changes,
            entry,
            still,
            ranges,
        })
    }
}

impl PhantomMoves<'_> {
    /// The layout with the phantom where it is.
    pub fn base(&self) -> &ResolvedScenario {
        self.still.resolved()
    }

    /// The scenario's section of the phantom after a move, whether or not there is such a layout.
    pub fn section_after(&self, by: &PhantomMove) -> PhantomSection {
        let scenario = &self.base().scenario;
        let mut section = scenario.phantom.clone().expect("there is a phantom");
        by.apply(&mut section);
        section
    }

    /// Phantom and goal after a move.
    ///
    /// # Errors
    /// As [`PhantomMoves::resolved`].
    pub fn moved(&self, by: &PhantomMove) -> Result<MovedPhantom, Vec<Finding>> {
        let section = self.section_after(by);
        if self.ranges.hold(&section)
            && let Some((phantom, goal)) = self.still.with_phantom_at(&section)?
        {
            return Ok(self.of(phantom, goal));
        }
        let mut resolved = self.resolved(by)?;
        let phantom = resolved.phantom.take().expect("there is a phantom");
        let goal = resolved.goals.swap_remove(0);
        Ok(self.of(phantom, goal))
    }

    fn of(&self, phantom: PlacedPhantom, goal: Goal) -> MovedPhantom {
        MovedPhantom {
            is_moved_as_one: self.still.lies_alike(&phantom),
            phantom,
            goal,
        }
    }

    /// The whole layout after a move.
    ///
    /// # Errors
    /// As [`ScenarioFamily::vary`].
    pub fn resolved(&self, by: &PhantomMove) -> Result<ResolvedScenario, Vec<Finding>> {
        let mut changes = self.changes.to_vec();
        changes.extend(by.changes());
        let (resolved, _) = self.family.varied(self.goal, &changes, self.entry)?;
        Ok(resolved)
    }
}

/// What files may give as a phantom's place.
#[derive(Debug)]
struct Ranges {
    position: [&'static Node; 3],
    yaw: &'static Node,
    roll: &'static Node,
}

impl Ranges {
    /// # Errors
    /// Where there are no such keys: a bug.
    fn new() -> Result<Self, String> {
        let phantom = section("phantom")?;
        let position = phantom.key("position_mm")?;
        Ok(Self {
            position: [position.item(0)?, position.item(1)?, position.item(2)?],
            yaw: phantom.key("head_yaw_deg")?,
            roll: phantom.key("body_roll_deg")?,
        })
    }

    /// Whether a place is one that files may give.
    fn hold(&self, of: &PhantomSection) -> bool {
        let fits = |node: &Node, number: f64| {
            let mut misfits = Vec::new();
            node.check(Path::Top, &Value::Float(number), &mut misfits);
            misfits.is_empty()
        };
        let mut position = self.position.iter().zip(of.position_mm);
        position.all(|(node, mm)| fits(node, mm))
            && fits(self.yaw, of.head_yaw_deg)
            && fits(self.roll, of.body_roll_deg)
    }
}
