//! Makes the virtual environment and installs the pinned packages into it.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use sha2::{Digest, Sha256};

use super::command::{CommandFailure, run};
use super::python::{Python, PythonVersion, on_path};
use super::wanted::WheelsFor;
use super::{EnvironmentError, EnvironmentOptions, REQUIREMENTS, hex, pinned};

/// The installer for machines without uv; with it Debian's missing `ensurepip` does no harm.
pub(super) const PIP_WHEEL: &[u8] =
    include_bytes!("../../../harness/vendor/pip-26.3-py3-none-any.whl");
const PIP_WHEEL_NAME: &str = "pip-26.3-py3-none-any.whl";
const PIP_WHEEL_SHA256: &str = "f3b60b20ffaadd4415ed7957212a38ac63fa4c5fa375bd0f4a797777940fad13";

const VENV_LIMIT: Duration = Duration::from_mins(2);
/// About 30 MB over a slow line.
const INSTALL_LIMIT: Duration = Duration::from_mins(15);

/// Python of a virtual environment.
pub(super) fn venv_python(venv: &Path) -> PathBuf {
    if cfg!(windows) {
        venv.join("Scripts").join("python.exe")
    } else {
        venv.join("bin").join("python")
    }
}

/// Makes `folder/venv` and installs `requirements` into it, with uv if it is there, else with pip.
pub(super) fn install(
    options: &EnvironmentOptions,
    python: &Python,
    folder: &Path,
    requirements: &Path,
    progress: &mut dyn FnMut(&str),
) -> Result<(), EnvironmentError> {
    let venv = folder.join("venv");
    if let Some(wheels) = &options.wheels {
        return install_from_wheels(wheels, python, folder, requirements, progress);
    }
    let uv = on_path(options, OsStr::new("uv")).next();
    if let Some(uv) = uv {
        progress("installing MuJoCo and numpy with uv (about 30 MB)");
        match install_with_uv(&uv, python, &venv, requirements) {
            Ok(()) => return Ok(()),
            Err(failure) => progress(&format!("uv failed, trying pip instead: {failure}")),
        }
        if venv.exists() {
            fs::remove_dir_all(&venv).map_err(|source| super::unwritable(&venv, source))?;
        }
    }
    progress("making a Python environment");
    make_venv(python, &venv)?;
    let pip = write_pip(folder, PIP_WHEEL)?;
    progress("installing MuJoCo and numpy with pip (about 30 MB)");
    install_with_pip(&pip, &venv_python(&venv), requirements, None).map_err(|failure| {
        EnvironmentError::Install {
            failure,
            wanted: WheelsFor::this_machine(python),
        }
    })?;
    // 2 MB that nothing needs any more; a leftover does no harm.
    let _ = fs::remove_file(pip);
    Ok(())
}

/// The same from a folder, with pip alone: it needs no index, and no network.
fn install_from_wheels(
    wheels: &Path,
    python: &Python,
    folder: &Path,
    requirements: &Path,
    progress: &mut dyn FnMut(&str),
) -> Result<(), EnvironmentError> {
    let unsuitable = |reason: String| EnvironmentError::Wheels {
        folder: wheels.to_owned(),
        reason,
        wanted: WheelsFor::this_machine(python),
    };
    let found = fs::read_dir(wheels).map_err(|error| unsuitable(error.to_string()))?;
    let is_wheel = |name: &OsStr| Path::new(name).extension() == Some(OsStr::new("whl"));
    if !found.flatten().any(|entry| is_wheel(&entry.file_name())) {
        return Err(unsuitable("it holds no wheels (*.whl)".to_owned()));
    }
    let venv = folder.join("venv");
    progress("making a Python environment");
    make_venv(python, &venv)?;
    let pip = write_pip(folder, PIP_WHEEL)?;
    progress(&format!(
        "installing MuJoCo and numpy from {}",
        wheels.display()
    ));
    install_with_pip(&pip, &venv_python(&venv), requirements, Some(wheels)).map_err(|failure| {
        // pip names a damaged file last, after every hash that it could have had.
        unsuitable(damaged(wheels).unwrap_or_else(|| failure.to_string()))
    })?;
    // As above.
    let _ = fs::remove_file(pip);
    Ok(())
}

/// The first wheel of a pinned package and version in a folder that is none of those that are pinned.
fn damaged(wheels: &Path) -> Option<String> {
    let prefixes: Vec<String> = pinned()
        .into_iter()
        .map(|(name, version)| format!("{}-{version}-", name.replace('-', "_")))
        .collect();
    let mut files: Vec<PathBuf> = fs::read_dir(wheels)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    files.sort();
    files.into_iter().find_map(|file| {
        let name = file.file_name()?.to_str()?.to_owned();
        if !prefixes.iter().any(|prefix| name.starts_with(prefix)) {
            return None;
        }
        let sha256 = hex(&Sha256::digest(fs::read(&file).ok()?));
        (!REQUIREMENTS.contains(&sha256))
            .then(|| format!("{name} is damaged: its SHA-256 is none of those that are known"))
    })
}

