//! What is known before the elbow's sign is chosen.

use nalgebra::RealField;
use needlebench_kinematics::ik::Shoulder;

use super::{arm_plane, shoulder_and_wrist, wrist_sum};
use crate::dh::{Arm, Target};

/// What is mended of the paper's closed form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mended {
    /// The sign in equation 11.
    pub equation_11: bool,
    /// The indices of beta in `q2,3 = alpha2 - beta1`, `q2,4 = alpha2 - beta2`.
    pub indices: bool,
    /// The sign of `r1` in equation 24; makes equation 37's mirror and the indices needless.
    pub sign_of_r1: bool,
}

impl Mended {
    /// Everything that has to be.
    pub const ALL: Self = Self {
        equation_11: true,
        indices: true,
        sign_of_r1: true,
    };
}

/// One wrist of one shoulder: all that is known before the elbow's sign is chosen.
#[derive(Debug, Clone, Copy)]
pub struct Side<T> {
    pub q1: T,
    pub q5: T,
    pub q6: T,
    pub q234: T,
    pub r1: T,
    pub r2: T,
}

impl<T: RealField + Copy> Side<T> {
    /// With everything mended. `wrist_sign` is that of `sin q5`.
    pub fn of(arm: &Arm<T>, target: &Target<T>, shoulder: Shoulder, wrist_sign: T) -> Self {
        Self::with(arm, target, shoulder, wrist_sign, Mended::ALL)
    }

    pub fn with(
        arm: &Arm<T>,
        target: &Target<T>,
        shoulder: Shoulder,
        wrist_sign: T,
        mended: Mended,
    ) -> Self {
        let q1 = shoulder_and_wrist::q1(arm, target, nalgebra::convert(shoulder.sign()));
        let q5 = shoulder_and_wrist::q5(target, q1, wrist_sign);
        let q6 = if mended.equation_11 {
            shoulder_and_wrist::q6(target, q1, q5)
        } else {
            shoulder_and_wrist::q6_printed(target, q1, q5)
        };
        let p4 = arm_plane::p4(arm, target, q6);
        Self {
            q1,
            q5,
            q6,
            q234: wrist_sum::q234(target, q5, q6),
            r1: if mended.sign_of_r1 {
                arm_plane::r1(&p4, q1)
            } else {
                arm_plane::r1_printed(arm, &p4)
            },
            r2: arm_plane::r2(arm, &p4),
        }
    }

    /// The joint vector for `q2` and `q3`: equation 38.
    pub fn joints(&self, q2: T, q3: T) -> [T; 6] {
        [self.q1, q2, q3, self.q234 - q3 - q2, self.q5, self.q6]
    }
}
