//! Recorded runs of real arms: reading, checks, and identification of the arm.
//!
//! [`read_log`] makes a [`RecordedRun`] of a log; errors and anomalies are reported, and nothing is guessed.
//! [`arm_fits`] identifies the arm, [`calibrate`] how its links differ from the nominal ones, [`identify`]
//! loads, rotor inertia and friction. Each value has a confidence interval, or the reason why the run does
//! not determine it, and the error on held-out rows.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod answers_file;
mod arm_fit;
mod calibration;
mod check;
mod csv;
mod derivative;
mod identify;
mod joint_states;
mod lag;
mod motion_file;
mod options;
mod quantity;
mod raw;
mod regression;
mod run;
mod terms;

use std::path::Path;

use needlebench_input::Finding;

pub use answers_file::{
    Answer, AnswersFile, AnswersSource, Asked, Question, answers_of, read_answers,
};
pub use arm_fit::{ArmFit, arm_fits};
pub use calibration::{CalibratedLink, CalibrationFit, PoseError, calibrate};
pub use identify::{
    ControllerFit, CurrentLaw, Estimate, Identification, IdentifiedLoad, JointDrive, KnownArm,
    MeasuredFit, identify,
};
pub use lag::{Tracking, tracking};
pub use motion_file::{
    Known, MOST_JOINT_RAD, MotionFile, MotionOptions, MotionSource, motion_of_points, read_motion,
};
pub use options::{AngleUnit, EffortMeaning, ReadOptions, TimeUnit};
pub use quantity::Quantity;
pub use run::{Effort, Load, LogKind, LogSource, RecordedRun};

/// Reads a log and checks its units, clock, gaps and modes.
///
/// # Errors
/// What is wrong with it, and a hint to make it readable.
pub fn read_log(path: &Path, options: &ReadOptions) -> Result<RecordedRun, Vec<Finding>> {
    let file = path.display().to_string();
    let is_mcap = joint_states::is_mcap(path);
    let (raw, sha256) = if is_mcap {
        joint_states::read(path, options)?
    } else {
        csv::read(path, options)?
    };
    let format = if is_mcap { "mcap" } else { "csv" };
    check::checked(&file, sha256, format, raw, options)
}
