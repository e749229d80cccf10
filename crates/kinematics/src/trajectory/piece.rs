//! What a trajectory is made of, for those who have others carry it out.

use super::{Course, JointTrajectory, Phase};

/// Part of a trajectory, from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// What it is part of.
    pub phase: Phase,
    /// When it starts, s.
    pub start_s: f64,
    /// When it ends, s.
    pub end_s: f64,
    /// How the joints move.
    pub course: PieceCourse,
}

/// How the joints move over a [`Piece`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PieceCourse {
    /// Straight in joint space, all joints together; of the joint that moves most.
    Straight {
        /// Index of that joint.
        leading: usize,
        /// Its highest speed, rad/s.
        speed_rad_s: f64,
        /// Its highest acceleration, rad/s^2.
        acceleration_rad_s2: f64,
    },
    /// Along another path.
    Curved,
    /// Not at all.
    Hold,
}

impl JointTrajectory {
    /// Its parts in the order of time.
    pub fn pieces(&self) -> impl Iterator<Item = Piece> {
        self.segments.iter().map(|segment| Piece {
            phase: segment.phase,
            start_s: segment.start_s,
            end_s: segment.start_s + segment.duration_s,
            course: match &segment.course {
                Course::Straight { delta, profile, .. } => {
                    let (leading, way_rad) = delta.abs().argmax();
                    let (speed, acceleration) = profile.peaks();
                    PieceCourse::Straight {
                        leading,
                        speed_rad_s: speed * way_rad,
                        acceleration_rad_s2: acceleration * way_rad,
                    }
                }
                Course::Hold { .. } => PieceCourse::Hold,
                Course::Path { .. } | Course::Slowing(_) | Course::Sampled(_) => {
                    PieceCourse::Curved
                }
            },
        })
    }
}
