//! The crate from outside.

mod evaluating;
mod parsing;
mod refusing;
mod test_arm;
