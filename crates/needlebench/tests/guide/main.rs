//! The guide is true: its commands print what it says they do, its examples are of keys that exist, and its
//! references are those of the program.
//!
//! After a change of what the program prints, look at what `TRYCMD=overwrite cargo test -p needlebench --test
//! guide` makes of the chapters, and commit it if it is what readers should see.

mod book;
mod commands;
mod examples;
mod references;
