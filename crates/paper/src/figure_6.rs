//! Figure 6 as images: the arm in its eight configurations, with the free space gained in each.

use std::sync::Arc;
use std::thread::ScopedJoinHandle;

use nalgebra::{Point2, Point3, Vector3};
use needlebench_kinematics::{Joints, Pose};
use needlebench_render::{Anchor, Camera, Floor, Image, Label, Line3, SurfaceInstance, render};
use needlebench_report::picture::configuration::{Backdrop, posture_scene};
use needlebench_report::picture::voxel_surface;
use needlebench_scenario::ResolvedScenario;

use super::free_space::{BASE_HEIGHT_M, ConfigurationSpace, Space};

const SIZE_PX: [u32; 2] = [800, 660];
/// Translucent green of the gained free space.
const GAINED: [f32; 4] = [0.1, 0.62, 0.35, 0.2];
const NEEDLE: [f32; 4] = [0.82, 0.2, 0.1, 1.0];
/// Length of the needle axis shown behind and ahead of the guide, m.
const NEEDLE_SHOWN_M: [f64; 2] = [0.12, 0.086];

/// All eight images, each with its file name.
pub fn pictures(resolved: &ResolvedScenario, space: &Space) -> Vec<(String, Image)> {
    let (camera, backdrop) = (&camera(resolved, space), &Backdrop::new(resolved));
    std::thread::scope(|scope| {
        let configurations = space.report.configurations.iter().zip(&space.gained);
        let threads: Vec<_> = configurations
            .map(|(configuration, gained)| {
                scope.spawn(move || {
                    let room = SurfaceInstance {
                        mesh: Arc::new(voxel_surface(&space.grid, gained)),
                        world_from_surface: Pose::identity(),
                        color_rgba: GAINED,
                    };
                    let image = picture(resolved, backdrop, configuration, room, camera);
                    (format!("{}.png", configuration.label), image)
                })
            })
            .collect();
        let drawn = threads.into_iter().map(ScopedJoinHandle::join);
        drawn
            .map(|image| image.expect("rendering does not panic"))
            .collect()
    })
}

/// One camera for all images, so that they can be compared: from the patient's far side and feet, as in Figure 6,
/// slightly from above.
fn camera(resolved: &ResolvedScenario, space: &Space) -> Camera {
    let cell = &resolved.cell;
    let mut points = Vec::new();
    for configuration in &space.report.configurations {
        let q = Joints::from(configuration.joints_rad);
        let links = cell.robot.world_from_links(&q);
        for pose in links.into_iter().chain([cell.world_from_guide_exit(&q)]) {
            // The surfaces reach beyond the joints' origins.
            for away in [Vector3::x(), Vector3::y(), Vector3::z()] {
                points.extend(
                    [-0.09, 0.09].map(|by_m| Point3::from(pose.translation.vector + away * by_m)),
                );
            }
        }
    }
    Camera::framing(&points, Vector3::new(0.8, 0.75, -0.5), SIZE_PX)
}

fn picture(
    resolved: &ResolvedScenario,
    backdrop: &Backdrop,
    configuration: &ConfigurationSpace,
    room: SurfaceInstance,
    camera: &Camera,
) -> Image {
    let q = Joints::from(configuration.joints_rad);
    let mut scene = posture_scene(resolved, backdrop, &q);
    scene.surfaces.push(room);
    let exit = resolved.cell.world_from_guide_exit(&q);
    let on_line = |along_m: f64| exit * Point3::new(0.0, 0.0, along_m);
    scene.lines.push(Line3 {
        from_m: on_line(-resolved.cell.tool.guide_length_m() - NEEDLE_SHOWN_M[0]),
        to_m: on_line(NEEDLE_SHOWN_M[1]),
        color_rgba: NEEDLE,
        width_px: 3.0,
    });
    let elbow = format!(
        "{}\nelbow {:+.2} m",
        configuration.label, configuration.elbow_m
    );
    let room = format!("free space: {}", configuration.room());
    let labels = [(elbow, Anchor::TopLeft), (room, Anchor::BottomLeft)];
    scene
        .labels
        .extend(labels.map(|(text, anchor)| Label { text, anchor }));
    scene.floor = Some(Floor {
        center_m: Point2::new(0.1, -0.2),
        // A little below the base plane: low elbows stay visible.
        z_m: BASE_HEIGHT_M - 0.25,
        radius_m: 1.1,
        spacing_m: 0.25,
    });
    render(&scene, camera)
}
