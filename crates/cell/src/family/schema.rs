//! Which keys a scenario can have.

use serde_json::Value;

use super::key_path::{KeyPath, Step};
use crate::scenario::scenario_schema;
use crate::toml_text::unknown_key_hint;

/// The JSON schema of scenarios, to look keys up in.
#[derive(Debug, Clone)]
pub(super) struct Keys(Value);

impl Keys {
    pub fn new() -> Self {
        Self(scenario_schema())
    }

    /// Whether there is such a key, in this scenario or left out of it.
    ///
    /// # Errors
    /// A message that says which part of the path is not known, and what is.
    pub fn check(&self, path: &KeyPath) -> Result<(), String> {
        let mut here = &self.0;
        for (index, step) in path.0.iter().enumerate() {
            here = if index == 0 && path.is_of_goal() {
                &self.0["properties"]["goals"]["items"]
            } else {
                Self::step(here, step).map_err(|why| format!("`{path}`: {why}"))?
            };
            if index == 0 && path.section() == "goals" {
                return Err(format!(
                    "`{path}`: the goal is a factor of its own; `goal.` stands for that of each \
                     case, as in `goal.roll_deg`"
                ));
            }
            here = self.plain(here);
        }
        Ok(())
    }

    fn step<'s>(here: &'s Value, step: &Step) -> Result<&'s Value, String> {
        match step {
            Step::Name(name) => {
                let known = here["properties"].as_object();
                if let Some(found) = known.and_then(|known| known.get(name)) {
                    return Ok(found);
                }
                let any = &here["additionalProperties"];
                if any.is_object() {
                    return Ok(any);
                }
                let names: Vec<&str> = known
                    .into_iter()
                    .flatten()
                    .map(|(name, _)| name.as_str())
                    .collect();
                let hint = unknown_key_hint(name, &names);
                Err(format!("unknown key `{name}`; {hint}"))
            }
            Step::Index(index) => {
                let items = &here["items"];
                if !items.is_object() {
                    return Err(format!("there is no [{index}]: it is not a list"));
                }
                match here["maxItems"].as_u64() {
                    Some(length) if *index as u64 >= length => Err(format!(
                        "there is no [{index}]: it has {length} numbers, the first is [0]"
                    )),
                    _ => Ok(items),
                }
            }
        }
    }

    /// A schema without its references, and without the null of what may be left out.
    fn plain<'s>(&'s self, mut here: &'s Value) -> &'s Value {
        loop {
            if let Some(reference) = here["$ref"].as_str() {
                let pointer = reference.trim_start_matches('#');
                match self.0.pointer(pointer) {
                    Some(found) => here = found,
                    None => return here,
                }
            } else if let Some(only) = ["allOf", "anyOf"].iter().find_map(|key| {
                let given = here[*key].as_array()?;
                let mut some = given.iter().filter(|each| each["type"] != "null");
                some.next().filter(|_| some.next().is_none())
            }) {
                here = only;
            } else {
                return here;
            }
        }
    }
}
