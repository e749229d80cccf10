//! Solids that are not convex: engines collide with their pieces, not with their hull.

use crate::process as harness;
use std::sync::Arc;

use nalgebra::Point3;
use needlebench_cell::{BodyKind, Cell, CollisionBody, Frame};
use needlebench_engine::{
    Contact, EngineError, MujocoPlant, MujocoSettings, Plant, RapierPlant, RapierSettings,
};
use needlebench_geometry::mesh::convex_hull;
use needlebench_geometry::{ConvexMesh, Shape, Solid, SolidMesh, TriangleMesh};
use needlebench_kinematics::{Joints, Pose};

const TIMESTEP_S: f64 = 1e-3;

/// A posture in free space.
const POSTURE: Joints = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);

/// Penetration that is asked for, m, and how well the engines see it: as for every other shape.
const DEPTH_M: f64 = 1e-5;
const DEPTH_ERROR_M: f64 = 1e-6;

/// A box between two corners.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> ConvexMesh {
    let corners: Vec<Point3<f64>> = (0..8_usize)
        .map(|i| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    low[axis]
                } else {
                    high[axis]
                }
            };
            Point3::new(pick(0), pick(1), pick(2))
        })
        .collect();
    convex_hull(&corners).unwrap()
}

/// A bowl with a square floor at z = 0, open towards -z, with walls 0.06 m high and 0.2 m apart.
fn bowl(pieces: Vec<ConvexMesh>) -> Solid {
    let mut surface = TriangleMesh {
        vertices_m: Vec::new(),
        triangles: Vec::new(),
    };
    // Not closed off inside, which engines do not see.
    for ConvexMesh(piece) in &pieces {
        let offset = u32::try_from(surface.vertices_m.len()).unwrap();
        surface.vertices_m.extend(&piece.vertices_m);
        let triangles = piece.triangles.iter();
        surface
            .triangles
            .extend(triangles.map(|t| t.map(|v| v + offset)));
    }
    Solid {
        name: "bowl".into(),
        shape: Shape::Mesh(Arc::new(SolidMesh::with_pieces(surface, pieces))),
        parent_from_shape: Pose::identity(),
    }
}

fn bowl_pieces() -> Vec<ConvexMesh> {
    let wall = |sign: f64, axis: usize| {
        let (mut low, mut high) = ([-0.12, -0.12, -0.06], [0.12, 0.12, 0.02]);
        if sign > 0.0 {
            low[axis] = 0.1;
        } else {
            high[axis] = -0.1;
        }
        cuboid(low, high)
    };
    vec![
        cuboid([-0.12, -0.12, 0.0], [0.12, 0.12, 0.02]),
        wall(1.0, 0),
        wall(-1.0, 0),
        wall(1.0, 1),
        wall(-1.0, 1),
    ]
}

/// The cell with the bowl's floor `gap_m` before the guide's exit, which is within the walls.
fn cell_with_floor_at(gap_m: f64) -> Cell {
    let exit = crate::common::ur3(Vec::new()).world_from_guide_exit(&POSTURE);
    let mut solid = bowl(bowl_pieces());
    solid.parent_from_shape = exit * Pose::translation(0.0, 0.0, gap_m);
    crate::common::ur3(vec![CollisionBody {
        name: "bowl".into(),
        kind: BodyKind::Phantom,
        frame: Frame::World,
        solids: vec![solid],
    }])
}

/// What rapier and MuJoCo see, in that order.
fn contacts(cell: &Cell) -> [Contact; 2] {
    let mut harness = harness::harness();
    let mut rapier = RapierPlant::new(cell, TIMESTEP_S, &RapierSettings::default()).unwrap();
    let settings = MujocoSettings::default();
    let mut mujoco = MujocoPlant::new(&mut harness, cell, TIMESTEP_S, &settings).unwrap();
    let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
    plants.map(|plant| plant.reset(&POSTURE).unwrap().contact)
}

#[test]
fn guide_inside_a_bowl_touches_nothing_until_it_meets_the_floor() {
    for contact in contacts(&cell_with_floor_at(1e-5)) {
        assert_eq!(contact.count, 0, "{contact:?}");
    }
    let cell = cell_with_floor_at(-DEPTH_M);
    let index = |name: &str| {
        let found = cell.bodies.iter().position(|body| body.name == name);
        u32::try_from(found.unwrap()).unwrap()
    };
    for contact in contacts(&cell) {
        assert!(contact.count > 0);
        let error = (contact.deepest_penetration_m - DEPTH_M).abs();
        assert!(error < DEPTH_ERROR_M, "{contact:?}");
        assert_eq!(contact.pair, Some((index("guide_tube"), index("bowl"))));
    }
}

#[test]
fn hull_of_the_bowl_would_touch() {
    let mut cell = cell_with_floor_at(1e-5);
    let bowl = &mut cell.bodies.last_mut().unwrap().solids[0];
    let Shape::Mesh(mesh) = &bowl.shape else {
        panic!()
    };
    bowl.shape = Shape::Convex(Arc::new(convex_hull(&mesh.surface().vertices_m).unwrap()));
    for contact in contacts(&cell) {
        assert!(contact.count > 0, "{contact:?}");
    }
}

#[test]
fn wall_of_the_bowl_is_seen_by_both_engines_at_the_same_place() {
    // Sideways until the tube of 6 mm radius leans against the wall.
    for (gap_m, touches) in [(1e-5, false), (-DEPTH_M, true)] {
        let mut cell = cell_with_floor_at(1e-2);
        let bowl = &mut cell.bodies.last_mut().unwrap().solids[0];
        bowl.parent_from_shape *= Pose::translation(-(0.1 - 0.006 - gap_m), 0.0, 0.0);
        for contact in contacts(&cell) {
            assert_eq!(contact.count > 0, touches, "{contact:?} at {gap_m}");
        }
    }
}

#[test]
fn mesh_without_pieces_is_refused_by_name() {
    let mut solid = bowl(bowl_pieces());
    let Shape::Mesh(mesh) = &solid.shape else {
        panic!()
    };
    let without = SolidMesh::with_pieces(mesh.surface().clone(), Vec::new());
    solid.shape = Shape::Mesh(Arc::new(without));
    solid.parent_from_shape = Pose::translation(0.0, 0.0, 3.0);
    let cell = crate::common::ur3(vec![CollisionBody {
        name: "bowl".into(),
        kind: BodyKind::Phantom,
        frame: Frame::World,
        solids: vec![solid],
    }]);
    let refused = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default()).err();
    assert!(
        matches!(&refused, Some(EngineError::BadSolid { solid, .. }) if solid == "bowl"),
        "{refused:?}"
    );
    let reason = refused.unwrap().to_string();
    assert!(reason.contains("no convex pieces"), "{reason}");
}
