//! `needlebench init`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use needlebench_bench::{Starter, StarterOptions, Template, starter, starter_study};
use needlebench_input::{Finding, nearest_name};
use needlebench_parallel::Control;
use needlebench_patient::SuggestError;
use needlebench_phantom::{Phantom, SIZE_PRESETS};
use needlebench_report::write_atomically;
use needlebench_robot::Arm;
use needlebench_scenario::scenario::shipped_tools;
use serde::Serialize;

use super::schema::{SchemaFormat, document};
use super::{overrides, print_json, print_text};
use crate::arguments::RobotArguments;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::findings::print_findings;
use crate::interrupts::watch_interrupts;
use crate::output::shown;
use crate::progress::TerminalProgress;

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches of the command line"
)]
pub(crate) struct InitArguments {
    /// File to write, or a folder for `first.toml`.
    #[arg(value_name = "FILE|DIR", default_value = "first.toml")]
    pub path: PathBuf,
    /// Template.
    #[arg(long, value_enum, default_value = "table")]
    pub from: FromArgument,
    /// Bundled arm.
    #[arg(long, value_name = "ARM", default_value = "ur3")]
    pub arm: String,
    /// Bundled phantom, by patient size.
    #[arg(long, value_name = "NAME", default_value = "male-p50-supine")]
    pub phantom: String,
    /// Lesion of the phantom [default: one that is feasible for the template's robot].
    #[arg(long, value_name = "NAME")]
    pub lesion: Option<String>,
    /// Also write a small study of the scenario beside it.
    #[arg(long)]
    pub study: bool,
    /// Replace existing files.
    #[arg(long)]
    pub force: bool,
    /// List the available arms, tools, phantoms, lesions and templates; write nothing.
    #[arg(long)]
    pub list: bool,
    /// With --list: print one JSON document.
    #[arg(long, requires = "list")]
    pub json: bool,
}

/// Templates of a first scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FromArgument {
    /// Robot on a column beside the CT table, patient supine.
    Table,
    /// Robot hanging from the ceiling, patient supine.
    Hanging,
    /// Robot on a column behind a patient in left lateral position.
    Lateral,
}

impl From<FromArgument> for Template {
    fn from(argument: FromArgument) -> Self {
        match argument {
            FromArgument::Table => Self::Table,
            FromArgument::Hanging => Self::Hanging,
            FromArgument::Lateral => Self::Lateral,
        }
    }
}

