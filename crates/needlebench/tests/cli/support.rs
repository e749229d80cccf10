//! A folder to work in, the program, and its answers.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

/// A scenario whose run takes well under a second: eight configurations, two of them rejected.
pub const SMALL: &str = include_str!("small.toml");

/// The pose of the paper's Table 3, flange in the controller's base frame.
pub const TABLE_3_POSE: &str = "0.1942,-0.3593,0.1701,-0.8567,2.7197,-1.1407";

/// Top folder of the workspace.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Files with an extension in a folder of the workspace, sorted.
pub fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(workspace().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|found| found == extension))
        .collect();
    files.sort();
    files
}

/// How the program ended and what it said.
#[derive(Debug)]
pub struct Answer {
    pub status: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Answer {
    pub fn of(output: Output) -> Self {
        Self {
            status: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    #[track_caller]
    pub fn exits_with(self, status: i32) -> Self {
        assert_eq!(self.status, Some(status), "{self:#?}");
        self
    }

    /// Standard output as one JSON document.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:#?}"))
    }

    /// Standard output holds all of these.
    #[track_caller]
    pub fn says<const N: usize>(&self, parts: [&str; N]) {
        holds(&self.stdout, parts);
    }

    /// Standard error holds all of these.
    #[track_caller]
    pub fn complains<const N: usize>(&self, parts: [&str; N]) {
        holds(&self.stderr, parts);
    }
}

/// What is typed behind the program's name.
pub trait Arguments {
    fn words(&self) -> Vec<String>;
}

/// A line; what stands between `'` is one word.
impl<S: AsRef<str>> Arguments for S {
    fn words(&self) -> Vec<String> {
        let mut words = Vec::new();
        for (at, part) in self.as_ref().split('\'').enumerate() {
            if at % 2 == 1 {
                words.push(part.to_owned());
            } else {
                words.extend(part.split_whitespace().map(str::to_owned));
            }
        }
        words
    }
}

/// A folder that is removed afterwards.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// For several tests: below `target`, since nobody removes it.
    pub fn shared() -> Self {
        Self {
            folder: tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap(),
        }
    }

    /// With a scenario `s.toml`.
    pub fn with_scenario(text: &str) -> Self {
        let bench = Self::new();
        bench.write("s.toml", text);
        bench
    }

    /// With a study `study.toml` of the small scenario.
    pub fn with_study(text: &str) -> Self {
        let bench = Self::with_scenario(SMALL);
        bench.write("study.toml", text);
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        let path = self.path(name);
        fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    pub fn read_json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }

    /// Copies all below a folder of another one.
    pub fn copy(&self, other: &Self, name: &str) {
        for file in other.tree(name) {
            let to = self.path(name).join(&file);
            fs::create_dir_all(to.parent().unwrap()).unwrap();
            fs::copy(other.path(name).join(&file), to).unwrap();
        }
    }

    /// Every file below a folder, relative to it, sorted.
    pub fn tree(&self, name: &str) -> Vec<PathBuf> {
        let root = self.path(name);
        let mut found = Vec::new();
        let mut folders = vec![root.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    found.push(path.strip_prefix(&root).unwrap().to_owned());
                }
            }
        }
        found.sort();
        found
    }

    /// The program in this folder, free of the settings of whoever runs the tests.
    #[expect(clippy::needless_pass_by_value, reason = "reads best without a sign")]
    pub fn command(&self, arguments: impl Arguments) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_needlebench"));
        command
            .args(arguments.words())
            .current_dir(self.folder.path())
            .env_remove("CI")
            .env_remove("CLICOLOR_FORCE")
            .env_remove("COLUMNS")
            .env_remove("GITHUB_STEP_SUMMARY")
            .env_remove("NEEDLEBENCH_HARNESS_COMMAND")
            .stdin(Stdio::null());
        command
    }

    pub fn run(&self, arguments: impl Arguments) -> Answer {
        Answer::of(self.command(arguments).output().unwrap())
    }

    /// With other environment variables; `None` removes one.
    pub fn run_with(
        &self,
        variables: &[(&str, Option<&str>)],
        arguments: impl Arguments,
    ) -> Answer {
        let mut command = self.command(arguments);
        for (name, value) in variables {
            match value {
                Some(value) => command.env(name, value),
                None => command.env_remove(name),
            };
        }
        Answer::of(command.output().unwrap())
    }
}

/// JUnit XML without its times, which alone differ between two runs of the same inputs.
pub fn without_times(junit: &[u8]) -> String {
    let text = String::from_utf8(junit.to_vec()).unwrap();
    let mut parts = text.split(" time=\"");
    let mut rest = parts.next().unwrap().to_owned();
    for part in parts {
        rest.push_str(part.split_once('"').unwrap().1);
    }
    assert_ne!(rest, text, "it has times");
    rest
}

/// Makes the MuJoCo environment if this machine has none yet, so that no test has to wait for it.
#[track_caller]
pub fn mujoco_is_ready() {
    static READY: OnceLock<Answer> = OnceLock::new();
    let doctor = READY.get_or_init(|| Bench::new().run("doctor --json"));
    assert_eq!(doctor.status, Some(0), "{doctor:#?}");
}

/// A run of `SMALL` in rapier that tests look at in common: its folder, and what it printed.
pub fn small_run() -> &'static (Bench, Answer) {
    static RUN: OnceLock<(Bench, Answer)> = OnceLock::new();
    RUN.get_or_init(|| run_once("run s.toml --engine rapier --json"))
}

/// The same with all its tables.
pub fn small_run_wide() -> &'static (Bench, Answer) {
    static RUN: OnceLock<(Bench, Answer)> = OnceLock::new();
    RUN.get_or_init(|| run_once("run s.toml --engine rapier --wide"))
}

fn run_once(arguments: &str) -> (Bench, Answer) {
    let bench = Bench::shared();
    bench.write("s.toml", SMALL);
    let answer = bench.run(arguments).exits_with(0);
    (bench, answer)
}

/// Asserts that a text holds all of these.
#[track_caller]
pub fn holds<const N: usize>(text: &str, parts: [&str; N]) {
    for part in parts {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
}

/// A text with one place changed, which has to be there exactly once.
#[track_caller]
pub fn with_edit(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "places of `{from}`");
    text.replace(from, to)
}

/// What a JSON value has to be.
pub trait Json {
    fn list(&self) -> &Vec<Value>;
    fn number(&self) -> f64;
    fn word(&self) -> &str;
}

impl Json for Value {
    #[track_caller]
    fn list(&self) -> &Vec<Value> {
        let list = self.as_array();
        list.unwrap_or_else(|| panic!("{self} is no list"))
    }

    #[track_caller]
    fn number(&self) -> f64 {
        let number = self.as_f64();
        number.unwrap_or_else(|| panic!("{self} is no number"))
    }

    #[track_caller]
    fn word(&self) -> &str {
        let word = self.as_str();
        word.unwrap_or_else(|| panic!("{self} is no text"))
    }
}

/// Asserts that a JSON object has all of these keys, with spaces between.
#[track_caller]
pub fn has_keys(value: &Value, keys: &str) {
    let object = value
        .as_object()
        .unwrap_or_else(|| panic!("{value} is not an object"));
    for key in keys.split_whitespace() {
        assert!(object.contains_key(key), "no key `{key}` in {value:#}");
    }
}

/// A JSON array of numbers.
#[track_caller]
pub fn numbers(value: &Value) -> Vec<f64> {
    value.list().iter().map(Json::number).collect()
}
