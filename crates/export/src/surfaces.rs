//! What a cell looks like: surfaces by what they move with, for pages and for other tools.

use nalgebra::Point3;
use needlebench_cell::{BodyKind, Frame, Robot, Tool};
use needlebench_geometry::{Shape, Solid, TriangleMesh, Visual};
use needlebench_kinematics::Pose;
use needlebench_phantom::{PhantomPart, Tissue};
use needlebench_scenario::fixtures::{Fixture, FixtureKind};
use needlebench_scenario::scenario::AttachedTo;
use needlebench_scenario::{PlacedPhantom, ResolvedScenario};

/// Fineness of curved surfaces, m.
const CHORD_ERROR_M: f64 = 1e-3;
/// Fineness of collision shapes, m.
const COLLISION_CHORD_ERROR_M: f64 = 2e-3;
/// Colour of collision shapes.
const COLLISION: [f32; 4] = [0.80, 0.47, 0.65, 0.5];
/// Colour of the access zone.
const CORRIDOR: [f32; 4] = [0.34, 0.71, 0.91, 0.35];
/// Colour of tools without surfaces for pictures.
const TOOL: [f32; 4] = [0.35, 0.37, 0.40, 1.0];

/// What a surface moves with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MovesWith {
    /// The robot's base, where somebody moves that; in the world.
    Base,
    /// Nothing; in the world.
    World,
    /// One of the six links, in its frame.
    Link(usize),
    /// The flange, in its frame.
    Flange,
}

use MovesWith::{Base, Flange, Link, World};

/// Surfaces that share group, frame and colour, as one.
#[derive(Debug, Clone, PartialEq)]
pub struct MergedSurface {
    /// What it is of: `robot`, `tool`, `skin`, `beside` (arms, couch and objects of a scan), `assumed` (body behind
    /// its cuts), `organ`, `bone`, `vessel`, `lesion`, `marker`, `table`, `gantry`, `mount`, `obstacle`, `corridor`,
    /// `collision`.
    pub group: &'static str,
    /// What it moves with.
    pub frame: MovesWith,
    /// Red, green, blue, opacity, each 0 to 1 (sRGB).
    pub color_rgba: [f32; 4],
    /// The surface, m.
    pub mesh: TriangleMesh,
}

/// Surfaces, merged as they come.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surfaces(pub Vec<MergedSurface>);

