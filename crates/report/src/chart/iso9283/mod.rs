//! A test by ISO 9283: attained positions about the command, and how arrivals settle.

mod attained;
mod stabilisation;

pub use attained::attained_chart;
pub use stabilisation::stabilisation_chart;
