//! Signed distance of a convex shape or a closed surface from a closed surface.
//!
//! Apart, it is the least over the triangles (`nearest`). A side that is within the other is told
//! from one that is outside by a winding number; then, and when a triangle is touched, the depth
//! (`penetration_depth`) is the length of the shortest of proven separating translations
//! (`separating_translation`). What keeps
//! them apart all along a motion is found box by box (`swept`).

mod distance;
mod nearest;
mod penetration_depth;
mod separating_translation;
mod sides;
mod swept;

pub(crate) use distance::{is_nearer, separation_within};
pub use swept::{EndGaps, MovingSolids};
