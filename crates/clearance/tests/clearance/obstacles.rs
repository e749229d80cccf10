//! Random cells with obstacles: the quick ways give what asking every pair of solids does.

use std::sync::Arc;

use crate::common::{Variety, cell, cell_among, fixed};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_cell::{BodyKind, Cell, ClearanceClass, CollisionBody};
use needlebench_clearance::ClearanceModel;
use needlebench_geometry::{
    ConvexMesh, PreparedShape, Shape, Solid, SolidMesh, sample_solids, separation,
};
use needlebench_kinematics::{Joints, Pose};

/// The solver's certificate of 1e-10 m and rounding, as in `cell.rs`.
const REPRODUCED_M: f64 = 1e-9;

fn shape(variety: &mut Variety, kind: usize) -> Shape {
    let mut size = |low_m, high_m| variety.between(low_m, high_m);
    match kind {
        0 => Shape::Sphere {
            radius_m: size(0.02, 0.15),
        },
        1 => Shape::Cylinder {
            radius_m: size(0.01, 0.1),
            half_length_m: size(0.05, 0.9),
        },
        2 => Shape::Capsule {
            radius_m: size(0.01, 0.1),
            half_length_m: size(0.05, 0.9),
        },
        3 => Shape::Cuboid {
            half_extents_m: Vector3::from_fn(|_, _| size(0.01, 0.3)),
        },
        4 => {
            let half_m = Vector3::from_fn(|_, _| size(0.05, 0.3));
            Shape::Convex(Arc::new(ConvexMesh(sample_solids::ellipsoid(
                9, 12, half_m,
            ))))
        }
        _ => {
            let mut surface = sample_solids::torus(20, 10);
            let scale = size(1.0, 4.0);
            for vertex in &mut surface.vertices_m {
                *vertex *= scale;
            }
            Shape::Mesh(Arc::new(SolidMesh::new(surface)))
        }
    }
}

/// One obstacle of every shape, anywhere in reach, for any of the classes that an obstacle may have.
fn obstacles(variety: &mut Variety) -> Vec<CollisionBody> {
    let kinds = [
        BodyKind::Obstacle,
        BodyKind::Table,
        BodyKind::Gantry,
        BodyKind::Mount,
    ];
    (0..6)
        .map(|k| {
            let at = Vector3::from_fn(|_, _| variety.between(-0.7, 0.7));
            let turn = Vector3::from_fn(|_, _| variety.between(-3.0, 3.0));
            let solid = Solid {
                name: format!("obstacle_{k}"),
                shape: shape(variety, k),
                parent_from_shape: Pose::from_parts(
                    Translation3::from(at),
                    UnitQuaternion::from_scaled_axis(turn),
                ),
            };
            // The first ones are of the class of their own.
            let kind = kinds[k.saturating_sub(2) % kinds.len()];
            fixed(&format!("obstacle_{k}"), kind, vec![solid])
        })
        .collect()
}

/// The least distance of every class over all pairs of solids, m.
fn exhaustive_m(cell: &Cell, q: &Joints) -> Vec<Option<f64>> {
    let poses = cell.world_from_bodies(q);
    let prepared: Vec<Vec<PreparedShape>> = cell
        .bodies
        .iter()
        .map(|body| {
            body.solids
                .iter()
                .map(|solid| PreparedShape::new(&solid.shape))
        })
        .map(Iterator::collect)
        .collect();
    let mut least_m = vec![None::<f64>; ClearanceClass::ALL.len()];
    for pair in &cell.pairs {
        let slot = &mut least_m[pair.class as usize];
        for (i, a) in cell.bodies[pair.a].solids.iter().enumerate() {
            for (j, b) in cell.bodies[pair.b].solids.iter().enumerate() {
                let found = separation(
                    &prepared[pair.a][i],
                    &(poses[pair.a] * a.parent_from_shape),
                    &prepared[pair.b][j],
                    &(poses[pair.b] * b.parent_from_shape),
                );
                *slot = Some(slot.map_or(found.distance_m, |known| known.min(found.distance_m)));
            }
        }
    }
    least_m
}

#[test]
fn minima_among_obstacles_are_those_of_all_solids() {
    let mut variety = Variety::new(77);
    let (mut touching, mut apart, mut free_of_obstacles) = (0, 0, 0);
    let bare = ClearanceModel::new(&cell());
    for _ in 0..12 {
        let cell = cell_among(obstacles(&mut variety));
        let model = ClearanceModel::new(&cell);
        // What is made from the model of another cell is the same, bit for bit.
        let made_from_other = bare.for_cell(&cell);
        for _ in 0..6 {
            let q = variety.joints();
            let minima = model.minimum_per_class(&q);
            assert_eq!(made_from_other.minimum_per_class(&q), minima);
            let exhaustive_m = exhaustive_m(&cell, &q);
            for class in ClearanceClass::ALL {
                let found = minima.get(class).map(|found| found.separation.distance_m);
                let expected = exhaustive_m[class as usize];
                assert_eq!(found.is_some(), expected.is_some(), "{class:?}");
                let (Some(found), Some(expected)) = (found, expected) else {
                    continue;
                };
                assert!(
                    (found - expected).abs() <= REPRODUCED_M,
                    "{class:?} {found} {expected}"
                );
                if class == ClearanceClass::RobotObstacle {
                    touching += usize::from(found < 0.0);
                    apart += usize::from(found > 0.0);
                }
            }
            let limit_m = |class| match class {
                ClearanceClass::RobotObstacle => 0.02,
                _ => f64::NEG_INFINITY,
            };
            let nearest_m = exhaustive_m[ClearanceClass::RobotObstacle as usize];
            let below = model.first_below(&q, limit_m);
            assert_eq!(
                below.is_some(),
                nearest_m.is_some_and(|least_m| least_m < 0.02)
            );
            free_of_obstacles += usize::from(below.is_none());
        }
    }
    assert!(
        touching > 8 && apart > 8 && free_of_obstacles > 8,
        "{touching} {apart}"
    );
}
