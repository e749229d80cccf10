//! The folder of a patient that was built from a scan, read and checked.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, Vector3};
use needlebench_bench::Desk;
use needlebench_bench::ct::{LABELS_FILE, VOLUME_FILE, voxels_sha256};
use needlebench_cell::scenario::GoalSection;
use needlebench_cell::{Finding, OpenScenario, Overrides, load_open_scenario, read_text};
use needlebench_imaging::read::{ReadOptions, read_labels, read_volume};
use needlebench_imaging::registration::{ReferenceFrame, Registration};
use needlebench_imaging::{ImagingError, LabelMap, Volume, VoxelGrid};
use serde::Deserialize;

/// Name of the scenario in a folder that was built.
pub const SCENARIO_FILE: &str = "scenario.toml";
const REPORT_FILE: &str = "report.json";
const NAMES_FILE: &str = "labels.json";

/// Farthest that a corner of the volume may be from where the report has it, m: a file has single precision.
const SAME_PLACE_M: f64 = 1e-5;

/// What of `report.json` is used here.
#[derive(Debug, Clone, Deserialize)]
pub struct BuildFacts {
    size: [usize; 3],
    spacing_m: [f64; 3],
    first_voxel_m: [f64; 3],
    phantom_origin_m: [f64; 3],
    #[serde(default)]
    voxels_sha256: Option<String>,
    #[serde(default)]
    labels_sha256: Option<String>,
    /// Closed surfaces.
    pub surfaces: Vec<SurfaceFacts>,
    /// Markers, if they were looked for.
    pub markers: Option<MarkersFacts>,
    /// Where the patient is, if markers say it.
    pub registration: Option<Registration>,
    /// Centres of lesions.
    pub targets: Vec<TargetFacts>,
    /// Lesions with their sizes.
    pub lesions: Vec<LesionFacts>,
}

/// A closed surface.
#[derive(Debug, Clone, Deserialize)]
pub struct SurfaceFacts {
    /// Its name, as in `[[phantom.parts]]`.
    pub name: String,
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

#[derive(Debug, Deserialize)]
struct NamedLabels {
    labels: Vec<NamedLabel>,
}

#[derive(Debug, Deserialize)]
struct NamedLabel {
    label: u16,
    name: String,
}

/// A voxel, and what is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Centre in `ct`, m.
    pub ct_m: Point3<f64>,
    /// Hounsfield units; none outside the volume.
    pub hu: Option<i16>,
    /// What its label is called; none outside of everything.
    pub label: Option<String>,
}

/// A patient that was built from a scan, with the room.
pub struct Case {
    folder: PathBuf,
    overrides: Overrides,
    hu: Vec<i16>,
    labels: LabelMap,
    facts: BuildFacts,
    goals: Vec<GoalSection>,
    desk: Desk,
    run_desk: OnceLock<Desk>,
}

impl Case {
    /// Reads a folder that `needlebench ct build` made.
    ///
    /// # Errors
    /// What is missing, what is wrong with it, and what does not belong together.
    pub fn open(folder: &Path, overrides: &Overrides) -> Result<Self, Vec<Finding>> {
        let one = |finding: Finding| vec![finding];
        let facts = facts(folder).map_err(one)?;
        let grid = grid(folder, &facts).map_err(one)?;
        let volume = volume(folder, &facts, &grid).map_err(one)?;
        let labels = labels(folder, &facts, &grid).map_err(one)?;
        let OpenScenario { resolved, goals } =
            load_open_scenario(&folder.join(SCENARIO_FILE), overrides)?;
        check_surfaces(folder, &facts).map_err(one)?;
        let scenario_file = resolved.source.file.clone();
        let case = Self {
            folder: folder.to_owned(),
            overrides: overrides.clone(),
            hu: volume.hu,
            labels,
            facts,
            goals,
            desk: Desk::new(resolved)
                .map_err(|error| one(Finding::new(scenario_file, error.to_string())))?,
            run_desk: OnceLock::new(),
        };
        case.check_patient().map_err(one)?;
        Ok(case)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What the command line puts in place of the scenario's.
    pub fn overrides(&self) -> &Overrides {
        &self.overrides
    }

    /// Hounsfield units: columns run fastest, slices slowest.
    pub fn hu(&self) -> &[i16] {
        &self.hu
    }

    /// What each voxel is.
    pub fn labels(&self) -> &LabelMap {
        &self.labels
    }

    /// Where the voxels are, to the last digit: the report's, not those of a file of single precision.
    pub fn grid(&self) -> &VoxelGrid {
        &self.labels.grid
    }

    /// What the report says.
    pub fn facts(&self) -> &BuildFacts {
        &self.facts
    }

    /// Goals of the scenario, with or without an entry.
    pub fn goals(&self) -> &[GoalSection] {
        &self.goals
    }

    /// The room, for goals to be tried in.
    pub fn desk(&self) -> &Desk {
        &self.desk
    }

    /// The room as a run of a plan has it, made once.
    ///
    /// # Errors
    /// What `make` says; it is asked again the next time.
    pub fn run_desk<E>(&self, make: impl FnOnce() -> Result<Desk, E>) -> Result<&Desk, E> {
        if let Some(known) = self.run_desk.get() {
            return Ok(known);
        }
        let made = make()?;
        Ok(self.run_desk.get_or_init(|| made))
    }

    /// Why nothing is said of the robot; none if the markers say where it is from the patient.
    pub fn robot_is_unknown(&self) -> Option<&'static str> {
        match &self.facts.registration {
            None => Some(
                "no registration: nothing says where the robot is from this patient; build it with --markers, touched by the robot",
            ),
            Some(registration) if registration.frame == ReferenceFrame::Phantom => Some(
                "the markers are those of a drawing, which says nothing of the robot; build it with markers that the robot has touched",
            ),
            Some(_) => None,
        }
    }

