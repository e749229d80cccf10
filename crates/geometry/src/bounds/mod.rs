//! Volumes around shapes: cheap lower bounds of a distance.

mod capsule;
mod oriented_box;

pub use capsule::BoundingCapsule;
pub(crate) use capsule::closest_on_segments;
pub use oriented_box::OrientedBox;
