//! Lungs, heart, liver and great vessels.

use std::f64::consts::PI;

use nalgebra::{Point2, Point3, UnitQuaternion};
use needlebench_geometry::Solid;

use super::envelope::{Envelope, Frame};
use super::loft::{Level, ellipsoid, loft};
use super::solids::{capsule, convex, pose, z_towards};
use super::{PhantomPart, Tissue};

const LUNG_RGBA: [f32; 4] = [0.86, 0.60, 0.62, 0.55];
const HEART_RGBA: [f32; 4] = [0.72, 0.18, 0.20, 1.0];
const LIVER_RGBA: [f32; 4] = [0.50, 0.24, 0.18, 1.0];
const ARTERY_RGBA: [f32; 4] = [0.80, 0.10, 0.12, 1.0];
const VEIN_RGBA: [f32; 4] = [0.20, 0.28, 0.68, 1.0];

/// One lung in the layout table.
///
/// Its cross-sections are the cage's, cut off by a straight medial line that leaves the mediastinum
/// free, and shrunk towards `axis_mm` as the lung closes at apex and base.
struct Lung {
    side: &'static str,
    sign: f64,
    /// Distance of the medial line from the mid-sagittal plane where it meets the cage's front
    /// and back, mm.
    medial_front_mm: f64,
    medial_back_mm: f64,
    /// The point about which sections shrink: distance from the mid-sagittal plane, and y, mm.
    axis_mm: [f64; 2],
    /// By how much the axis leans towards the mid-sagittal plane, per height. A shear, which keeps
    /// the mesh convex.
    lean: f64,
    base_mm: f64,
}

const LUNGS: [Lung; 2] = [
    Lung {
        side: "left",
        sign: 1.0,
        medial_front_mm: 78.0,
        medial_back_mm: 30.0,
        axis_mm: [60.0, 4.0],
        lean: 0.10,
        base_mm: -74.0,
    },
    Lung {
        side: "right",
        sign: -1.0,
        medial_front_mm: 55.0,
        medial_back_mm: 28.0,
        axis_mm: [54.0, 2.0],
        lean: 0.09,
        base_mm: -64.0,
    },
];
const LUNG_APEX_MM: f64 = 166.0;
/// Height of the lungs' widest section.
const LUNG_WIDEST_MM: f64 = 8.0;
/// Fullness of the lungs' upper and lower part: exponents of `r^p + h^p = 1`.
const LUNG_APEX_EXPONENT: f64 = 2.2;
const LUNG_BASE_EXPONENT: f64 = 2.4;
/// Space between the lung and the cage's surface, mm.
const LUNG_FROM_CAGE_MM: f64 = 1.0;
const LUNG_ARC_VERTICES: usize = 17;
const LUNG_UPPER_BANDS: usize = 9;
const LUNG_LOWER_BANDS: usize = 5;

/// Lungs, heart, liver and vessels, in a fixed order.
pub(super) fn organs(envelope: &Envelope, frame: &Frame) -> Vec<PhantomPart> {
    let mut parts: Vec<PhantomPart> = LUNGS
        .iter()
        .map(|lung| organ(lung_solid(lung, envelope, frame), LUNG_RGBA))
        .collect();
    parts.push(organ(heart(frame), HEART_RGBA));
    parts.push(organ(liver(frame), LIVER_RGBA));
    parts.extend(vessels(frame));
    parts.extend(internal_mammary_arteries(envelope, frame));
    parts
}

fn organ(solid: Solid, color_rgba: [f32; 4]) -> PhantomPart {
    PhantomPart {
        name: solid.name.clone(),
        tissue: Tissue::Organ,
        organ: Some(solid.name.clone()),
        solid,
        color_rgba,
    }
}

