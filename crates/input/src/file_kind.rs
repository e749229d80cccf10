//! What a file is, where it was taken for something else.
//!
//! Asked when something cannot be read: a study that is given to `run` is not a scenario with an unknown key.

use std::path::Path;

use crate::Finding;
use crate::read::{read_data, read_text};

/// Kinds of files and folders that commands take or make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A scenario.
    Scenario,
    /// A study.
    Study,
    /// Thresholds of `compare`.
    Thresholds,
    /// An arm's data.
    Arm,
    /// A table of columns of a recorded log.
    LogColumns,
    /// Sizes of a phantom.
    PhantomSizes,
    /// A robot or a tool.
    Urdf,
    /// A factory calibration.
    Calibration,
    /// A surface.
    Mesh,
    /// A table of numbers, such as a recorded log.
    Table,
    /// A recorded run in an MCAP file.
    Mcap,
    /// A page.
    Page,
    /// The table of a study's results.
    StudyTable,
    /// A report of a run.
    Report,
    /// A folder with the results of a run.
    RunResults,
    /// A folder with the results of a study.
    StudyResults,
    /// A folder with the results of a replay.
    ReplayResults,
    /// Any other folder.
    Folder,
}

impl FileKind {
    /// What a file or a folder looks like, from its name and its text; `None` for what is not there and what
    /// looks like nothing known.
    pub fn of(path: &Path) -> Option<Self> {
        if path.is_dir() {
            return Some(Self::of_folder(path));
        }
        if !path.is_file() {
            return None;
        }
        let extension = path.extension().and_then(|extension| extension.to_str());
        match extension?.to_ascii_lowercase().as_str() {
            "toml" => Self::of_toml(&read_text(path).ok()?),
            "urdf" | "xacro" => Some(Self::Urdf),
            "yaml" | "yml" => Some(Self::Calibration),
            "stl" | "obj" | "dae" => Some(Self::Mesh),
            "csv" | "tsv" | "txt" => Some(Self::Table),
            "mcap" => Some(Self::Mcap),
            "html" => Some(Self::Page),
            "parquet" => Some(Self::StudyTable),
            "json" => {
                let text = String::from_utf8(read_data(path).ok()?).ok()?;
                let is_report = text.contains("\"schema_version\"") && text.contains("\"verdict\"");
                is_report.then_some(Self::Report)
            }
            _ => None,
        }
    }

    fn of_folder(path: &Path) -> Self {
        let has = |name: &str| path.join(name).is_file();
        if has("results.parquet") || has("study.json") {
            Self::StudyResults
        } else if has("replay.json") {
            Self::ReplayResults
        } else if has("report.json") {
            Self::RunResults
        } else {
            Self::Folder
        }
    }

    /// By the keys at the top that no other kind has.
    fn of_toml(text: &str) -> Option<Self> {
        let table: toml::Table = text.parse().ok()?;
        let has = |key: &str| table.contains_key(key);
        let is_study = has("factors") || table.get("scenario").is_some_and(toml::Value::is_str);
        // A study names goals of its scenario; a scenario's are tables.
        let goals = table.get("goals").and_then(toml::Value::as_array);
        let has_own_goals = goals.is_some_and(|goals| goals.iter().any(toml::Value::is_table));
        if is_study && !has_own_goals && !has("robot") {
            Some(Self::Study)
        } else if has("max_loss") {
            Some(Self::Thresholds)
        } else if has("geometry") && has("urdf") {
            Some(Self::Arm)
        } else if has("rib_height_mm") {
            Some(Self::PhantomSizes)
        } else if has("actual_q") || has("target_q") {
            Some(Self::LogColumns)
        } else if ["robot", "goals", "tool", "iso9283", "excitation"]
            .into_iter()
            .any(has)
        {
            Some(Self::Scenario)
        } else {
            None
        }
    }