/// The available choices.
#[derive(Serialize)]
struct Choices {
    schema_version: u32,
    templates: Vec<[&'static str; 2]>,
    arms: Vec<&'static str>,
    tools: Vec<String>,
    phantoms: Vec<&'static str>,
    /// Name of the requested phantom.
    phantom: String,
    lesions: Vec<LesionChoice>,
}

#[derive(Serialize)]
struct LesionChoice {
    name: String,
    /// Left, posterior, superior from mid-chest.
    center_m: [f64; 3],
    diameter_m: f64,
}

/// Writes a first scenario, or lists the choices.
pub(crate) fn init(arguments: &InitArguments) -> Result<ExitStatus, Failure> {
    let choices = choices(arguments)?;
    if arguments.list {
        if arguments.json {
            print_json(&choices)?;
        } else {
            print_text(&choices.in_words())?;
        }
        return Ok(ExitStatus::Success);
    }
    let (path, options) = options(arguments, &choices)?;
    let cancel = watch_interrupts()?;
    let progress = TerminalProgress::new(false);
    let control = Control {
        threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        cancel: &cancel,
        progress: &progress,
    };
    let overrides = overrides(&RobotArguments::default())?;
    let made = starter(&path.display().to_string(), &options, &overrides, &control);
    progress.finish();
    match made {
        Ok(starter) => {
            write_files(arguments, &path, &options, &starter)?;
            print_text(&said(arguments, &path, &options, &starter))?;
            Ok(ExitStatus::Success)
        }
        Err(SuggestError::Interrupted) => Err(Failure::interrupted("interrupted")),
        Err(SuggestError::Refused { message, hint }) => {
            let message = format!("no scenario with these options passes: {message}");
            print_findings(&[Finding::new("the command line", message).hint(hint)]);
            Ok(ExitStatus::CriterionFailed)
        }
    }
}

/// The available choices, with the lesions of the requested phantom.
fn choices(arguments: &InitArguments) -> Result<Choices, Finding> {
    let lesions = Phantom::size_preset(&arguments.phantom)
        .map_err(|_| unknown("--phantom", &arguments.phantom, &SIZE_PRESETS))?
        .lesions;
    Ok(Choices {
        schema_version: 1,
        templates: Template::ALL
            .map(|each| [each.name(), each.in_words()])
            .to_vec(),
        arms: Arm::shipped_names().collect(),
        tools: shipped_tools(),
        phantoms: SIZE_PRESETS.to_vec(),
        phantom: arguments.phantom.clone(),
        lesions: lesions
            .into_iter()
            .map(|lesion| LesionChoice {
                name: lesion.name,
                center_m: lesion.center_mm.map(|mm| mm * 1e-3),
                diameter_m: lesion.diameter_mm * 1e-3,
            })
            .collect(),
    })
}

fn unknown(argument: &str, given: &str, known: &[&str]) -> Finding {
    let finding = Finding::new("the command line", format!("there is no `{given}`")).key(argument);
    let near = nearest_name(given, known.iter().copied());
    finding.hint(match near {
        Some(near) => format!("did you mean `{near}`? There are {}", known.join(", ")),
        None => format!("there are {}", known.join(", ")),
    })
}

/// The file and its content.
fn options(
    arguments: &InitArguments,
    choices: &Choices,
) -> Result<(PathBuf, StarterOptions), Finding> {
    let template = Template::from(arguments.from);
    let lesion = arguments
        .lesion
        .clone()
        .unwrap_or_else(|| template.lesion().to_owned());
    let arms = &choices.arms;
    if !arms.contains(&arguments.arm.as_str()) {
        return Err(unknown("--arm", &arguments.arm, arms));
    }
    let lesions: Vec<&str> = choices
        .lesions
        .iter()
        .map(|each| each.name.as_str())
        .collect();
    if !lesions.contains(&lesion.as_str()) {
        return Err(unknown("--lesion", &lesion, &lesions));
    }
    let is_folder =
        arguments.path.is_dir() || arguments.path.as_os_str().to_string_lossy().ends_with('/');
    let path = if is_folder {
        arguments.path.join("first.toml")
    } else {
        arguments.path.clone()
    };
    let file = path.display().to_string();
    let is_toml = path.extension().is_some_and(|ending| ending == "toml");
    let name = path
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or_default();
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if !is_toml || name.is_empty() || !name.chars().all(is_name) {
        return Err(Finding::new(&file, "not a valid name for a scenario file").hint(
            "use letters, digits, `-` and `_`, and the extension `.toml`: the results folder has the same name",
        ));
    }
    let written = [
        Some(path.clone()),
        arguments.study.then(|| study_path(&path, name)),
    ];
    for path in written.into_iter().flatten() {
        if path.exists() && !arguments.force {
            let file = path.display().to_string();
            return Err(Finding::new(file, "the file exists already")
                .hint("choose another name, or add --force"));
        }
    }
    let options = StarterOptions {
        name: name.to_owned(),
        template,
        arm: arguments.arm.clone(),
        phantom: arguments.phantom.clone(),
        lesion,
    };
    Ok((path, options))
}

fn study_path(path: &Path, name: &str) -> PathBuf {
    path.with_file_name(format!("{name}_study.toml"))
}

fn write_files(
    arguments: &InitArguments,
    path: &Path,
    options: &StarterOptions,
    starter: &Starter,
) -> Result<()> {
    let write = |path: &Path, text: &str| {
        write_atomically(path, text.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot create the folder {}", folder.display()))?;
    }
    write(path, &starter.text)?;
    // Written by the program, so that an older one can be replaced.
    let schema = |format: SchemaFormat| -> Result<String> {
        Ok(serde_json::to_string_pretty(&document(format))? + "\n")
    };
    write(
        &path.with_file_name("scenario.schema.json"),
        &schema(SchemaFormat::Scenario)?,
    )?;
    if arguments.study {
        write(
            &study_path(path, &options.name),
            &starter_study(&options.name),
        )?;
        write(
            &path.with_file_name("study.schema.json"),
            &schema(SchemaFormat::Study)?,
        )?;
    }
    Ok(())
}

fn said(
    arguments: &InitArguments,
    path: &Path,
    options: &StarterOptions,
    starter: &Starter,
) -> String {
    let entry = &starter.entry;
    let mut text = format!(
        "{}: {} for {}, {}\n  insertion depth {:.0} mm; {} of 8 configurations feasible (postures only)\n",
        shown(path),
        options.arm,
        options.lesion,
        options.template.in_words(),
        entry.depth_m * 1e3,
        entry.working,
    );
    if let Some(place) = &starter.place {
        let [x, y, z] = place.position_mm;
        let _ = writeln!(
            text,
            "  base moved to [{x}, {y}, {z}] mm: this lesion is infeasible from the default placement"
        );
    }
    let _ = writeln!(text, "  also written: scenario.schema.json, for editors");
    text += "next:\n";
    let path = shown(path);
    let mut next = vec![
        (
            format!("needlebench run {path}"),
            "full run with report page",
        ),
        (
            format!("needlebench check {path}"),
            "quick check after each change",
        ),
        (
            format!("needlebench suggest {path}"),
            "other entries and base placements",
        ),
    ];
    if arguments.study {
        let study = study_path(Path::new(&path), &options.name);
        next.push((
            format!("needlebench study {}", shown(&study)),
            "tolerance to patient displacement",
        ));
    }
    let width = next
        .iter()
        .map(|(command, _)| command.len())
        .max()
        .unwrap_or(0);
    for (command, why) in next {
        let _ = writeln!(text, "  {command:width$}  {why}");
    }
    text.trim_end().to_owned()
}

impl Choices {
    fn in_words(&self) -> String {
        let mut text = String::from("--from\n");
        for [name, words] in &self.templates {
            let _ = writeln!(text, "  {name:8} {words}");
        }
        let _ = writeln!(text, "--arm\n  {}", self.arms.join(", "));
        let _ = writeln!(text, "tools ([tool] urdf)\n  {}", self.tools.join(", "));
        let _ = writeln!(
            text,
            "--phantom: male and female, 5th, 50th and 95th percentile, supine (-supine) or upright\n  {}",
            self.phantoms.join(", ")
        );
        let _ = writeln!(
            text,
            "--lesion: in {}; left, posterior, superior from mid-chest, mm",
            self.phantom
        );
        for LesionChoice {
            name,
            center_m,
            diameter_m,
        } in &self.lesions
        {
            let [x, y, z] = center_m.map(|m| m * 1e3);
            let _ = writeln!(
                text,
                "  {name:17} {:2.0} mm at [{x:4.0}, {y:3.0}, {z:3.0}]",
                diameter_m * 1e3
            );
        }
        text.trim_end().to_owned()
    }
}
