//! A study ready to be searched: its candidates and circumstances, the evaluation of their cases, and the outcomes.

mod evaluator;
mod placement;
mod prepare;
mod reach;
#[cfg(test)]
mod tests;
mod worth;

pub use evaluator::GenerationEvaluator;
pub use placement::{Placement, placement};
pub use prepare::PreparedSearch;
pub use reach::out_of_reach;
pub use worth::worth_of;
