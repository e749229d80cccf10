//! Pictures of what a configuration leaves to people, as the paper's Figure 6: free space shaded,
//! lines of sight, and the hand cone.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_cell::part_in_words;
use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_evaluation::room::{
    RoomModel, RoomReport, SECTOR_RADIUS_M, Sector, sight_segments,
};
use needlebench_geometry::{Shape, TriangleMesh};
use needlebench_kinematics::{Joints, Pose};
use needlebench_render::{Anchor, Camera, Image, Label, Line3, Scene, Stage, SurfaceInstance};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::people::Person;

use super::configuration::{Backdrop, Shown, arm_scene, sheet_caption, status_in_words, viewpoint};
use super::voxels::voxel_surface;

/// Size of one picture, pixels.
const SIZE_PX: [u32; 2] = [1000, 750];
/// Translucent green of the free space, and red of what arm and tool take of it.
const FREE: [f32; 4] = [0.10, 0.68, 0.36, 0.26];
const TAKEN: [f32; 4] = [0.88, 0.16, 0.10, 0.30];
/// Translucent blue of the hand's cone.
const CONE: [f32; 4] = [0.10, 0.30, 0.95, 0.55];
/// Lines of sight: free, and blocked up to what blocks them.
const SEEN: [f32; 4] = [0.0, 0.60, 0.25, 1.0];
const HIDDEN: [f32; 4] = [0.85, 0.12, 0.10, 1.0];
/// A person: body and head.
const BODY: [f32; 4] = [0.35, 0.42, 0.62, 0.28];
const HEAD: [f32; 4] = [0.35, 0.42, 0.62, 1.0];
/// Lines of sight that are drawn per stature, half to the skin and half to the needle.
const LINES_DRAWN: u32 = 8;
/// Space over the tallest person's eyes that is in the picture, for the labels, m.
const HEADROOM_M: f64 = 0.3;
/// Fineness of curved surfaces, m.
const CHORD_ERROR_M: f64 = 2e-3;

/// What all pictures of a goal have in common.
pub struct RoomPictures<'a> {
    resolved: &'a ResolvedScenario,
    room: &'a RoomModel<'a>,
    goal: usize,
    stage: Stage,
}

impl<'a> RoomPictures<'a> {
    /// Of one goal of a scenario.
    pub fn new(
        resolved: &'a ResolvedScenario,
        backdrop: &Backdrop,
        room: &'a RoomModel<'a>,
        goal: usize,
    ) -> Self {
        let mut scene = backdrop.scene(resolved, &resolved.goals[goal]);
        for person in &resolved.people.by_goal[goal] {
            let heads = person.statures_m.iter().map(|m| person.eyes_m(*m));
            scene.surfaces.extend(heads.map(|at| ball(at, 0.045, HEAD)));
            scene.surfaces.push(body(person));
        }
        Self {
            resolved,
            room,
            goal,
            stage: Stage::new(&scene, &camera(resolved, room, goal)),
        }
    }

