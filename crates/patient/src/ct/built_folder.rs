//! The folder of a patient that was built, read again and checked.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, Vector3};
use needlebench_imaging::registration::{ReferenceFrame, Registration};
use needlebench_input::{Finding, read_text, sha256_hex};
use needlebench_scenario::scenario::{LengthUnit, Scenario};
use needlebench_volume::read::{ReadOptions, read_label_names, read_labels, read_volume};
use needlebench_volume::{LabelMap, SurfaceTissue, Volume, VolumeError, VoxelGrid};
use serde::Deserialize;

use super::digest::voxels_sha256;
use super::files::{LABELS_FILE, NAMES_FILE, REPORT_FILE, VOLUME_FILE};
use super::overview::OverviewRow;
use super::patient::is_under;
use crate::stop::Stop;

/// Farthest that a corner of the volume may be from where the report has it, m: a file has single precision.
const SAME_PLACE_M: f64 = 1e-5;
/// The version of `report.json` that is read.
const VERSION: u32 = 1;
/// What to do about a folder that was not built, or not for this.
pub(super) const BUILD: &str = "create such a folder with `needlebench ct build SCAN --out DIR`";
const BUILD_ANEW: &str = "volume, labels, surfaces and scenario must come from one `needlebench ct build`; rebuild the \
     folder";

/// What of `report.json` is used again. Lengths in m, places in `ct`.
#[derive(Debug, Clone, Deserialize)]
pub struct BuildFacts {
    schema_version: u32,
    /// Of the report itself.
    #[serde(skip)]
    sha256: String,
    pub(super) size: [usize; 3],
    pub(super) spacing_m: [f64; 3],
    first_voxel_m: [f64; 3],
    pub(super) phantom_origin_m: [f64; 3],
    #[serde(default)]
    voxels_sha256: Option<String>,
    #[serde(default)]
    labels_sha256: Option<String>,
    /// What was found, and what is not known; nothing in reports of former versions.
    #[serde(default)]
    pub overview: Vec<OverviewRow>,
    /// Closed surfaces.
    pub surfaces: Vec<SurfaceFacts>,
    /// The body behind the cuts of the scan, if one is assumed.
    #[serde(default)]
    assumed_body: Option<AssumedBodyFacts>,
    /// Markers, if they were looked for.
    pub markers: Option<MarkersFacts>,
    /// Where the patient is, if markers say it.
    pub registration: Option<Registration>,
    /// Centres of lesions.
    pub targets: Vec<TargetFacts>,
    /// Lesions with their sizes.
    pub lesions: Vec<LesionFacts>,
}

impl BuildFacts {
    /// Files of the surfaces, relative to the folder.
    pub(super) fn surface_files(&self) -> impl Iterator<Item = &str> {
        let assumed = self.assumed_body.iter();
        let assumed = assumed.flat_map(|assumed| &assumed.surfaces);
        let surfaces = self.surfaces.iter().map(|surface| surface.file.as_str());
        surfaces.chain(assumed.map(|piece| piece.file.as_str()))
    }
}

/// An assumed body.
#[derive(Debug, Clone, Deserialize)]
struct AssumedBodyFacts {
    surfaces: Vec<AssumedPieceFacts>,
}

#[derive(Debug, Clone, Deserialize)]
struct AssumedPieceFacts {
    file: String,
}

/// A closed surface.
#[derive(Debug, Clone, Deserialize)]
pub struct SurfaceFacts {
    /// Its name, as in `[[phantom.parts]]`.
    pub name: String,
    /// What it is of; none in reports of former versions.
    #[serde(default)]
    tissue: Option<SurfaceTissue>,
    file: String,
    triangles: u64,
    /// From the surface of the voxels to this one.
    pub distance_from_voxels: SurfaceDistance,
}

/// How far a surface is from that of the voxels.
#[derive(Debug, Clone, Deserialize)]
pub struct SurfaceDistance {
    /// Of 99 % of it, m.
    pub p99_m: f64,
}

/// Markers of a scan.
#[derive(Debug, Clone, Deserialize)]
pub struct MarkersFacts {
    /// Those that were found.
    pub found: Vec<MarkerFacts>,
}

/// A marker.
#[derive(Debug, Clone, Deserialize)]
pub struct MarkerFacts {
    /// Its centre in `ct`.
    pub center_m: [f64; 3],
    /// Its diameter.
    pub diameter_m: f64,
}

/// A lesion as a target.
#[derive(Debug, Clone, Deserialize)]
pub struct TargetFacts {
    /// Its name.
    pub name: String,
    /// Its centroid in `ct`.
    pub center_m: [f64; 3],
    /// Covariance of how well it is localised in the scan, rows.
    pub covariance_m2: [[f64; 3]; 3],
    /// The registration's error there.
    pub registration: Option<TargetErrorFacts>,
}

/// A registration's error at a target.
#[derive(Debug, Clone, Deserialize)]
pub struct TargetErrorFacts {
    /// Root mean square, m.
    pub rms_m: f64,
}

