//! `needlebench ct build`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::{Args, ValueEnum};
use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_imaging::markers::MarkerModel;
use needlebench_imaging::registration::{ReferenceFrame, ReferenceMarker, Registration};
use needlebench_imaging::{AssumedBody, Label, LesionSeed, Outside, SurfaceSizes};
use needlebench_input::Finding;
use needlebench_parallel::Control;
use needlebench_patient::Stop;
use needlebench_patient::ct::{
    BuildFiles, BuildOptions, BuildReport, GivenLabels, KnownMarkers, PatientFrame, Registered,
    Room, SLICES, ScanBuild, SetAside, WrittenPatient, build, write_patient,
};
use needlebench_report::picture::{OVERVIEW, SlicePicture, scan_pictures};
use needlebench_report::table::overview::overview_text;
use needlebench_scenario::scenario::{GoalSection, Posture, Target};
use needlebench_scenario::{
    MarkerFrame, MarkerList, Overrides, load_open_scenario, name_from_file, resolve_open_scenario,
};
use needlebench_show::layout;
use needlebench_volume::read::{ReadVolume, read_label_names};
use serde::Serialize;

use super::info::ReadArguments;
use super::position;
use crate::arguments::{PicturesArguments, RobotArguments};
use crate::command::results_folder::ResultsFolder;
use crate::command::{overrides, print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::{Failure, status_of};
use crate::interrupts::watch_interrupts;
use crate::output::shown;
use crate::progress::TerminalProgress;

/// What `ct build --help` prints after the options.
pub(crate) const BUILD_HELP: &str = "\
Example: needlebench ct build scan.nii.gz --out out/patient --lesion nodule=-60,40,-112 --markers markers.toml

Writes into DIR:
  scenario.toml       ready for `run`, `check`, `suggest` and all other commands
  surfaces/           closed surfaces as STL, mm, LPS
  labels.nii.gz       label map; names in labels.json
  labels.seg.nrrd     the same for 3D Slicer, with --seg-nrrd
  volume.nii.gz       the volume aligned with the patient's axes, for `view`
  slices/             images of slices with the outlines of the surfaces; overview.png has all of it in one
  report.json         surfaces with their distance from the voxels, lesions, markers, registration, errors; m and rad

Positions are in the LPS frame of the scan (left, posterior, superior), mm. 3D Slicer shows RAS: change the sign of its
first two numbers.

MARKERS.toml: frame = \"base_link\", \"base\" (as shown by the controller) or \"drawing\"; sphere_mm; sd_mm; and for each
marker [[markers]] with name and position_mm. With \"base_link\" or \"base\" they register the robot to the patient.";

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches of the command line"
)]
pub(crate) struct BuildArguments {
    /// A DICOM file or folder, NIfTI, NRRD, MetaImage, MGH, or a ZIP of one.
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// Folder for the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed point in a lesion, mm in the scan (LPS); the lesion is segmented from it and becomes a goal.
    #[arg(long = "lesion", value_name = "NAME=X,Y,Z", value_parser = named_place, allow_hyphen_values = true)]
    lesions: Vec<NamedPlace>,
    /// The same as a voxel index, as viewers show it: column, row and slice in the file, from 0.
    #[arg(long = "lesion-voxel", value_name = "NAME=I,J,K", value_parser = named_place)]
    lesion_voxels: Vec<NamedPlace>,
    /// Skin entry for a lesion, mm in the scan [default: the best entry that `suggest` finds].
    #[arg(long = "entry", value_name = "NAME=X,Y,Z", value_parser = named_place, allow_hyphen_values = true)]
    entries: Vec<NamedPlace>,
    /// Segmentation by another program, e.g. 3D Slicer or TotalSegmentator: .seg.nrrd, DICOM segmentation or RT structure set, a label map
    /// in a format of volumes, or a folder with a mask in each file, named by its structure.
    #[arg(long, value_name = "PATH")]
    labels: Option<PathBuf>,
    /// Names of the labels: JSON, a 3D Slicer colour table, or lines like `1,lung_left`.
    #[arg(long, value_name = "FILE", requires = "labels")]
    label_names: Option<PathBuf>,
    /// Marker positions in the robot or drawing frame, to register the patient.
    #[arg(long, value_name = "FILE")]
    markers: Option<PathBuf>,
    /// Scenario for robot, tool, table, people and criteria [default: a UR3 beside a table].
    #[arg(long, value_name = "SCENARIO")]
    room: Option<PathBuf>,
    /// Patient position [default: that in the file, else that of the room's scenario, or supine]; markers digitised with
    /// the robot override it.
    #[arg(
        long = "patient-position",
        alias = "posture",
        value_name = "POSITION",
        value_enum
    )]
    posture: Option<PostureArgument>,
    /// Slice thickness, mm, if it is not in the file.
    #[arg(long, value_name = "MM", value_parser = super::synth::positive)]
    thickness_mm: Option<f64>,
    /// Assumes the body behind the cuts of the scan, so far: its cross-sections at the ends and the tangents of its
    /// skin at the sides go on. Clearances are evaluated against it there; it is no bound of the patient.
    #[arg(long, value_name = "MM", value_parser = reach)]
    outside: Option<f64>,
    /// How much wider the assumed body becomes within 100 mm behind the first and the last slice, mm on each side: to
    /// left and right, and to front and back [default: 125,50].
    #[arg(long, value_name = "MM,MM", value_parser = wider, requires = "outside")]
    outside_wider: Option<Wider>,
    /// Number of triangles of the skin surface.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=2_000_000))]
    skin_triangles: Option<u32>,
    /// Do not write the label map.
    #[arg(long)]
    no_labels: bool,
    /// Also write the label map as a segmentation of 3D Slicer with names and colours.
    #[arg(long)]
    seg_nrrd: bool,
    /// Do not write the volume; `view` requires it.
    #[arg(long)]
    no_volume: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    pictures: PicturesArguments,
    #[command(flatten)]
    reading: ReadArguments,
    #[command(flatten)]
    robot: RobotArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PostureArgument {
    Supine,
    Prone,
    LeftLateral,
    RightLateral,
}

