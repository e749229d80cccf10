//! The program from outside: what it prints, writes, refuses, and how it ends.

mod accuracy;
#[cfg(unix)]
mod action;
mod arms;
mod atlas;
mod breath;
mod calibration;
#[cfg(unix)]
mod cases;
mod check;
mod clearance;
#[cfg(target_os = "linux")]
mod cluster;
mod compare;
mod compare_studies;
mod credibility;
mod ct_build;
mod ct_info;
mod ct_routes;
mod ct_synth;
mod determinism;
#[cfg(target_os = "linux")]
mod environment;
mod events;
mod export;
mod export_motion;
mod help;
mod imperfect;
mod init;
#[cfg(target_os = "linux")]
mod interrupt;
mod iso9283;
mod judge;
mod kinematics;
mod log;
mod made;
mod names_of_metrics;
mod page;
mod pairs;
mod paper;
mod parts;
mod people;
#[cfg(target_os = "linux")]
mod process;
mod record_plan;
mod referee;
mod replay;
mod robot;
mod robust_io;
mod run;
mod schema;
mod screen;
mod search;
mod study;
mod suggest;
mod support;
mod unjudged;
#[cfg(unix)]
mod xacro;
