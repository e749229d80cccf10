//! The cell as markers.

use needlebench_cell::{BodyKind, Frame};
use needlebench_geometry::Shape;
use needlebench_kinematics::LINK_NAMES;
use needlebench_ros::message::{Colour, Marker, MarkerArray, MarkerShape};

use super::frames::{between, header, pose};
use crate::motion::Motion;

/// How far surfaces that are made of triangles may be inside the true ones, m.
const CHORD_M: f64 = 1e-3;

/// Diameter of the balls at entry and target, m.
const POINT_M: f64 = 0.006;

/// Every solid of arm, tool and surroundings, in the frame that it moves with, and the planned needle.
pub(super) fn cell(motion: &Motion<'_>) -> MarkerArray {
    let mut all = Vec::new();
    for body in &motion.resolved.cell.bodies {
        let Some(colour) = colour(body.kind) else {
            continue;
        };
        let frame = match body.frame {
            Frame::World => "world",
            Frame::Link(index) => LINK_NAMES[index],
        };
        for (id, solid) in (0..).zip(&body.solids) {
            all.push(Marker {
                header: header(frame, 0),
                ns: body.name.clone(),
                id,
                pose: pose(&solid.parent_from_shape),
                shape: shape(&solid.shape),
                colour,
            });
        }
    }
    all.extend(needle(motion));
    MarkerArray(all)
}

/// Colour of a kind of body; none for the access zone, which is not a body and not shown.
fn colour(kind: BodyKind) -> Option<Colour> {
    Some(Colour(match kind {
        BodyKind::Base | BodyKind::Link => [0.62, 0.66, 0.72, 1.0],
        BodyKind::Tool => [0.30, 0.55, 0.80, 1.0],
        BodyKind::GuideTube => [0.95, 0.75, 0.20, 1.0],
        BodyKind::Phantom => [0.88, 0.70, 0.60, 0.45],
        BodyKind::Table => [0.55, 0.60, 0.65, 1.0],
        BodyKind::Gantry => [0.85, 0.86, 0.88, 0.35],
        BodyKind::Mount => [0.45, 0.47, 0.50, 1.0],
        BodyKind::Obstacle => [0.75, 0.45, 0.30, 0.8],
        BodyKind::Person => [0.35, 0.45, 0.65, 0.35],
        BodyKind::NeedleCorridor => return None,
    }))
}

fn shape(of: &Shape) -> MarkerShape {
    match of {
        Shape::Sphere { radius_m } => MarkerShape::Sphere([2.0 * radius_m; 3]),
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => MarkerShape::Cylinder([2.0 * radius_m, 2.0 * radius_m, 2.0 * half_length_m]),
        Shape::Cuboid { half_extents_m } => MarkerShape::Cube((half_extents_m * 2.0).into()),
        Shape::Capsule { .. } | Shape::Convex(_) | Shape::Mesh(_) => {
            let surface = of.surface(CHORD_M);
            let corners = surface.triangles.iter().flatten();
            let places = corners.map(|&corner| surface.vertices_m[corner as usize].coords.into());
            MarkerShape::Triangles(places.collect())
        }
    }
}

/// The planned needle from entry to target, or from the guide where there is no patient.
fn needle(motion: &Motion<'_>) -> Vec<Marker> {
    let goal = motion.goal;
    let target = goal.target_m.coords;
    let from = goal.entry_m.map_or_else(
        || goal.world_from_guide_exit.translation.vector,
        |entry| entry.coords,
    );
    let marker = |id, pose, shape, colour| Marker {
        header: header("world", 0),
        ns: "planned_needle".to_owned(),
        id,
        pose,
        shape,
        colour: Colour(colour),
    };
    let ball = |id, at: nalgebra::Vector3<f64>, colour| {
        let place = pose(&needlebench_kinematics::Pose::from_parts(
            at.into(),
            nalgebra::UnitQuaternion::identity(),
        ));
        marker(id, place, MarkerShape::Sphere([POINT_M; 3]), colour)
    };
    let diameter_m = motion.resolved.cell.tool.needle.outer_diameter_m;
    let line = between(&from, &target).map(|(at, length_m)| {
        let shape = MarkerShape::Cylinder([diameter_m, diameter_m, length_m]);
        marker(0, pose(&at), shape, [0.85, 0.10, 0.10, 1.0])
    });
    let mut all: Vec<Marker> = line.into_iter().collect();
    if goal.entry_m.is_some() {
        all.push(ball(1, from, [0.10, 0.60, 0.20, 1.0]));
    }
    all.push(ball(2, target, [0.85, 0.10, 0.10, 1.0]));
    all
}
