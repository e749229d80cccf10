//! The cell as surfaces, and the arm's chain.

use needlebench_cell::fixtures::{Fixture, FixtureKind};
use needlebench_cell::phantom::{PhantomPart, Tissue};
use needlebench_cell::{BodyKind, Frame, PlacedPhantom, ResolvedScenario, Robot, Tool};
use needlebench_geometry::{Shape, Solid, TriangleMesh, Visual};
use needlebench_kinematics::{Chain, Pose};
use serde_json::{Value, json};

use super::explore::goes_with_base;
use super::mesh::{MOST_TRIANGLES, append, joined, surface, thinned};
use super::pack::Pack;

/// Fineness of curved surfaces, m.
const CHORD_ERROR_M: f64 = 1e-3;
/// Fineness of collision shapes, m.
const COLLISION_CHORD_ERROR_M: f64 = 2e-3;
/// Colour of collision shapes.
const COLLISION: [f32; 4] = [0.80, 0.47, 0.65, 0.5];
/// Colour of the needle corridor.
const CORRIDOR: [f32; 4] = [0.34, 0.71, 0.91, 0.35];
/// Colour of tools without surfaces for pictures.
const TOOL: [f32; 4] = [0.35, 0.37, 0.40, 1.0];

/// What a surface moves with: the robot's base where somebody moves that, nothing, one of the six links, or
/// the flange.
const BASE: i64 = -2;
const WORLD: i64 = -1;
const FLANGE: i64 = 6;

/// A pose as `[x, y, z, qx, qy, qz, qw]`, m.
pub(super) fn pose(pose: &Pose) -> Value {
    let (t, q) = (pose.translation.vector, pose.rotation);
    json!([t.x, t.y, t.z, q.i, q.j, q.k, q.w])
}

/// The chain that poses the links: `world_from_link = base * product of joint * turn(axis, q)`.
pub(super) fn chain(world_from_base_link: &Pose, chain: &Chain) -> Value {
    let joints: Vec<Value> = chain
        .joints
        .iter()
        .map(|joint| {
            let axis = joint.axis.into_inner();
            json!({"pose": pose(&joint.parent_from_joint), "axis": [axis.x, axis.y, axis.z]})
        })
        .collect();
    json!({
        "base": pose(world_from_base_link),
        "joints": joints,
        "flange": pose(&chain.wrist_3_from_flange),
    })
}

/// Surfaces that share group, frame and colour, as one.
struct Merged {
    group: &'static str,
    frame: i64,
    color_rgba: [f32; 4],
    mesh: TriangleMesh,
}

#[derive(Default)]
struct Surfaces(Vec<Merged>);

impl Surfaces {
    fn add(
        &mut self,
        group: &'static str,
        frame: i64,
        color_rgba: [f32; 4],
        mesh: &TriangleMesh,
        place: &Pose,
    ) {
        let same = |each: &Merged| {
            each.group == group && each.frame == frame && each.color_rgba == color_rgba
        };
        let at = self.0.iter().position(same).unwrap_or_else(|| {
            self.0.push(Merged {
                group,
                frame,
                color_rgba,
                mesh: TriangleMesh {
                    vertices_m: Vec::new(),
                    triangles: Vec::new(),
                },
            });
            self.0.len() - 1
        });
        append(&mut self.0[at].mesh, mesh, place);
    }

    /// Surfaces for pictures, or else the solids.
    fn add_body(
        &mut self,
        group: &'static str,
        frame: i64,
        visuals: &[Visual],
        solids: &[Solid],
        parent: &Pose,
    ) {
        for visual in visuals {
            let place = parent * visual.parent_from_visual;
            self.add(group, frame, visual.color_rgba, &visual.mesh, &place);
        }
        if visuals.is_empty() {
            self.add_solids(group, frame, TOOL, solids, parent);
        }
    }

    fn add_tool(&mut self, tool: &Tool) {
        let here = Pose::identity();
        if tool.visuals.is_empty() {
            self.add_solids("tool", FLANGE, TOOL, &tool.solids, &here);
            self.add_solids("tool", FLANGE, TOOL, &tool.guide_solids, &here);
        } else {
            self.add_body("tool", FLANGE, &tool.visuals, &[], &here);
        }
    }

    /// A patient, from the phantom's frame.
    fn add_phantom(&mut self, placed: &PlacedPhantom, place: &Pose) {
        for part in placed.phantom.parts.iter().chain(&placed.limbs) {
            self.add_tissue(part, place);
        }
    }

    fn add_tissue(&mut self, part: &PhantomPart, place: &Pose) {
        let (group, opacity) = match part.tissue {
            Tissue::Skin => ("skin", 0.22),
            Tissue::Organ => ("organ", 0.4),
            Tissue::Bone => ("bone", 1.0),
            Tissue::Fissure => ("organ", 0.5),
            Tissue::Vessel => ("vessel", 1.0),
            Tissue::Lesion => ("lesion", 1.0),
            Tissue::Marker => ("marker", 1.0),
        };
        let mut color_rgba = part.color_rgba;
        color_rgba[3] = opacity;
        self.add_solids(
            group,
            WORLD,
            color_rgba,
            std::slice::from_ref(&part.solid),
            place,
        );
    }

