//! Scenario and model files, resolved into one validated cell.

mod model;
pub mod shape;
mod tessellate;

pub use model::{
    BodyKind, BodyPair, Cell, ClearanceClass, CollisionBody, Frame, Link, ModelSource, Needle,
    NeedleCorridor, Robot, Tool,
};
