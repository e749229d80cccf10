//! The argument `--engine`.

use std::ffi::OsStr;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, Error};
use needlebench_engine::{ENGINES, choose_engines, engine_names};
use needlebench_input::nearest_name;
use needlebench_scenario::scenario::EngineName;

/// All engines that run by default.
const BOTH: &str = "both";

/// Names of engines: one, several between commas, or `both`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct EngineArgument(Vec<EngineName>);

impl EngineArgument {
    /// The names.
    pub(crate) fn names(&self) -> Vec<EngineName> {
        self.0.clone()
    }
}

/// Parses names of existing engines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EngineParser;

fn possible() -> Vec<&'static str> {
    let mut names = engine_names(ENGINES);
    names.push(BOTH);
    names
}

fn read(text: &str) -> Option<EngineArgument> {
    if text == BOTH {
        let by_default = choose_engines::<&str>(ENGINES, None).ok()?;
        let names = engine_names(&by_default);
        return Some(EngineArgument(names.into_iter().map(Into::into).collect()));
    }
    let names: Vec<&str> = text.split(',').map(str::trim).collect();
    choose_engines(ENGINES, Some(&names)).ok()?;
    Some(EngineArgument(names.into_iter().map(Into::into).collect()))
}

impl TypedValueParser for EngineParser {
    type Value = EngineArgument;

    fn parse_ref(
        &self,
        command: &Command,
        argument: Option<&Arg>,
        value: &OsStr,
    ) -> Result<EngineArgument, Error> {
        let text = value.to_string_lossy();
        read(&text).ok_or_else(|| {
            let mut error = Error::new(ErrorKind::InvalidValue).with_cmd(command);
            let argument = argument.map_or_else(|| "--engine".to_owned(), ToString::to_string);
            let strings = |names: Vec<&str>| {
                ContextValue::Strings(names.into_iter().map(str::to_owned).collect())
            };
            error.insert(ContextKind::InvalidArg, ContextValue::String(argument));
            let given = ContextValue::String(text.to_string());
            error.insert(ContextKind::InvalidValue, given);
            error.insert(ContextKind::ValidValue, strings(possible()));
            if let Some(near) = nearest_name(&text, possible()) {
                let near = ContextValue::String(near.to_owned());
                error.insert(ContextKind::SuggestedValue, near);
            }
            error
        })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue>>> {
        Some(Box::new(possible().into_iter().map(PossibleValue::new)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Option<Vec<String>> {
        let names = read(text)?.names();
        Some(names.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn engines_are_one_several_or_both() {
        let named = |names: &[&str]| Some(names.iter().map(ToString::to_string).collect());
        assert_eq!(names("mujoco"), named(&["mujoco"]));
        assert_eq!(names("both"), named(&["rapier", "mujoco"]));
        assert_eq!(names("mujoco, rapier"), named(&["mujoco", "rapier"]));
        for text in ["", "bullet", "rapier,", "rapier,bullet", "Rapier"] {
            assert_eq!(names(text), None, "{text}");
        }
    }
}
