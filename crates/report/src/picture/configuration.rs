//! A picture of each configuration, and all of a goal on one sheet.

use std::sync::Arc;

use nalgebra::{Point2, Point3, Vector3};
use needlebench_cell::{Rule, pair_in_words, rule_in_words};
use needlebench_evaluation::report::{ConfigurationReport, GoalReport, Report, Status};
use needlebench_geometry::Visual;
use needlebench_kinematics::{Joints, Pose};
use needlebench_phantom::Tissue;
use needlebench_render::{
    Anchor, Camera, Floor, Image, Label, Line3, Scene, Stage, SurfaceInstance, render,
};
use needlebench_scenario::{Goal, ResolvedScenario};
use needlebench_show::number::{millimetres, small_length};

use crate::table::verdict::status;

/// Size of one picture, pixels.
const SIZE_PX: [u32; 2] = [1000, 750];
/// Reach of the arm out of its base, which may hang or be tilted, for framing, m.
const REACH_M: f64 = 0.55;
/// Share of a needle's direction that leads away from the robot, beyond which pictures look the
/// same way.
const FROM_ROBOT_SIDE: f64 = 0.75;
/// Fineness of curved surfaces in pictures, m.
const CHORD_ERROR_M: f64 = 3e-4;

/// Everything of a cell that does not move, made once for all pictures of a scenario.
pub struct Backdrop {
    surfaces: Vec<SurfaceInstance>,
}

impl Backdrop {
    /// Everything of a scenario that does not move.
    pub fn new(resolved: &ResolvedScenario) -> Self {
        let robot = &resolved.cell.robot;
        let mut surfaces = Vec::new();
        add(
            &mut surfaces,
            &robot.base.visuals,
            &robot.world_from_base_link,
        );
        for fixture in &resolved.fixtures {
            for (color_rgba, solids) in fixture.by_color() {
                surfaces.extend(solids.into_iter().map(|solid| SurfaceInstance {
                    mesh: Arc::new(solid.shape.surface(CHORD_ERROR_M)),
                    world_from_surface: solid.parent_from_shape,
                    color_rgba,
                }));
            }
        }
        if let Some(placed) = &resolved.phantom {
            for part in placed.phantom.parts.iter().chain(&placed.limbs) {
                let mut color_rgba = part.color_rgba;
                match part.tissue {
                    Tissue::Skin => color_rgba[3] = 0.22,
                    Tissue::Organ => color_rgba[3] = 0.4,
                    Tissue::Beside | Tissue::Assumed => color_rgba[3] = 0.5,
                    _ => {}
                }
                surfaces.push(SurfaceInstance {
                    mesh: Arc::new(part.solid.shape.surface(CHORD_ERROR_M)),
                    world_from_surface: placed.world_from_phantom * part.solid.parent_from_shape,
                    color_rgba,
                });
            }
        }
        Self { surfaces }
    }

    /// All of it, on the floor under a goal.
    pub(super) fn scene(&self, resolved: &ResolvedScenario, goal: &Goal) -> Scene {
        Scene {
            surfaces: self.surfaces.clone(),
            floor: Some(floor(resolved, goal)),
            ..Scene::default()
        }
    }

    /// What all pictures of a goal's postures have in common.
    pub(crate) fn stage(&self, resolved: &ResolvedScenario, goal: &Goal) -> Stage {
        Stage::new(&self.scene(resolved, goal), &goal_camera(resolved, goal))
    }
}

fn add(surfaces: &mut Vec<SurfaceInstance>, visuals: &[Visual], world_from_parent: &Pose) {
    surfaces.extend(visuals.iter().map(|visual| SurfaceInstance {
        mesh: Arc::clone(&visual.mesh),
        world_from_surface: world_from_parent * visual.parent_from_visual,
        color_rgba: visual.color_rgba,
    }));
}

/// The planned needle, and one that goes where it must not.
const NEEDLE_RGBA: [f32; 4] = [0.0, 0.55, 0.2, 1.0];
const REFUSED_RGBA: [f32; 4] = [0.85, 0.1, 0.05, 1.0];

/// A configuration of a run.
#[derive(Clone, Copy)]
pub(crate) struct Shown<'a> {
    pub run: &'a Report,
    pub goal: &'a Goal,
    pub configuration: &'a ConfigurationReport,
}

