//! Lungs with their fissures, airways, heart, liver and great vessels.

use std::f64::consts::PI;

use nalgebra::{Point2, Point3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid};

use super::envelope::{Envelope, Frame};
use super::loft::{Level, ellipsoid, loft};
use super::ribs::intercostal_vessels;
use super::solids::{capsule, convex, facing, pose, z_towards};
use super::{PhantomParameters, PhantomPart, Tissue};

const LUNG_RGBA: [f32; 4] = [0.86, 0.60, 0.62, 0.55];
const HEART_RGBA: [f32; 4] = [0.72, 0.18, 0.20, 1.0];
const LIVER_RGBA: [f32; 4] = [0.50, 0.24, 0.18, 1.0];
const ARTERY_RGBA: [f32; 4] = [0.80, 0.10, 0.12, 1.0];
const VEIN_RGBA: [f32; 4] = [0.20, 0.28, 0.68, 1.0];
const AIRWAY_RGBA: [f32; 4] = [0.62, 0.80, 0.84, 1.0];
const FISSURE_RGBA: [f32; 4] = [0.60, 0.34, 0.40, 0.5];

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

/// Lungs, heart, liver, airways, vessels and fissures, in a fixed order.
pub(super) fn organs(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    let lungs = LUNGS.map(|lung| lung_solid(&lung, envelope, frame));
    let fissures = fissures(&lungs, frame);
    let mut parts: Vec<PhantomPart> = lungs.map(|lung| organ(lung, LUNG_RGBA)).into();
    parts.push(organ(heart(frame), HEART_RGBA));
    parts.push(organ(liver(frame), LIVER_RGBA));
    parts.extend(airways(frame));
    parts.extend(vessels(frame));
    parts.extend(internal_mammary_vessels(parameters, envelope, frame));
    parts.extend(intercostal_vessels(parameters, envelope, frame));
    parts.extend(fissures);
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
        z_m: frame.height_m(
            (end_mm - LUNG_WIDEST_MM) * libm::pow(libm::sin(0.5 * PI * way), 2.0 / exponent),
        ),
        scale: if way >= 1.0 {
            0.0
        } else {
            libm::pow(libm::cos(0.5 * PI * way), 2.0 / exponent)
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
        parts.extend(tube(Tissue::Vessel, organ, &points, radius_m, color_rgba));
    }
    parts
}

/// The arteries and veins behind the costal cartilages on both sides of the sternum.
fn internal_mammary_vessels(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    /// Name, colour, and distance from the edge of the sternum to the left and to the right, mm: means
    /// of 100 CT scans (AJR 1990;155:397-400).
    const VESSELS: [(&str, [f32; 4], [f64; 2]); 2] = [
        ("mammary_artery", ARTERY_RGBA, [14.7, 15.7]),
        ("mammary_vein", VEIN_RGBA, [9.8, 10.3]),
    ];
    /// Diameter, depth behind the cage's front, and heights of the centre line in the layout table, mm
    /// (assumed).
    const DIAMETER_MM: f64 = 2.5;
    const BEHIND_CAGE_MM: f64 = 1.5;
    const HEIGHTS_MM: [f64; 4] = [130.0, 80.0, 40.0, -4.0];

    let mut parts = Vec::new();
    for (vessel, color_rgba, from_sternum_mm) in VESSELS {
        for ((side, sign), from_edge_mm) in [("left", 1.0), ("right", -1.0)]
            .into_iter()
            .zip(from_sternum_mm)
        {
            let x_m = 1e-3 * (0.5 * parameters.sternum_width_mm + from_edge_mm);
            let points: Vec<Point3<f64>> = HEIGHTS_MM
                .iter()
                .map(|&height_mm| {
                    let z_m = frame.height_m(height_mm);
                    let front_m = envelope.cage_section(z_m).front_at_m(x_m);
                    Point3::new(sign * x_m, front_m + 1e-3 * BEHIND_CAGE_MM, z_m)
                })
                .collect();
            let name = format!("{vessel}_{side}");
            let radius_m = 0.5e-3 * DIAMETER_MM;
            parts.extend(tube(Tissue::Vessel, &name, &points, radius_m, color_rgba));
        }
    }
    parts
}

/// Trachea and main bronchi: centre lines in the layout table, mm (assumed).
fn airways(frame: &Frame) -> Vec<PhantomPart> {
    const CARINA_MM: [f64; 3] = [-11.0, 20.0, 88.0];
    /// Name, outer diameter (mm: men's coronal lumen of 18, Pol J Radiol 2011;76:28-31, with 1 mm of wall;
    /// the bronchi's assumed), centre line.
    const COURSES: [(&str, f64, &[[f64; 3]]); 3] = [
        (
            "trachea",
            20.0,
            &[[-5.0, -8.0, 156.0], [-13.0, 15.0, 116.0], CARINA_MM],
        ),
        (
            "main_bronchus_left",
            13.0,
            &[CARINA_MM, [14.0, 10.0, 66.0], [42.0, 8.0, 54.0]],
        ),
        (
            "main_bronchus_right",
            15.0,
            &[CARINA_MM, [-36.0, 18.0, 72.0]],
        ),
    ];
    let mut parts = Vec::new();
    for (name, diameter_mm, line) in COURSES {
        let points: Vec<Point3<f64>> = line.iter().map(|&point| frame.point(point)).collect();
        let radius_m = frame.size_m(0.5 * diameter_mm);
        parts.extend(tube(Tissue::Organ, name, &points, radius_m, AIRWAY_RGBA));
    }
    parts
}

