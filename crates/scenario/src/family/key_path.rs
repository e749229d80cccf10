//! Keys of a scenario, by their path.

use std::fmt;

use crate::scenario;
use needlebench_input::schema::{Node, unit_of};

/// Name of the case's goal in paths.
const GOAL: &str = "goal";

/// A step into a table or an array.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Step {
    Name(String),
    Index(usize),
}

/// Path of a key in a scenario: `phantom.position_mm[0]`, `robot.base_position_mm`, `tool.urdf`,
/// `seed`. The case's goal, whichever it is, is `goal`: `goal.roll_deg`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct KeyPath(pub(super) Vec<Step>);

impl KeyPath {
    /// Reads a path.
    ///
    /// # Errors
    /// A message for people, where the text is no path.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut steps = Vec::new();
        for part in text.split('.') {
            let (name, mut indices) = part.split_at(part.find('[').unwrap_or(part.len()));
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if name.is_empty() || !name.chars().all(is_name) {
                return Err(format!(
                    "`{text}` is not the path of a key: names joined by dots, as in \
                     `phantom.position_mm[0]`"
                ));
            }
            steps.push(Step::Name(name.to_owned()));
            while !indices.is_empty() {
                let index = indices
                    .strip_prefix('[')
                    .and_then(|rest| rest.split_once(']'))
                    .and_then(|(index, rest)| Some((index.parse::<usize>().ok()?, rest)));
                let Some((index, rest)) = index else {
                    return Err(format!(
                        "`{text}` is not the path of a key: an index is a whole number in \
                         brackets after a name, as in `phantom.position_mm[0]`"
                    ));
                };
                steps.push(Step::Index(index));
                indices = rest;
            }
        }
        Ok(Self(steps))
    }

    /// Whether it is a key of the case's goal.
    pub(crate) fn is_of_goal(&self) -> bool {
        self.0.first() == Some(&Step::Name(GOAL.to_owned()))
    }

    /// The first name: a section of the scenario, or the goal.
    pub(super) fn section(&self) -> &str {
        match self.0.first() {
            Some(Step::Name(name)) => name,
            _ => "",
        }
    }

    /// Unit that the last name ends with, such as `mm` or `deg`; empty if it has none.
    pub fn unit(&self) -> &'static str {
        let name = self.0.iter().rev().find_map(|step| match step {
            Step::Name(name) => Some(name.as_str()),
            Step::Index(_) => None,
        });
        name.map_or("", unit_of)
    }

    /// Whether scenarios have such a key, or may have it.
    ///
    /// # Errors
    /// A message that says which part of the path is not known, and what is.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.section() == "goals" {
            return Err(format!(
                "`{self}`: the goal is a factor of its own; `goal.` stands for that of each case, as \
                 in `goal.roll_deg`"
            ));
        }
        let mut here = section(self.section()).map_err(|why| format!("`{self}`: {why}"))?;
        for step in &self.0[1..] {
            let next = match step {
                Step::Name(name) => here.key(name),
                Step::Index(index) => here.item(*index),
            };
            here = next.map_err(|why| format!("`{self}`: {why}"))?;
        }
        Ok(())
    }
}

/// What a section may hold; `goal` is any of the goals.
///
/// # Errors
/// That there is no such section, and which ones there are.
pub(super) fn section(name: &str) -> Result<&'static Node, String> {
    let file = scenario::FILE.root();
    if name == GOAL {
        file.key("goals")?.item(0)
    } else {
        file.key(name)
    }
}

impl fmt::Display for KeyPath {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, step) in self.0.iter().enumerate() {
            match step {
                Step::Name(name) if index == 0 => write!(formatter, "{name}")?,
                Step::Name(name) => write!(formatter, ".{name}")?,
                Step::Index(index) => write!(formatter, "[{index}]")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_written_as_it_was_read() {
        for text in [
            "seed",
            "phantom.position_mm[0]",
            "goal.roll_deg",
            "imperfections.registration.markers_mm[2][1]",
            "phantom.parts[0].position_mm",
        ] {
            assert_eq!(KeyPath::parse(text).unwrap().to_string(), text);
        }
        assert!(KeyPath::parse("goal.roll_deg").unwrap().is_of_goal());
        assert!(!KeyPath::parse("goals[0].roll_deg").unwrap().is_of_goal());
    }

    #[test]
    fn what_is_no_path_is_refused() {
        for text in [
            "", ".", "a.", "a..b", "[0]", "a[", "a[x]", "a[-1]", "a[0]b", "a b",
        ] {
            let message = KeyPath::parse(text).unwrap_err();
            assert!(message.contains("path of a key"), "{message}");
        }
    }

    #[test]
    fn the_unit_is_the_last_names() {
        for (text, unit) in [
            ("phantom.position_mm[0]", "mm"),
            ("phantom.head_yaw_deg", "deg"),
            ("motion.joint_velocity_deg_s", "deg/s"),
            ("tool.urdf", ""),
            ("imperfections.breathing.phase", ""),
            ("imperfections.breathing.period_s", "s"),
        ] {
            assert_eq!(KeyPath::parse(text).unwrap().unit(), unit);
        }
    }
}
