//! Which engines there are.

use crate::{Engine, mujoco, rapier};

/// All engines, in the order in which results list them.
///
/// An engine is a module of this crate and a line here.
pub const ENGINES: &[&dyn Engine] = &[&rapier::Rapier, &mujoco::Mujoco];

/// A name that no engine has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no engine `{name}`; the engines are {}", known.join(", "))]
pub struct UnknownEngine {
    /// The name.
    pub name: String,
    /// Names that there are.
    pub known: Vec<&'static str>,
}

/// Names of engines.
pub fn engine_names(engines: &[&'static dyn Engine]) -> Vec<&'static str> {
    engines.iter().map(|engine| engine.name()).collect()
}

/// Those of `known` that are named, each once and in the order of `known`; those that run by default
/// if no names are given.
///
/// # Errors
/// The first name that no engine has.
pub fn choose_engines<S: AsRef<str>>(
    known: &[&'static dyn Engine],
    names: Option<&[S]>,
) -> Result<Vec<&'static dyn Engine>, UnknownEngine> {
    let Some(names) = names else {
        let by_default = known.iter().filter(|engine| engine.runs_by_default());
        return Ok(by_default.copied().collect());
    };
    let is_known = |name: &str| known.iter().any(|engine| engine.name() == name);
    if let Some(unknown) = names.iter().find(|name| !is_known(name.as_ref())) {
        return Err(UnknownEngine {
            name: unknown.as_ref().to_owned(),
            known: engine_names(known),
        });
    }
    let is_named = |engine: &&&dyn Engine| names.iter().any(|name| name.as_ref() == engine.name());
    Ok(known.iter().filter(is_named).copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the first two, however many there are.
    fn chosen(names: Option<&[&str]>) -> Result<Vec<&'static str>, UnknownEngine> {
        choose_engines(&ENGINES[..2], names).map(|engines| engine_names(&engines))
    }

    #[test]
    fn engines_are_chosen_once_and_in_the_order_of_the_registry() {
        assert_eq!(chosen(None), Ok(vec!["rapier", "mujoco"]));
        assert_eq!(chosen(Some(&["mujoco"])), Ok(vec!["mujoco"]));
        let all = ["mujoco", "rapier", "mujoco"];
        assert_eq!(chosen(Some(&all)), Ok(vec!["rapier", "mujoco"]));
    }

    #[test]
    fn name_of_no_engine_is_refused() {
        let error = chosen(Some(&["rapier", "bullet"])).unwrap_err();
        assert_eq!(
            error.to_string(),
            "there is no engine `bullet`; the engines are rapier, mujoco"
        );
    }

    #[test]
    fn names_are_unique_and_fit_for_files() {
        let names = engine_names(ENGINES);
        for (at, name) in names.iter().enumerate() {
            assert!(!names[..at].contains(name), "{name}");
            let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
            assert!(!name.is_empty() && name.chars().all(fits), "{name}");
        }
    }
}
