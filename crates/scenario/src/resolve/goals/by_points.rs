//! Goals by entry and target.

use std::collections::BTreeMap;

use nalgebra::{Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_input::{Finding, TomlText, nearest_name};
use needlebench_kinematics::Pose;
use needlebench_phantom::Phantom;

use super::checks::{true_target, unseen_entry};
use super::needle_path::with_needle;
use super::{Goal, Roll, Surroundings};
use crate::scenario::GoalSection;

/// Distance from the skin within which an entry point is moved onto it along the needle.
const ENTRY_TOLERANCE_M: f64 = 5e-3;

/// A goal by entry and target with its places in the phantom frame: it goes with the phantom wherever that
/// lies.
#[derive(Debug, Clone)]
pub(crate) struct GoalInPhantom(pub(super) Goal);

impl GoalInPhantom {
    /// The goal with the phantom at a place.
    pub fn placed(&self, world_from_phantom: &Pose) -> Goal {
        let Self(goal) = self;
        let axis = world_from_phantom.rotation * goal.axis.into_inner();
        Goal {
            entry_m: goal.entry_m.map(|entry| world_from_phantom * entry),
            target_m: world_from_phantom * goal.target_m,
            true_target_m: goal.true_target_m.map(|at| world_from_phantom * at),
            aim_m: world_from_phantom.rotation * goal.aim_m,
            axis: UnitVector3::new_normalize(axis),
            world_from_guide_exit: world_from_phantom * goal.world_from_guide_exit,
            ..goal.clone()
        }
    }
}

pub(super) fn from_entry_and_target(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
    notes: &mut Vec<String>,
) -> Result<GoalInPhantom, Finding> {
    let Some(placed) = surroundings.phantom else {
        return Err(text
            .finding(
                &key("entry_mm"),
                "a goal by entry and target needs a [phantom]",
            )
            .hint(
                "add the patient:\n\n    [phantom]\n    model = \"male-p50-supine\"\n\nor give `flange_pose`",
            ));
    };
    let phantom = &placed.phantom;
    let (target, lesion) = target_inside(text, key, section, phantom)?;
    if section.entry_key_given().is_none() {
        return Err(text
            .finding(
                &key("entry_mm"),
                format!("goal `{}` has no entry", section.name),
            )
            .hint(
                "add `entry_mm = [left, posterior, superior]`, a point on the skin, or `entry_direction_deg = \
                 [azimuth, elevation]` as seen from the target; `needlebench suggest` proposes some",
            ));
    }
    let (entry, axis) = entry_of(text, key, section, phantom, &target)?;
    let entry_key = section.entry_key();
    // The target is inside, so the line through it crosses the skin.
    let Some((enters_m, leaves_m)) = phantom.skin_intersection(&entry, &axis) else {
        return Err(text.finding(
            &key(entry_key),
            "the line from entry to target misses the skin",
        ));
    };
    if enters_m.abs() > ENTRY_TOLERANCE_M {
        let skin = (entry + axis.into_inner() * enters_m).coords * 1e3;
        return Err(text
            .finding(
                &key(entry_key),
                format!(
                    "the entry point is {:.1} mm {} the skin along the needle axis",
                    enters_m.abs() * 1e3,
                    if enters_m > 0.0 { "before" } else { "inside" }
                ),
            )
            .hint(format!(
                "{}the line meets the skin at [{:.1}, {:.1}, {:.1}]",
                if entry.iter().all(|value| value.abs() < 1e-3) {
                    "the point is in millimetres, not metres; "
                } else {
                    ""
                },
                skin.x,
                skin.y,
                skin.z
            )));
    }
    let to_target_m = (target - entry).norm();
    if leaves_m < to_target_m {
        return Err(text
            .finding(
                &key(entry_key),
                format!(
                    "the needle would leave the skin {:.1} mm after its entry and pierce it again \
                     before the target",
                    (leaves_m - enters_m) * 1e3
                ),
            )
            .hint("choose an entry on the target's side of the skin fold"));
    }
    if enters_m.abs() > 1e-6 {
        notes.push(format!(
            "goal `{}`: the entry point was moved {:.3} mm along the needle axis onto the skin",
            section.name,
            enters_m * 1e3
        ));
    }
    let on_skin = entry + axis.into_inner() * enters_m;
    if !phantom.is_skin_seen(&on_skin) {
        return Err(unseen_entry(text, &key(entry_key)));
    }
    let standoff_m = section.standoff_mm * 1e-3;
    let exit = on_skin - axis.into_inner() * standoff_m;
    let to_target_m = (target - exit).norm();
    let insertion_length_m = section
        .insertion_length_mm
        .map_or(to_target_m, |length_mm| length_mm * 1e-3);
    if insertion_length_m <= standoff_m {
        return Err(text
            .finding(
                &key("insertion_length_mm"),
                format!(
                    "the needle would end {:.1} mm before the skin",
                    (standoff_m - insertion_length_m) * 1e3
                ),
            )
            .hint(
                "the insertion length is measured from the guide's exit and includes the stand-off",
            ));
    }
    let guide_exit = guide_frame(&exit, &axis);
    let mut goal = Goal {
        name: section.name.clone(),
        entry_m: Some(on_skin),
        target_m: target,
        true_target_m: true_target(text, key, section, phantom, &target)?,
        axis,
        world_from_guide_exit: guide_exit,
        roll: section
            .roll_deg
            .map_or(Roll::Free, |deg| Roll::Fixed(deg.to_radians())),
        insertion_length_m,
        standoff_m: Some(standoff_m),
        approach_m: section.approach_mm * 1e-3,
        target_organ: phantom.organ_at(&target),
        lesion,
        aim_m: Vector3::zeros(),
        needle_path: None,
        expected: BTreeMap::new(),
    };
    if let Some(tissue) = surroundings.needle {
        goal = with_needle(text, tissue, Some(phantom), goal, &Pose::identity())?;
    }
    Ok(GoalInPhantom(goal))
}

/// Point of the phantom frame.
fn point(mm: [f64; 3]) -> Point3<f64> {
    Point3::from(Vector3::from(mm) * 1e-3)
}

/// The target, inside the phantom and in its frame, and the lesion that it is.
pub(crate) fn target_inside(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    phantom: &Phantom,
) -> Result<(Point3<f64>, Option<String>), Finding> {
    let (target_key, target, lesion) = target_of(text, key, section, phantom)?;
    let depth_m = phantom.skin_signed_depth(&target);
    if depth_m > 0.0 {
        return Ok((target, lesion));
    }
    let message = format!("the target is {:.1} mm outside the phantom", -depth_m * 1e3);
    Err(text
        .finding(&key(target_key), message)
        .hint("points are in the phantom frame: left, posterior, superior, from mid-chest, in mm"))
}

/// The key that decides the target, the target in the phantom frame, and the lesion that it is.
fn target_of(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    phantom: &Phantom,
) -> Result<(&'static str, Point3<f64>, Option<String>), Finding> {
    let (key_name, at, lesion) = match (&section.target_mm, &section.lesion) {
        (Some(_), Some(_)) => {
            return Err(text.finding(&key("lesion"), "`lesion` contradicts `target_mm`"));
        }
        (Some(mm), None) => ("target_mm", point(*mm), None),
        (None, Some(name)) => {
            let Some(lesion) = phantom.lesions.iter().find(|lesion| lesion.name == *name) else {
                let names: Vec<&str> = phantom
                    .lesions
                    .iter()
                    .map(|lesion| lesion.name.as_str())
                    .collect();
                return Err(text
                    .finding(
                        &key("lesion"),
                        format!("the phantom has no lesion `{name}`"),
                    )
                    .hint(match nearest_name(name, names.iter().copied()) {
                        Some(near) => format!("did you mean `{near}`?"),
                        None if names.is_empty() => {
                            "it has none: give `target_mm`, or a part with the tissue lesion"
                                .to_owned()
                        }
                        None => format!("it has {}", names.join(", ")),
                    }));
            };
            ("lesion", lesion.center_m, Some(name.clone()))
        }
        (None, None) => {
            let lesion = phantom
                .lesions
                .first()
                .map_or("NAME", |lesion| &lesion.name);
            return Err(text
                .finding(
                    &key("target_mm"),
                    format!(
                        "goal `{}` has neither `target_mm` nor `lesion`",
                        section.name
                    ),
                )
                .hint(format!(
                    "add `lesion = \"{lesion}\"`, or `target_mm = [left, posterior, superior]` in mm from mid-chest"
                )));
        }
    };
    Ok(match section.target_offset_mm {
        None => (key_name, at, lesion),
        Some(offset_mm) => ("target_offset_mm", at + point(offset_mm).coords, lesion),
    })
}

/// Where the needle is to enter, as the scenario has it, and its direction; phantom frame.
fn entry_of(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    phantom: &Phantom,
    target: &Point3<f64>,
) -> Result<(Point3<f64>, UnitVector3<f64>), Finding> {
    const DIRECTION: &str = "entry_direction_deg";
    match (section.entry_mm, section.entry_direction_deg) {
        (Some(entry_mm), None) => {
            let entry = point(entry_mm);
            let axis = UnitVector3::try_new(target - entry, 1e-4).ok_or_else(|| {
                text.finding(&key("entry_mm"), "entry and target are the same point")
                    .hint("the needle's direction is from entry to target")
            })?;
            Ok((entry, axis))
        }
        (None, Some([azimuth_deg, elevation_deg])) => {
            let outwards = direction(azimuth_deg.to_radians(), elevation_deg.to_radians());
            let Some((_, leaves_m)) = phantom.skin_intersection(target, &outwards) else {
                return Err(text.finding(
                    &key(DIRECTION),
                    "the line from the target in this direction misses the skin",
                ));
            };
            Ok((target + outwards.into_inner() * leaves_m, -outwards))
        }
        (Some(_), Some(_)) => Err(text
            .finding(
                &key(DIRECTION),
                format!("`{DIRECTION}` contradicts `entry_mm`"),
            )
            .hint("the entry is a point, or where a direction from the target leaves the skin")),
        (None, None) => unreachable!("checked by the caller"),
    }
}

/// From a target outwards, phantom frame (left, posterior, superior): azimuth about the superior axis
/// from anterior towards the patient's left, elevation towards superior.
pub fn direction(azimuth_rad: f64, elevation_rad: f64) -> UnitVector3<f64> {
    let (azimuth_sine, azimuth_cosine) = libm::sincos(azimuth_rad);
    let (elevation_sine, elevation_cosine) = libm::sincos(elevation_rad);
    UnitVector3::new_normalize(Vector3::new(
        elevation_cosine * azimuth_sine,
        -elevation_cosine * azimuth_cosine,
        elevation_sine,
    ))
}

/// Guide frame at roll 0 in the phantom frame: z along the needle, x as near to the head as it gets
/// (to the patient's left for a needle along the body).
fn guide_frame(exit: &Point3<f64>, axis: &UnitVector3<f64>) -> Pose {
    let towards = if axis.z.abs() < 0.99 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let y = axis.cross(&towards).normalize();
    let x = y.cross(axis);
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&[
        x,
        y,
        axis.into_inner(),
    ]));
    Pose::from_parts(
        Translation3::from(exit.coords),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}