impl From<PostureArgument> for Posture {
    fn from(argument: PostureArgument) -> Self {
        match argument {
            PostureArgument::Supine => Self::Supine,
            PostureArgument::Prone => Self::Prone,
            PostureArgument::LeftLateral => Self::LeftLateral,
            PostureArgument::RightLateral => Self::RightLateral,
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
struct NamedPlace {
    name: String,
    numbers: [f64; 3],
}

fn named_place(text: &str) -> Result<NamedPlace, String> {
    let (name, numbers) = text
        .split_once('=')
        .ok_or_else(|| "expected a name and three numbers: nodule=-60,40,-112".to_owned())?;
    let is_name = !name.is_empty()
        && name.len() <= 64
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
    if !is_name {
        return Err(format!(
            "`{name}` is not a valid name: use letters, digits, `-` and `_`"
        ));
    }
    Ok(NamedPlace {
        name: name.to_owned(),
        numbers: super::synth::numbers::<3>(numbers)?.0,
    })
}

/// How much wider an assumed body becomes along x and y, mm.
#[derive(Debug, Clone, Copy)]
struct Wider([f64; 2]);

fn wider(text: &str) -> Result<Wider, String> {
    const MOST_MM: f64 = 500.0;
    let mm = super::synth::numbers::<2>(text)?.0;
    if mm.iter().any(|mm| !(0.0..=MOST_MM).contains(mm)) {
        return Err(format!("expected two lengths from 0 to {MOST_MM} mm"));
    }
    Ok(Wider(mm))
}

fn reach(text: &str) -> Result<f64, String> {
    const MM: std::ops::RangeInclusive<f64> = 1.0..=2000.0;
    let mm = super::synth::positive(text)?;
    if !MM.contains(&mm) {
        return Err(format!("expected {} to {} mm", MM.start(), MM.end()));
    }
    Ok(mm)
}

#[derive(Serialize)]
struct BuildAnswer<'a> {
    schema_version: u32,
    ok: bool,
    findings: Vec<Finding>,
    folder: String,
    scenario: Option<String>,
    report: Option<&'a BuildReport<'a>>,
    /// What was made of a former build of the folder.
    set_aside: Option<&'a SetAside>,
}

/// Builds a patient from a CT.
pub(crate) fn build_scan(arguments: &BuildArguments) -> Result<ExitStatus, Failure> {
    let cancel = watch_interrupts()?;
    let progress = TerminalProgress::new(arguments.json);
    let control = Control {
        threads: arguments.reading.threads(),
        cancel: &cancel,
        progress: &progress,
    };
    match make(arguments, &control, &progress) {
        Ok(()) => Ok(ExitStatus::Success),
        Err(Failure::BadInput(findings)) if arguments.json => {
            let answer = BuildAnswer {
                schema_version: 1,
                ok: false,
                findings,
                folder: arguments.out.display().to_string(),
                scenario: None,
                report: None,
                set_aside: None,
            };
            Err(Failure::answered(status_of(&answer.findings), &answer))
        }
        Err(failure) => Err(failure),
    }
}

/// Inputs besides the scan.
struct Given {
    markers: Option<MarkerList>,
    names: Option<Vec<(u16, String)>>,
    room: OwnRoom,
    overrides: Overrides,
}

/// Builds, writes and prints.
fn make(
    arguments: &BuildArguments,
    control: &Control<'_>,
    progress: &TerminalProgress,
) -> Result<(), Failure> {
    let stopped = |stop| Failure::of_stop(stop, "interrupted: no scenario.toml was written");
    let mut given = given(arguments).map_err(stopped)?;
    let _taken = ResultsFolder::take_private(&arguments.out)?;
    let mut built = built(arguments, &given, control)
        .inspect_err(|_| progress.finish())
        .map_err(stopped)?;
    position::lay(
        arguments.posture.map(Posture::from),
        &mut given.room.scenario,
        &given.room.resolved,
        &mut built,
    );
    let written = write(arguments, &given.room, &built, control);
    progress.finish();
    let written = written.map_err(stopped)?;
    let mut findings = not_grown(&arguments.path, &built);
    findings.extend(refused(&written.scenario, &given, &built));
    if arguments.json {
        let status = status_of(&findings);
        let answer = BuildAnswer {
            schema_version: 1,
            ok: findings.is_empty(),
            findings,
            folder: arguments.out.display().to_string(),
            scenario: Some(written.scenario.display().to_string()),
            report: Some(&written.report),
            set_aside: written.set_aside.as_ref(),
        };
        if !answer.ok {
            return Err(Failure::answered(status, &answer));
        }
        print_json(&answer)?;
        return Ok(());
    }
    let text = in_words(&built, arguments, &written, findings.is_empty())?;
    print_text(&layout::wrapped(&text))?;
    if findings.is_empty() {
        Ok(())
    } else {
        Err(findings.into())
    }
}

/// The lesions that could not be grown: all else is built and written.
fn not_grown(scan: &Path, built: &ScanBuild) -> Vec<Finding> {
    let not_grown = built.seen.made.not_grown.iter();
    let stops = not_grown.map(|each| Stop::of_scan(scan, each.error.clone()));
    let findings = stops.filter_map(|stop| match stop {
        Stop::Refused(findings) => Some(findings),
        Stop::Interrupted => None,
    });
    findings.flatten().collect()
}

/// What `check` refuses of the scenario, with the options that mend it.
fn refused(scenario: &Path, given: &Given, built: &ScanBuild) -> Vec<Finding> {
    let Err(mut findings) = load_open_scenario(scenario, &given.overrides) else {
        return Vec::new();
    };
    let is_registered =
        |registered: &Registered| registered.registration.frame == ReferenceFrame::Robot;
    if built.registered.as_ref().is_some_and(is_registered) {
        for finding in &mut findings {
            if finding.key.as_deref() == Some("phantom.position_mm") {
                finding.hint = Some(
                    "the markers place the patient, the room places the table: in the file of --room, set \
                     `table.top_height_mm` and the robot's base as they are, or remove [table]"
                        .to_owned(),
                );
            }
        }
    }
    findings
}

fn given(arguments: &BuildArguments) -> Result<Given, Stop> {
    let overrides = overrides(&arguments.robot)?;
    let markers = arguments
        .markers
        .as_deref()
        .map(MarkerList::load)
        .transpose()?;
    let names = arguments
        .label_names
        .as_deref()
        .map(read_label_names)
        .transpose();
    let names = names.map_err(|error| Stop::of_scan(&arguments.path, error))?;
    Ok(Given {
        markers,
        names,
        room: room(arguments, &overrides)?,
        overrides,
    })
}

fn built(
    arguments: &BuildArguments,
    given: &Given,
    control: &Control<'_>,
) -> Result<ScanBuild, Stop> {
    control.progress.message("reading");
    let path = &arguments.path;
    let mut read = arguments
        .reading
        .read(path, control.cancel)
        .map_err(|error| Stop::of_scan(path, error))?;
    if let Some(thickness_mm) = arguments.thickness_mm {
        read.volume.slice_thickness_m = Some(1e-3 * thickness_mm);
    }
    let lesions = lesions(arguments, &read)?;
    check_entries(arguments, &lesions)?;
    let options = BuildOptions {
        lesions,
        labels: arguments.labels.clone().map(|file| GivenLabels {
            file,
            names: given.names.clone().unwrap_or_default(),
        }),
        markers: given.markers.as_ref().map(known_markers),
        sizes: SurfaceSizes {
            skin: arguments
                .skin_triangles
                .map_or(SurfaceSizes::default().skin, |count| count as usize),
            ..SurfaceSizes::default()
        },
        outside: arguments.outside.map(|reach_mm| Outside {
            reach_m: 1e-3 * reach_mm,
            wider_m: arguments
                .outside_wider
                .map_or(Outside::USUAL_WIDER_M, |Wider(mm)| mm.map(|mm| 1e-3 * mm)),
        }),
        max_bytes: arguments.reading.max_bytes(),
    };
    build(read, &options, control).map_err(|error| Stop::of_scan(path, error))
}

fn write<'b>(
    arguments: &BuildArguments,
    room: &OwnRoom,
    built: &'b ScanBuild,
    control: &Control<'_>,
) -> Result<WrittenPatient<'b>, Stop> {
    let mut files = BuildFiles {
        labels: !arguments.no_labels,
        segmentation: arguments.seg_nrrd,
        volume: !arguments.no_volume,
        slices: Vec::new(),
    };
    if arguments.pictures.are_wanted(arguments.json) {
        control.progress.message("images");
        files.slices = slices(built, &arguments.out)?;
    }
    let room = Room {
        scenario: &room.scenario,
        resolved: &room.resolved,
        folder: &room.folder,
    };
    write_patient(
        &arguments.out,
        &room,
        built,
        goals(arguments, built),
        &files,
        "Built from a scan by `needlebench ct build`; details in report.json.",
        control,
    )
}

