//! A test by ISO 9283: attained positions about the command, and how arrivals settle.

mod attained;
mod stabilisation;

pub(crate) use attained::attained_chart;
pub(crate) use stabilisation::stabilisation_chart;
