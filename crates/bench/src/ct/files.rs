//! The folder of what was built from a scan.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use needlebench_imaging::markers::{DetectedMarker, Rejected};
use needlebench_imaging::read::Description;
use needlebench_imaging::registration::{MarkerMatch, Registration};
use needlebench_imaging::write::{write_bytes, write_label_nifti, write_nifti, write_stl};
use needlebench_imaging::{
    ImagingError, LabelFacts, LesionSize, Remark, SurfaceError, SurfaceTissue,
};
use needlebench_scenario::scenario::Scenario;
use needlebench_scenario::scenario_text;
use serde::Serialize;

use super::patient::{PatientFrame, SURFACES};
use super::{BuiltTarget, ScanBuild};

/// What was built, for programs. Lengths in m, places in `ct` (patient LPS) unless said otherwise.
#[derive(Debug, Serialize)]
pub struct BuildReport<'b> {
    /// Of this document.
    pub schema_version: u32,
    /// Where the volume comes from; nothing of it names the patient.
    pub source: &'b Description,
    /// Columns, rows, slices, along the patient's axes.
    pub size: [usize; 3],
    /// Distance of voxels along x, y, z.
    pub spacing_m: [f64; 3],
    /// Centre of the first voxel.
    pub first_voxel_m: [f64; 3],
    /// What a slice integrates over, where it is known.
    pub slice_thickness_m: Option<f64>,
    /// Origin of the scenario's phantom frame; its axes are those of `ct`.
    pub phantom_origin_m: [f64; 3],
    /// SHA-256 of the Hounsfield units, each as two bytes, little endian: whether `volume.nii.gz` is that of this report.
    /// None where that is not written.
    pub voxels_sha256: Option<String>,
    /// The same of the labels, for `labels.nii.gz`.
    pub labels_sha256: Option<String>,
    /// Closed surfaces.
    pub surfaces: Vec<SurfaceReport<'b>>,
    /// Lesions that were asked for, in that order.
    pub lesions: Vec<LesionReport<'b>>,
    /// Labels of `labels.nii.gz`.
    pub labels: &'b [LabelFacts],
    /// Markers; none if none were looked for.
    pub markers: Option<MarkersReport<'b>>,
    /// Where the patient is; none without markers that are known.
    pub registration: Option<&'b Registration>,
    /// Centres of lesions with what is known of their error.
    pub targets: &'b [BuiltTarget],
    /// What is worth knowing.
    pub remarks: &'b [Remark],
}

/// A surface.
#[derive(Debug, Serialize)]
pub struct SurfaceReport<'b> {
    /// Its name, as in `[[phantom.parts]]`.
    pub name: &'b str,
    /// What it is of.
    pub tissue: SurfaceTissue,
    /// Its file, in the same folder.
    pub file: String,
    /// Triangles.
    pub triangles: usize,
    /// Triangles before they were reduced.
    pub triangles_before: usize,
    /// Volume within, m^3.
    pub volume_m3: f64,
    /// Where it runs, HU; none where it runs between voxels of a label map.
    pub level_hu: Option<f64>,
    /// From the surface of the voxels to this one.
    pub distance_from_voxels: SurfaceError,
}

/// A lesion.
#[derive(Debug, Serialize)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "facts that do not depend on each other"
)]
pub struct LesionReport<'b> {
    /// Its name.
    pub name: &'b str,
    /// Whether it is in the lung.
    pub in_lung: bool,
    /// Its median, HU.
    pub median_hu: i16,
    /// Where its surface runs, HU.
    pub level_hu: f64,
    /// Whether it was cut where it meets the wall of the lung.
    pub cut_at_wall: bool,
    /// Whether it was cut where vessels leave it.
    pub cut_at_vessels: bool,
    /// Whether it ran into what is around it: its size is not known then.
    pub leaked: bool,
    /// How large it is; none if it has no surface.
    pub size: Option<&'b LesionSize>,
}

/// Markers of a scan.
#[derive(Debug, Serialize)]
pub struct MarkersReport<'b> {
    /// Those that were found.
    pub found: &'b [DetectedMarker],
    /// What might have been one and is not.
    pub rejected: &'b [Rejected],
    /// Standard deviation of the scan's noise in soft tissue, HU, if it has homogeneous tissue.
    pub noise_hu: Option<f64>,
    /// Which is which; none without a registration.
    pub matched: Option<&'b MarkerMatch>,
}

