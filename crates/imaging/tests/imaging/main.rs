//! CT volumes, from outside the crate.

mod reconstruct;
