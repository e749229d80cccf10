//! Plans, from outside the crate.

mod around;
mod families;
mod margins;
mod plans;
mod routes;
