//! From a phantom through a synthetic scan to the scenario of those who know the scan alone.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_imaging::LesionSeed;
use needlebench_imaging::markers::MarkerModel;
use needlebench_imaging::registration::{ReferenceFrame, ReferenceMarker};
use needlebench_input::{Finding, nearest_name};
use needlebench_kinematics::Pose;
use needlebench_parallel::{Control, Silent};
use needlebench_phantom::Phantom;
use needlebench_scenario::scenario::{CtSection, GoalSection, MarkerKind, ScanKernel, ScanSlices};
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};
use needlebench_synthesis::{Kernel, Noise, ScanPreset, Scanner, Streaks, synthesise_watched};
use needlebench_volume::VolumeError;
use needlebench_volume::read::{Description, ReadVolume};

use super::build::{BuildOptions, KnownMarkers, ScanBuild, SeenScan, register, see};
use super::files::BuildFiles;
use super::patient::{PatientFrame, Room};
use super::touched::Draws;
use super::written_folder::{SetAside, WrittenPatient, write_json, write_patient};
use super::{CtSubject, Materials, ScanOrder, ScanRange, SyntheticScan};
use crate::stop::Stop;

/// A scenario whose phantom was scanned.
#[derive(Debug)]
pub struct Imaged {
    /// What was built from the scan.
    pub build: ScanBuild,
    /// What is run: its file is in the folder.
    pub scenario: ResolvedScenario,
    /// That file.
    pub file: PathBuf,
    /// What was made of a former build of the folder.
    pub set_aside: Option<SetAside>,
}

/// The last scan that was made: of several cases that differ in what is done with it, it is made once.
#[derive(Debug, Default)]
pub struct LastScan(Option<(String, Arc<SeenScan>)>);

impl LastScan {
    fn of(&self, key: Option<&str>) -> Option<Arc<SeenScan>> {
        let (known, seen) = self.0.as_ref()?;
        (Some(known.as_str()) == key).then(|| Arc::clone(seen))
    }
}

/// All that a scan depends on, and what is pointed to in it.
fn key(resolved: &ResolvedScenario, section: &CtSection) -> String {
    let scan = CtSection {
        fle_sd_mm: 0.0,
        markers: None,
        ..section.clone()
    };
    let scenario = &resolved.scenario;
    let lesions: Vec<_> = resolved.goals.iter().map(|goal| &goal.lesion).collect();
    format!(
        "{:?} {:?} {} {lesions:?}",
        scan, scenario.phantom, scenario.seed
    )
}

/// Makes a scan, and looks at it.
fn seen(
    scan: &SyntheticScan,
    options: &BuildOptions,
    control: &Control<'_>,
) -> Result<SeenScan, VolumeError> {
    control.progress.message("scanning");
    control.progress.expect(scan.grid.size()[2] as u64);
    let volume = synthesise_watched(
        &scan.scene,
        &scan.truth.scanner,
        &scan.grid,
        scan.truth.seed,
        control.threads,
        control.cancel,
        &|| control.progress.step(),
    )?;
    let read = ReadVolume {
        volume,
        remarks: Vec::new(),
        description: Description {
            format: "synthetic".to_owned(),
            modality: Some("CT".to_owned()),
            ..Description::default()
        },
    };
    see(read, options, control)
}

