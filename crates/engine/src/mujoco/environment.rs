//! The Python environment of the MuJoCo harness, made on first use in the user's cache folder.

mod command;
mod guard;
mod install;
mod installed;
mod python;
mod wanted;
mod wheels;

use std::env;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use sha2::{Digest, Sha256};

pub use command::CommandFailure;
use guard::{Guard, Staging};
use python::Python;
pub use python::{PythonVersion, RejectedPython};
pub use wanted::{WheelPlatform, WheelsFor};
pub use wheels::{DownloadedWheels, download_wheels};

/// The MuJoCo that `requirements.lock` pins.
const MUJOCO_VERSION: &str = "4.0.0";

const REQUIREMENTS: &str = include_str!("../../harness/requirements.lock");

/// The harness package, carried in the program so that an installed binary needs no source tree.
const SOURCES: [(&str, &str); 5] = [
    (
        "__init__.py",
        include_str!("../../harness/needlebench_harness/__init__.py"),
    ),
    (
        "__main__.py",
        include_str!("../../harness/needlebench_harness/__main__.py"),
    ),
    (
        "plant.py",
        include_str!("../../harness/needlebench_harness/plant.py"),
    ),
    (
        "protocol.py",
        include_str!("../../harness/needlebench_harness/protocol.py"),
    ),
    (
        "server.py",
        include_str!("../../harness/needlebench_harness/server.py"),
    ),
];

/// Holds the environment's full key once everything else is in place.
const STAMP: &str = "complete";

/// Waiting for another set-up is bounded by the time that it may itself take, and some.
const GUARD_LIMIT: Duration = Duration::from_mins(20);

/// The first import compiles what it needs of numpy.
const VERIFY_LIMIT: Duration = Duration::from_mins(2);

/// A Python that can run the harness.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Environment {
    /// The interpreter.
    pub python: PathBuf,
    /// Folder that holds all of it; none of another program in its place.
    pub folder: Option<PathBuf>,
}

/// Where the set-up looks and writes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct EnvironmentOptions {
    /// Folder that holds the environments; `None` if the user has no cache folder.
    pub cache_dir: Option<PathBuf>,
    /// The Python to use (a path, or a name on the search path) instead of searching for one.
    pub python: Option<PathBuf>,
    /// Where Python and uv are searched, in the form of `PATH`.
    pub search_path: Option<OsString>,
    /// Folder of wheels to install from, without a network (see [`download_wheels`]).
    pub wheels: Option<PathBuf>,
}

impl EnvironmentOptions {
    /// What this process's environment variables say.
    ///
    /// `NEEDLEBENCH_CACHE_DIR`, or else `needlebench` in the user's cache folder;
    /// `NEEDLEBENCH_PYTHON`; `PATH`.
    pub fn from_process() -> Self {
        let cache_dir = variable("NEEDLEBENCH_CACHE_DIR")
            .map(PathBuf::from)
            .or_else(|| user_cache().map(|cache| cache.join("needlebench")));
        Self {
            cache_dir,
            python: variable("NEEDLEBENCH_PYTHON").map(PathBuf::from),
            search_path: env::var_os("PATH"),
            wheels: None,
        }
    }
}