    /// From `ct` to the scenario's phantom frame, m.
    pub fn in_phantom(&self, ct_m: &Point3<f64>) -> Point3<f64> {
        ct_m - Vector3::from(self.facts.phantom_origin_m)
    }

    /// From the scenario's phantom frame to `ct`, m.
    pub fn in_ct(&self, phantom_m: &Point3<f64>) -> Point3<f64> {
        phantom_m + Vector3::from(self.facts.phantom_origin_m)
    }

    /// What is at an index, which may lie between voxels: the place to the last digit, the value of the nearest voxel.
    pub fn place(&self, index: &Point3<f64>) -> Place {
        let offset = self.nearest_voxel(index);
        Place {
            ct_m: self.grid().ct_from_index(index),
            hu: offset.map(|offset| self.hu[offset]),
            label: offset.and_then(|offset| self.label_name(self.labels.labels[offset])),
        }
    }

    /// Offset of the voxel that an index is in; none outside the volume.
    pub fn nearest_voxel(&self, index: &Point3<f64>) -> Option<usize> {
        let size = self.grid().size();
        let mut voxel = [0; 3];
        for axis in 0..3 {
            let at = index[axis].round();
            if !(0.0..size[axis] as f64).contains(&at) {
                return None;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the volume"
            )]
            {
                voxel[axis] = at as usize;
            }
        }
        Some(self.grid().offset(voxel))
    }

    /// What a label is called; none of what is outside of everything.
    pub fn label_name(&self, label: u16) -> Option<String> {
        if label == 0 {
            return None;
        }
        let known = self.labels.names.iter().find(|(each, _)| *each == label);
        Some(known.map_or_else(|| format!("label {label}"), |(_, name)| name.clone()))
    }

    /// The scenario's patient has to be the one of the report.
    fn check_patient(&self) -> Result<(), Finding> {
        let resolved = self.desk.scenario();
        let file = &resolved.source.file;
        let other = |message: String| {
            Finding::new(file, message)
                .key("phantom.parts")
                .hint("volume, surfaces and scenario have to come from one `needlebench ct build`: build the folder anew")
        };
        let parts = resolved.scenario.phantom.as_ref().map(|it| &it.parts[..]);
        let parts = parts.unwrap_or_default();
        for surface in &self.facts.surfaces {
            let part = parts.iter().find(|part| part.name == surface.name);
            let part = part.filter(|part| part.file == surface.file);
            let Some(part) = part else {
                return Err(other(format!(
                    "it has no part `{}` of the file {}, which {REPORT_FILE} has",
                    surface.name, surface.file
                )));
            };
            let origin = Vector3::from(part.position_mm) * 1e-3;
            let off_m = (origin + Vector3::from(self.facts.phantom_origin_m)).norm();
            if off_m > SAME_PLACE_M {
                return Err(other(format!(
                    "part `{}` is {:.2} mm from where {REPORT_FILE} has it",
                    part.name,
                    off_m * 1e3
                )));
            }
        }
        Ok(())
    }
}

