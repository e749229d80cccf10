//! Goals: where the guide has to stand, in the world.

mod by_flange;
mod by_points;
mod checks;
mod needle_path;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_cell::{CollisionBody, Robot, Tool};
use needlebench_geometry::Solid;
use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::Pose;
use needlebench_kinematics::ik::Configuration;
use serde::{Deserialize, Serialize};

use super::imperfections::{NeedlePath, TissueNeedle, bends_along_m};
use super::phantom::{Corners, PlacedPhantom};
use crate::scenario::{EVERY_CONFIGURATION, GoalSection};
use by_flange::from_flange_pose;
pub(crate) use by_points::GoalInPhantom;
pub use by_points::direction;
use by_points::from_entry_and_target;
pub(crate) use by_points::target_inside;
use checks::{check_place, check_target};
pub use needle_path::{BevelFacing, RunsAlong, bevel_clock};
pub(crate) use needle_path::{InTissue, bevel_facing, check_insertions};

/// Angle of the guide about the needle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Roll {
    /// Turning the guide changes nothing for the needle; the plan chooses.
    Free,
    /// Fixed, rad from [`Goal::world_from_guide_exit`].
    Fixed(f64),
}

/// What is expected of a configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Expectation {
    /// Feasible, all criteria passed.
    Ok,
    /// Feasible, but a criterion failed.
    Failed,
    /// It is rejected by this rule.
    Rejected(String),
}

/// One needle, in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Goal {
    /// Name.
    pub name: String,
    /// Where the needle enters the skin; `None` without a phantom.
    pub entry_m: Option<Point3<f64>>,
    /// Where the needle's tip is to come.
    pub target_m: Point3<f64>,
    /// Where the lesion really is, if that is known; nothing is planned by it.
    pub true_target_m: Option<Point3<f64>>,
    /// How far beside the target the straight needle is aimed, so that the tip of the bent one comes to it, m; lateral to
    /// [`Goal::axis`], zero without `aim`.
    pub aim_m: Vector3<f64>,
    /// Direction of insertion.
    pub axis: UnitVector3<f64>,
    /// Pose of the guide's exit at roll 0; z is [`Goal::axis`].
    pub world_from_guide_exit: Pose,
    /// Roll about the needle.
    pub roll: Roll,
    /// From the guide's exit to the needle's tip, m.
    pub insertion_length_m: f64,
    /// Gap between guide exit and entry point along the needle, m; `None` without a phantom.
    pub standoff_m: Option<f64>,
    /// Length of the straight approach, m.
    pub approach_m: f64,
    /// Lesion that is aimed at.
    pub lesion: Option<String>,
    /// Organ that contains the target, which the needle has to enter.
    pub target_organ: Option<String>,
    /// The needle's way through tissue; none for one that bends in air.
    pub needle_path: Option<Arc<NeedlePath>>,
    /// Expected outcomes; `None` where nothing is expected.
    pub expected: BTreeMap<Configuration, Expectation>,
}

impl Goal {
    /// Pose of the guide's exit in the world at a roll, rad.
    pub fn world_from_guide_exit_at(&self, roll_rad: f64) -> Pose {
        self.world_from_guide_exit * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll_rad)
    }

    /// Points of a needle that is bent off the axis, from the skin to its tip, world: `path_m` has depths and bends, `towards`
    /// is a unit vector across the guide's exit at roll 0.
    pub fn bent_line(&self, path_m: &[[f64; 2]], towards: [f64; 2]) -> Vec<Point3<f64>> {
        let entry = self.entry_m.unwrap_or(self.target_m);
        let [x, y] = towards;
        let across = self.world_from_guide_exit.rotation * Vector3::new(x, y, 0.0);
        let at = |[depth_m, bend_m]: &[f64; 2]| {
            entry + self.axis.into_inner() * *depth_m + across * *bend_m
        };
        path_m.iter().map(at).collect()
    }

    /// The line of the median needle that tissue bends, from the skin to its tip, world; none where it is not known to which
    /// side.
    pub fn median_line(&self, needle: &TissueNeedle) -> Option<Vec<Point3<f64>>> {
        let path = self.needle_path.as_ref()?;
        let towards = needle.pushed_towards(path)?;
        let stand_off_m = self.standoff_m.unwrap_or(0.0);
        let inserted = needle.insert_median(path, stand_off_m).ok()?;
        Some(self.bent_line(&bends_along_m(&inserted), towards))
    }

    /// Where the tip of a straight needle is to come.
    pub fn aimed_m(&self) -> Point3<f64> {
        self.target_m + self.aim_m
    }

    /// Length of the planned needle in the patient, m; `None` without a phantom.
    pub fn entry_to_target_m(&self) -> Option<f64> {
        Some((self.target_m - self.entry_m?).norm())
    }
}

