//! Studies, from outside the crate.

mod design;
mod store;