fn finding_of(file: &Path, error: ImagingError) -> Finding {
    let file = file.display().to_string();
    match error {
        ImagingError::Interrupted => Finding::new(file, "interrupted"),
        ImagingError::Refused { message, hint, .. } => {
            let finding = Finding::new(file, message);
            match hint {
                Some(hint) => finding.hint(hint),
                None => finding,
            }
        }
    }
}

/// What to do about a folder that was not built, or not for this.
const BUILD: &str =
    "`needlebench ct build SCAN --out DIR` makes such a folder, and with it what `view` shows";

fn json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, Finding> {
    let file = path.display().to_string();
    let text =
        read_text(path).map_err(|error| Finding::new(&file, error.to_string()).hint(BUILD))?;
    serde_json::from_str(&text).map_err(|error| {
        Finding::new(&file, format!("it is not what `ct build` writes: {error}")).hint(BUILD)
    })
}

fn facts(folder: &Path) -> Result<BuildFacts, Finding> {
    json(&folder.join(REPORT_FILE))
}

fn grid(folder: &Path, facts: &BuildFacts) -> Result<VoxelGrid, Finding> {
    let file = folder.join(REPORT_FILE);
    VoxelGrid::aligned(facts.size, facts.spacing_m, facts.first_voxel_m.into())
        .map_err(|error| Finding::new(file.display().to_string(), error.to_string()).key("size"))
}

/// The volume, if it is that of the report.
fn volume(folder: &Path, facts: &BuildFacts, grid: &VoxelGrid) -> Result<Volume, Finding> {
    let path = folder.join(VOLUME_FILE);
    let file = path.display().to_string();
    if !path.is_file() {
        return Err(Finding::new(file, "there is no volume to show")
            .hint("build the folder without --no-volume: `needlebench ct build SCAN --out DIR`"));
    }
    let read = read_volume(&path, &ReadOptions::default(), 1, &AtomicBool::new(false))
        .map_err(|error| finding_of(&path, error))?;
    let volume = read.volume;
    let other = |what: &str| {
        Finding::new(&file, format!("it is not the volume of {REPORT_FILE}: {what}"))
            .hint("volume, surfaces and scenario have to come from one `needlebench ct build`: build the folder anew")
    };
    if volume.grid.size() != grid.size() {
        return Err(other("another number of voxels"));
    }
    if volume.grid.farthest_corners_m(grid) > SAME_PLACE_M {
        return Err(other("voxels at other places"));
    }
    if facts.voxels_sha256.as_deref() != Some(&voxels_sha256(&volume.hu, i16::to_le_bytes)) {
        return Err(other("other Hounsfield units"));
    }
    Ok(volume)
}

/// The label map, if it is that of the report.
fn labels(folder: &Path, facts: &BuildFacts, grid: &VoxelGrid) -> Result<LabelMap, Finding> {
    let path = folder.join(LABELS_FILE);
    let file = path.display().to_string();
    if !path.is_file() {
        return Err(Finding::new(file, "there is no label map")
            .hint("build the folder without --no-labels: `needlebench ct build SCAN --out DIR`"));
    }
    let named: NamedLabels = json(&folder.join(NAMES_FILE))?;
    let read = read_labels(
        &path,
        grid,
        &ReadOptions::default(),
        &AtomicBool::new(false),
    )
    .map_err(|error| finding_of(&path, error))?;
    let mut labels = read.labels;
    if facts.labels_sha256.as_deref() != Some(&voxels_sha256(&labels.labels, u16::to_le_bytes)) {
        return Err(
            Finding::new(file, format!("it is not the label map of {REPORT_FILE}")).hint(
                "volume, labels and scenario have to come from one `needlebench ct build`: build the folder anew",
            ),
        );
    }
    labels.grid = grid.clone();
    labels.names = named
        .labels
        .into_iter()
        .map(|each| (each.label, each.name))
        .collect();
    Ok(labels)
}

/// Surfaces have to be those of the report, by the number of their triangles.
fn check_surfaces(folder: &Path, facts: &BuildFacts) -> Result<(), Finding> {
    /// Bytes of a binary STL before its triangles, and of one.
    const HEAD: u64 = 84;
    const TRIANGLE: u64 = 50;
    for surface in &facts.surfaces {
        let path = folder.join(&surface.file);
        let size = path.metadata().map(|metadata| metadata.len());
        if size.ok() != Some(HEAD + TRIANGLE * surface.triangles) {
            return Err(Finding::new(
                path.display().to_string(),
                format!("it is not the surface `{}` of {REPORT_FILE}", surface.name),
            )
            .hint("volume, surfaces and scenario have to come from one `needlebench ct build`: build the folder anew"));
        }
    }
    Ok(())
}