/// A lesion.
#[derive(Debug, Clone, Deserialize)]
pub struct LesionFacts {
    /// Its name.
    pub name: String,
    /// Whether it is in the lung.
    pub in_lung: bool,
    /// How large it is.
    pub size: Option<SizeFacts>,
}

/// Size of a lesion.
#[derive(Debug, Clone, Deserialize)]
pub struct SizeFacts {
    /// Diameter of the ball of its volume.
    pub equivalent_diameter_m: f64,
}

/// A patient that was built from a scan: report and label map, which belong together.
#[derive(Debug, Clone)]
pub struct BuiltFolder {
    folder: PathBuf,
    facts: BuildFacts,
    labels: LabelMap,
}

impl BuiltFolder {
    /// Reads the report and the label map of a folder of `ct build`.
    ///
    /// # Errors
    /// A folder that `ct build` did not write, files that are missing or do not belong together; interrupted.
    pub fn read(folder: &Path, cancel: &AtomicBool) -> Result<Self, Stop> {
        let path = folder.join(REPORT_FILE);
        let facts = read_facts(&path).map_err(|error| Stop::of_scan(&path, error.hint(BUILD)))?;
        let grid = VoxelGrid::aligned(facts.size, facts.spacing_m, facts.first_voxel_m.into())
            .map_err(|error| {
                Stop::of_scan(&path, VolumeError::refused(error.to_string()).at("size"))
            })?;
        check_surfaces(folder, &facts)?;
        Ok(Self {
            labels: labels(folder, &facts, &grid, cancel)?,
            facts,
            folder: folder.to_owned(),
        })
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What the report says.
    pub fn facts(&self) -> &BuildFacts {
        &self.facts
    }

    /// SHA-256 of the report: what was made of this build names it.
    pub fn sha256(&self) -> &str {
        &self.facts.sha256
    }

    /// Whether the folder still has the build that was read.
    ///
    /// # Errors
    /// It was built again since.
    pub fn check_unchanged(&self) -> Result<(), Finding> {
        let path = self.folder.join(REPORT_FILE);
        let text = read_text(&path).ok();
        if text.is_some_and(|text| sha256_hex(text.as_bytes()) == self.facts.sha256) {
            return Ok(());
        }
        let message = "the folder was built again since it was read";
        Err(Finding::new(path.display().to_string(), message)
            .hint("start the planning page again, and choose target and entry anew"))
    }

    /// What each voxel is. Its grid is the report's, to the last digit, not that of a file of single precision.
    pub fn labels(&self) -> &LabelMap {
        &self.labels
    }

    /// Origin of frame `phantom` in `ct`, m; the axes are the same.
    pub fn origin_in_ct_m(&self) -> Vector3<f64> {
        self.facts.phantom_origin_m.into()
    }

    /// Names of labels that are lesions.
    pub fn lesions(&self) -> Vec<String> {
        let lesions = self.facts.lesions.iter();
        lesions.map(|lesion| lesion.name.clone()).collect()
    }

    /// Markers on the skin: middle in `ct` and radius, m.
    pub fn markers(&self) -> Vec<(Point3<f64>, f64)> {
        let markers = self.facts.markers.iter().flat_map(|it| &it.found);
        markers
            .map(|marker| (Point3::from(marker.center_m), 0.5 * marker.diameter_m))
            .collect()
    }

    /// Why it is not known where the robot is to the patient; none if it is.
    pub fn not_registered(&self) -> Option<&'static str> {
        match self.facts.registration.as_ref().map(|it| it.frame) {
            None => Some(
                "no registration: the scan is not registered to the robot; build it with --markers \
                 digitised with the robot",
            ),
            Some(ReferenceFrame::Phantom) => Some(
                "the marker positions are from a drawing, which does not register the robot; build \
                 it with markers digitised with the robot",
            ),
            Some(ReferenceFrame::Robot) => None,
        }
    }

    /// The volume, if it is that of the report.
    ///
    /// # Errors
    /// If there is another; interrupted.
    pub fn volume_if_any(&self, cancel: &AtomicBool) -> Result<Option<Volume>, Stop> {
        let is_there = self.folder.join(VOLUME_FILE).is_file();
        is_there.then(|| self.volume(cancel)).transpose()
    }

    /// The volume.
    ///
    /// # Errors
    /// If there is none, or another; interrupted.
    pub fn volume(&self, cancel: &AtomicBool) -> Result<Volume, Stop> {
        let path = self.folder.join(VOLUME_FILE);
        if !path.is_file() {
            let error = VolumeError::refused("no volume to show").hint(
                "build the folder without --no-volume: `needlebench ct build SCAN --out DIR`",
            );
            return Err(Stop::of_scan(&path, error));
        }
        let read = read_volume(&path, &ReadOptions::default(), 1, cancel)
            .map_err(|error| Stop::of_scan(&path, error))?;
        let mut volume = read.volume;
        let sha256 = self.facts.voxels_sha256.as_deref();
        let other = if volume.grid.size() != self.facts.size {
            Some("a different number of voxels")
        } else if volume.grid.farthest_corners_m(&self.labels.grid) > SAME_PLACE_M {
            Some("voxels at different positions")
        } else if sha256 != Some(&voxels_sha256(&volume.hu, i16::to_le_bytes)) {
            Some("different Hounsfield units")
        } else {
            None
        };
        if let Some(other) = other {
            let message = format!("not the volume of {REPORT_FILE}: {other}");
            let error = VolumeError::refused(message).hint(BUILD_ANEW);
            return Err(Stop::of_scan(&path, error));
        }
        volume.grid = self.labels.grid.clone();
        Ok(volume)
    }

