//! Sternum and spine.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_geometry::Solid;

use super::envelope::{Envelope, Frame};
use super::solids::{cuboid, cylinder, pose};
use super::{PhantomParameters, PhantomPart, Tissue};

const BONE_RGBA: [f32; 4] = [0.93, 0.89, 0.78, 1.0];

/// Vertebrae from the first thoracic one down, with the height of the first and the distance from
/// one to the next in the layout table, mm (assumed: T1 to T12 span 285 mm).
const VERTEBRAE: [&str; 16] = [
    "t1", "t2", "t3", "t4", "t5", "t6", "t7", "t8", "t9", "t10", "t11", "t12", "l1", "l2", "l3",
    "l4",
];
pub(super) const FIRST_VERTEBRA_MM: f64 = 180.0;
pub(super) const VERTEBRA_PITCH_MM: f64 = 24.0;
/// Share of the pitch that is bone; the rest is disc.
const VERTEBRA_SHARE: f64 = 0.84;
/// Distance of the vertebral bodies' axis in front of the back of the cage, layout mm.
const SPINE_FROM_CAGE_MM: f64 = 26.0;

/// Sternum and spine, in a fixed order.
pub(super) fn skeleton(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    let mut parts = sternum(parameters, envelope, frame);
    parts.extend(spine(parameters, envelope, frame));
    parts
}

/// A part of bone.
pub(super) fn bone(solid: Solid, organ: &str) -> PhantomPart {
    PhantomPart {
        name: solid.name.clone(),
        tissue: Tissue::Bone,
        organ: Some(organ.to_owned()),
        solid,
        color_rgba: BONE_RGBA,
    }
}

/// Manubrium, body and xiphoid process, each a box that leans with the front of the cage.
fn sternum(parameters: &PhantomParameters, envelope: &Envelope, frame: &Frame) -> Vec<PhantomPart> {
    /// Name, upper and lower end in the layout table (mm), share of the width and the thickness.
    const PIECES: [(&str, f64, f64, f64, f64); 3] = [
        ("manubrium", 144.0, 97.0, 1.35, 1.0),
        ("sternum_body", 95.0, -8.0, 1.0, 1.0),
        ("xiphoid", -10.0, -38.0, 0.55, 0.6),
    ];
    /// Space between the cage's front and the bone, mm.
    const FROM_PLEURA_MM: f64 = 1.0;

    PIECES
        .into_iter()
        .map(|(name, upper_mm, lower_mm, width, thickness)| {
            let thickness_m = 1e-3 * thickness * parameters.sternum_thickness_mm;
            let outwards_m = 1e-3 * FROM_PLEURA_MM + 0.5 * thickness_m;
            let [upper, lower] = [upper_mm, lower_mm].map(|height_mm| {
                let z_m = frame.height_m(height_mm);
                let front_m = envelope.cage_section(z_m).front_m();
                Point3::new(0.0, front_m - outwards_m, z_m)
            });
            let along = upper - lower;
            // Turn about x only, so that the box keeps its broad side to the front.
            let lean_rad = libm::atan2(-along.y, along.z);
            let half_extents_m = Vector3::new(
                0.5e-3 * width * parameters.sternum_width_mm,
                0.5 * thickness_m,
                0.5 * along.norm(),
            );
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), lean_rad);
            let placed = pose(nalgebra::center(&upper, &lower), rotation);
            bone(cuboid(name.to_owned(), half_extents_m, placed), "sternum")
        })
        .collect()
}

/// Vertebral bodies, each with a box for its spinous process.
fn spine(parameters: &PhantomParameters, envelope: &Envelope, frame: &Frame) -> Vec<PhantomPart> {
    /// Spinous processes: half width, half height as a share of the pitch, and the soft tissue
    /// between their tips and the skin (assumed).
    const PROCESS_HALF_WIDTH_MM: f64 = 4.0;
    const PROCESS_HALF_HEIGHT: f64 = 0.35;
    const PROCESS_UNDER_SKIN_MM: f64 = 14.0;

    let radius_m = 0.5e-3 * parameters.vertebra_diameter_mm;
    let pitch_m = frame.height_m(VERTEBRA_PITCH_MM);
    let mut parts = Vec::with_capacity(2 * VERTEBRAE.len());
    for (index, level) in VERTEBRAE.iter().enumerate() {
        let z_m = frame.height_m(FIRST_VERTEBRA_MM - VERTEBRA_PITCH_MM * index as f64);
        let [low, high] = [-0.5, 0.5].map(|side| {
            let z_m = z_m + side * VERTEBRA_SHARE * pitch_m;
            Point3::new(0.0, spine_axis_y_m(envelope, frame, z_m), z_m)
        });
        let name = format!("vertebra_{level}");
        let body = cylinder(name.clone(), low, high, radius_m);
        parts.push(bone(body, "spine"));

        let front_m = spine_axis_y_m(envelope, frame, z_m) + radius_m;
        let back_m = envelope.skin_section(z_m).back_m() - 1e-3 * PROCESS_UNDER_SKIN_MM;
        let half_extents_m = Vector3::new(
            1e-3 * PROCESS_HALF_WIDTH_MM,
            0.5 * (back_m - front_m),
            PROCESS_HALF_HEIGHT * pitch_m,
        );
        let center = Point3::new(0.0, 0.5 * (front_m + back_m), z_m);
        let process = cuboid(
            format!("{name}.process"),
            half_extents_m,
            pose(center, UnitQuaternion::identity()),
        );
        parts.push(bone(process, "spine"));
    }
    parts
}

/// The vertebral bodies' axis follows the back of the cage.
pub(super) fn spine_axis_y_m(envelope: &Envelope, frame: &Frame, z_m: f64) -> f64 {
    envelope.cage_section(z_m).back_m() - frame.size_m(SPINE_FROM_CAGE_MM)
}
