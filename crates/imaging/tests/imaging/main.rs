//! CT volumes, from outside the crate.

mod beside;
mod contents;
mod nodules;
mod outside;
mod reconstruct;
mod round_view;
