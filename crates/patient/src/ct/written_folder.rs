//! The folder of a patient, written: made aside and renamed, and nothing of a former build stays in use.

use std::io;
use std::path::{Path, PathBuf};

use needlebench_geometry::TriangleMesh;
use needlebench_imaging::stl_bytes;
use needlebench_input::{from_toml, read_text, sha256_hex};
use needlebench_parallel::Control;
use needlebench_scenario::scenario::{BuildSection, GoalSection};
use needlebench_scenario::scenario_text;
use needlebench_volume::write::{
    TEMPORARY_PREFIX, write_bytes, write_label_nifti, write_nifti, write_seg_nrrd,
};
use needlebench_volume::{Remark, VolumeError};
use serde::{Deserialize, Serialize};

use super::ScanBuild;
use super::built_folder::{BuildFacts, read_facts};
use super::files::{
    BuildDigests, BuildFiles, BuildReport, LABELS_FILE, LabelNames, NAMES_FILE, REPORT_FILE,
    ROUTES_FILE, SCENARIO_FILE, SEGMENTATION_FILE, SESSION_FILE, SLICES, VOLUME_FILE,
};
use super::patient::{Room, SURFACES, couch_left_out, patient_scenario, surface_file};
use crate::stop::Stop;

/// A patient whose folder was written.
#[derive(Debug)]
pub struct WrittenPatient<'b> {
    /// Its scenario.
    pub scenario: PathBuf,
    /// What the folder's report says.
    pub report: BuildReport<'b>,
    /// What was made of a former build of the folder.
    pub set_aside: Option<SetAside>,
}

/// What was made of a former build, and is used no longer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SetAside {
    /// Folder within the patient's that it is in now.
    pub folder: String,
    /// Files and folders, as they were called.
    pub names: Vec<String>,
}

impl SetAside {
    /// What is said of it.
    pub fn remark(&self) -> Remark {
        Remark::new(format!(
            "of a former build, moved to {}/ and of no use to other commands: {}",
            self.folder,
            self.names.join(", ")
        ))
    }
}

/// Writes what was built, and a scenario with it that can be run as it is.
///
/// All of it is written into a folder of its own first: a build that is interrupted leaves the former one as it was, or,
/// while files are renamed, a folder without a report, which is rejected by all that read it. Report, plans, sessions and
/// the like of a former build are moved into a folder `former-...`, and a scenario with another text, too.
///
/// # Errors
/// What cannot be written; interrupted.
pub fn write_patient<'b>(
    folder: &Path,
    room: &Room<'_>,
    build: &'b ScanBuild,
    goals: Vec<GoalSection>,
    files: &BuildFiles,
    first: &str,
    control: &Control<'_>,
) -> Result<WrittenPatient<'b>, Stop> {
    control.progress.message("writing");
    let scenario = folder.join(SCENARIO_FILE);
    let written = || -> Result<_, VolumeError> {
        let aside = tempfile::Builder::new()
            .prefix(TEMPORARY_PREFIX)
            .suffix(".tmp")
            .tempdir_in(folder)
            .map_err(|error| not_written(folder, &error))?;
        let aside = aside.path();
        for name in [SURFACES, SLICES] {
            let folder = aside.join(name);
            std::fs::create_dir(&folder).map_err(|error| not_written(&folder, &error))?;
        }
        let digests = BuildDigests {
            surfaces: surfaces(aside, surfaces_of(build))?,
            assumed: surfaces(aside, pieces_of(build))?,
            room: room_sha256(room, &goals)?,
        };
        images(aside, build, files, control)?;
        let left_out = couch_left_out(room, build);
        let is_couch_left_out = left_out.is_some();
        let mut report = BuildReport::of(build, files, digests);
        report.remarks.extend(left_out);
        let text = json(&report)?;
        let section = BuildSection {
            report: REPORT_FILE.to_owned(),
            sha256: sha256_hex(text.as_bytes()),
        };
        let sha256 = section.sha256.clone();
        let patient = patient_scenario(room, build, goals, section, folder, is_couch_left_out);
        let patient = scenario_text(&patient).map_err(VolumeError::refused)?;
        let patient = format!("# {first}\n{patient}");
        write_bytes(&aside.join(SCENARIO_FILE), patient.as_bytes())?;
        write_bytes(&aside.join(REPORT_FILE), text.as_bytes())?;
        let set_aside = replace(folder, aside, &sha256, &report)
            .map_err(|error| not_written(folder, &error))?;
        Ok((report, set_aside))
    };
    let (report, set_aside) = written().map_err(|error| Stop::of_scan(&scenario, error))?;
    Ok(WrittenPatient {
        scenario,
        report,
        set_aside,
    })
}

