//! The bodies of people, for clearances and pictures.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid, TriangleMesh};
use needlebench_kinematics::Pose;

use super::{BODY_RADIUS_M, People, Person};
use crate::fixtures::{Fixture, FixtureKind};
use crate::resolve::goals::Goal;

/// Half of the width of a body at its shoulders with clothes, m. Assumed: the 95th percentile of British men is 0.51 m
/// across the deltoids, of women 0.44 (Pheasant, Bodyspace, 1996).
const HALF_WIDTH_M: f64 = 0.25;

/// Height of soles, m: statures are without shoes.
const SHOES_M: f64 = 0.03;

/// Corners of each half of the outline, which lie outside it by `1 / cos(pi / 16)`, 2 %: a clearance from the body is
/// never optimistic.
const HALF_CORNERS: usize = 9;

/// Places that differ by less are one, m.
const SAME_PLACE_M: f64 = 1e-6;

impl People {
    /// A body for everybody by name, with a solid for each of the places that the person has over all goals.
    pub(crate) fn bodies(&self, goals: &[Goal]) -> Vec<(String, Vec<Solid>)> {
        let mut places: BTreeMap<usize, (String, Vec<(Pose, f64)>)> = BTreeMap::new();
        for (people, goal) in self.by_goal.iter().zip(goals) {
            for (index, person) in people.iter().enumerate() {
                let pose = person.facing(&goal.standing_place());
                let (_, known) = places
                    .entry(index)
                    .or_insert_with(|| (person.name.clone(), Vec::new()));
                let same = |(other, _): &(Pose, f64)| {
                    let between = other.inverse() * pose;
                    between.translation.vector.norm() < SAME_PLACE_M
                        && between.rotation.angle() < SAME_PLACE_M
                };
                if !known.iter().any(same) {
                    known.push((pose, person.height_m()));
                }
            }
        }
        let bodies = places.into_values().map(|(name, places)| {
            let several = places.len() > 1;
            let solids = places.into_iter().enumerate();
            let solids = solids.map(|(index, (pose, height_m))| Solid {
                name: if several {
                    format!("{name}.{}", index + 1)
                } else {
                    name.clone()
                },
                shape: Shape::Convex(Arc::new(outline_to(height_m))),
                parent_from_shape: pose,
            });
            let solids = solids.collect();
            (name, solids)
        });
        bodies.collect()
    }
}

impl Person {
    /// Between the feet, z up, x towards a place that is looked at; towards the world's x from right over it.
    fn facing(&self, place: &Point3<f64>) -> Pose {
        let ahead = place - self.position_m;
        let yaw = if libm::hypot(ahead.x, ahead.y) > SAME_PLACE_M {
            libm::atan2(ahead.y, ahead.x)
        } else {
            0.0
        };
        Pose::from_parts(
            self.position_m.coords.into(),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw),
        )
    }

    fn height_m(&self) -> f64 {
        self.statures_m.iter().copied().fold(0.0, f64::max) + SHOES_M
    }
}

/// A prism from the floor up whose outline is a stadium, deep along x and wide along y.
fn outline_to(height_m: f64) -> ConvexMesh {
    let step = PI / (HALF_CORNERS - 1) as f64;
    let radius_m = BODY_RADIUS_M / libm::cos(0.5 * step);
    let shoulder_m = HALF_WIDTH_M - BODY_RADIUS_M;
    let half = |side: f64, from: f64| {
        (0..HALF_CORNERS).map(move |corner| {
            let (sine, cosine) = libm::sincos((from + step * corner as f64).rem_euclid(TAU));
            [radius_m * cosine, side * shoulder_m + radius_m * sine]
        })
    };
    // Counter-clockwise seen from above: the left shoulder, then the right one.
    let outline: Vec<[f64; 2]> = half(1.0, 0.0).chain(half(-1.0, PI)).collect();
    let count = u32::try_from(outline.len()).expect("a few corners");
    let at = |z_m: f64| outline.iter().map(move |&[x, y]| Point3::new(x, y, z_m));
    let vertices_m = at(0.0).chain(at(height_m)).collect();
    let mut triangles = Vec::new();
    for corner in 0..count {
        let next = (corner + 1) % count;
        triangles.push([corner, next, count + next]);
        triangles.push([corner, count + next, count + corner]);
    }
    for corner in 1..count - 1 {
        triangles.push([0, corner + 1, corner]);
        triangles.push([count, count + corner, count + corner + 1]);
    }
    ConvexMesh(TriangleMesh {
        vertices_m,
        triangles,
    })
}

/// As something to be drawn, and to be seen through.
pub(crate) fn drawn(solids: Vec<Solid>) -> Fixture {
    Fixture {
        kind: FixtureKind::Person,
        solids,
        color_rgba: [0.35, 0.45, 0.65, 0.35],
    }
}
