//! Triangles of a closed surface in nested boxes: distances, rays and inside tests.

mod line;
mod point_triangle;
mod queries;
mod triangle_tree;

pub use triangle_tree::TriangleTree;
pub(crate) use triangle_tree::{Parts, by_coordinates};