/// Draws one configuration in its final posture on the stage of its goal; `None` if it has none.
pub(crate) fn configuration_picture(
    resolved: &ResolvedScenario,
    stage: &Stage,
    shown: &Shown<'_>,
) -> Option<Image> {
    let Shown {
        goal,
        configuration: report,
        ..
    } = shown;
    let q = Joints::from_column_slice(&report.joints_rad?);
    let mut scene = arm_scene(resolved, &q);

    let mut rejections = report.rejections.iter();
    let refused = rejections.find(|each| each.rule == Rule::NeedleRoute.name());
    let exit = Point3::from(goal.world_from_guide_exit.translation.vector);
    let behind = exit
        - goal.axis.into_inner()
            * (resolved.cell.tool.guide_length_m() + resolved.cell.tool.needle.length_m * 0.5);
    let color_rgba = if refused.is_some() {
        REFUSED_RGBA
    } else {
        NEEDLE_RGBA
    };
    let lines = needle_line(resolved, goal, behind);
    scene.lines.extend(lines.windows(2).map(|ends| Line3 {
        from_m: ends[0],
        to_m: ends[1],
        color_rgba,
        width_px: 3.0,
    }));
    scene.labels.push(Label {
        text: caption(shown),
        anchor: Anchor::TopLeft,
    });
    scene.labels.push(Label {
        text: refused.map_or("target".to_owned(), |rejection| rejection.detail.clone()),
        anchor: Anchor::World(goal.target_m),
    });
    if let Some(found) = report.clearance.least_from_surroundings() {
        scene.labels.push(Label {
            text: format!(
                "clearance {} mm\n{}\n({})",
                millimetres(found.minimum_m),
                pair_in_words(&found.pair),
                found.phase
            ),
            anchor: Anchor::BottomLeft,
        });
    }
    Some(stage.picture(&scene))
}

/// The needle from a place behind the guide's exit to its tip: as tissue bends it where it is known to which side, else straight.
fn needle_line(resolved: &ResolvedScenario, goal: &Goal, behind: Point3<f64>) -> Vec<Point3<f64>> {
    let expected = resolved.expected.as_ref();
    let needle = expected.and_then(|expected| expected.imperfections.tissue());
    let bent = needle.and_then(|needle| goal.median_line(needle));
    let inside = bent.unwrap_or_else(|| vec![goal.aimed_m()]);
    [behind].into_iter().chain(inside).collect()
}

/// Draws the cell of a scenario with the arm in a posture at its first goal.
pub(crate) fn placement_picture(resolved: &ResolvedScenario, q: &Joints) -> Image {
    let goal = &resolved.goals[0];
    let mut scene = posture_scene(resolved, &Backdrop::new(resolved), q);
    scene.lines.push(Line3 {
        from_m: Point3::from(goal.world_from_guide_exit.translation.vector),
        to_m: goal.target_m,
        color_rgba: NEEDLE_RGBA,
        width_px: 3.0,
    });
    scene.floor = Some(floor(resolved, goal));
    render(&scene, &goal_camera(resolved, goal))
}

/// The cell with the arm in a posture.
pub fn posture_scene(resolved: &ResolvedScenario, backdrop: &Backdrop, q: &Joints) -> Scene {
    let mut scene = arm_scene(resolved, q);
    scene
        .surfaces
        .splice(..0, backdrop.surfaces.iter().cloned());
    scene
}

/// Arm and tool in a posture.
pub(super) fn arm_scene(resolved: &ResolvedScenario, q: &Joints) -> Scene {
    let robot = &resolved.cell.robot;
    let mut scene = Scene::default();
    for (link, pose) in robot.links.iter().zip(robot.world_from_links(q)) {
        add(&mut scene.surfaces, &link.visuals, &pose);
    }
    add(
        &mut scene.surfaces,
        &resolved.cell.tool.visuals,
        &robot.world_from_flange(q),
    );
    scene
}

/// The floor under robot and patient.
pub(super) fn floor(resolved: &ResolvedScenario, goal: &Goal) -> Floor {
    let base = resolved.cell.robot.world_from_base_link.translation.vector;
    Floor {
        center_m: Point2::new(
            0.5 * (base.x + goal.target_m.x),
            0.5 * (base.y + goal.target_m.y),
        ),
        z_m: 0.0,
        radius_m: 1.6,
        spacing_m: 0.25,
    }
}

