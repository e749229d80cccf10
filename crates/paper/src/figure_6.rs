//! Figure 6 as pictures: the arm in its eight configurations, with the room that each gains.

use std::sync::Arc;

use nalgebra::{Point2, Point3, Vector3};
use needlebench_cell::ResolvedScenario;
use needlebench_evaluation::room::VoxelGrid;
use needlebench_geometry::Visual;
use needlebench_kinematics::{Joints, Pose};

use super::free_space::{BASE_HEIGHT_M, ConfigurationSpace, Space};
use needlebench_render::{
    Anchor, Camera, Floor, Image, Label, Line3, Scene, SurfaceInstance, render,
};
use needlebench_report::picture::voxel_surface;

const SIZE_PX: [u32; 2] = [800, 660];
/// Fineness of curved surfaces, m.
const CHORD_ERROR_M: f64 = 3e-4;
/// Translucent green of the gained room.
const GAINED: [f32; 4] = [0.1, 0.62, 0.35, 0.2];
const NEEDLE: [f32; 4] = [0.82, 0.2, 0.1, 1.0];
/// What of the needle's line is shown behind the guide and ahead of it, m.
const NEEDLE_SHOWN_M: [f64; 2] = [0.12, 0.086];

/// All eight pictures, each with its file name.
pub fn pictures(resolved: &ResolvedScenario, space: &Space) -> Vec<(String, Image)> {
    let camera = camera(resolved, space);
    std::thread::scope(|scope| {
        let threads: Vec<_> = space
            .report
            .configurations
            .iter()
            .zip(&space.gained)
            .map(|(configuration, gained)| {
                let camera = &camera;
                scope.spawn(move || {
                    let image = picture(resolved, configuration, &space.grid, gained, camera);
                    (format!("{}.png", configuration.label), image)
                })
            })
            .collect();
        threads
            .into_iter()
            .map(|thread| thread.join().expect("drawing does not panic"))
            .collect()
    })
}

/// One camera for all, so that pictures can be compared: from the patient's far side and feet,
/// where Figure 6 is seen from, a little above.
fn camera(resolved: &ResolvedScenario, space: &Space) -> Camera {
    let robot = &resolved.cell.robot;
    let mut points = Vec::new();
    for configuration in &space.report.configurations {
        let q = Joints::from(configuration.joints_rad);
        points.extend(
            robot
                .world_from_links(&q)
                .map(|pose| Point3::from(pose.translation.vector)),
        );
        let exit = Point3::from(resolved.cell.world_from_guide_exit(&q).translation.vector);
        points.push(exit);
    }
    // The surfaces reach beyond the joints' origins.
    let grown: Vec<Point3<f64>> = points
        .iter()
        .flat_map(|point| {
            [-0.09, 0.09].into_iter().flat_map(move |away_m| {
                (0..3).map(move |axis| {
                    let mut moved = *point;
                    moved[axis] += away_m;
                    moved
                })
            })
        })
        .collect();
    Camera::framing(&grown, Vector3::new(0.8, 0.75, -0.5), SIZE_PX)
}

fn add(scene: &mut Scene, visuals: &[Visual], world_from_parent: &Pose) {
    scene
        .surfaces
        .extend(visuals.iter().map(|visual| SurfaceInstance {
            mesh: Arc::clone(&visual.mesh),
            world_from_surface: world_from_parent * visual.parent_from_visual,
            color_rgba: visual.color_rgba,
        }));
}

fn picture(
    resolved: &ResolvedScenario,
    configuration: &ConfigurationSpace,
    grid: &VoxelGrid,
    gained: &[bool],
    camera: &Camera,
) -> Image {
    let (robot, tool) = (&resolved.cell.robot, &resolved.cell.tool);
    let q = Joints::from(configuration.joints_rad);
    let mut scene = Scene::default();
    add(&mut scene, &robot.base.visuals, &robot.world_from_base_link);
    for (link, pose) in robot.links.iter().zip(robot.world_from_links(&q)) {
        add(&mut scene, &link.visuals, &pose);
    }
    add(&mut scene, &tool.visuals, &robot.world_from_flange(&q));
    for solid in resolved.fixtures.iter().flat_map(|fixture| &fixture.solids) {
        scene.surfaces.push(SurfaceInstance {
            mesh: Arc::new(solid.shape.surface(CHORD_ERROR_M)),
            world_from_surface: solid.parent_from_shape,
            color_rgba: [0.62, 0.64, 0.68, 1.0],
        });
    }
    scene.surfaces.push(SurfaceInstance {
        mesh: Arc::new(voxel_surface(grid, gained)),
        world_from_surface: Pose::identity(),
        color_rgba: GAINED,
    });
    let exit = resolved.cell.world_from_guide_exit(&q);
    let on_line = |along_m: f64| exit * Point3::new(0.0, 0.0, along_m);
    scene.lines.push(Line3 {
        from_m: on_line(-tool.guide_length_m() - NEEDLE_SHOWN_M[0]),
        to_m: on_line(NEEDLE_SHOWN_M[1]),
        color_rgba: NEEDLE,
        width_px: 3.0,
    });
    scene.labels.push(Label {
        text: format!(
            "{}\nelbow {:+.2} m",
            configuration.label, configuration.elbow_m
        ),
        anchor: Anchor::TopLeft,
    });
    scene.labels.push(Label {
        text: format!("room: {}", configuration.room()),
        anchor: Anchor::BottomLeft,
    });
    scene.floor = Some(Floor {
        center_m: Point2::new(0.1, -0.2),
        // A little below the base plane: low elbows stay visible.
        z_m: BASE_HEIGHT_M - 0.25,
        radius_m: 1.1,
        spacing_m: 0.25,
    });
    render(&scene, camera)
}
