//! Where the needle would go through the guide as it stands.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_cell::{Cell, Goal, PlacedPhantom};
use needlebench_kinematics::Pose;
use serde::Serialize;

/// Needle metrics of one pose of the flange.
///
/// The needle's tip is the point that it reaches when it is pushed through the guide, as it
/// stands, by the planned insertion length. With planned axis `u`, actual axis `v` through the
/// guide's exit `g`, target `t`:
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Default)]
pub struct NeedleMeasurement {
    /// `|p_tip - t|`, m.
    pub tip_position_error_m: f64,
    /// `(p_tip - t) . u`, m; positive is too deep.
    pub depth_error_m: f64,
    /// `|(I - v v^T)(t - g)|`, m: distance of the target from the actual axis.
    pub lateral_error_m: f64,
    /// `atan2(|u x v|, u . v)`, rad.
    pub needle_angle_error_rad: f64,
    /// Distance of the guide's exit from its planned place, m.
    pub guide_position_error_m: f64,
    /// Distance from the planned entry point to where the actual axis meets the skin, m; none
    /// without a phantom or where the axis misses it.
    pub entry_point_error_m: Option<f64>,
}

/// Tip of the needle in the world for a pose of the flange.
pub fn tip_of(cell: &Cell, goal: &Goal, world_from_flange: &Pose) -> Point3<f64> {
    world_from_flange
        * cell.tool.flange_from_guide_exit
        * Point3::new(0.0, 0.0, goal.insertion_length_m)
}

/// Measures the needle for a pose of the flange in the world; `roll_rad` is the planned roll.
pub fn measure_needle(
    cell: &Cell,
    phantom: Option<&PlacedPhantom>,
    goal: &Goal,
    world_from_flange: &Pose,
) -> NeedleMeasurement {
    let exit = world_from_flange * cell.tool.flange_from_guide_exit;
    measure_guide(phantom, goal, &exit)
}

/// Measures the needle for a pose of the guide's exit in the world, z along the insertion.
pub fn measure_guide(
    phantom: Option<&PlacedPhantom>,
    goal: &Goal,
    exit: &Pose,
) -> NeedleMeasurement {
    let exit_point = Point3::from(exit.translation.vector);
    let actual = exit.rotation * Vector3::z();
    let planned = goal.axis.into_inner();
    let tip = exit * Point3::new(0.0, 0.0, goal.insertion_length_m);
    let miss = tip - goal.target_m;
    let to_target = goal.target_m - exit_point;
    let entry_point_error_m = phantom.zip(goal.entry_m).and_then(|(placed, entry)| {
        let to_phantom = placed.world_from_phantom.inverse();
        let axis = UnitVector3::new_normalize(actual);
        let (enters_m, _) = placed.phantom.skin_intersection(
            &(to_phantom * exit_point),
            &UnitVector3::new_normalize(to_phantom.rotation * actual),
        )?;
        Some((exit_point + axis.into_inner() * enters_m - entry).norm())
    });
    NeedleMeasurement {
        tip_position_error_m: miss.norm(),
        depth_error_m: miss.dot(&planned),
        lateral_error_m: (to_target - actual * actual.dot(&to_target)).norm(),
        needle_angle_error_rad: planned.cross(&actual).norm().atan2(planned.dot(&actual)),
        guide_position_error_m: (exit_point.coords - goal.world_from_guide_exit.translation.vector)
            .norm(),
        entry_point_error_m,
    }
}
