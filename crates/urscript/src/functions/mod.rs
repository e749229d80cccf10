//! What built-in functions do.

pub(crate) mod arm;
pub(crate) mod math;
pub(crate) mod poses;
pub(crate) mod texts;
