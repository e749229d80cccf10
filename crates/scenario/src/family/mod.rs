//! One scenario, varied: many layouts of which each differs in a few keys.

mod edit;
mod key_path;
mod moves;
mod setting;

use std::path::{Path, PathBuf};

pub use key_path::KeyPath;
pub use moves::{MovedPhantom, PhantomMove, PhantomMoves, SHIFT_KEYS, TURN_KEYS};
pub use setting::{Change, Setting};

use crate::resolve::{ChosenEntries, Extent, ModelLibrary, resolve};
use crate::scenario::{GoalSection, Scenario};
use crate::{Overrides, ResolvedScenario, load_scenario};
use edit::{Editable, Edited};
use needlebench_input::schema::Misfit;
use needlebench_input::{Finding, TomlText, nearest_name};

/// A scenario of which layouts are made by changing keys.
///
/// What [`ScenarioFamily::vary`] gives is what the scenario's file would give with those keys
/// changed in it, but for the hash of the file, which stays that of the file as it is.
#[derive(Debug)]
pub struct ScenarioFamily {
    base: ResolvedScenario,
    editable: Editable,
    folder: PathBuf,
    overrides: Overrides,
    library: ModelLibrary,
}

/// Rejects a cell with parts without collision shape: its cases could not be evaluated.
fn all_seen(resolved: &ResolvedScenario) -> Result<(), Vec<Finding>> {
    let mut names: Vec<&str> = resolved
        .cell
        .unseen
        .values()
        .flatten()
        .map(String::as_str)
        .collect();
    names.sort_unstable();
    names.dedup();
    if names.is_empty() {
        return Ok(());
    }
    let message = format!("no collision shape for {}", names.join(", "));
    Err(vec![
        Finding::new(&resolved.robot_description.source.file, message).hint(
            "give the link a <collision>; for one that needs none, set in the scenario: `shape.NAME = \"none\"` \
             under [robot] or [tool]",
        ),
    ])
}

impl ScenarioFamily {
    /// Reads and resolves a scenario file.
    ///
    /// # Errors
    /// As [`load_scenario`], and parts without a shape, of whose clearance nothing is known.
    pub fn load(path: &Path, overrides: &Overrides) -> Result<Self, Vec<Finding>> {
        let base = load_scenario(path, overrides)?;
        Self::of(base, path.parent().unwrap_or(Path::new("")), overrides)
    }

    /// Of a scenario that was resolved with these overrides; `folder` is the one that its paths are relative to.
    ///
    /// # Errors
    /// Where its values cannot be changed: a bug, but one to be told of.
    pub fn of(
        base: ResolvedScenario,
        folder: &Path,
        overrides: &Overrides,
    ) -> Result<Self, Vec<Finding>> {
        all_seen(&base)?;
        let arm = base.robot_description.arm.as_ref();
        let editable = Editable::new(base.scenario.clone(), arm)
            .map_err(|error| vec![Finding::new(&base.source.file, error)])?;
        Ok(Self {
            base,
            editable,
            folder: folder.to_owned(),
            overrides: overrides.clone(),
            library: ModelLibrary::default(),
        })
    }

    /// The scenario as it stands in its file, with all its goals.
    pub fn base(&self) -> &ResolvedScenario {
        &self.base
    }

    /// What replaces parts of its files.
    pub fn overrides(&self) -> &Overrides {
        &self.overrides
    }

    /// Names of its goals, in the order of the file.
    pub fn goals(&self) -> impl ExactSizeIterator<Item = &str> {
        let goals = self.editable.scenario.goals.iter();
        goals.map(|goal| goal.name.as_str())
    }

    /// The scenario with one goal alone and some keys changed, one after the other.
    ///
    /// # Errors
    /// What is wrong with the layout, with keys and values; there are no lines, since no text has
    /// these values.
    pub fn vary(
        &self,
        goal: &str,
        changes: &[(KeyPath, Change)],
    ) -> Result<ResolvedScenario, Vec<Finding>> {
        let (resolved, chosen) = self.varied(goal, changes, None)?;
        Ok(chosen.planned.put_back(resolved))
    }

    /// As [`ScenarioFamily::vary`], with the entry that was chosen in the section of an open goal, and what was chosen. With
    /// an `entry`, deg, none is to be chosen.
    fn varied(
        &self,
        goal: &str,
        changes: &[(KeyPath, Change)],
        entry: Option<[f64; 2]>,
    ) -> Result<(ResolvedScenario, ChosenEntries), Vec<Finding>> {
        let file = &self.base.source.file;
        let index = self
            .goal(goal)
            .map_err(|message| vec![Finding::new(file, message).key("goal")])?;
        let finding = |misfit: Misfit| Finding {
            hint: misfit.hint,
            ..Finding::new(file, misfit.message).key(misfit.key)
        };
        let Edited {
            scenario,
            out_of_range,
        } = self
            .editable
            .with(index, changes)
            .map_err(|misfit| vec![finding(misfit)])?;
        if !out_of_range.is_empty() {
            return Err(out_of_range.into_iter().map(finding).collect());
        }
        let toml = TomlText::without_text(file);
        let resolved = |scenario: Scenario, extent: Extent| {
            let source = self.base.source.clone();
            let made = resolve(
                &toml,
                scenario,
                source,
                &self.folder,
                &self.overrides,
                &self.library,
                extent,
            )?;
            all_seen(&made)?;
            Ok::<_, Vec<Finding>>(made)
        };
        let mut scenario = scenario;
        if let (Some(goal), Some(entry)) = (scenario.goals.first_mut(), entry) {
            goal.entry_direction_deg = Some(entry);
            goal.route = None;
        }
        let none = ChosenEntries::default;
        let Some(chooser) = &self.overrides.choose_entry else {
            return Ok((resolved(scenario, Extent::Whole)?, none()));
        };
        if !scenario.goals.iter().any(GoalSection::is_open) {
            return Ok((resolved(scenario, Extent::Whole)?, none()));
        }
        // Routes are planned for each layout.
        let empty = Scenario {
            goals: Vec::new(),
            ..scenario.clone()
        };
        let chosen = chooser.choose(
            &toml,
            &resolved(empty, Extent::WithoutGoals)?,
            &mut scenario.goals,
        )?;
        Ok((resolved(scenario, Extent::Whole)?, chosen))
    }

    /// Whether the scenario has such a key, and the change fits its type, for every goal. A value out of
    /// its range fits here: with it a layout is impossible.
    ///
    /// # Errors
    /// What does not fit, and what would.
    pub fn check(&self, path: &KeyPath, change: &Change) -> Result<(), String> {
        path.check()?;
        let goals = if path.is_of_goal() {
            self.editable.scenario.goals.len()
        } else {
            1
        };
        let changes = [(path.clone(), change.clone())];
        for index in 0..goals {
            self.editable.with(index, &changes).map_err(|misfit| {
                let Misfit {
                    key, message, hint, ..
                } = misfit;
                let hint = hint.map_or(String::new(), |hint| format!("; {hint}"));
                if message.contains(&key) {
                    format!("{message}{hint}")
                } else {
                    format!("`{key}`: {message}{hint}")
                }
            })?;
        }
        Ok(())
    }

    fn goal(&self, name: &str) -> Result<usize, String> {
        self.goals().position(|goal| goal == name).ok_or_else(|| {
            let hint = match nearest_name(name, self.goals()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("it has {}", self.goals().collect::<Vec<_>>().join(", ")),
            };
            format!("the scenario has no goal `{name}`; {hint}")
        })
    }
}
