//! Against independent tools: see README.md beside this file.

mod dynamics;
mod engines;
mod inverse;
