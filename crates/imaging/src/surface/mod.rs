//! Closed surfaces of structures, and how far they are from the voxels.

mod accuracy;
mod cases;
mod field;
mod local_level;
mod middles;
mod nets;
mod simplify;
mod sound;
mod stl;

pub use accuracy::SurfaceError;
pub(crate) use accuracy::surface_error;
pub use field::{Field, Level, Values};
pub(crate) use local_level::local_level;
pub use local_level::refine;
pub(crate) use middles::at_middles;
pub(crate) use nets::surface_net;
pub(crate) use simplify::simplify;
pub use sound::sound;
pub use stl::stl_bytes;

#[cfg(test)]
mod tests;
