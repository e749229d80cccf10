//! What is known of a synthetic scan.

use nalgebra::Point3;
use needlebench_kinematics::Pose;
use needlebench_phantom::Phantom;
use needlebench_synthesis::Scanner;
use needlebench_volume::VoxelGrid;
use serde::Serialize;

use super::Materials;

/// The ground truth of a synthetic scan. Lengths in m, positions in frame `ct` (patient LPS); a transform `a_from_b` is
/// the rows of its 4 x 4 matrix.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScanTruth {
    /// Of this document.
    pub schema_version: u32,
    /// Scenario or file of parameters, by its file name.
    pub subject: String,
    /// Seed of the noise.
    pub seed: u64,
    /// The scanner's settings.
    pub scanner: Scanner,
    /// Hounsfield units of the materials.
    pub materials_hu: Materials,
    /// Columns, rows, slices.
    pub size: [usize; 3],
    /// From an index (i, j, k) at voxel centres to `ct`.
    pub ct_from_index: [[f64; 4]; 4],
    /// From the phantom's frame to `ct`.
    pub ct_from_phantom: [[f64; 4]; 4],
    /// From `ct` to the robot's `base_link`; of a scenario alone.
    pub robot_from_ct: Option<[[f64; 4]; 4]>,
    /// Tilt of the gantry, rad.
    pub gantry_tilt_rad: f64,
    /// Direction of gravity in `ct`: towards the table.
    pub down: [f64; 3],
    /// Targets.
    pub lesions: Vec<LesionTruth>,
    /// Markers.
    pub markers: Vec<MarkerTruth>,
}

/// A target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LesionTruth {
    /// Name of the lesion.
    pub name: String,
    /// Its centre in `ct`, m.
    pub center_m: [f64; 3],
    /// Its diameter, m.
    pub diameter_m: f64,
    /// The organ that contains it, if one does.
    pub organ: Option<String>,
}

/// A marker.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarkerTruth {
    /// Name of the marker.
    pub name: String,
    /// Centre of the disc's outer face in `ct`, m.
    pub center_m: [f64; 3],
    /// Outward normal in `ct`.
    pub normal: [f64; 3],
    /// Centre of the sphere in `ct`, m, if it has one.
    pub sphere_center_m: Option<[f64; 3]>,
    /// Diameter of the sphere, m.
    pub sphere_diameter_m: Option<f64>,
}

/// Rows of a rigid transform's matrix.
pub(super) fn rows_of_pose(pose: &Pose) -> [[f64; 4]; 4] {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// Rows of a grid's matrix.
pub(super) fn rows_of_grid(grid: &VoxelGrid) -> [[f64; 4]; 4] {
    let (steps, first) = (grid.steps_m(), grid.first_m());
    let row = |row: usize| {
        [
            steps[(row, 0)],
            steps[(row, 1)],
            steps[(row, 2)],
            first[row],
        ]
    };
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

pub(super) fn lesions(phantom: &Phantom, ct_from_phantom: &Pose) -> Vec<LesionTruth> {
    let truth = phantom.lesions.iter().map(|lesion| LesionTruth {
        name: lesion.name.clone(),
        center_m: moved(ct_from_phantom, &lesion.center_m),
        diameter_m: lesion.diameter_m,
        organ: lesion.organ.clone(),
    });
    truth.collect()
}

pub(super) fn markers(phantom: &Phantom, ct_from_phantom: &Pose) -> Vec<MarkerTruth> {
    let truth = phantom.markers.iter().map(|marker| MarkerTruth {
        name: marker.name.clone(),
        center_m: moved(ct_from_phantom, &marker.center_m),
        normal: (ct_from_phantom.rotation * marker.normal.into_inner()).into(),
        sphere_center_m: marker
            .sphere
            .map(|sphere| moved(ct_from_phantom, &sphere.center_m)),
        sphere_diameter_m: marker.sphere.map(|sphere| sphere.diameter_m),
    });
    truth.collect()
}

fn moved(pose: &Pose, point: &Point3<f64>) -> [f64; 3] {
    (pose * point).coords.into()
}
