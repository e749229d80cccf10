//! CT volumes, from outside the crate.

mod readers;
mod reconstruct;
