//! The folder of a patient that was built, read again.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, Vector3};
use needlebench_imaging::read::{ReadOptions, read_label_names, read_labels};
use needlebench_imaging::registration::ReferenceFrame;
use needlebench_imaging::{ImagingError, LabelMap, VoxelGrid};
use serde::Deserialize;

/// What was built from a scan, as far as routes need it.
#[derive(Debug, Clone, PartialEq)]
pub struct BuiltFolder {
    /// What each voxel is.
    pub labels: LabelMap,
    /// Origin of frame `phantom` in `ct`, m; the axes are the same.
    pub origin_in_ct_m: Vector3<f64>,
    /// Labels that are lesions, by name.
    pub lesions: Vec<String>,
    /// Markers on the skin: middle in `ct` and radius, m.
    pub markers: Vec<(Point3<f64>, f64)>,
    /// Why it is not known where the robot is to the patient; none if it is.
    pub not_registered: Option<String>,
}

#[derive(Deserialize)]
struct Report {
    schema_version: u32,
    size: [usize; 3],
    spacing_m: [f64; 3],
    first_voxel_m: [f64; 3],
    phantom_origin_m: [f64; 3],
    lesions: Vec<Named>,
    markers: Option<Markers>,
    registration: Option<Frame>,
}

#[derive(Deserialize)]
struct Named {
    name: String,
}

#[derive(Deserialize)]
struct Markers {
    found: Vec<Marker>,
}

#[derive(Deserialize)]
struct Marker {
    center_m: [f64; 3],
    diameter_m: f64,
}

#[derive(Deserialize)]
struct Frame {
    frame: ReferenceFrame,
}

/// The version of `report.json` that is read.
const VERSION: u32 = 1;

impl BuiltFolder {
    /// Reads the report and the label map of a folder of `ct build`.
    ///
    /// # Errors
    /// A folder that `ct build` did not write, files that are missing or do not belong together, interrupted.
    pub fn read(folder: &Path, cancel: &AtomicBool) -> Result<Self, ImagingError> {
        let report = report(folder)?;
        let grid = VoxelGrid::aligned(
            report.size,
            report.spacing_m,
            Point3::from(report.first_voxel_m),
        )
        .map_err(|error| {
            ImagingError::refused(error.to_string())
                .at(folder.join("report.json").display().to_string())
        })?;
        let at =
            |name: &str, error: ImagingError| error.at(folder.join(name).display().to_string());
        let path = folder.join("labels.nii.gz");
        if !path.exists() {
            return Err(ImagingError::refused(
                "there is no label map, by which routes are planned",
            )
            .hint("build the patient again without --no-labels")
            .at(path.display().to_string()));
        }
        let options = ReadOptions::default();
        let read = read_labels(&path, &grid, &options, cancel)
            .map_err(|error| at("labels.nii.gz", error))?;
        let names = folder.join("labels.json");
        let names = read_label_names(&names).map_err(|error| at("labels.json", error))?;
        let not_registered = match report.registration.map(|registration| registration.frame) {
            Some(ReferenceFrame::Robot) => None,
            Some(ReferenceFrame::Phantom) => Some(
                "the markers are those of a drawing, which does not say where the robot is"
                    .to_owned(),
            ),
            None => Some(
                "the scan was built without markers, so it is not known where the robot is"
                    .to_owned(),
            ),
        };
        Ok(Self {
            labels: LabelMap {
                names,
                ..read.labels
            },
            origin_in_ct_m: Vector3::from(report.phantom_origin_m),
            lesions: report
                .lesions
                .into_iter()
                .map(|lesion| lesion.name)
                .collect(),
            markers: report.markers.map_or_else(Vec::new, |markers| {
                let found = markers.found.into_iter();
                found
                    .map(|marker| (Point3::from(marker.center_m), 0.5 * marker.diameter_m))
                    .collect()
            }),
            not_registered,
        })
    }
}

fn report(folder: &Path) -> Result<Report, ImagingError> {
    let path = folder.join("report.json");
    let refused = |message: String| {
        ImagingError::refused(message)
            .hint("give a folder that `needlebench ct build` has written")
            .at(path.display().to_string())
    };
    let text = std::fs::read_to_string(&path)
        .map_err(|error| refused(format!("cannot be read: {error}")))?;
    let report: Report = serde_json::from_str(&text).map_err(|error| {
        refused(format!(
            "it is no report of a patient that was built: {error}"
        ))
    })?;
    if report.schema_version != VERSION {
        return Err(refused(format!(
            "its schema_version is {}, and {VERSION} is known",
            report.schema_version
        )));
    }
    Ok(report)
}
