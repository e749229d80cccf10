//! Figure 6 in numbers: heights of the arm, free space around it, and the effect of roll about the needle.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_cell::{BodyKind, Cell};
use needlebench_evaluation::room::{Obstacles, VoxelGrid};
use needlebench_input::Finding;
use needlebench_kinematics::ik::closed_form;
use needlebench_kinematics::{Joints, UrGeometry};
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};
use serde::Serialize;

use super::dh::{Arm, origin};
use super::equations::SEED;
use super::printed::FIGURE_6;
use super::table_3::{Table3Report, exact_pose, pose_of};
use super::{PaperError, Watch};

/// Height of the base plane in the world, m.
pub const BASE_HEIGHT_M: f64 = 0.8;

/// The bundled UR3 on a column with a bundled tool; the world's x and y are the controller's.
///
/// # Errors
/// Findings about the bundled models, which are a bug in needlebench.
pub fn resolve(tool: &str) -> Result<ResolvedScenario, Vec<Finding>> {
    let text = format!(
        "name = \"paper\"\nseed = {SEED}\n\
         [robot]\nbase_position_mm = [0, 0, 800]\nbase_rpy_deg = [0, 0, 180]\n[mount]\n\
         [tool]\nurdf = \"{tool}\"\nmount_rotation_deg = 90\n\
         [[goals]]\nname = \"pose\"\ninsertion_length_mm = 86\n\
         [goals.flange_pose]\nposition_mm = [194.2, -359.3, 170.1]\n\
         rotation_vector_rad = [-0.8567, 2.7197, -1.1407]\n"
    );
    resolve_scenario("builtin:paper", &text, Path::new(""), &Overrides::default())
}

/// Regions that the physician may use, seen from the guide's exit. Patient position as in
/// `scenarios/table3.toml`: across in front of the robot, head towards the base's +x, which is on the
/// left seen from the robot to the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// `x` above the guide's: the patient's head, the robot's left.
    HeadLeft,
    /// `x` below the guide's: the patient's feet, the robot's right.
    FeetRight,
    /// `y` below the guide's: across the patient.
    FarSide,
    /// `y` above the guide's: the side of the robot.
    RobotSide,
    /// Higher than the guide's entry.
    Above,
}

/// Regions and their names.
pub const REGIONS: [(Region, &str); 5] = [
    (Region::HeadLeft, "head (left)"),
    (Region::FeetRight, "feet (right)"),
    (Region::FarSide, "far side"),
    (Region::RobotSide, "robot side"),
    (Region::Above, "above"),
];

impl Region {
    fn all() -> impl Iterator<Item = Self> {
        REGIONS.into_iter().map(|(region, _)| region)
    }

    /// `offset` is from the guide's exit; `entry_height_m` that of the guide's entry over it.
    fn contains(self, offset: &Vector3<f64>, entry_height_m: f64) -> bool {
        match self {
            Self::HeadLeft => offset.x > 0.0,
            Self::FeetRight => offset.x < 0.0,
            Self::FarSide => offset.y < 0.0,
            Self::RobotSide => offset.y > 0.0,
            Self::Above => offset.z > entry_height_m,
        }
    }
}

/// One configuration of Figure 6.
#[derive(Debug, Clone, Serialize)]
pub struct ConfigurationSpace {
    pub label: &'static str,
    /// Panel of the paper's Figure 6, `a` to `h`.
    pub figure_6: &'static str,
    pub joints_rad: [f64; 6],
    /// Heights of the origins of DH frames 1 to 6 above the base plane, m.
    pub joint_heights_m: [f64; 6],
    pub lowest_joint_m: f64,
    /// Height of the elbow axis, m.
    pub elbow_m: f64,
    /// Lowest and highest point of the arm's and tool's collision shapes beyond the base link, m.
    pub lowest_surface_m: f64,
    pub highest_surface_m: f64,
    /// Free share of each region, farther than the margin from arm and tool, 0 to 1.
    pub free: BTreeMap<Region, f64>,
    /// Volume free here but occupied in at least half of the other configurations, m^3.
    pub gained_m3: BTreeMap<Region, f64>,
    /// Regions in which it gains at least a fifth more than the mean of all configurations, most
    /// first; if there is none, the one where it gains most against the mean.
    pub room_is_left: Vec<Region>,
}

impl ConfigurationSpace {
    /// Names of the regions with gained free space.
    pub fn room(&self) -> String {
        let name = |region: &Region| REGIONS[*region as usize].1;
        self.room_is_left
            .iter()
            .map(name)
            .collect::<Vec<_>>()
            .join(", ")
    }
}

/// Postures on the needle axis of the pose, by the roll about it.
#[derive(Debug, Clone, Serialize)]
pub struct RollReport {
    pub tool: String,
    /// Number of steps over 360 deg.
    pub steps: usize,
    pub fewest_solutions: usize,
    pub most_solutions: usize,
    /// Lowest joint above the base plane: of the worst and of the best solution over all rolls, m.
    pub lowest_joint_worst_m: f64,
    pub lowest_joint_best_m: f64,
    /// Largest motion of joints 1 to 5 over all rolls within a configuration, rad.
    pub other_joints_move_rad: f64,
    /// Roll rotates wrist 3 only.
    pub roll_is_wrist_3: bool,
}

