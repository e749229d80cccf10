//! The pinned packages: into a virtual environment, or as wheels into a folder for machines without a network.

use std::ffi::OsStr;
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::str::FromStr;
use std::time::Duration;

use crate::mujoco::sha256_hex;

use super::command::run;
use super::python::{Python, PythonVersion, find, made_for, on_path};
use super::staging::Staging;
use super::{EnvironmentError, EnvironmentOptions, MUJOCO_VERSION, unwritable};

/// Carried for machines without uv; with it Debian's missing `ensurepip` does no harm.
const PIP: &[u8] = include_bytes!("../../../harness/vendor/pip-26.3-py3-none-any.whl");
const PIP_NAME: &str = "pip-26.3-py3-none-any.whl";
const PIP_SHA256: &str = "f3b60b20ffaadd4415ed7957212a38ac63fa4c5fa375bd0f4a797777940fad13";

/// What is installed, and nothing else: each requirement has the hashes of its wheels.
const EXACTLY: &str = "--quiet --require-hashes --no-deps --only-binary :all: --requirement";

const PIP_HINT: &str = "pip uses your own configuration (index, proxy, certificates)";

const VENV_LIMIT: Duration = Duration::from_mins(2);
/// About 30 MB over a slow line.
const INSTALL_LIMIT: Duration = Duration::from_mins(15);

/// The lock for a Python.
pub(super) fn requirements(version: PythonVersion) -> &'static str {
    if version < PythonVersion(3, 12) {
        include_str!("../../../harness/requirements-3.11.lock")
    } else {
        include_str!("../../../harness/requirements-3.12.lock")
    }
}

/// Python of the virtual environment in a folder.
pub(super) fn venv_python(folder: &Path) -> PathBuf {
    folder.join(if cfg!(windows) {
        "venv/Scripts/python.exe"
    } else {
        "venv/bin/python"
    })
}

/// Where the environment in a folder has its packages.
pub(super) fn site_packages(folder: &Path, version: PythonVersion) -> PathBuf {
    folder.join(if cfg!(windows) {
        "venv/Lib/site-packages".to_owned()
    } else {
        format!("venv/lib/python{version}/site-packages")
    })
}

/// Makes `folder/venv` with the packages in it: with uv if it is there, else with pip; from a folder of wheels
/// with pip alone, which needs no index and no network.
pub(super) fn install(
    options: &EnvironmentOptions,
    python: &Python,
    folder: &Path,
    progress: &mut dyn FnMut(&str),
) -> Result<(), EnvironmentError> {
    let wheels = options.wheels.as_deref();
    let uv = on_path(options, OsStr::new("uv")).next();
    if let Some(uv) = uv.filter(|_| wheels.is_none()) {
        progress("installing MuJoCo and numpy with uv (about 30 MB)");
        match install_with_uv(&uv, python, folder)? {
            Ok(_) => return Ok(()),
            Err(failure) => progress(&format!("uv failed, trying pip instead: {failure}")),
        }
    }
    progress("creating a Python environment");
    make_venv(python, folder)?;
    progress(&match wheels {
        Some(wheels) => format!("installing MuJoCo and numpy from {}", wheels.display()),
        None => "installing MuJoCo and numpy with pip (about 30 MB)".to_owned(),
    });
    let lock = requirements(python.wheels);
    let wanted = WheelsFor::this_machine(python);
    let installed = run_pip(&venv_python(folder), folder, lock, |pip| {
        // Compiling all of numpy beforehand takes longer than the few modules that are used.
        pip.args(["install", "--no-compile", "--no-warn-script-location"]);
        if let Some(wheels) = wheels {
            pip.args(["--no-index", "--find-links"]).arg(wheels);
        }
    })?;
    installed.map_err(|reason| {
        let what = format!("installing MuJoCo {MUJOCO_VERSION}");
        let download = format!("needlebench doctor --download wheels {wanted}");
        match wheels {
            Some(wheels) => EnvironmentError::Failed {
                what: format!("{what} from {}", wheels.display()),
                // pip names a damaged file last, after every hash that it could have had.
                reason: unsuitable(wheels, lock).unwrap_or(reason),
                hint: format!(
                    "{download}\ndownloads the wheels for this machine on one with a network; copy \
                     the whole folder here"
                ),
            },
            None => EnvironmentError::Failed {
                what,
                reason,
                hint: format!(
                    "{PIP_HINT}. Without a network, run\n  {download}\non a machine that has one, copy the folder \
                     `wheels` here, and run\n  needlebench doctor --prepare --wheels wheels"
                ),
            },
        }
    })
}

