//! Names of the eight configurations: Table 2 of the paper.

use std::fmt;

use crate::{Joints, UrGeometry};

/// Sign of the square root in equation 9.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Shoulder {
    /// The positive root.
    Right,
    /// The negative root.
    Left,
}

/// Sign of `sin q3`: Down is positive with a right shoulder and negative with a left one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Elbow {
    /// Below the line from shoulder to wrist.
    Down,
    /// Above the line from shoulder to wrist.
    Up,
}

/// Sign of `sin q5`: Fold is positive with a right shoulder and negative with a left one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Wrist {
    /// Folded towards the arm.
    Fold,
    /// Unfolded.
    Unfold,
}

/// One of the eight configurations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Configuration {
    /// Side of the shoulder.
    pub shoulder: Shoulder,
    /// Elbow below or above.
    pub elbow: Elbow,
    /// Wrist folded or not.
    pub wrist: Wrist,
}

impl Configuration {
    /// All eight, in the order of rows in reports: as the rows of Table 3 under their true labels.
    pub const ALL: [Self; 8] = {
        use Elbow::{Down, Up};
        use Shoulder::{Left, Right};
        use Wrist::{Fold, Unfold};
        const fn of(shoulder: Shoulder, elbow: Elbow, wrist: Wrist) -> Configuration {
            Configuration {
                shoulder,
                elbow,
                wrist,
            }
        }
        [
            of(Right, Down, Fold),
            of(Right, Up, Fold),
            of(Right, Down, Unfold),
            of(Right, Up, Unfold),
            of(Left, Down, Fold),
            of(Left, Up, Fold),
            of(Left, Down, Unfold),
            of(Left, Up, Unfold),
        ]
    };

    /// Table 2's words, e.g. `Right-Down-Fold`.
    pub fn label(self) -> &'static str {
        match (self.shoulder, self.elbow, self.wrist) {
            (Shoulder::Right, Elbow::Down, Wrist::Fold) => "Right-Down-Fold",
            (Shoulder::Right, Elbow::Up, Wrist::Fold) => "Right-Up-Fold",
            (Shoulder::Right, Elbow::Down, Wrist::Unfold) => "Right-Down-Unfold",
            (Shoulder::Right, Elbow::Up, Wrist::Unfold) => "Right-Up-Unfold",
            (Shoulder::Left, Elbow::Down, Wrist::Fold) => "Left-Down-Fold",
            (Shoulder::Left, Elbow::Up, Wrist::Fold) => "Left-Up-Fold",
            (Shoulder::Left, Elbow::Down, Wrist::Unfold) => "Left-Down-Unfold",
            (Shoulder::Left, Elbow::Up, Wrist::Unfold) => "Left-Up-Unfold",
        }
    }

    /// Position in [`Configuration::ALL`].
    pub const fn index(self) -> usize {
        let shoulder = match self.shoulder {
            Shoulder::Right => 0,
            Shoulder::Left => 4,
        };
        let wrist = match self.wrist {
            Wrist::Fold => 0,
            Wrist::Unfold => 2,
        };
        let elbow = match self.elbow {
            Elbow::Down => 0,
            Elbow::Up => 1,
        };
        shoulder + wrist + elbow
    }

    /// Configuration with a label, if it is one of Table 2's.
    pub fn from_label(label: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|configuration| configuration.label() == label)
    }

    /// Configuration of a posture. A zero sine counts as positive.
    pub fn of(geometry: &UrGeometry, q: &Joints) -> Self {
        let forward = geometry.wrist_forward_m(q);
        let shoulder = if forward >= 0.0 {
            Shoulder::Right
        } else {
            Shoulder::Left
        };
        Self {
            shoulder,
            elbow: Elbow::of_sign(shoulder, libm::sin(q[2])),
            wrist: Wrist::of_sign(shoulder, libm::sin(q[4])),
        }
    }
}

impl Shoulder {
    /// +1 for the right shoulder, -1 for the left one.
    pub fn sign(self) -> f64 {
        match self {
            Self::Right => 1.0,
            Self::Left => -1.0,
        }
    }
}

impl Elbow {
    fn of_sign(shoulder: Shoulder, sine: f64) -> Self {
        if (sine >= 0.0) == (shoulder == Shoulder::Right) {
            Self::Down
        } else {
            Self::Up
        }
    }

    /// Sign of `sin q3`.
    pub fn sign(self, shoulder: Shoulder) -> f64 {
        match self {
            Self::Down => shoulder.sign(),
            Self::Up => -shoulder.sign(),
        }
    }
}

impl Wrist {
    fn of_sign(shoulder: Shoulder, sine: f64) -> Self {
        if (sine >= 0.0) == (shoulder == Shoulder::Right) {
            Self::Fold
        } else {
            Self::Unfold
        }
    }

    /// Sign of `sin q5`.
    pub fn sign(self, shoulder: Shoulder) -> f64 {
        match self {
            Self::Fold => shoulder.sign(),
            Self::Unfold => -shoulder.sign(),
        }
    }
}

impl fmt::Display for Configuration {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.label())
    }
}
