//! What is published of an arm's brakes, in SI units.

use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, JointLimits};
use serde::Serialize;

use super::Arm;

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

impl Arm {
    /// The brakes, if there are figures of them; `limits` are those of the arm's own URDF.
    pub fn brakes(&self, limits: &JointLimits) -> Option<BrakeFigures> {
        let brakes = self.data.brakes.as_ref()?;
        let index = |name: &str| JOINT_LABELS.iter().position(|label| *label == name);
        let joints = JOINT_LABELS.map(|label| {
            let stop = brakes.stops.iter().find(|stop| stop.joint == label);
            let stop = stop.expect("checked: every joint has one");
            let source = stop.source.as_ref().unwrap_or(&brakes.source).clone();
            match (&stop.like, stop.distance_rad, stop.time_s) {
                (None, Some(distance_rad), Some(time_s)) => BrakeFigure::Published {
                    distance_rad,
                    time_s,
                    source,
                },
                (like, ..) => {
                    let like = like.as_deref().and_then(index);
                    let joint = like.expect("checked: figures, or a joint that has some");
                    let limit_nm = |index: usize| limits.0[index].effort_nm;
                    let own = index(label).expect("a joint's name");
                    BrakeFigure::Like {
                        joint,
                        torque_ratio: limit_nm(own) / limit_nm(joint),
                        source,
                    }
                }
            }
        });
        Some(BrakeFigures {
            arm: self.data.name.clone(),
            file: self.source.file.clone(),
            source: brakes.source.clone(),
            speed_rad_s: brakes.speed_deg_s.to_radians(),
            load_kg: brakes.load_kg,
            standing_ratio: brakes.standing.ratio,
            standing_source: brakes.standing.source.clone(),
            joints,
        })
    }
}

impl BrakeFigures {
    /// What the brakes are derived from, for people.
    pub(crate) fn note(&self) -> String {
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
            "the brakes are derived from the {}'s stops: {}{derived}",
            self.arm, self.source
        )
    }
}