    /// What it is, in words.
    fn words(self) -> &'static str {
        match self {
            Self::Scenario => "a scenario",
            Self::Study => "a study",
            Self::Thresholds => "a file of thresholds",
            Self::Arm => "arm data",
            Self::LogColumns => "a table of log columns",
            Self::PhantomSizes => "a phantom parameter file",
            Self::Urdf => "a URDF of a robot or a tool",
            Self::Calibration => "a YAML file, such as a factory calibration",
            Self::Mesh => "a surface",
            Self::Table => "a table of numbers, such as a recorded log",
            Self::Mcap => "a recorded run",
            Self::Page => "a page",
            Self::StudyTable => "the results table of a study",
            Self::Report => "the report of a run",
            Self::RunResults => "a folder with the results of a run",
            Self::StudyResults => "a folder with the results of a study",
            Self::ReplayResults => "a folder with the results of a replay",
            Self::Folder => "a folder",
        }
    }

    /// Which command or argument takes it.
    fn hint(self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::Scenario => format!("use `needlebench run {path}` or `needlebench check {path}`"),
            Self::Study => format!("use `needlebench study {path}`"),
            Self::Thresholds => format!("use `needlebench compare A B --thresholds {path}`"),
            Self::Arm => format!(
                "use `needlebench run SCENARIO --arm {path}`, or name it in a scenario: [robot] arm = \"{path}\""
            ),
            Self::LogColumns => format!("use `needlebench replay LOG --columns {path}`"),
            Self::PhantomSizes => format!("name it in a scenario: [phantom] model = \"{path}\""),
            Self::Urdf => format!(
                "use `needlebench run SCENARIO --robot {path}`, or name it in a scenario: [robot] urdf = \"{path}\""
            ),
            Self::Calibration => format!("use `needlebench run SCENARIO --calibration {path}`"),
            Self::Mesh => "name it in a scenario, as an obstacle's or a phantom's part".to_owned(),
            Self::Table => format!(
                "use `needlebench replay {path}` for the log of an arm, `needlebench iso9283 --csv {path}` for that of a laser tracker"
            ),
            Self::Mcap => format!("use `needlebench replay {path}`"),
            Self::Page => "open it in a browser".to_owned(),
            Self::StudyTable | Self::StudyResults => {
                format!(
                    "use `needlebench compare {path} B`, or open report.html there; `study` takes the study's TOML file"
                )
            }
            Self::Report | Self::RunResults => {
                format!(
                    "use `needlebench compare {path} B`, or open report.html there; `run` takes the scenario's TOML file"
                )
            }
            Self::ReplayResults => "open replay.html in it; `replay` takes the log".to_owned(),
            Self::Folder => "give a file in it".to_owned(),
        }
    }
}

impl FileKind {
    /// What a command wants, in words.
    fn wanted_words(self) -> &'static str {
        match self {
            Self::Table => "a log",
            Self::Report => "the report of a run, nor its folder",
            other => other.words(),
        }
    }
}

/// What is wrong with a file of another kind than `wanted`; `None` if it is of that kind or of none that is
/// known.
pub(crate) fn wrong_kind(path: &Path, wanted: FileKind) -> Option<Finding> {
    let kind = FileKind::of(path).filter(|kind| *kind != wanted)?;
    let message = format!("this is {}, not {}", kind.words(), wanted.wanted_words());
    Some(Finding::new(path.display().to_string(), message).hint(kind.hint(path)))
}

/// Findings about a file: if it is of another kind than `wanted`, that alone.
pub fn or_wrong_kind(path: &Path, wanted: FileKind, findings: Vec<Finding>) -> Vec<Finding> {
    wrong_kind(path, wanted).map_or(findings, |finding| vec![finding])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_apart_by_what_they_hold() {
        let kind = FileKind::of_toml;
        assert_eq!(
            kind("name = \"a\"\n[robot]\nurdf = \"ur3\""),
            Some(FileKind::Scenario)
        );
        assert_eq!(
            kind("name = \"a\"\nscenario = \"a.toml\""),
            Some(FileKind::Study)
        );
        assert_eq!(kind("[[factors]]\nname = \"a\""), Some(FileKind::Study));
        assert_eq!(
            kind("[max_loss]\nclearance = \"1mm\""),
            Some(FileKind::Thresholds)
        );
        assert_eq!(
            kind("actual_q = { unit = \"deg\" }"),
            Some(FileKind::LogColumns)
        );
        assert_eq!(kind("anything = 1"), None);
        assert_eq!(kind("not TOML"), None);
        // A scenario with a key too many is one all the same.
        assert_eq!(
            kind("[[factors]]\n[robot]\nurdf = \"ur3\""),
            Some(FileKind::Scenario)
        );
    }

    #[test]
    fn shipped_files_are_what_they_are() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        for (file, kind) in [
            ("scenarios/table3.toml", FileKind::Scenario),
            ("scenarios/iso9283.toml", FileKind::Scenario),
            ("scenarios/studies/tools.toml", FileKind::Study),
            ("models/ur3e/arm.toml", FileKind::Arm),
            ("models/ur3/ur3.urdf", FileKind::Urdf),
            ("models/chest_phantom/male-p50.toml", FileKind::PhantomSizes),
            (
                "models/ur3e/recorded/ur3e_rad_20211005.csv",
                FileKind::Table,
            ),
            ("models", FileKind::Folder),
        ] {
            assert_eq!(FileKind::of(&root.join(file)), Some(kind), "{file}");
        }
        assert_eq!(FileKind::of(&root.join("missing.toml")), None);
    }

    #[test]
    fn a_study_is_no_scenario() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let study = root.join("scenarios/studies/tools.toml");
        let finding = wrong_kind(&study, FileKind::Scenario).expect("it is another kind");
        assert_eq!(finding.message, "this is a study, not a scenario");
        assert!(
            finding
                .hint
                .is_some_and(|hint| hint.contains("needlebench study "))
        );
        assert_eq!(wrong_kind(&study, FileKind::Study), None);
    }
}
