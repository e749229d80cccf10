//! Ribs, their cartilages, and the vessels that run along them.
//!
//! A rib is a chain of elliptic capsules on the cage, each with its broad side along the chest wall.

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

use super::envelope::{Envelope, Frame};
use super::skeleton::{FIRST_VERTEBRA_MM, VERTEBRA_PITCH_MM, bone, spine_axis_y_m};
use super::solids::{capsule, elliptic_capsule};
use super::{PhantomParameters, PhantomPart, Tissue};

const CARTILAGE_RGBA: [f32; 4] = [0.78, 0.84, 0.86, 1.0];
const INTERCOSTAL_RGBA: [f32; 4] = [0.62, 0.14, 0.36, 1.0];

/// Course of one rib in the layout table: heights in mm, angles from the back in degrees.
///
/// The rib descends from its vertebra to its lowest point, then rises to its front end. Ribs 1 to 7
/// reach the sternum, and the front end's angle is `None`.
struct RibCourse {
    lowest_mm: f64,
    lowest_deg: f64,
    front_mm: f64,
    front_deg: Option<f64>,
    /// Where bone ends and cartilage begins.
    cartilage_from_deg: f64,
}

const fn true_rib(
    lowest_mm: f64,
    lowest_deg: f64,
    front_mm: f64,
    cartilage_from_deg: f64,
) -> RibCourse {
    RibCourse {
        lowest_mm,
        lowest_deg,
        front_mm,
        front_deg: None,
        cartilage_from_deg,
    }
}

/// One of which the bone ends in front at its own angle.
const fn false_rib(lowest_mm: f64, lowest_deg: f64, front_mm: f64, front_deg: f64) -> RibCourse {
    RibCourse {
        lowest_mm,
        lowest_deg,
        front_mm,
        front_deg: Some(front_deg),
        cartilage_from_deg: front_deg,
    }
}

/// The twelve pairs, top down (assumed, drawn after atlas proportions).
const RIBS: [RibCourse; 12] = [
    true_rib(135.0, 180.0, 135.0, 150.0),
    true_rib(96.0, 180.0, 96.0, 155.0),
    true_rib(69.0, 180.0, 69.0, 155.0),
    true_rib(42.0, 180.0, 42.0, 153.0),
    true_rib(10.0, 158.0, 19.0, 150.0),
    true_rib(-27.0, 146.0, 3.0, 146.0),
    true_rib(-62.0, 140.0, -9.0, 140.0),
    false_rib(-98.0, 134.0, -80.0, 150.0),
    false_rib(-135.0, 120.0, -119.0, 138.0),
    false_rib(-167.0, 112.0, -158.0, 124.0),
    false_rib(-168.0, 76.0, -168.0, 76.0),
    false_rib(-157.0, 42.0, -157.0, 42.0),
];
/// Pieces of a rib beyond its neck, which leads from the vertebra back to the cage.
const PIECES_PER_RIB: usize = 10;
/// Angle from the back at which the neck reaches the cage's surface (beside the transverse
/// process, so that the lung has the gutter next to the spine), rad.
const NECK_ANGLE_RAD: f64 = 0.12;
/// Space between the pleura and the inside of a rib. A straight piece's middle comes nearer to the
/// pleura than its ends, by up to 2 mm.
pub(super) const RIB_FROM_PLEURA_MM: f64 = 3.5;

/// Point of a rib's centre line.
#[derive(Debug, Clone, Copy)]
struct CoursePoint {
    at: Point3<f64>,
    /// Along the rib's height: up the cage's surface.
    up: Vector3<f64>,
    /// From the back, rad.
    angle_rad: f64,
}

/// Lays ribs on the cage of one phantom.
struct Cage<'a> {
    parameters: &'a PhantomParameters,
    envelope: &'a Envelope,
    frame: &'a Frame,
}

