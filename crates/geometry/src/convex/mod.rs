//! Convex cores: support functions, and signed distance in closed form or by iteration.

pub(crate) mod closed_form;
mod convex_core;
mod core_separation;
mod difference;
pub(crate) mod epa;
pub(crate) mod gjk;
mod polyhedron;
mod polytope;
mod simplex;

pub(crate) use convex_core::ConvexCore;
pub(crate) use core_separation::CoreSeparation;
pub(crate) use difference::Difference;
pub(crate) use polyhedron::Polyhedron;
