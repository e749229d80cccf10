//! The Python environment of the MuJoCo harness, made on first use in the user's cache folder.

mod command;
mod install;
mod python;
mod seal;
mod staging;

use std::env;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::mujoco::sha256_hex;

pub use install::{DownloadedWheels, WheelPlatform, WheelsFor, download_wheels};
use python::Python;
pub use python::PythonVersion;
use seal::Found;
use staging::{Guard, Staging};

/// The MuJoCo that the locks pin.
const MUJOCO_VERSION: &str = "4.0.0";

macro_rules! harness_file {
    ($name:literal) => {
        (
            $name,
            include_str!(concat!("../../harness/needlebench_harness/", $name)),
        )
    };
}

/// The harness package, carried in the program so that an installed binary needs no source tree.
const SOURCES: [(&str, &str); 5] = [
    harness_file!("__init__.py"),
    harness_file!("__main__.py"),
    harness_file!("plant.py"),
    harness_file!("protocol.py"),
    harness_file!("server.py"),
];

/// Waiting for another set-up is bounded by the time that it may itself take, and some.
const GUARD_LIMIT: Duration = Duration::from_mins(20);

/// The first import compiles what it needs of numpy.
const VERIFY_LIMIT: Duration = Duration::from_mins(2);

/// Whether each file of packages is the one that its wheel had, by their records (PyPA, "Recording installed
/// projects").
const CHECK_RECORDS: &str = "import base64, hashlib, importlib.metadata, sys
for package in sys.argv[1:]:
    for file in importlib.metadata.files(package):
        if file.hash:
            digest = hashlib.new(file.hash.mode, file.locate().read_bytes()).digest()
            if base64.urlsafe_b64encode(digest).decode().rstrip('=') != file.hash.value:
                raise SystemExit(f'{file} is not what its wheel has')";

const SAY_VERSION: &str =
    "import mujoco, needlebench_harness.server; print(mujoco.mj_versionString())";

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

/// Why there is no Python environment; every message ends with a hint how to fix it.
#[derive(Debug, thiserror::Error)]
pub enum EnvironmentError {
    /// Neither the variable nor a home folder is set.
    #[error(
        "no folder for the MuJoCo environment\n\
         hint: set NEEDLEBENCH_CACHE_DIR to a writable folder"
    )]
    NoCacheFolder,
    /// The cache folder cannot be written.
    #[error(
        "cannot write {}: {source}\n\
         hint: set NEEDLEBENCH_CACHE_DIR to a writable folder with 100 MB free",
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
        "MuJoCo requires 64-bit Python 3.11 or newer, and none is on PATH; {tried}\n\
         hint: install one, or set NEEDLEBENCH_PYTHON to its path"
    )]
    NoPython {
        /// What was found and why it will not do.
        tried: String,
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
        "the program's copy of pip is damaged: its SHA-256 is {got}, not the vendored file's\n\
         hint: build or install needlebench again"
    )]
    DamagedPip {
        /// Hash of what the program carries.
        got: String,
    },
    /// A stage of the set-up failed.
    #[error("{what} failed: {reason}\nhint: {hint}")]
    Failed {
        /// What was being done.
        what: String,
        /// What went wrong.
        reason: String,
        /// How to fix it.
        hint: String,
    },
    /// Another process has been making the same environment for too long.
    #[error(
        "another needlebench has been setting up MuJoCo in {} for more than {seconds} s\n\
         hint: end it, or set NEEDLEBENCH_CACHE_DIR to another folder",
        path.display()
    )]
    Busy {
        /// The folder of environments.
        path: PathBuf,
        /// How long was waited, s.
        seconds: u64,
    },
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
    prepared(&EnvironmentOptions::from_process(), progress)
}

fn prepared(
    options: &EnvironmentOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<Environment, EnvironmentError> {
    match harness_override() {
        Some(words) => Ok(Environment {
            python: PathBuf::from(&words[0]),
            folder: None,
        }),
        None => ensure_with(options, progress),
    }
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
    let environment = prepared(&options, &mut |text| {
        made = true;
        progress(text);
    })?;
    let files = |folder| seal::files(folder).unwrap_or_default();
    let size = |folder| files(folder).iter().map(|(_, about)| about.len()).sum();
    Ok(Prepared {
        size_bytes: environment.folder.as_deref().map(size),
        environment,
        made,
    })
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
        python: install::venv_python(&target),
        folder: Some(target.clone()),
    };
    let folder = target.display();
    if seal::look(&target, &key) == Found::Complete {
        tracing::debug!(%folder, python = %python.version, "MuJoCo environment found");
        return Ok(environment);
    }
    tracing::info!(%folder, python = %python.version, "MuJoCo environment missing or damaged");
    let failed = |source| unwritable(&cache, source);
    fs::create_dir_all(&cache).map_err(failed)?;
    let guard = Guard::acquire(&cache, GUARD_LIMIT, || {
        progress("waiting for another needlebench that is setting up MuJoCo");
    });
    let Some(_guard) = guard.map_err(failed)? else {
        return Err(EnvironmentError::Busy {
            path: cache,
            seconds: GUARD_LIMIT.as_secs(),
        });
    };
    match seal::look(&target, &key) {
        Found::Complete => return Ok(environment),
        Found::Damaged(reason) => progress(&format!(
            "the MuJoCo environment in {folder} is damaged and will be recreated: {reason}"
        )),
        Found::Nothing => {}
    }
    progress(&format!(
        "setting up MuJoCo {MUJOCO_VERSION} for Python {} in {folder} (once)",
        python.version
    ));
    let staging = Staging::beside(&target).map_err(failed)?;
    install::install(options, &python, &staging.folder, progress)?;
    let package =
        install::site_packages(&staging.folder, python.wheels).join("needlebench_harness");
    let write = || {
        fs::create_dir_all(&package)?;
        SOURCES
            .iter()
            .try_for_each(|(name, text)| fs::write(package.join(name), text))
    };
    write().map_err(|source| unwritable(&package, source))?;
    progress("checking that MuJoCo works");
    verify(&install::venv_python(&staging.folder), &target)?;
    let publish = || {
        seal::seal(&staging.folder, &key)?;
        staging.publish(&target, || seal::look(&target, &key) == Found::Complete)
    };
    publish().map_err(|source| unwritable(&target, source))?;
    progress("MuJoCo is ready");
    Ok(environment)
}

