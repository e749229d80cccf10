//! What is left free by a needle's line: the roll about it.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use needlebench_kinematics::ik::closed_form;
use needlebench_kinematics::{Pose, UrGeometry};

use super::dh::{Arm, origin, rotation};
use super::free_space::{RollReport, lowest_joint_m, resolve};
use super::printed::TABLE_3;
use super::{PaperError, Watch};

/// Rolls tried about the needle.
const ROLL_STEPS: usize = 360;

/// Tools that hold the needle in different ways.
const TOOLS: [&str; 3] = ["offset", "perpendicular", "inline"];

/// What roll about the needle of the paper's pose changes, for every shipped tool.
pub(super) fn evaluate(watch: &Watch<'_>) -> Result<Vec<RollReport>, PaperError> {
    let geometry = UrGeometry::UR3;
    let arm = Arm::<f64>::ur3();
    let exact = arm.base_from_flange(&TABLE_3[0].joints_rad);
    let turn = Rotation3::from_matrix_unchecked(rotation(&exact));
    let base_from_flange = Pose::from_parts(
        origin(&exact).into(),
        UnitQuaternion::from_rotation_matrix(&turn),
    );
    let mut reports = Vec::new();
    for name in TOOLS {
        let tool = resolve(name)?.cell.tool;
        let flange_from_guide = tool.flange_from_guide_exit;
        let base_from_guide = base_from_flange * flange_from_guide;
        let (mut fewest, mut most) = (usize::MAX, 0);
        let (mut worst, mut best) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut ranges: BTreeMap<&str, [[f64; 2]; 5]> = BTreeMap::new();
        for step in 0..ROLL_STEPS {
            watch.check()?;
            let roll_rad = TAU * step as f64 / ROLL_STEPS as f64;
            let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll_rad);
            let wanted = base_from_guide * turned * flange_from_guide.inverse();
            let found: Vec<_> = closed_form(&geometry, &wanted, None).solutions().collect();
            fewest = fewest.min(found.len());
            most = most.max(found.len());
            for solution in found {
                let joints: [f64; 6] = solution.joints.into();
                worst = worst.min(lowest_joint_m(&joints));
                best = best.max(lowest_joint_m(&joints));
                let range = ranges
                    .entry(solution.configuration.label())
                    .or_insert_with(|| std::array::from_fn(|joint| [joints[joint]; 2]));
                for (range, joint) in range.iter_mut().zip(joints) {
                    *range = [range[0].min(joint), range[1].max(joint)];
                }
            }
        }
        let other_joints_move_rad = ranges
            .values()
            .flatten()
            .map(|[low, high]| high - low)
            .fold(0.0, f64::max);
        reports.push(RollReport {
            tool: tool.name,
            steps: ROLL_STEPS,
            fewest_solutions: fewest,
            most_solutions: most,
            lowest_joint_worst_m: worst,
            lowest_joint_best_m: best,
            other_joints_move_rad,
            // Rounding of the closed form, nothing else.
            roll_is_wrist_3: other_joints_move_rad < 1e-9,
        });
    }
    Ok(reports)
}
