//! Obstacles of a scenario: their shapes, and where they are.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use nalgebra::{Translation3, Vector3};
use needlebench_cell::CollisionBody;
use needlebench_geometry::mesh::{check_thickness, convex_hull, extent_m};
use needlebench_geometry::{PreparedShape, Shape, Solid};
use needlebench_input::{Finding, ModelSource, TomlText};
use needlebench_kinematics::Pose;

use super::mesh_file::{FileFault, MeshFile};
use super::unit::Kind;
use super::{pose_of, static_body};
use crate::fixtures::{Fixture, FixtureKind, world_from_gantry, world_from_table};
use crate::scenario::{AttachedTo, FileShape, ObstacleSection, ObstacleShape, Scenario};

/// Obstacles in pictures.
const COLOR_RGBA: [f32; 4] = [0.33, 0.52, 0.60, 1.0];

/// A shape before it is placed.
#[derive(Debug)]
pub(crate) struct UnplacedShape {
    shape: Shape,
    /// Where the shape's own origin is from the obstacle's, m.
    middle_m: Vector3<f64>,
    /// The file that it is from.
    source: Option<ModelSource>,
    prepared: OnceLock<PreparedShape>,
}

/// An obstacle at its place.
#[derive(Debug)]
pub(super) struct PlacedObstacle {
    /// Index of its section.
    pub index: usize,
    pub solid: Solid,
    shape: Arc<UnplacedShape>,
}

impl PlacedObstacle {
    /// Its shape, ready for distances, in its own frame.
    pub fn prepared(&self) -> &PreparedShape {
        let shape = &self.shape;
        shape
            .prepared
            .get_or_init(|| PreparedShape::new(&shape.shape))
    }
}

/// The obstacles that are there.
#[derive(Debug, Default)]
pub(super) struct PlacedObstacles {
    pub placed: Vec<PlacedObstacle>,
    /// Files of their shapes, each once.
    pub sources: Vec<ModelSource>,
}

impl PlacedObstacles {
    /// For pictures, one each.
    pub fn fixtures(&self) -> impl Iterator<Item = Fixture> + '_ {
        self.placed.iter().map(|obstacle| Fixture {
            kind: FixtureKind::Obstacle,
            solids: vec![obstacle.solid.clone()],
            color_rgba: COLOR_RGBA,
        })
    }

    /// As bodies of the cell.
    pub fn bodies<'s>(
        &'s self,
        sections: &'s [ObstacleSection],
    ) -> impl Iterator<Item = CollisionBody> + 's {
        self.placed.iter().map(|obstacle| {
            let section = &sections[obstacle.index];
            let solids = vec![obstacle.solid.clone()];
            static_body(&section.name, section.class.kind(), solids)
        })
    }
}

/// Places the obstacles that are there. What is not is looked at too, for a study that puts it there, but
/// for its file. `shape_of` makes the shape of a section, or has it.
pub(super) fn place_obstacles(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    world_from_base_link: &Pose,
    shape_of: impl Fn(usize, &ObstacleSection) -> Result<Arc<UnplacedShape>, Finding>,
) -> Result<PlacedObstacles, Vec<Finding>> {
    let (mut made, mut findings) = (PlacedObstacles::default(), Vec::new());
    for (index, section) in scenario.obstacles.iter().enumerate() {
        let parent = match section.attached_to {
            AttachedTo::World => Some(Pose::identity()),
            AttachedTo::Table => scenario.table.as_ref().map(world_from_table),
            AttachedTo::Gantry => scenario.gantry.as_ref().map(world_from_gantry),
            AttachedTo::RobotBase => Some(*world_from_base_link),
        };
        let Some(parent) = parent else {
            let what = section.attached_to.key();
            let message = format!(
                "obstacle `{}` is attached to the {what}, but there is no [{what}]",
                section.name
            );
            let key = format!("obstacles[{index}].attached_to");
            let finding = toml.finding(&key, message);
            findings.push(finding.hint(format!("add a [{what}], or attach it to the world")));
            continue;
        };
        if !section.present {
            continue;
        }
        let shape = match shape_of(index, section) {
            Ok(shape) => shape,
            Err(finding) => {
                findings.push(finding);
                continue;
            }
        };
        if let Some(source) = &shape.source
            && !made.sources.contains(source)
        {
            made.sources.push(source.clone());
        }
        let world_from_obstacle = parent * pose_of(section.position_mm, section.rpy_deg);
        made.placed.push(PlacedObstacle {
            index,
            solid: Solid {
                name: section.name.clone(),
                shape: shape.shape.clone(),
                parent_from_shape: world_from_obstacle * Translation3::from(shape.middle_m),
            },
            shape,
        });
    }
    if findings.is_empty() {
        Ok(made)
    } else {
        Err(findings)
    }
}