/// The room, from its file or the default one.
struct OwnRoom {
    scenario: needlebench_scenario::scenario::Scenario,
    resolved: needlebench_scenario::ResolvedScenario,
    folder: PathBuf,
}

fn room(arguments: &BuildArguments, overrides: &Overrides) -> Result<OwnRoom, Stop> {
    let (open, folder) = if let Some(path) = &arguments.room {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        (load_open_scenario(path, overrides)?, folder)
    } else {
        let text = needlebench_patient::ct::USUAL_ROOM;
        let open = resolve_open_scenario("room.toml", text, Path::new(""), overrides)?;
        (open, PathBuf::new())
    };
    let resolved = open.resolved;
    let mut scenario = resolved.scenario.clone();
    if arguments.room.is_none() {
        scenario.name = name_from_file(&arguments.out);
    }
    Ok(OwnRoom {
        scenario,
        resolved,
        folder,
    })
}

/// Reserved names of surfaces, beside those of labels.
const TAKEN: [&str; 3] = ["skin", "other_bone", "trachea"];

fn lesions(arguments: &BuildArguments, read: &ReadVolume) -> Result<Vec<LesionSeed>, Stop> {
    let file = arguments.path.display().to_string();
    let by_place = arguments.lesions.iter().map(|place| LesionSeed {
        name: place.name.clone(),
        point_m: Point3::from(Vector3::from(place.numbers) * 1e-3),
    });
    let by_voxel = arguments.lesion_voxels.iter().map(|voxel| LesionSeed {
        name: voxel.name.clone(),
        point_m: read.volume.grid.ct_from_index(&Point3::from(voxel.numbers)),
    });
    let all: Vec<LesionSeed> = by_place.chain(by_voxel).collect();
    let mut known: BTreeMap<&str, usize> = BTreeMap::new();
    for seed in &all {
        *known.entry(&seed.name).or_default() += 1;
    }
    let is_assumed =
        |name: &str| arguments.outside.is_some() && name.starts_with(AssumedBody::NAME);
    let is_taken = |name: &str| {
        let is_label = || Label::ALL.iter().any(|label| label.name() == name);
        TAKEN.contains(&name) || is_assumed(name) || is_label()
    };
    if let Some((name, _)) = known
        .iter()
        .find(|(name, count)| **count > 1 || is_taken(name))
    {
        return Err(
            Finding::new(file, format!("the name `{name}` is already in use"))
                .key("--lesion")
                .hint("give each lesion a unique name")
                .into(),
        );
    }
    Ok(all)
}