fn install_with_uv(
    uv: &Path,
    python: &Python,
    folder: &Path,
) -> Result<Result<String, String>, EnvironmentError> {
    let lock = write(folder, "requirements.lock", requirements(python.wheels))?;
    let mut make = Command::new(uv);
    make.args(["venv", "--quiet", "--no-project", "--python"]);
    make.arg(&python.executable).arg(folder.join("venv"));
    let mut install = Command::new(uv);
    // Its cache holds unpacked files, which have no hashes and are linked into other environments.
    install.args(["pip", "install", "--no-cache", "--python"]);
    install
        .arg(venv_python(folder))
        .args(EXACTLY.split(' '))
        .arg(lock);
    Ok(run(&mut make, VENV_LIMIT).and_then(|_| run(&mut install, INSTALL_LIMIT)))
}

pub(super) fn make_venv(python: &Python, folder: &Path) -> Result<(), EnvironmentError> {
    let mut command = Command::new(&python.executable);
    command.args(["-I", "-m", "venv", "--clear", "--without-pip"]);
    run(command.arg(folder.join("venv")), VENV_LIMIT).map_err(|reason| {
        EnvironmentError::Failed {
            what: format!("`{} -m venv`", python.executable.display()),
            reason,
            hint: "this Python is incomplete; install the full one (on Debian the package python3-venv), or set \
                   NEEDLEBENCH_PYTHON to another"
                .to_owned(),
        }
    })?;
    Ok(())
}

/// Has the carried pip do something with what a lock names, in a folder where it leaves the lock.
pub(super) fn run_pip(
    python: &Path,
    folder: &Path,
    lock: &str,
    ask: impl FnOnce(&mut Command),
) -> Result<Result<(), String>, EnvironmentError> {
    let lock = write(folder, "requirements.lock", lock)?;
    let pip = write_pip(folder, PIP)?;
    let mut command = Command::new(python);
    // Isolated concerns Python alone: pip's configuration (index, proxy, certificates) holds.
    command.arg("-I").arg(pip.join("pip"));
    ask(&mut command);
    command.args(EXACTLY.split(' ')).arg(lock);
    // `user = true` in a pip.conf contradicts a virtual environment.
    command.env("PIP_USER", "0");
    // Nobody is there to answer a question about credentials, or to read about another pip.
    command.env("PIP_DISABLE_PIP_VERSION_CHECK", "1");
    command.env("PIP_NO_INPUT", "1");
    let answer = run(&mut command, INSTALL_LIMIT);
    // 2 MB that nothing needs any more; a leftover does no harm.
    let _ = fs::remove_file(pip);
    Ok(answer.map(|_| ()))
}

/// Writes the vendored installer into `folder`, if it is what it was when it was vendored.
fn write_pip(folder: &Path, wheel: &[u8]) -> Result<PathBuf, EnvironmentError> {
    let got = sha256_hex(wheel);
    if got != PIP_SHA256 {
        return Err(EnvironmentError::DamagedPip { got });
    }
    write(folder, PIP_NAME, wheel)
}

fn write(
    folder: &Path,
    name: &str,
    contents: impl AsRef<[u8]>,
) -> Result<PathBuf, EnvironmentError> {
    let path = folder.join(name);
    fs::write(&path, contents).map_err(|source| unwritable(&path, source))?;
    Ok(path)
}