/// Clefts between the lobes: flat plates through a lung, which a needle may cross but should not.
///
/// Both oblique fissures descend from behind at the third thoracic vertebra to the sixth rib in front;
/// the right lung's horizontal one runs forwards from it at the fourth costal cartilage (assumed, so that no
/// shipped lesion lies across one).
fn fissures(lungs: &[Solid; 2], frame: &Frame) -> Vec<PhantomPart> {
    /// Drawn thickness, mm.
    const THICKNESS_MM: f64 = 1.0;
    /// Points behind and in front that an oblique fissure passes, y and z in the layout table, mm.
    const OBLIQUE_MM: [[[f64; 2]; 2]; 2] = [
        [[88.0, 146.0], [-80.0, -4.0]],
        [[88.0, 140.0], [-80.0, -12.0]],
    ];
    const HORIZONTAL_MM: f64 = 46.0;

    let [left, right] = OBLIQUE_MM.map(|ends_mm| {
        let [behind, front] = ends_mm.map(|[y, z]| frame.point([0.0, y, z]));
        let along = behind - front;
        Plane {
            point: front,
            // Up and forwards.
            normal: UnitVector3::new_normalize(Vector3::new(0.0, -along.z, along.y)),
        }
    });
    let horizontal = Plane {
        point: frame.point([0.0, 0.0, HORIZONTAL_MM]),
        normal: Vector3::z_axis(),
    };
    let [lung_left, lung_right] = lungs;
    let in_front = clipped(&section(lung_right, &horizontal), &right);
    let cuts = [
        ("fissure_oblique_left", section(lung_left, &left), &left),
        ("fissure_oblique_right", section(lung_right, &right), &right),
        ("fissure_horizontal_right", in_front, &horizontal),
    ];
    cuts.into_iter()
        .map(|(name, outline, plane)| PhantomPart {
            tissue: Tissue::Fissure,
            ..organ(
                plate(name, &outline, plane, 1e-3 * THICKNESS_MM),
                FISSURE_RGBA,
            )
        })
        .collect()
}

/// Points `p` with `normal . (p - point) = 0`.
struct Plane {
    point: Point3<f64>,
    normal: UnitVector3<f64>,
}

impl Plane {
    fn height_m(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&(point - self.point))
    }

    /// Where it is crossed between two points on either side of it.
    fn crossing(&self, a: &Point3<f64>, b: &Point3<f64>) -> Option<Point3<f64>> {
        let [from_m, to_m] = [a, b].map(|point| self.height_m(point));
        let crosses = (from_m < 0.0) != (to_m < 0.0);
        crosses.then(|| a + (b - a) * (from_m / (from_m - to_m)))
    }
}

/// The outline in which a plane cuts a convex mesh, in order about the plane's normal.
fn section(solid: &Solid, plane: &Plane) -> Vec<Point3<f64>> {
    let Shape::Convex(mesh) = &solid.shape else {
        return Vec::new();
    };
    let ConvexMesh(mesh) = mesh.as_ref();
    let at = |i: u32| solid.parent_from_shape * mesh.vertices_m[i as usize];
    let edges = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        // Every edge belongs to two triangles, once in each direction.
        .filter(|[a, b]| a < b);
    let mut outline: Vec<Point3<f64>> = edges
        .filter_map(|[a, b]| plane.crossing(&at(a), &at(b)))
        .collect();
    let middle = centroid(&outline);
    let rotation = facing(&plane.normal);
    let bearing = |point: &Point3<f64>| {
        let seen = rotation.inverse() * (point - middle);
        libm::atan2(seen.y, seen.x)
    };
    outline.sort_by(|a, b| bearing(a).total_cmp(&bearing(b)));
    outline
}

/// What of an outline is above a plane.
fn clipped(outline: &[Point3<f64>], plane: &Plane) -> Vec<Point3<f64>> {
    let mut kept = Vec::with_capacity(outline.len() + 2);
    for (k, point) in outline.iter().enumerate() {
        if plane.height_m(point) >= 0.0 {
            kept.push(*point);
        }
        kept.extend(plane.crossing(point, &outline[(k + 1) % outline.len()]));
    }
    kept
}

/// A flat solid with a convex outline in a plane.
fn plate(name: &str, outline: &[Point3<f64>], plane: &Plane, thickness_m: f64) -> Solid {
    /// Corners that stand out by less are in the line of their neighbours, m.
    const STRAIGHT_M: f64 = 5e-5;
    let rotation = facing(&plane.normal);
    let middle = centroid(outline);
    let mut polygon: Vec<Point2<f64>> = outline
        .iter()
        .map(|point| Point2::from((rotation.inverse() * (point - middle)).xy()))
        .collect();
    let stands_out_m = |polygon: &[Point2<f64>], k: usize| {
        let count = polygon.len();
        let (before, after) = (polygon[(k + count - 1) % count], polygon[(k + 1) % count]);
        let across = (after - before).perp(&(polygon[k] - before));
        -across / (after - before).norm().max(f64::MIN_POSITIVE)
    };
    while let Some(k) = (0..polygon.len()).find(|&k| stands_out_m(&polygon, k) < STRAIGHT_M) {
        polygon.remove(k);
    }
    let levels = [-0.5, 0.5].map(|side| Level {
        z_m: side * thickness_m,
        scale: 1.0,
    });
    convex(
        name.to_owned(),
        loft(&polygon, &levels),
        pose(middle, rotation),
    )
}

fn centroid(points: &[Point3<f64>]) -> Point3<f64> {
    let sum: Vector3<f64> = points.iter().map(|point| point.coords).sum();
    Point3::from(sum / points.len().max(1) as f64)
}

/// A chain of capsules, named `organ.1`, `organ.2`, ...
fn tube(
    tissue: Tissue,
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
                tissue,
                organ: Some(organ.to_owned()),
                solid: capsule(name, ends[0], ends[1], radius_m),
                color_rgba,
            }
        })
        .collect()
}
