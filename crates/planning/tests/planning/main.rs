//! Plans, from outside the crate.

mod around;
mod families;
mod plans;
mod routes;
