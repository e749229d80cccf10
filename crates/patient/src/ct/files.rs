//! The folder of what was built from a scan.

use needlebench_geometry::mesh::volume_m3;
use needlebench_imaging::markers::{DetectedMarker, Rejected};
use needlebench_imaging::registration::{MarkerMatch, Registration};
use needlebench_imaging::{LabelFacts, LesionSize, Outside, SurfaceError};
use needlebench_volume::read::Description;
use needlebench_volume::{LabelMap, Remark, SurfaceTissue};
use serde::Serialize;

use super::overview::OverviewRow;
use super::patient::{PatientFrame, surface_file};
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
    /// SHA-256 of the room and the goals: of what the scenario has that is not of the scan.
    pub room_sha256: String,
    /// What was found, how much of it, from what, how accurate, and what is not known.
    pub overview: Vec<OverviewRow>,
    /// Closed surfaces.
    pub surfaces: Vec<SurfaceReport<'b>>,
    /// The body behind the cuts of the scan; none if none is assumed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assumed_body: Option<AssumedBodyReport<'b>>,
    /// Lesions of the label map, then those that were asked for, in that order.
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
    pub remarks: Vec<Remark>,
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
    /// SHA-256 of the file.
    pub sha256: String,
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

/// A body that is assumed where no scan shows it.
#[derive(Debug, Serialize)]
pub struct AssumedBodyReport<'b> {
    /// By what it is assumed.
    #[serde(flatten)]
    pub outside: Outside,
    /// How many cuts of the scan it is behind.
    pub cuts: usize,
    /// Its convex pieces; neighbours overlap.
    pub surfaces: Vec<AssumedPieceReport<'b>>,
}

/// A convex piece of an assumed body.
#[derive(Debug, Serialize)]
pub struct AssumedPieceReport<'b> {
    /// Its name, as in `[[phantom.parts]]`.
    pub name: &'b str,
    /// Its file, in the same folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Volume within, m^3.
    pub volume_m3: f64,
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
    /// Where its surface runs, HU; none where a label map has its outline.
    pub level_hu: Option<f64>,
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

/// SHA-256 of what a build wrote, as lower-case hexadecimal.
pub(super) struct BuildDigests {
    /// Of the surfaces' files, in their order.
    pub surfaces: Vec<String>,
    /// Of the files of the assumed body, in their order.
    pub assumed: Vec<String>,
    /// Of the room and the goals.
    pub room: String,
}

impl<'b> BuildReport<'b> {
    /// Of what was built, of which some files are written.
    pub(super) fn of(build: &'b ScanBuild, files: &BuildFiles, digests: BuildDigests) -> Self {
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
            room_sha256: digests.room,
            overview: build.overview(),
            surfaces: made
                .surfaces
                .iter()
                .zip(digests.surfaces)
                .map(|(surface, sha256)| SurfaceReport {
                    name: &surface.name,
                    tissue: surface.tissue,
                    file: surface_file(&surface.name),
                    sha256,
                    triangles: surface.mesh.triangles.len(),
                    triangles_before: surface.triangles_before,
                    volume_m3: surface.volume_m3,
                    level_hu: surface.level_hu,
                    distance_from_voxels: surface.error,
                })
                .collect(),
            assumed_body: build.assumed.as_ref().map(|assumed| {
                let pieces = assumed.pieces.iter().zip(digests.assumed);
                AssumedBodyReport {
                    outside: assumed.outside,
                    cuts: assumed.cuts,
                    surfaces: pieces
                        .map(|(piece, sha256)| AssumedPieceReport {
                            name: &piece.name,
                            file: surface_file(&piece.name),
                            sha256,
                            volume_m3: volume_m3(&piece.hull.0),
                        })
                        .collect(),
                }
            }),
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
            remarks: build.remarks.clone(),
        }
    }
}

impl BuildReport<'_> {
    /// Files of what was seen and of what is assumed, relative to the folder.
    pub(super) fn surface_files(&self) -> impl Iterator<Item = &str> {
        let assumed = self.assumed_body.iter();
        let assumed = assumed.flat_map(|assumed| &assumed.surfaces);
        let surfaces = self.surfaces.iter().map(|surface| &*surface.file);
        surfaces.chain(assumed.map(|piece| &*piece.file))
    }
}

#[derive(Serialize)]
struct LabelName<'b> {
    label: u16,
    name: &'b str,
}

/// Names of labels, as a document.
#[derive(Serialize)]
pub(super) struct LabelNames<'b> {
    schema_version: u32,
    labels: Vec<LabelName<'b>>,
}

impl<'b> LabelNames<'b> {
    /// Those of a label map.
    pub fn of(map: &'b LabelMap) -> Self {
        let names = map.names.iter();
        let names = names.map(|(label, name)| LabelName {
            label: *label,
            name,
        });
        Self {
            schema_version: 1,
            labels: names.collect(),
        }
    }
}

/// What of a build is written besides surfaces, report and scenario.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BuildFiles {
    /// The label map with its names.
    pub labels: bool,
    /// The label map as a segmentation of 3D Slicer, too.
    pub segmentation: bool,
    /// The volume along the patient's axes: what everything was found in.
    pub volume: bool,
    /// Images of slices: name and bytes of each.
    pub slices: Vec<(String, Vec<u8>)>,
}

/// Name of the scenario in a folder that was built.
pub const SCENARIO_FILE: &str = "scenario.toml";
/// Name of the volume there.
pub const VOLUME_FILE: &str = "volume.nii.gz";
/// Name of the label map there.
pub(super) const LABELS_FILE: &str = "labels.nii.gz";
/// The label map as a segmentation of 3D Slicer.
pub(super) const SEGMENTATION_FILE: &str = "labels.seg.nrrd";
/// Names of its labels.
pub(super) const NAMES_FILE: &str = "labels.json";
/// What was built.
pub(super) const REPORT_FILE: &str = "report.json";
/// Folder of images of slices there.
pub const SLICES: &str = "slices";
/// Routes that were planned there.
pub const ROUTES_FILE: &str = "routes.json";
/// Decisions of the planning page's user there.
pub const SESSION_FILE: &str = "session.toml";
