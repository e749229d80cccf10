//! CT volumes, from outside the crate.

mod synth;