/// What is wrong with a folder of wheels: there are none, or one is of a package and version of the lock, but none
/// of those that are pinned.
fn unsuitable(folder: &Path, lock: &str) -> Option<String> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) => return Some(error.to_string()),
    };
    let files = entries.flatten().map(|entry| entry.path());
    let mut wheels: Vec<PathBuf> = files
        .filter(|file| file.extension() == Some(OsStr::new("whl")))
        .collect();
    wheels.sort();
    if wheels.is_empty() {
        return Some("it contains no wheels (*.whl)".to_owned());
    }
    let pinned = lock.lines().filter_map(|line| line.split_once("=="));
    let prefixes: Vec<String> = pinned
        .map(|(name, version)| {
            let version = version.trim_end_matches([' ', '\\']);
            format!("{}-{version}-", name.replace('-', "_"))
        })
        .collect();
    wheels.into_iter().find_map(|file| {
        let name = file.file_name()?.to_str()?;
        let pinned = prefixes.iter().any(|prefix| name.starts_with(prefix));
        let damaged = pinned && !lock.contains(&sha256_hex(&fs::read(&file).ok()?));
        damaged.then(|| format!("{name} is damaged: its SHA-256 does not match any expected one"))
    })
}

/// A system that the pinned wheels exist for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WheelPlatform {
    name: &'static str,
    /// By which pip finds its wheels: the oldest system that both packages support.
    tag: &'static str,
    /// As Rust calls them.
    system: [&'static str; 2],
}

const PLATFORMS: [WheelPlatform; 4] = {
    const fn platform(
        name: &'static str,
        tag: &'static str,
        system: [&'static str; 2],
    ) -> WheelPlatform {
        WheelPlatform { name, tag, system }
    }
    [
        platform("linux-x86_64", "manylinux_2_28_x86_64", ["linux", "x86_64"]),
        platform(
            "linux-aarch64",
            "manylinux_2_28_aarch64",
            ["linux", "aarch64"],
        ),
        platform("macos-arm64", "macosx_11_0_arm64", ["macos", "aarch64"]),
        platform("windows-x86_64", "win_amd64", ["windows", "x86_64"]),
    ]
};

impl FromStr for WheelPlatform {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let named = PLATFORMS.into_iter().find(|each| each.name == text);
        named.ok_or_else(|| format!("not one of {}", PLATFORMS.map(|each| each.name).join(", ")))
    }
}

/// Which wheels are wanted; written as the options of `needlebench doctor --download`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WheelsFor {
    /// The Python that they are for; `None` is the one that is found here.
    pub python: Option<PythonVersion>,
    /// The system that they are for; `None` is this one.
    pub platform: Option<WheelPlatform>,
}

impl WheelsFor {
    /// What a machine needs that has this Python.
    fn this_machine(python: &Python) -> Self {
        let this = [std::env::consts::OS, std::env::consts::ARCH];
        Self {
            python: Some(python.wheels),
            platform: PLATFORMS.into_iter().find(|each| each.system == this),
        }
    }
}

impl fmt::Display for WheelsFor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let python = self.python.map(|version| format!("--for-python {version}"));
        let platform = self
            .platform
            .map(|each| format!("--for-platform {}", each.name));
        let options: Vec<String> = python.into_iter().chain(platform).collect();
        f.write_str(&options.join(" "))
    }
}

/// Wheels that were fetched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DownloadedWheels {
    /// The Python that they are for.
    pub python: PythonVersion,
    /// The files and their sizes, bytes, by name.
    pub files: Vec<(PathBuf, u64)>,
}

