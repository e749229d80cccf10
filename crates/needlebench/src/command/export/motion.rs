//! Exports of one motion, to a goal in a configuration, by an engine.

use std::path::{Path, PathBuf};

use anyhow::Result;
use needlebench_bench::motion::{MotionChoice, NoMotion, WorkingMotion};
use needlebench_export::{
    ExportError, ExportedFile, Motion, TrajectoryNotation, mcap, motion_script, trajectory,
};
use needlebench_input::Finding;
use needlebench_parallel::Control;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::EngineName;

use super::{ExportArguments, Format, configuration_named, finish, place};
use crate::arguments::EngineArgument;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::{threads, watch_interrupts};
use crate::progress::TerminalProgress;

use super::super::results_folder::prepare_folder;

/// Default engine: it has no requirements besides the program.
const ENGINE: &str = "rapier";

/// Notations of a trajectory with the extensions of their files.
const NOTATIONS: [(&str, TrajectoryNotation); 4] = [
    ("json", TrajectoryNotation::Json),
    ("yaml", TrajectoryNotation::Yaml),
    ("yml", TrajectoryNotation::Yaml),
    ("csv", TrajectoryNotation::Csv),
];

/// Runs the goal and writes the requested motion.
pub(super) fn export(
    arguments: &ExportArguments,
    resolved: &ResolvedScenario,
) -> Result<ExitStatus, Failure> {
    let choice = choice(arguments)?;
    let named = named(arguments, resolved)?;
    // Before a run that takes seconds.
    let folder = named.as_ref().map_or_else(
        || Path::new("out").join(&resolved.scenario.name),
        |named| named.folder.clone(),
    );
    prepare_folder(&folder)?;
    let progress = TerminalProgress::new(false);
    let cancel = watch_interrupts()?;
    let control = Control {
        threads: threads(None),
        cancel: &cancel,
        progress: &progress,
    };
    let working = WorkingMotion::of(resolved, &choice, &control);
    progress.finish();
    let working = working.map_err(|reason| match reason {
        NoMotion::Refused(finding) => finding.into(),
        NoMotion::Engine(message) => Failure::Ended {
            status: ExitStatus::EnvironmentFailed,
            message: format!("the engine failed: {message}"),
        },
        NoMotion::Interrupted => Failure::interrupted("interrupted: nothing was exported"),
    })?;
    let motion = Motion::of(&working);
    let files = files(arguments.format, &motion, named.as_ref())
        .map_err(|error| Finding::new(&resolved.source.file, error.to_string()))?;
    finish(arguments, resolved, &folder, &files)
}

/// The file that is named.
struct Named {
    folder: PathBuf,
    name: String,
    /// Extension in small letters, without its dot.
    extension: String,
}

fn named(
    arguments: &ExportArguments,
    resolved: &ResolvedScenario,
) -> Result<Option<Named>, Finding> {
    let Some(out) = &arguments.out else {
        return Ok(None);
    };
    let (folder, stem, dotted) = place(arguments, resolved)?;
    let extension = dotted.trim_start_matches('.').to_ascii_lowercase();
    let known = NOTATIONS.iter().any(|(known, _)| *known == extension);
    if arguments.format == Format::Trajectory && !known {
        let finding = Finding::new(
            out.display().to_string(),
            "a trajectory is written as JSON, YAML or CSV, selected by the file extension",
        );
        return Err(finding
            .key("--out")
            .hint("name a file that ends in .json, .yaml or .csv"));
    }
    Ok(Some(Named {
        folder,
        name: format!("{stem}{dotted}"),
        extension,
    }))
}

fn choice(arguments: &ExportArguments) -> Result<MotionChoice, Finding> {
    let engines = arguments.engine.as_ref().map(EngineArgument::names);
    let engine = match engines.as_deref() {
        None => EngineName(ENGINE.to_owned()),
        Some([engine]) => engine.clone(),
        Some(several) => {
            let message = format!(
                "{} engines are named; a motion requires exactly one",
                several.len()
            );
            let finding = Finding::new("the command line", message).key("--engine");
            return Err(finding.hint("name one engine"));
        }
    };
    let configuration = arguments.configuration.as_deref();
    Ok(MotionChoice {
        goal: arguments.goal.clone(),
        configuration: configuration.map(configuration_named).transpose()?,
        engine,
    })
}

/// The files: the named one, or those of goal and configuration in a separate folder, which a run does not modify.
fn files(
    format: Format,
    motion: &Motion<'_>,
    named: Option<&Named>,
) -> Result<Vec<ExportedFile>, ExportError> {
    let stem = format!("export/{}/{}", motion.goal.name, motion.configuration);
    let name = |own: String| named.map_or(own, |named| named.name.clone());
    match format {
        Format::Urscript => {
            let own = format!("{stem}.script");
            Ok(vec![motion_script(motion, &name(own))?])
        }
        Format::Trajectory => {
            let notations = NOTATIONS
                .iter()
                .filter(|(extension, notation)| match named {
                    Some(named) => *extension == named.extension,
                    None => *extension != "yml" || *notation != TrajectoryNotation::Yaml,
                });
            let one = |(extension, notation): &(&str, TrajectoryNotation)| {
                let own = format!("{stem}.trajectory.{extension}");
                trajectory(motion, *notation, &name(own))
            };
            Ok(notations.map(one).collect())
        }
        _ => {
            let own = format!("{stem}.{}.mcap", motion.recorded.engine);
            Ok(vec![mcap(motion, &name(own))?])
        }
    }
}
