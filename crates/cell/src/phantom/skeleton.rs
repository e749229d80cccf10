//! Ribs, sternum and spine.

use std::f64::consts::PI;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::envelope::{Envelope, Frame};
use super::solids::{capsule, cuboid, cylinder, pose};
use super::{PhantomParameters, PhantomPart, Tissue};

const BONE_RGBA: [f32; 4] = [0.93, 0.89, 0.78, 1.0];

/// Vertebrae from the first thoracic one down, with the height of the first and the distance from
/// one to the next in the layout table, mm (assumed: T1 to T12 span 285 mm).
const VERTEBRAE: [&str; 16] = [
    "t1", "t2", "t3", "t4", "t5", "t6", "t7", "t8", "t9", "t10", "t11", "t12", "l1", "l2", "l3",
    "l4",
];
const FIRST_VERTEBRA_MM: f64 = 180.0;
const VERTEBRA_PITCH_MM: f64 = 24.0;
/// Share of the pitch that is bone; the rest is disc.
const VERTEBRA_SHARE: f64 = 0.84;
/// Distance of the vertebral bodies' axis in front of the back of the cage, layout mm.
const SPINE_FROM_CAGE_MM: f64 = 26.0;

/// Course of one rib in the layout table: heights in mm, angles from the back in degrees.
///
/// The rib descends from its vertebra to its lowest point, then rises to its front end. The front
/// end's angle is `None` for ribs that reach the sternum (their costal cartilage is counted as
/// bone).
struct RibCourse {
    lowest_mm: f64,
    lowest_deg: f64,
    front_mm: f64,
    front_deg: Option<f64>,
}

const fn true_rib(lowest_mm: f64, lowest_deg: f64, front_mm: f64) -> RibCourse {
    RibCourse {
        lowest_mm,
        lowest_deg,
        front_mm,
        front_deg: None,
    }
}

const fn false_rib(lowest_mm: f64, lowest_deg: f64, front_mm: f64, front_deg: f64) -> RibCourse {
    RibCourse {
        lowest_mm,
        lowest_deg,
        front_mm,
        front_deg: Some(front_deg),
    }
}

/// The ten pairs, top down (assumed, drawn after atlas proportions).
const RIBS: [RibCourse; 10] = [
    true_rib(135.0, 180.0, 135.0),
    true_rib(96.0, 180.0, 96.0),
    true_rib(69.0, 180.0, 69.0),
    true_rib(42.0, 180.0, 42.0),
    true_rib(10.0, 158.0, 19.0),
    true_rib(-27.0, 146.0, 3.0),
    true_rib(-62.0, 140.0, -9.0),
    false_rib(-98.0, 134.0, -80.0, 150.0),
    false_rib(-130.0, 120.0, -113.0, 138.0),
    false_rib(-169.0, 112.0, -158.0, 124.0),
];
/// Pieces of a rib beyond its neck, which leads from the vertebra back to the cage.
const PIECES_PER_RIB: usize = 10;
/// Angle from the back at which the neck reaches the cage's surface (beside the transverse
/// process, so that the lung has the gutter next to the spine), rad.
const NECK_ANGLE_RAD: f64 = 0.12;
/// Space between the pleura and the inside of a rib. A straight piece's middle comes nearer to the
/// pleura than its ends, by up to 2 mm.
const RIB_FROM_PLEURA_MM: f64 = 3.5;

/// All bones, in a fixed order.
pub(super) fn bones(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    let mut parts = sternum(parameters, envelope, frame);
    parts.extend(spine(parameters, envelope, frame));
    for (index, course) in RIBS.iter().enumerate() {
        for (side, sign) in [("left", 1.0), ("right", -1.0)] {
            let organ = format!("rib_{side}_{}", index + 1);
            let points = rib_points(parameters, envelope, frame, index, course, sign);
            for (piece, ends) in points.windows(2).enumerate() {
                let name = format!("{organ}.{}", piece + 1);
                let radius_m = 0.5e-3 * parameters.rib_diameter_mm;
                parts.push(bone(capsule(name, ends[0], ends[1], radius_m), &organ));
            }
        }
    }
    parts
}

fn bone(solid: needlebench_geometry::Solid, organ: &str) -> PhantomPart {
    PhantomPart {
        name: solid.name.clone(),
        tissue: Tissue::Bone,
        organ: Some(organ.to_owned()),
        solid,
        color_rgba: BONE_RGBA,
    }
}

/// Centre line of a rib from its vertebra to its front end, m.
fn rib_points(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
    index: usize,
    course: &RibCourse,
    sign: f64,
) -> Vec<Point3<f64>> {
    let head_mm = FIRST_VERTEBRA_MM - VERTEBRA_PITCH_MM * index as f64;
    let outwards_m = 1e-3 * (0.5 * parameters.rib_diameter_mm + RIB_FROM_PLEURA_MM);
    let sternum_edge_m = 1e-3 * (0.5 * parameters.sternum_width_mm + 2.0);
    let front_m = frame.height_m(course.front_mm);
    let front_rad = course.front_deg.map_or_else(
        || {
            let section = envelope.cage_section(front_m).grown_by(outwards_m);
            section.front_angle_rad(sternum_edge_m)
        },
        f64::to_radians,
    );
    let lowest_rad = course.lowest_deg.to_radians();

    let head_z_m = frame.height_m(head_mm);
    let spine_y_m = spine_axis_y_m(envelope, frame, head_z_m);
    let vertebra_radius_m = 0.5e-3 * parameters.vertebra_diameter_mm;
    let mut points = vec![Point3::new(
        sign * 0.85 * vertebra_radius_m,
        spine_y_m + 0.6 * vertebra_radius_m,
        head_z_m,
    )];
    points.extend((0..=PIECES_PER_RIB).map(|k| {
        let angle_rad =
            NECK_ANGLE_RAD + (front_rad - NECK_ANGLE_RAD) * k as f64 / PIECES_PER_RIB as f64;
        // Half a cosine wave is the height along a planar ring that is tilted.
        let wave = |way: f64| 0.5 * (1.0 - (PI * way).cos());
        let height_mm = if angle_rad <= lowest_rad {
            head_mm + (course.lowest_mm - head_mm) * wave(angle_rad / lowest_rad)
        } else {
            let way = (angle_rad - lowest_rad) / (front_rad - lowest_rad);
            course.lowest_mm + (course.front_mm - course.lowest_mm) * wave(way)
        };
        let z_m = frame.height_m(height_mm);
        let on_cage = envelope
            .cage_section(z_m)
            .grown_by(outwards_m)
            .at_angle(angle_rad);
        Point3::new(sign * on_cage.x, on_cage.y, z_m)
    }));
    points
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
            let lean_rad = (-along.y).atan2(along.z);
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
fn spine_axis_y_m(envelope: &Envelope, frame: &Frame, z_m: f64) -> f64 {
    envelope.cage_section(z_m).back_m() - frame.size_m(SPINE_FROM_CAGE_MM)
}
