//! Studies in folders, with a design and an evaluator that need no physics.

mod folder;
mod healing;
mod interrupted;
mod merging;
mod reading;
mod refusals;
mod same_bytes;
mod surveying;
mod synthetic;
