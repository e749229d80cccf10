//! Goals: where the guide has to stand, in the world.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::{Pose, pose_from_rotation_vector};

use crate::phantom::{Phantom, Tissue};
use crate::scenario::GoalSection;
use crate::shape::{Shape, Solid};
use crate::toml_text::TomlText;
use crate::{CollisionBody, Finding, Robot, Tool, nearest_name};

/// Angle of the guide about the needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Roll {
    /// Turning the guide changes nothing for the needle; the plan chooses.
    Free,
    /// Fixed, rad from [`Goal::world_from_guide_exit`].
    Fixed(f64),
}

/// What is expected of a configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Expectation {
    /// It works and meets all criteria.
    Ok,
    /// It works but misses a criterion.
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
    /// Expected outcomes; `None` where nothing is expected.
    pub expected: BTreeMap<Configuration, Expectation>,
}

impl Goal {
    /// Pose of the guide's exit in the world at a roll, rad.
    pub fn world_from_guide_exit_at(&self, roll_rad: f64) -> Pose {
        self.world_from_guide_exit * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll_rad)
    }
}

/// The phantom, placed.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedPhantom {
    /// The phantom.
    pub phantom: Arc<Phantom>,
    /// Its place.
    pub world_from_phantom: Pose,
}

/// Distance from the skin within which an entry point is moved onto it along the needle.
const ENTRY_TOLERANCE_M: f64 = 5e-3;

/// What resolving goals needs to know.
pub(crate) struct Surroundings<'a> {
    pub robot: &'a Robot,
    pub tool: &'a Tool,
    pub phantom: Option<&'a PlacedPhantom>,
    pub fixtures: &'a [CollisionBody],
}

/// Rules that reject configurations: the words that `expected` may use.
pub const REJECTION_RULES: [&str; 9] = [
    "unreachable",
    "merged",
    "joint_limit",
    "singular",
    "collision",
    "needle_corridor",
    "approach",
    "nearest_only",
    "no_motion",
];

