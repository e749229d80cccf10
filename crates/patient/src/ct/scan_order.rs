//! What is scanned, how it lies, and which slices are made of it.

use std::path::Path;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::Pose;
use needlebench_phantom::{Phantom, PhantomPart};
use needlebench_scenario::ResolvedScenario;
use needlebench_synthesis::{Scanner, Scene};
use needlebench_volume::{VolumeError, VoxelGrid};

use super::truth::{lesions, markers, rows_of_grid, rows_of_pose};
use super::{Materials, ScanTruth, phantom_scene};

/// A patient on the table.
#[derive(Debug, Clone)]
pub struct CtSubject<'p> {
    /// What it is called: the file's name.
    pub name: String,
    /// The phantom.
    pub phantom: &'p Phantom,
    /// Head and arms.
    pub limbs: &'p [PhantomPart],
    /// Direction of gravity in the phantom's frame.
    pub down: Vector3<f64>,
    /// Place of the phantom in terms of the robot's `base_link`, where there is a robot.
    pub robot_from_phantom: Option<Pose>,
}

impl<'p> CtSubject<'p> {
    /// A phantom on its back, without a robot.
    pub fn of_phantom(file: &Path, phantom: &'p Phantom) -> Self {
        Self {
            name: name_of(file),
            phantom,
            limbs: &[],
            down: Vector3::y(),
            robot_from_phantom: None,
        }
    }

    /// The phantom of a scenario as it lies there; `None` if it has none.
    pub fn of_scenario(file: &Path, resolved: &'p ResolvedScenario) -> Option<Self> {
        let placed = resolved.phantom.as_ref()?;
        let robot_from_world = resolved.cell.robot.world_from_base_link.inverse();
        let world_from_phantom = placed.world_from_phantom;
        Some(Self {
            name: name_of(file),
            phantom: &placed.phantom,
            limbs: placed.modelled_limbs(),
            down: world_from_phantom.inverse_transform_vector(&-Vector3::z()),
            robot_from_phantom: Some(robot_from_world * world_from_phantom),
        })
    }
}

