//! Laws, bounds and estimates against quadrature and closed forms.

mod bounds;
mod cells;
mod common;
mod covers;
mod estimates;
mod input;
mod intervals;
mod laws;
mod quadrature;
mod scenes;
mod shapes;
mod truth;
mod words;
