//! What built-in functions do.

pub(crate) mod arm;
pub(crate) mod controller;
pub(crate) mod math;
pub(crate) mod matrices;
pub(crate) mod poses;
pub(crate) mod sockets;
pub(crate) mod texts;
