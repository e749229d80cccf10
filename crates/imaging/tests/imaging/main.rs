//! CT volumes, from outside the crate.

mod beside;
mod contents;
mod names;
mod nodules;
mod outside;
mod readers;
mod reconstruct;
mod round_view;
