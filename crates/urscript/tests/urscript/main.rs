//! The crate from outside.

mod parsing;
