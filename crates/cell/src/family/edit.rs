//! Changes of keys, applied to a scenario's struct.

use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::key_path::{KeyPath, Step};
use super::setting::{Change, Setting, number_value};
use crate::scenario::{GoalSection, Scenario};
use crate::toml_text::Misfit;

/// Why a change cannot be made.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EditError {
    /// The key at fault.
    pub key: String,
    /// What is wrong with its value.
    pub message: String,
    /// How to mend it.
    pub hint: Option<String>,
}

/// A scenario's struct, and all of it that has a value as a table, defaults included.
#[derive(Debug, Clone)]
pub(super) struct Editable {
    pub scenario: Scenario,
    table: Table,
    goals: Vec<Value>,
}

/// Deserialises the sections of a scenario that have been edited, by their names.
macro_rules! put_sections {
    ($scenario:ident, $name:ident, $value:ident, [$($section:ident),*]) => {
        match $name {
            $(stringify!($section) => $scenario.$section = read($name, $value)?,)*
            _ => {
                return Err(EditError {
                    key: $name.to_owned(),
                    message: format!("unknown key `{}`", $name),
                    hint: None,
                });
            }
        }
    };
}

impl Editable {
    /// # Errors
    /// Where the struct is no table: a bug, but one to be told of.
    pub fn new(scenario: Scenario) -> Result<Self, String> {
        let as_value = |error: toml::ser::Error| error.to_string();
        let goals = scenario.goals.iter().map(Value::try_from);
        let goals = goals.collect::<Result<_, _>>().map_err(as_value)?;
        let table = Table::try_from(&scenario).map_err(as_value)?;
        Ok(Self {
            scenario,
            table,
            goals,
        })
    }

    /// The scenario with one of its goals and some keys changed, one after the other.
    pub fn with(&self, goal: usize, changes: &[(KeyPath, Change)]) -> Result<Scenario, EditError> {
        let mut edited: Vec<(&str, Option<Value>)> = Vec::with_capacity(changes.len());
        for (path, change) in changes {
            let section = path.section();
            let index = edited.iter().position(|(name, _)| *name == section);
            let index = index.unwrap_or_else(|| {
                let value = if path.is_of_goal() {
                    self.goals.get(goal)
                } else {
                    self.table.get(section)
                };
                edited.push((section, value.cloned()));
                edited.len() - 1
            });
            let place = &mut edited[index].1;
            *place = Some(changed(place.take(), path, &path.0[1..], change)?);
        }
        let mut scenario = self.scenario.with_goal(goal);
        for (name, value) in edited {
            let Some(value) = value else { continue };
            if name == "goal" {
                scenario.goals = vec![read::<GoalSection>(name, value)?];
                continue;
            }
            put_sections!(
                scenario,
                name,
                value,
                [
                    name,
                    description,
                    seed,
                    robot,
                    mount,
                    tool,
                    phantom,
                    table,
                    gantry,
                    iso9283,
                    start,
                    motion,
                    planning,
                    controller,
                    engines,
                    criteria,
                    ranking,
                    recording,
                    people,
                    imperfections,
                    events
                ]
            );
        }
        Ok(scenario)
    }
}

impl Scenario {
    /// Without its other goals.
    fn with_goal(&self, goal: usize) -> Self {
        Self {
            goals: self.goals.get(goal).cloned().into_iter().collect(),
            name: self.name.clone(),
            description: self.description.clone(),
            seed: self.seed,
            robot: self.robot.clone(),
            mount: self.mount.clone(),
            tool: self.tool.clone(),
            phantom: self.phantom.clone(),
            table: self.table.clone(),
            gantry: self.gantry.clone(),
            iso9283: self.iso9283.clone(),
            start: self.start.clone(),
            motion: self.motion.clone(),
            planning: self.planning.clone(),
            controller: self.controller.clone(),
            engines: self.engines.clone(),
            criteria: self.criteria.clone(),
            ranking: self.ranking.clone(),
            recording: self.recording.clone(),
            people: self.people.clone(),
            imperfections: self.imperfections.clone(),
            events: self.events.clone(),
        }
    }
}

impl KeyPath {
    /// The first name: a section of the scenario, or the goal.
    pub(super) fn section(&self) -> &str {
        match self.0.first() {
            Some(Step::Name(name)) => name,
            _ => "",
        }
    }
}

/// A value with one key inside changed; tables that are not there are made.
fn changed(
    value: Option<Value>,
    path: &KeyPath,
    steps: &[Step],
    change: &Change,
) -> Result<Value, EditError> {
    let error = |message: String, hint: Option<String>| EditError {
        key: path.to_string(),
        message,
        hint,
    };
    match steps {
        [] => match change {
            Change::Set(Setting(setting)) => Ok(setting.clone()),
            Change::Add(number) => match value.as_ref().map(|value| Setting(value.clone())) {
                None => Err(error(
                    "there is nothing to add to: the scenario does not give this key".to_owned(),
                    Some("give it there, or give the values themselves".to_owned()),
                )),
                Some(setting) => setting.number().map_or_else(
                    || {
                        let message = format!("{number} cannot be added to `{setting}`");
                        Err(error(message, Some("only numbers have sums".to_owned())))
                    },
                    |base| Ok(number_value(base + number)),
                ),
            },
        },
        [Step::Name(name), rest @ ..] => {
            let mut table = match value {
                None => Table::new(),
                Some(Value::Table(table)) => table,
                Some(other) => {
                    let message = format!("`{}` is no table", Setting(other));
                    return Err(error(message, None));
                }
            };
            match table.entry(name.clone()) {
                toml::map::Entry::Occupied(mut entry) => {
                    let inner = std::mem::replace(entry.get_mut(), Value::Boolean(false));
                    entry.insert(changed(Some(inner), path, rest, change)?);
                }
                toml::map::Entry::Vacant(entry) => {
                    entry.insert(changed(None, path, rest, change)?);
                }
            }
            Ok(Value::Table(table))
        }
        [Step::Index(index), rest @ ..] => {
            let Some(Value::Array(mut array)) = value else {
                return Err(error(
                    "the scenario gives no list here".to_owned(),
                    Some("set the whole list".to_owned()),
                ));
            };
            let length = array.len();
            let Some(place) = array.get_mut(*index) else {
                return Err(error(
                    format!("there is no [{index}]: the list has {length}"),
                    Some("the first one is [0]".to_owned()),
                ));
            };
            let inner = std::mem::replace(place, Value::Boolean(false));
            *place = changed(Some(inner), path, rest, change)?;
            Ok(Value::Array(array))
        }
    }
}

fn read<T: DeserializeOwned>(section: &str, value: Value) -> Result<T, EditError> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let joined = match path.as_str() {
            "." => section.to_owned(),
            rest if rest.starts_with('[') => format!("{section}{rest}"),
            rest => format!("{section}.{rest}"),
        };
        let Misfit { key, message, hint } = Misfit::read(joined, error.inner().message());
        EditError { key, message, hint }
    })
}
