//! `needlebench export`.

mod motion;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use needlebench_export::{ExportError, ExportedFile, Packing, Shown, gltf, markups, mjcf, urdf};
use needlebench_input::{Finding, nearest_name, sha256_hex};
use needlebench_kinematics::Joints;
use needlebench_kinematics::ik::Configuration;
use needlebench_patient::ct::ScanNeedles;
use needlebench_report::write_atomically;
use needlebench_scenario::ResolvedScenario;
use serde::Serialize;

use super::atlas::goals;
use super::results_folder::prepare_folder;
use super::{load, overrides, print_json, print_text};
use crate::arguments::{EngineArgument, EngineParser, RobotArguments, Six};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::shown;

#[derive(Debug, Args)]
pub(crate) struct ExportArguments {
    /// Scenario to export.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Format.
    #[arg(long = "as", value_name = "FORMAT", value_enum)]
    pub format: Format,
    /// Goal, for formats of a posture or a motion [default: the scenario's only goal].
    #[arg(long, value_name = "NAME")]
    pub goal: Option<String>,
    /// Configuration of the goal, e.g. Right-Up-Fold [default for a motion: the recommended one].
    #[arg(long, value_name = "CONFIGURATION")]
    pub configuration: Option<String>,
    /// Physics engine that simulates the motion, for formats of a motion [default: rapier].
    #[arg(long, value_name = "ENGINE", value_parser = EngineParser)]
    pub engine: Option<EngineArgument>,
    /// Joint positions, shoulder pan to wrist 3, rad, for formats of a posture.
    #[arg(
        long,
        value_name = "q1,..,q6",
        allow_hyphen_values = true,
        conflicts_with_all = ["goal", "configuration"]
    )]
    pub joints: Option<Six>,
    /// File to write; its other files are written beside it [default: a file of the scenario's name in out/NAME].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Export formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// The whole cell as a MuJoCo model.
    Mjcf,
    /// A motion as recorded by an engine, as ROS 2 messages in an MCAP file.
    Mcap,
    /// A planned motion as a ROS 2 joint trajectory: JSON, YAML or CSV.
    Trajectory,
    /// A planned motion as a URScript program for the arm's controller.
    Urscript,
    /// The whole cell as a robot description for ROS: URDF, SRDF and a package with their meshes.
    Urdf,
    /// The whole cell in a posture as a 3D scene, for Blender, slides and viewers: binary glTF.
    Gltf,
    /// Entry and target of each goal as markups of 3D Slicer over the scan, for a patient of `ct build`.
    Markups,
}

/// Properties of a format.
struct Traits {
    /// Extension of the file that people open.
    extension: &'static str,
    /// Its description.
    what: &'static str,
    /// It has one posture.
    posture: bool,
    /// It has one motion, to a goal in a configuration.
    motion: bool,
    /// It requires the recording of an engine.
    recording: bool,
}

impl Traits {
    /// Formats of one motion, whose feasibility a run in an engine confirms.
    fn of_motion(extension: &'static str, what: &'static str) -> Self {
        Self {
            extension,
            what,
            posture: false,
            motion: true,
            recording: true,
        }
    }
}

impl Format {
    fn traits(self) -> Traits {
        match self {
            Self::Mjcf => Traits {
                extension: "xml",
                what: "the cell as a MuJoCo model",
                posture: false,
                motion: false,
                recording: false,
            },
            Self::Mcap => Traits::of_motion("mcap", "a recorded motion as ROS 2 messages"),
            Self::Trajectory => Traits::of_motion("json", "a planned motion as a joint trajectory"),
            Self::Urscript => Traits::of_motion(
                "script",
                "a planned motion as a URScript program, not tested on a robot",
            ),
            Self::Urdf => Traits {
                extension: "urdf",
                what: "the cell as a robot description for ROS",
                posture: false,
                motion: false,
                recording: false,
            },
            Self::Gltf => Traits {
                extension: "glb",
                what: "the cell in a posture as a 3D scene",
                posture: true,
                motion: false,
                recording: false,
            },
            Self::Markups => Traits {
                extension: "mrk.json",
                what: "the needles as markups of 3D Slicer, in the coordinates of the scan",
                posture: false,
                motion: false,
                recording: false,
            },
        }
    }

    fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

#[derive(Serialize)]
struct ExportAnswer {
    schema_version: u32,
    scenario: String,
    format: String,
    files: Vec<FileAnswer>,
}

#[derive(Serialize)]
struct FileAnswer {
    name: String,
    bytes: usize,
    sha256: String,
}

/// What to export of the scenario.
struct Wanted<'a> {
    resolved: &'a ResolvedScenario,
    /// Name of the file that people open, without its extension.
    stem: &'a str,
    /// Packing of the requested file.
    packing: Packing,
    /// Index of a goal, and a configuration of it.
    chosen: Option<(usize, Configuration)>,
    /// A posture from the command line.
    joints: Option<Joints>,
}

