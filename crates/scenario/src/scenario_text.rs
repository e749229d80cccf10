//! A scenario as text: what differs from what is meant where a key is left out, and nothing else.

use std::path::{Component, Path, PathBuf};

use toml::{Table, Value};

use crate::scenario::Scenario;

/// Sections in the order in which people read them; all others follow by name.
const FIRST: [&str; 12] = [
    "name",
    "description",
    "seed",
    "robot",
    "mount",
    "tool",
    "phantom",
    "table",
    "gantry",
    "obstacles",
    "goals",
    "planning",
];

/// The text of a scenario. Read again it is the same scenario; what is left out has the value that it has by default.
///
/// # Errors
/// A value that TOML does not have: a bug, but one to be told of.
pub fn scenario_text(scenario: &Scenario) -> Result<String, String> {
    let words = |error: toml::ser::Error| error.to_string();
    let mut table = Table::try_from(scenario).map_err(words)?;
    let sections: Vec<String> = table.keys().cloned().collect();
    for section in sections {
        prune(&mut table, &[Step::Key(section)], scenario);
    }
    let mut text = String::new();
    let order = FIRST.iter().map(|name| (*name).to_owned());
    let others: Vec<String> = table.keys().cloned().collect();
    for name in order.chain(others) {
        let Some(value) = table.remove(&name) else {
            continue;
        };
        let is_section = matches!(&value, Value::Table(_))
            || value
                .as_array()
                .is_some_and(|list| list.iter().all(Value::is_table));
        if is_section && !text.is_empty() {
            text.push('\n');
        }
        let alone = Table::from_iter([(name, value)]);
        text.push_str(&toml::to_string(&alone).map_err(words)?);
    }
    Ok(text)
}

#[derive(Debug, Clone)]
enum Step {
    Key(String),
    At(usize),
}

/// Takes away what makes no difference, from the inside out.
fn prune(table: &mut Table, path: &[Step], scenario: &Scenario) {
    let below: Vec<Step> = match value_at(table, path) {
        Some(Value::Table(inner)) => inner.keys().cloned().map(Step::Key).collect(),
        Some(Value::Array(list)) if list.iter().any(Value::is_table) => {
            (0..list.len()).map(Step::At).collect()
        }
        _ => Vec::new(),
    };
    for step in below {
        let mut inner = path.to_vec();
        inner.push(step);
        prune(table, &inner, scenario);
    }
    if matches!(path.last(), Some(Step::At(_))) {
        return;
    }
    let mut without = table.clone();
    if remove(&mut without, path)
        && Scenario::deserialize_table(&without).as_ref() == Some(scenario)
    {
        *table = without;
    }
}

fn value_at<'t>(table: &'t Table, path: &[Step]) -> Option<&'t Value> {
    let (Step::Key(first), rest) = path.split_first()? else {
        return None;
    };
    rest.iter()
        .try_fold(table.get(first)?, |value, step| match step {
            Step::Key(key) => value.get(key),
            Step::At(index) => value.get(index),
        })
}

fn remove(table: &mut Table, path: &[Step]) -> bool {
    let Some((Step::Key(last), before)) = path.split_last() else {
        return false;
    };
    let Some((first, rest)) = before.split_first() else {
        return table.remove(last).is_some();
    };
    let Step::Key(first) = first else {
        return false;
    };
    let inner = rest
        .iter()
        .try_fold(table.get_mut(first), |value, step| {
            Some(match (value?, step) {
                (Value::Table(inner), Step::Key(key)) => inner.get_mut(key),
                (Value::Array(list), Step::At(index)) => list.get_mut(*index),
                _ => None,
            })
        })
        .flatten();
    match inner {
        Some(Value::Table(inner)) => inner.remove(last).is_some(),
        _ => false,
    }
}

impl Scenario {
    fn deserialize_table(table: &Table) -> Option<Self> {
        needlebench_input::read_table(table).ok()
    }

