//! The user's decisions, saved in the folder from one run of the program to the next.
//!
//! A session has a version. Each write names the version that was read: the second of two pages that change the same
//! version is rejected, and loses nothing.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use needlebench_input::{Finding, from_toml, to_toml};
use needlebench_patient::ct::SESSION_FILE;
use needlebench_report::write_atomically;
use serde::{Deserialize, Serialize};

use crate::live::{Aim, EntryAim, TargetAim};

/// Version of the file's layout.
const SCHEMA_VERSION: u32 = 1;
/// Most characters of notes.
const MOST_NOTES: usize = 20_000;
/// Most characters of a name.
const MOST_NAME: usize = 64;
/// Most routes that are kept.
const MOST_ROUTES: usize = 20;
/// Farthest place, m or voxels.
const FAR: f64 = 1e5;

/// The user's decisions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// Of the layout.
    schema_version: u32,
    /// Counts the changes.
    pub version: u64,
    /// SHA-256 of the `report.json` that it is about; none in sessions of folders that were built before it was kept.
    #[serde(default)]
    build_sha256: Option<String>,
    /// Everything else.
    #[serde(flatten)]
    pub state: State,
}

/// What a session is about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct State {
    /// Notes.
    #[serde(default)]
    pub notes: String,
    /// Least and most Hounsfield units of what is shown.
    #[serde(default)]
    pub window_hu: Option<[f64; 2]>,
    /// Voxel of the crosshair.
    #[serde(default)]
    pub crosshair: Option<[f64; 3]>,
    /// Markers that are not shown.
    #[serde(default)]
    pub hidden_markers: Vec<String>,
    /// The needle.
    #[serde(default)]
    pub needle: NeedleChoice,
    /// Routes that are kept, to be compared.
    #[serde(default)]
    pub routes: Vec<KeptRoute>,
}

/// A needle, as far as it is chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct NeedleChoice {
    /// The scenario's goal that it is for.
    #[serde(default)]
    pub goal: Option<String>,
    /// Its target.
    #[serde(default)]
    pub target: Option<TargetAim>,
    /// Its entry.
    #[serde(default)]
    pub entry: Option<EntryAim>,
    /// Label of the configuration.
    #[serde(default)]
    pub configuration: Option<String>,
}

/// A route that is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptRoute {
    /// Its name.
    pub name: String,
    /// Its needle.
    pub needle: NeedleChoice,
}

impl NeedleChoice {
    /// The needle, if both its ends are chosen.
    pub fn aim(&self) -> Option<Aim> {
        Some(Aim {
            goal: self.goal.clone(),
            target: self.target.clone()?,
            entry: self.entry.clone()?,
        })
    }

    fn problem(&self) -> Option<String> {
        let names = [&self.goal, &self.configuration].into_iter().flatten();
        let mut long = names.filter(|name| name.chars().count() > MOST_NAME);
        if let Some(name) = long.next() {
            return Some(format!(
                "a name has {} characters, at most {MOST_NAME} allowed",
                name.chars().count()
            ));
        }
        let far = match &self.target {
            Some(TargetAim::PlaceM(place) | TargetAim::Index(place)) => is_far(place),
            Some(TargetAim::Lesion(name)) => name.chars().count() > MOST_NAME,
            None => false,
        } || match &self.entry {
            Some(EntryAim::PlaceM(place) | EntryAim::Index(place)) => is_far(place),
            None => false,
        };
        far.then(|| "a position requires three finite numbers".to_owned())
    }
}

impl State {
    /// What is wrong with it, if anything is.
    fn problem(&self) -> Option<String> {
        let count = self.notes.chars().count();
        if count > MOST_NOTES {
            return Some(format!(
                "the notes have {count} characters, at most {MOST_NOTES} allowed"
            ));
        }
        if self.routes.len() > MOST_ROUTES {
            return Some(format!(
                "{} paths are kept, at most {MOST_ROUTES} allowed",
                self.routes.len()
            ));
        }
        let named = self
            .hidden_markers
            .iter()
            .chain(self.routes.iter().map(|route| &route.name));
        if named.clone().any(|name| name.chars().count() > MOST_NAME) || named.count() > 256 {
            return Some(format!("names have at most {MOST_NAME} characters"));
        }
        if let Some([low, high]) = self.window_hu
            && !(low < high && low > -40_000.0 && high < 40_000.0)
        {
            return Some("a window needs two ascending HU values".to_owned());
        }
        if self.crosshair.is_some_and(|place| is_far(&place)) {
            return Some("the crosshair needs three finite numbers".to_owned());
        }
        let needles = self.routes.iter().map(|route| &route.needle);
        needles
            .chain([&self.needle])
            .find_map(NeedleChoice::problem)
    }
}

/// Why a session was not saved.
#[derive(Debug, Clone, PartialEq)]
pub enum NotKept {
    /// It was changed elsewhere: its present state.
    Changed(Box<Session>),
    /// What is wrong with it.
    Wrong(String),
    /// It cannot be read or written.
    Folder(String),
}

/// The session of a folder.
#[derive(Debug)]
pub struct SessionFile {
    path: PathBuf,
    build_sha256: String,
}

impl SessionFile {
    /// Of a folder whose `report.json` has this SHA-256; a new one if there is none.
    pub fn new(folder: &Path, build_sha256: &str) -> Self {
        Self {
            path: folder.join(SESSION_FILE),
            build_sha256: build_sha256.to_owned(),
        }
    }

