//! Figure 6 in numbers: how high the arm stands and where it leaves room.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use needlebench_cell::{BodyKind, Cell, Finding, Overrides, ResolvedScenario, resolve_scenario};
use needlebench_evaluation::room::{Obstacles, VoxelGrid};
use needlebench_kinematics::Joints;
use serde::Serialize;

use super::dh::{Arm, origin};
use super::table_3::Table3Report;
use super::{Interrupted, Watch};

/// Height of the base plane in the world, m.
pub const BASE_HEIGHT_M: f64 = 0.8;

/// The shipped UR3 on a column with a shipped tool; the world's x and y are the controller's.
fn scenario_text(tool: &str) -> String {
    format!(
        "name = \"paper\"\nseed = {seed}\n\
         [robot]\nbase_position_mm = [0, 0, 800]\nbase_rpy_deg = [0, 0, 180]\n[mount]\n\
         [tool]\nurdf = \"{tool}\"\nmount_rotation_deg = 90\n\
         [[goals]]\nname = \"pose\"\ninsertion_length_mm = 86\n\
         [goals.flange_pose]\nposition_mm = [194.2, -359.3, 170.1]\n\
         rotation_vector_rad = [-0.8567, 2.7197, -1.1407]\n",
        seed = super::equations::SEED
    )
}

/// The cell of the pictures.
///
/// # Errors
/// Findings about the shipped models, which would be our own bug.
pub fn resolve(tool: &str) -> Result<ResolvedScenario, Vec<Finding>> {
    let overrides = Overrides::default();
    resolve_scenario(
        "builtin:paper",
        &scenario_text(tool),
        std::path::Path::new(""),
        &overrides,
    )
}

/// Where a doctor may want room, seen from the guide's exit. The patient lies as in
/// `scenarios/table3.toml`: across in front of the robot, head towards the base's +x, which is the
/// left hand of whoever looks from the robot to the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// `x` above the guide's: the patient's head, the robot's left.
    HeadLeft,
    /// `x` below the guide's: the patient's feet, the robot's right.
    FeetRight,
    /// `y` below the guide's: across the patient.
    FarSide,
    /// `y` above the guide's: where the robot stands.
    RobotSide,
    /// Higher than the guide's entry.
    Above,
}

impl Region {
    pub const ALL: [Self; 5] = [
        Self::HeadLeft,
        Self::FeetRight,
        Self::FarSide,
        Self::RobotSide,
        Self::Above,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::HeadLeft => "head (left)",
            Self::FeetRight => "feet (right)",
            Self::FarSide => "far side",
            Self::RobotSide => "robot side",
            Self::Above => "above",
        }
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
    /// Picture of the paper's Figure 6 by its own label, `a` to `h`.
    pub figure_6: &'static str,
    pub joints_rad: [f64; 6],
    /// Heights of the origins of DH frames 1 to 6 over the base plane, m.
    pub joint_heights_m: [f64; 6],
    pub lowest_joint_m: f64,
    /// Height of the elbow's axis, m.
    pub elbow_m: f64,
    /// Lowest and highest point of the arm's and tool's collision shapes beyond the base link, m.
    pub lowest_surface_m: f64,
    pub highest_surface_m: f64,
    /// Share of each region that is farther than the margin from arm and tool, 0 to 1.
    pub free: BTreeMap<Region, f64>,
    /// Volume free here but taken in at least half of the other configurations, m^3.
    pub gained_m3: BTreeMap<Region, f64>,
    /// Regions in which it gains at least a fifth more than the mean of all configurations, most
    /// first; if there is none, the one where it gains most against the mean.
    pub room_is_left: Vec<Region>,
}

impl ConfigurationSpace {
    /// Names of the regions with room.
    pub fn room(&self) -> String {
        let names: Vec<&str> = self
            .room_is_left
            .iter()
            .map(|region| region.name())
            .collect();
        names.join(", ")
    }
}

/// How the needle line of the pose can be held, by the roll about it.
#[derive(Debug, Clone, Serialize)]
pub struct RollReport {
    pub tool: String,
    /// Steps over the whole circle.
    pub steps: usize,
    pub fewest_solutions: usize,
    pub most_solutions: usize,
    /// Lowest joint over the base plane: of the worst and of the best solution over all rolls, m.
    pub lowest_joint_worst_m: f64,
    pub lowest_joint_best_m: f64,
    /// Largest motion of joints 1 to 5 over all rolls within a configuration, rad.
    pub other_joints_move_rad: f64,
    /// Roll turns wrist 3 and nothing else.
    pub roll_is_wrist_3: bool,
}

