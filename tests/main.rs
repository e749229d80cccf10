//! The project as a whole: its architecture, its language, and its numbers against independent tools and closed forms.

mod architecture;
mod benchmarks;
mod language;
mod validation;
