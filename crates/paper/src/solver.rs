//! The paper's closed form as a whole, from equation 9 to Table 2: as printed and mended step by
//! step, and how many of its answers are right.

use nalgebra::RealField;
use needlebench_kinematics::ik::{Configuration, Shoulder, closed_form};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::random::SplitMix64;
use needlebench_kinematics::{Joints, UrGeometry};
use serde::Serialize;

use super::dh::{Arm, Target, largest_entry};
use super::equations::side::{Mended, Side};
use super::equations::{angle_error, elbow};
use super::{Interrupted, Watch};

/// The rows of Table 2, in the order of [`Configuration::ALL`]; `None` where one does not exist.
///
/// Follows section 4.1 to the letter but for what is mended.
pub fn solve<T: RealField + Copy>(
    arm: &Arm<T>,
    target: &Target<T>,
    mended: Mended,
) -> [Option<[T; 6]>; 8] {
    let mut rows = [None; 8];
    // q5,1 and q5,2 first, then their negatives q5,3 and q5,4.
    for (half, flip) in [T::one(), -T::one()].into_iter().enumerate() {
        let side = |shoulder: Shoulder| {
            let sign: T = nalgebra::convert(shoulder.sign());
            Side::with(arm, target, shoulder, sign * flip, mended)
        };
        let (right, left) = (side(Shoulder::Right), side(Shoulder::Left));
        for (index, elbow_sign) in [T::one(), -T::one()].into_iter().enumerate() {
            let q3_right = elbow::q3(elbow::c3(arm, right.r1, right.r2), elbow_sign);
            let alpha_right = elbow::alpha(right.r1, right.r2);
            let beta_right = elbow::beta(arm, q3_right);
            let row = 2 * half + index;
            rows[row] = finite(right.joints(alpha_right - beta_right, q3_right));

            // With the signed r1 the names Down and Up of the left side change places.
            let left_sign = if mended.sign_of_r1 {
                -elbow_sign
            } else {
                elbow_sign
            };
            let q3_left = elbow::q3(elbow::c3(arm, left.r1, left.r2), left_sign);
            let alpha_left = elbow::alpha(left.r1, left.r2);
            // Where the right shoulder has no beta1 to offer, nothing but the own one is left.
            let beta_left = if mended.indices || !beta_right.is_finite() {
                elbow::beta(arm, q3_left)
            } else {
                beta_right
            };
            let (q2, q3) = if mended.sign_of_r1 {
                (alpha_left - beta_left, q3_left)
            } else {
                elbow::mirrored(alpha_left - beta_left, q3_left)
            };
            rows[4 + row] = finite(left.joints(q2, q3));
        }
    }
    rows
}

fn finite<T: RealField + Copy>(joints: [T; 6]) -> Option<[T; 6]> {
    joints
        .iter()
        .all(nalgebra::ComplexField::is_finite)
        .then_some(joints)
}

/// How a variant of the closed form did on random poses.
#[derive(Debug, Clone, Serialize)]
pub struct VariantReport {
    pub name: &'static str,
    /// Joint vectors that it returned.
    pub returned: usize,
    /// Share of them that reproduce the pose, 0 to 1.
    pub right: f64,
    /// Share of poses for which the joint vector that made the pose is among the answers, 0 to 1.
    pub finds_the_joints: f64,
    /// Share according to the errata that this reproduces, 0 to 1.
    pub expected: f64,
}

/// How many joint vectors reach random poses.
#[derive(Debug, Clone, Serialize)]
pub struct CountReport {
    pub poses: usize,
    /// Share of poses with this many solutions, 0 to 1, by the library's closed form.
    pub share_by_count: std::collections::BTreeMap<usize, f64>,
    pub mean: f64,
    /// Poses for which the mended equations and the library count differently.
    pub disagreements: usize,
}

/// A returned joint vector is right below this error of the pose's entries: wrong ones are off by
/// centimetres.
const RIGHT: f64 = 1e-6;
/// The joints that made a pose are found below this difference, rad.
const SAME_JOINTS_RAD: f64 = 1e-5;

const VARIANTS: [(&str, Mended, f64); 4] = {
    const fn mended(equation_11: bool, indices: bool, sign_of_r1: bool) -> Mended {
        Mended {
            equation_11,
            indices,
            sign_of_r1,
        }
    }
    [
        ("as printed", mended(false, false, false), 0.0),
        ("equation 11 mended", mended(true, false, false), 0.486),
        (
            "equation 11 and the indices of 36 mended",
            mended(true, true, false),
            0.913,
        ),
        ("equation 11 mended, r1 signed", Mended::ALL, 1.0),
    ]
};

/// Tries all variants on `count` random poses.
pub(super) fn evaluate(
    count: usize,
    watch: &Watch<'_>,
) -> Result<(Vec<VariantReport>, CountReport), Interrupted> {
    let geometry = UrGeometry::UR3;
    let arm = Arm::<f64>::of(&geometry);
    let mut random = SplitMix64::new(super::equations::SEED + 1);
    let mut tallies = [[0_usize; 3]; VARIANTS.len()];
    let mut by_count = [0_usize; Configuration::ALL.len() + 1];
    let mut disagreements = 0;
    for _ in 0..count {
        watch.check()?;
        let made_of = PoseSet::Generic.sample(&geometry, &mut random, 0.0);
        let pose = geometry.base_from_flange(&made_of);
        let matrix = pose.to_homogeneous();
        let target = Target::of(&matrix);
        let solutions = closed_form(&geometry, &pose, None).solutions().count();
        by_count[solutions] += 1;
        for ((_, mended, _), [returned, right, found]) in VARIANTS.iter().zip(&mut tallies) {
            let rows = solve(&arm, &target, *mended);
            let mut has_found = false;
            for joints in rows.iter().flatten() {
                *returned += 1;
                let reached = arm.base_from_flange(joints);
                *right += usize::from(largest_entry(&reached, &matrix) < RIGHT);
                has_found |= same_joints(joints, &made_of);
            }
            *found += usize::from(has_found);
            if *mended == Mended::ALL && rows.iter().flatten().count() != solutions {
                disagreements += 1;
            }
        }
    }
    let variants = VARIANTS
        .iter()
        .zip(tallies)
        .map(
            |(&(name, _, expected), [returned, right, found])| VariantReport {
                name,
                returned,
                right: right as f64 / returned.max(1) as f64,
                finds_the_joints: found as f64 / count.max(1) as f64,
                expected,
            },
        )
        .collect();
    let total: usize = by_count
        .iter()
        .enumerate()
        .map(|(n, poses)| n * poses)
        .sum();
    let counts = CountReport {
        poses: count,
        share_by_count: by_count
            .iter()
            .enumerate()
            .filter(|(_, poses)| **poses > 0)
            .map(|(n, poses)| (n, *poses as f64 / count as f64))
            .collect(),
        mean: total as f64 / count.max(1) as f64,
        disagreements,
    };
    Ok((variants, counts))
}

/// Whether two joint vectors are the same but for whole turns.
pub fn same_joints(a: &[f64; 6], b: &Joints) -> bool {
    a.iter()
        .zip(b.iter())
        .all(|(a, b)| angle_error(*a, *b) < SAME_JOINTS_RAD)
}