fn lung_solid(lung: &Lung, envelope: &Envelope, frame: &Frame) -> Solid {
    let z_m = frame.height_m(LUNG_WIDEST_MM);
    let cage = envelope
        .cage_section(z_m)
        .grown_by(-1e-3 * LUNG_FROM_CAGE_MM);
    let axis = frame.point([lung.axis_mm[0], lung.axis_mm[1], LUNG_WIDEST_MM]);
    let medial_x_m = |mm| frame.point([mm, 0.0, 0.0]).x;
    let front_rad = cage.front_angle_rad(medial_x_m(lung.medial_front_mm));
    let back_rad = PI - cage.front_angle_rad(medial_x_m(lung.medial_back_mm));

    // On the left, angles that grow from the back over the side to the front run clockwise seen
    // from above (x left, y back); mirroring to the right reverses that.
    let mut polygon: Vec<Point2<f64>> = (0..LUNG_ARC_VERTICES)
        .map(|k| {
            let way = k as f64 / (LUNG_ARC_VERTICES - 1) as f64;
            let point = cage.at_angle(back_rad + way * (front_rad - back_rad));
            Point2::new(lung.sign * (point.x - axis.x), point.y - axis.y)
        })
        .collect();
    if lung.sign > 0.0 {
        polygon.reverse();
    }

    let band = |end_mm: f64, exponent: f64, way: f64| Level {
        // Evenly spread over the superelliptic arc rather than over the height.
        z_m: frame
            .height_m((end_mm - LUNG_WIDEST_MM) * (0.5 * PI * way).sin().powf(2.0 / exponent)),
        scale: if way >= 1.0 {
            0.0
        } else {
            (0.5 * PI * way).cos().powf(2.0 / exponent)
        },
    };
    let mut levels: Vec<Level> = (1..=LUNG_LOWER_BANDS)
        .rev()
        .map(|k| {
            band(
                lung.base_mm,
                LUNG_BASE_EXPONENT,
                k as f64 / LUNG_LOWER_BANDS as f64,
            )
        })
        .collect();
    levels.extend((0..=LUNG_UPPER_BANDS).map(|k| {
        band(
            LUNG_APEX_MM,
            LUNG_APEX_EXPONENT,
            k as f64 / LUNG_UPPER_BANDS as f64,
        )
    }));
    let mut mesh = loft(&polygon, &levels);
    for vertex in &mut mesh.0.vertices_m {
        vertex.x -= lung.sign * lung.lean * vertex.z;
    }
    let origin = Point3::new(lung.sign * axis.x, axis.y, z_m);
    convex(
        format!("lung_{}", lung.side),
        mesh,
        pose(origin, UnitQuaternion::identity()),
    )
}

/// An ellipsoid whose long axis points to the left, forwards and down.
fn heart(frame: &Frame) -> Solid {
    const CENTER_MM: [f64; 3] = [12.0, -34.0, 16.0];
    const SEMI_AXES_MM: [f64; 3] = [42.0, 43.0, 60.0];
    const LONG_AXIS: [f64; 3] = [0.72, -0.42, -0.55];

    let semi_axes_m = SEMI_AXES_MM.map(|mm| frame.size_m(mm));
    convex(
        "heart".to_owned(),
        ellipsoid(semi_axes_m.into()),
        pose(frame.point(CENTER_MM), z_towards(&LONG_AXIS.into())),
    )
}

/// An ellipsoid under the right lung.
fn liver(frame: &Frame) -> Solid {
    const CENTER_MM: [f64; 3] = [-40.0, -18.0, -126.0];
    const SEMI_AXES_MM: [f64; 3] = [62.0, 55.0, 57.0];

    let semi_axes_m = SEMI_AXES_MM.map(|mm| frame.size_m(mm));
    convex(
        "liver".to_owned(),
        ellipsoid(semi_axes_m.into()),
        pose(frame.point(CENTER_MM), UnitQuaternion::identity()),
    )
}