/// Why there is no Python environment; every message ends with a hint how to mend it.
#[derive(Debug, thiserror::Error)]
pub enum EnvironmentError {
    /// Neither the variable nor a home folder is set.
    #[error(
        "there is no folder for the MuJoCo environment\n\
         hint: set NEEDLEBENCH_CACHE_DIR to a folder that can be written"
    )]
    NoCacheFolder,
    /// The cache folder cannot be written.
    #[error(
        "cannot write {}: {source}\n\
         hint: set NEEDLEBENCH_CACHE_DIR to a folder that can be written and has 100 MB free",
        path.display()
    )]
    Unwritable {
        /// What was to be written.
        path: PathBuf,
        /// Why it failed.
        source: io::Error,
    },
    /// No suitable Python on the search path.
    #[error(
        "MuJoCo needs Python 3.11 or newer, 64 bit, and there is none on PATH; {}\n\
         hint: install one, or set NEEDLEBENCH_PYTHON to its path",
        tried(rejected)
    )]
    NoPython {
        /// What was found and will not do.
        rejected: Vec<RejectedPython>,
    },
    /// The Python that the user chose will not do.
    #[error(
        "NEEDLEBENCH_PYTHON is {}: {reason}\n\
         hint: set it to a 64-bit Python of 3.11 or newer, or unset it",
        path.display()
    )]
    ChosenPython {
        /// The chosen Python.
        path: PathBuf,
        /// Why it will not do.
        reason: String,
    },
    /// The program's copy of pip is not the one that was vendored.
    #[error(
        "the program's copy of pip is damaged: its SHA-256 is {got}, not {expected}\n\
         hint: build or install needlebench again"
    )]
    DamagedPip {
        /// Hash of the vendored file.
        expected: &'static str,
        /// Hash of what the program carries.
        got: String,
    },
    /// Python cannot make a virtual environment.
    #[error(
        "`{} -m venv` failed: {failure}\n\
         hint: this Python is incomplete; install the full one (on Debian the package python3-venv), \
         or set NEEDLEBENCH_PYTHON to another",
        python.display()
    )]
    Venv {
        /// The Python that was used.
        python: PathBuf,
        /// What went wrong.
        failure: CommandFailure,
    },
    /// The packages could not be installed.
    #[error(
        "installing MuJoCo {MUJOCO_VERSION} failed: {failure}\n\
         hint: pip uses your own configuration (index, proxy, certificates). Without a network, run\n  \
         needlebench doctor --download wheels {wanted}\n\
         on a machine that has one, copy the folder `wheels` here, and run\n  \
         needlebench doctor --prepare --wheels wheels"
    )]
    Install {
        /// What went wrong.
        failure: CommandFailure,
        /// Which wheels this machine needs.
        wanted: WheelsFor,
    },
    /// A folder of wheels does not hold those that this machine needs.
    #[error(
        "installing MuJoCo {MUJOCO_VERSION} from {} failed: {reason}\n\
         hint: needlebench doctor --download wheels {wanted}\n\
         gives the wheels for this machine, on one with a network; copy the whole folder here",
        folder.display()
    )]
    Wheels {
        /// The folder.
        folder: PathBuf,
        /// What is wrong with it.
        reason: String,
        /// Which wheels this machine needs.
        wanted: WheelsFor,
    },
    /// The wheels could not be fetched.
    #[error(
        "downloading the wheels of MuJoCo {MUJOCO_VERSION} failed: {failure}\n\
         hint: pip uses your own configuration (index, proxy, certificates); MuJoCo {MUJOCO_VERSION} is made \
         for Python {}",
        python::made_for()
    )]
    Download {
        /// What went wrong.
        failure: CommandFailure,
    },
    /// The installed packages do not work.
    #[error(
        "MuJoCo was installed in {} but does not work: {reason}\n\
         hint: set NEEDLEBENCH_PYTHON to another Python of 3.11 or newer",
        folder.display()
    )]
    Verify {
        /// The environment.
        folder: PathBuf,
        /// What went wrong.
        reason: String,
    },
    /// Another process has been making the same environment for too long.
    #[error(
        "another needlebench has been setting MuJoCo up in {} for more than {seconds} s\n\
         hint: end it, or set NEEDLEBENCH_CACHE_DIR to another folder",
        path.display()
    )]
    Busy {
        /// The environment.
        path: PathBuf,
        /// How long was waited, s.
        seconds: u64,
    },
}

fn tried(rejected: &[RejectedPython]) -> String {
    if rejected.is_empty() {
        return "found none at all".to_owned();
    }
    let list: String = rejected.iter().map(ToString::to_string).collect();
    format!("tried:{list}")
}

fn unwritable(path: &Path, source: io::Error) -> EnvironmentError {
    EnvironmentError::Unwritable {
        path: path.to_owned(),
        source,
    }
}

/// The harness's Python environment, made now if it is not there yet (about 20 s and a network).
///
/// `progress` receives a line per stage. With `NEEDLEBENCH_HARNESS_COMMAND` set (see
/// [`HarnessProcess::start`](super::HarnessProcess::start)) there is nothing to make.
pub fn ensure(progress: &mut dyn FnMut(&str)) -> Result<Environment, EnvironmentError> {
    if let Some(words) = harness_override() {
        let python = PathBuf::from(&words[0]);
        return Ok(Environment {
            python,
            folder: None,
        });
    }
    ensure_with(&EnvironmentOptions::from_process(), progress)
}

