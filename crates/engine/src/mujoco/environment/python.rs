//! Finds a Python that the pinned wheels exist for.

use std::env;
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::str::FromStr;
use std::time::Duration;

use super::command::run;
use super::{EnvironmentError, EnvironmentOptions, MUJOCO_VERSION};

/// The part of a Python's version that wheels are made for, such as 3.12.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct PythonVersion(pub(super) u32, pub(super) u32);

/// Oldest and newest Python that MuJoCo 4.0.0 has wheels for.
const OLDEST: PythonVersion = PythonVersion(3, 11);
const NEWEST: PythonVersion = PythonVersion(3, 15);

impl fmt::Display for PythonVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.0, self.1)
    }
}

impl FromStr for PythonVersion {
    type Err = String;

    /// Reads `3.12` or `3.12.1`; of those that the wheels exist for.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let version =
            leading(text).ok_or_else(|| format!("`{text}` is not a version such as 3.12"))?;
        if !(OLDEST..=NEWEST).contains(&version) {
            return Err(made_for());
        }
        Ok(version)
    }
}

/// Major and minor number of a version.
fn leading(version: &str) -> Option<PythonVersion> {
    let mut numbers = version.split('.').map(str::parse::<u32>);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => Some(PythonVersion(major, minor)),
        _ => None,
    }
}

/// The Pythons that there are wheels for, in words.
pub(super) fn made_for() -> String {
    format!("MuJoCo {MUJOCO_VERSION} supports Python {OLDEST} to {NEWEST}")
}

/// In the order in which they are tried.
///
/// `python3` is what the user means by Python, and nearly always suits: asking it alone keeps the
/// start short. The others help where it is too old.
const NAMES: &str = "python3 python3.13 python3.12 python3.11 python3.14 python3.15 python";

/// Answers one line: version, bits, implementation, whether there is a GIL, executable.
const PROBE: &str = "import platform, sys, sysconfig
print(platform.python_version(), sys.maxsize.bit_length() + 1, sys.implementation.name, \
int(not sysconfig.get_config_var('Py_GIL_DISABLED')), sys.executable)";

const PROBE_LIMIT: Duration = Duration::from_secs(20);

/// A Python that will do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Python {
    /// The interpreter itself, behind any launcher script.
    pub(super) executable: PathBuf,
    /// Full version, such as `3.11.7`.
    pub(super) version: String,
    /// The part of it that wheels are made for.
    pub(super) wheels: PythonVersion,
}

/// The Python that the options name, or else the first on the search path that will do.
pub(super) fn find(options: &EnvironmentOptions) -> Result<Python, EnvironmentError> {
    if let Some(chosen) = &options.python {
        let is_name = chosen.components().count() == 1;
        let named = is_name.then(|| on_path(options, chosen.as_os_str()).next());
        let path = named.flatten().unwrap_or_else(|| chosen.clone());
        return probe(&path).map_err(|reason| EnvironmentError::ChosenPython { path, reason });
    }
    let mut rejected: Vec<String> = Vec::new();
    for name in NAMES.split(' ') {
        for path in on_path(options, OsStr::new(name)) {
            match probe(&path) {
                Ok(python) => return Ok(python),
                Err(reason) => rejected.push(format!("\n  {}: {reason}", path.display())),
            }
        }
    }
    let tried = if rejected.is_empty() {
        "none found".to_owned()
    } else {
        format!("tried:{}", rejected.concat())
    };
    Err(EnvironmentError::NoPython { tried })
}

/// Files of a name on the search path, in its order.
pub(super) fn on_path<'a>(
    options: &'a EnvironmentOptions,
    name: &'a OsStr,
) -> impl Iterator<Item = PathBuf> + 'a {
    let folders = options.search_path.iter().flat_map(env::split_paths);
    folders
        .map(move |folder| {
            let mut file = folder.join(name).into_os_string();
            file.push(env::consts::EXE_SUFFIX);
            PathBuf::from(file)
        })
        .filter(|file| file.is_file())
}

fn probe(path: &Path) -> Result<Python, String> {
    let answer = run(Command::new(path).args(["-I", "-c", PROBE]), PROBE_LIMIT);
    judge(&answer.map_err(|failure| {
        let lines: Vec<&str> = failure.lines().take(2).collect();
        format!("does not run: {}", lines.join(" "))
    })?)
}

fn judge(answer: &str) -> Result<Python, String> {
    let unreadable = || format!("does not answer like a Python: {answer:?}");
    let words = answer.splitn(5, ' ').filter(|word| !word.is_empty());
    let words: Vec<&str> = words.collect();
    let [version, bits, implementation, gil, executable] = words[..] else {
        return Err(unreadable());
    };
    let wheels = leading(version).ok_or_else(unreadable)?;
    let name = format!("{implementation} {version}, {bits} bit");
    if implementation != "cpython" || gil != "1" {
        return Err(format!("{name}: not the standard CPython"));
    }
    if bits != "64" {
        return Err(format!("{name}: MuJoCo requires 64 bit"));
    }
    if wheels < OLDEST {
        return Err(format!("Python {version} is too old: {}", made_for()));
    }
    if wheels > NEWEST {
        return Err(format!("Python {version} is too new: {}", made_for()));
    }
    Ok(Python {
        executable: PathBuf::from(executable),
        version: version.to_owned(),
        wheels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probe_answer_names_version_and_executable() {
        let python = judge("3.12.1 64 cpython 1 /opt/my python/bin/python3").unwrap();
        assert_eq!(python.version, "3.12.1");
        assert_eq!(python.executable, Path::new("/opt/my python/bin/python3"));
    }

    #[test]
    fn unsuitable_pythons_are_refused_with_their_reason() {
        for (answer, reason) in [
            ("3.10.13 64 cpython 1 /p", "too old"),
            ("2.7.18 64 cpython 1 /p", "too old"),
            ("3.99.0 64 cpython 1 /p", "too new"),
            ("3.11.2 32 cpython 1 /p", "64 bit"),
            ("3.11.2 64 pypy 1 /p", "not the standard"),
            ("3.13.0 64 cpython 0 /p", "not the standard"),
            ("hello", "does not answer"),
            ("", "does not answer"),
        ] {
            let refused = judge(answer).unwrap_err();
            assert!(refused.contains(reason), "{answer}: {refused}");
        }
    }
}