/// Figure 6 in numbers.
#[derive(Debug, Clone, Serialize)]
pub struct FreeSpaceReport {
    /// The box: about the guide's exit in x and y, from the base plane up.
    pub box_half_width_m: f64,
    pub box_height_m: f64,
    pub cell_m: f64,
    /// Points closer to the arm than this are occupied.
    pub margin_m: f64,
    pub guide_exit_m: [f64; 3],
    pub configurations: Vec<ConfigurationSpace>,
    pub roll: Vec<RollReport>,
    pub roll_remark: &'static str,
}

const BOX_HALF_WIDTH_M: f64 = 0.6;
const BOX_HEIGHT_M: f64 = 0.8;
const CELL_M: f64 = 0.025;
/// Cubes across and up the box.
const CELLS: [usize; 3] = [48, 48, 32];
/// Margin for a hand or a forearm.
const MARGIN_M: f64 = 0.1;

/// Data of the images, besides the numbers.
pub struct Space {
    pub report: FreeSpaceReport,
    pub grid: VoxelGrid,
    /// By configuration: cells that are free here but occupied in at least half of the others.
    pub gained: Vec<Vec<bool>>,
}

/// Measures all eight configurations.
pub fn measure(
    resolved: &ResolvedScenario,
    table: &Table3Report,
    watch: &Watch<'_>,
) -> Result<Space, PaperError> {
    let cell = &resolved.cell;
    let postures = table.rows.iter().map(|row| Joints::from(row.joints_rad));
    let first = Joints::from(table.rows[0].joints_rad);
    let exit_m = Point3::from(cell.world_from_guide_exit(&first).translation.vector);
    let entry = cell.robot.world_from_flange(&first) * cell.tool.flange_from_guide_entry;
    let entry_height_m = entry.translation.vector.z - exit_m.z;
    let grid = VoxelGrid {
        corner_m: Point3::new(
            exit_m.x - BOX_HALF_WIDTH_M,
            exit_m.y - BOX_HALF_WIDTH_M,
            BASE_HEIGHT_M,
        ),
        cells: CELLS,
        voxel_m: CELL_M,
    };
    let obstacles = Obstacles::new(cell);
    let taken = |q| obstacles.robot(&q).taken(&grid, MARGIN_M);
    let taken: Vec<Vec<bool>> = postures.map(taken).collect();
    watch.check()?;
    let free: Vec<Vec<bool>> = taken
        .iter()
        .map(|cells| cells.iter().map(|taken| !taken).collect())
        .collect();
    let is_gained = |own: &Vec<bool>, index: usize| {
        let others = taken.iter().filter(|each| each[index]).count();
        own[index] && 2 * others >= taken.len() - 1
    };
    let gained: Vec<Vec<bool>> = free
        .iter()
        .map(|own| (0..grid.len()).map(|index| is_gained(own, index)).collect())
        .collect();
    let cells_by_region = |set: &[bool]| {
        REGIONS.map(|(region, _)| {
            let inside = |index: &usize| {
                set[*index] && region.contains(&(grid.center_m(*index) - exit_m), entry_height_m)
            };
            (0..grid.len()).filter(inside).count() as f64
        })
    };
    let by_region = |values: [f64; 5]| Region::all().zip(values).collect::<BTreeMap<_, _>>();
    let all = cells_by_region(&vec![true; grid.len()]);
    let volumes = |set: &Vec<bool>| cells_by_region(set).map(|cells| cells * CELL_M.powi(3));
    let gained_m3: Vec<_> = gained.iter().map(|set| by_region(volumes(set))).collect();
    let rows = table.rows.iter().zip(&free).enumerate();
    let configurations = rows.map(|(index, (row, free))| {
        let joint_heights_m = joint_heights_m(&row.joints_rad);
        let [lowest_surface_m, highest_surface_m] =
            surface_heights_m(cell, &Joints::from(row.joints_rad));
        let mut figure_6 = FIGURE_6.into_iter();
        let free = cells_by_region(free);
        ConfigurationSpace {
            label: row.label,
            figure_6: figure_6
                .find(|(_, label)| *label == row.label)
                .unwrap_or_default()
                .0,
            joints_rad: row.joints_rad,
            joint_heights_m,
            lowest_joint_m: lowest(joint_heights_m),
            elbow_m: joint_heights_m[1],
            lowest_surface_m,
            highest_surface_m,
            free: by_region(std::array::from_fn(|region| {
                free[region] / all[region].max(1.0)
            })),
            gained_m3: gained_m3[index].clone(),
            room_is_left: room_is_left(&gained_m3, index),
        }
    });
    Ok(Space {
        report: FreeSpaceReport {
            box_half_width_m: BOX_HALF_WIDTH_M,
            box_height_m: BOX_HEIGHT_M,
            cell_m: CELL_M,
            margin_m: MARGIN_M,
            guide_exit_m: (exit_m - Vector3::z() * BASE_HEIGHT_M).coords.into(),
            configurations: configurations.collect(),
            roll: TOOLS.into_iter().map(roll).collect::<Result<_, _>>()?,
            roll_remark: "Roll about the needle is free: the task has five degrees of freedom. \
                          A guide on the flange axis turns that freedom into wrist 3 alone; any \
                          other guide turns it into a choice of postures.",
        },
        grid,
        gained,
    })
}

