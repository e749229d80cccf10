//! A needle in tissue: an elastic beam that cuts its path through layers, held by a guide with play.
//!
//! The frame is that of the guide: x from the guide's exit along its axis, y and z across. Slopes are small; what the tip
//! has cut stays as it is, and springs rest on the path, not on the straight line:
//!
//! ```text
//! EI v'''' + k(x) (v - c(x)) = 0,   at the tip  EI v'' = 0, shear F,   and the path grows by c(L) = v(L)
//! ```
//!
//! with the stiffness k of the layers (force per length per displacement, N/m2; none in air) and the force F across the
//! tip, which follows the bevel and is averaged over its length. No robot, no voxels, no scenario.

mod element;
mod elimination;
mod fit;
mod guide;
mod insertion;
mod layers;
mod needle;
mod push;
#[cfg(test)]
mod tests;
mod tissue;

pub use fit::{Bend, FitError, FittedForce, fit_force};
pub use guide::{Guide, Holder};
pub use insertion::{Bevel, Insertion, InsertionError, Slip, WARNED_SLOPE, ends, insert};
pub use layers::{Layer, Layers, LayersError};
pub use needle::{Gauge, Needle, NeedleError, STEEL_PA};
pub use tissue::{
    DIAMETER_POWER, Factor, MODEL, Point, REFERENCE_DIAMETER_M, STIFFNESS_POWER, Tissue,
    WALL_FORCE_N,
};
