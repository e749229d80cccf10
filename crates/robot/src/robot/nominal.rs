//! An arm's own URDF as a stand-in for what another URDF lacks, and as a yardstick for its limits.

use std::sync::Arc;

use needlebench_cell::Robot;
use needlebench_input::{Finding, PackagePaths};
use needlebench_kinematics::{Body, Chain, JOINT_COUNT, JointLimit, JointLimits, Joints, Pose};

use super::{MissingInertia, read_robot};
use crate::LoadedRobot;
use crate::arm::Arm;

/// The arm by its own URDF.
pub(crate) fn nominal_robot(
    arm: &Arc<Arm>,
    packages: &PackagePaths,
) -> Result<LoadedRobot, Finding> {
    read_robot(
        &arm.urdf(),
        packages,
        &MissingInertia::Error,
        Pose::identity(),
        Some(arm),
        None,
    )
}

/// Mass properties of moving link `index` of `nominal`, in the frame of the same link of `chain`.
///
/// Two descriptions of one arm may place and turn their link frames differently. At zero angles
/// the links are in the same place, whatever their frames.
pub(crate) fn body_in_frame_of(chain: &Chain, nominal: &Robot, index: usize) -> Body {
    let zero = Joints::zeros();
    let base_from_link = chain.link_poses(&zero)[index];
    let base_from_nominal_link = nominal.chain.link_poses(&zero)[index];
    nominal.bodies[index].transformed(&(base_from_link.inverse() * base_from_nominal_link))
}

/// One kind of limit.
type Limit = fn(&JointLimit) -> f64;

/// Says which limits of a URDF are not those of the arm that it is of: margins and criteria are
/// measured by them.
pub(crate) fn notes_on_limits(
    limits: &JointLimits,
    whose: &str,
    nominal: &JointLimits,
) -> Vec<String> {
    let list = |values: [f64; JOINT_COUNT]| values.map(|value| format!("{value}")).join(", ");
    let kinds: [(&str, &str, Limit); 2] = [
        ("effort", "N m", |limit| limit.effort_nm),
        ("velocity", "rad/s", |limit| limit.velocity_rad_s),
    ];
    kinds
        .into_iter()
        .filter_map(|(name, unit, limit)| {
            let [stated, usual] = [limits, nominal].map(|each| each.0.each_ref().map(limit));
            let differ = stated
                .iter()
                .zip(&usual)
                .any(|(stated, usual)| (stated - usual).abs() > 0.01 * usual);
            differ.then(|| {
                format!(
                    "URDF {name} limits used: {} {unit}; {whose} are {}",
                    list(stated),
                    list(usual.map(rounded))
                )
            })
        })
        .collect()
}

/// To four decimals, for messages.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() * 1e-4
}
