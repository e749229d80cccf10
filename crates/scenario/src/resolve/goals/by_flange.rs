//! Goals by a pose of the flange.

use std::collections::BTreeMap;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::{Pose, pose_from_rotation_vector};

use super::checks::{true_target, unseen_entry};
use super::needle_path::with_needle;
use super::{Goal, Roll, Surroundings};
use crate::scenario::GoalSection;

pub(super) fn from_flange_pose(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
) -> Result<Goal, Finding> {
    for (name, given) in [
        ("entry_mm", section.entry_mm.is_some()),
        ("entry_direction_deg", section.entry_direction_deg.is_some()),
        ("target_mm", section.target_mm.is_some()),
        ("lesion", section.lesion.is_some()),
        ("target_offset_mm", section.target_offset_mm.is_some()),
        ("roll_deg", section.roll_deg.is_some()),
    ] {
        if given {
            return Err(text
                .finding(&key(name), format!("`{name}` contradicts `flange_pose`"))
                .hint("a goal is either entry and target, or a flange pose"));
        }
    }
    let pose = section.flange_pose.as_ref().expect("checked by the caller");
    let Some(insertion_length_mm) = section.insertion_length_mm else {
        return Err(text
            .finding(
                &key("insertion_length_mm"),
                "a flange pose needs `insertion_length_mm`",
            )
            .hint("the distance from the guide's exit to the needle tip"));
    };
    let base_from_flange = pose_from_rotation_vector(
        Vector3::from(pose.position_mm) * 1e-3,
        Vector3::from(pose.rotation_vector_rad),
    );
    let world_from_guide_exit = surroundings.robot.world_from_base()
        * base_from_flange
        * surroundings.tool.flange_from_guide_exit;
    let exit = Point3::from(world_from_guide_exit.translation.vector);
    let axis = UnitVector3::new_normalize(world_from_guide_exit.rotation * Vector3::z());
    let insertion_length_m = insertion_length_mm * 1e-3;
    let target_m = exit + axis.into_inner() * insertion_length_m;
    let mut standoff_m = None;
    let mut target_organ = None;
    let mut true_target_m = None;
    if let Some(placed) = surroundings.phantom {
        let to_phantom = placed.world_from_phantom.inverse();
        let crossing = placed.phantom.skin_intersection(
            &(to_phantom * exit),
            &UnitVector3::new_normalize(to_phantom.rotation * axis.into_inner()),
        );
        let Some((enters_m, leaves_m)) = crossing else {
            return Err(text
                .finding(&key("flange_pose"), "the guide's axis misses the phantom")
                .hint("move the phantom, or turn the flange pose"));
        };
        if !(0.0..insertion_length_m).contains(&enters_m) || leaves_m < insertion_length_m {
            return Err(text
                .finding(
                    &key("flange_pose"),
                    format!(
                        "along the guide's axis the phantom is {:.1} to {:.1} mm from the guide's \
                     exit, but the needle ends at {insertion_length_mm:.1} mm",
                        enters_m * 1e3,
                        leaves_m * 1e3
                    ),
                )
                .hint(
                    "the skin must be ahead of the guide's exit, and the needle must end inside",
                ));
        }
        let entry = exit + axis.into_inner() * enters_m;
        if !placed.phantom.is_skin_seen(&(to_phantom * entry)) {
            return Err(unseen_entry(text, &key("flange_pose")));
        }
        standoff_m = Some(enters_m);
        target_organ = placed.phantom.organ_at(&(to_phantom * target_m));
        let found = true_target(
            text,
            key,
            section,
            &placed.phantom,
            &(to_phantom * target_m),
        )?;
        true_target_m = found.map(|at| placed.world_from_phantom * at);
    } else if section.true_target_mm.is_some() {
        return Err(text
            .finding(&key("true_target_mm"), "a true target needs a [phantom]")
            .hint("it is a point of the phantom frame"));
    }
    let mut goal = Goal {
        name: section.name.clone(),
        entry_m: standoff_m.map(|distance| exit + axis.into_inner() * distance),
        target_m,
        true_target_m,
        axis,
        world_from_guide_exit,
        roll: Roll::Fixed(0.0),
        insertion_length_m,
        standoff_m,
        approach_m: section.approach_mm * 1e-3,
        lesion: None,
        target_organ,
        aim_m: Vector3::zeros(),
        needle_path: None,
        expected: BTreeMap::new(),
    };
    if let Some(tissue) = surroundings.needle {
        if tissue.needle.is_aimed {
            let message = format!(
                "the axis of goal `{}` is given by its `flange_pose`",
                goal.name
            );
            let finding = text.finding(&format!("{}.aim", tissue.place), message);
            return Err(finding.hint("leave `aim` out, or give the goal an entry and a target"));
        }
        let placed = surroundings.phantom;
        let to_phantom =
            placed.map_or_else(Pose::identity, |placed| placed.world_from_phantom.inverse());
        let phantom = placed.map(|placed| &*placed.phantom);
        goal = with_needle(text, tissue, phantom, goal, &to_phantom)?;
    }
    Ok(goal)
}
