//! Shapes and triangle meshes: reading and checking them, convex hulls and pieces, signed distance
//! with witnesses, rays.
//!
//! Signed distances are positive for a gap and negative for a penetration depth; `point_on_b -
//! point_on_a = distance * normal`. Metres throughout.
//!
//! # Method
//!
//! A sphere is a point and a capsule a segment with a radius around it, which is exact for both
//! signs; cylinders, boxes and convex meshes have none. What is left of two shapes without their
//! radii is solved in closed form (points and segments with each other, a point with a box or a
//! cylinder) or by iteration: GJK while they are apart, an expanding polytope when they overlap.
//! Both bound the answer from both sides and stop when the bounds meet; the one that is never
//! optimistic is reported. What rounding leaves between the bounds is below 1e-8 m apart and,
//! for coaxial shapes of metres in penetration, below 2e-7 m.
//!
//! # Meshes
//!
//! The distance from a triangle mesh is the least over its triangles, each as certain as above;
//! a tree of turned boxes finds it. What is within the closed surface is told by a winding
//! number, so cavities are free and parts that overlap are one solid. [`TriangleTree`] holds the
//! triangles for all that is asked of a surface: distances, rays and what is inside.
//!
//! The depth in a mesh is the length of the shortest of some separating translations: out of the
//! convex hull, to the nearest point of the surface, across the pieces of surface that are touched, and
//! what a local search makes of the best. Each is proven to part the two: no triangle that is
//! touched on the way is left later than at its end, and the end is outside. So the depth is an
//! upper bound, the signed distance never optimistic, and `distance * normal` does part the two.
//! It is exact for a mesh that is convex, and for a ball or a point that meets nothing else on the
//! way to the nearest point of the surface. Where a solid is not convex a shorter way may exist;
//! `tests/geometry/meshes.rs` looks for one by brute force, and the worst reported depth was 1.14 times
//! what it found.
//!
//! # Accuracy
//!
//! Differences in um from the reference in `tests/validation/clearance`, 300 random pairs per
//! row (a third of them near touching, a fifth aligned with each other), as
//! `tests/geometry/against_coal.rs` prints and asserts them. The goal was 1 um. The reference itself is
//! certified to 8e-4 um. `over` is the largest overestimate, the unsafe side.
//!
//! | Shapes | apart q75 | max | penetrating q75 | max | over |
//! |---|---|---|---|---|---|
//! | sphere, sphere | 3.3e-8 | 5.0e-8 | 3.7e-8 | 5.0e-8 | 5.0e-8 |
//! | sphere, cylinder | 3.8e-8 | 1.3e-6 | 3.7e-8 | 4.3e-7 | 1.3e-6 |
//! | sphere, capsule | 3.4e-8 | 5.1e-8 | 3.2e-8 | 1.8e-7 | 1.8e-7 |
//! | sphere, cuboid | 4.1e-8 | 1.7e-6 | 3.4e-8 | 8.3e-8 | 1.7e-6 |
//! | sphere, convex | 4.0e-8 | 4.3e-7 | 3.8e-8 | 2.0e-7 | 4.3e-7 |
//! | cylinder, cylinder | 1.5e-5 | 2.5e-4 | 1.3e-5 | 8.3e-5 | 3.3e-5 |
//! | cylinder, capsule | 1.8e-6 | 4.5e-5 | 2.8e-6 | 5.2e-5 | 1.8e-5 |
//! | cylinder, cuboid | 1.2e-5 | 8.4e-5 | 9.8e-6 | 7.5e-5 | 6.2e-5 |
//! | cylinder, convex | 1.6e-5 | 8.2e-4 | 1.3e-5 | 8.7e-5 | 1.4e-5 |
//! | capsule, capsule | 3.2e-8 | 7.1e-7 | 3.3e-8 | 1.4e-7 | 7.1e-7 |
//! | capsule, cuboid | 3.7e-8 | 1.5e-6 | 3.6e-8 | 2.4e-7 | 1.5e-6 |
//! | capsule, convex | 4.1e-8 | 5.4e-7 | 3.9e-8 | 6.2e-8 | 5.4e-7 |
//! | cuboid, cuboid | 4.2e-8 | 2.3e-6 | 3.3e-8 | 5.0e-8 | 2.3e-6 |
//! | cuboid, convex | 4.0e-8 | 9.5e-6 | 3.4e-8 | 5.0e-8 | 9.5e-6 |
//! | convex, convex | 4.1e-8 | 4.0e-6 | 3.6e-8 | 4.9e-8 | 3.1e-6 |
//!
//! Meshes, as `tests/geometry/meshes.rs` prints and asserts them, in um: against the convex solver where
//! the mesh is convex (both signs), and while apart against brute force over all triangles, with a
//! distance of triangles of its own, for a torus, a bowl and an angle iron.
//!
//! | Shapes | convex mesh over | under | brute force over | under |
//! |---|---|---|---|---|
//! | sphere, mesh | 1.1e-10 | 3.5e-10 | 1.0e-7 | 0 |
//! | cylinder, mesh | 9.3e-5 | 6.1e-5 | 8.0e-5 | 3.7e-5 |
//! | capsule, mesh | 3.1e-10 | 3.4e-9 | 5.9e-8 | 2.2e-10 |
//! | cuboid, mesh | 1.5e-10 | 1.0e-8 | 2.5e-10 | 2.4e-10 |
//! | convex, mesh | 2.6e-10 | 1.3e-10 | 1.7e-10 | 2.2e-10 |
//! | mesh, mesh | 3.1e-10 | 2.3e-10 | 2.2e-10 | 2.9e-10 |
//! | notch, cavity, closed form | 1.4e-10 | 1.5e-9 | | |
//!
//! The test of the primitives asks parry 0.31 (in millimetres) and Coal 3.0.3. Apart, both agree with the
//! reference to 7e-3 um. In penetration parry misses 25 of the 4500 pairs and Coal 45, by up to
//! 0.2 m and 0.1 m, all with a cylinder or a capsule, and parry mostly to the unsafe side. That
//! is why the solver is our own.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod bounds;
mod convex;
mod distance;
pub mod encoding;
mod inside;
mod measure;
pub mod mesh;
mod parry;
mod placement;
mod prepared;
mod ray;
pub mod sample_solids;
mod segment;
mod separation;
mod shape;
mod surface;
mod tessellate;
mod topology;
mod tree;
mod triangle_mesh;

pub use bounds::{BoundingCapsule, OrientedBox};
pub use distance::{
    Between, PRUNING_MARGIN_M, is_nearer, separation, separation_between, separation_within,
};
pub use mesh::SolidMesh;
pub use placement::Placement;
pub use prepared::PreparedShape;
pub use ray::{SightTarget, first_hit};
pub use segment::{PreparedSolids, segment_clearance};
pub use separation::Separation;
pub use shape::{Shape, Solid, Visual};
pub use surface::{EndGaps, MovingSolids};
pub use tree::TriangleTree;
pub use triangle_mesh::{ConvexMesh, TriangleMesh};