fn install_with_uv(
    uv: &Path,
    python: &Python,
    venv: &Path,
    requirements: &Path,
) -> Result<(), CommandFailure> {
    let mut make = Command::new(uv);
    make.args(["venv", "--quiet", "--no-project", "--python"]);
    make.arg(&python.executable).arg(venv);
    run(&mut make, VENV_LIMIT)?;
    let mut install = Command::new(uv);
    install.args(["pip", "install", "--quiet", "--python"]);
    install.arg(venv_python(venv));
    install.args([
        "--require-hashes",
        "--only-binary",
        ":all:",
        "--no-deps",
        "-r",
    ]);
    install.arg(requirements);
    run(&mut install, INSTALL_LIMIT)?;
    Ok(())
}

pub(super) fn make_venv(python: &Python, venv: &Path) -> Result<(), EnvironmentError> {
    let mut command = Command::new(&python.executable);
    command
        .args(["-I", "-m", "venv", "--without-pip"])
        .arg(venv);
    run(&mut command, VENV_LIMIT).map_err(|failure| EnvironmentError::Venv {
        failure,
        python: python.executable.clone(),
    })?;
    Ok(())
}

/// Writes the vendored installer into `folder`, if it is what it was when it was vendored.
pub(super) fn write_pip(folder: &Path, wheel: &[u8]) -> Result<PathBuf, EnvironmentError> {
    let sha256 = hex(&Sha256::digest(wheel));
    if sha256 != PIP_WHEEL_SHA256 {
        return Err(EnvironmentError::DamagedPip {
            expected: PIP_WHEEL_SHA256,
            got: sha256,
        });
    }
    let path = folder.join(PIP_WHEEL_NAME);
    fs::write(&path, wheel).map_err(|source| super::unwritable(&path, source))?;
    Ok(path)
}

/// Installs exactly the wheels whose hashes the requirements list, out of a folder if one is given.
pub(super) fn install_with_pip(
    pip: &Path,
    venv_python: &Path,
    requirements: &Path,
    wheels: Option<&Path>,
) -> Result<(), CommandFailure> {
    let mut install = Command::new(venv_python);
    // Isolated concerns Python alone: pip's configuration (index, proxy, certificates) holds.
    install.arg("-I").arg(pip.join("pip"));
    install.args([
        "install",
        "--quiet",
        "--require-hashes",
        "--only-binary",
        ":all:",
    ]);
    // Compiling all of numpy beforehand takes longer than the few modules that are used.
    install.args([
        "--no-deps",
        "--no-compile",
        "--no-warn-script-location",
        "-r",
    ]);
    install.arg(requirements);
    if let Some(wheels) = wheels {
        install.args(["--no-index", "--find-links"]).arg(wheels);
    }
    // `user = true` in a pip.conf contradicts a virtual environment.
    install.env("PIP_USER", "0");
    set_unattended(&mut install);
    run(&mut install, INSTALL_LIMIT)?;
    Ok(())
}

/// Nobody is there to answer a question about credentials, or to read about another pip.
fn set_unattended(pip: &mut Command) {
    pip.env("PIP_DISABLE_PIP_VERSION_CHECK", "1");
    pip.env("PIP_NO_INPUT", "1");
}

/// Fetches the wheels that requirements without markers name, for a Python and, unless it is this one's,
/// a platform by its tag.
pub(super) fn download_with_pip(
    pip: &Path,
    python: &Python,
    requirements: &Path,
    version: PythonVersion,
    tag: Option<&str>,
    folder: &Path,
) -> Result<(), CommandFailure> {
    let mut download = Command::new(&python.executable);
    download.arg("-I").arg(pip.join("pip"));
    download.args(["download", "--quiet", "--require-hashes", "--no-deps"]);
    download.args(["--only-binary", ":all:", "--implementation", "cp"]);
    download.args(["--python-version", &version.to_string()]);
    if let Some(tag) = tag {
        download.args(["--platform", tag]);
    }
    download
        .arg("--dest")
        .arg(folder)
        .arg("-r")
        .arg(requirements);
    set_unattended(&mut download);
    run(&mut download, INSTALL_LIMIT)?;
    Ok(())
}

/// Copies the harness package to where the environment's Python looks for packages.
pub(super) fn install_package(
    venv_python: &Path,
    sources: &[(&str, &str)],
    target: &Path,
) -> Result<(), EnvironmentError> {
    const ASK: &str = "import sysconfig; print(sysconfig.get_path('purelib'))";
    let answer = run(
        Command::new(venv_python).args(["-I", "-c", ASK]),
        VENV_LIMIT,
    );
    let packages = answer.map_err(|failure| EnvironmentError::Verify {
        folder: target.to_owned(),
        reason: failure.to_string(),
    })?;
    let package = Path::new(&packages).join("needlebench_harness");
    let write = || -> io::Result<()> {
        fs::create_dir_all(&package)?;
        for (name, text) in sources {
            fs::write(package.join(name), text)?;
        }
        Ok(())
    };
    write().map_err(|source| super::unwritable(&package, source))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vendored_pip_is_what_was_vendored() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write_pip(folder.path(), PIP_WHEEL).is_ok());
    }

    #[test]
    fn damaged_pip_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut wheel = PIP_WHEEL.to_vec();
        wheel[1000] ^= 1;
        let refused = write_pip(folder.path(), &wheel);
        assert!(matches!(refused, Err(EnvironmentError::DamagedPip { .. })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
