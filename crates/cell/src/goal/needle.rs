//! A goal by entry and target.

use std::collections::BTreeMap;

use nalgebra::{Point3, UnitVector3, Vector3};

use super::{Goal, Roll, Surroundings, check_length, guide_frame, organ_at};
use crate::phantom::Phantom;
use crate::scenario::GoalSection;
use crate::toml_text::TomlText;
use crate::{Finding, nearest_name};

/// Distance from the skin within which an entry point is moved onto it along the needle.
const ENTRY_TOLERANCE_M: f64 = 5e-3;

/// What both ends of a needle are found with.
struct Ends<'a> {
    text: &'a TomlText<'a>,
    key: &'a dyn Fn(&str) -> String,
    section: &'a GoalSection,
    phantom: &'a Phantom,
}

pub(super) fn from_entry_and_target(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
    notes: &mut Vec<String>,
) -> Result<Goal, Finding> {
    let Some(placed) = surroundings.phantom else {
        return Err(text
            .finding(
                &key("entry_mm"),
                "a goal by entry and target needs a [phantom]",
            )
            .hint("add a [phantom] section, or give `flange_pose`"));
    };
    let phantom = &placed.phantom;
    let ends = Ends {
        text,
        key,
        section,
        phantom,
    };
    let (target, lesion) = ends.target()?;
    let (on_skin, axis) = ends.entry(&target, notes)?;
    check_length(text, &key("standoff_mm"), section.standoff_mm, 0.0, 200.0)?;
    check_length(text, &key("approach_mm"), section.approach_mm, 0.0, 500.0)?;
    let standoff_m = section.standoff_mm * 1e-3;
    let exit = on_skin - axis.into_inner() * standoff_m;
    let to_target_m = (target - exit).norm();
    let insertion_length_m = match section.insertion_length_mm {
        None => to_target_m,
        Some(length_mm) => {
            check_length(text, &key("insertion_length_mm"), length_mm, 1.0, 500.0)?;
            length_mm * 1e-3
        }
    };
    if insertion_length_m <= standoff_m {
        return Err(text
            .finding(
                &key("insertion_length_mm"),
                format!(
                    "the needle would end {:.1} mm before the skin",
                    (standoff_m - insertion_length_m) * 1e3
                ),
            )
            .hint("the insertion length counts from the guide's exit, stand-off included"));
    }
    let world = &placed.world_from_phantom;
    Ok(Goal {
        name: section.name.clone(),
        entry_m: Some(world * on_skin),
        target_m: world * target,
        axis: UnitVector3::new_normalize(world.rotation * axis.into_inner()),
        world_from_guide_exit: world * guide_frame(&exit, &axis),
        roll: section
            .roll_deg
            .map_or(Roll::Free, |deg| Roll::Fixed(deg.to_radians())),
        insertion_length_m,
        standoff_m: Some(standoff_m),
        approach_m: section.approach_mm * 1e-3,
        target_organ: organ_at(phantom, &target),
        lesion,
        expected: BTreeMap::new(),
    })
}

