//! Runs and cases of studies, from outside the crate.

mod answers;
mod directed;
mod further_engine;
mod judge;
#[path = "../../../engine/tests/engine/common/replay.rs"]
mod replay;
mod routes;
mod study_cases;
mod suggest;