impl Cage<'_> {
    /// Distance of a rib's centre line outside the pleura, m.
    fn outwards_m(&self) -> f64 {
        1e-3 * (0.5 * self.parameters.rib_thickness_mm + RIB_FROM_PLEURA_MM)
    }

    /// A point of the surface of the ribs' centre lines, to the left (`sign` 1) or the right (-1).
    fn point(&self, angle_rad: f64, height_mm: f64, sign: f64) -> CoursePoint {
        /// Half of the height over which the surface's direction is taken, m.
        const STEP_M: f64 = 1e-3;
        let z_m = self.frame.height_m(height_mm);
        let on_cage = |z_m: f64| {
            let section = self.envelope.cage_section(z_m).grown_by(self.outwards_m());
            let point = section.at_angle(angle_rad);
            Point3::new(sign * point.x, point.y, z_m)
        };
        CoursePoint {
            at: on_cage(z_m),
            up: (on_cage(z_m + STEP_M) - on_cage(z_m - STEP_M)).normalize(),
            angle_rad,
        }
    }

    /// Centre line of a rib from its vertebra to its front end.
    fn course(&self, index: usize, sign: f64) -> Vec<CoursePoint> {
        let rib = &RIBS[index];
        let head_mm = FIRST_VERTEBRA_MM - VERTEBRA_PITCH_MM * index as f64;
        let front_rad = rib.front_deg.map_or_else(
            || {
                let sternum_edge_m = 1e-3 * (0.5 * self.parameters.sternum_width_mm + 2.0);
                let front_m = self.frame.height_m(rib.front_mm);
                let section = self.envelope.cage_section(front_m);
                section
                    .grown_by(self.outwards_m())
                    .front_angle_rad(sternum_edge_m)
            },
            f64::to_radians,
        );
        let lowest_rad = rib.lowest_deg.to_radians();

        let head_z_m = self.frame.height_m(head_mm);
        let vertebra_radius_m = 0.5e-3 * self.parameters.vertebra_diameter_mm;
        let spine_y_m = spine_axis_y_m(self.envelope, self.frame, head_z_m);
        let mut points = vec![CoursePoint {
            at: Point3::new(
                sign * 0.85 * vertebra_radius_m,
                spine_y_m + 0.6 * vertebra_radius_m,
                head_z_m,
            ),
            up: Vector3::z(),
            angle_rad: 0.0,
        }];
        points.extend((0..=PIECES_PER_RIB).map(|k| {
            let angle_rad =
                NECK_ANGLE_RAD + (front_rad - NECK_ANGLE_RAD) * k as f64 / PIECES_PER_RIB as f64;
            // Half a cosine wave is the height along a planar ring that is tilted.
            let wave = |way: f64| 0.5 * (1.0 - libm::cos(PI * way));
            let height_mm = if angle_rad <= lowest_rad {
                head_mm + (rib.lowest_mm - head_mm) * wave(angle_rad / lowest_rad)
            } else {
                let way = (angle_rad - lowest_rad) / (front_rad - lowest_rad);
                rib.lowest_mm + (rib.front_mm - rib.lowest_mm) * wave(way)
            };
            self.point(angle_rad, height_mm, sign)
        }));
        across_course(&mut points);
        points
    }

    /// One straight piece of a rib or a cartilage.
    fn piece(&self, organ: &str, number: usize, ends: &[CoursePoint]) -> PhantomPart {
        let half_axes_m = [
            0.5e-3 * self.parameters.rib_thickness_mm,
            0.5e-3 * self.parameters.rib_height_mm,
        ];
        let up = ends[0].up + ends[1].up;
        let name = format!("{organ}.{number}");
        let solid = elliptic_capsule(name, ends[0].at, ends[1].at, half_axes_m, &up);
        bone(solid, organ)
    }

    /// A chain of costal cartilage.
    fn cartilage(&self, organ: &str, points: &[CoursePoint]) -> Vec<PhantomPart> {
        let pieces = points.windows(2).zip(1..);
        let pieces = pieces.map(|(ends, number)| PhantomPart {
            color_rgba: CARTILAGE_RGBA,
            ..self.piece(organ, number, ends)
        });
        pieces.collect()
    }
}

/// Turns the heights of a course's points to a right angle with the course.
fn across_course(points: &mut [CoursePoint]) {
    let places: Vec<Point3<f64>> = points.iter().map(|point| point.at).collect();
    for (k, point) in points.iter_mut().enumerate() {
        let along = places[(k + 1).min(places.len() - 1)] - places[k.saturating_sub(1)];
        let along = along.normalize();
        point.up = (point.up - along * point.up.dot(&along)).normalize();
    }
}

const SIDES: [(&str, f64); 2] = [("left", 1.0), ("right", -1.0)];

/// The point of a course at which a rib's bone ends.
fn bone_end(course: &[CoursePoint], rib: &RibCourse) -> usize {
    // A piece is of what its middle is of.
    let is_cartilage = |ends: &[CoursePoint]| {
        0.5 * (ends[0].angle_rad + ends[1].angle_rad) > rib.cartilage_from_deg.to_radians()
    };
    let bone_pieces = course.windows(2).take_while(|ends| !is_cartilage(ends));
    bone_pieces.count()
}

