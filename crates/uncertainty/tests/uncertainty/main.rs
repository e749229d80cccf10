//! Imperfections and error budgets, from outside the crate.

mod budget;
mod common;
mod settled;
mod true_target;
