//! The paper's closed form as a whole: as printed and corrected step by step, and the share of its correct answers.

use std::collections::BTreeMap;

use needlebench_kinematics::ik::closed_form;
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::{Joints, UrGeometry};
use needlebench_numerics::random::SplitMix64;
use serde::Serialize;

use super::Watch;
use super::closed_form::{Mended, solve};
use super::dh::{Arm, Target, largest_entry};
use super::equations::{SEED, angle_error};

/// Results of a variant of the closed form on random poses.
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

/// Numbers of solutions of random poses.
#[derive(Debug, Clone, Serialize)]
pub struct CountReport {
    pub poses: usize,
    /// Share of poses with this many solutions, 0 to 1, by the library's closed form.
    pub share_by_count: BTreeMap<usize, f64>,
    pub mean: f64,
    /// Poses for which the corrected equations and the library count differently.
    pub disagreements: usize,
}

/// A returned joint vector is correct below this error of the pose entries: wrong ones have errors of
/// centimetres.
const RIGHT: f64 = 1e-6;
/// The joints of a pose count as found below this difference, rad.
const SAME_JOINTS_RAD: f64 = 1e-5;

/// Name, whether equation 11, the indices and the sign of `r1` are corrected, and the errata's share.
const VARIANTS: [(&str, [bool; 3], f64); 4] = [
    ("as printed", [false, false, false], 0.0),
    ("equation 11 corrected", [true, false, false], 0.486),
    (
        "equation 11 and the indices of 36 corrected",
        [true, true, false],
        0.913,
    ),
    ("equation 11 corrected, r1 signed", [true, true, true], 1.0),
];

/// Tries all variants on `count` random poses.
pub fn evaluate(count: usize, watch: &Watch<'_>) -> (Vec<VariantReport>, CountReport) {
    let (geometry, arm) = (UrGeometry::UR3, Arm::<f64>::ur3());
    let mut random = SplitMix64::new(SEED + 1);
    let mut tallies = [[0_usize; 3]; VARIANTS.len()];
    let mut by_count = BTreeMap::<usize, usize>::new();
    let mut disagreements = 0;
    for _ in watch.each(0..count) {
        let made_of = PoseSet::Generic.sample(&geometry, &mut random, 0.0);
        let pose = geometry.base_from_flange(&made_of);
        let matrix = pose.to_homogeneous();
        let target = Target::of(&matrix);
        let solutions = closed_form(&geometry, &pose, None).solutions().count();
        *by_count.entry(solutions).or_default() += 1;
        for ((_, mended, _), [returned, right, found]) in VARIANTS.iter().zip(&mut tallies) {
            let [equation_11, indices, sign_of_r1] = *mended;
            let mended = Mended {
                equation_11,
                indices,
                sign_of_r1,
            };
            let answers: Vec<_> = solve(&arm, &target, mended).into_iter().flatten().collect();
            let is_right =
                |joints: &&[f64; 6]| largest_entry(&arm.base_from_flange(joints), &matrix) < RIGHT;
            *returned += answers.len();
            *right += answers.iter().filter(is_right).count();
            *found += usize::from(answers.iter().any(|joints| same_joints(joints, &made_of)));
            disagreements += usize::from(mended == Mended::ALL && answers.len() != solutions);
        }
    }
    let of_poses = |part: usize| part as f64 / count.max(1) as f64;
    let variants = VARIANTS.iter().zip(tallies);
    let variants = variants.map(
        |(&(name, _, expected), [returned, right, found])| VariantReport {
            name,
            returned,
            right: right as f64 / returned.max(1) as f64,
            finds_the_joints: of_poses(found),
            expected,
        },
    );
    let counts = CountReport {
        poses: count,
        mean: of_poses(by_count.iter().map(|(n, poses)| n * poses).sum()),
        share_by_count: by_count
            .into_iter()
            .map(|(n, poses)| (n, of_poses(poses)))
            .collect(),
        disagreements,
    };
    (variants.collect(), counts)
}

/// Whether two joint vectors are 2 pi equivalents.
pub fn same_joints(a: &[f64; 6], b: &Joints) -> bool {
    let mut pairs = a.iter().zip(b.iter());
    pairs.all(|(a, b)| angle_error(*a, *b) < SAME_JOINTS_RAD)
}