/// An environment that was made ahead.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Prepared {
    /// The environment.
    pub environment: Environment,
    /// Size of all its files, bytes; `None` where another program stands in its place.
    pub size_bytes: Option<u64>,
    /// Whether it was made now, and was not there before.
    pub made: bool,
}

/// Makes the harness's Python environment ahead, for machines that later have no network, from a folder of
/// wheels if one is given; there already, it is looked at only.
pub fn prepare(
    wheels: Option<&Path>,
    progress: &mut dyn FnMut(&str),
) -> Result<Prepared, EnvironmentError> {
    let options = EnvironmentOptions {
        wheels: wheels.map(Path::to_owned),
        ..EnvironmentOptions::from_process()
    };
    let mut made = false;
    let environment = match harness_override() {
        Some(_) => ensure(progress)?,
        None => ensure_with(&options, &mut |text| {
            made = true;
            progress(text);
        })?,
    };
    if made && environment.folder.is_some() {
        // Hashes are kept from now on, so that whoever may only read it need not take them at every start.
        ensure_with(&options, progress)?;
    }
    let size_bytes = environment.folder.as_deref().map(size_of_files);
    Ok(Prepared {
        environment,
        size_bytes,
        made,
    })
}

/// Sum over all files below a folder, bytes; links count for nothing.
fn size_of_files(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| match entry.metadata() {
            Ok(about) if about.is_dir() => size_of_files(&entry.path()),
            Ok(about) if about.is_file() => about.len(),
            _ => 0,
        })
        .sum()
}

