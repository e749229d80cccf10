//! Cases of studies: what becomes of a layout's eight configurations.

mod prediction;
pub mod robustness;
mod static_case;
#[cfg(test)]
mod tests;

pub use static_case::{StaticWorker, invalid_rows, static_rows};
