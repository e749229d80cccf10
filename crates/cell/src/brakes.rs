//! What is published of an arm's brakes, in SI units.

use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS};
use serde::Serialize;

/// Published stops of category 0, from which the torques of the brakes are derived.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BrakeFigures {
    /// Name of the arm that the figures are of.
    pub arm: String,
    /// The file that has them.
    pub file: String,
    /// Where they are from.
    pub source: String,
    /// Speed from which the stops are, rad/s.
    pub speed_rad_s: f64,
    /// Load at the flange, kg.
    pub load_kg: f64,
    /// Torque of a brake that stands over that of one that slips.
    pub standing_ratio: f64,
    /// Where that is from.
    pub standing_source: String,
    /// The joints.
    pub joints: [BrakeFigure; JOINT_COUNT],
}

/// What is known of one brake.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum BrakeFigure {
    /// A published stop at full extension.
    Published {
        /// Angle travelled, rad.
        distance_rad: f64,
        /// Time taken, s.
        time_s: f64,
        /// Where it is from.
        source: String,
    },
    /// The brake of another joint.
    Like {
        /// The other joint, from 0.
        #[serde(rename = "like_joint")]
        joint: usize,
        /// This brake's torque over that one's.
        torque_ratio: f64,
        /// Where that is from.
        source: String,
    },
}

impl BrakeFigures {
    /// The source of the brakes, in words.
    pub fn note(&self) -> String {
        let mut derived: Vec<String> = Vec::new();
        for (figure, label) in self.joints.iter().zip(JOINT_LABELS) {
            if let BrakeFigure::Like { joint, source, .. } = figure {
                derived.push(format!("{label} as {} ({source})", JOINT_LABELS[*joint]));
            }
        }
        let derived = if derived.is_empty() {
            String::new()
        } else {
            format!("; {}", derived.join(", "))
        };
        format!(
            "brakes derived from the stopping data of the {}: {}{derived}",
            self.arm, self.source
        )
    }
}
