//! The cell as a model of MuJoCo.

use needlebench_cell::Frame;
use needlebench_engine::ArmSpec;
use needlebench_engine::mujoco::{Keyframe, MarkedPlace, StandaloneModel, standalone_model};
use needlebench_kinematics::JOINT_COUNT;
use needlebench_scenario::ResolvedScenario;

use crate::head::{head, xml_comment};
use crate::marks::marks;
use crate::postures::named_postures;
use crate::{ExportError, ExportedFile, MovesWith};

/// The cell as an MJCF model that loads alone: the very one that the engine steps, with a motor for each joint, the
/// joints' limits, the postures of start and goals as keyframes whose torques hold the arm, and marked places.
///
/// # Errors
/// [`ExportError::Engine`] for a cell that MuJoCo cannot have.
pub fn mjcf(resolved: &ResolvedScenario, stem: &str) -> Result<Vec<ExportedFile>, ExportError> {
    let cell = &resolved.cell;
    let dynamics = cell.dynamics();
    let keyframes = named_postures(resolved)?
        .into_iter()
        .map(|posture| Keyframe {
            name: posture.name,
            position: posture.joints,
            torque_nm: dynamics.gravity_torque(&posture.joints),
        });
    let mut lines = head(resolved, "The whole cell as a model of MuJoCo");
    lines.extend(REMARKS.map(str::to_owned));
    let standalone = StandaloneModel {
        name: resolved.scenario.name.clone(),
        comment: xml_comment(&lines),
        keyframes: keyframes.collect(),
        sites: sites(resolved),
    };
    let settings = resolved.scenario.engines.settings();
    let arm = ArmSpec::new(cell, &settings);
    let model = standalone_model(&arm, &standalone)?;
    Ok(vec![ExportedFile::text(format!("{stem}.xml"), model)])
}

/// What the model is, for who opens it.
const REMARKS: [&str; 6] = [
    "Collision geometry is that of clearances and engines: primitives and convex pieces. Only \
     pairs that needlebench measures can collide, as set by contype and conaffinity.",
    "Motors are ideal joint torques within the arm's limits; ctrl of a keyframe compensates \
     gravity there. No servo, no friction, no backlash.",
    "Joint limits are hard stops of the model; a real arm stops before them. The engine of \
     needlebench has no stops.",
    "Contacts are as stiff as the time step allows; a longer step requires a softer solref.",
    "Keyframes of goals are the postures that a plan tries first; a run determines whether a \
     motion to them is feasible.",
    "The access zone (needle_corridor) is a geom without collisions. Inner organs are omitted.",
];

/// Marked places, in the frames of the model's bodies.
fn sites(resolved: &ResolvedScenario) -> Vec<MarkedPlace> {
    let robot = &resolved.cell.robot;
    let base = MarkedPlace {
        name: "base_link".to_owned(),
        frame: Frame::World,
        frame_from_site: robot.world_from_base_link,
    };
    let rest = marks(resolved).into_iter().map(|mark| {
        let (frame, frame_from_site) = match mark.frame {
            MovesWith::World | MovesWith::Base => (Frame::World, mark.place),
            MovesWith::Link(link) => (Frame::Link(link), mark.place),
            MovesWith::Flange => (
                Frame::Link(JOINT_COUNT - 1),
                robot.chain.wrist_3_from_flange * mark.place,
            ),
        };
        MarkedPlace {
            name: mark.name,
            frame,
            frame_from_site,
        }
    });
    std::iter::once(base).chain(rest).collect()
}
