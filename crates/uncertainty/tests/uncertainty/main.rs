//! Imperfections and error budgets, from outside the crate.

mod budget;
mod common;
mod path;
mod settled;
mod tissue;
mod true_target;