/// Refuses names that something else in the cell has: reports tell bodies and solids by them.
pub(super) fn check_obstacle_names<'n>(
    toml: &TomlText<'_>,
    sections: &[ObstacleSection],
    taken: impl Iterator<Item = &'n str>,
) -> Result<(), Finding> {
    /// Bodies that may be there or not, and parts of the arm and its tool.
    const ALWAYS: [&str; 8] = [
        "base",
        "tool",
        "guide_tube",
        "needle_corridor",
        "phantom",
        "table",
        "gantry",
        "mount",
    ];
    // Few obstacles, many parts: the names of the obstacles are what is looked up.
    let mut first_of = std::collections::BTreeMap::new();
    for (index, section) in sections.iter().enumerate() {
        first_of.entry(section.name.as_str()).or_insert(index);
    }
    if first_of.is_empty() {
        return Ok(());
    }
    let met = taken.chain(ALWAYS).filter_map(|name| first_of.get(name));
    let Some(&index) = met.min() else {
        return Ok(());
    };
    let key = format!("obstacles[{index}].name");
    let message = format!(
        "another body in the cell is named `{}`",
        sections[index].name
    );
    let finding = toml.finding(&key, message);
    Err(finding.hint("names identify bodies in reports: choose another"))
}

/// Makes the shape of an obstacle.
pub(super) fn unplaced_shape(
    toml: &TomlText<'_>,
    index: usize,
    section: &ObstacleSection,
    base: &Path,
) -> Result<UnplacedShape, Finding> {
    let half = |mm: f64| 0.5e-3 * mm;
    let ObstacleShape {
        cuboid,
        cylinder,
        capsule,
        sphere,
        convex,
        mesh,
    } = &section.shape;
    let shape = if let Some(cuboid) = cuboid {
        Shape::Cuboid {
            half_extents_m: Vector3::from(cuboid.size_mm.map(half)),
        }
    } else if let Some(round) = cylinder {
        Shape::Cylinder {
            radius_m: round.radius_mm * 1e-3,
            half_length_m: half(round.length_mm),
        }
    } else if let Some(round) = capsule {
        Shape::Capsule {
            radius_m: round.radius_mm * 1e-3,
            half_length_m: half(round.length_mm),
        }
    } else if let Some(sphere) = sphere {
        Shape::Sphere {
            radius_m: sphere.radius_mm * 1e-3,
        }
    } else {
        let (key, file) = match (convex, mesh) {
            (Some(file), _) => ("convex", file),
            (None, Some(file)) => ("mesh", file),
            // The section's own check wants a shape.
            (None, None) => {
                return Err(toml.finding(&format!("obstacles[{index}].shape"), "no shape"));
            }
        };
        let at = format!("obstacles[{index}].shape.{key}");
        return shape_of_file(toml, &at, section, file, key == "convex", base);
    };
    Ok(UnplacedShape {
        shape,
        middle_m: Vector3::zeros(),
        source: None,
        prepared: OnceLock::new(),
    })
}

fn shape_of_file(
    toml: &TomlText<'_>,
    key: &str,
    section: &ObstacleSection,
    file: &FileShape,
    hulled: bool,
    base: &Path,
) -> Result<UnplacedShape, Finding> {
    let at_file = format!("{key}.file");
    let faulty = |fault: FileFault| toml.finding(&at_file, fault.message).hint(fault.hint);
    let read = MeshFile::read(&file.file, base).map_err(faulty)?;
    let mut surface = read.surface(file.unit, file.flip);
    let kind = Kind::obstacle(read.has_unit || toml.span_of(&format!("{key}.unit")).is_some());
    read.check_unit(toml, key, &kind, file.unit)?;
    let what = format!("obstacle `{}`", section.name);
    if !hulled {
        read.check_closed(&surface, file.flip, &what)
            .map_err(faulty)?;
    }
    let refused = |why: String| {
        toml.finding(&at_file, format!("{}: {what}: {why}", read.file))
            .hint("a solid needs a volume; use `box` for a flat body")
    };
    // About its middle: coordinates far from their origin cost digits.
    let [low, high] = extent_m(&surface);
    let middle = nalgebra::center(&low, &high).coords;
    for vertex in &mut surface.vertices_m {
        *vertex -= middle;
    }
    let shape = if hulled {
        let hull = convex_hull(&surface.vertices_m).map_err(|why| refused(why.to_string()))?;
        Shape::Convex(Arc::new(hull))
    } else {
        check_thickness(&surface.vertices_m).map_err(|why| refused(why.to_string()))?;
        Shape::of_surface(surface)
    };
    Ok(UnplacedShape {
        shape,
        middle_m: middle,
        source: Some(read.source),
        prepared: OnceLock::new(),
    })
}