fn not_written(path: &Path, error: &io::Error) -> VolumeError {
    VolumeError::refused(format!("cannot be written: {error}")).at(path.display().to_string())
}

/// Writes a JSON document.
pub(super) fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), VolumeError> {
    write_bytes(path, json(value)?.as_bytes())
}

fn json<T: Serialize>(value: &T) -> Result<String, VolumeError> {
    serde_json::to_string_pretty(value)
        .map(|text| format!("{text}\n"))
        .map_err(|error| VolumeError::refused(error.to_string()))
}

/// Of what the scenario has that is not of the scan.
fn room_sha256(room: &Room<'_>, goals: &[GoalSection]) -> Result<String, VolumeError> {
    json(&(room.scenario, goals)).map(|text| sha256_hex(text.as_bytes()))
}

/// The surfaces of what was seen, by name.
fn surfaces_of(build: &ScanBuild) -> impl Iterator<Item = (&str, &TriangleMesh)> {
    let surfaces = build.seen.made.surfaces.iter();
    surfaces.map(|surface| (&*surface.name, &surface.mesh))
}

/// Those of what is assumed.
fn pieces_of(build: &ScanBuild) -> impl Iterator<Item = (&str, &TriangleMesh)> {
    let pieces = build.assumed.iter().flat_map(|assumed| &assumed.pieces);
    pieces.map(|piece| (&*piece.name, &piece.hull.0))
}

/// Writes surfaces; the digest of each.
fn surfaces<'m>(
    folder: &Path,
    surfaces: impl Iterator<Item = (&'m str, &'m TriangleMesh)>,
) -> Result<Vec<String>, VolumeError> {
    let written = surfaces.map(|(name, mesh)| {
        let bytes = stl_bytes(mesh)?;
        write_bytes(&folder.join(surface_file(name)), &bytes)?;
        Ok(sha256_hex(&bytes))
    });
    written.collect()
}

/// Writes labels, volume and pictures, as far as they are wanted.
fn images(
    folder: &Path,
    build: &ScanBuild,
    wanted: &BuildFiles,
    control: &Control<'_>,
) -> Result<(), VolumeError> {
    if wanted.labels {
        let labels = &build.seen.made.labels;
        write_label_nifti(&folder.join(LABELS_FILE), labels, control.cancel)?;
        write_json(&folder.join(NAMES_FILE), &LabelNames::of(labels))?;
    }
    if wanted.segmentation {
        let labels = &build.seen.made.labels;
        write_seg_nrrd(&folder.join(SEGMENTATION_FILE), labels, control.cancel)?;
    }
    if wanted.volume {
        write_nifti(
            &folder.join(VOLUME_FILE),
            &build.seen.volume,
            control.cancel,
        )?;
    }
    for (name, bytes) in &wanted.slices {
        write_bytes(&folder.join(SLICES).join(name), bytes)?;
    }
    Ok(())
}

/// Puts the folder `aside` in the place of a former build.
fn replace(
    folder: &Path,
    aside: &Path,
    sha256: &str,
    report: &BuildReport<'_>,
) -> io::Result<Option<SetAside>> {
    let path = folder.join(REPORT_FILE);
    let former = read_text(&path).ok();
    let former = former.map(|text| sha256_hex(text.as_bytes()));
    let surfaces = read_facts(&path).ok();
    let is_edited = read_text(&folder.join(SCENARIO_FILE))
        .is_ok_and(|text| read_text(&aside.join(SCENARIO_FILE)).ok() != Some(text));
    let is_same = former.as_deref() == Some(sha256);
    // A build that was interrupted while its files were renamed has a scenario that names its report.
    let was_built = surfaces.is_some() || is_of_build(&folder.join(SCENARIO_FILE));
    let mut names = Vec::new();
    if was_built && !is_same {
        // First: from here to the end the folder has no report, and nothing reads it.
        names.extend(path.exists().then(|| REPORT_FILE.to_owned()));
        names.extend(derived(folder, sha256)?);
    }
    if is_edited && !names.iter().any(|name| name == SCENARIO_FILE) {
        names.push(SCENARIO_FILE.to_owned());
    }
    let set_aside = set_aside(folder, former.as_deref(), names)?;
    remove(&path)?;
    let kept = |file: &str| report.surface_files().any(|kept| kept == file);
    let surfaces = surfaces.iter().flat_map(BuildFacts::surface_files);
    // What the report of a stranger names is not removed.
    let is_ours = |file: &&str| {
        let name = file
            .strip_prefix(SURFACES)
            .and_then(|rest| rest.strip_prefix('/'));
        name.is_some_and(|name| !name.starts_with('.') && !name.contains(['/', '\\']))
    };
    for file in surfaces.filter(is_ours).filter(|file| !kept(file)) {
        remove(&folder.join(file))?;
    }
    for file in [LABELS_FILE, NAMES_FILE, SEGMENTATION_FILE, VOLUME_FILE] {
        remove(&folder.join(file))?;
    }
    for inner in [SURFACES, SLICES, ""] {
        let (from, to) = (aside.join(inner), folder.join(inner));
        for entry in from.read_dir()? {
            let entry = entry?;
            if entry.file_type()?.is_file() && entry.file_name() != REPORT_FILE {
                std::fs::create_dir_all(&to)?;
                std::fs::rename(entry.path(), to.join(entry.file_name()))?;
            }
        }
    }
    std::fs::rename(aside.join(REPORT_FILE), path)?;
    Ok(set_aside)
}