/// The ribs with their cartilages.
pub(super) fn ribs(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    let mut parts = sternal_and_free_ribs(parameters, envelope, frame);
    parts.extend(costal_margin(parameters, envelope, frame));
    parts
}

/// The ribs, those that reach the sternum with their cartilages.
fn sternal_and_free_ribs(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    let cage = Cage {
        parameters,
        envelope,
        frame,
    };
    let mut parts = Vec::new();
    for (index, rib) in RIBS.iter().enumerate() {
        for (side, sign) in SIDES {
            let course = cage.course(index, sign);
            let end = bone_end(&course, rib);
            let number = index + 1;
            let organ = format!("rib_{side}_{number}");
            let pieces = course[..=end].windows(2).zip(1..);
            parts.extend(pieces.map(|(ends, piece)| cage.piece(&organ, piece, ends)));
            let organ = format!("cartilage_{side}_{number}");
            parts.extend(cage.cartilage(&organ, &course[end..]));
        }
    }
    parts
}

/// The cartilages of ribs 8 to 10: each from the end of its rib to the end of the one above, the
/// first to the cartilage of rib 7.
fn costal_margin(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    /// Where the cartilage of rib 8 meets that of rib 7: angle, deg, and height, mm (assumed).
    const ON_SEVENTH: [f64; 2] = [162.0, -27.0];
    /// Straight pieces from one rib to the next.
    const PIECES: usize = 3;

    let cage = Cage {
        parameters,
        envelope,
        frame,
    };
    let mut parts = Vec::new();
    for (side, sign) in SIDES {
        let mut above = ON_SEVENTH;
        for (rib, number) in RIBS[7..10].iter().zip(8..) {
            let end = [rib.cartilage_from_deg, rib.front_mm];
            let points: Vec<CoursePoint> = (0..=PIECES)
                .map(|k| {
                    let way = k as f64 / PIECES as f64;
                    let [deg, height_mm] =
                        [0, 1].map(|axis| end[axis] + (above[axis] - end[axis]) * way);
                    cage.point(deg.to_radians(), height_mm, sign)
                })
                .collect();
            let organ = format!("cartilage_{side}_{number}");
            parts.extend(cage.cartilage(&organ, &points));
            above = end;
        }
    }
    parts
}

/// Vein and artery under each rib's lower edge, as one tube, along the rib's bone.
pub(super) fn intercostal_vessels(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    /// Diameter of vein and artery together (assumed), mm.
    const DIAMETER_MM: f64 = 4.0;

    let cage = Cage {
        parameters,
        envelope,
        frame,
    };
    let radius_m = 0.5e-3 * DIAMETER_MM;
    let mut parts = Vec::new();
    for (index, rib) in RIBS.iter().enumerate() {
        for (side, sign) in SIDES {
            let course = cage.course(index, sign);
            let end = bone_end(&course, rib);
            let organ = format!("intercostal_vessels_{side}_{}", index + 1);
            let points: Vec<Point3<f64>> = course[1..=end]
                .iter()
                .map(|point| {
                    let below_mm = 0.5 * parameters.rib_height_mm + under_rib_mm(point.angle_rad);
                    point.at - 1e-3 * below_mm * point.up
                })
                .collect();
            for (ends, number) in points.windows(2).zip(1..) {
                let name = format!("{organ}.{number}");
                parts.push(PhantomPart {
                    name: name.clone(),
                    tissue: Tissue::Vessel,
                    organ: Some(organ.clone()),
                    solid: capsule(name, ends[0], ends[1], radius_m),
                    color_rgba: INTERCOSTAL_RGBA,
                });
            }
        }
    }
    parts
}

/// Distance of the vessels' middle from the rib's lower edge, mm, by the angle from the back.
///
/// Beside the spine, at the rib's angle and 25 mm lateral of it: CT angiography (Diagn Interv Radiol
/// 2012;18:221-224). Further lateral they run in the groove.
fn under_rib_mm(angle_rad: f64) -> f64 {
    /// Angle from the back, deg (assumed), and distance, mm.
    const MEASURED: [[f64; 2]; 4] = [[10.0, 7.2], [30.0, 5.5], [45.0, 2.3], [70.0, 0.0]];
    let deg = angle_rad.to_degrees();
    let mut under_mm = MEASURED[0][1];
    for pair in MEASURED.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let way = ((deg - from[0]) / (to[0] - from[0])).clamp(0.0, 1.0);
        under_mm += way * (to[1] - from[1]);
    }
    under_mm
}