    /// Whether a scenario is that of this patient.
    ///
    /// # Errors
    /// What it lacks, or has elsewhere.
    pub fn check_scenario(&self, file: &str, scenario: &Scenario) -> Result<(), Stop> {
        check_patient(&self.facts, file, scenario).map_err(Stop::from)
    }
}

/// Whether the patient of a scenario is that of the report: of the same build, its surfaces where the report has them.
pub(super) fn check_patient(
    facts: &BuildFacts,
    file: &str,
    scenario: &Scenario,
) -> Result<(), Finding> {
    let other = |message: String| {
        let finding = Finding::new(file, message);
        finding.key("phantom.parts").hint(BUILD_ANEW)
    };
    let build = scenario.phantom.as_ref().and_then(|it| it.build.as_ref());
    if build.is_some_and(|build| build.sha256 != facts.sha256) {
        return Err(other(format!("not of the build of {REPORT_FILE}")));
    }
    let parts = scenario.phantom.as_ref().map(|it| &it.parts[..]);
    for surface in &facts.surfaces {
        let mut parts = parts.unwrap_or_default().iter();
        let part = parts.find(|it| it.name == surface.name && it.file == surface.file);
        if part.is_none() && surface.tissue.is_some_and(|it| is_under(it, &surface.name)) {
            // Left out where the patient lies otherwise than in the scan.
            continue;
        }
        let Some(part) = part else {
            return Err(other(format!(
                "no part `{}` of the file {}, which {REPORT_FILE} has",
                surface.name, surface.file
            )));
        };
        let off_m =
            (Vector3::from(part.position_mm) * 1e-3 + Vector3::from(facts.phantom_origin_m)).norm();
        if off_m > SAME_PLACE_M {
            return Err(other(format!(
                "part `{}` is {:.2} mm from its position in {REPORT_FILE}",
                part.name,
                off_m * 1e3
            )));
        }
        if part.rpy_deg != [0.0; 3] || part.unit != LengthUnit::Mm {
            return Err(other(format!(
                "part `{}` is turned or in another unit than in {REPORT_FILE}",
                part.name
            )));
        }
    }
    Ok(())
}

/// The report at a path.
pub(super) fn read_facts(path: &Path) -> Result<BuildFacts, VolumeError> {
    let text = read_text(path).map_err(|error| VolumeError::refused(error.to_string()))?;
    let mut facts: BuildFacts = serde_json::from_str(&text)
        .map_err(|error| VolumeError::refused(format!("not written by `ct build`: {error}")))?;
    facts.sha256 = sha256_hex(text.as_bytes());
    if facts.schema_version == VERSION {
        return Ok(facts);
    }
    let version = facts.schema_version;
    Err(
        VolumeError::refused(format!("version {version}, supported is {VERSION}"))
            .at("schema_version"),
    )
}

/// The label map, if it is that of the report.
fn labels(
    folder: &Path,
    facts: &BuildFacts,
    grid: &VoxelGrid,
    cancel: &AtomicBool,
) -> Result<LabelMap, Stop> {
    let path = folder.join(LABELS_FILE);
    if !path.is_file() {
        let error = VolumeError::refused("no label map")
            .hint("build the folder without --no-labels: `needlebench ct build SCAN --out DIR`");
        return Err(Stop::of_scan(&path, error));
    }
    let read = read_labels(&path, grid, &ReadOptions::default(), cancel)
        .map_err(|error| Stop::of_scan(&path, error))?;
    let labels = read.labels.labels;
    if facts.labels_sha256.as_deref() != Some(&voxels_sha256(&labels, u16::to_le_bytes)) {
        let error = VolumeError::refused(format!("not the label map of {REPORT_FILE}"));
        return Err(Stop::of_scan(&path, error.hint(BUILD_ANEW)));
    }
    let names = folder.join(NAMES_FILE);
    Ok(LabelMap {
        grid: grid.clone(),
        labels,
        names: read_label_names(&names).map_err(|error| Stop::of_scan(&names, error))?,
    })
}

/// Surfaces must be those of the report, by the number of their triangles.
fn check_surfaces(folder: &Path, facts: &BuildFacts) -> Result<(), Stop> {
    /// Bytes of a binary STL before its triangles, and of one.
    const HEAD: u64 = 84;
    const TRIANGLE: u64 = 50;
    for surface in &facts.surfaces {
        let path = folder.join(&surface.file);
        let size = path.metadata().map(|metadata| metadata.len());
        if size.ok() != Some(HEAD + TRIANGLE * surface.triangles) {
            let message = format!("not the surface `{}` of {REPORT_FILE}", surface.name);
            let error = VolumeError::refused(message).hint(BUILD_ANEW);
            return Err(Stop::of_scan(&path, error));
        }
    }
    Ok(())
}
