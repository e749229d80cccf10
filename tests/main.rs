//! The project as a whole: its architecture, and its numbers against independent tools and closed forms.

mod architecture;
mod benchmarks;
mod validation;