/// Scans the phantom of a scenario with `[ct]`, builds what is seen of it into `folder`, and gives the scenario of that.
/// With the same seed the same bytes, whatever the number of threads.
///
/// # Errors
/// A scan in which lesions or markers cannot be found; a folder that cannot be written; interrupted.
pub fn imaged(
    resolved: &ResolvedScenario,
    folder: &Path,
    overrides: &Overrides,
    files: &BuildFiles,
    last: Option<&mut LastScan>,
    control: &Control<'_>,
) -> Result<Imaged, Stop> {
    let file = resolved.source.file.as_str();
    let refused = |message: &str, key: &str| {
        Stop::Refused(vec![Finding::new(file, message.to_owned()).key(key)])
    };
    let Some(section) = &resolved.scenario.ct else {
        return Err(refused("no scan to synthesise", "ct"));
    };
    let mut draws = Draws::new(resolved.scenario.seed);
    let order = order(section, resolved.scenario.seed, &mut draws);
    let Some(subject) = CtSubject::of_scenario(Path::new(file), resolved) else {
        return Err(refused("no patient to scan", "phantom"));
    };
    let scan = SyntheticScan::new(&subject, &order)
        .map_err(|error| Stop::of_scan(Path::new(file), error))?;
    let options = wanted(resolved, section, subject.phantom, &scan, &mut draws)?;
    let key = last.as_ref().map(|_| key(resolved, section));
    let known = last.as_ref().and_then(|last| last.of(key.as_deref()));
    let seen = match known {
        Some(seen) => seen,
        None => Arc::new(
            seen(&scan, &options, control)
                .map_err(|error| Stop::of_scan(Path::new(file), error))?,
        ),
    };
    if let (Some(last), Some(key)) = (last, key) {
        last.0 = Some((key, Arc::clone(&seen)));
    }
    let build = register(seen, &options).map_err(|error| Stop::of_scan(Path::new(file), error))?;
    let goals =
        goals(resolved, &scan, &build).map_err(|error| Stop::of_scan(Path::new(file), error))?;
    let room = Room {
        scenario: &resolved.scenario,
        resolved,
        folder: Path::new(file).parent().unwrap_or(Path::new("")),
    };
    let first = format!(
        "{}, as built from a synthetic scan of its phantom",
        resolved.scenario.name
    );
    let truth = folder.join("truth.json");
    if truth.exists() {
        // That of another scan is no truth of this one.
        std::fs::remove_file(&truth).map_err(|error| {
            let refused = VolumeError::refused(format!("cannot be replaced: {error}"));
            Stop::of_scan(&truth, refused)
        })?;
    }
    let WrittenPatient {
        scenario: path,
        set_aside,
        ..
    } = write_patient(folder, &room, &build, goals, files, &first, control)?;
    write_json(&truth, &scan.truth).map_err(|error| Stop::of_scan(Path::new(file), error))?;
    let scenario = load_scenario(&path, overrides)?;
    Ok(Imaged {
        build,
        scenario,
        file: path,
        set_aside,
    })
}

