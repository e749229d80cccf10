//! What each command does.

mod atlas;
mod check;
mod clearance;
mod compare;
mod compare_studies;
mod doctor;
mod iso9283;
mod kinematics;
mod pairs;
mod paper;
mod run;
mod servo;
mod study;

use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};
use needlebench_cell::{
    Finding, MissingInertia, Overrides, PackagePaths, ResolvedScenario, load_scenario,
};
use needlebench_clearance::ClearanceModel;
use needlebench_planning::iso9283::plan_protocol;
use serde::Serialize;

pub(crate) use atlas::atlas;
pub(crate) use check::check;
pub(crate) use clearance::clearance;
pub(crate) use compare::compare;
pub(crate) use doctor::doctor;
pub(crate) use iso9283::iso9283;
pub(crate) use kinematics::{fk, ik};
pub(crate) use pairs::pairs;
pub(crate) use paper::paper;
pub(crate) use run::run;
pub(crate) use servo::servo;
pub(crate) use study::{merge, study};

use crate::cli::{MissingInertiaArgument, RobotArguments, SchemaFormat};
use crate::exit::ExitStatus;
use crate::output::findings::print_findings;

/// Reads a scenario; prints what is wrong with it and gives `None` if it cannot be used.
fn load(path: &Path, overrides: &Overrides) -> Option<ResolvedScenario> {
    match load_checked(path, overrides) {
        Ok(resolved) => Some(resolved),
        Err(findings) => {
            print_findings(&findings);
            None
        }
    }
}

/// Reads a scenario and refuses one whose start posture collides, or whose protocol cannot be
/// carried out.
fn load_checked(path: &Path, overrides: &Overrides) -> Result<ResolvedScenario, Vec<Finding>> {
    let resolved = load_scenario(path, overrides)?;
    let cell = &resolved.cell;
    let model = ClearanceModel::new(cell);
    if let Some(protocol) = &resolved.iso9283 {
        // It does not start from the start posture.
        return match plan_protocol(&resolved, protocol, &model) {
            Ok(_) => Ok(resolved),
            Err(error) => {
                let finding = Finding::new(path.display().to_string(), error.to_string());
                Err(vec![finding.key("iso9283").hint(error.hint())])
            }
        };
    }
    let Some(pair) = model.first_below(&resolved.start, |_| 0.0) else {
        return Ok(resolved);
    };
    let (a, b) = pair.solid_names(cell);
    let depth_mm = -pair.separation.distance_m * 1e3;
    let finding = Finding::new(
        path.display().to_string(),
        format!("the start posture collides: {a} is {depth_mm:.1} mm inside {b}"),
    );
    Err(vec![
        finding
            .key("start.joints_deg")
            .hint("choose another start posture, or move what it hits"),
    ])
}

fn overrides(arguments: &RobotArguments) -> Result<Overrides, Finding> {
    Ok(Overrides {
        robot_urdf: arguments.robot.clone(),
        packages: PackagePaths::from_arguments(&arguments.package_path)?,
        calibration: arguments.calibration.clone(),
        missing_inertia: arguments.missing_inertia.map(|policy| match policy {
            MissingInertiaArgument::Error => MissingInertia::Error,
            MissingInertiaArgument::NominalUr3 => MissingInertia::NominalUr3,
        }),
    })
}

/// Prints one JSON document to standard output.
fn print_json(value: &impl Serialize) -> Result<()> {
    print_text(&serde_json::to_string_pretty(value).map_err(std::io::Error::from)?)
}

/// Prints text and a line end to standard output.
///
/// A reader that stops reading is no error: what the command found decides its exit status.
fn print_text(text: &str) -> Result<()> {
    let mut out = anstream::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

/// Prints the schema of a file format.
pub(crate) fn schema(format: SchemaFormat) -> Result<ExitStatus> {
    match format {
        SchemaFormat::Scenario => print_json(&needlebench_cell::scenario::scenario_schema())?,
        SchemaFormat::Study => print_json(&needlebench_cell::study::study_schema())?,
    }
    Ok(ExitStatus::Success)
}

/// Prints completions for a shell.
pub(crate) fn completions(shell: clap_complete::Shell) -> Result<ExitStatus> {
    let mut script = Vec::new();
    clap_complete::generate(
        shell,
        &mut crate::cli::command_line(),
        "needlebench",
        &mut script,
    );
    print_text(String::from_utf8_lossy(&script).trim_end())?;
    Ok(ExitStatus::Success)
}
