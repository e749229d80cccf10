//! Free space, line of sight and hand cone of a configuration.

use needlebench_evaluation::room::{RoomModel, RoomReport};
use needlebench_kinematics::Joints;
use needlebench_report::page::shared;
use serde::Serialize;
use serde_json::Value;

use crate::case::Case;
use crate::live::{Aim, Refusal, registered};
use crate::plan_file::{PLAN_FILE, planned};

/// The people at a needle, and the space and line of sight that a posture leaves to them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PeopleAnswer {
    /// As a run of the plan reports it for this posture.
    pub room: RoomReport,
    /// Who stands where, lines of sight and the guide's place, for the view in three dimensions.
    pub view: Value,
}

/// Measures a posture for the people of the plan, who stand where this needle needs them.
///
/// # Errors
/// As [`planned`]; invalid joints; a robot whose position is unknown.
pub fn people(case: &Case, aim: &Aim, joints_rad: &[f64; 6]) -> Result<PeopleAnswer, Refusal> {
    /// Beyond all joints' limits, rad.
    const FAR_RAD: f64 = 10.0;
    registered(case)?;
    if !joints_rad.iter().all(|joint| joint.abs() < FAR_RAD) {
        return Err(Refusal::new(
            "joints need six finite numbers, rad",
            "send those of the planned motion",
        ));
    }
    let plan = planned(case, aim, None, None, &case.folder().join(PLAN_FILE))?;
    let model = RoomModel::new(&plan.resolved);
    let q = Joints::from_column_slice(joints_rad);
    Ok(PeopleAnswer {
        room: model.measure(plan.goal, &q),
        view: shared::people(&plan.resolved, &model, plan.goal, &q),
    })
}
