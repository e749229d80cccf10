//! What a needle passes on its way to a goal, and to which side it bends.

use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_input::{Finding, TomlText, nearest_name};
use needlebench_kinematics::Pose;
use needlebench_phantom::{Phantom, Tissue};

use needlebench_insertion::WARNED_SLOPE;

use super::Goal;
use crate::resolve::imperfections::{Aim, Imperfections, NeedlePath, TissueNeedle};
use crate::resolve::phantom::PlacedPhantom;
use crate::scenario::{BevelFace, NeedleBlock, Scenario};

/// All bones, where what a needle may pass through is named.
const BONE: &str = "bone";

/// Least sine of the angle between a needle and a direction that its bevel is to face.
const LEAST_SINE: f64 = 0.3;

/// Where the face of a needle's bevel looks, phantom frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BevelFacing {
    /// Anywhere.
    Unknown,
    /// Clockwise from the patient's head as seen along the insertion, rad.
    Clock(f64),
    /// Along a vector.
    Along(Vector3<f64>),
    /// Towards a place, m.
    Towards(Point3<f64>),
}

/// A needle runs along what its bevel is to face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunsAlong;

impl BevelFacing {
    /// Unit vector lateral to a needle, from where it enters to where it ends (phantom frame), towards which its
    /// bevelled tip is pushed: away from the face. None where nobody knows.
    ///
    /// # Errors
    /// [`RunsAlong`].
    pub fn pushed_towards(
        &self,
        entry: &Point3<f64>,
        tip: &Point3<f64>,
    ) -> Result<Option<Vector3<f64>>, RunsAlong> {
        let faced = match self {
            Self::Unknown => return Ok(None),
            Self::Clock(angle_rad) => {
                let [twelve, three] = bevel_clock(entry, tip);
                let (sine, cosine) = libm::sincos(*angle_rad);
                twelve * cosine + three * sine
            }
            Self::Along(direction) => *direction,
            Self::Towards(place) => place - entry,
        };
        let off = across(&(tip - entry).normalize(), &faced.normalize());
        if off.norm() < LEAST_SINE {
            return Err(RunsAlong);
        }
        Ok(Some(-off.normalize()))
    }
}

fn across(axis: &Vector3<f64>, direction: &Vector3<f64>) -> Vector3<f64> {
    direction - axis * axis.dot(direction)
}

/// Twelve and three on the clock at the hub of a needle, unit vectors lateral to it (phantom frame): towards the
/// patient's head as near as the needle lets, and a quarter further as seen along the insertion.
pub fn bevel_clock(entry: &Point3<f64>, tip: &Point3<f64>) -> [Vector3<f64>; 2] {
    let axis = (tip - entry).normalize();
    let head = if axis.z.abs() < 0.99 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let twelve = across(&axis, &head).normalize();
    [twelve, axis.cross(&twelve)]
}

/// Where a bevel looks in a phantom.
pub(crate) fn bevel_facing(
    text: &TomlText<'_>,
    place: &str,
    block: &NeedleBlock,
    phantom: &Phantom,
) -> Result<BevelFacing, Finding> {
    Ok(match block.face() {
        BevelFace::Unknown => BevelFacing::Unknown,
        BevelFace::Clock(angle_rad) => BevelFacing::Clock(angle_rad),
        BevelFace::Direction(direction) => BevelFacing::Along(direction.into()),
        BevelFace::Structure(name) => {
            let middle = phantom.middle_of(name).ok_or_else(|| {
                let message = format!("`{name}` is neither a direction nor a structure of the phantom");
                let structures = phantom.parts.iter().filter(|part| part.tissue != Tissue::Marker);
                let names = structures.map(|part| part.organ.as_deref().unwrap_or(&part.name));
                let near = nearest_name(name, names);
                text.finding(&format!("{place}.bevel"), message).hint(near.map_or_else(
                    || {
                        "`unknown`, a time such as `3:00`, `superior`, `inferior`, `left`, `right`, `anterior`, \
                         `posterior`, or a structure such as `spine`"
                            .to_owned()
                    },
                    |near| format!("did you mean `{near}`?"),
                ))
            })?;
            BevelFacing::Towards(middle)
        }
    })
}

/// A needle that bends in tissue, with its block and the key of that.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InTissue<'a> {
    pub place: &'a str,
    pub block: &'a NeedleBlock,
    pub needle: &'a TissueNeedle,
}

