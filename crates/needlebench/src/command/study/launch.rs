//! `needlebench study --launch`: scripts for shards, and the commands to start them.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use needlebench_bench::study::{
    Launch, LaunchFile, LaunchPlan, LaunchRequest, Launcher, PreparedStudy, StudyEvaluator, advice,
    launch_plan, time_per_case,
};
use needlebench_input::Finding;
use needlebench_report::files::write_atomically;
use serde::Serialize;

use super::super::{print_json, print_text};
use super::{StudyArguments, prepare_folder};
use crate::arguments::RobotArguments;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::host;
use crate::output::{complain, shown};

#[derive(Serialize)]
struct LaunchAnswer {
    schema_version: u32,
    folder: String,
    shards: u32,
    /// Largest number of shards of the study.
    blocks: u64,
    files: Vec<String>,
    steps: Vec<StepAnswer>,
    advice: Vec<String>,
}

#[derive(Serialize)]
struct StepAnswer {
    does: &'static str,
    line: String,
}

/// Writes the scripts and prints the commands; starts nothing.
pub(super) fn launch(
    arguments: &StudyArguments,
    prepared: &PreparedStudy,
    request: LaunchRequest,
) -> Result<ExitStatus, Failure> {
    let manifest = prepared.manifest(None);
    let blocks = manifest.blocks();
    if u64::from(request.shards) > blocks {
        let finding = Finding::new(
            &prepared.study.source.file,
            format!(
                "{} shards, at most {blocks} possible: the study has {blocks} blocks of {} cases",
                request.shards, manifest.block_cases
            ),
        )
        .key("--launch")
        .hint(format!(
            "use {}:{blocks} or less; a shard requires at least one block",
            request.launcher.name()
        ));
        return Err(finding.into());
    }
    let here = std::env::current_dir().context("cannot determine the current folder")?;
    // Inside another program the command line is what is on the path.
    let program = if host::is_hosted() {
        PathBuf::from("needlebench")
    } else {
        std::env::current_exe().context("cannot determine the path of this program")?
    };
    let cache = std::env::var_os("NEEDLEBENCH_CACHE_DIR").map(PathBuf::from);
    let cache = cache.filter(|cache| !cache.as_os_str().is_empty());
    let options = options(&arguments.robot);
    let jobs = arguments.results.jobs.unwrap_or(1);
    let plan = Launch {
        request,
        name: &prepared.study.file.name,
        program: &program,
        folder: &here,
        study: &arguments.study,
        out: &arguments.out,
        options: &options,
        jobs,
        cache: cache.as_deref(),
        needs_mujoco: prepared.needs_mujoco(),
    };
    let plan = launch_plan(&plan)?;
    prepare_folder(&plan.folder)?;
    for folder in &plan.folders {
        prepare_folder(folder)?;
    }
    for name in &plan.stale {
        let path = plan.folder.join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                let error = anyhow::Error::from(error);
                return Err(error
                    .context(format!("cannot remove {}", path.display()))
                    .into());
            }
            _ => {}
        }
    }
    for file in &plan.files {
        let path = plan.folder.join(file.name);
        write(&path, file).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let advice = advised(prepared, request, manifest.cases, jobs);
    answer(arguments, &plan, request, blocks, advice)?;
    Ok(ExitStatus::Success)
}

fn answer(
    arguments: &StudyArguments,
    plan: &LaunchPlan,
    request: LaunchRequest,
    blocks: u64,
    advice: Vec<String>,
) -> Result<()> {
    if arguments.results.json {
        let files = plan.files.iter().map(|file| file.name.to_owned());
        let steps = plan.steps.iter();
        return print_json(&LaunchAnswer {
            schema_version: 1,
            folder: plan.folder.display().to_string(),
            shards: request.shards,
            blocks,
            files: files.collect(),
            steps: steps
                .map(|step| StepAnswer {
                    does: step.does,
                    line: step.line.clone(),
                })
                .collect(),
            advice,
        });
    }
    let names: Vec<&str> = plan.files.iter().map(|file| file.name).collect();
    let mut lines = vec![format!("{}: {}", shown(&plan.folder), names.join(", "))];
    for step in &plan.steps {
        lines.push(format!("{}:\n  {}", step.does, step.line));
    }
    print_text(&lines.join("\n"))?;
    for line in advice {
        complain(&format!("note: {line}"));
    }
    Ok(())
}

fn write(path: &Path, file: &LaunchFile) -> std::io::Result<()> {
    write_atomically(path, file.text.as_bytes())?;
    #[cfg(unix)]
    if file.is_executable() {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755))?;
    }
    Ok(())
}

/// Advice on the number of shards, from the time of a few cases.
fn advised(prepared: &PreparedStudy, request: LaunchRequest, cases: u64, jobs: u16) -> Vec<String> {
    let evaluator = StudyEvaluator::new(&prepared.study, &prepared.design, &prepared.columns);
    let mut lines = match time_per_case(&evaluator, cases) {
        Ok(each) => advice(request, cases, jobs, each),
        Err(error) => vec![format!("time per shard unknown: {error}")],
    };
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let processes = u64::from(request.shards) * u64::from(jobs);
    if request.launcher == Launcher::Local && processes > cores as u64 {
        lines.push(format!(
            "all shards run simultaneously, and this machine has {cores} cores"
        ));
    }
    lines
}

/// The robot arguments, as options.
fn options(robot: &RobotArguments) -> Vec<String> {
    let path = |path: &PathBuf| path.display().to_string();
    let urdf = &robot.urdf;
    let mut options = Vec::new();
    let mut add = |name: &str, value: Option<String>| {
        options.extend(value.map(|value| format!("--{name}={value}")));
    };
    add("arm", robot.arm.clone());
    add("robot", urdf.robot.as_ref().map(path));
    for argument in &urdf.xacro {
        add("xacro", Some(argument.clone()));
    }
    add("prefix", urdf.prefix.clone());
    for package in &urdf.package_path {
        add("package-path", Some(package.clone()));
    }
    add("calibration", urdf.calibration.as_ref().map(path));
    add(
        "missing-inertia",
        urdf.missing_inertia.as_ref().map(ToString::to_string),
    );
    options
}
