//! A recorded run, read and checked.

use std::ops::Range;

use nalgebra::Vector3;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{Joints, Pose, pose_from_rotation_vector};
use serde::Serialize;

/// A recorded run of an arm: one entry per row in every list, s, rad, A, N m.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedRun {
    /// Where it is from.
    pub source: LogSource,
    /// Time of each row, s, by the log's clock.
    pub time_s: Vec<f64>,
    /// Set-points, if the log has any.
    pub target: Option<Vec<JointState>>,
    /// Joint angles as measured.
    pub actual_q: Vec<Joints>,
    /// Joint speeds as measured.
    pub actual_qd: Option<Vec<Joints>>,
    /// The controller's rigid-body torques, without friction.
    pub target_moment_nm: Option<Vec<Joints>>,
    /// Target currents of the controller.
    pub target_current_a: Option<Vec<Joints>>,
    /// Currents as measured.
    pub actual_current_a: Option<Vec<Joints>>,
    /// Torques as measured, and what they mean.
    pub effort_nm: Option<(Vec<Joints>, Effort)>,
    /// Pose of the tool's point in `base` as the controller computes it from the measured angles:
    /// position and rotation vector.
    pub tcp: Option<Vec<[f64; 6]>>,
    /// Loads that the controller used, each from a row on.
    pub loads: Vec<(usize, Load)>,
    /// Rows without a gap between them.
    pub stretches: Vec<Range<usize>>,
    /// Whose log it is.
    pub kind: LogKind,
    /// Lowest and highest temperature of any joint, degrees C.
    pub temperature_c: Option<[f64; 2]>,
    /// Notes from reading; belong in every report.
    pub notes: Vec<String>,
}

/// The file of a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogSource {
    /// File as the user named it.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// What it is: `csv` or `mcap`.
    pub format: &'static str,
    /// Rows in the file.
    pub rows_in_file: usize,
    /// Rows that are used.
    pub rows: usize,
}

/// What a log's torques are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effort {
    /// Whole torques at the joints, N m, friction included.
    Torque,
    /// Torques without the part that holds arm and load against gravity, N m.
    Compensated,
}

/// Whether an arm stands behind a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LogKind {
    /// Nothing says otherwise.
    Arm,
    /// The measured angles are the set-points, bit for bit.
    Simulator,
}

/// A load at the flange.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Load {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre in the flange frame, m.
    pub centre_m: [f64; 3],
    /// Inertia about its centre along the flange's axes, kg m^2: xx, yy, zz, xy, xz, yz; 0 where the log
    /// does not say, which counts it as a point.
    pub inertia_kgm2: [f64; 6],
}

impl RecordedRun {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Time covered by the stretches, s.
    pub fn duration_s(&self) -> f64 {
        let stretches = self.stretches.iter();
        stretches
            .map(|rows| self.time_s[rows.end - 1] - self.time_s[rows.start])
            .sum()
    }

    /// Median time between two rows of a stretch, s.
    pub fn period_s(&self) -> f64 {
        let mut steps: Vec<f64> = self
            .stretches
            .iter()
            .flat_map(|rows| self.time_s[rows.clone()].windows(2))
            .map(|pair| pair[1] - pair[0])
            .collect();
        if steps.is_empty() {
            return f64::NAN;
        }
        let middle = steps.len() / 2;
        *steps.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Pose of the tool's point in `base` at a row, if the log has it.
    pub(crate) fn base_from_tcp(&self, row: usize) -> Option<Pose> {
        self.tcp.as_ref().map(|poses| {
            let [x, y, z, rx, ry, rz] = poses[row];
            pose_from_rotation_vector(Vector3::new(x, y, z), Vector3::new(rx, ry, rz))
        })
    }

    /// Index of the load of a row, if the log says any.
    pub fn load_at(&self, row: usize) -> Option<usize> {
        self.loads
            .partition_point(|(from, _)| *from <= row)
            .checked_sub(1)
    }

    /// Speeds and accelerations of a row: of the set-points where there are any.
    pub fn state(&self, row: usize) -> Option<&JointState> {
        self.target.as_ref().map(|states| &states[row])
    }
}