/// Figure 6 in numbers.
#[derive(Debug, Clone, Serialize)]
pub struct FreeSpaceReport {
    /// The box: about the guide's exit in x and y, from the base plane up.
    pub box_half_width_m: f64,
    pub box_height_m: f64,
    pub cell_m: f64,
    /// Points nearer to the arm than this are taken.
    pub margin_m: f64,
    pub guide_exit_m: [f64; 3],
    pub configurations: Vec<ConfigurationSpace>,
    pub roll: Vec<RollReport>,
    pub roll_remark: &'static str,
}

const BOX_HALF_WIDTH_M: f64 = 0.6;
const BOX_HEIGHT_M: f64 = 0.8;
const CELL_M: f64 = 0.025;
/// Room for a hand or a forearm.
const MARGIN_M: f64 = 0.1;

/// The box cut into cubes.
fn grid_about(guide_exit_m: &Point3<f64>) -> VoxelGrid {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few dozen"
    )]
    let along = |length_m: f64| (length_m / CELL_M).round() as usize;
    let across = along(2.0 * BOX_HALF_WIDTH_M);
    VoxelGrid {
        corner_m: Point3::new(
            guide_exit_m.x - BOX_HALF_WIDTH_M,
            guide_exit_m.y - BOX_HALF_WIDTH_M,
            BASE_HEIGHT_M,
        ),
        cells: [across, across, along(BOX_HEIGHT_M)],
        voxel_m: CELL_M,
    }
}

/// What pictures need besides the numbers.
pub struct Space {
    pub report: FreeSpaceReport,
    pub grid: VoxelGrid,
    /// By configuration: cells that are free here but taken in at least half of the others.
    pub gained: Vec<Vec<bool>>,
}

/// Measures all eight configurations.
pub(super) fn measure(
    resolved: &ResolvedScenario,
    table: &Table3Report,
    watch: &Watch<'_>,
) -> Result<Space, Interrupted> {
    let cell = &resolved.cell;
    let Some(first) = table.rows.first() else {
        unreachable!("the pose of row 1 is reached by row 1");
    };
    let first = Joints::from(first.joints_rad);
    let exit = cell.world_from_guide_exit(&first);
    let exit_m = Point3::from(exit.translation.vector);
    let entry = cell.robot.world_from_flange(&first) * cell.tool.flange_from_guide_entry;
    let entry_height_m = entry.translation.vector.z - exit_m.z;
    let grid = grid_about(&exit_m);
    let obstacles = Obstacles::new(cell);
    let mut taken = Vec::new();
    for row in &table.rows {
        watch.check()?;
        let robot = obstacles.robot(&Joints::from(row.joints_rad));
        taken.push(robot.taken(&grid, MARGIN_M));
    }
    let gained: Vec<Vec<bool>> = (0..taken.len())
        .map(|own| {
            (0..grid.len())
                .map(|index| {
                    let others = taken.iter().filter(|each| each[index]).count();
                    !taken[own][index] && 2 * others >= taken.len() - 1
                })
                .collect()
        })
        .collect();
    let regions: Vec<Vec<Region>> = (0..grid.len())
        .map(|index| {
            let offset = grid.center_m(index) - exit_m;
            let contains = |region: &Region| region.contains(&offset, entry_height_m);
            Region::ALL.into_iter().filter(contains).collect()
        })
        .collect();
    let free: Vec<BTreeMap<Region, f64>> = taken
        .iter()
        .map(|cells| free_shares(cells, &regions))
        .collect();
    let gained_m3: Vec<BTreeMap<Region, f64>> = gained
        .iter()
        .map(|cells| volumes(cells, &regions))
        .collect();
    let configurations = table
        .rows
        .iter()
        .enumerate()
        .map(|(index, row)| {
            let joint_heights_m = joint_heights_m(&row.joints_rad);
            let (lowest_surface_m, highest_surface_m) =
                surface_heights_m(cell, &Joints::from(row.joints_rad));
            ConfigurationSpace {
                label: row.label,
                figure_6: figure_6(row.label),
                joints_rad: row.joints_rad,
                joint_heights_m,
                lowest_joint_m: joint_heights_m.into_iter().fold(f64::INFINITY, f64::min),
                elbow_m: joint_heights_m[1],
                lowest_surface_m,
                highest_surface_m,
                free: free[index].clone(),
                gained_m3: gained_m3[index].clone(),
                room_is_left: room_is_left(&gained_m3, index),
            }
        })
        .collect();
    Ok(Space {
        report: FreeSpaceReport {
            box_half_width_m: BOX_HALF_WIDTH_M,
            box_height_m: BOX_HEIGHT_M,
            cell_m: CELL_M,
            margin_m: MARGIN_M,
            guide_exit_m: (exit_m - Vector3::z() * BASE_HEIGHT_M).coords.into(),
            configurations,
            roll: Vec::new(),
            roll_remark: "Roll about the needle is free: the task has five degrees of freedom. \
                          A guide on the flange axis turns that freedom into wrist 3 alone; any \
                          other guide turns it into a choice of postures.",
        },
        grid,
        gained,
    })
}

