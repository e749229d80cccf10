//! CT volumes, from outside the crate.

mod names;
mod nodules;
mod readers;
mod reconstruct;