impl<'b> BuildReport<'b> {
    /// Of what was built, of which some files are written.
    pub fn of(build: &'b ScanBuild, files: BuildFiles) -> Self {
        let grid = &build.seen.volume.grid;
        let made = &build.seen.made;
        Self {
            schema_version: 1,
            source: &build.seen.source,
            size: grid.size(),
            spacing_m: grid.spacing_m(),
            first_voxel_m: grid.first_m().coords.into(),
            slice_thickness_m: build.seen.volume.slice_thickness_m,
            phantom_origin_m: PatientFrame::of(build).origin_in_ct_m.into(),
            voxels_sha256: files.volume.then(|| build.seen.voxels_sha256().to_owned()),
            labels_sha256: files.labels.then(|| build.seen.labels_sha256().to_owned()),
            surfaces: made
                .surfaces
                .iter()
                .map(|surface| SurfaceReport {
                    name: &surface.name,
                    tissue: surface.tissue,
                    file: surface_file(&surface.name),
                    triangles: surface.mesh.triangles.len(),
                    triangles_before: surface.triangles_before,
                    volume_m3: surface.volume_m3,
                    level_hu: surface.level_hu,
                    distance_from_voxels: surface.error,
                })
                .collect(),
            lesions: made
                .lesions
                .iter()
                .map(|measured| LesionReport {
                    name: &measured.lesion.name,
                    in_lung: measured.lesion.in_lung,
                    median_hu: measured.lesion.median_hu,
                    level_hu: measured.lesion.level_hu,
                    cut_at_wall: measured.lesion.cut_at_wall,
                    cut_at_vessels: measured.lesion.cut_at_vessels,
                    leaked: measured.lesion.leaked,
                    size: measured.size.as_ref(),
                })
                .collect(),
            labels: &made.facts,
            markers: build.seen.markers.as_ref().map(|found| MarkersReport {
                found: &found.markers,
                rejected: &found.rejected,
                noise_hu: found.noise.as_ref().map(|noise| noise.sd_hu),
                matched: build
                    .registered
                    .as_ref()
                    .map(|registered| &registered.matched),
            }),
            registration: build
                .registered
                .as_ref()
                .map(|registered| &registered.registration),
            targets: &build.targets,
            remarks: &build.remarks,
        }
    }
}

fn surface_file(name: &str) -> String {
    format!("{SURFACES}/{name}.stl")
}

#[derive(Serialize)]
struct LabelName<'b> {
    label: u16,
    name: &'b str,
}

#[derive(Serialize)]
struct LabelNames<'b> {
    schema_version: u32,
    labels: Vec<LabelName<'b>>,
}

/// What of a build is written besides surfaces, report and scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildFiles {
    /// The label map with its names.
    pub labels: bool,
    /// The volume along the patient's axes: what everything was found in.
    pub volume: bool,
}

/// Name of the scenario in a folder that was built.
pub const SCENARIO_FILE: &str = "scenario.toml";
/// Name of the volume there.
pub const VOLUME_FILE: &str = "volume.nii.gz";
/// Name of the label map there.
pub(super) const LABELS_FILE: &str = "labels.nii.gz";
/// Names of its labels.
pub(super) const NAMES_FILE: &str = "labels.json";
/// What was built.
pub(super) const REPORT_FILE: &str = "report.json";

/// Writes surfaces and report, and what else is wanted; the names of the files.
///
/// # Errors
/// What cannot be written; interrupted.
pub(crate) fn write_build(
    folder: &Path,
    build: &ScanBuild,
    wanted: BuildFiles,
    cancel: &AtomicBool,
) -> Result<Vec<String>, ImagingError> {
    let mut files = Vec::new();
    let surfaces = folder.join(SURFACES);
    std::fs::create_dir_all(&surfaces).map_err(|error| {
        ImagingError::refused(format!("cannot be created: {error}"))
            .at(surfaces.display().to_string())
    })?;
    for surface in &build.seen.made.surfaces {
        let file = surface_file(&surface.name);
        write_stl(&folder.join(&file), &surface.mesh)?;
        files.push(file);
    }
    if wanted.labels {
        write_label_nifti(&folder.join(LABELS_FILE), &build.seen.made.labels, cancel)?;
        let names = build.seen.made.labels.names.iter();
        let names = LabelNames {
            schema_version: 1,
            labels: names
                .map(|(label, name)| LabelName {
                    label: *label,
                    name,
                })
                .collect(),
        };
        write_json(&folder.join(NAMES_FILE), &names)?;
        files.extend([LABELS_FILE.to_owned(), NAMES_FILE.to_owned()]);
    }
    if wanted.volume {
        write_nifti(&folder.join(VOLUME_FILE), &build.seen.volume, cancel)?;
        files.push(VOLUME_FILE.to_owned());
    }
    write_json(&folder.join(REPORT_FILE), &BuildReport::of(build, wanted))?;
    files.push(REPORT_FILE.to_owned());
    Ok(files)
}

/// Writes a JSON document.
pub(super) fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), ImagingError> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| ImagingError::refused(error.to_string()).at(path.display().to_string()))?;
    write_bytes(path, format!("{text}\n").as_bytes())
}

/// Writes a scenario with a line on where it comes from.
///
/// # Errors
/// What cannot be written.
pub(super) fn write_scenario(
    path: &Path,
    scenario: &Scenario,
    first: &str,
) -> Result<(), ImagingError> {
    let text = scenario_text(scenario)
        .map_err(|error| ImagingError::refused(error).at(path.display().to_string()))?;
    write_bytes(path, format!("# {first}\n{text}").as_bytes())
}
