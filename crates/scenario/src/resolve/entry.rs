//! Entries that a scenario leaves open, and goals that are tried in its cell.

use std::fmt;
use std::sync::Arc;

use nalgebra::Point3;
use needlebench_cell::{BodyKind, CollisionBody, Frame};
use needlebench_input::TomlText;

use super::goals::{
    BevelFacing, BodyBoxes, Goal, Surroundings, bevel_facing, resolve_goal, target_inside,
};
use super::{Finding, ResolvedScenario};
use crate::scenario::GoalSection;

/// Where a needle is to enter, and by what that was chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenEntry {
    /// For `entry_direction_deg`.
    pub direction_deg: [f64; 2],
    /// What it is, for people.
    pub in_words: String,
}

/// Why a goal gets no entry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NoEntry {
    /// What is wrong.
    pub message: String,
    /// How to fix it.
    pub hint: String,
    /// As in [`Finding::nothing_serves`].
    pub nothing_serves: bool,
}

/// What chooses entries; it may keep what it found for the layouts that come.
pub trait ChooseEntry: fmt::Debug + Send + Sync {
    /// Chooses an entry for a goal that has none, in a cell without its goals. What it kept changes nothing.
    ///
    /// # Errors
    /// Where there is none to choose.
    fn choose(&self, cell: &ResolvedScenario, goal: &GoalSection) -> Result<ChosenEntry, NoEntry>;
}

/// Chooses the entries of open goals: their evaluation is above this crate.
#[derive(Debug, Clone)]
pub struct EntryChooser(pub Arc<dyn ChooseEntry>);

/// Entries that were chosen for open goals.
#[derive(Debug, Default)]
pub(crate) struct ChosenEntries {
    /// What was chosen and why, for people.
    pub remarks: Vec<String>,
    /// Sections of goals with planned routes.
    pub planned: PlannedSections,
}

/// Sections of goals whose routes were planned, as they were before they had an entry.
#[derive(Debug, Default)]
pub(crate) struct PlannedSections(Vec<(usize, GoalSection)>);

impl ChosenEntries {
    /// Whether no goal was open.
    pub(crate) fn is_empty(&self) -> bool {
        self.remarks.is_empty()
    }
}

impl PlannedSections {
    /// The scenario with these sections: it stays what its file says, and is planned anew where it is changed.
    pub(crate) fn put_back(self, mut resolved: ResolvedScenario) -> ResolvedScenario {
        for (index, section) in self.0 {
            resolved.scenario.goals[index] = section;
        }
        resolved
    }
}

impl EntryChooser {
    /// Gives open goals their entries, in a cell without its goals.
    ///
    /// # Errors
    /// Goals for which there is none to choose.
    pub(crate) fn choose(
        &self,
        toml: &TomlText<'_>,
        cell: &ResolvedScenario,
        goals: &mut [GoalSection],
    ) -> Result<ChosenEntries, Vec<Finding>> {
        let mut chosen = ChosenEntries::default();
        let mut findings = Vec::new();
        for (index, goal) in goals.iter_mut().enumerate() {
            if !goal.is_open() {
                continue;
            }
            match self.0.choose(cell, goal) {
                Ok(entry) => {
                    let section = goal.clone();
                    goal.entry_direction_deg = Some(entry.direction_deg);
                    let why = match goal.route.take() {
                        Some(_) => {
                            chosen.planned.0.push((index, section));
                            format!("needle path planned for goal `{}`", goal.name)
                        }
                        None => format!("assumed, since goal `{}` has no entry", goal.name),
                    };
                    chosen.remarks.push(format!("{why}: {}", entry.in_words));
                }
                Err(NoEntry {
                    message,
                    hint,
                    nothing_serves,
                }) => {
                    let key = match goal.route {
                        Some(_) => "route",
                        None => goal.target_key(),
                    };
                    let key = format!("goals[{index}].{key}");
                    findings.push(Finding {
                        nothing_serves,
                        ..toml.finding(&key, message).hint(hint)
                    });
                }
            }
        }
        if findings.is_empty() {
            Ok(chosen)
        } else {
            Err(findings)
        }
    }
}

/// Says nothing of what is resolved.
impl PartialEq for EntryChooser {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The cell of a scenario, whose goals are still to be placed in it.
#[derive(Debug, Clone)]
pub struct OpenScenario {
    /// Everything but the goals.
    pub resolved: ResolvedScenario,
    /// The goals of the file, sound or not; one without an entry has none.
    pub goals: Vec<GoalSection>,
}

/// Places goals in the cell of a scenario, one after the other.
#[derive(Debug)]
pub struct GoalPlacer<'a> {
    resolved: &'a ResolvedScenario,
    fixtures: Vec<CollisionBody>,
    boxes: Vec<BodyBoxes>,
}

impl<'a> GoalPlacer<'a> {
    /// For the cell of a scenario; its own goals do not count.
    pub fn new(resolved: &'a ResolvedScenario) -> Self {
        let stands = |body: &&CollisionBody| {
            body.frame == Frame::World && !matches!(body.kind, BodyKind::Base | BodyKind::Phantom)
        };
        let fixtures: Vec<CollisionBody> = resolved
            .cell
            .bodies
            .iter()
            .filter(stands)
            .cloned()
            .collect();
        Self {
            resolved,
            boxes: fixtures.iter().map(BodyBoxes::new).collect(),
            fixtures,
        }
    }

    /// A goal's target, phantom frame, m.
    ///
    /// # Errors
    /// What a scenario with this goal is refused for, whatever its entry.
    pub fn target(&self, section: &GoalSection) -> Result<Point3<f64>, Finding> {
        let toml = TomlText::without_text(&self.resolved.source.file);
        let key = |name: &str| format!("goals[0].{name}");
        let Some(placed) = &self.resolved.phantom else {
            return Err(toml
                .finding("phantom", "no patient in the scenario")
                .hint("add a [phantom] section"));
        };
        if section.flange_pose.is_some() {
            let message = format!(
                "goal `{}` is a flange pose, which determines the entry",
                section.name
            );
            return Err(toml
                .finding(&key("flange_pose"), message)
                .hint("give it a `lesion` or `target_mm` instead"));
        }
        target_inside(&toml, &key, section, &placed.phantom).map(|(target, _)| target)
    }

    /// Where the bevel of a needle that bends in tissue looks; none without such a needle or a patient.
    ///
    /// # Errors
    /// A structure that the patient does not have.
    pub fn bevel(&self) -> Result<Option<BevelFacing>, Finding> {
        let toml = TomlText::without_text(&self.resolved.source.file);
        let needle = self.resolved.scenario.needle_in_tissue();
        let both = needle.zip(self.resolved.phantom.as_ref());
        both.map(|((place, block), placed)| bevel_facing(&toml, place, block, &placed.phantom))
            .transpose()
    }

    /// The goal in the world.
    ///
    /// # Errors
    /// What a scenario with this goal is refused for, with keys of the first goal and without lines.
    pub fn place(&self, section: &GoalSection) -> Result<Goal, Finding> {
        let toml = TomlText::without_text(&self.resolved.source.file);
        let surroundings = Surroundings {
            robot: &self.resolved.cell.robot,
            tool: &self.resolved.cell.tool,
            phantom: self.resolved.phantom.as_ref(),
            fixtures: &self.fixtures,
            boxes: &self.boxes,
            needle: self.resolved.needle_in_tissue(),
        };
        resolve_goal(&toml, 0, section, &surroundings, &mut Vec::new())
    }
}