/// Fetches the pinned wheels into a folder, from which [`prepare`](super::prepare) makes an environment on a
/// machine without a network. Their hashes are checked here, and there again.
///
/// Wheels are for one system and one Python; a folder may hold those of several.
pub fn download_wheels(
    folder: &Path,
    wanted: &WheelsFor,
    progress: &mut dyn FnMut(&str),
) -> Result<DownloadedWheels, EnvironmentError> {
    let here = find(&EnvironmentOptions::from_process())?;
    let python = wanted.python.unwrap_or(here.wheels);
    let failed = |source| unwritable(folder, source);
    fs::create_dir_all(folder).map_err(failed)?;
    // Relative paths would mean something else to pip; what was there before is nobody's business here.
    let absolute = std::path::absolute(folder).map_err(failed)?;
    let staging = Staging::beside(&absolute.join("download")).map_err(failed)?;
    progress(&format!(
        "fetching MuJoCo and numpy for Python {python} with pip (about 30 MB)"
    ));
    let wheels = staging.folder.join("wheels");
    let lock = requirements(python);
    let fetched = run_pip(&here.executable, &staging.folder, lock, |pip| {
        pip.args(["download", "--implementation", "cp", "--python-version"]);
        pip.arg(python.to_string()).arg("--dest").arg(&wheels);
        if let Some(platform) = wanted.platform {
            pip.args(["--platform", platform.tag]);
        }
    })?;
    fetched.map_err(|reason| EnvironmentError::Failed {
        what: format!("downloading the wheels of MuJoCo {MUJOCO_VERSION}"),
        reason,
        hint: format!("{PIP_HINT}; {}", made_for()),
    })?;
    let publish = || -> io::Result<Vec<(PathBuf, u64)>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(&wheels)? {
            let entry = entry?;
            let place = folder.join(entry.file_name());
            fs::rename(entry.path(), &place)?;
            files.push((place.clone(), fs::metadata(place)?.len()));
        }
        files.sort();
        Ok(files)
    };
    let files = publish().map_err(failed)?;
    Ok(DownloadedWheels { python, files })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn version(text: &str) -> PythonVersion {
        text.parse().unwrap()
    }

    #[test]
    fn vendored_pip_is_what_was_vendored_and_a_damaged_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut wheel = PIP.to_vec();
        wheel[1000] ^= 1;
        let refused = write_pip(folder.path(), &wheel);
        assert!(matches!(refused, Err(EnvironmentError::DamagedPip { .. })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(write_pip(folder.path(), PIP).is_ok());
    }

    #[test]
    fn each_python_has_one_version_of_each_package_and_no_marker() {
        for (python, numpy) in [("3.11", "2.4.6"), ("3.12", "2.5.5"), ("3.15", "2.5.5")] {
            let lock = requirements(version(python));
            let named: Vec<&str> = lock.lines().filter(|line| line.contains("==")).collect();
            assert_eq!(
                named,
                [
                    &format!("mujoco-core=={MUJOCO_VERSION} \\"),
                    &format!("numpy=={numpy} \\")
                ],
                "Python {python}"
            );
            assert!(!lock.contains(';') && !lock.contains("://"));
        }
    }

    #[test]
    fn versions_without_wheels_are_refused() {
        for (text, reason) in [
            ("3.10", "3.11 to 3.15"),
            ("3.16", "3.11 to 3.15"),
            ("three", "not a version such as 3.12"),
            ("", "not a version such as 3.12"),
        ] {
            let refused = text.parse::<PythonVersion>().unwrap_err();
            assert!(refused.contains(reason), "{text}: {refused}");
        }
        assert_eq!(version("3.12.1").to_string(), "3.12");
    }

    #[test]
    fn what_is_wanted_is_written_as_options() {
        let wanted = WheelsFor {
            python: Some(version("3.12")),
            platform: Some("linux-aarch64".parse().unwrap()),
        };
        assert_eq!(
            wanted.to_string(),
            "--for-python 3.12 --for-platform linux-aarch64"
        );
        for platform in PLATFORMS {
            assert_eq!(platform.name.parse(), Ok(platform));
        }
    }
}
