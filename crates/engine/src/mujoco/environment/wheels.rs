//! The pinned wheels in a folder, for machines without a network.

use std::fs;
use std::path::{Path, PathBuf};

use super::python::{Python, PythonVersion};
use super::wanted::{WheelPlatform, WheelsFor};
use super::{EnvironmentError, EnvironmentOptions, REQUIREMENTS, install, python, unwritable};

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
    let python = python::find(&EnvironmentOptions::from_process())?;
    let version = wanted.python.unwrap_or(python.wheels);
    // A folder of its own: files that were there before are nobody's business here.
    fs::create_dir_all(folder).map_err(|source| unwritable(folder, source))?;
    let absolute = std::path::absolute(folder).map_err(|source| unwritable(folder, source))?;
    let staging = absolute.join(format!(".download-{}", std::process::id()));
    let fetched = fetch(&staging, &python, version, wanted.platform, progress);
    let moved = fetched.and_then(|()| publish(&staging, folder));
    // A leftover only takes space.
    let _ = fs::remove_dir_all(&staging);
    Ok(DownloadedWheels {
        python: version,
        files: moved?,
    })
}

fn fetch(
    staging: &Path,
    python: &Python,
    version: PythonVersion,
    platform: Option<WheelPlatform>,
    progress: &mut dyn FnMut(&str),
) -> Result<(), EnvironmentError> {
    fs::create_dir_all(staging).map_err(|source| unwritable(staging, source))?;
    let pip = install::write_pip(staging, install::PIP_WHEEL)?;
    let requirements = staging.join("requirements.lock");
    fs::write(&requirements, requirements_for(REQUIREMENTS, version))
        .map_err(|source| unwritable(&requirements, source))?;
    progress(&format!(
        "fetching MuJoCo and numpy for Python {version} with pip (about 30 MB)"
    ));
    let tag = platform.map(WheelPlatform::tag);
    let wheels = wheels_folder(staging);
    install::download_with_pip(&pip, python, &requirements, version, tag, &wheels)
        .map_err(|failure| EnvironmentError::Download { failure })
}

fn wheels_folder(staging: &Path) -> PathBuf {
    staging.join("wheels")
}

/// Renames every wheel to its place.
fn publish(staging: &Path, folder: &Path) -> Result<Vec<(PathBuf, u64)>, EnvironmentError> {
    let wheels = wheels_folder(staging);
    let publish = || -> std::io::Result<Vec<(PathBuf, u64)>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(&wheels)? {
            let entry = entry?;
            let place = folder.join(entry.file_name());
            let size_bytes = entry.metadata()?.len();
            fs::rename(entry.path(), &place)?;
            files.push((place, size_bytes));
        }
        files.sort();
        Ok(files)
    };
    publish().map_err(|source| unwritable(folder, source))
}

/// The requirements that hold for a Python, without the markers that say so: pip holds markers against the
/// Python that it runs in, which may be another.
fn requirements_for(requirements: &str, version: PythonVersion) -> String {
    let mut text = String::new();
    let mut holds = true;
    for line in requirements.lines() {
        let mut line = line.to_owned();
        if line.contains("==") {
            (line, holds) = match line.split_once(" ; ") {
                Some((requirement, marker)) => (
                    format!("{requirement} \\"),
                    marker_holds(marker.trim_end_matches([' ', '\\']), version),
                ),
                None => (line, true),
            };
        }
        if holds {
            text.push_str(&line);
            text.push('\n');
        }
    }
    text
}

/// Whether a marker of the lock holds; it only has bounds of the Python's version.
fn marker_holds(marker: &str, version: PythonVersion) -> bool {
    let bound = |sign: &str| -> Option<PythonVersion> {
        let rest = marker.strip_prefix("python_full_version")?.trim_start();
        let quoted = rest.strip_prefix(sign)?.trim_start();
        quoted.strip_prefix('\'')?.strip_suffix('\'')?.parse().ok()
    };
    match (bound("<"), bound(">=")) {
        (Some(below), None) => version < below,
        (None, Some(least)) => version >= least,
        _ => panic!("the lock has a marker of another kind: {marker}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn version(text: &str) -> PythonVersion {
        text.parse().unwrap()
    }

    #[test]
    fn each_python_has_one_version_of_each_package_and_no_marker() {
        for (python, numpy) in [("3.11", "2.4.6"), ("3.12", "2.5.5"), ("3.15", "2.5.5")] {
            let text = requirements_for(REQUIREMENTS, version(python));
            let named: Vec<&str> = text.lines().filter(|line| line.contains("==")).collect();
            assert_eq!(
                named,
                ["mujoco-core==4.0.0 \\", &format!("numpy=={numpy} \\")],
                "Python {python}"
            );
            assert!(!text.contains(';'));
        }
        // Every hash is somebody's.
        let hashes = |text: &str| text.matches("--hash=").count();
        let of = |python: &str| hashes(&requirements_for(REQUIREMENTS, version(python)));
        let shared = REQUIREMENTS.split("numpy==").next().map(hashes).unwrap();
        assert_eq!(of("3.11") + of("3.12"), hashes(REQUIREMENTS) + shared);
    }

    #[test]
    fn versions_without_wheels_are_refused() {
        for (text, reason) in [
            ("3.10", "3.11 to 3.15"),
            ("3.16", "3.11 to 3.15"),
            ("three", "no version such as 3.12"),
            ("", "no version such as 3.12"),
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
            platform: Some(WheelPlatform::LinuxArm),
        };
        assert_eq!(
            wanted.to_string(),
            "--for-python 3.12 --for-platform linux-aarch64"
        );
        for platform in WheelPlatform::ALL {
            assert_eq!(platform.name().parse(), Ok(platform));
        }
    }
}