/// A region counts as gained if a configuration gains this many times the mean there.
const HAS_ROOM: f64 = 1.2;
/// Regions with a smaller mean gain do not distinguish configurations, m^3.
const LEAST_MEAN_M3: f64 = 1e-3;

/// See [`ConfigurationSpace::room_is_left`].
fn room_is_left(gained: &[BTreeMap<Region, f64>], own: usize) -> Vec<Region> {
    let mut ratios: Vec<(Region, f64)> = Region::all()
        .filter_map(|region| {
            let sum: f64 = gained.iter().map(|each| each[&region]).sum();
            let mean = sum / gained.len() as f64;
            (mean >= LEAST_MEAN_M3).then(|| (region, gained[own][&region] / mean))
        })
        .collect();
    ratios.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    let with_room = ratios
        .iter()
        .filter(|(_, ratio)| *ratio >= HAS_ROOM)
        .count();
    ratios.truncate(with_room.max(1));
    ratios.into_iter().map(|(region, _)| region).collect()
}

fn joint_heights_m(joints_rad: &[f64; 6]) -> [f64; 6] {
    let frames = Arm::<f64>::ur3().frames(joints_rad);
    std::array::from_fn(|i| origin(&frames[i + 1]).z)
}

fn lowest(heights_m: [f64; 6]) -> f64 {
    heights_m.into_iter().fold(f64::INFINITY, f64::min)
}

/// Fineness of curved collision shapes, m.
const CHORD_ERROR_M: f64 = 1e-3;

/// Lowest and highest point of all moving bodies, m.
fn surface_heights_m(cell: &Cell, q: &Joints) -> [f64; 2] {
    let mut bounds = [f64::INFINITY, f64::NEG_INFINITY];
    for (body, pose) in cell.bodies.iter().zip(cell.world_from_bodies(q)) {
        if !matches!(
            body.kind,
            BodyKind::Link | BodyKind::Tool | BodyKind::GuideTube
        ) {
            continue;
        }
        for solid in &body.solids {
            let world_from_shape = pose * solid.parent_from_shape;
            for vertex in &solid.shape.surface(CHORD_ERROR_M).vertices_m {
                let height = (world_from_shape * vertex).z - BASE_HEIGHT_M;
                bounds = [bounds[0].min(height), bounds[1].max(height)];
            }
        }
    }
    bounds
}

/// Number of rolls about the needle.
const ROLL_STEPS: usize = 360;

/// Tools that hold the needle in different ways.
const TOOLS: [&str; 3] = ["offset", "perpendicular", "inline"];

/// Effect of roll about the needle at the paper's pose, with a bundled tool.
fn roll(name: &str) -> Result<RollReport, PaperError> {
    let tool = resolve(name)?.cell.tool;
    let flange_from_guide = tool.flange_from_guide_exit;
    let base_from_guide = pose_of(&exact_pose()) * flange_from_guide;
    let (mut fewest, mut most) = (usize::MAX, 0);
    let (mut worst, mut best) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut ranges: BTreeMap<&str, [[f64; 2]; 5]> = BTreeMap::new();
    for step in 0..ROLL_STEPS {
        let roll_rad = TAU * step as f64 / ROLL_STEPS as f64;
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll_rad);
        let wanted = base_from_guide * turned * flange_from_guide.inverse();
        let found: Vec<_> = closed_form(&UrGeometry::UR3, &wanted, None)
            .solutions()
            .collect();
        fewest = fewest.min(found.len());
        most = most.max(found.len());
        for solution in found {
            let joints: [f64; 6] = solution.joints.into();
            let lowest_m = lowest(joint_heights_m(&joints));
            worst = worst.min(lowest_m);
            best = best.max(lowest_m);
            let range = ranges.entry(solution.configuration.label());
            let range = range.or_insert_with(|| std::array::from_fn(|joint| [joints[joint]; 2]));
            for (range, joint) in range.iter_mut().zip(joints) {
                *range = [range[0].min(joint), range[1].max(joint)];
            }
        }
    }
    let moves = ranges.values().flatten().map(|[low, high]| high - low);
    let other_joints_move_rad = moves.fold(0.0, f64::max);
    Ok(RollReport {
        tool: tool.name,
        steps: ROLL_STEPS,
        fewest_solutions: fewest,
        most_solutions: most,
        lowest_joint_worst_m: worst,
        lowest_joint_best_m: best,
        other_joints_move_rad,
        // Rounding of the closed form only.
        roll_is_wrist_3: other_joints_move_rad < 1e-9,
    })
}
