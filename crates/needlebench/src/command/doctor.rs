//! `needlebench doctor`.

use anyhow::Result;
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use serde::Serialize;

use super::{print_json, print_text};
use crate::exit::ExitStatus;
use crate::provenance::GIT_REVISION;

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

/// Checks what both engines need.
pub(crate) fn doctor(json: bool) -> Result<ExitStatus> {
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
    ];
    let environment = ensure(&mut |text| {
        if !json {
            anstream::eprintln!("{text}");
        }
    });
    match environment {
        Err(error) => {
            checks.push(Check {
                name: "mujoco environment",
                ok: false,
                detail: error.to_string(),
            });
        }
        Ok(environment) => {
            checks.push(Check {
                name: "mujoco environment",
                ok: true,
                detail: environment.python.display().to_string(),
            });
            let timeout = std::time::Duration::from_secs(30);
            let (ok, detail) = match HarnessProcess::start(&environment, timeout) {
                Ok(process) => {
                    let versions = process.versions();
                    (
                        true,
                        format!(
                            "MuJoCo {}, Python {}, numpy {}",
                            versions.mujoco, versions.python, versions.numpy
                        ),
                    )
                }
                Err(error) => (false, error.to_string()),
            };
            checks.push(Check {
                name: "mujoco harness",
                ok,
                detail,
            });
        }
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