impl Surfaces {
    fn add(
        &mut self,
        group: &'static str,
        frame: MovesWith,
        color_rgba: [f32; 4],
        mesh: &TriangleMesh,
        place: &Pose,
    ) {
        let same = |each: &MergedSurface| {
            each.group == group && each.frame == frame && each.color_rgba == color_rgba
        };
        let at = self.0.iter().position(same).unwrap_or_else(|| {
            self.0.push(MergedSurface {
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
    pub fn add_body(
        &mut self,
        group: &'static str,
        frame: MovesWith,
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

    /// A tool, from the flange.
    pub fn add_tool(&mut self, tool: &Tool) {
        let here = Pose::identity();
        if tool.visuals.is_empty() {
            self.add_solids("tool", Flange, TOOL, &tool.solids, &here);
            self.add_solids("tool", Flange, TOOL, &tool.guide_solids, &here);
        } else {
            self.add_body("tool", Flange, &tool.visuals, &[], &here);
        }
    }

    /// A patient, from the phantom's frame.
    pub(crate) fn add_phantom(&mut self, placed: &PlacedPhantom, place: &Pose) {
        for part in placed.phantom.parts.iter().chain(&placed.limbs) {
            self.add_tissue(part, place);
        }
    }

    /// A part of a patient.
    pub fn add_tissue(&mut self, part: &PhantomPart, place: &Pose) {
        let (group, opacity) = match part.tissue {
            Tissue::Skin => ("skin", 0.22),
            Tissue::Beside => ("beside", 0.5),
            Tissue::Assumed => ("assumed", 0.3),
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
            World,
            color_rgba,
            std::slice::from_ref(&part.solid),
            place,
        );
    }

    /// Something that stands in the room, from the world.
    pub fn add_fixture(&mut self, fixture: &Fixture, frame: MovesWith, place: &Pose) {
        let group = match fixture.kind {
            FixtureKind::Table => "table",
            FixtureKind::Gantry => "gantry",
            FixtureKind::Mount => "mount",
            FixtureKind::Obstacle => "obstacle",
            FixtureKind::Person => "person",
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
    pub fn add_links(&mut self, robot: &Robot) {
        for (frame, link) in robot.links.iter().enumerate() {
            let here = Pose::identity();
            self.add_body("robot", Link(frame), &link.visuals, &link.solids, &here);
        }
    }

    fn add_solids(
        &mut self,
        group: &'static str,
        frame: MovesWith,
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

/// All of a cell: arm, tool, what stands around, the patient; and besides, as groups of their own, the
/// access zone and the collision shapes of arm and tool.
pub fn surfaces_of_cell(resolved: &ResolvedScenario) -> Surfaces {
    let cell = &resolved.cell;
    let robot = &cell.robot;
    let mut surfaces = Surfaces::default();
    surfaces.add_body(
        "robot",
        Base,
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
            Base
        } else {
            World
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
            Frame::World => Base,
            Frame::Link(link) => Link(link),
        };
        surfaces.add_solids(group, frame, color_rgba, &body.solids, &here);
    }
    surfaces
}

/// Whether something of the cell goes where the robot's base goes.
fn goes_with_base(resolved: &ResolvedScenario, name: &str) -> bool {
    let mut obstacles = resolved.scenario.obstacles.iter();
    obstacles.any(|each| each.name == name && each.attached_to == AttachedTo::RobotBase)
}

/// Adds a copy of a mesh at a place.
fn append(to: &mut TriangleMesh, mesh: &TriangleMesh, place: &Pose) {
    let first = u32::try_from(to.vertices_m.len()).expect("meshes are far below 2^32 vertices");
    to.vertices_m
        .extend(mesh.vertices_m.iter().map(|vertex| place * vertex));
    to.triangles.extend(
        mesh.triangles
            .iter()
            .map(|corners| corners.map(|corner| corner + first)),
    );
}

/// Touching solids as one surface, without the walls between them: nobody sees those, but they flicker
/// along the seams. A triangle is left out where its middle and all its corners, a little in front of
/// it and off its edges, are within another solid.
fn joined(solids: &[TriangleMesh]) -> TriangleMesh {
    const IN_FRONT_M: f64 = 1e-4;
    const OFF_THE_EDGES: f64 = 0.02;
    let mut whole = TriangleMesh {
        vertices_m: Vec::new(),
        triangles: Vec::new(),
    };
    for (index, solid) in solids.iter().enumerate() {
        let mut seen = solid.clone();
        seen.triangles.retain(|corners| {
            let [a, b, c] = corners.map(|corner| solid.vertices_m[corner as usize].coords);
            let Some(normal) = (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE) else {
                return false;
            };
            let middle = (a + b + c) / 3.0;
            let is_covered = [a, b, c, middle].into_iter().all(|corner| {
                let point = corner.lerp(&middle, OFF_THE_EDGES) + normal * IN_FRONT_M;
                solids.iter().enumerate().any(|(other, each)| {
                    other != index && each.winding_number(&Point3::from(point)) != 0
                })
            });
            !is_covered
        });
        append(&mut whole, &seen, &Pose::identity());
    }
    whole
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Hiding the skin does not hide the couch.
    #[test]
    fn what_is_beside_the_patient_has_a_group_of_its_own() {
        let phantom = needlebench_phantom::Phantom::build(
            &needlebench_phantom::Phantom::size_preset("male-p50-supine").unwrap(),
        );
        let mut skin = phantom.unwrap().parts[0].clone();
        assert_eq!(skin.tissue, Tissue::Skin);
        let mut surfaces = Surfaces::default();
        surfaces.add_tissue(&skin, &Pose::identity());
        skin.tissue = Tissue::Beside;
        surfaces.add_tissue(&skin, &Pose::identity());
        let groups: Vec<&str> = surfaces.0.iter().map(|each| each.group).collect();
        assert_eq!(groups, ["skin", "beside"]);
    }

    #[test]
    fn walls_between_touching_solids_are_left_out() {
        let half_extents_m = Vector3::repeat(0.1);
        let cube = Shape::Cuboid { half_extents_m }.surface(1e-3);
        let beside = |x_m: f64, z_m: f64| {
            let mut moved = cube.clone();
            for vertex in &mut moved.vertices_m {
                *vertex += Vector3::new(x_m, 0.0, z_m);
            }
            moved
        };
        let count = cube.triangles.len();
        let face = count / 6;
        let joined_count = |x_m, z_m| joined(&[cube.clone(), beside(x_m, z_m)]).triangles.len();
        assert_eq!(joined_count(0.2, 0.0), 2 * count - 2 * face);
        // Apart, or covered in part: all is seen.
        assert_eq!(joined_count(0.21, 0.0), 2 * count);
        assert_eq!(joined_count(0.2, 0.1), 2 * count);
    }
}