    /// As the folder has it.
    ///
    /// # Errors
    /// A file that is no session, or cannot be read.
    pub fn read(&self) -> Result<Session, Finding> {
        let file = self.path.display().to_string();
        let text = match fs::read_to_string(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::NotFound && self.folder_is_there() => {
                return Ok(Session {
                    schema_version: SCHEMA_VERSION,
                    version: 0,
                    build_sha256: Some(self.build_sha256.clone()),
                    state: State::default(),
                });
            }
            Err(error) => {
                return Err(Finding::new(file, format!("cannot be read: {error}")));
            }
        };
        let hint = "rename it to start a new session";
        let session: Session = from_toml(&file, &text).map_err(|finding| finding.hint(hint))?;
        if session.schema_version != SCHEMA_VERSION {
            return Err(Finding::new(
                file,
                format!("unsupported version {}", session.schema_version),
            )
            .key("schema_version")
            .hint(hint));
        }
        let is_other = |known: &String| *known != self.build_sha256;
        if session.build_sha256.as_ref().is_some_and(is_other) {
            return Err(Finding::new(file, "this is the session of another build")
                .key("build_sha256")
                .hint(
                    "its positions are those of another scan or registration: move the file away",
                ));
        }
        match session.state.problem() {
            Some(problem) => Err(Finding::new(file, problem).hint(hint)),
            None => Ok(session),
        }
    }

    /// Keeps a new state, if `version` is that of the folder's.
    ///
    /// # Errors
    /// The session was changed elsewhere; an invalid state; a missing folder.
    pub fn write(&self, version: u64, state: State) -> Result<Session, NotKept> {
        if let Some(problem) = state.problem() {
            return Err(NotKept::Wrong(problem));
        }
        let known = self
            .read()
            .map_err(|finding| NotKept::Folder(finding.message))?;
        if known.version != version {
            return Err(NotKept::Changed(Box::new(known)));
        }
        let session = Session {
            schema_version: SCHEMA_VERSION,
            version: version + 1,
            build_sha256: Some(self.build_sha256.clone()),
            state,
        };
        let text = to_toml(&session).map_err(NotKept::Wrong)?;
        let head = "# Session of the planning page; read by `needlebench view`.\n";
        write_atomically(&self.path, format!("{head}{text}").as_bytes())
            .map_err(|error| NotKept::Folder(format!("the session cannot be written: {error}")))?;
        Ok(session)
    }

    fn folder_is_there(&self) -> bool {
        self.path.parent().is_some_and(Path::is_dir)
    }
}

/// A place that no scan holds.
fn is_far(place: &[f64; 3]) -> bool {
    place
        .iter()
        .any(|number| number.is_nan() || number.abs() >= FAR)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUILD: &str = "5f";

    fn state() -> State {
        State {
            notes: "breath held\n\"quoted\" \u{e4}".to_owned(),
            window_hu: Some([-1350.0, 150.0]),
            crosshair: Some([1.0, 2.0, 3.0]),
            hidden_markers: vec!["m1".to_owned()],
            needle: NeedleChoice {
                goal: Some("nodule".to_owned()),
                target: Some(TargetAim::Lesion("nodule".to_owned())),
                entry: Some(EntryAim::PlaceM([0.1, -0.1234567890123, 1e-9])),
                configuration: Some("Right-Up-Fold".to_owned()),
            },
            routes: vec![KeptRoute {
                name: "steep".to_owned(),
                needle: NeedleChoice {
                    target: Some(TargetAim::Index([1.0, 2.0, 3.5])),
                    ..NeedleChoice::default()
                },
            }],
        }
    }

    #[test]
    fn what_is_kept_is_read_again_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let file = SessionFile::new(folder.path(), BUILD);
        assert_eq!(file.read().unwrap().version, 0);
        let kept = file.write(0, state()).unwrap();
        assert_eq!(kept.version, 1);
        assert_eq!(SessionFile::new(folder.path(), BUILD).read().unwrap(), kept);
        assert_eq!(kept.state, state());
    }

    #[test]
    fn the_second_of_two_writers_is_refused_and_nothing_is_lost() {
        let folder = tempfile::tempdir().unwrap();
        let file = SessionFile::new(folder.path(), BUILD);
        let first = file.write(0, state()).unwrap();
        let refused = file.write(0, State::default()).unwrap_err();
        assert_eq!(refused, NotKept::Changed(Box::new(first.clone())));
        assert_eq!(file.read().unwrap(), first);
    }

    #[test]
    fn a_session_of_another_build_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        SessionFile::new(folder.path(), BUILD)
            .write(0, state())
            .unwrap();
        let refused = SessionFile::new(folder.path(), "60").read().unwrap_err();
        assert_eq!(refused.key.as_deref(), Some("build_sha256"));
    }

    #[test]
    fn what_is_no_session_is_refused_with_what_is_wrong() {
        let folder = tempfile::tempdir().unwrap();
        let file = SessionFile::new(folder.path(), BUILD);
        fs::write(folder.path().join(SESSION_FILE), "version = \"x\"").unwrap();
        assert!(file.read().unwrap_err().hint.is_some());
        let wrong = [
            State {
                window_hu: Some([5.0, 5.0]),
                ..State::default()
            },
            State {
                crosshair: Some([f64::NAN, 0.0, 0.0]),
                ..State::default()
            },
            State {
                notes: "x".repeat(MOST_NOTES + 1),
                ..State::default()
            },
        ];
        for state in wrong {
            assert!(matches!(file.write(0, state), Err(NotKept::Wrong(_))));
        }
    }

    #[test]
    fn a_folder_that_is_gone_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let file = SessionFile::new(folder.path(), BUILD);
        folder.close().unwrap();
        assert!(matches!(file.write(0, state()), Err(NotKept::Folder(_))));
    }
}
