//! Shoulder blades: flat bones on the back of the cage, as they lie with the arms raised.

use nalgebra::{Point3, Vector3};
use needlebench_geometry::mesh::convex_hull;
use needlebench_kinematics::Pose;

use super::envelope::{Envelope, Frame};
use super::ribs::RIB_FROM_PLEURA_MM;
use super::skeleton::bone;
use super::solids::convex;
use super::{PhantomParameters, PhantomPart};

/// Corners in the layout table: angle from the back, deg, and height, mm: superior, inferior and lateral
/// angle. Places are assumed, turned outwards as with raised arms; 155 mm long and 100 mm broad in the
/// median man standing (Clin Orthop 2001;383:131-139: 155 mm; CBMJ 2025;14:141-145: 100 mm).
const CORNERS: [[f64; 2]; 3] = [[40.0, 158.0], [68.0, 18.0], [104.0, 134.0]];
/// Thickness (the medial border is 4 mm thick: Clin Orthop 2001) and muscle between ribs and bone
/// (assumed), mm.
const THICKNESS_MM: f64 = 4.0;
const FROM_RIBS_MM: f64 = 4.0;

/// Both, each of four flat triangles that follow the cage.
pub(super) fn scapulae(
    parameters: &PhantomParameters,
    envelope: &Envelope,
    frame: &Frame,
) -> Vec<PhantomPart> {
    let [a, b, c] = CORNERS;
    let between = |p: [f64; 2], q: [f64; 2]| [0, 1].map(|axis| 0.5 * (p[axis] + q[axis]));
    let (ab, bc, ca) = (between(a, b), between(b, c), between(c, a));
    let triangles = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]];
    let inside_m = 1e-3 * (RIB_FROM_PLEURA_MM + parameters.rib_thickness_mm + FROM_RIBS_MM);
    let faces_m = [inside_m, inside_m + 1e-3 * THICKNESS_MM];

    let mut parts = Vec::new();
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let organ = format!("scapula_{side}");
        for (corners, number) in triangles.iter().zip(1..) {
            let points: Vec<Point3<f64>> = faces_m
                .iter()
                .flat_map(|&outwards_m| {
                    corners.map(|[deg, height_mm]| {
                        let z_m = frame.height_m(height_mm);
                        let section = envelope.cage_section(z_m).grown_by(outwards_m);
                        let point = section.at_angle(deg.to_radians());
                        Point3::from(Vector3::new(sign * point.x, point.y, z_m))
                    })
                })
                .collect();
            let mesh = convex_hull(&points).expect("a triangle of some thickness has a volume");
            let name = format!("{organ}.{number}");
            parts.push(bone(convex(name, mesh, Pose::identity()), &organ));
        }
    }
    parts
}