fn check_entries(arguments: &BuildArguments, lesions: &[LesionSeed]) -> Result<(), Stop> {
    let unknown = arguments
        .entries
        .iter()
        .find(|entry| lesions.iter().all(|lesion| lesion.name != entry.name));
    match unknown {
        None => Ok(()),
        Some(entry) => Err(Finding::new(
            arguments.path.display().to_string(),
            format!("there is no lesion `{}`", entry.name),
        )
        .key("--entry")
        .hint("an entry requires a --lesion of its name")
        .into()),
    }
}

fn known_markers(list: &MarkerList) -> KnownMarkers {
    let diameter_m = 1e-3 * list.sphere_mm;
    let frame = match list.frame {
        MarkerFrame::BaseLink | MarkerFrame::Base => ReferenceFrame::Robot,
        MarkerFrame::Drawing => ReferenceFrame::Phantom,
    };
    let markers = list.markers.iter().map(|marker| {
        let [x, y, z] = marker.position_mm.map(|mm| 1e-3 * mm);
        let sigma_m = 1e-3 * marker.sd_mm.unwrap_or(list.sd_mm);
        let covariance = Matrix3::from_diagonal_element(sigma_m * sigma_m);
        match list.frame {
            MarkerFrame::BaseLink => {
                ReferenceMarker::touched(&marker.name, Point3::new(x, y, z), covariance)
            }
            // Half a turn about z, which `REP 199` and UR's own frames differ by.
            MarkerFrame::Base => {
                ReferenceMarker::touched(&marker.name, Point3::new(-x, -y, z), covariance)
            }
            MarkerFrame::Drawing => {
                ReferenceMarker::from_cad(&marker.name, Point3::new(x, y, z), sigma_m)
            }
        }
    });
    KnownMarkers {
        frame,
        model: if list.carrier {
            MarkerModel::phantom_sphere(diameter_m)
        } else {
            MarkerModel::bare_sphere(diameter_m)
        },
        placement_sigma_m: list.placement_mm.map(|mm| 1e-3 * mm),
        markers: markers.collect(),
    }
}