/// The goal, in the frame that `to_phantom` is from, with the way of its needle through the phantom, and with its axis aimed
/// against the bend if that is asked for. It has no way where that is not known and nothing in the block asks for it.
pub(super) fn with_needle(
    text: &TomlText<'_>,
    tissue: InTissue<'_>,
    phantom: Option<&Phantom>,
    mut goal: Goal,
    to_phantom: &Pose,
) -> Result<Goal, Finding> {
    goal.needle_path = needle_path(text, tissue, phantom, &goal, to_phantom)?.map(Arc::new);
    let InTissue { place, needle, .. } = tissue;
    if !needle.is_aimed {
        return Ok(goal);
    }
    let aimed = |message: String, hint: &str| {
        let message = format!("goal `{}`: {message}", goal.name);
        text.finding(&format!("{place}.aim"), message).hint(hint)
    };
    let (Some(path), Some(entry)) = (goal.needle_path.as_deref(), goal.entry_m) else {
        return Ok(goal);
    };
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    let bend_m = needle.mean_bend_m(path, stand_off_m).map_err(|error| {
        let message = format!("its needle cannot be inserted: {error}");
        aimed(message, "leave `aim` out")
    })?;
    let tip_m = goal.insertion_length_m - stand_off_m;
    let to_target = goal.target_m - entry;
    if (tip_m - to_target.norm()).abs() > ENDS_AT_TARGET_M {
        let message = "its needle does not end at its target".to_owned();
        return Err(aimed(message, "leave `insertion_length_mm` out, or `aim`"));
    }
    let Some([x, y]) = needle.pushed_towards(path) else {
        return Ok(goal);
    };
    let towards = goal.world_from_guide_exit.rotation * Vector3::new(x, y, 0.0);
    let Some(aim) = Aim::new(tip_m, bend_m) else {
        let message = format!("its needle bends by {:.0} mm", bend_m * 1e3);
        return Err(aimed(message, "a stiffer needle, or leave `aim` out"));
    };
    let tilt = UnitQuaternion::from_axis_angle(
        &UnitVector3::new_normalize(goal.axis.cross(&towards)),
        -aim.tilt_rad,
    );
    let rotation = tilt * goal.world_from_guide_exit.rotation;
    let axis = tilt * goal.axis;
    let exit = entry - axis.into_inner() * stand_off_m;
    let aimed = Goal {
        axis,
        world_from_guide_exit: Pose::from_parts(exit.into(), rotation),
        insertion_length_m: stand_off_m + aim.tip_m,
        aim_m: tilt * towards * -bend_m,
        ..goal
    };
    // What is passed on the aimed way; the side that the bevel looks to stays.
    let path = needle_path(text, tissue, phantom, &aimed, to_phantom)?;
    Ok(Goal {
        needle_path: path.map(Arc::new),
        ..aimed
    })
}

/// Difference of the depths of tip and target that is rounding, m.
const ENDS_AT_TARGET_M: f64 = 1e-6;

/// The way of a goal's needle through a phantom.
fn needle_path(
    text: &TomlText<'_>,
    InTissue {
        place,
        block,
        needle,
    }: InTissue<'_>,
    phantom: Option<&Phantom>,
    goal: &Goal,
    to_phantom: &Pose,
) -> Result<Option<NeedlePath>, Finding> {
    let is_asked_for = block.asks_for_tissue();
    let (Some(entry), Some(phantom)) = (goal.entry_m, phantom) else {
        if !is_asked_for {
            return Ok(None);
        }
        let message = format!(
            "goal `{}` has no patient whose tissue bends its needle",
            goal.name
        );
        let finding = text.finding(&format!("{place}.model"), message);
        return Err(
            finding.hint("add a [phantom], or `model = \"cantilever\"` for a needle in air")
        );
    };
    let [entry, tip] = [entry, tip_of(goal)].map(|at| to_phantom * at);
    let layers = match phantom.layers(&entry, &tip) {
        Ok(layers) => layers,
        Err(_) if !is_asked_for => return Ok(None),
        Err(error) => {
            let message = format!("goal `{}`: {error}", goal.name);
            let finding = text.finding(&format!("{place}.model"), message);
            return Err(finding.hint(
                "choose an entry that passes the bone: `needlebench suggest` proposes some",
            ));
        }
    };
    let depth_m = (tip - entry).norm();
    if let Some(turn_at_mm) = block.turn_at_mm.filter(|mm| mm * 1e-3 > depth_m) {
        let message = format!(
            "the needle of goal `{}` is turned at {turn_at_mm} mm, but ends {:.1} mm behind the skin",
            goal.name,
            depth_m * 1e3
        );
        let finding = text.finding(&format!("{place}.turn_at_mm"), message);
        return Err(finding.hint("a depth between skin and tip"));
    }
    let facing = bevel_facing(text, place, block, phantom)?;
    let pushed_towards = facing.pushed_towards(&entry, &tip).map_err(|_| {
        let message = format!(
            "the needle of goal `{}` runs along `{}`: its bevel cannot face it",
            goal.name, block.bevel
        );
        text.finding(&format!("{place}.bevel"), message)
            .hint("choose a direction lateral to the needle, or a time such as `3:00`")
    })?;
    // Whatever the frame of the goal.
    let to_guide = (to_phantom.rotation * goal.world_from_guide_exit.rotation).inverse();
    let in_guide = |direction: Vector3<f64>| {
        let turned = to_guide * direction;
        [turned.x, turned.y]
    };
    let path = NeedlePath::new(
        layers,
        pushed_towards.map(in_guide),
        bevel_clock(&entry, &tip).map(in_guide),
    );
    Ok(Some(needle.turned(path, goal.standoff_m.unwrap_or(0.0))))
}

