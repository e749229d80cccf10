//! Equations 9 to 38 as functions, as printed and as corrected, and the solver that they make up.

use nalgebra::{RealField, Vector3};
use needlebench_kinematics::ik::Shoulder;

use super::dh::{Arm, Target};

/// Equation 9. `sign` is that of the root: positive for the right shoulder.
pub fn q1<T: RealField + Copy>(arm: &Arm<T>, target: &Target<T>, sign: T) -> T {
    let x = target.p.x - arm.d6 * target.a.x;
    let y = arm.d6 * target.a.y - target.p.y;
    let root = (y * y + x * x - arm.d4 * arm.d4).sqrt();
    arm.d4.atan2(sign * root) - y.atan2(x)
}

/// Equation 10.
pub fn q5<T: RealField + Copy>(target: &Target<T>, q1: T, sign: T) -> T {
    let (s1, c1) = q1.sin_cos();
    let n = target.n.x * s1 - target.n.y * c1;
    let o = target.o.x * s1 - target.o.y * c1;
    (sign * (n * n + o * o).sqrt()).atan2(target.a.x * s1 - target.a.y * c1)
}

/// Equation 11; `mended` is the sign of `o_y C1`.
pub fn q6<T: RealField + Copy>(target: &Target<T>, q1: T, q5: T, mended: bool) -> T {
    let (s1, c1) = q1.sin_cos();
    let (s5, o_y) = (q5.sin(), if mended { target.o.y } else { -target.o.y });
    ((-target.o.x * s1 + o_y * c1) / s5).atan2((target.n.x * s1 - target.n.y * c1) / s5)
}

/// Equation 16: entry (3, 1) of frame 4, from the target pose.
pub fn entry_31<T: RealField + Copy>(target: &Target<T>, q5: T, q6: T) -> T {
    let ((s5, c5), (s6, c6)) = (q5.sin_cos(), q6.sin_cos());
    target.n.z * c5 * c6 - target.a.z * s5 - target.o.z * c5 * s6
}

/// Equation 17: entry (3, 3) of frame 4, from the target pose.
pub fn entry_33<T: RealField + Copy>(target: &Target<T>, q6: T) -> T {
    let (s6, c6) = q6.sin_cos();
    -target.o.z * c6 - target.n.z * s6
}

/// Equation 19: `q2 + q3 + q4`.
pub fn q234<T: RealField + Copy>(target: &Target<T>, q5: T, q6: T) -> T {
    entry_31(target, q5, q6).atan2(-entry_33(target, q6))
}

/// Equations 20 to 22: origin of frame 4 in the base frame, m.
pub fn p4<T: RealField + Copy>(arm: &Arm<T>, target: &Target<T>, q6: T) -> Vector3<T> {
    let (s6, c6) = q6.sin_cos();
    let Target { n, o, a, p } = target;
    Vector3::from_fn(|i, _| p[i] - a[i] * arm.d6 + arm.d5 * o[i] * c6 + arm.d5 * n[i] * s6)
}

/// Equation 23: distance of frame 4's origin from the shoulder axis, m.
pub fn l<T: RealField + Copy>(p4: &Vector3<T>) -> T {
    (p4.x * p4.x + p4.y * p4.y).sqrt()
}

/// Equation 24 as printed, m: never negative.
pub fn r1_printed<T: RealField + Copy>(arm: &Arm<T>, p4: &Vector3<T>) -> T {
    let l = l(p4);
    (l * l - arm.d4 * arm.d4).sqrt()
}

/// Equation 24 with its sign, m: negative where the arm reaches back over its shoulder.
pub fn r1<T: RealField + Copy>(p4: &Vector3<T>, q1: T) -> T {
    let (s1, c1) = q1.sin_cos();
    p4.x * c1 + p4.y * s1
}

/// Equation 25, m.
pub fn r2<T: RealField + Copy>(arm: &Arm<T>, p4: &Vector3<T>) -> T {
    p4.z - arm.d1
}

/// Equation 31.
pub fn c3<T: RealField + Copy>(arm: &Arm<T>, r1: T, r2: T) -> T {
    let two = T::one() + T::one();
    (r1 * r1 + r2 * r2 - (arm.a2 * arm.a2 + arm.a3 * arm.a3)) / (two * arm.a2 * arm.a3)
}

