//! Random numbers, distributions and order statistics, the same bits on every processor.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

pub mod beta;
pub mod chi_square;
pub mod normal;
pub mod order;
pub mod pareto;
pub mod random;
pub mod sobol;
pub mod student;