/// Great vessels: centre lines in the layout table, mm.
fn vessels(frame: &Frame) -> Vec<PhantomPart> {
    /// Name, diameter (mm), colour, centre line.
    type Course = (&'static str, f64, [f32; 4], &'static [[f64; 3]]);
    const COURSES: [Course; 6] = [
        (
            "aorta",
            26.0,
            ARTERY_RGBA,
            &[
                [2.0, -30.0, 42.0],
                [-14.0, -32.0, 72.0],
                [-8.0, -22.0, 98.0],
                [8.0, 4.0, 108.0],
                [18.0, 30.0, 92.0],
                [20.0, 38.0, 40.0],
                [18.0, 40.0, -80.0],
                [8.0, 40.0, -176.0],
            ],
        ),
        (
            "pulmonary_trunk",
            26.0,
            VEIN_RGBA,
            &[[20.0, -46.0, 46.0], [18.0, -24.0, 76.0]],
        ),
        (
            "pulmonary_artery_left",
            18.0,
            VEIN_RGBA,
            &[[20.0, -20.0, 76.0], [44.0, 6.0, 72.0]],
        ),
        (
            "pulmonary_artery_right",
            18.0,
            VEIN_RGBA,
            &[[14.0, -14.0, 76.0], [-34.0, -2.0, 66.0]],
        ),
        (
            "vena_cava_superior",
            19.0,
            VEIN_RGBA,
            &[[-26.0, -24.0, 122.0], [-28.0, -22.0, 44.0]],
        ),
        (
            "vena_cava_inferior",
            22.0,
            VEIN_RGBA,
            &[
                [-22.0, -8.0, -8.0],
                [-20.0, 16.0, -70.0],
                [-20.0, 28.0, -176.0],
            ],
        ),
    ];

    let mut parts = Vec::new();
    for (organ, diameter_mm, color_rgba, line) in COURSES {
        let points: Vec<Point3<f64>> = line.iter().map(|&point| frame.point(point)).collect();
        let radius_m = frame.size_m(0.5 * diameter_mm);
        parts.extend(tube(organ, &points, radius_m, color_rgba));
    }
    parts
}

/// The arteries behind the costal cartilages on both sides of the sternum.
fn internal_mammary_arteries(envelope: &Envelope, frame: &Frame) -> Vec<PhantomPart> {
    /// Distance from the mid-sagittal plane, diameter, depth behind the cage's front, and heights
    /// of the centre line in the layout table, mm (assumed).
    const LATERAL_MM: f64 = 33.0;
    const DIAMETER_MM: f64 = 2.5;
    const BEHIND_CAGE_MM: f64 = 1.5;
    const HEIGHTS_MM: [f64; 4] = [130.0, 80.0, 40.0, -4.0];

    let mut parts = Vec::new();
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let points: Vec<Point3<f64>> = HEIGHTS_MM
            .iter()
            .map(|&height_mm| {
                let at = frame.point([LATERAL_MM, 0.0, height_mm]);
                let front_m = envelope.cage_section(at.z).front_at_m(at.x);
                Point3::new(sign * at.x, front_m + 1e-3 * BEHIND_CAGE_MM, at.z)
            })
            .collect();
        let name = format!("mammary_artery_{side}");
        parts.extend(tube(&name, &points, 0.5e-3 * DIAMETER_MM, ARTERY_RGBA));
    }
    parts
}

/// A chain of capsules, named `organ.1`, `organ.2`, ...
fn tube(
    organ: &str,
    points: &[Point3<f64>],
    radius_m: f64,
    color_rgba: [f32; 4],
) -> Vec<PhantomPart> {
    points
        .windows(2)
        .enumerate()
        .map(|(piece, ends): (usize, &[Point3<f64>])| {
            let name = format!("{organ}.{}", piece + 1);
            PhantomPart {
                name: name.clone(),
                tissue: Tissue::Vessel,
                organ: Some(organ.to_owned()),
                solid: capsule(name, ends[0], ends[1], radius_m),
                color_rgba,
            }
        })
        .collect()
}