impl Wanted<'_> {
    /// The posture.
    fn shown(&self) -> Shown {
        match (self.chosen, self.joints) {
            (Some((goal, configuration)), _) => Shown::Goal {
                goal,
                configuration,
            },
            (None, Some(joints)) => Shown::Joints(joints),
            (None, None) => Shown::Start,
        }
    }

    fn files(&self, format: Format) -> Result<Vec<ExportedFile>, ExportError> {
        match format {
            Format::Mjcf => mjcf(self.resolved, self.stem),
            Format::Mcap | Format::Trajectory | Format::Urscript => {
                unreachable!("motions are exported after a run")
            }
            Format::Markups => unreachable!("needles are placed in the scan first"),
            Format::Urdf => urdf(self.resolved, self.stem),
            Format::Gltf => gltf(self.resolved, self.stem, &self.shown(), self.packing),
        }
    }
}

/// Exports a scenario to another tool's format.
pub(crate) fn export(arguments: &ExportArguments) -> Result<ExitStatus, Failure> {
    check_options(arguments)?;
    let overrides = overrides(&arguments.robot)?;
    let resolved = load(&arguments.scenario, &overrides)?;
    if arguments.format.traits().motion {
        return motion::export(arguments, &resolved);
    }
    let chosen = chosen(arguments, &resolved)?;
    let joints = joints(arguments, &resolved)?;
    let scan = needles(arguments, &resolved)?;
    let (folder, stem, extension) = place(arguments, &resolved)?;
    prepare_folder(&folder)?;
    let wanted = Wanted {
        resolved: &resolved,
        stem: &stem,
        packing: if extension.eq_ignore_ascii_case(".gltf") {
            Packing::Separate
        } else {
            Packing::Binary
        },
        chosen,
        joints,
    };
    let mut files = match &scan {
        Some(scan) => markups(&resolved, scan, &stem),
        None => wanted
            .files(arguments.format)
            .map_err(|error| Finding::new(&resolved.source.file, error.to_string()))?,
    };
    if let Some((first, others)) = files.split_first_mut() {
        first.name = format!("{stem}{extension}");
        if others.iter().any(|other| other.name == first.name) {
            let message = format!("the export also writes another file named {}", first.name);
            return Err(Finding::new(&resolved.source.file, message)
                .key("--out")
                .hint("choose another extension, e.g. the default one of the format")
                .into());
        }
    }
    finish(arguments, &resolved, &folder, &files)
}

/// The needles in the coordinates of the scan, for the format that has them.
fn needles(
    arguments: &ExportArguments,
    resolved: &ResolvedScenario,
) -> Result<Option<ScanNeedles>, Failure> {
    if arguments.format != Format::Markups {
        return Ok(None);
    }
    let folder = arguments.scenario.parent().unwrap_or(Path::new(""));
    ScanNeedles::of(resolved, folder)
        .map(Some)
        .map_err(|stop| Failure::of_stop(stop, "interrupted"))
}

/// Writes and lists the files.
fn finish(
    arguments: &ExportArguments,
    resolved: &ResolvedScenario,
    folder: &Path,
    files: &[ExportedFile],
) -> Result<ExitStatus, Failure> {
    let written = write(folder, files)?;
    let traits = arguments.format.traits();
    if arguments.json {
        print_json(&ExportAnswer {
            schema_version: 1,
            scenario: resolved.scenario.name.clone(),
            format: arguments.format.name(),
            files: written,
        })?;
    } else {
        let mut lines = vec![format!("{}: {}", resolved.scenario.name, traits.what)];
        // A cell has up to a hundred surfaces: their folder is enough.
        let (shown_files, further) = written.split_at(written.len().min(MOST_FILES_SHOWN));
        lines.extend(
            shown_files
                .iter()
                .map(|file| format!("{} ({} bytes)", shown(Path::new(&file.name)), file.bytes)),
        );
        if !further.is_empty() {
            lines.push(format!("and {} more files", further.len()));
        }
        print_text(&lines.join("\n"))?;
    }
    Ok(ExitStatus::Success)
}

/// Number of files listed in the printed text.
const MOST_FILES_SHOWN: usize = 6;

/// Rejects options that do not apply to the format, instead of ignoring them.
fn check_options(arguments: &ExportArguments) -> Result<(), Finding> {
    let traits = arguments.format.traits();
    let choice = traits.posture || traits.motion;
    for (given, applies, option) in [
        (arguments.goal.is_some(), choice, "--goal"),
        (arguments.configuration.is_some(), choice, "--configuration"),
        (arguments.joints.is_some(), traits.posture, "--joints"),
        (arguments.engine.is_some(), traits.recording, "--engine"),
    ] {
        if given && !applies {
            let name = arguments.format.name();
            let finding = Finding::new(
                "the command line",
                format!(
                    "{option} does not apply to {name}, which is {}",
                    traits.what
                ),
            );
            return Err(finding.key(option).hint(format!("remove {option}")));
        }
    }
    Ok(())
}