impl Ends<'_> {
    /// The target in the phantom frame, and the lesion that it belongs to.
    fn target(&self) -> Result<(Point3<f64>, Option<String>), Finding> {
        let (target_key, target, lesion) = match (&self.section.target_mm, &self.section.lesion) {
            (Some(_), Some(_)) => {
                return Err(self
                    .text
                    .finding(&(self.key)("lesion"), "`lesion` contradicts `target_mm`"));
            }
            (Some(mm), None) => ("target_mm", point(*mm), None),
            (None, Some(name)) => {
                let Some(lesion) = self
                    .phantom
                    .lesions
                    .iter()
                    .find(|lesion| lesion.name == *name)
                else {
                    let names: Vec<&str> = self
                        .phantom
                        .lesions
                        .iter()
                        .map(|lesion| lesion.name.as_str())
                        .collect();
                    return Err(self
                        .text
                        .finding(
                            &(self.key)("lesion"),
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
                return Err(self.text.finding(
                    &(self.key)("target_mm"),
                    format!(
                        "goal `{}` has neither `target_mm` nor `lesion`",
                        self.section.name
                    ),
                ));
            }
        };
        let (target_key, target) = match self.section.target_offset_mm {
            Some(offset_mm) => ("target_offset_mm", target + point(offset_mm).coords),
            None => (target_key, target),
        };
        let depth_m = self.phantom.skin_signed_depth(&target);
        if depth_m <= 0.0 {
            return Err(self
            .text
            .finding(
                &(self.key)(target_key),
                format!(
                    "the target lies {:.1} mm outside the phantom",
                    -depth_m * 1e3
                ),
            )
            .hint(
                "points are in the phantom frame: left, posterior, superior, from mid-chest, in mm",
            ));
        }
        Ok((target, lesion))
    }

    /// Where the needle meets the skin, and its direction of insertion, in the phantom frame.
    fn entry(
        &self,
        target: &Point3<f64>,
        notes: &mut Vec<String>,
    ) -> Result<(Point3<f64>, UnitVector3<f64>), Finding> {
        match (self.section.entry_mm, self.section.entry_direction_deg) {
            (Some(_), Some(_)) => Err(self
                .text
                .finding(
                    &(self.key)("entry_direction_deg"),
                    "`entry_direction_deg` contradicts `entry_mm`",
                )
                .hint("one of them says where the needle comes from")),
            (Some(entry_mm), None) => self.entry_by_point(entry_mm, target, notes),
            (None, Some(direction_deg)) => self.entry_by_direction(direction_deg, target),
            (None, None) => Err(self
                .text
                .finding(
                    &(self.key)("entry_mm"),
                    format!("goal `{}` has no `entry_mm`", self.section.name),
                )
                .hint(
                    "a goal needs `entry_mm` or `entry_direction_deg`, and `target_mm` or `lesion`; or a \
                     `flange_pose`",
                )),
        }
    }

    fn entry_by_direction(
        &self,
        direction_deg: [f64; 2],
        target: &Point3<f64>,
    ) -> Result<(Point3<f64>, UnitVector3<f64>), Finding> {
        let [azimuth_deg, elevation_deg] = direction_deg;
        let key = (self.key)("entry_direction_deg");
        if azimuth_deg.abs() > 360.0 || elevation_deg.abs() > 90.0 {
            return Err(self
                .text
                .finding(
                    &key,
                    format!(
                        "azimuth {azimuth_deg} and elevation {elevation_deg} deg are no direction"
                    ),
                )
                .hint("azimuth -180 to 180, elevation -90 to 90, in degrees"));
        }
        let outward = outward_direction(azimuth_deg, elevation_deg);
        // The target is inside, so the line leaves the skin ahead of it.
        let Some((_, leaves_m)) = self
            .phantom
            .skin_intersection(target, &outward)
            .filter(|(_, leaves_m)| *leaves_m > 0.0)
        else {
            return Err(self.text.finding(
                &key,
                "the line from the target in this direction misses the skin",
            ));
        };
        Ok((target + outward.into_inner() * leaves_m, -outward))
    }

    fn entry_by_point(
        &self,
        entry_mm: [f64; 3],
        target: &Point3<f64>,
        notes: &mut Vec<String>,
    ) -> Result<(Point3<f64>, UnitVector3<f64>), Finding> {
        let entry = point(entry_mm);
        let Some(axis) = UnitVector3::try_new(target - entry, 1e-4) else {
            return Err(self
                .text
                .finding(
                    &(self.key)("entry_mm"),
                    "entry and target are the same point",
                )
                .hint("the needle's direction is from entry to target"));
        };
        // The target is inside, so the line through it crosses the skin.
        let Some((enters_m, leaves_m)) = self.phantom.skin_intersection(&entry, &axis) else {
            return Err(self.text.finding(
                &(self.key)("entry_mm"),
                "the line from entry to target misses the skin",
            ));
        };
        if enters_m.abs() > ENTRY_TOLERANCE_M {
            let skin = (entry + axis.into_inner() * enters_m).coords * 1e3;
            return Err(self
                .text
                .finding(
                    &(self.key)("entry_mm"),
                    format!(
                        "the entry point is {:.1} mm {} the skin along the needle",
                        enters_m.abs() * 1e3,
                        if enters_m > 0.0 { "before" } else { "inside" }
                    ),
                )
                .hint(format!(
                    "{}the line meets the skin at [{:.1}, {:.1}, {:.1}]",
                    if entry_mm.iter().all(|value| value.abs() < 1.0) {
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
            return Err(self
            .text
            .finding(
                &(self.key)("entry_mm"),
                format!(
                    "the needle would leave the skin {:.1} mm after its entry and pierce it again \
                     before the target",
                    (leaves_m - enters_m) * 1e3
                ),
            )
            .hint("choose an entry on the target's side of the fold"));
        }
        if enters_m.abs() > 1e-6 {
            notes.push(format!(
                "goal `{}`: the entry point was moved {:.2} mm along the needle onto the skin",
                self.section.name,
                enters_m * 1e3
            ));
        }
        Ok((entry + axis.into_inner() * enters_m, axis))
    }
}

fn point(mm: [f64; 3]) -> Point3<f64> {
    Point3::from(Vector3::from(mm) * 1e-3)
}

/// Direction from the target towards the entry in the phantom frame (left, posterior, superior), by
/// azimuth about the superior axis, from anterior towards the patient's left, and elevation towards
/// superior, deg.
fn outward_direction(azimuth_deg: f64, elevation_deg: f64) -> UnitVector3<f64> {
    let (sin_a, cos_a) = azimuth_deg.to_radians().sin_cos();
    let (sin_e, cos_e) = elevation_deg.to_radians().sin_cos();
    UnitVector3::new_normalize(Vector3::new(sin_a * cos_e, -cos_a * cos_e, sin_e))
}
