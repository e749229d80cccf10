//! Changes of keys, applied to a scenario's struct.

use needlebench_input::schema::{Misfit, MisfitKind, Path};
use needlebench_robot::ArmInUse;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::key_path::{KeyPath, Step, section};
use super::setting::{Change, Setting, number_value};
use crate::scenario::{GoalSection, Scenario};

/// A scenario's struct, and all of it that has a value as a table, defaults included.
#[derive(Debug, Clone)]
pub(super) struct Editable {
    pub scenario: Scenario,
    table: Table,
    goals: Vec<Value>,
    /// What the scenario leaves to its arm, with the arm's values: there to be added to and changed in
    /// part.
    of_arm: Value,
}

/// A scenario with some keys changed.
#[derive(Debug)]
pub(super) struct Edited {
    pub scenario: Scenario,
    /// Values of the right type outside their ranges.
    pub out_of_range: Vec<Misfit>,
}

/// Deserialises the sections of a scenario that have been edited, by their names.
macro_rules! put_sections {
    ($scenario:ident, $name:ident, $value:ident, [$($section:ident),*]) => {
        match $name {
            $(stringify!($section) => $scenario.$section = read($name, &$value)?,)*
            _ => return Err(unknown($name, format!("`{}` cannot be changed", $name))),
        }
    };
}

impl Editable {
    /// # Errors
    /// Where the struct is no table: a bug, but one to be told of.
    pub fn new(scenario: Scenario, arm: Option<&ArmInUse>) -> Result<Self, String> {
        let as_value = |error: toml::ser::Error| error.to_string();
        let goals = scenario.goals.iter().map(Value::try_from);
        let goals = goals.collect::<Result<_, _>>().map_err(as_value)?;
        let table = Table::try_from(&scenario).map_err(as_value)?;
        let of_arm = match arm {
            Some(used) => used.arm.data.by_scenario_keys().map_err(as_value)?,
            None => Value::Table(Table::new()),
        };
        Ok(Self {
            scenario,
            table,
            goals,
            of_arm,
        })
    }

    /// The scenario with one of its goals and some keys changed, one after the other.
    /// The sections that are changed are checked like those of a file.
    ///
    /// # Errors
    /// What is no such key, or of another type than its key.
    pub fn with(&self, goal: usize, changes: &[(KeyPath, Change)]) -> Result<Edited, Misfit> {
        let mut edited: Vec<(&str, Option<Value>)> = Vec::with_capacity(changes.len());
        // Another robot has another arm's values, and not this one's.
        let is_other = changes.iter().any(|(path, _)| path.is_of_robot_model());
        let of_arm = Some(&self.of_arm).filter(|_| !is_other);
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
            let of_arm = of_arm.and_then(|values| values.get(section));
            *place = Some(changed(place.take(), of_arm, path, &path.0[1..], change)?);
        }
        let mut scenario = self.scenario.with_goal(goal);
        let mut out_of_range = Vec::new();
        for (name, value) in edited {
            let Some(value) = value else { continue };
            let node = section(name).map_err(|why| unknown(name, why))?;
            let first = out_of_range.len();
            node.check(Path::Key(&Path::Top, name), &value, &mut out_of_range);
            let wrong = |misfit: &Misfit| misfit.kind != MisfitKind::Range;
            if let Some(at) = out_of_range[first..].iter().position(wrong) {
                return Err(out_of_range.swap_remove(first + at));
            }
            if name == "goal" {
                scenario.goals = vec![read::<GoalSection>(name, &value)?];
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
                    ct,
                    table,
                    gantry,
                    obstacles,
                    iso9283,
                    excitation,
                    start,
                    motion,
                    planning,
                    controller,
                    engines,
                    criteria,
                    requirements,
                    ranking,
                    recording,
                    people,
                    expected,
                    imperfections,
                    events,
                    replay
                ]
            );
        }
        Ok(Edited {
            scenario,
            out_of_range,
        })
    }
}

fn unknown(section: &str, message: String) -> Misfit {
    Misfit {
        key: section.to_owned(),
        kind: MisfitKind::Unknown,
        message,
        hint: None,
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
            ct: self.ct.clone(),
            table: self.table.clone(),
            gantry: self.gantry.clone(),
            obstacles: self.obstacles.clone(),
            iso9283: self.iso9283.clone(),
            excitation: self.excitation.clone(),
            start: self.start.clone(),
            motion: self.motion.clone(),
            planning: self.planning.clone(),
            controller: self.controller.clone(),
            engines: self.engines.clone(),
            criteria: self.criteria.clone(),
            requirements: self.requirements.clone(),
            ranking: self.ranking.clone(),
            recording: self.recording.clone(),
            people: self.people.clone(),
            expected: self.expected.clone(),
            imperfections: self.imperfections.clone(),
            events: self.events.clone(),
            replay: self.replay.clone(),
        }
    }
}

impl KeyPath {
    /// Whether it decides whose data the robot has.
    fn is_of_robot_model(&self) -> bool {
        self.section() == "robot"
            && self.0.get(1).is_none_or(
                |key| matches!(key, Step::Name(name) if name == "urdf" || name == "arm"),
            )
    }
}

/// A value with one key inside changed; tables that are not there are made. What is not there and is
/// changed in part is `of_arm`.
fn changed(
    value: Option<Value>,
    of_arm: Option<&Value>,
    path: &KeyPath,
    steps: &[Step],
    change: &Change,
) -> Result<Value, Misfit> {
    let error = |message: String, hint: Option<String>| Misfit {
        key: path.to_string(),
        kind: MisfitKind::Type,
        message,
        hint,
    };
    let in_part = match steps {
        [] => matches!(change, Change::Add(_)),
        [Step::Index(_), ..] => true,
        [Step::Name(_), ..] => false,
    };
    let value = value.or_else(|| of_arm.filter(|_| in_part).cloned());
    match steps {
        [] => match change {
            Change::Set(Setting(setting)) => Ok(setting.clone()),
            Change::Add(number) => match value.as_ref().map(|value| Setting(value.clone())) {
                None => Err(error(
                    "no value to add to: the scenario does not give this key".to_owned(),
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
            let of_arm = of_arm.and_then(|values| values.get(name));
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
                    entry.insert(changed(Some(inner), of_arm, path, rest, change)?);
                }
                toml::map::Entry::Vacant(entry) => {
                    entry.insert(changed(None, of_arm, path, rest, change)?);
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
            *place = changed(Some(inner), None, path, rest, change)?;
            Ok(Value::Array(array))
        }
    }
}

/// The schema holds, so this fails by a mistake of ours alone.
fn read<T: DeserializeOwned>(section: &str, value: &Value) -> Result<T, Misfit> {
    needlebench_input::read_value(value).map_err(|message| Misfit {
        key: section.to_owned(),
        kind: MisfitKind::Type,
        message,
        hint: None,
    })
}