fn free_shares(taken: &[bool], regions: &[Vec<Region>]) -> BTreeMap<Region, f64> {
    Region::ALL
        .into_iter()
        .map(|region| {
            let (mut all, mut free) = (0_usize, 0_usize);
            for (taken, _) in taken
                .iter()
                .zip(regions)
                .filter(|(_, of)| of.contains(&region))
            {
                all += 1;
                free += usize::from(!taken);
            }
            (region, free as f64 / all.max(1) as f64)
        })
        .collect()
}

fn volumes(cells: &[bool], regions: &[Vec<Region>]) -> BTreeMap<Region, f64> {
    Region::ALL
        .into_iter()
        .map(|region| {
            let pairs = cells.iter().zip(regions);
            let count = pairs
                .filter(|(cell, of)| **cell && of.contains(&region))
                .count();
            (region, count as f64 * CELL_M.powi(3))
        })
        .collect()
}

/// A region has room if a configuration gains this many times the mean there.
const HAS_ROOM: f64 = 1.2;
/// Regions where configurations gain less than this on average do not tell them apart, m^3.
const LEAST_MEAN_M3: f64 = 1e-3;

/// See [`ConfigurationSpace::room_is_left`].
fn room_is_left(gained: &[BTreeMap<Region, f64>], own: usize) -> Vec<Region> {
    let mut ratios: Vec<(Region, f64)> = Region::ALL
        .into_iter()
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

/// Letter of the paper's Figure 6 that bears a label.
fn figure_6(label: &str) -> &'static str {
    match label {
        "Left-Up-Unfold" => "a",
        "Left-Up-Fold" => "b",
        "Left-Down-Unfold" => "c",
        "Left-Down-Fold" => "d",
        "Right-Up-Unfold" => "e",
        "Right-Up-Fold" => "f",
        "Right-Down-Unfold" => "g",
        _ => "h",
    }
}

fn joint_heights_m(joints_rad: &[f64; 6]) -> [f64; 6] {
    let frames = Arm::<f64>::ur3().frames(joints_rad);
    std::array::from_fn(|i| origin(&frames[i + 1]).z)
}

pub(super) fn lowest_joint_m(joints_rad: &[f64; 6]) -> f64 {
    joint_heights_m(joints_rad)
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// Fineness of curved collision shapes, m.
const CHORD_ERROR_M: f64 = 1e-3;

fn surface_heights_m(cell: &Cell, q: &Joints) -> (f64, f64) {
    let poses = cell.world_from_bodies(q);
    let moving = cell.bodies.iter().zip(&poses).filter(|(body, _)| {
        matches!(
            body.kind,
            BodyKind::Link | BodyKind::Tool | BodyKind::GuideTube
        )
    });
    moving
        .flat_map(|(body, pose)| body.solids.iter().map(move |solid| (solid, pose)))
        .fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |bounds, (solid, pose)| {
                let world_from_shape = pose * solid.parent_from_shape;
                let vertices = solid.shape.surface(CHORD_ERROR_M).vertices_m;
                vertices.iter().fold(bounds, |(low, high), vertex| {
                    let height = (world_from_shape * vertex).z - BASE_HEIGHT_M;
                    (low.min(height), high.max(height))
                })
            },
        )
}