/// The requested goal and configuration; none if none is named.
fn chosen(
    arguments: &ExportArguments,
    resolved: &ResolvedScenario,
) -> Result<Option<(usize, Configuration)>, Finding> {
    if arguments.goal.is_none() && arguments.configuration.is_none() {
        return Ok(None);
    }
    let found = goals(resolved, arguments.goal.as_deref())?;
    let &[goal] = found.as_slice() else {
        let names: Vec<&str> = resolved.goals.iter().map(|goal| &*goal.name).collect();
        let finding = Finding::new(
            &resolved.source.file,
            format!("the scenario has {} goals; --goal is missing", found.len()),
        );
        return Err(finding
            .key("--goal")
            .hint(format!("select one with --goal: {}", names.join(", "))));
    };
    let index = resolved
        .goals
        .iter()
        .position(|each| each.name == goal.name);
    let labels = || Configuration::ALL.map(Configuration::label);
    let Some(label) = arguments.configuration.as_deref() else {
        let finding = Finding::new("the command line", "--goal requires --configuration");
        return Err(finding
            .key("--configuration")
            .hint(format!("configurations: {}", labels().join(", "))));
    };
    let configuration = configuration_named(label)?;
    Ok(index.map(|index| (index, configuration)))
}

/// The configuration of a label.
fn configuration_named(label: &str) -> Result<Configuration, Finding> {
    let labels = || Configuration::ALL.map(Configuration::label);
    Configuration::from_label(label).ok_or_else(|| {
        let finding = Finding::new(
            "the command line",
            format!("there is no configuration `{label}`"),
        );
        let all = labels().join(", ");
        let hint = match nearest_name(label, labels()) {
            Some(near) => format!("did you mean `{near}`? Configurations: {all}"),
            None => format!("configurations: {all}"),
        };
        finding.key("--configuration").hint(hint)
    })
}

/// The given posture, checked against the joint limits.
fn joints(
    arguments: &ExportArguments,
    resolved: &ResolvedScenario,
) -> Result<Option<Joints>, Finding> {
    let Some(six) = &arguments.joints else {
        return Ok(None);
    };
    six.doubt_degrees();
    let q = Joints::from_column_slice(&six.0);
    let limits = &resolved.cell.robot.limits;
    let Some(joint) = limits.first_violation(&q) else {
        return Ok(Some(q));
    };
    let limit = &limits.0[joint];
    let finding = Finding::new(
        "the command line",
        format!(
            "{} is {} rad, outside its limits {:.4} to {:.4} rad",
            needlebench_kinematics::JOINT_LABELS[joint],
            q[joint],
            limit.lower_rad,
            limit.upper_rad
        ),
    );
    Err(finding
        .key("--joints")
        .hint("give six joint positions within the limits, in rad"))
}

/// Folder, name and extension (with its dot) of the file that people open.
fn place(
    arguments: &ExportArguments,
    resolved: &ResolvedScenario,
) -> Result<(PathBuf, String, String), Finding> {
    let extension = arguments.format.traits().extension;
    let Some(out) = &arguments.out else {
        let name = resolved.scenario.name.clone();
        return Ok((Path::new("out").join(&name), name, format!(".{extension}")));
    };
    let refuse = |message: &str| {
        let finding = Finding::new(out.display().to_string(), message);
        Err(finding
            .key("--out")
            .hint(format!("name a file, such as cell.{extension}")))
    };
    if out.is_dir() {
        return refuse("it is a folder");
    }
    let Some((stem, name)) = out
        .file_stem()
        .and_then(|stem| stem.to_str())
        .zip(out.file_name().and_then(|name| name.to_str()))
    else {
        return refuse("it is not a file name");
    };
    let folder = out.parent().map(Path::to_owned).unwrap_or_default();
    Ok((folder, stem.to_owned(), name[stem.len()..].to_owned()))
}

/// Writes the files, the one that people open last: where it is, the others are.
fn write(folder: &Path, files: &[ExportedFile]) -> Result<Vec<FileAnswer>> {
    let mut written = Vec::new();
    for file in files.iter().rev() {
        let path = folder.join(&file.name);
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent)
            .and_then(|()| write_atomically(&path, &file.bytes))
            .with_context(|| format!("cannot write {}", path.display()))?;
        written.push(FileAnswer {
            name: path.display().to_string(),
            bytes: file.bytes.len(),
            sha256: sha256_hex(&file.bytes),
        });
    }
    written.reverse();
    Ok(written)
}
