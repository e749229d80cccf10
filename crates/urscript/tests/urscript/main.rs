//! The crate from outside.

mod evaluating;
mod parsing;
mod refusing;
mod running;
mod test_arm;
mod test_host;