    /// For a file in another folder: paths of files that are relative to the folder `from` become relative to `to`.
    pub fn moved_files(&mut self, from: &Path, to: &Path) {
        let robot = &mut self.robot;
        let mut references: Vec<&mut String> = Vec::new();
        references.extend(robot.urdf.as_mut());
        references.extend(robot.arm.as_mut());
        references.extend(robot.calibration.as_mut());
        references.push(&mut self.tool.urdf);
        if let Some(phantom) = &mut self.phantom {
            references.push(&mut phantom.model);
            references.extend(phantom.parts.iter_mut().map(|part| &mut part.file));
            references.extend(phantom.build.iter_mut().map(|build| &mut build.report));
        }
        for obstacle in &mut self.obstacles {
            let shape = &mut obstacle.shape;
            let files = [&mut shape.convex, &mut shape.mesh].into_iter().flatten();
            references.extend(files.map(|stl| &mut stl.file));
        }
        let blocks = self.imperfections.as_mut();
        if let Some(calibration) = blocks.and_then(|blocks| blocks.calibration.as_mut()) {
            references.push(&mut calibration.arm);
        }
        for reference in references {
            let is_name = !reference.contains(['/', '\\'])
                && Path::new(reference.as_str()).extension().is_none();
            if !is_name
                && !reference.starts_with("builtin:")
                && Path::new(reference.as_str()).is_relative()
            {
                let file = from.join(reference.as_str());
                *reference = relative(&file, to).to_string_lossy().replace('\\', "/");
            }
        }
    }
}

/// A path as seen from a folder.
pub fn relative(path: &Path, folder: &Path) -> PathBuf {
    let absolute = |path: &Path| {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let mut parts: Vec<std::ffi::OsString> = Vec::new();
        for part in path.components() {
            match part {
                Component::ParentDir if parts.len() > 1 => {
                    parts.pop();
                }
                Component::CurDir => {}
                other => parts.push(other.as_os_str().to_owned()),
            }
        }
        parts
    };
    let (path, folder) = (absolute(path), absolute(folder));
    let shared = path.iter().zip(&folder).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return path.iter().collect();
    }
    let up = std::iter::repeat_n(std::ffi::OsString::from(".."), folder.len() - shared);
    up.chain(path[shared..].iter().cloned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::parse_scenario;

    fn parsed(text: &str) -> Scenario {
        parse_scenario("s.toml", text).unwrap()
    }

    #[test]
    fn text_is_read_as_the_same_scenario_and_has_no_defaults() {
        let text = "name = \"a\"\nseed = 3\n\n[robot]\nurdf = \"ur3\"\n\n[mount]\n\n[phantom]\nmarkers = \"ct_sphere\"\n\n\
                    [[goals]]\nentry_mm = [1.0, 2.0, 3.0]\nlesion = \"b\"\nname = \"g\"\n\n[expected.imaging]\ncovariance_mm2 = [1.0, 1.0, \
                    1.0, 0.0, 0.0, 0.0]\n";
        let scenario = parsed(text);
        assert_eq!(scenario_text(&scenario).unwrap(), text);
        for path in std::fs::read_dir("../../scenarios").unwrap() {
            let path = path.unwrap().path();
            if path.extension().is_some_and(|end| end == "toml") {
                let scenario = parsed(&std::fs::read_to_string(&path).unwrap());
                let again = parsed(&scenario_text(&scenario).unwrap());
                assert_eq!(again, scenario, "{}", path.display());
            }
        }
    }

    #[test]
    fn files_are_found_from_another_folder() {
        let mut scenario =
            parsed("[robot]\nurdf = \"../arms/a.urdf\"\n[phantom]\nmodel = \"male-p50\"\n");
        scenario.moved_files(Path::new("/lab/scenarios"), Path::new("/lab/out/x"));
        assert_eq!(scenario.robot.urdf.as_deref(), Some("../../arms/a.urdf"));
        assert_eq!(scenario.phantom.unwrap().model, "male-p50");
    }
}