/// A goal for each lesion that has a surface.
fn goals(arguments: &BuildArguments, built: &ScanBuild) -> Vec<GoalSection> {
    let frame = PatientFrame::of(built);
    let asked = arguments.lesions.iter().chain(&arguments.lesion_voxels);
    let asked: Vec<&String> = asked.map(|lesion| &lesion.name).collect();
    let is_built = |name: &&String| built.targets.iter().any(|target| target.name == **name);
    // Those of the label map follow.
    let names = built.targets.iter().map(|target| &target.name);
    let mapped = names.filter(|name| !asked.contains(name));
    let seen = asked.iter().copied().filter(is_built).chain(mapped);
    seen.map(|name| {
        let entry = arguments.entries.iter().find(|entry| entry.name == *name);
        let entry_mm =
            entry.map(|entry| frame.in_mm(&Point3::from(Vector3::from(entry.numbers) * 1e-3)));
        GoalSection {
            entry_mm,
            standoff_mm: 15.0,
            ..GoalSection::at(Target::Lesion(name.clone()))
        }
    })
    .collect()
}

/// Images of slices: their names and bytes.
fn slices(built: &ScanBuild, out: &Path) -> Result<Vec<(String, Vec<u8>)>, Stop> {
    let pictures = scan_pictures(built).map_err(|error| {
        let file = out.display().to_string();
        Stop::from(Finding::new(file, format!("no images of slices: {error}")).key("--out"))
    })?;
    let each = |SlicePicture { name, png }| (name, png);
    Ok(pictures.into_iter().map(each).collect())
}