fn verify(python: &Path, target: &Path) -> Result<(), EnvironmentError> {
    let said = ask(python, CHECK_RECORDS, &["mujoco-core", "numpy"])
        .and_then(|_| ask(python, SAY_VERSION, &[]));
    let reason = match said {
        Ok(version) if version == MUJOCO_VERSION => return Ok(()),
        Ok(version) => format!("it is version {version:?}, not {MUJOCO_VERSION}"),
        Err(reason) => reason,
    };
    Err(EnvironmentError::Failed {
        what: format!("MuJoCo was installed in {} and", target.display()),
        reason,
        hint: "set NEEDLEBENCH_PYTHON to another Python of 3.11 or newer".to_owned(),
    })
}

/// What an environment's Python answers to a script.
fn ask(python: &Path, script: &str, arguments: &[&str]) -> Result<String, String> {
    let mut command = Command::new(python);
    command.args(["-I", "-c", script]).args(arguments);
    command::run(&mut command, VERIFY_LIMIT)
}

/// Hash of all that an environment is made of, so that a change of any makes a new environment.
fn key(python: &Python) -> String {
    let executable = python.executable.to_string_lossy();
    let parts = [
        ("python", python.version.as_str()),
        ("executable", executable.as_ref()),
        ("requirements", install::requirements(python.wheels)),
        ("seal", "bytecode too"),
    ];
    let parts = parts.into_iter().chain(SOURCES);
    let texts = parts.flat_map(|(name, text)| [name, text]);
    let told_apart: Vec<String> = texts.map(|text| format!("{}:{text}", text.len())).collect();
    sha256_hex(told_apart.concat().as_bytes())
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
mod tests {
    use super::*;

    #[test]
    fn quotes_keep_blanks_in_a_word() {
        assert_eq!(
            split_words(r#" "C:\my python\python.exe"  -c "" x"#),
            [r"C:\my python\python.exe", "-c", "", "x"]
        );
        assert!(split_words("  ").is_empty());
    }

    #[test]
    fn every_source_of_the_harness_is_carried() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("harness/needlebench_harness");
        let mut on_disk: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "py"))
            .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
            .collect();
        on_disk.sort();
        assert_eq!(on_disk, SOURCES.map(|(name, _)| name));
    }

    #[test]
    fn key_depends_on_the_python() {
        let python = |version: &str| Python {
            executable: PathBuf::from("/p"),
            version: version.to_owned(),
            wheels: version.parse().unwrap(),
        };
        assert_eq!(key(&python("3.11.7")), key(&python("3.11.7")));
        assert_ne!(key(&python("3.11.7")), key(&python("3.11.8")));
    }

    /// Writes a wheel of an empty package, and returns its path and hash.
    fn tiny_wheel(folder: &Path, python: &Python) -> (PathBuf, String) {
        const WRITE: &str = "
import base64, hashlib, sys, zipfile
text, info = 'here = True\\n', 'tiny-1.0.dist-info/'
sha256 = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).decode().rstrip('=')
with zipfile.ZipFile(sys.argv[1], 'w') as wheel:
    wheel.writestr('tiny.py', text)
    wheel.writestr(info + 'METADATA', 'Metadata-Version: 2.1\\nName: tiny\\nVersion: 1.0\\n')
    wheel.writestr(info + 'WHEEL', 'Wheel-Version: 1.0\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n')
    wheel.writestr(info + 'RECORD', f'tiny.py,sha256={sha256},{len(text)}\\n')
";
        let wheel = folder.join("tiny-1.0-py3-none-any.whl");
        ask(&python.executable, WRITE, &[wheel.to_str().unwrap()]).unwrap();
        let sha256 = sha256_hex(&fs::read(&wheel).unwrap());
        (wheel, sha256)
    }

    #[test]
    fn package_with_other_hashes_than_the_lock_or_its_record_says_is_refused() {
        let python = python::find(&EnvironmentOptions::from_process()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        install::make_venv(&python, folder.path()).unwrap();
        let venv_python = install::venv_python(folder.path());
        let (wheel, sha256) = tiny_wheel(folder.path(), &python);
        let install = |hash: &str| {
            let lock = format!("{} --hash=sha256:{hash}\n", wheel.display());
            let ask = |pip: &mut Command| {
                pip.arg("install");
            };
            install::run_pip(&venv_python, folder.path(), &lock, ask).unwrap()
        };
        let import = || ask(&venv_python, "import tiny", &[]);
        let check = || ask(&venv_python, CHECK_RECORDS, &["tiny"]);

        let refused = install(&"0".repeat(64)).unwrap_err();
        assert!(refused.contains("HASHES"), "{refused}");
        assert!(import().is_err());

        install(&sha256).unwrap();
        import().unwrap();
        check().unwrap();
        let site = install::site_packages(folder.path(), python.wheels);
        fs::write(site.join("tiny.py"), "here = Fals\n").unwrap();
        let refused = check().unwrap_err();
        assert!(refused.contains("tiny.py is not what its wheel has"));
    }
}
