//! The commands.

mod atlas;
mod breath;
mod check;
mod clearance;
mod compare;
mod ct;
mod doctor;
mod export;
mod init;
mod iso9283;
mod judge;
mod kinematics;
mod needle;
mod pairs;
mod paper;
mod record_plan;
mod replay;
mod report;
mod results_folder;
mod robot;
mod run;
mod schema;
mod search;
mod servo;
mod study;
mod suggest;
mod view;

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use needlebench_engine::{ENGINES, engine_names};
use needlebench_input::{Finding, PackagePaths};
use needlebench_robot::package_of;
use needlebench_scenario::{EntryChooser, Overrides, ResolvedScenario, load_scenario};
use serde::Serialize;

pub(crate) use atlas::{AtlasArguments, atlas};
pub(crate) use breath::{BREATH_HELP, BreathArguments, breath};
pub(crate) use check::{CheckArguments, check};
pub(crate) use clearance::{ClearanceArguments, clearance};
pub(crate) use compare::{CompareArguments, compare, compare_help};
pub(crate) use ct::{CtArguments, ct};
pub(crate) use doctor::{DOCTOR_HELP, DoctorArguments, doctor};
pub(crate) use export::{ExportArguments, export};
pub(crate) use init::{InitArguments, init};
pub(crate) use iso9283::{ISO9283_HELP, Iso9283Arguments, iso9283};
pub(crate) use judge::{JUDGE_HELP, JudgeArguments, judge};
pub use kinematics::KinematicArm;
pub(crate) use kinematics::{FkArguments, IkArguments, fk, ik};
pub use needle::needle_case_schema;
pub(crate) use needle::{NeedleArguments, needle};
pub(crate) use pairs::{PairsArguments, pairs};
pub(crate) use paper::{PaperArguments, paper};
pub(crate) use record_plan::{RecordPlanArguments, record_plan};
pub(crate) use replay::{REPLAY_HELP, ReplayArguments, replay};
pub(crate) use report::{REPORT_HELP, ReportArguments, report};
pub(crate) use robot::{ROBOT_HELP, RobotCommandArguments, robot};
pub(crate) use run::{RunArguments, run};
pub(crate) use schema::{SchemaFormat, schema};
pub(crate) use search::{SEARCH_HELP, SearchArguments, search};
pub(crate) use servo::{ServoArguments, servo};
pub(crate) use study::{MergeArguments, STUDY_HELP, StudyArguments, merge, study};
pub(crate) use suggest::{SuggestArguments, suggest};
pub(crate) use view::{VIEW_HELP, ViewArguments, view};

use needlebench_bench::{EntryFinder, Runnable};

use crate::arguments::{RobotArguments, UrdfArguments};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::{json_text, print_as_it_is, print_text};
use crate::xacro::{expand, is_xacro};

/// Reads a scenario, and rejects one that cannot be run.
fn load(path: &Path, overrides: &Overrides) -> Result<ResolvedScenario, Vec<Finding>> {
    load_runnable(path, overrides).map(Runnable::into_scenario)
}

/// The same, ready to be run.
fn load_runnable(path: &Path, overrides: &Overrides) -> Result<Runnable, Vec<Finding>> {
    let resolved = load_scenario(path, overrides)?;
    Runnable::checked(resolved).map_err(|finding| vec![finding])
}

fn overrides(arguments: &RobotArguments) -> Result<Overrides, Finding> {
    Ok(Overrides {
        arm: arguments.arm.clone(),
        ..urdf_overrides(&arguments.urdf)?
    })
}

fn urdf_overrides(arguments: &UrdfArguments) -> Result<Overrides, Finding> {
    let mut packages = PackagePaths::from_arguments(&arguments.package_path)?;
    let expanded = match &arguments.robot {
        // A file that is not there is told as any other is.
        Some(file) if is_xacro(file) && file.is_file() => {
            if let Some((name, folder)) = package_of(file) {
                packages = packages.or(name, folder);
            }
            Some(Arc::new(expand(file, &arguments.xacro, &packages)?))
        }
        Some(file) if !arguments.xacro.is_empty() && !is_xacro(file) => {
            let message = "it is for a robot whose file is one for xacro".to_owned();
            return Err(Finding::new("--xacro", message).hint(format!(
                "omit it, or give --robot a file.xacro instead of {}",
                file.display()
            )));
        }
        _ => None,
    };
    Ok(Overrides {
        robot_urdf: arguments.robot.clone(),
        expanded,
        arm: None,
        prefix: arguments.prefix.clone(),
        packages,
        calibration: arguments.calibration.clone(),
        engines: engine_names(ENGINES),
        missing_inertia: arguments.missing_inertia.clone(),
        choose_entry: Some(EntryChooser(Arc::new(EntryFinder::default()))),
    })
}

/// Prints one JSON document to standard output.
fn print_json(value: &impl Serialize) -> Result<()> {
    print_as_it_is(&json_text(value)?)
}

/// Third-party licences, linked into the crate's folder.
const NOTICES: &str = include_str!("../../THIRD-PARTY-NOTICES");

/// Prints the third-party licences.
pub(crate) fn licences() -> Result<ExitStatus, Failure> {
    print_as_it_is(NOTICES.trim_end())?;
    Ok(ExitStatus::Success)
}

/// Prints completions for a shell.
pub(crate) fn completions(
    shell: clap_complete::Shell,
    command_line: &mut clap::Command,
) -> Result<ExitStatus, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, command_line, "needlebench", &mut script);
    print_as_it_is(String::from_utf8_lossy(&script).trim_end())?;
    Ok(ExitStatus::Success)
}
