//! `needlebench ct synth`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use nalgebra::Vector3;
use needlebench_input::{FileKind, Finding, read_text};
use needlebench_parallel::Progress;
use needlebench_patient::ct::{
    CtSubject, Materials, ScanOrder, ScanRange, SyntheticScan, marker_list,
};
use needlebench_phantom::{Phantom, PhantomParameters, SIZE_PRESETS};
use needlebench_report::write_atomically;
use needlebench_scenario::scenario::MarkerKind;
use needlebench_scenario::{ResolvedScenario, load_scenario};
use needlebench_synthesis::{
    Kernel, Noise, Overshoot, ScanPreset, Scanner, SliceProfile, Streaks, label, synthesise_watched,
};
use needlebench_volume::VolumeError;
use needlebench_volume::write::{DicomSeries, write_dicom, write_label_nifti, write_nifti};
use serde::Serialize;

use crate::arguments::RobotArguments;
use crate::command::results_folder::ResultsFolder;
use crate::command::{overrides, print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::watch_interrupts;
use crate::output::shown;
use crate::progress::TerminalProgress;

/// What `ct synth --help` prints after the options.
pub(crate) const SYNTH_HELP: &str = "\
Example: needlebench ct synth scenarios/supine_suite.toml --out out/ct --preset biopsy --markers ct-sphere

Writes into DIR:
  ct.nii.gz, dicom/   the volume, as --format says
  labels.nii.gz       label map by voxel centres; names in labels.json
  truth.json          scanner, materials, transforms (robot_from_ct of a scenario), lesions, markers; m and rad
  lesions.json, markers.json
  marker_list.toml    spheres as digitised with the robot, for `ct build --markers`; of a phantom alone, in its drawing

Frame ct is the patient's LPS frame. The same file, options and seed give the same bytes.";

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch of the command line"
)]
pub(crate) struct SynthArguments {
    /// Scenario with a phantom, file of phantom sizes, or a bundled size, e.g. male-p50-supine.
    #[arg(value_name = "SCENARIO|PHANTOM")]
    subject: PathBuf,
    /// Folder for the volume and its ground truth.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Slice thickness and spacing: 1 mm, 2.5 mm, 5 mm, or 5 mm every 2.5 mm.
    #[arg(long, value_enum, default_value = "thin")]
    preset: PresetArgument,
    /// File format of the volume.
    #[arg(long, value_enum, default_value = "nifti")]
    format: FormatArgument,
    /// Seed of the noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Reconstruction kernel; sets blur and noise unless they are given.
    #[arg(long, value_enum, default_value = "smooth")]
    kernel: KernelArgument,
    /// Slice thickness, mm [default: by preset].
    #[arg(long, value_name = "MM", value_parser = positive)]
    thickness_mm: Option<f64>,
    /// Slice spacing, mm [default: by preset].
    #[arg(long, value_name = "MM", value_parser = positive)]
    increment_mm: Option<f64>,
    /// Slice sensitivity profile.
    #[arg(long, value_enum, default_value = "box")]
    profile: ProfileArgument,
    /// Number of columns and of rows of a slice.
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u16).range(16..=4096))]
    pixels: u16,
    /// Pixel spacing, mm [default: 0.7, or larger if the body requires it].
    #[arg(long, value_name = "MM", value_parser = positive)]
    pixel_mm: Option<f64>,
    /// Lowest and highest slice along the patient, mm in ct [default: the whole chest].
    #[arg(long, value_name = "LOW,HIGH", value_parser = numbers::<2>, allow_hyphen_values = true)]
    range_mm: Option<Numbers<2>>,
    /// Standard deviation of the noise at the centre, for 1 mm slices and dose 1, HU; 0 for none [default: by kernel].
    #[arg(long, value_name = "HU", value_parser = not_negative)]
    noise: Option<f64>,
    /// Relative dose; noise scales with 1/sqrt(dose x slice thickness).
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = positive)]
    dose: f64,
    /// Standard deviation of the in-plane blur, mm; 0 for none [default: by kernel].
    #[arg(long, value_name = "MM", value_parser = not_negative)]
    blur_mm: Option<f64>,
    /// Add edge overshoot, as of edge-enhancing kernels.
    #[arg(long)]
    overshoot: bool,
    /// Add streak artefacts.
    #[arg(long)]
    streaks: bool,
    /// Gantry tilt, deg; positive: the lower ends of the slices lean towards the feet.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = tilt, allow_hyphen_values = true)]
    tilt: f64,
    /// Rotation of the patient about the long axis, relative to the patient position, deg.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = finite, allow_hyphen_values = true)]
    turn: f64,
    /// Position of the phantom's origin in ct, mm.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    shift_mm: Option<Numbers<3>>,
    /// Voxel axis orientation: patient sides towards which columns, rows and slices increase, L or R, P or A, S or I.
    #[arg(long, value_name = "LPS", default_value = "LPS", value_parser = axes)]
    axes: [bool; 3],
    /// Kind of markers [default: that of the scenario or file].
    #[arg(long, value_enum)]
    markers: Option<MarkersArgument>,
    /// Hounsfield units of vessels; 150 to 300 with contrast medium [default: 45].
    #[arg(long, value_name = "HU", value_parser = finite)]
    vessels: Option<f64>,
    /// Fiducial localisation error of the positions in marker_list.toml: standard deviation per axis, mm.
    #[arg(long = "fle-sd-mm", alias = "touch-mm", value_name = "MM", default_value_t = 0.3, value_parser = positive)]
    touch_mm: f64,
    /// Leave out the couch under the patient.
    #[arg(long = "no-couch", alias = "no-bed")]
    no_bed: bool,
    /// Keep the corners outside the circular field of view.
    #[arg(long)]
    no_circle: bool,
    /// Do not write the label map.
    #[arg(long)]
    no_labels: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    #[command(flatten)]
    robot: RobotArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PresetArgument {
    Thin,
    Biopsy,
    Thick,
    ThickOverlap,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatArgument {
    Nifti,
    Dicom,
    Both,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KernelArgument {
    /// For soft tissue: blur of 0.55 mm, 20 HU.
    Smooth,
    /// For lung and bone: blur of 0.3 mm, 50 HU.
    Sharp,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ProfileArgument {
    /// Uniform over the slice thickness.
    Box,
    /// Gaussian with the slice thickness as full width at half maximum.
    Bell,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MarkersArgument {
    /// Plastic discs, isodense with skin.
    Disc,
    /// The discs on foam that contains a sphere.
    CtSphere,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers<const N: usize>(pub(super) [f64; N]);

fn finite(text: &str) -> Result<f64, String> {
    let value: f64 = text.trim().parse().map_err(|_| "not a number".to_owned())?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err("not a finite number".to_owned())
    }
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 {
        Ok(value)
    } else {
        Err("must be above 0".to_owned())
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value >= 0.0 {
        Ok(value)
    } else {
        Err("must be 0 or more".to_owned())
    }
}

fn tilt(text: &str) -> Result<f64, String> {
    /// Gantries reach 30 degrees.
    const MOST_DEG: f64 = 45.0;
    let value = finite(text)?;
    if value.abs() <= MOST_DEG {
        Ok(value)
    } else {
        Err(format!("must be within +-{MOST_DEG} deg"))
    }
}

pub(super) fn numbers<const N: usize>(text: &str) -> Result<Numbers<N>, String> {
    let values: Vec<f64> = text.split(',').map(finite).collect::<Result<_, _>>()?;
    <[f64; N]>::try_from(values)
        .map(Numbers)
        .map_err(|values| format!("expected {N} numbers, got {}", values.len()))
}

/// Whether each axis is opposite to that of `ct`.
fn axes(text: &str) -> Result<[bool; 3], String> {
    const SIDES: [[char; 2]; 3] = [['L', 'R'], ['P', 'A'], ['S', 'I']];
    let letters: Vec<char> = text.to_ascii_uppercase().chars().collect();
    let flipped = letters
        .iter()
        .zip(SIDES)
        .map(|(letter, sides)| sides.iter().position(|side| side == letter));
    let flipped: Option<Vec<bool>> = flipped.map(|place| Some(place? == 1)).collect();
    flipped
        .filter(|_| letters.len() == 3)
        .and_then(|flipped| flipped.try_into().ok())
        .ok_or_else(|| "expected three letters: L or R, then P or A, then S or I".to_owned())
}

/// The scanned object.
enum Subject {
    Scenario(Box<ResolvedScenario>),
    Phantom(Box<Phantom>),
}

/// The answer as JSON.
#[derive(Debug, Serialize)]
struct Made<'m> {
    schema_version: u32,
    folder: String,
    files: Vec<String>,
    truth: &'m needlebench_patient::ct::ScanTruth,
}

#[derive(Debug, Serialize)]
struct Listed<'l, T> {
    schema_version: u32,
    frame: &'static str,
    #[serde(flatten)]
    list: std::collections::BTreeMap<&'static str, &'l [T]>,
}

/// Synthesises a CT.
pub(crate) fn synth(arguments: &SynthArguments) -> Result<ExitStatus, Failure> {
    let subject = subject(arguments)?;
    let scan = described(arguments, &subject)?;
    let _taken = ResultsFolder::take(&arguments.out)?;
    let cancel = watch_interrupts()?;
    let progress = TerminalProgress::new(arguments.json);
    let made = make(arguments, &scan, &cancel, &progress);
    progress.finish();
    match made {
        Ok(files) => {
            write_truth(&arguments.out, &scan, &files, arguments)?;
            Ok(ExitStatus::Success)
        }
        Err(VolumeError::Interrupted) => Err(Failure::interrupted(
            "interrupted: incomplete files were not written",
        )),
        Err(VolumeError::Refused {
            place,
            message,
            hint,
        }) => {
            let place = place.unwrap_or_else(|| shown(&arguments.subject));
            let finding = Finding::new(place, message);
            Err(Failure::from(match hint {
                Some(hint) => finding.hint(hint),
                None => finding,
            }))
        }
    }
}

fn subject(arguments: &SynthArguments) -> Result<Subject, Failure> {
    let path = &arguments.subject;
    let name = path.to_string_lossy();
    if SIZE_PRESETS.contains(&&*name) && !path.exists() {
        let parameters = Phantom::size_preset(&name);
        return parameters
            .and_then(|parameters| build(parameters, arguments))
            .map_err(|error| Finding::new(name.clone(), error.to_string()).into());
    }
    if FileKind::of(path) == Some(FileKind::PhantomSizes) {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| Finding::new(&file, error.to_string()))?;
        return PhantomParameters::from_toml(&text)
            .and_then(|parameters| build(parameters, arguments))
            .map_err(|error| Finding::new(&file, error.to_string()).into());
    }
    let overrides = overrides(&arguments.robot)?;
    let resolved = load_scenario(path, &overrides)?;
    Ok(Subject::Scenario(Box::new(resolved)))
}

fn build(
    mut parameters: PhantomParameters,
    arguments: &SynthArguments,
) -> Result<Subject, needlebench_phantom::PhantomError> {
    if let Some(kind) = arguments.markers {
        parameters.marker_kind = kind.into();
    }
    Phantom::build(&parameters).map(|phantom| Subject::Phantom(Box::new(phantom)))
}

impl From<MarkersArgument> for MarkerKind {
    fn from(argument: MarkersArgument) -> Self {
        match argument {
            MarkersArgument::Disc => Self::Disc,
            MarkersArgument::CtSphere => Self::CtSphere,
        }
    }
}

fn described(arguments: &SynthArguments, subject: &Subject) -> Result<SyntheticScan, Finding> {
    let path = &arguments.subject;
    let refused = |message: String| Finding::new(path.display().to_string(), message);
    let order = order(arguments);
    let error = |error: VolumeError| refused(error.to_string());
    match subject {
        Subject::Phantom(phantom) => {
            SyntheticScan::new(&CtSubject::of_phantom(path, phantom), &order).map_err(error)
        }
        Subject::Scenario(resolved) => {
            let placed = resolved.phantom.as_ref();
            let remade = match (
                arguments.markers,
                placed.and_then(|placed| placed.phantom.parameters.clone()),
            ) {
                (Some(kind), Some(parameters)) if parameters.marker_kind != kind.into() => Some(
                    Phantom::build(&PhantomParameters {
                        marker_kind: kind.into(),
                        ..parameters
                    })
                    .map_err(|error| refused(error.to_string()))?,
                ),
                _ => None,
            };
            let mut subject = CtSubject::of_scenario(path, resolved).ok_or_else(|| {
                refused("the scenario has no phantom to scan".to_owned()).key("phantom")
            })?;
            if let Some(phantom) = &remade {
                if !resolved.phantom_parts.is_empty() {
                    return Err(refused(
                        "its phantom has parts from files; --markers applies to the built-in phantom only"
                            .to_owned(),
                    )
                    .key("phantom.parts")
                    .hint("write `markers = \"ct_sphere\"` under [phantom]"));
                }
                subject.phantom = phantom;
            }
            SyntheticScan::new(&subject, &order).map_err(error)
        }
    }
}

fn order(arguments: &SynthArguments) -> ScanOrder {
    let preset = match arguments.preset {
        PresetArgument::Thin => ScanPreset::Thin,
        PresetArgument::Biopsy => ScanPreset::Biopsy,
        PresetArgument::Thick => ScanPreset::Thick,
        PresetArgument::ThickOverlap => ScanPreset::ThickOverlap,
    };
    let metres = |mm: f64| 1e-3 * mm;
    let [thickness_m, increment_m] = preset.thickness_and_increment_m();
    let materials = Materials::default();
    ScanOrder {
        scanner: scanner(
            arguments,
            arguments.thickness_mm.map_or(thickness_m, metres),
        ),
        increment_m: arguments.increment_mm.map_or(increment_m, metres),
        size: usize::from(arguments.pixels),
        pixel_m: arguments.pixel_mm.map(metres),
        range: match arguments.range_mm {
            Some(Numbers(heights_mm)) => ScanRange::Heights(heights_mm.map(metres)),
            None => ScanRange::Whole(metres(5.0)),
        },
        tilt_rad: arguments.tilt.to_radians(),
        turn_rad: arguments.turn.to_radians(),
        off_middle: Vector3::zeros(),
        shift_m: arguments
            .shift_mm
            .map_or_else(Vector3::zeros, |Numbers(mm)| Vector3::from(mm) * 1e-3),
        flipped: arguments.axes,
        has_bed: !arguments.no_bed,
        materials: Materials {
            vessel: arguments.vessels.unwrap_or(materials.vessel),
            ..materials
        },
        seed: arguments.seed,
    }
}

fn scanner(arguments: &SynthArguments, thickness_m: f64) -> Scanner {
    let kernel = match arguments.kernel {
        KernelArgument::Smooth => Kernel::Smooth,
        KernelArgument::Sharp => Kernel::Sharp,
    };
    let plain = Scanner::new(thickness_m, kernel);
    let usual = Noise::of(kernel);
    let sd_hu = arguments.noise.unwrap_or(usual.sd_hu);
    Scanner {
        slice_profile: match arguments.profile {
            ProfileArgument::Box => SliceProfile::Box,
            ProfileArgument::Bell => SliceProfile::Bell,
        },
        psf_sigma_m: arguments.blur_mm.map_or(plain.psf_sigma_m, |mm| 1e-3 * mm),
        overshoot: arguments.overshoot.then_some(Overshoot::USUAL),
        noise: (sd_hu > 0.0).then_some(Noise {
            sd_hu,
            dose: arguments.dose,
            ..usual
        }),
        streaks: arguments.streaks.then_some(Streaks::USUAL),
        has_circle: !arguments.no_circle,
        ..plain
    }
}

/// Synthesises and writes volume and labels; returns the names of the files.
fn make(
    arguments: &SynthArguments,
    scan: &SyntheticScan,
    cancel: &AtomicBool,
    progress: &TerminalProgress,
) -> Result<Vec<String>, VolumeError> {
    let threads = arguments.jobs.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    );
    let place = |name: &str| arguments.out.join(name);
    let truth = &scan.truth;
    progress.message("scanning");
    progress.expect(scan.grid.size()[2] as u64);
    let volume = synthesise_watched(
        &scan.scene,
        &truth.scanner,
        &scan.grid,
        truth.seed,
        threads,
        cancel,
        &|| progress.step(),
    )?;
    progress.message("writing");
    let mut files = Vec::new();
    if arguments.format != FormatArgument::Dicom {
        write_nifti(&place("ct.nii.gz"), &volume, cancel)?;
        files.push("ct.nii.gz".to_owned());
    }
    if arguments.format != FormatArgument::Nifti {
        write_dicom(&place("dicom"), &volume, &series(arguments, scan), cancel)?;
        files.push("dicom".to_owned());
    }
    drop(volume);
    if !arguments.no_labels {
        progress.message("labels");
        let map = label(&scan.scene, &scan.grid, threads, cancel)?;
        write_label_nifti(&place("labels.nii.gz"), &map, cancel)?;
        files.push("labels.nii.gz".to_owned());
    }
    Ok(files)
}

fn series(arguments: &SynthArguments, scan: &SyntheticScan) -> DicomSeries {
    let [x, y, _] = scan.truth.down;
    let position = match () {
        () if x > 0.5 => "HFDL",
        () if x < -0.5 => "HFDR",
        () if y < 0.0 => "HFP",
        () => "HFS",
    };
    let kernel = match arguments.kernel {
        KernelArgument::Smooth => "SMOOTH",
        KernelArgument::Sharp => "SHARP",
    };
    DicomSeries {
        patient_id: scan.truth.subject.clone(),
        description: format!(
            "synthetic CT {} mm",
            1e3 * scan.truth.scanner.slice_thickness_m
        ),
        kernel: kernel.to_owned(),
        gantry_tilt_rad: scan.truth.gantry_tilt_rad,
        patient_position: position.to_owned(),
        has_padding: scan.truth.scanner.has_circle,
    }
}

/// Writes the ground truth beside the volume, and prints a summary.
fn write_truth(
    out: &Path,
    scan: &SyntheticScan,
    files: &[String],
    arguments: &SynthArguments,
) -> Result<()> {
    #[derive(Serialize)]
    struct Name<'n> {
        label: u16,
        name: &'n str,
    }
    let truth = &scan.truth;
    let names: Vec<Name> = scan
        .scene
        .names
        .iter()
        .map(|(label, name)| Name {
            label: *label,
            name,
        })
        .collect();
    let mut files = files.to_vec();
    let mut write = |name: &str, text: serde_json::Result<String>| -> Result<()> {
        let text = text.map_err(std::io::Error::from)?;
        write_atomically(&out.join(name), format!("{text}\n").as_bytes())
            .with_context(|| shown(&out.join(name)))?;
        files.push(name.to_owned());
        Ok(())
    };
    write("truth.json", serde_json::to_string_pretty(truth))?;
    write(
        "lesions.json",
        serde_json::to_string_pretty(&listed("lesions", &truth.lesions)),
    )?;
    write(
        "markers.json",
        serde_json::to_string_pretty(&listed("markers", &truth.markers)),
    )?;
    if let Some(list) = marker_list(scan, MarkerKind::CtSphere, 1e-3 * arguments.touch_mm) {
        let text = list.text().map_err(anyhow::Error::msg)?;
        write("marker_list.toml", Ok(text.trim_end().to_owned()))?;
    }
    if !arguments.no_labels {
        write(
            "labels.json",
            serde_json::to_string_pretty(&listed("labels", &names)),
        )?;
    }
    if arguments.json {
        return print_json(&Made {
            schema_version: 1,
            folder: out.display().to_string(),
            files,
            truth,
        });
    }
    print_text(&said(out, scan, &files))
}

