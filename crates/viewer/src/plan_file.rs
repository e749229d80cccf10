//! The plan as a scenario: the folder's own with the chosen goal, in the text that its author wrote.

use std::path::{Path, PathBuf};

use needlebench_bench::Runnable;
use needlebench_input::{Finding, read_text};
use needlebench_parallel::Control;
use needlebench_patient::ct::SCENARIO_FILE;
use needlebench_report::write_atomically;
use needlebench_scenario::scenario::GoalSection;
use needlebench_scenario::{ResolvedScenario, ScenarioEdit, resolve_scenario};
use serde::Deserialize;

use crate::case::Case;
use crate::entries::look_around;
use crate::live::{Aim, Refusal, RouteAnswer, needle, route};

/// Its default name.
pub(crate) const PLAN_FILE: &str = "planned.toml";

/// Decimals of places, mm.
const DECIMALS: usize = 6;

/// A plan as a scenario.
#[derive(Debug, Clone)]
pub struct Planned {
    /// Its text.
    pub text: String,
    /// What it says.
    pub resolved: ResolvedScenario,
    /// Which of its goals the needle is.
    pub goal: usize,
    /// Goals of the folder that it does not include, as they have no entry.
    pub left_out: Vec<String>,
}

/// What the user agreed to before a plan is written.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Consent {
    /// A file of another text may be overwritten.
    pub overwrite: bool,
    /// The needle may be a rejected one; the file is marked so.
    pub refused: bool,
}

/// A plan that was written.
#[derive(Debug, Clone)]
pub struct Written {
    /// Its file.
    pub path: PathBuf,
    /// Goals of the folder that it does not include.
    pub left_out: Vec<String>,
    /// Why its needle is rejected, where it is.
    pub refusal: Option<String>,
}

/// Why a plan was not written.
#[derive(Debug, Clone)]
pub enum NotWritten {
    /// It cannot be.
    Refused(Refusal),
    /// There is a file of its name with another text.
    Exists {
        /// The file.
        file: String,
        /// A name that no file has.
        free: String,
    },
    /// The needle is rejected.
    NotAllowed(String),
}

