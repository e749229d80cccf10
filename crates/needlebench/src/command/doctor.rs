//! `needlebench doctor`.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use needlebench_bench::provenance::GIT_REVISION;
use needlebench_bench::{forget_kept_meshes, kept_meshes};
use needlebench_engine::ENGINES;
use needlebench_engine::mujoco::{
    EnvironmentError, PythonVersion, WheelPlatform, WheelsFor, download_wheels, prepare,
};
use needlebench_input::Finding;
use serde::Serialize;

use super::{print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::complain;

/// How MuJoCo is installed in advance.
pub(crate) const DOCTOR_HELP: &str = "\
MuJoCo's Python environment is created on first use, in NEEDLEBENCH_CACHE_DIR or else the user's cache folder, \
from wheels with known hashes. `--prepare` creates it in advance: on the login node of a cluster, in an image. It is \
valid for the same Python at the same path, and may be read-only afterwards.

Offline: download the wheels on a machine with a network, for the system and the Python of the offline machine, copy \
the folder, and create the environment from it:
  needlebench doctor --download wheels --for-python 3.12
  needlebench doctor --prepare --wheels wheels

Example: needlebench doctor --prepare";

#[derive(Debug, Args)]
pub(crate) struct DoctorArguments {
    /// Create MuJoCo's environment unless it exists; print its folder and size.
    #[arg(long)]
    prepare: bool,
    /// With --prepare: create it offline, from the wheels in this folder.
    #[arg(long, value_name = "DIR", requires = "prepare")]
    wheels: Option<PathBuf>,
    /// Download the wheels into this folder, for an offline machine.
    #[arg(long, value_name = "DIR", conflicts_with = "prepare")]
    download: Option<PathBuf>,
    /// With --download: Python version of the wheels, e.g. 3.12 [default: this machine's].
    #[arg(long, value_name = "VERSION", requires = "download")]
    for_python: Option<PythonVersion>,
    /// With --download: system of the wheels, linux-x86_64, linux-aarch64, macos-arm64 or windows-x86_64 [default: this
    /// machine's].
    #[arg(long, value_name = "SYSTEM", requires = "download")]
    for_platform: Option<WheelPlatform>,
    /// Clear the mesh cache, which may contain patient surfaces; it is rebuilt when needed.
    #[arg(long, conflicts_with_all = ["prepare", "download"])]
    clear_meshes: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct PrepareAnswer {
    schema_version: u32,
    /// Folder of the environment; none if another program replaces the harness.
    folder: Option<PathBuf>,
    python: PathBuf,
    size_bytes: Option<u64>,
    made: bool,
}

#[derive(Serialize)]
struct DownloadAnswer {
    schema_version: u32,
    python: String,
    files: Vec<DownloadedFile>,
}

#[derive(Serialize)]
struct DownloadedFile {
    file: PathBuf,
    size_bytes: u64,
}

#[derive(Serialize)]
struct DoctorAnswer {
    schema_version: u32,
    ok: bool,
    checks: Vec<Check>,
}

#[derive(Serialize)]
struct Check {
    name: &'static str,
    ok: bool,
    detail: String,
}

/// Checks the environment of the engines, creates it, or downloads its wheels.
pub(crate) fn doctor(arguments: &DoctorArguments) -> Result<ExitStatus, Failure> {
    if let Some(folder) = &arguments.download {
        return fetch_wheels(folder, arguments);
    }
    if arguments.clear_meshes {
        forget_kept_meshes().map_err(|error| Failure::Ended {
            status: ExitStatus::EnvironmentFailed,
            message: format!("error: cannot clear the mesh cache: {error}"),
        })?;
    }
    if arguments.prepare {
        return prepare_environment(arguments);
    }
    check_engines(arguments.json)
}

fn prepare_environment(arguments: &DoctorArguments) -> Result<ExitStatus, Failure> {
    if let Some(wheels) = arguments.wheels.as_ref().filter(|folder| !folder.is_dir()) {
        let message = format!("there is no folder {}", wheels.display());
        return Err(Finding::new("--wheels", message)
            .hint("`needlebench doctor --download DIR` downloads the wheels on a machine with a network")
            .into());
    }
    let prepared = prepare(arguments.wheels.as_deref(), &mut told(arguments.json))
        .map_err(|error| environment_failed(&error))?;
    let environment = prepared.environment;
    if arguments.json {
        print_json(&PrepareAnswer {
            schema_version: 1,
            folder: environment.folder,
            python: environment.python,
            size_bytes: prepared.size_bytes,
            made: prepared.made,
        })?;
        return Ok(ExitStatus::Success);
    }
    print_text(&match (&environment.folder, prepared.size_bytes) {
        (Some(folder), Some(bytes)) => format!(
            "MuJoCo's environment {} {} ({})",
            if prepared.made {
                "created in"
            } else {
                "exists in"
            },
            folder.display(),
            megabytes(bytes)
        ),
        _ => format!(
            "nothing to prepare: NEEDLEBENCH_HARNESS_COMMAND replaces the environment ({})",
            environment.python.display()
        ),
    })?;
    Ok(ExitStatus::Success)
}

fn fetch_wheels(folder: &Path, arguments: &DoctorArguments) -> Result<ExitStatus, Failure> {
    let wanted = WheelsFor {
        python: arguments.for_python,
        platform: arguments.for_platform,
    };
    let fetched = download_wheels(folder, &wanted, &mut told(arguments.json))
        .map_err(|error| environment_failed(&error))?;
    if arguments.json {
        let files = fetched.files.into_iter();
        print_json(&DownloadAnswer {
            schema_version: 1,
            python: fetched.python.to_string(),
            files: files
                .map(|(file, size_bytes)| DownloadedFile { file, size_bytes })
                .collect(),
        })?;
        return Ok(ExitStatus::Success);
    }
    for (file, bytes) in &fetched.files {
        print_text(&format!("{} ({})", file.display(), megabytes(*bytes)))?;
    }
    print_text(&format!(
        "wheels for Python {}; on the offline machine: needlebench doctor --prepare --wheels {}",
        fetched.python,
        folder.display()
    ))?;
    Ok(ExitStatus::Success)
}

/// Prints progress to standard error, unless the answer is JSON.
fn told(json: bool) -> impl FnMut(&str) {
    move |text| {
        if !json {
            complain(text);
        }
    }
}

fn environment_failed(error: &EnvironmentError) -> Failure {
    Failure::Ended {
        status: ExitStatus::EnvironmentFailed,
        message: format!("error: {error}"),
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 * 1e-6)
}

/// The mesh cache, and how to clear it.
fn kept_in_words() -> String {
    let folders = kept_meshes();
    if folders.is_empty() {
        return "none".to_owned();
    }
    let texts: Vec<String> = folders
        .iter()
        .map(|(folder, bytes)| format!("{} in {}", megabytes(*bytes), folder.display()))
        .collect();
    format!(
        "{}; may contain patient surfaces, --clear-meshes removes all",
        texts.join(", ")
    )
}

/// Checks the environment of the engines.
fn check_engines(json: bool) -> Result<ExitStatus, Failure> {
    let mut checks = vec![
        Check {
            name: "needlebench",
            ok: true,
            detail: format!("{} ({GIT_REVISION})", env!("CARGO_PKG_VERSION")),
        },
        Check {
            name: "cores",
            ok: true,
            detail: std::thread::available_parallelism()
                .map_or_else(|error| error.to_string(), |count| count.to_string()),
        },
        Check {
            name: "mesh cache",
            ok: true,
            detail: kept_in_words(),
        },
    ];
    for engine in ENGINES {
        let found = engine.check(&mut told(json));
        checks.extend(found.into_iter().map(|each| Check {
            name: each.name,
            ok: each.found.is_ok(),
            detail: each.found.unwrap_or_else(|missing| missing),
        }));
    }
    let ok = checks.iter().all(|check| check.ok);
    if json {
        print_json(&DoctorAnswer {
            schema_version: 1,
            ok,
            checks,
        })?;
    } else {
        for check in &checks {
            let mark = if check.ok { "ok  " } else { "FAIL" };
            print_text(&format!("{mark} {}: {}", check.name, check.detail))?;
        }
    }
    Ok(if ok {
        ExitStatus::Success
    } else {
        ExitStatus::EnvironmentFailed
    })
}