/// Equation 33; not a number where the elbow cannot reach.
pub fn q3<T: RealField + Copy>(c3: T, sign: T) -> T {
    (sign * (T::one() - c3 * c3).sqrt()).atan2(c3)
}

/// Equation 34.
pub fn alpha<T: RealField + Copy>(r1: T, r2: T) -> T {
    r2.atan2(r1)
}

/// Equation 35 with its comma.
pub fn beta<T: RealField + Copy>(arm: &Arm<T>, q3: T) -> T {
    (arm.a3 * q3.sin()).atan2(arm.a2 + arm.a3 * q3.cos())
}

/// Equation 37: `q2` and `q3` mirrored about the shoulder axis.
pub fn mirrored<T: RealField + Copy>([q2, q3]: [T; 2]) -> [T; 2] {
    [T::pi() - q2, -q3]
}

/// The corrections of the paper's closed form.
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
    /// All corrections.
    pub const ALL: Self = Self {
        equation_11: true,
        indices: true,
        sign_of_r1: true,
    };
}

/// One wrist of one shoulder: the quantities before the sign of the elbow is chosen.
#[derive(Debug, Clone, Copy)]
pub struct Side<T> {
    q1: T,
    q5: T,
    q6: T,
    q234: T,
    pub r1: T,
    pub r2: T,
}

impl<T: RealField + Copy> Side<T> {
    /// `wrist_sign` is that of `sin q5`.
    pub fn new(
        arm: &Arm<T>,
        target: &Target<T>,
        shoulder: Shoulder,
        wrist_sign: T,
        mended: Mended,
    ) -> Self {
        let q1 = q1(arm, target, nalgebra::convert(shoulder.sign()));
        let q5 = q5(target, q1, wrist_sign);
        let q6 = q6(target, q1, q5, mended.equation_11);
        let p4 = p4(arm, target, q6);
        let r1 = if mended.sign_of_r1 {
            r1(&p4, q1)
        } else {
            r1_printed(arm, &p4)
        };
        Self {
            q1,
            q5,
            q6,
            q234: q234(target, q5, q6),
            r1,
            r2: r2(arm, &p4),
        }
    }

    /// `q3` for a sign of the elbow.
    pub fn q3(&self, arm: &Arm<T>, sign: T) -> T {
        q3(c3(arm, self.r1, self.r2), sign)
    }

    /// The joint vector for `q2` and `q3`: equation 38.
    pub fn joints(&self, [q2, q3]: [T; 2]) -> [T; 6] {
        [self.q1, q2, q3, self.q234 - q3 - q2, self.q5, self.q6]
    }
}

/// The rows of Table 2, in the order of `Configuration::ALL`; `None` where one does not exist.
///
/// Follows section 4.1 literally, except for the corrections.
pub fn solve<T: RealField + Copy>(
    arm: &Arm<T>,
    target: &Target<T>,
    mended: Mended,
) -> [Option<[T; 6]>; 8] {
    let mut rows = [None; 8];
    let finite = |joints: [T; 6]| joints.iter().all(T::is_finite).then_some(joints);
    let signs = [T::one(), -T::one()];
    // q5,1 and q5,2 first, then their negatives q5,3 and q5,4.
    for (half, flip) in signs.into_iter().enumerate() {
        let [right, left] = [Shoulder::Right, Shoulder::Left].map(|shoulder| {
            let sign: T = nalgebra::convert(shoulder.sign());
            Side::new(arm, target, shoulder, sign * flip, mended)
        });
        for (index, elbow_sign) in signs.into_iter().enumerate() {
            let row = 2 * half + index;
            let q3 = right.q3(arm, elbow_sign);
            let beta_right = beta(arm, q3);
            rows[row] = finite(right.joints([alpha(right.r1, right.r2) - beta_right, q3]));

            // With the signed r1 the names Down and Up of the left side are exchanged.
            let left_sign = if mended.sign_of_r1 {
                -elbow_sign
            } else {
                elbow_sign
            };
            let q3 = left.q3(arm, left_sign);
            // Where the right shoulder has no beta1 to offer, nothing but the own one is left.
            let own_beta = mended.indices || !beta_right.is_finite();
            let beta = if own_beta { beta(arm, q3) } else { beta_right };
            let found = [alpha(left.r1, left.r2) - beta, q3];
            let found = if mended.sign_of_r1 {
                found
            } else {
                mirrored(found)
            };
            rows[4 + row] = finite(left.joints(found));
        }
    }
    rows
}