impl From<Refusal> for NotWritten {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

/// Writes the plan into the case's folder as `NAME.toml`.
///
/// It is a scenario for [`needlebench run`], resolved and checked before. A rejected needle is marked in the file.
///
/// # Errors
/// An invalid name; what keeps the plan from being run; a file that cannot be written; a missing consent.
pub fn write_plan(
    case: &Case,
    aim: &Aim,
    configuration: Option<&str>,
    name: &str,
    consent: Consent,
    control: &Control<'_>,
) -> Result<Written, NotWritten> {
    let file = file_name(name)?;
    let path = case.folder().join(&file);
    look_around(case, &aim.goal_aim(), control)?;
    let RouteAnswer {
        refusal, judged, ..
    } = route(case, aim)?;
    if let Some(refusal) = refusal.as_ref().filter(|_| !consent.refused) {
        return Err(NotWritten::NotAllowed(refusal.clone()));
    }
    let remark = match (&refusal, judged) {
        (Some(why), _) => Some(format!("REJECTED: {why}")),
        // The scan has no voxels around its target, or they could not be read.
        (None, None) => {
            Some("not evaluated by the path rules, only by its distance from tissues".to_owned())
        }
        (None, Some(_)) => None,
    };
    let plan = planned(case, aim, configuration, remark.as_deref(), &path)?;
    Runnable::checked(plan.resolved).map_err(Refusal::from)?;
    if !consent.overwrite && path.exists() && read_text(&path).ok().as_ref() != Some(&plan.text) {
        return Err(NotWritten::Exists {
            free: free_name(case.folder(), &file),
            file,
        });
    }
    write_atomically(&path, plan.text.as_bytes()).map_err(|error| Refusal {
        message: format!("the plan cannot be written: {error}"),
        hint: Some(
            "the folder may have been moved or deleted since the page was opened".to_owned(),
        ),
    })?;
    Ok(Written {
        path,
        left_out: plan.left_out,
        refusal,
    })
}

/// `planned-2` where there is a `planned.toml`.
fn free_name(folder: &Path, file: &str) -> String {
    let stem = file.strip_suffix(".toml").unwrap_or(file);
    let base = stem.rsplit_once('-').map_or(stem, |(base, number)| {
        if number.parse::<u32>().is_ok() {
            base
        } else {
            stem
        }
    });
    (2..u32::MAX)
        .map(|number: u32| format!("{base}-{number}"))
        .find(|name| !folder.join(format!("{name}.toml")).exists())
        .expect("a folder has few files")
}

/// The text of the plan for a file, with a remark on its needle, and what it is as a scenario. Other goals of the
/// folder without an entry are left out: a plan has the needles that were planned.
///
/// # Errors
/// What makes it an invalid scenario.
pub fn planned(
    case: &Case,
    aim: &Aim,
    configuration: Option<&str>,
    remark: Option<&str>,
    path: &Path,
) -> Result<Planned, Refusal> {
    let needle = needle(case, aim)?;
    // The words of a goal that cannot be placed are those of the page, not of a file's line.
    needle.goal?;
    let source = case.folder().join(SCENARIO_FILE);
    let file = source.display().to_string();
    let text = read_text(&source).map_err(|error| Refusal {
        message: format!("{SCENARIO_FILE} cannot be read: {error}"),
        hint: Some(
            "the folder may have been moved or deleted since the page was opened".to_owned(),
        ),
    })?;
    // The needle is of the scan that the page shows.
    case.built().check_unchanged()?;
    let mut edit = ScenarioEdit::new(&file, &text)?;
    edit_goal(&mut edit, case, &needle.section, configuration, remark)?;
    let is_open = |goal: &GoalSection| {
        goal.name != needle.section.name
            && goal.entry_mm.is_none()
            && goal.entry_direction_deg.is_none()
            && goal.flange_pose.is_none()
            && goal.route.is_none()
    };
    let mut left_out = Vec::new();
    // The last first: those after one that goes count one less.
    for (index, goal) in case.goals().iter().enumerate().rev() {
        if is_open(goal) {
            edit.remove_section(&format!("goals[{index}]"))?;
            left_out.insert(0, goal.name.clone());
        }
    }
    edit.name_after(path)?;
    let to = path.display().to_string();
    let resolved =
        resolve_scenario(&to, edit.text(), case.folder(), case.overrides()).map_err(first)?;
    let goal = resolved
        .goals
        .iter()
        .position(|goal| goal.name == needle.section.name);
    Ok(Planned {
        text: edit.text().to_owned(),
        goal: goal.expect("the plan has it"),
        resolved,
        left_out,
    })
}

/// The file of a name within the folder: never another folder's, and none that is reserved.
fn file_name(name: &str) -> Result<String, Refusal> {
    let stem = name.strip_suffix(".toml").unwrap_or(name);
    let is_plain = stem
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
    if stem.is_empty() || stem.len() > 64 || !is_plain {
        return Err(Refusal {
            message: "invalid name of a plan".to_owned(),
            hint: Some("use at most 64 letters, digits, `-` and `_`".to_owned()),
        });
    }
    if ["scenario", "session"].contains(&stem.to_ascii_lowercase().as_str()) {
        return Err(Refusal {
            message: format!("{stem}.toml is reserved"),
            hint: Some("choose another name".to_owned()),
        });
    }
    Ok(format!("{stem}.toml"))
}

fn edit_goal(
    edit: &mut ScenarioEdit,
    case: &Case,
    section: &GoalSection,
    configuration: Option<&str>,
    remark: Option<&str>,
) -> Result<(), Finding> {
    let own = case
        .goals()
        .iter()
        .position(|goal| goal.name == section.name);
    let index = own.unwrap_or(case.goals().len());
    let at = format!("goals[{index}]");
    let former = own.map(|index| &case.goals()[index]);
    let same_target = former.is_some_and(|former| {
        former.lesion.is_some()
            && former.lesion == section.lesion
            && former.target_offset_mm.is_none()
    });
    if former.is_none() {
        edit.set(&at, "name", &format!("\"{}\"", section.name))?;
    }
    if !same_target {
        // What was said of the former target does not hold for another one.
        for key in ["lesion", "target_mm", "target_offset_mm", "true_target_mm"] {
            edit.remove(&at, key)?;
        }
        match (&section.lesion, section.target_mm) {
            (Some(lesion), _) => edit.set(&at, "lesion", &format!("\"{lesion}\""))?,
            (None, Some(target)) => edit.set(&at, "target_mm", &in_mm(target))?,
            (None, None) => {}
        }
    }
    for key in [
        "entry_mm",
        "entry_direction_deg",
        "insertion_length_mm",
        "expected",
    ] {
        edit.remove(&at, key)?;
    }
    let chosen = configuration.map_or(String::new(), |label| format!(", for {label}"));
    let remark = remark.map_or(String::new(), |remark| format!("; {remark}"));
    let entry = in_mm(section.entry_mm.unwrap_or_default());
    edit.set(
        &at,
        "entry_mm",
        &format!("{entry} # chosen on the planning page{chosen}{remark}"),
    )?;
    if former.is_none() {
        edit.set(&at, "standoff_mm", &format!("{:?}", section.standoff_mm))?;
    }
    Ok(())
}

fn in_mm(place: [f64; 3]) -> String {
    let [x, y, z] = place.map(|number| format!("{:.DECIMALS$}", number + 0.0));
    format!("[{x}, {y}, {z}]")
}

fn first(findings: Vec<Finding>) -> Refusal {
    let first = findings.into_iter().next();
    first.map_or_else(
        || Refusal {
            message: "the plan cannot be resolved".to_owned(),
            hint: None,
        },
        Refusal::from,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_within_the_folder() {
        assert_eq!(file_name("planned").unwrap(), "planned.toml");
        assert_eq!(file_name("left-2.toml").unwrap(), "left-2.toml");
        for wrong in [
            "",
            "../x",
            "a/b",
            "a\\b",
            "..",
            "scenario",
            "Session.toml",
            ".toml",
            "a b",
            "x\0",
        ] {
            assert!(file_name(wrong).is_err(), "{wrong:?}");
        }
    }
}
