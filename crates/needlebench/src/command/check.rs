//! `needlebench check`.

use crate::arguments::RobotArguments;
use crate::output::shown;
use anyhow::Result;
use clap::Args;
use needlebench_cell::Finding;
use serde::Serialize;
use std::path::PathBuf;

use super::{load_checked, overrides, print_json, print_text};

use crate::exit::ExitStatus;
use crate::findings::print_findings;

#[derive(Debug, Args)]
pub(crate) struct CheckArguments {
    /// Scenario files.
    #[arg(required = true, value_name = "SCENARIO")]
    pub scenarios: Vec<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Serialize)]
struct CheckAnswer {
    schema_version: u32,
    ok: bool,
    findings: Vec<Finding>,
    notes: Vec<String>,
}

/// Parses, resolves and validates scenarios.
pub(crate) fn check(arguments: &CheckArguments) -> Result<ExitStatus> {
    let mut findings = Vec::new();
    let mut notes = Vec::new();
    match overrides(&arguments.robot) {
        Err(finding) => findings.push(finding),
        Ok(overrides) => {
            for path in &arguments.scenarios {
                match load_checked(path, &overrides) {
                    Ok(runnable) => {
                        let resolved = runnable.into_scenario();
                        if !arguments.json {
                            let purpose = match resolved.iso9283 {
                                Some(_) => "test by ISO 9283".to_owned(),
                                None => format!("{} goals", resolved.goals.len()),
                            };
                            print_text(&format!(
                                "{}: ok ({purpose}, {} bodies, {} pairs)",
                                shown(path),
                                resolved.cell.bodies.len(),
                                resolved.cell.pairs.len()
                            ))?;
                            for note in &resolved.notes {
                                print_text(&format!("  note: {note}"))?;
                            }
                        }
                        notes.extend(resolved.notes);
                    }
                    Err(found) => findings.extend(found),
                }
            }
        }
    }
    let ok = findings.is_empty();
    if arguments.json {
        print_json(&CheckAnswer {
            schema_version: 1,
            ok,
            findings,
            notes,
        })?;
    } else {
        print_findings(&findings);
    }
    Ok(if ok {
        ExitStatus::Success
    } else {
        ExitStatus::BadInput
    })
}
