//! What a goal must not be, and where points lie.

use nalgebra::Point3;
use needlebench_input::{Finding, TomlText};
use needlebench_phantom::{Phantom, Tissue};

use super::{Goal, Surroundings};
use crate::resolve::phantom::Corners;
use crate::scenario::GoalSection;

/// Farthest that a lesion may be from where it was planned to be, m. Assumed: twenty times what needle robots are off by
/// at most; beyond, it is another lesion, another frame or another unit.
const FARTHEST_TRUE_TARGET_M: f64 = 0.05;

/// Where the lesion really is, if that is known; phantom frame, as is `planned`.
pub(super) fn true_target(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    phantom: &Phantom,
    planned: &Point3<f64>,
) -> Result<Option<Point3<f64>>, Finding> {
    let Some(at) = section.true_target_mm else {
        return Ok(None);
    };
    let at = Point3::from(at.map(|mm| mm * 1e-3));
    let refused = |message: String| {
        let [x, y, z] = (planned.coords * 1e3).into();
        Err(text.finding(&key("true_target_mm"), message).hint(format!(
            "it is where the lesion that is aimed at really is, in the phantom frame (left, posterior, superior) in \
             mm; it is planned to be at [{x:.1}, {y:.1}, {z:.1}]"
        )))
    };
    let depth_m = phantom.skin_signed_depth(&at);
    if depth_m <= 0.0 {
        let outside_mm = -depth_m * 1e3;
        return refused(format!(
            "the true target is {outside_mm:.1} mm outside the phantom"
        ));
    }
    let apart_m = (at - planned).norm();
    if apart_m > FARTHEST_TRUE_TARGET_M {
        return refused(format!(
            "the true target is {:.1} mm from the planned one, at most {:.0} mm allowed",
            apart_m * 1e3,
            FARTHEST_TRUE_TARGET_M * 1e3
        ));
    }
    Ok(Some(at))
}

fn is_in((low, high): &Corners, point: &Point3<f64>) -> bool {
    (0..3).all(|axis| (low[axis]..=high[axis]).contains(&point[axis]))
}

pub(super) fn check_place(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    goal: &Goal,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
) -> Result<(), Finding> {
    let exit = Point3::from(goal.world_from_guide_exit.translation.vector);
    let points = [
        ("target", Some(goal.target_m)),
        ("entry", goal.entry_m),
        ("guide exit", Some(exit)),
    ];
    for (what, point) in points {
        let Some(point) = point else { continue };
        for (fixture, boxes) in surroundings.fixtures.iter().zip(surroundings.boxes) {
            if !is_in(&boxes.whole, &point) {
                continue;
            }
            let mut solids = fixture.solids.iter().zip(&boxes.solids);
            if solids.any(|(solid, corners)| is_in(corners, &point) && solid.contains(&point)) {
                let name = match what {
                    _ if section.flange_pose.is_some() => "flange_pose",
                    "target" => section.target_key(),
                    "entry" => section.entry_key(),
                    _ => "standoff_mm",
                };
                return Err(text
                    .finding(
                        &key(name),
                        format!("the {what} is inside the {}", fixture.name),
                    )
                    .hint("compare the goal with the phantom's patient position (`posture`) and location"));
            }
        }
    }
    Ok(())
}

/// Refuses a target inside a bone, unless it lies in the lesion that is there.
pub(super) fn check_target(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    goal: &Goal,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
) -> Result<(), Finding> {
    let Some(placed) = surroundings.phantom else {
        return Ok(());
    };
    let target = placed.world_from_phantom.inverse() * goal.target_m;
    let aimed_at = placed.phantom.lesions.iter().find(|lesion| {
        // Off its centre by a target offset, or not at all.
        let beyond_m = (target - lesion.center_m).norm() - 0.5 * lesion.diameter_m;
        goal.lesion.as_ref() == Some(&lesion.name)
            && (section.target_offset_mm.is_none() || beyond_m <= 0.0)
    });
    if aimed_at.is_some() {
        return Ok(());
    }
    let bone = placed
        .phantom
        .parts
        .iter()
        .filter(|part| part.tissue == Tissue::Bone)
        .find(|part| part.solid.contains(&target));
    let Some(bone) = bone else { return Ok(()) };
    let name = if section.flange_pose.is_some() {
        "flange_pose"
    } else {
        section.target_key()
    };
    Err(text
        .finding(
            &key(name),
            format!("the target is inside the bone `{}`", bone.name),
        )
        .hint("move the target, or define a lesion there if the bone is to be pierced"))
}

/// An entry where the scan cuts the body.
pub(super) fn unseen_entry(text: &TomlText<'_>, key: &str) -> Finding {
    let message = "the entry is where the scan ends: no skin was seen there";
    text.finding(key, message).hint(
        "choose an entry that the scan shows (`needlebench ct routes`), or scan with a larger field of view; the \
         scan's ends are [[phantom.cuts]]",
    )
}
