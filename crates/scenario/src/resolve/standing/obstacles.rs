//! Whether obstacles can be where a scenario has them.

use needlebench_geometry::{PreparedShape, Solid, separation};
use needlebench_input::Finding;
use needlebench_kinematics::Pose;

use super::{Beside, Corners, FOOT_M, RIGID_M, SOFT_M, Standing, overlap};
use crate::fixtures::FixtureKind;
use crate::resolve::obstacles::PlacedObstacle;
use crate::scenario::{AttachedTo, ObstacleClass, ObstacleSection};

/// Something that an obstacle may go into.
struct Other<'s> {
    name: &'s str,
    solids: &'s [Solid],
    /// Depth that is none, m.
    allowed_m: f64,
}

impl Standing<'_> {
    /// Obstacles through the floor, the table, the gantry, the mount, the robot's base or the patient. What
    /// one is fixed to, or counts as, it may go into: it is built into that.
    pub(super) fn check_obstacles(&self, notes: &mut Vec<String>) -> Result<(), Finding> {
        if self.obstacles.is_empty() {
            return Ok(());
        }
        for obstacle in self.obstacles {
            let section = &self.scenario.obstacles[obstacle.index];
            let refuse = |message: String| Err(self.misplaced(obstacle, &message));
            let (low, _) = obstacle.solid.bounding_box();
            if low.z < -RIGID_M {
                return refuse(format!("extends {:.1} mm below the floor", -low.z * 1e3));
            }
            for other in self.others(section) {
                if let Some(depth_m) = depth_in(obstacle, &other) {
                    let depth_mm = depth_m * 1e3;
                    return refuse(format!("overlaps the {} by {depth_mm:.1} mm", other.name));
                }
            }
            if section.attached_to == AttachedTo::World && !self.is_carried(obstacle) {
                notes.push(format!(
                    "obstacle `{}` is {:.0} mm above the floor without support in the cell",
                    section.name,
                    low.z * 1e3
                ));
            }
        }
        self.check_obstacles_in_patient()
    }

    /// What an obstacle must not go into, but for the patient.
    fn others<'s>(&'s self, section: &ObstacleSection) -> Vec<Other<'s>> {
        let (fixed_to, counts_as) = (section.attached_to, section.class);
        let mut others = Vec::new();
        for (kind, name, is_part) in [
            (
                FixtureKind::Table,
                "table",
                fixed_to == AttachedTo::Table || counts_as == ObstacleClass::RobotTable,
            ),
            (
                FixtureKind::Gantry,
                "gantry's housing",
                fixed_to == AttachedTo::Gantry || counts_as == ObstacleClass::RobotGantry,
            ),
            (
                FixtureKind::Mount,
                "robot's mount",
                fixed_to == AttachedTo::RobotBase || counts_as == ObstacleClass::RobotMount,
            ),
        ] {
            if let (Some(fixture), false) = (self.fixture(kind), is_part) {
                others.push(Other {
                    name,
                    solids: &fixture.solids,
                    allowed_m: RIGID_M,
                });
            }
        }
        if fixed_to != AttachedTo::RobotBase {
            others.push(Other {
                name: "robot's base",
                solids: self.base,
                allowed_m: FOOT_M,
            });
        }
        others
    }

    /// Obstacles in the patient.
    pub(super) fn check_obstacles_in_patient(&self) -> Result<(), Finding> {
        let solids = self.obstacles.iter().map(|obstacle| &obstacle.solid);
        let Some((place, depth_m)) = self.depth_in_patient(Beside::Obstacles, solids, true) else {
            return Ok(());
        };
        let message = format!("overlaps the patient by {:.1} mm", depth_m * 1e3);
        Err(self.misplaced(&self.obstacles[place], &message))
    }

    fn misplaced(&self, obstacle: &PlacedObstacle, message: &str) -> Finding {
        let section = &self.scenario.obstacles[obstacle.index];
        let key = format!("obstacles[{}].position_mm", obstacle.index);
        let message = format!("obstacle `{}` {message}", section.name);
        self.toml.finding(&key, message).hint(frame(section))
    }

    /// Whether the floor or anything else is right under or beside an obstacle.
    fn is_carried(&self, obstacle: &PlacedObstacle) -> bool {
        let here = obstacle.solid.bounding_box();
        if here.0.z <= SOFT_M {
            return true;
        }
        let touches = |solid: &Solid| overlap(&here, &solid.bounding_box(), -SOFT_M);
        let others = self
            .obstacles
            .iter()
            .filter(|other| other.index != obstacle.index);
        self.fixtures
            .iter()
            .any(|each| each.solids.iter().any(touches))
            || self.base.iter().any(touches)
            || others.into_iter().any(|other| touches(&other.solid))
    }
}

/// How deep an obstacle is in something, m, if that is more than it may be.
fn depth_in(obstacle: &PlacedObstacle, other: &Other<'_>) -> Option<f64> {
    let solid = &obstacle.solid;
    let here: Corners = solid.bounding_box();
    let near = other.solids.iter();
    let near = near.filter(|each| overlap(&here, &each.bounding_box(), other.allowed_m));
    let depths = near.map(|each| depth_m(obstacle.prepared(), &solid.parent_from_shape, each));
    let deepest_m = depths.fold(0.0, f64::max);
    (deepest_m > other.allowed_m).then_some(deepest_m)
}

fn depth_m(shape: &PreparedShape, at: &Pose, other: &Solid) -> f64 {
    let prepared = PreparedShape::new(&other.shape);
    -separation(shape, at, &prepared, &other.parent_from_shape).distance_m
}

/// In which frame an obstacle's position is.
fn frame(section: &ObstacleSection) -> &'static str {
    match section.attached_to {
        AttachedTo::World => {
            "its position is that of the shape's centre, or of the file's origin, in the world: z up, \
             floor at 0, in millimetres"
        }
        AttachedTo::Table => {
            "its position is in the table's frame, in millimetres: from the centre of the upper face, x \
             along it, z up"
        }
        AttachedTo::Gantry => {
            "its position is in the gantry's frame, in millimetres: from the isocentre, x along the \
             bore, tilted with it"
        }
        AttachedTo::RobotBase => {
            "its position is in the frame of the robot's `base_link`, in millimetres, tilted and hanging \
             with it"
        }
    }
}
