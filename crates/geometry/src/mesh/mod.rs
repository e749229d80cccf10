//! Triangle meshes: reading, checking and repairing them, and the convex pieces that engines need.

mod cache;
mod check;
mod decompose;
mod fidelity;
mod file;
mod hull;
mod mend;
mod pieces;
mod solid;
mod stl;
mod surface_index;

pub use cache::{OtherWriters, forget_kept_meshes, kept_meshes, other_writers};
pub use check::{
    MeshDefect, MeshFacts, check_closed, has_no_area, inverted_part, open_edges,
    without_inverted_parts,
};
pub(crate) use decompose::as_convex;
pub use decompose::decompose;
pub use fidelity::{Fidelity, points_on};
pub use file::{MeshFileError, surface_of_file};
pub use hull::{HullError, check_thickness, convex_hull, simplified_hull};
pub use mend::{Mended, mend};
pub use pieces::ConvexPieces;
pub use solid::SolidMesh;
pub use stl::{is_lfs_pointer, read_stl};
pub use surface_index::SurfaceIndex;

pub use crate::measure::{area_m2, centroid_m, extent_m, size_m, volume_m3};
pub use crate::topology::{connected_parts, weld};
