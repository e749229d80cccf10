//! `needlebench doctor`.

use anyhow::Result;
use needlebench_engine::ENGINES;
use serde::Serialize;

use super::{print_json, print_text};
use crate::exit::ExitStatus;
use crate::output::complain;
use needlebench_bench::provenance::GIT_REVISION;

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

/// Checks what the engines need.
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
    for engine in ENGINES {
        let found = engine.check(&mut |text| {
            if !json {
                complain(text);
            }
        });
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
