//! `needlebench init`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use needlebench_bench::suggest::SuggestError;
use needlebench_bench::{Control, Starter, StarterOptions, Template, starter, starter_study};
use needlebench_cell::phantom::{Phantom, SIZE_PRESETS};
use needlebench_cell::scenario::shipped_tools;
use needlebench_cell::{Arm, Finding, nearest_name};
use needlebench_report::write_atomically;
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
    /// File to write, or a folder for a file of the name `first.toml`.
    #[arg(value_name = "FILE|DIR", default_value = "first.toml")]
    pub path: PathBuf,
    /// What to begin from.
    #[arg(long, value_enum, default_value = "table")]
    pub from: FromArgument,
    /// A shipped arm.
    #[arg(long, value_name = "ARM", default_value = "ur3")]
    pub arm: String,
    /// A shipped phantom: the patient's size.
    #[arg(long, value_name = "NAME", default_value = "male-p50-supine")]
    pub phantom: String,
    /// One of the phantom's lesions; one that the robot serves well if left out.
    #[arg(long, value_name = "NAME")]
    pub lesion: Option<String>,
    /// Write a small study of the scenario too, beside it.
    #[arg(long)]
    pub study: bool,
    /// Replace files that are there.
    #[arg(long)]
    pub force: bool,
    /// Write nothing, and say which arms, tools, phantoms, lesions and templates there are.
    #[arg(long)]
    pub list: bool,
    /// With --list: print one JSON document.
    #[arg(long, requires = "list")]
    pub json: bool,
}

/// What a scenario begins from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FromArgument {
    /// Robot on a column beside the CT table, patient on the back.
    Table,
    /// Robot hanging from the ceiling, patient on the back.
    Hanging,
    /// Robot on a column behind a patient on the left side.
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

/// What there is to choose from.
#[derive(Serialize)]
struct Choices {
    schema_version: u32,
    templates: Vec<[&'static str; 2]>,
    arms: Vec<&'static str>,
    tools: Vec<String>,
    phantoms: Vec<&'static str>,
    /// Of the phantom that is asked for.
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

/// Writes a first scenario, or says what there is.
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

/// What there is, with the lesions of the phantom that is asked for.
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

/// The file, and what is wanted in it.
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
        return Err(Finding::new(&file, "this is no name of a scenario's file").hint(
            "letters, digits, `-` and `_`, and the ending `.toml`: results go to a folder of that name",
        ));
    }
    let written = [
        Some(path.clone()),
        arguments.study.then(|| study_path(&path, name)),
    ];
    for path in written.into_iter().flatten() {
        if path.exists() && !arguments.force {
            let file = path.display().to_string();
            return Err(Finding::new(file, "there is such a file already")
                .hint("choose another name, or replace it with --force"));
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
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    write(path, &starter.text)?;
    // Made by the program, so that an older one is never worth keeping.
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
        "{}: {} for {}, {}\n  needle {:.0} mm deep, {} of 8 configurations can work (postures only, motions not planned)\n",
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
            "  the robot stands at [{x}, {y}, {z}] mm: from the usual place it does not serve this lesion"
        );
    }
    let _ = writeln!(
        text,
        "  beside it: scenario.schema.json, which editors read"
    );
    text += "next:\n";
    let path = shown(path);
    let mut next = vec![
        (
            format!("needlebench run {path}"),
            "all of it, with a page to look at",
        ),
        (
            format!("needlebench check {path}"),
            "after each change: what can work",
        ),
        (
            format!("needlebench suggest {path}"),
            "other entries, other places",
        ),
    ];
    if arguments.study {
        let study = study_path(Path::new(&path), &options.name);
        next.push((
            format!("needlebench study {}", shown(&study)),
            "how much the patient may be off",
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
            "--phantom: male and female, 5th, 50th and 95th percentile, lying (-supine) or upright\n  {}",
            self.phantoms.join(", ")
        );
        let _ = writeln!(
            text,
            "--lesion: of {}; left, posterior, superior from mid-chest, mm",
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
