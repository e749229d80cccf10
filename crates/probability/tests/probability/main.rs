//! Laws, bounds and estimates against quadrature and closed forms.

mod common;
mod input;
mod intervals;
mod laws;
