//! Recorded runs of real arms: read, checked, and what they say of the arm.
//!
//! [`read_log`] makes a [`RecordedRun`] of a log; whatever is wrong or odd with it is said, and nothing
//! is guessed. [`arm_fits`] says which arm it is of, [`calibrate`] how its links differ from the nominal
//! ones, [`identify`] what it weighs and rubs. Each figure comes with an interval, or with why the run
//! does not show it, and with the error on rows that it was not made from.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod arm_fit;
mod calibration;
mod check;
mod csv;
mod derivative;
mod identify;
mod joint_states;
mod lag;
mod options;
mod quantity;
mod raw;
mod regression;
mod run;
mod terms;

use std::path::Path;

use needlebench_cell::Finding;

pub use arm_fit::{ArmFit, arm_fits};
pub use calibration::{CalibratedLink, CalibrationFit, PoseError, calibrate};
pub use identify::{
    ControllerFit, CurrentLaw, Estimate, Identification, IdentifiedLoad, JointDrive, KnownArm,
    MeasuredFit, identify,
};
pub use lag::{Tracking, tracking};
pub use options::{AngleUnit, EffortMeaning, ReadOptions, TimeUnit};
pub use quantity::Quantity;
pub use run::{Effort, Load, LogKind, LogSource, RecordedRun};

/// Reads a log and checks its units, clock, gaps and modes.
///
/// # Errors
/// What is wrong with it, and what to say so that it can be read.
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
