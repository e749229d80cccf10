//! Tests of the crate from outside.

mod bad_logs;
mod closed_loop;
mod common;
mod joint_states;
mod shipped_log;