/// The camera of all pictures of a goal, so that they can be compared.
pub(crate) fn goal_camera(resolved: &ResolvedScenario, goal: &Goal) -> Camera {
    Camera::framing(&framed(resolved, goal), viewpoint(resolved, goal), SIZE_PX)
}

/// Points that every picture of a goal shows.
fn framed(resolved: &ResolvedScenario, goal: &Goal) -> Vec<Point3<f64>> {
    let world_from_base = &resolved.cell.robot.world_from_base_link;
    let mut points = vec![goal.target_m];
    for corner in [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]] {
        for height_m in [-0.1, REACH_M] {
            points.push(world_from_base * Point3::new(0.2 * corner[0], 0.2 * corner[1], height_m));
        }
    }
    if let Some(placed) = &resolved.phantom {
        let skin = placed.phantom.skin();
        let pose = placed.world_from_phantom * skin.parent_from_shape;
        points.extend(
            skin.shape
                .surface(CHORD_ERROR_M)
                .vertices_m
                .iter()
                .map(|v| pose * v),
        );
    }
    points
}

/// Direction of view: from the side of the robot that looks across towards the goal, from above.
pub(super) fn viewpoint(resolved: &ResolvedScenario, goal: &Goal) -> Vector3<f64> {
    let base = resolved.cell.robot.world_from_base_link.translation.vector;
    let ahead = goal.target_m.coords - base;
    let across = Vector3::new(ahead.y, -ahead.x, 0.0);
    let level = across.try_normalize(1e-6).unwrap_or(Vector3::x());
    let forward = Vector3::new(ahead.x, ahead.y, 0.0)
        .try_normalize(1e-6)
        .unwrap_or(Vector3::y());
    // Back towards the robot, unless the needle comes so much from its side that the chest would
    // hide the guide.
    let along = if goal.axis.dot(&forward) > FROM_ROBOT_SIDE {
        0.45
    } else {
        -0.45
    };
    level * -0.75 + forward * along + Vector3::new(0.0, 0.0, -0.55)
}

/// What became of a configuration: `feasible`, `rejected: access zone blocked`, `failed`.
pub(super) fn status_in_words(shown: &Shown<'_>) -> String {
    let report = shown.configuration;
    match (report.status, report.rejections.first()) {
        (Status::Rejected, Some(first)) => format!("rejected: {}", rule_in_words(first.rule)),
        // As the tables say it: a criterion may fail, or be open.
        _ => match status(shown.run, &shown.goal.name, report) {
            accepted if accepted == Status::Ok.name() => "feasible".to_owned(),
            other => other.to_owned(),
        },
    }
}

fn caption(shown: &Shown<'_>) -> String {
    let report = shown.configuration;
    let mut lines = vec![report.label.to_owned(), status_in_words(shown)];
    if let Some(budget) = &report.budget {
        let rms_m = budget.total.at_target.analytic.rms_m;
        lines.push(format!("RMS tip error {}", small_length(rms_m)));
    }
    let mut goals = shown.run.goals.iter();
    let goal = goals.find(|goal| goal.name == shown.goal.name);
    if let Some(needle) = goal.and_then(|goal| goal.needle.as_ref()) {
        let bend_m = needle.bend.median_m.abs();
        lines.push(format!("needle bends {}", small_length(bend_m)));
    }
    for (engine, measured) in &report.engines {
        let error = small_length(measured.needle.tip_position_error_m);
        // What is left is a residual only of an arm that is what its controller assumes.
        let name = match &shown.run.truth {
            None => "simulation residual",
            Some(_) => "simulated tip error",
        };
        lines.push(format!("{engine}: {name} {error}"));
    }
    lines.join("\n")
}

/// Caption of a configuration on the sheet of its goal.
pub(crate) fn sheet_caption(goal: &GoalReport, report: &ConfigurationReport) -> String {
    let chosen = goal
        .recommended
        .as_ref()
        .is_some_and(|found| found.label == report.label);
    let mark = if chosen { " (recommended)" } else { "" };
    match report.rejections.first() {
        Some(first) => format!("{}: {}", report.label, rule_in_words(first.rule)),
        None => format!("{}{mark}", report.label),
    }
}
