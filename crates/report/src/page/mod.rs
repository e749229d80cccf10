//! Report pages: one HTML file each, with everything in it, that opens from disk without a network.
//!
//! A page is markup, style and scripts (readable files under `assets/`, and three.js) and one payload:
//! base64 of zlib of a pack, that is a JSON document and the arrays that it refers to. Rust
//! gathers and quantises; the scripts draw. The payload holds no characters that markup could take
//! for its own, and the scripts put texts into the page as texts only, so names from files cannot
//! become markup. A content security policy forbids the page every connection.
//!
//! The same results give the same bytes: wall-clock times are left out.

mod atlas;
mod charts;
pub mod document;
mod explore;
#[cfg(test)]
mod further_engine_tests;
mod mesh;
mod motion;
#[cfg(test)]
mod number_tests;
mod pack;
pub mod parts;
mod replay;
mod room;
mod run;
mod scene;
mod search;
pub mod shared;
pub mod study;
mod viewer;
mod words;

pub(crate) use atlas::atlas_page;
pub(crate) use replay::replay_page;
pub(crate) use run::run_page;
pub(crate) use search::search_page;