fn remove(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Names of what was made of another build than this, in order.
fn derived(folder: &Path, sha256: &str) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in folder.read_dir()? {
        let entry = entry?;
        // What is not text in any alphabet is not ours.
        if let Ok(name) = entry.file_name().into_string()
            && is_derived(&entry.path(), &name, sha256)
        {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

/// Moves these files and folders into a folder of their own, in this order.
fn set_aside(
    folder: &Path,
    former: Option<&str>,
    names: Vec<String>,
) -> io::Result<Option<SetAside>> {
    if names.is_empty() {
        return Ok(None);
    }
    let stem = format!(
        "former-{}",
        former.map_or("unfinished", |sha256| &sha256[..8])
    );
    let of_number = |number: u32| match number {
        1 => stem.clone(),
        number => format!("{stem}-{number}"),
    };
    let free = (1..u32::MAX).map(of_number);
    let mut free = free.filter(|name| !folder.join(name).exists());
    let to = free.next().expect("a folder has few folders");
    std::fs::create_dir(folder.join(&to))?;
    for name in &names {
        std::fs::rename(folder.join(name), folder.join(&to).join(name))?;
    }
    Ok(Some(SetAside { folder: to, names }))
}

/// What is read of a TOML file that may be of a build.
#[derive(Deserialize)]
struct Derived {
    build_sha256: Option<String>,
    phantom: Option<DerivedPhantom>,
}

#[derive(Deserialize)]
struct DerivedPhantom {
    build: Option<BuildSection>,
    #[serde(default)]
    parts: Vec<DerivedPart>,
}

#[derive(Deserialize)]
struct DerivedPart {
    file: String,
}

/// Whether a file of the folder was made of another build than this.
fn is_derived(path: &Path, name: &str, sha256: &str) -> bool {
    if path.is_dir() {
        return name == SLICES && has_images_alone(path);
    }
    let is_map = [".routes.png", ".routes.svg"]
        .iter()
        .any(|end| name.ends_with(end));
    if name == ROUTES_FILE || is_map {
        return true;
    }
    if Path::new(name).extension().is_none_or(|end| end != "toml") {
        return false;
    }
    let Some(derived) = read_derived(path) else {
        // A session that cannot be read is none of this build.
        return name == SESSION_FILE;
    };
    if name == SESSION_FILE {
        return derived.build_sha256.as_deref() != Some(sha256);
    }
    let Some(phantom) = derived.phantom else {
        return false;
    };
    if let Some(build) = phantom.build {
        return build.report == REPORT_FILE && build.sha256 != sha256;
    }
    // As builds were written that did not say which they are.
    let inner = format!("{SURFACES}/");
    let mut parts = phantom.parts.iter();
    parts.any(|part| part.file.starts_with(&inner))
}

fn read_derived(path: &Path) -> Option<Derived> {
    let text = read_text(path).ok()?;
    from_toml(&path.display().to_string(), &text).ok()
}

/// Whether a scenario names the report of its build.
fn is_of_build(path: &Path) -> bool {
    let phantom = read_derived(path).and_then(|derived| derived.phantom);
    phantom.is_some_and(|phantom| phantom.build.is_some())
}

/// Whether a folder has the images of slices that builds draw, and nothing else.
fn has_images_alone(folder: &Path) -> bool {
    let is_image = |entry: io::Result<std::fs::DirEntry>| {
        entry.is_ok_and(|entry| entry.path().extension().is_some_and(|end| end == "png"))
    };
    folder.read_dir().is_ok_and(|mut all| all.all(is_image))
}