/// What resolving goals needs to know.
pub(crate) struct Surroundings<'a> {
    pub robot: &'a Robot,
    pub tool: &'a Tool,
    pub phantom: Option<&'a PlacedPhantom>,
    pub fixtures: &'a [CollisionBody],
    /// Boxes around each of the fixtures.
    pub boxes: &'a [BodyBoxes],
    /// A needle that bends in tissue.
    pub needle: Option<InTissue<'a>>,
}

/// Boxes around a body and its solids, along the world's axes.
#[derive(Debug)]
pub(crate) struct BodyBoxes {
    pub whole: Corners,
    pub solids: Vec<Corners>,
}

impl BodyBoxes {
    /// Of a body whose solids are given in the world.
    pub fn new(body: &CollisionBody) -> Self {
        let solids: Vec<Corners> = body.solids.iter().map(Solid::bounding_box).collect();
        let start = (
            Point3::from(Vector3::repeat(f64::INFINITY)),
            Point3::from(Vector3::repeat(f64::NEG_INFINITY)),
        );
        let whole = solids
            .iter()
            .fold(start, |all, each| (all.0.inf(&each.0), all.1.sup(&each.1)));
        Self { whole, solids }
    }
}

pub(crate) fn resolve_goal(
    text: &TomlText<'_>,
    index: usize,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
    notes: &mut Vec<String>,
) -> Result<Goal, Finding> {
    let in_phantom = goal_in_phantom(text, index, section, surroundings, notes)?;
    place_goal(text, index, section, in_phantom.as_ref(), surroundings)
}

/// The goal in the phantom's frame, wherever that lies; none for one by a pose of the flange.
pub(crate) fn goal_in_phantom(
    text: &TomlText<'_>,
    index: usize,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
    notes: &mut Vec<String>,
) -> Result<Option<GoalInPhantom>, Finding> {
    if section.flange_pose.is_some() {
        return Ok(None);
    }
    let key = |name: &str| format!("goals[{index}].{name}");
    let mut goal = from_entry_and_target(text, &key, section, surroundings, notes)?;
    goal.0.expected = expectations(section);
    Ok(Some(goal))
}

/// The goal in the world; `in_phantom` is what [`goal_in_phantom`] says.
pub(crate) fn place_goal(
    text: &TomlText<'_>,
    index: usize,
    section: &GoalSection,
    in_phantom: Option<&GoalInPhantom>,
    surroundings: &Surroundings<'_>,
) -> Result<Goal, Finding> {
    let key = |name: &str| format!("goals[{index}].{name}");
    let goal = match in_phantom.zip(surroundings.phantom) {
        Some((goal, lying)) => goal.placed(&lying.world_from_phantom),
        None => Goal {
            expected: expectations(section),
            ..from_flange_pose(text, &key, section, surroundings)?
        },
    };
    check_place(text, &key, &goal, section, surroundings)?;
    check_target(text, &key, &goal, section, surroundings)?;
    let needle_m = surroundings.tool.needle.length_m;
    let needed_m = surroundings.tool.guide_length_m() + goal.insertion_length_m;
    if needle_m < needed_m {
        return Err(text
            .finding(
                &key(if section.insertion_length_mm.is_some() {
                    "insertion_length_mm"
                } else {
                    section.entry_key()
                }),
                format!(
                    "the needle is {:.1} mm long, but guide and insertion need {:.1} mm",
                    needle_m * 1e3,
                    needed_m * 1e3
                ),
            )
            .hint(
                "a longer needle (`needle_length_mm` under [tool]), a smaller stand-off, or an \
                 entry on the target's side of the body (x is to the patient's left)",
            ));
    }
    Ok(goal)
}

/// Outcomes by configuration; the schema knows their words.
fn expectations(section: &GoalSection) -> BTreeMap<Configuration, Expectation> {
    let expectation = |outcome: &str| match outcome {
        "ok" => Expectation::Ok,
        "failed" => Expectation::Failed,
        rule => Expectation::Rejected(rule.to_owned()),
    };
    let every = section.expected.get(EVERY_CONFIGURATION);
    Configuration::ALL
        .into_iter()
        .filter_map(|configuration| {
            let named = section.expected.get(configuration.label());
            let outcome = named.or(every)?;
            Some((configuration, expectation(outcome)))
        })
        .collect()
}