fn name_of(file: &Path) -> String {
    let name = file.file_name().unwrap_or(file.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Which part of the patient is scanned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ScanRange {
    /// The chest from its lower to its upper end, and this much more at both, m.
    Whole(f64),
    /// Between two heights of `ct`, m.
    Heights([f64; 2]),
}

/// How a subject is to be scanned.
#[derive(Debug, Clone)]
pub struct ScanOrder {
    /// The scanner.
    pub scanner: Scanner,
    /// Distance of neighbouring slices along the table, m.
    pub increment_m: f64,
    /// Columns and rows.
    pub size: usize,
    /// Distance between pixels, m; as small as the body, with its markers, fits into the circle if left out, at least
    /// 0.7 mm.
    pub pixel_m: Option<f64>,
    /// Which slices.
    pub range: ScanRange,
    /// Tilt of the gantry about the patient's left-right axis, rad: rows lean towards the feet for positive ones.
    pub tilt_rad: f64,
    /// Turn of the patient about the long axis, rad, away from how he lies.
    pub turn_rad: f64,
    /// Place of the phantom's origin in `ct`, m.
    pub shift_m: Vector3<f64>,
    /// By how much of a voxel the slices lie off the middle of the patient, along columns, rows and slices.
    pub off_middle: Vector3<f64>,
    /// Whether columns, rows and slices run along -x, -y, -z of `ct` and not along +x, +y, +z.
    pub flipped: [bool; 3],
    /// Whether a bed is under the patient.
    pub has_bed: bool,
    /// Hounsfield units.
    pub materials: Materials,
    /// Seed of the noise.
    pub seed: u64,
}

/// All that a synthetic scan is made from, and its ground truth.
#[derive(Debug, Clone)]
pub struct SyntheticScan {
    /// What is scanned, in `ct`.
    pub scene: Scene,
    /// Where the voxels are.
    pub grid: VoxelGrid,
    /// Place of the phantom in `ct`.
    pub ct_from_phantom: Pose,
    /// From `ct` to the robot's `base_link`, where there is a robot.
    pub robot_from_ct: Option<Pose>,
    /// The ground truth.
    pub truth: ScanTruth,
}

/// Least distance between pixels that is chosen, m: a usual one of chest scans.
const LEAST_PIXEL_M: f64 = 0.7e-3;
/// Body in the circle: what is left beside it, m.
const BESIDE_M: f64 = 10e-3;
/// The bed: a mattress of foam on a plate of carbon fibre, in the order from the patient down; thickness in m and HU
/// (assumed).
const BED: [(&str, f64, f64); 3] = [
    ("mattress", 15e-3, -950.0),
    ("bed_shell", 2e-3, -100.0),
    ("bed_core", 40e-3, -900.0),
];
/// Half of the bed's breadth, and of its length, m (assumed).
const BED_HALF_M: [f64; 2] = [0.21, 1.2];

impl SyntheticScan {
    /// Lays the subject on the bed and the slices through it.
    pub fn new(subject: &CtSubject<'_>, order: &ScanOrder) -> Result<Self, VolumeError> {
        let pose = Posed::new(subject, order);
        let mut scene = phantom_scene(subject.phantom, subject.limbs, &order.materials)
            .moved(&pose.ct_from_phantom);
        let outside = pose.extent(&subject.phantom.parts);
        let grid = order.grid(&outside)?;
        if order.has_bed {
            add_bed(&mut scene, &pose, subject);
        }
        let phantom = subject.phantom;
        let ct_from_phantom = pose.ct_from_phantom;
        let robot_from_ct = subject
            .robot_from_phantom
            .map(|pose| pose * ct_from_phantom.inverse());
        let truth = ScanTruth {
            schema_version: 1,
            subject: subject.name.clone(),
            seed: order.seed,
            scanner: order.scanner.clone(),
            materials_hu: order.materials.clone(),
            size: grid.size(),
            ct_from_index: rows_of_grid(&grid),
            ct_from_phantom: rows_of_pose(&ct_from_phantom),
            robot_from_ct: robot_from_ct.as_ref().map(rows_of_pose),
            gantry_tilt_rad: order.tilt_rad,
            down: pose.down.into(),
            lesions: lesions(phantom, &ct_from_phantom),
            markers: markers(phantom, &ct_from_phantom),
        };
        Ok(Self {
            scene,
            grid,
            ct_from_phantom,
            robot_from_ct,
            truth,
        })
    }
}

/// The subject in `ct`.
struct Posed {
    ct_from_phantom: Pose,
    /// One of +x, -x, +y, -y: how technicians lay people.
    down: Vector3<f64>,
}

impl Posed {
    fn new(subject: &CtSubject<'_>, order: &ScanOrder) -> Self {
        let across = Vector3::new(subject.down.x, subject.down.y, 0.0);
        let down = if across.x.abs() > across.y.abs() {
            Vector3::x() * across.x.signum()
        } else if across.y < 0.0 {
            -Vector3::y()
        } else {
            Vector3::y()
        };
        // How far he is turned from the posture that is named after that direction.
        let turn = libm::atan2(across.cross(&down).z, across.dot(&down)) + order.turn_rad;
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        Self {
            ct_from_phantom: Pose::from_parts(order.shift_m.into(), rotation),
            down,
        }
    }

    fn extent(&self, parts: &[PhantomPart]) -> (Vector3<f64>, Vector3<f64>) {
        let start = (
            Vector3::repeat(f64::INFINITY),
            Vector3::repeat(f64::NEG_INFINITY),
        );
        parts.iter().fold(start, |(low, high), part| {
            let (least, most) = self.moved(&part.solid).bounding_box();
            (low.inf(&least.coords), high.sup(&most.coords))
        })
    }

    fn moved(&self, solid: &Solid) -> Solid {
        Solid {
            parent_from_shape: self.ct_from_phantom * solid.parent_from_shape,
            ..solid.clone()
        }
    }
}

impl ScanOrder {
    /// The slices through a body of this extent in `ct`.
    fn grid(&self, (low, high): &(Vector3<f64>, Vector3<f64>)) -> Result<VoxelGrid, VolumeError> {
        let middle = 0.5 * (low + high);
        let reach_m = 0.5 * (high - low).xy().max() + BESIDE_M;
        let pixel_m = self
            .pixel_m
            .unwrap_or_else(|| (2.0 * reach_m / self.size as f64).max(LEAST_PIXEL_M));
        let [from_m, to_m] = match self.range {
            ScanRange::Whole(beyond_m) => [low.z - beyond_m, high.z + beyond_m],
            ScanRange::Heights(heights_m) => heights_m,
        };
        let slices = ((to_m - from_m) / self.increment_m).ceil().max(1.0);
        if !slices.is_finite() || slices > f64::from(u16::MAX) {
            return Err(VolumeError::refused(format!(
                "{slices} slices from {:.1} to {:.1} mm with spacing {} mm; at most 65535",
                1e3 * from_m,
                1e3 * to_m,
                1e3 * self.increment_m
            )));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 1 to 65535"
        )]
        let slices = slices as usize;
        let (sine, cosine) = libm::sincos(self.tilt_rad);
        let sign = |axis: usize| if self.flipped[axis] { -1.0 } else { 1.0 };
        let steps_m = Matrix3::from_columns(&[
            Vector3::x() * (sign(0) * pixel_m),
            Vector3::new(0.0, cosine, -sine) * (sign(1) * pixel_m),
            Vector3::z() * (sign(2) * self.increment_m),
        ]);
        let last = Vector3::new(self.size as f64, self.size as f64, slices as f64).add_scalar(-1.0);
        let middle = Vector3::new(middle.x, middle.y, 0.5 * (from_m + to_m));
        let first_m = middle + steps_m * (self.off_middle - last * 0.5);
        VoxelGrid::new(
            [self.size, self.size, slices],
            steps_m,
            Point3::from(first_m),
        )
        .map_err(|error| VolumeError::refused(format!("invalid slices: {error}")))
    }
}

/// Under what lies lowest of the patient; under all parts of the scene, which is why it is laid first.
fn add_bed(scene: &mut Scene, pose: &Posed, subject: &CtSubject<'_>) {
    let skin = std::iter::once(subject.phantom.skin());
    let outside = skin.chain(subject.limbs.iter().map(|part| &part.solid));
    let mut top_m = outside
        .map(|solid| {
            let (low, high) = pose.moved(solid).bounding_box();
            low.coords.dot(&pose.down).max(high.coords.dot(&pose.down))
        })
        .fold(f64::NEG_INFINITY, f64::max);
    let centre = pose.ct_from_phantom.translation.vector;
    let across = centre - pose.down * centre.dot(&pose.down);
    let breadthwise = pose.down.cross(&Vector3::z()).abs();
    let patient = std::mem::take(&mut scene.parts);
    for (name, thickness_m, hu) in BED {
        let half_extents_m = pose.down.abs() * (0.5 * thickness_m)
            + breadthwise * BED_HALF_M[0]
            + Vector3::z() * BED_HALF_M[1];
        let place = across + pose.down * (top_m + 0.5 * thickness_m);
        let label = scene.label(name);
        let solid = Solid {
            name: name.to_owned(),
            shape: Shape::Cuboid { half_extents_m },
            parent_from_shape: Pose::translation(place.x, place.y, place.z),
        };
        scene.push(solid, hu, label);
        top_m += thickness_m;
    }
    scene.parts.extend(patient);
}
