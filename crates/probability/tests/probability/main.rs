//! Laws, bounds and estimates against quadrature and closed forms.

mod bounds;
mod cells;
mod common;
mod covers;
mod input;
mod intervals;
mod laws;
mod quadrature;
mod shapes;