    fn people(&self) -> &'a [Person] {
        &self.resolved.people.by_goal[self.goal]
    }

    /// Draws one configuration in its final posture; `None` if it has none.
    pub(crate) fn draw(&self, shown: &Shown<'_>) -> Option<Image> {
        let report = shown.configuration;
        let q = Joints::from_column_slice(&report.joints_rad?);
        let room = report.room.as_ref()?;
        let mut scene = arm_scene(self.resolved, &q);
        self.add_space(&mut scene, &q);
        self.add_sight(&mut scene, &q, room);
        let entry = self.room.guide_entry(&q);
        scene.surfaces.push(SurfaceInstance {
            mesh: Arc::new(cone(room.hand_cone_half_angle_rad, room.hand_cone_length_m)),
            world_from_surface: entry,
            color_rgba: CONE,
        });
        scene.lines.push(Line3 {
            from_m: entry * Point3::new(0.0, 0.0, -room.hand_cone_length_m),
            to_m: self.room.sector(self.goal).center_m,
            color_rgba: [0.05, 0.15, 0.55, 1.0],
            width_px: 2.5,
        });
        scene.labels.push(Label {
            text: title(shown, room),
            anchor: Anchor::TopLeft,
        });
        scene.labels.push(Label {
            text: numbers(room),
            anchor: Anchor::BottomLeft,
        });
        scene.labels.push(Label {
            text: "green: free space   red: occupied by the arm\n\
                   blue: hand cone\n\
                   lines of sight: free and blocked"
                .to_owned(),
            anchor: Anchor::BottomRight,
        });
        Some(self.stage.picture(&scene))
    }

    /// The hemisphere about the entry point, and what the arm occupies of it; not on the stage, since both meet in the
    /// entry point, where the one that is drawn first is behind the other.
    fn add_space(&self, scene: &mut Scene, q: &Joints) {
        let sector = self.room.sector(self.goal);
        let taken = self.room.taken(self.goal, q);
        scene.surfaces.push(SurfaceInstance {
            mesh: Arc::new(voxel_surface(&sector.grid, &taken)),
            world_from_surface: Pose::identity(),
            color_rgba: TAKEN,
        });
        scene.surfaces.push(hemisphere(sector));
    }

    /// People's lines of sight; one label for each stature.
    fn add_sight(&self, scene: &mut Scene, q: &Joints, room: &RoomReport) {
        let all = self.room.obstacles().all(q);
        let mut sight = all.lines();
        let targets = self.room.targets(self.goal, q);
        for person in self.people() {
            for &stature_m in &person.statures_m {
                let eyes_m = person.eyes_m(stature_m);
                let segments =
                    sight_segments(&eyes_m, person.head_movement_m, &targets, LINES_DRAWN / 2);
                for [eye, target] in segments {
                    let (to_m, color_rgba) = match sight.first_on_the_way(&eye, &target) {
                        None => (target, SEEN),
                        Some((t, _)) => (eye + (target - eye) * t, HIDDEN),
                    };
                    scene.lines.push(Line3 {
                        from_m: eye,
                        to_m,
                        color_rgba,
                        width_px: 1.4,
                    });
                }
                let seen = room
                    .sight
                    .iter()
                    .find(|each| each.person == person.name && each.stature_m == stature_m);
                if let Some(seen) = seen {
                    scene.labels.push(Label {
                        text: format!(
                            "{} sees {:.0} %",
                            seen.person_in_words,
                            100.0 * seen.fraction
                        ),
                        anchor: Anchor::World(eyes_m),
                    });
                }
            }
        }
    }
}

/// The hemisphere about an entry point.
fn hemisphere(sector: &Sector) -> SurfaceInstance {
    let outwards = UnitQuaternion::rotation_between(&-Vector3::z(), &sector.outwards)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
    SurfaceInstance {
        mesh: Arc::new(cone(FRAC_PI_2, sector.radius_m)),
        world_from_surface: Pose::from_parts(sector.center_m.coords.into(), outwards),
        color_rgba: FREE,
    }
}

/// Entry point with its sector, robot and everybody's eyes.
fn camera(resolved: &ResolvedScenario, room: &RoomModel<'_>, goal: usize) -> Camera {
    let base = Point3::from(resolved.cell.robot.world_from_base_link.translation.vector);
    let center = room.sector(goal).center_m;
    let mut points = Vec::new();
    for corner in [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]] {
        let [x, y] = corner;
        for height_m in [-0.1, 0.35] {
            points.push(base + Vector3::new(0.15 * x, 0.15 * y, height_m));
        }
        for height_m in [-0.25, SECTOR_RADIUS_M] {
            let level = Vector3::new(x, y, 0.0) * SECTOR_RADIUS_M;
            points.push(center + level + Vector3::z() * height_m);
        }
    }
    for person in &resolved.people.by_goal[goal] {
        let over = Vector3::z() * HEADROOM_M;
        points.extend(person.statures_m.iter().map(|m| person.eyes_m(*m) + over));
    }
    Camera::framing(&points, viewpoint(resolved, &resolved.goals[goal]), SIZE_PX)
}

fn ball(center: Point3<f64>, radius_m: f64, color_rgba: [f32; 4]) -> SurfaceInstance {
    SurfaceInstance {
        mesh: Arc::new(Shape::Sphere { radius_m }.surface(CHORD_ERROR_M)),
        world_from_surface: Pose::translation(center.x, center.y, center.z),
        color_rgba,
    }
}