/// [`ensure`] with explicit options.
///
/// Safe to call from several processes at once; an interrupted set-up is never taken for complete, and an
/// environment whose files are not those that were installed is made again.
pub fn ensure_with(
    options: &EnvironmentOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<Environment, EnvironmentError> {
    let cache = options
        .cache_dir
        .as_ref()
        .ok_or(EnvironmentError::NoCacheFolder)?;
    // Relative paths would mean something else to the commands below.
    let cache = std::path::absolute(cache).map_err(|source| unwritable(cache, source))?;
    let python = python::find(options)?;
    let key = key(&python);
    let target = cache.join(format!("harness-{}", &key[..16]));
    let environment = Environment {
        python: install::venv_python(&target.join("venv")),
        folder: Some(target.clone()),
    };
    if state(&target, &key) == State::Complete {
        return Ok(environment);
    }
    fs::create_dir_all(&cache).map_err(|source| unwritable(&cache, source))?;
    let guard = Guard::acquire(&target, GUARD_LIMIT, || {
        progress("waiting for another needlebench that is setting MuJoCo up");
    });
    let guard = guard.map_err(|source| unwritable(&cache, source))?;
    let Some(_guard) = guard else {
        return Err(EnvironmentError::Busy {
            path: target,
            seconds: GUARD_LIMIT.as_secs(),
        });
    };
    match state(&target, &key) {
        State::Complete => return Ok(environment),
        State::Damaged(reason) => progress(&format!(
            "the MuJoCo environment in {} is damaged and is made again: {reason}",
            target.display()
        )),
        State::Absent => {}
    }
    guard::remove_dead_staging(&target);
    progress(&format!(
        "setting MuJoCo {MUJOCO_VERSION} up for Python {} in {} (once)",
        python.version,
        target.display()
    ));
    let staging = Staging::beside(&target).map_err(|source| unwritable(&cache, source))?;
    build(options, &python, &staging.folder, &target, progress)?;
    let stamp = staging.folder.join(STAMP);
    fs::write(&stamp, &key).map_err(|source| unwritable(&stamp, source))?;
    staging
        .publish(&target, || state(&target, &key) == State::Complete)
        .map_err(|source| unwritable(&target, source))?;
    progress("MuJoCo is ready");
    Ok(environment)
}

/// Makes everything but the stamp.
fn build(
    options: &EnvironmentOptions,
    python: &Python,
    folder: &Path,
    target: &Path,
    progress: &mut dyn FnMut(&str),
) -> Result<(), EnvironmentError> {
    let requirements = folder.join("requirements.lock");
    fs::write(&requirements, REQUIREMENTS).map_err(|source| unwritable(&requirements, source))?;
    install::install(options, python, folder, &requirements, progress)?;
    let venv_python = install::venv_python(&folder.join("venv"));
    install::install_package(&venv_python, &SOURCES, target)?;
    progress("checking that MuJoCo works");
    verify(&venv_python, target)
}

fn verify(venv_python: &Path, target: &Path) -> Result<(), EnvironmentError> {
    const ASK: &str = "import mujoco, needlebench_harness.server; print(mujoco.mj_versionString())";
    let answer = command::run(
        Command::new(venv_python).args(["-I", "-c", ASK]),
        VERIFY_LIMIT,
    );
    let reason = match answer {
        Ok(version) if version == MUJOCO_VERSION => return Ok(()),
        Ok(version) => format!("it is version {version:?}, not {MUJOCO_VERSION}"),
        Err(failure) => failure.to_string(),
    };
    let folder = target.to_owned();
    Err(EnvironmentError::Verify { folder, reason })
}

/// What there is of an environment.
#[derive(Debug, PartialEq, Eq)]
enum State {
    /// Nothing that was ever complete.
    Absent,
    /// All of it, as it was installed.
    Complete,
    /// It was complete; why it is not any more.
    Damaged(String),
}

fn state(target: &Path, key: &str) -> State {
    if !fs::read_to_string(target.join(STAMP)).is_ok_and(|stamp| stamp == key) {
        return State::Absent;
    }
    match installed::check(target, &pinned(), &SOURCES) {
        Ok(()) => State::Complete,
        Err(reason) => State::Damaged(reason),
    }
}

/// Names and versions that the requirements pin.
fn pinned() -> Vec<(String, String)> {
    let lines = REQUIREMENTS.lines();
    lines
        .filter_map(|line| {
            let (name, rest) = line.split_once("==")?;
            let version = rest.split([' ', ';', '\\']).next()?;
            Some((name.trim().to_owned(), version.to_owned()))
        })
        .collect()
}

/// Hash of all that an environment is made of, so that a change of any makes a new environment.
fn key(python: &Python) -> String {
    let executable = python.executable.to_string_lossy();
    let parts = [
        ("python", python.version.as_str()),
        ("executable", executable.as_ref()),
        ("requirements", REQUIREMENTS),
    ];
    let mut hash = Sha256::new();
    for (name, text) in parts.into_iter().chain(SOURCES) {
        for part in [name, text] {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        }
    }
    hex(&hash.finalize())
}

fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// An environment variable that is set to something.
fn variable(name: &str) -> Option<OsString> {
    env::var_os(name).filter(|value| !value.is_empty())
}

/// The user's cache folder by the conventions of the operating system.
fn user_cache() -> Option<PathBuf> {
    let folder = |name| variable(name).map(PathBuf::from);
    if cfg!(windows) {
        folder("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        folder("HOME").map(|home| home.join("Library").join("Caches"))
    } else {
        // The XDG specification tells to ignore relative paths.
        folder("XDG_CACHE_HOME")
            .filter(|cache| cache.is_absolute())
            .or_else(|| folder("HOME").map(|home| home.join(".cache")))
    }
}

/// The words of `NEEDLEBENCH_HARNESS_COMMAND`, at least one, or `None` if it is not set.
pub(super) fn harness_override() -> Option<Vec<String>> {
    let command = variable("NEEDLEBENCH_HARNESS_COMMAND")?;
    let words = split_words(&command.to_string_lossy());
    (!words.is_empty()).then_some(words)
}

/// Splits at blanks outside double quotes.
fn split_words(command: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut quoted = false;
    for character in command.chars() {
        if character == '"' {
            quoted = !quoted;
            word.get_or_insert_default();
        } else if character.is_whitespace() && !quoted {
            words.extend(word.take());
        } else {
            word.get_or_insert_default().push(character);
        }
    }
    words.extend(word);
    words
}

#[cfg(test)]
mod tests;
