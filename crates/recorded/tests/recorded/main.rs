//! Tests of the crate from outside.

mod answers_files;
mod bad_logs;
mod closed_loop;
mod common;
mod joint_states;
mod motion_files;
mod shipped_log;