/// A scenario as it is run: if it begins with a scan, that of what is seen there, as [`imaged`] has it; nothing of it stays on
/// disk.
///
/// # Errors
/// As [`imaged`]; it is not interrupted.
pub fn scanned(
    resolved: ResolvedScenario,
    overrides: &Overrides,
    last: &mut LastScan,
) -> Result<ResolvedScenario, Vec<Finding>> {
    if resolved.scenario.ct.is_none() {
        return Ok(resolved);
    }
    let file = resolved.source.file.clone();
    let one = |message: String| vec![Finding::new(&file, message).key("ct")];
    let folder = tempfile::tempdir()
        .map_err(|error| one(format!("cannot create a folder for a scan: {error}")))?;
    let control = Control {
        threads: 1,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    match imaged(
        &resolved,
        folder.path(),
        overrides,
        &BuildFiles::default(),
        Some(last),
        &control,
    ) {
        Ok(made) => Ok(made.scenario),
        Err(Stop::Refused(findings)) => Err(findings),
        Err(Stop::Interrupted) => Err(one("interrupted".to_owned())),
    }
}

fn order(section: &CtSection, seed: u64, draws: &mut Draws) -> ScanOrder {
    let preset = match section.slices {
        ScanSlices::Thin => ScanPreset::Thin,
        ScanSlices::Biopsy => ScanPreset::Biopsy,
        ScanSlices::Thick => ScanPreset::Thick,
        ScanSlices::ThickOverlap => ScanPreset::ThickOverlap,
    };
    let kernel = match section.kernel {
        ScanKernel::Smooth => Kernel::Smooth,
        ScanKernel::Sharp => Kernel::Sharp,
    };
    let [thickness_m, increment_m] = preset.thickness_and_increment_m();
    let usual = Noise::of(kernel);
    let sd_hu = section.noise_hu.unwrap_or(usual.sd_hu);
    ScanOrder {
        scanner: Scanner {
            noise: (sd_hu > 0.0).then_some(Noise {
                sd_hu,
                dose: section.dose,
                ..usual
            }),
            streaks: section.streaks.then_some(Streaks::USUAL),
            ..Scanner::new(thickness_m, kernel)
        },
        increment_m,
        size: usize::from(section.pixels),
        pixel_m: None,
        range: ScanRange::Whole(5e-3),
        tilt_rad: section.tilt_deg.to_radians(),
        turn_rad: 0.0,
        shift_m: Vector3::from(section.shift_mm) * 1e-3,
        off_middle: draws.uniform(),
        flipped: [false; 3],
        has_bed: true,
        materials: Materials {
            vessel: section.vessels_hu,
            ..Materials::default()
        },
        seed,
    }
}

/// What is known of the scan: where the robot has the markers, what they look like, and where a person points to.
fn wanted(
    resolved: &ResolvedScenario,
    section: &CtSection,
    phantom: &Phantom,
    scan: &SyntheticScan,
    draws: &mut Draws,
) -> Result<BuildOptions, Stop> {
    let file = resolved.source.file.as_str();
    let one = |finding: Finding| Stop::Refused(vec![finding]);
    let parameters = phantom.parameters.as_ref();
    let sphere_mm = parameters
        .filter(|parameters| parameters.marker_kind == MarkerKind::CtSphere)
        .map(|parameters| parameters.marker_sphere_mm);
    let Some(sphere_mm) = sphere_mm else {
        return Err(one(Finding::new(
            file,
            "the phantom's markers are isodense with skin",
        )
        .key("phantom.markers")
        .hint("`markers = \"ct_sphere\"` under [phantom]")));
    };
    let robot_from_ct = scan.robot_from_ct.unwrap_or_else(Pose::identity);
    let touch_m = 1e-3 * section.fle_sd_mm;
    let mut markers = Vec::new();
    for marker in &scan.truth.markers {
        // Drawn for all of them, so that a set of fewer has the same ones.
        let error = draws.normal(touch_m);
        let is_used = section
            .markers
            .as_ref()
            .is_none_or(|names| names.contains(&marker.name));
        if let Some(center_m) = marker.sphere_center_m.filter(|_| is_used) {
            let touched = robot_from_ct * Point3::from(center_m) + error;
            let covariance = Matrix3::from_diagonal_element(touch_m * touch_m);
            markers.push(ReferenceMarker::touched(&marker.name, touched, covariance));
        }
    }
    for name in section.markers.iter().flatten() {
        let known = || scan.truth.markers.iter().map(|marker| marker.name.as_str());
        if !known().any(|each| each == name) {
            let hint = match nearest_name(name, known()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("it has {}", known().collect::<Vec<_>>().join(", ")),
            };
            return Err(one(Finding::new(
                file,
                format!("the phantom has no marker `{name}`"),
            )
            .key("ct.markers")
            .hint(hint)));
        }
    }
    let mut lesions: Vec<LesionSeed> = Vec::new();
    for lesion in &scan.truth.lesions {
        let click = draws.normal(1e-3 * section.click_mm);
        let is_goal = resolved
            .goals
            .iter()
            .any(|goal| goal.lesion.as_deref() == Some(&lesion.name));
        if is_goal {
            // Nobody points beside a lesion.
            let click = click.cap_magnitude(0.25 * lesion.diameter_m);
            lesions.push(LesionSeed {
                name: lesion.name.clone(),
                point_m: Point3::from(lesion.center_m) + click,
            });
        }
    }
    Ok(BuildOptions {
        lesions,
        markers: Some(KnownMarkers {
            frame: ReferenceFrame::Robot,
            model: MarkerModel::phantom_sphere(1e-3 * sphere_mm),
            placement_sigma_m: None,
            markers,
        }),
        max_bytes: u64::MAX,
        ..BuildOptions::default()
    })
}

/// The scenario's goals as they are seen in the scan.
fn goals(
    resolved: &ResolvedScenario,
    scan: &SyntheticScan,
    build: &ScanBuild,
) -> Result<Vec<GoalSection>, VolumeError> {
    let frame = PatientFrame::of(build);
    let true_robot_from_ct = scan.robot_from_ct.unwrap_or_else(Pose::identity);
    let placed = resolved.phantom.as_ref();
    let world_from_phantom = placed.map_or_else(Pose::identity, |placed| placed.world_from_phantom);
    let ct_from_world = scan.ct_from_phantom * world_from_phantom.inverse();
    let mut goals = Vec::new();
    for (section, goal) in resolved.scenario.goals.iter().zip(&resolved.goals) {
        let name = goal.lesion.as_deref().unwrap_or_default();
        let truth = scan.truth.lesions.iter().find(|lesion| lesion.name == name);
        let is_built = build.targets.iter().any(|target| target.name == name);
        let Some(truth) = truth.filter(|_| is_built) else {
            let mut not_grown = build.seen.made.not_grown.iter();
            if let Some(own) = not_grown.find(|each| each.name == name) {
                return Err(own.error.clone());
            }
            return Err(VolumeError::refused(format!(
                "lesion `{name}` is not visible in the scan"
            ))
            .at(format!("goal `{}`", goal.name))
            .hint("use thinner slices to image smaller lesions"));
        };
        let really_at = true_robot_from_ct * Point3::from(truth.center_m);
        let taken_for = match &build.registered {
            Some(registered) => registered.registration.reference_from_ct.inverse() * really_at,
            None => Point3::from(truth.center_m),
        };
        goals.push(GoalSection {
            name: goal.name.clone(),
            lesion: Some(name.to_owned()),
            entry_mm: goal
                .entry_m
                .map(|entry| frame.in_mm(&(ct_from_world * entry))),
            entry_direction_deg: None,
            true_target_mm: Some(frame.in_mm(&taken_for)),
            ..section.clone()
        });
    }
    Ok(goals)
}
