//! The brakes of an arm by its data.

use needlebench_cell::{BrakeFigure, BrakeFigures};
use needlebench_kinematics::{JOINT_LABELS, JointLimits};

use super::Arm;

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