/// A person's body up to the shoulders of the shortest stature.
fn body(person: &Person) -> SurfaceInstance {
    /// Radius of the figure, and height of its shoulders as a share of the stature.
    const RADIUS_M: f64 = 0.12;
    const SHOULDERS: f64 = 0.82;
    let shortest_m = person.statures_m.iter().copied().fold(f64::MAX, f64::min);
    let half_length_m = 0.5 * (SHOULDERS * shortest_m - 2.0 * RADIUS_M);
    let capsule = Shape::Capsule {
        radius_m: RADIUS_M,
        half_length_m,
    };
    let middle = person.position_m + Vector3::z() * (half_length_m + RADIUS_M);
    SurfaceInstance {
        mesh: Arc::new(capsule.surface(CHORD_ERROR_M)),
        world_from_surface: Pose::translation(middle.x, middle.y, middle.z),
        color_rgba: BODY,
    }
}

/// Cone with its apex at the origin, about -z, up to a round cap.
fn cone(half_angle_rad: f64, length_m: f64) -> TriangleMesh {
    const AROUND: u32 = 48;
    const RINGS: u32 = 8;
    let mut mesh = TriangleMesh {
        vertices_m: vec![Point3::origin(), Point3::new(0.0, 0.0, -length_m)],
        triangles: Vec::new(),
    };
    // Rings of the cap from the rim inwards.
    for ring in 0..RINGS {
        let angle = half_angle_rad * (1.0 - f64::from(ring) / f64::from(RINGS));
        for step in 0..AROUND {
            let (sine, cosine) = libm::sincos(TAU * f64::from(step) / f64::from(AROUND));
            let level_m = length_m * libm::sin(angle);
            mesh.vertices_m.push(Point3::new(
                level_m * cosine,
                level_m * sine,
                -length_m * libm::cos(angle),
            ));
        }
    }
    let at = |ring: u32, step: u32| 2 + ring * AROUND + step % AROUND;
    for step in 0..AROUND {
        mesh.triangles.push([0, at(0, step), at(0, step + 1)]);
        for ring in 1..RINGS {
            let [a, b] = [at(ring - 1, step), at(ring - 1, step + 1)];
            let [c, d] = [at(ring, step), at(ring, step + 1)];
            mesh.triangles.extend([[a, c, b], [b, c, d]]);
        }
        let last = RINGS - 1;
        mesh.triangles.push([1, at(last, step + 1), at(last, step)]);
    }
    mesh
}

fn title(shown: &Shown<'_>, room: &RoomReport) -> String {
    let report = shown.configuration;
    let status = status_in_words(shown);
    format!(
        "{}\n{status}\nelbow {} ({:+.0} mm)",
        report.label,
        if room.elbow_up { "up" } else { "down" },
        1e3 * room.elbow_over_entry_m
    )
}

fn numbers(room: &RoomReport) -> String {
    let mut lines = vec![format!("free {:.0} %", 100.0 * room.free_fraction)];
    lines.extend(
        room.regions
            .iter()
            .map(|(name, free)| format!("  {name} {:.0} %", 100.0 * free)),
    );
    lines.push(format!(
        "line of sight {:.0} %",
        100.0 * room.sight_fraction
    ));
    let blocker = room
        .hand_cone_blocker
        .as_ref()
        .map_or(String::new(), |name| format!(" ({})", part_in_words(name)));
    lines.push(format!(
        "hand cone {:.0} deg{blocker}",
        room.hand_cone_half_angle_rad.to_degrees()
    ));
    lines.join("\n")
}

/// Caption of a configuration on the sheet.
pub(crate) fn room_caption(goal: &GoalReport, report: &ConfigurationReport) -> String {
    let Some(room) = &report.room else {
        return sheet_caption(goal, report);
    };
    format!(
        "{}\nfree {:.0} %, line of sight {:.0} %, hand cone {:.0} deg",
        sheet_caption(goal, report),
        100.0 * room.free_fraction,
        100.0 * room.sight_fraction,
        room.hand_cone_half_angle_rad.to_degrees()
    )
}