pub(crate) fn resolve_goal(
    text: &TomlText<'_>,
    index: usize,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
    notes: &mut Vec<String>,
) -> Result<Goal, Finding> {
    let key = |name: &str| format!("goals[{index}].{name}");
    let mut goal = if section.flange_pose.is_some() {
        from_flange_pose(text, &key, section, surroundings)?
    } else {
        from_entry_and_target(text, &key, section, surroundings, notes)?
    };
    goal.expected = expectations(text, &key, section)?;
    let by_flange_pose = section.flange_pose.is_some();
    check_place(text, &key, &goal, by_flange_pose, surroundings)?;
    check_target(text, &key, &goal, by_flange_pose, surroundings)?;
    let needle_m = surroundings.tool.needle.length_m;
    let needed_m = surroundings.tool.guide_length_m() + goal.insertion_length_m;
    if needle_m < needed_m {
        return Err(text
            .finding(
                &key(if section.insertion_length_mm.is_some() {
                    "insertion_length_mm"
                } else {
                    "entry_mm"
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

fn from_flange_pose(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
    surroundings: &Surroundings<'_>,
) -> Result<Goal, Finding> {
    for (name, given) in [
        ("entry_mm", section.entry_mm.is_some()),
        ("target_mm", section.target_mm.is_some()),
        ("lesion", section.lesion.is_some()),
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
            .hint("the distance from the guide's exit to the needle's tip"));
    };
    check_length(
        text,
        &key("insertion_length_mm"),
        insertion_length_mm,
        1.0,
        500.0,
    )?;
    check_length(text, &key("approach_mm"), section.approach_mm, 0.0, 500.0)?;
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
            return Err(text.finding(
                &key("flange_pose"),
                format!(
                    "along the guide's axis the phantom lies {:.1} to {:.1} mm from the guide's \
                     exit, but the needle ends at {insertion_length_mm:.1} mm",
                    enters_m * 1e3,
                    leaves_m * 1e3
                ),
            )
            .hint("the skin has to be ahead of the guide's exit, and the needle has to end inside"));
        }
        standoff_m = Some(enters_m);
        target_organ = organ_at(&placed.phantom, &(to_phantom * target_m));
    }
    Ok(Goal {
        name: section.name.clone(),
        entry_m: standoff_m.map(|distance| exit + axis.into_inner() * distance),
        target_m,
        axis,
        world_from_guide_exit,
        roll: Roll::Fixed(0.0),
        insertion_length_m,
        standoff_m,
        approach_m: section.approach_mm * 1e-3,
        lesion: None,
        target_organ,
        expected: BTreeMap::new(),
    })
}

fn from_entry_and_target(
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
    let point = |mm: [f64; 3]| Point3::from(Vector3::from(mm) * 1e-3);
    let Some(entry_mm) = section.entry_mm else {
        return Err(text
            .finding(
                &key("entry_mm"),
                format!("goal `{}` has no `entry_mm`", section.name),
            )
            .hint("a goal needs `entry_mm` and `target_mm` or `lesion`, or a `flange_pose`"));
    };
    let (target_key, target, lesion) = match (&section.target_mm, &section.lesion) {
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
            return Err(text.finding(
                &key("target_mm"),
                format!(
                    "goal `{}` has neither `target_mm` nor `lesion`",
                    section.name
                ),
            ));
        }
    };
    let entry = point(entry_mm);
    let Some(axis) = UnitVector3::try_new(target - entry, 1e-4) else {
        return Err(text
            .finding(&key("entry_mm"), "entry and target are the same point")
            .hint("the needle's direction is from entry to target"));
    };
    let depth_m = phantom.skin_signed_depth(&target);
    if depth_m <= 0.0 {
        return Err(text
            .finding(
                &key(target_key),
                format!(
                    "the target lies {:.1} mm outside the phantom",
                    -depth_m * 1e3
                ),
            )
            .hint(
                "points are in the phantom frame: left, posterior, superior, from mid-chest, in mm",
            ));
    }
    // The target is inside, so the line through it crosses the skin.
    let Some((enters_m, leaves_m)) = phantom.skin_intersection(&entry, &axis) else {
        return Err(text.finding(
            &key("entry_mm"),
            "the line from entry to target misses the skin",
        ));
    };
    if enters_m.abs() > ENTRY_TOLERANCE_M {
        let skin = (entry + axis.into_inner() * enters_m).coords * 1e3;
        return Err(text
            .finding(
                &key("entry_mm"),
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
        return Err(text
            .finding(
                &key("entry_mm"),
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
            section.name,
            enters_m * 1e3
        ));
    }
    check_length(text, &key("standoff_mm"), section.standoff_mm, 0.0, 200.0)?;
    check_length(text, &key("approach_mm"), section.approach_mm, 0.0, 500.0)?;
    let on_skin = entry + axis.into_inner() * enters_m;
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

/// Organ that contains a point of the phantom frame.
fn organ_at(phantom: &Phantom, point: &Point3<f64>) -> Option<String> {
    phantom
        .lesions
        .iter()
        .filter(|lesion| (point - lesion.center_m).norm() <= 0.5 * lesion.diameter_m)
        .find_map(|lesion| lesion.organ.clone())
        .or_else(|| {
            phantom
                .parts
                .iter()
                .filter(|part| part.tissue == Tissue::Organ)
                .find(|part| solid_contains(&part.solid, point))
                .and_then(|part| part.organ.clone())
        })
}

/// Whether a point of the parent frame lies in a solid.
pub(crate) fn solid_contains(solid: &Solid, point: &Point3<f64>) -> bool {
    let local = solid.parent_from_shape.inverse() * point;
    match &solid.shape {
        Shape::Sphere { radius_m } => local.coords.norm() <= *radius_m,
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => local.z.abs() <= *half_length_m && local.x.hypot(local.y) <= *radius_m,
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => {
            let on_axis = local.z.clamp(-half_length_m, *half_length_m);
            (local - Point3::new(0.0, 0.0, on_axis)).norm() <= *radius_m
        }
        Shape::Cuboid { half_extents_m } => {
            (0..3).all(|axis| local[axis].abs() <= half_extents_m[axis])
        }
        Shape::Convex(mesh) => mesh.0.triangles.iter().all(|triangle| {
            let [a, b, c] = triangle.map(|i| mesh.0.vertices_m[i as usize]);
            (b - a).cross(&(c - a)).dot(&(local - a)) <= 0.0
        }),
        Shape::Mesh(mesh) => mesh.surface.winding_number(&local) > 0.5,
    }
}

fn check_place(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    goal: &Goal,
    by_flange_pose: bool,
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
        for fixture in surroundings.fixtures {
            if fixture
                .solids
                .iter()
                .any(|solid| solid_contains(solid, &point))
            {
                let name = match what {
                    _ if by_flange_pose => "flange_pose",
                    "target" => "target_mm",
                    "entry" => "entry_mm",
                    _ => "standoff_mm",
                };
                return Err(text
                    .finding(
                        &key(name),
                        format!("the {what} lies inside the {}", fixture.name),
                    )
                    .hint("compare the goal with the phantom's posture and place"));
            }
        }
    }
    Ok(())
}

/// Refuses a target inside a bone, unless it is a lesion that is there.
fn check_target(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    goal: &Goal,
    by_flange_pose: bool,
    surroundings: &Surroundings<'_>,
) -> Result<(), Finding> {
    let (Some(placed), None) = (surroundings.phantom, &goal.lesion) else {
        return Ok(());
    };
    let target = placed.world_from_phantom.inverse() * goal.target_m;
    let bone = placed
        .phantom
        .parts
        .iter()
        .filter(|part| part.tissue == Tissue::Bone)
        .find(|part| solid_contains(&part.solid, &target));
    let Some(bone) = bone else { return Ok(()) };
    let name = if by_flange_pose {
        "flange_pose"
    } else {
        "target_mm"
    };
    Err(text
        .finding(
            &key(name),
            format!("the target lies inside the bone `{}`", bone.name),
        )
        .hint("move the target, or make it a lesion if the bone is to be pierced"))
}

fn check_length(
    text: &TomlText<'_>,
    key: &str,
    value_mm: f64,
    least_mm: f64,
    most_mm: f64,
) -> Result<(), Finding> {
    if (least_mm..=most_mm).contains(&value_mm) {
        return Ok(());
    }
    Err(text
        .finding(
            key,
            format!("{value_mm} mm is outside {least_mm} to {most_mm} mm"),
        )
        .hint("lengths are in millimetres"))
}

fn expectations(
    text: &TomlText<'_>,
    key: &dyn Fn(&str) -> String,
    section: &GoalSection,
) -> Result<BTreeMap<Configuration, Expectation>, Finding> {
    let mut every = None;
    let mut named = BTreeMap::new();
    for (label, outcome) in &section.expected {
        let here = key(&format!("expected.{label}"));
        let expectation = match outcome.as_str() {
            "ok" => Expectation::Ok,
            "failed" => Expectation::Failed,
            rule if REJECTION_RULES.contains(&rule) => Expectation::Rejected(rule.to_owned()),
            other => {
                return Err(text
                    .finding(&here, format!("`{other}` is not an outcome"))
                    .hint(format!(
                        "ok, failed, or a rule: {}",
                        REJECTION_RULES.join(", ")
                    )));
            }
        };
        if label == "every" {
            every = Some(expectation);
        } else if let Some(configuration) = Configuration::from_label(label) {
            named.insert(configuration, expectation);
        } else {
            let labels = Configuration::ALL.map(Configuration::label);
            return Err(text
                .finding(&here, format!("`{label}` is not a configuration"))
                .hint(match nearest_name(label, labels) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("every, {}", labels.join(", ")),
                }));
        }
    }
    if let Some(every) = every {
        for configuration in Configuration::ALL {
            named.entry(configuration).or_insert_with(|| every.clone());
        }
    }
    Ok(named)
}