/// Where a goal's needle ends, in the goal's frame.
fn tip_of(goal: &Goal) -> Point3<f64> {
    let exit = goal.world_from_guide_exit.translation.vector;
    Point3::from(exit + goal.axis.into_inner() * goal.insertion_length_m)
}

/// Checks that the needles of all goals can be inserted as their scenario has them, and notes where one bends more than the
/// model is for. A scenario that does not ask for a needle in tissue bends all as in air where one cannot be inserted.
pub(crate) fn check_insertions(
    text: &TomlText<'_>,
    scenario: &Scenario,
    phantom: Option<&PlacedPhantom>,
    goals: &mut [Goal],
    found: &mut [&mut Imperfections],
    notes: &mut Vec<String>,
) -> Result<(), Finding> {
    if let Some((place, block)) = scenario.needle_in_tissue() {
        let Some(needle) = found.iter().find_map(|each| each.tissue()) else {
            return Ok(());
        };
        let off = &scenario.planning.needle_route.off;
        let each = goals
            .iter()
            .map(|goal| inserted(needle, goal, phantom, off));
        match each.collect::<Result<Vec<_>, String>>() {
            Ok(rough) => {
                notes.extend(rough.into_iter().flatten());
                return Ok(());
            }
            Err(message) if block.asks_for_tissue() => {
                let finding = text.finding(&format!("{place}.model"), message);
                return Err(finding.hint("`model = \"cantilever\"` for a needle in air"));
            }
            Err(message) => notes.push(format!(
                "{message}; needles bend as in air (`{place}.model`)"
            )),
        }
    }
    for each in found {
        each.bend_in_air();
    }
    for goal in goals {
        goal.needle_path = None;
    }
    Ok(())
}

/// Inserts the median needle of a goal: what is to be noted, or why it cannot be inserted. A goal whose way is not known has
/// no needle to insert where it is refused for the bone in it.
fn inserted(
    needle: &TissueNeedle,
    goal: &Goal,
    phantom: Option<&PlacedPhantom>,
    off: &[String],
) -> Result<Option<String>, String> {
    let Some(path) = &goal.needle_path else {
        let ways = phantom.zip(goal.entry_m).map(|(placed, entry)| {
            let to_phantom = placed.world_from_phantom.inverse();
            (placed, [entry, tip_of(goal)].map(|at| to_phantom * at))
        });
        let is_refused = ways.is_some_and(|(placed, [entry, tip])| {
            let mut bones = placed.phantom.bones_met(&entry, &tip);
            let target = placed.world_from_phantom.inverse() * goal.target_m;
            // A route may enter the bone that its lesion is in.
            let holding: Vec<&str> = match goal.lesion {
                Some(_) => placed.phantom.bones_at(&target).collect(),
                None => Vec::new(),
            };
            bones.any(|bone| {
                if holding.contains(&bone.organ.as_ref().unwrap_or(&bone.name).as_str()) {
                    return false;
                }
                let called = [Some(&bone.name), bone.organ.as_ref()];
                let is_called = |name: &String| called.contains(&Some(name)) || name == BONE;
                !off.iter().any(is_called)
            })
        });
        return if is_refused {
            Ok(None)
        } else {
            Err(format!(
                "goal `{}`: it is not known what tissue its needle passes",
                goal.name
            ))
        };
    };
    let stand_off_m = goal.standoff_m.unwrap_or(0.0);
    let inserted = needle.insert_median(path, stand_off_m);
    let inserted = inserted.map_err(|error| format!("goal `{}`: {error}", goal.name))?;
    let slope = inserted.largest_slope();
    Ok((slope > WARNED_SLOPE).then(|| {
        format!(
            "goal `{}`: the needle bends to a slope of {slope:.2}, and its model is for slopes below {WARNED_SLOPE}: \
             the bend is a rough figure",
            goal.name
        )
    }))
}
