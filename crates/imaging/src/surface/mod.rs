//! Closed surfaces of structures, and how far they are from the voxels.

mod accuracy;
mod cases;
mod field;
mod local_level;
mod middles;
mod nets;
mod simplify;
mod sound;

pub use accuracy::{SurfaceError, surface_error};
pub use field::{Field, Level, Values};
pub use local_level::{local_level, refine};
pub use middles::at_middles;
pub use nets::surface_net;
pub use simplify::simplify;
pub use sound::sound;

#[cfg(test)]
mod tests;