    /// Something that stands in the room, from the world.
    fn add_fixture(&mut self, fixture: &Fixture, frame: i64, place: &Pose) {
        let group = match fixture.kind {
            FixtureKind::Table => "table",
            FixtureKind::Gantry => "gantry",
            FixtureKind::Mount => "mount",
            FixtureKind::Obstacle => "obstacle",
        };
        for (color_rgba, solids) in fixture.by_color() {
            let solids: Vec<TriangleMesh> = solids
                .iter()
                .map(|solid| {
                    let mut placed = solid.shape.surface(CHORD_ERROR_M);
                    for vertex in &mut placed.vertices_m {
                        *vertex = solid.parent_from_shape * *vertex;
                    }
                    placed
                })
                .collect();
            self.add(group, frame, color_rgba, &joined(&solids), place);
        }
    }

    /// The links that move.
    fn add_links(&mut self, robot: &Robot) {
        for (frame, link) in (0..).zip(&robot.links) {
            let here = Pose::identity();
            self.add_body("robot", frame, &link.visuals, &link.solids, &here);
        }
    }

    /// The surfaces, each with at most so many triangles.
    fn finish(self, pack: &mut Pack, most: usize) -> Vec<Value> {
        let parts = self.0.into_iter().map(|each| {
            let mesh = thinned(&each.mesh, most);
            json!({
                "group": each.group,
                "frame": each.frame,
                "color": each.color_rgba,
                "surface": surface(pack, &mesh),
            })
        });
        parts.collect()
    }

    fn add_solids(
        &mut self,
        group: &'static str,
        frame: i64,
        color_rgba: [f32; 4],
        solids: &[Solid],
        parent: &Pose,
    ) {
        for solid in solids {
            let mesh = solid.shape.surface(match solid.shape {
                Shape::Sphere { .. } | Shape::Capsule { .. } => COLLISION_CHORD_ERROR_M,
                _ => CHORD_ERROR_M,
            });
            let place = parent * solid.parent_from_shape;
            self.add(group, frame, color_rgba, &mesh, &place);
        }
    }
}

/// The document's part on what a cell looks like.
pub(super) fn surroundings(resolved: &ResolvedScenario, pack: &mut Pack) -> Value {
    let cell = &resolved.cell;
    let robot = &cell.robot;
    let mut surfaces = Surfaces::default();
    surfaces.add_body(
        "robot",
        BASE,
        &robot.base.visuals,
        &robot.base.solids,
        &robot.world_from_base_link,
    );
    surfaces.add_links(robot);
    let tool = &cell.tool;
    let here = Pose::identity();
    surfaces.add_tool(tool);
    for fixture in &resolved.fixtures {
        let ties = fixture.solids.iter();
        let mut ties = ties.map(|solid| goes_with_base(resolved, &solid.name));
        let frame = if fixture.kind == FixtureKind::Mount || ties.any(|tied| tied) {
            BASE
        } else {
            WORLD
        };
        surfaces.add_fixture(fixture, frame, &here);
    }
    if let Some(placed) = &resolved.phantom {
        surfaces.add_phantom(placed, &placed.world_from_phantom);
    }
    for body in &cell.bodies {
        let (group, color_rgba) = match body.kind {
            BodyKind::NeedleCorridor => ("corridor", CORRIDOR),
            BodyKind::Base | BodyKind::Link | BodyKind::Tool | BodyKind::GuideTube => {
                ("collision", COLLISION)
            }
            _ => continue,
        };
        let frame = match body.frame {
            Frame::World => BASE,
            Frame::Link(link) => i64::try_from(link).expect("six links"),
        };
        surfaces.add_solids(group, frame, color_rgba, &body.solids, &here);
    }
    let parts = surfaces.finish(pack, MOST_TRIANGLES);
    json!({
        "chain": chain(&robot.world_from_base_link, &robot.chain),
        "guide": [pose(&tool.flange_from_guide_entry), pose(&tool.flange_from_guide_exit)],
        "needleLength": tool.needle.length_m,
        "parts": parts,
    })
}

/// The arm of a scenario alone: its chain and the links that move.
pub(super) fn arm(robot: &Robot, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    surfaces.add_links(robot);
    json!({
        "chain": chain(&robot.world_from_base_link, &robot.chain),
        "parts": surfaces.finish(pack, MOST_TRIANGLES),
    })
}

/// Triangles of a surface of which there may be many kinds on a page.
const MOST_TRIANGLES_OF_A_KIND: usize = 3000;

/// A tool, in the flange's frame.
pub(super) fn tool(tool: &Tool, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    surfaces.add_tool(tool);
    json!({
        "guide": [pose(&tool.flange_from_guide_entry), pose(&tool.flange_from_guide_exit)],
        "parts": surfaces.finish(pack, MOST_TRIANGLES_OF_A_KIND),
    })
}

/// The link of an arm that does not move, in its own frame.
pub(super) fn base(robot: &Robot, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    let (link, here) = (&robot.base, Pose::identity());
    surfaces.add_body("robot", WORLD, &link.visuals, &link.solids, &here);
    Value::Array(surfaces.finish(pack, MOST_TRIANGLES))
}

/// Parts of a patient, in the frame that they are in.
pub(super) fn tissues(parts: &[PhantomPart], pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    for part in parts {
        surfaces.add_tissue(part, &Pose::identity());
    }
    Value::Array(surfaces.finish(pack, MOST_TRIANGLES_OF_A_KIND))
}

/// Something that stands in the room, in the frame that it is in.
pub(super) fn fixture(fixture: &Fixture, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    surfaces.add_fixture(fixture, WORLD, &Pose::identity());
    Value::Array(surfaces.finish(pack, MOST_TRIANGLES))
}