fn in_words(
    built: &ScanBuild,
    arguments: &BuildArguments,
    written: &WrittenPatient<'_>,
    is_complete: bool,
) -> Result<String> {
    let mut text = String::new();
    let report = &written.report;
    let out = &arguments.out;
    let [columns, rows, slices] = report.size;
    let [x, y, z] = report.spacing_m.map(|metres| metres * 1e3);
    write!(
        text,
        "{}: {columns} x {rows} x {slices} voxels of {x:.3} x {y:.3} x {z:.3} mm",
        report.source.format
    )?;
    write!(text, "\n\n{}", overview_text(&report.overview))?;
    for lesion in &report.lesions {
        match lesion.size {
            Some(size) => {
                let [x, y, z]: [f64; 3] = (size.centroid_m.coords * 1e3).into();
                write!(
                    text,
                    "\n\nlesion {}: {:.1} ml, axial diameters {:.1} x {:.1} mm, centroid ({x:.1}, {y:.1}, {z:.1}) mm in the scan",
                    lesion.name,
                    size.volume_m3 * 1e6,
                    size.axial_longest_m * 1e3,
                    size.axial_width_m * 1e3
                )?;
            }
            None => write!(text, "\n\nlesion {}: no surface, not a goal", lesion.name)?,
        }
    }
    if let Some(registered) = &built.registered {
        write_registration(&mut text, built, &registered.registration)?;
    }
    text.push('\n');
    let set_aside = written.set_aside.as_ref().map(SetAside::remark);
    for remark in report.remarks.iter().chain(&set_aside) {
        match &remark.place {
            Some(place) => write!(text, "\nnote: {place}: {}", remark.message)?,
            None => write!(text, "\nnote: {}", remark.message)?,
        }
    }
    if built.registered.is_none() {
        write!(
            text,
            "\nnote: no --markers: scan not registered to the robot; base placement taken from the room"
        )?;
    }
    if report.targets.is_empty() {
        write!(
            text,
            "\nnote: no lesion, so the scenario has no goals: add --lesion NAME=X,Y,Z, or write [[goals]]"
        )?;
    }
    if arguments.pictures.are_wanted(true) {
        write!(
            text,
            "\npicture: {}",
            shown(&out.join(SLICES).join(OVERVIEW))
        )?;
    }
    write!(text, "\nresults: {}", shown(out))?;
    if is_complete {
        let scenario = shown(&written.scenario);
        write!(text, "; next: needlebench check {scenario}")?;
    }
    Ok(text)
}

fn write_registration(
    text: &mut String,
    built: &ScanBuild,
    registration: &Registration,
) -> std::fmt::Result {
    write!(
        text,
        "\n\nmarker             residual (mm)  expected (mm)  leave-one-out (mm)"
    )?;
    for marker in &registration.markers {
        let others = marker.leave_one_out.as_ref().map_or_else(
            || "-".to_owned(),
            |left| format!("{:.2}", left.error_m.norm() * 1e3),
        );
        write!(
            text,
            "\n{:<18} {:>13.2}  {:>13.2}  {others:>18}",
            marker.name,
            marker.residual_m.norm() * 1e3,
            marker.expected_residual_m * 1e3
        )?;
    }
    write!(
        text,
        "\nFRE {:.2} mm RMS ({:.2} expected); FRE does not predict the TRE:",
        registration.fre_rms_m * 1e3,
        registration.expected_fre_rms_m * 1e3
    )?;
    for target in &built.targets {
        if let Some(error) = &target.registration {
            let seen = (0..3)
                .map(|axis| target.covariance_m2[axis][axis])
                .sum::<f64>()
                .sqrt();
            write!(
                text,
                "\n  {}: TRE {:.2} mm RMS, target localisation error {:.2} mm RMS",
                target.name,
                error.rms_m * 1e3,
                seen * 1e3
            )?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_have_names() {
        let place = named_place("nodule_1=-60, 40,-112.5").unwrap();
        assert_eq!(place.name, "nodule_1");
        assert_eq!(place.numbers, [-60.0, 40.0, -112.5]);
        for wrong in ["1,2,3", "=1,2,3", "a b=1,2,3", "a=1,2", "a=1,2,nan"] {
            assert!(named_place(wrong).is_err(), "{wrong}");
        }
    }
}
