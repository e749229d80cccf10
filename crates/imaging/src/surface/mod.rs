//! Closed surfaces of structures, and how far they are from the voxels.

mod accuracy;
mod cases;
mod field;
mod nets;
mod simplify;

pub use accuracy::{SurfaceError, surface_error};
pub use field::{Field, Level, LocalLevel, Values};
pub use nets::surface_net;
pub use simplify::simplify;

#[cfg(test)]
mod tests;