fn listed<'l, T>(key: &'static str, list: &'l [T]) -> Listed<'l, T> {
    Listed {
        schema_version: 1,
        frame: "ct",
        list: std::collections::BTreeMap::from([(key, list)]),
    }
}

fn said(out: &Path, scan: &SyntheticScan, files: &[String]) -> String {
    let [columns, rows, slices] = scan.grid.size();
    let [width, height, apart] = scan.grid.spacing_m().map(|step_m| 1e3 * step_m);
    let truth = &scan.truth;
    let seen = truth
        .markers
        .iter()
        .filter(|marker| marker.sphere_center_m.is_some())
        .count();
    let noise = truth.scanner.noise.map_or_else(
        || "no noise".to_owned(),
        |noise| {
            format!(
                "noise {:.1} HU at the centre",
                noise.in_middle_hu(truth.scanner.slice_thickness_m)
            )
        },
    );
    let mut lines = vec![
        format!(
            "{}: {columns} x {rows} x {slices} voxels of {width:.3} x {height:.3} x {apart:.3} mm",
            truth.subject
        ),
        format!(
            "slice thickness {} mm, blur {} mm, {noise}, seed {}",
            1e3 * truth.scanner.slice_thickness_m,
            1e3 * truth.scanner.psf_sigma_m,
            truth.seed
        ),
        format!(
            "{} lesions, {} markers, {seen} of them with a sphere visible in CT",
            truth.lesions.len(),
            truth.markers.len()
        ),
    ];
    if seen == 0 && !truth.markers.is_empty() {
        lines.push("these markers are isodense with skin; use `--markers ct-sphere`, or `markers = \"ct_sphere\"` under [phantom]".to_owned());
    }
    lines.push(format!("results: {} ({})", shown(out), files.join(", ")));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_sides_of_the_patient() {
        assert_eq!(axes("LPS"), Ok([false; 3]));
        assert_eq!(axes("ras"), Ok([true, true, false]));
        for wrong in ["", "LP", "LPSS", "PLS", "LPX"] {
            assert!(axes(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn lists_of_numbers_have_their_length() {
        assert_eq!(
            numbers::<3>("1, -2.5,3").map(|it| it.0),
            Ok([1.0, -2.5, 3.0])
        );
        assert_eq!(
            numbers::<2>("1,2,3").map(|it| it.0),
            Err("expected 2 numbers, got 3".to_owned())
        );
        assert!(numbers::<2>("1,nan").is_err());
    }
}
