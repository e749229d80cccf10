//! CT volumes, from outside the crate.

mod names;
mod readers;
mod reconstruct;
