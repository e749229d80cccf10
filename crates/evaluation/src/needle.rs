//! Where the needle would go through the guide as it stands.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_cell::Cell;
use needlebench_kinematics::Pose;
use needlebench_scenario::{Goal, PlacedPhantom};
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
    /// `|(I - v v^T)(e - g)|`, m: distance of the planned entry point `e` from the actual axis; none
    /// without an entry point.
    pub entry_lateral_error_m: Option<f64>,
    /// Angle between planned and actual axis as the patient's axial plane shows them (left and posterior),
    /// rad; none without a phantom, and where the needle stands too steep to that plane
    /// ([`LEAST_SHADOW`]).
    pub axial_angle_error_rad: Option<f64>,
    /// The same in the sagittal plane (posterior and superior).
    pub sagittal_angle_error_rad: Option<f64>,
    /// `|p_tip - t'|`, m, with `t'` where the lesion really is; none where that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_target_error_m: Option<f64>,
    /// `|(I - v v^T)(t' - g)|`, m: distance of the true target from the actual axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_target_lateral_m: Option<f64>,
}

/// Shortest shadow of the planned needle's direction on a plane in which an angle is still measured: that of
/// a needle 60 degrees out of the plane. The angle of shadows is larger than that of needles by one over
/// it: beyond, it would say more about the plane than about the needle. Assumed.
pub const LEAST_SHADOW: f64 = 0.5;

/// Angle between the shadows of two directions on the plane of two axes, rad.
fn angle_of_shadows(
    planned: &Vector3<f64>,
    actual: &Vector3<f64>,
    axes: [usize; 2],
) -> Option<f64> {
    let [u, v] = [planned, actual].map(|each| [each[axes[0]], each[axes[1]]]);
    if libm::hypot(u[0], u[1]) < LEAST_SHADOW {
        return None;
    }
    let turned = libm::atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1]);
    Some(turned.abs())
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
    let aimed = goal.aimed_m();
    let (miss, to_target) = (tip - aimed, aimed - exit_point);
    let off_axis_m = |to: Vector3<f64>| (to - actual * actual.dot(&to)).norm();
    let in_plane = |axes: [usize; 2]| {
        let to_phantom = phantom?.world_from_phantom.rotation.inverse();
        angle_of_shadows(&(to_phantom * planned), &(to_phantom * actual), axes)
    };
    let entry_point_error_m = phantom.zip(goal.entry_m).and_then(|(placed, entry)| {
        let to_phantom = placed.world_from_phantom.inverse();
        let axis = UnitVector3::new_normalize(actual);
        let (enters_m, _) = placed.phantom.skin_intersection(
            &(to_phantom * exit_point),
            &UnitVector3::new_normalize(to_phantom.rotation * actual),
        )?;
        Some((exit_point + axis.into_inner() * enters_m - entry).norm())
    });
    let true_aimed = goal.true_target_m.map(|at| at + goal.aim_m);
    NeedleMeasurement {
        tip_position_error_m: miss.norm(),
        depth_error_m: miss.dot(&planned),
        lateral_error_m: off_axis_m(to_target),
        needle_angle_error_rad: libm::atan2(planned.cross(&actual).norm(), planned.dot(&actual)),
        guide_position_error_m: (exit_point.coords - goal.world_from_guide_exit.translation.vector)
            .norm(),
        entry_point_error_m,
        entry_lateral_error_m: goal.entry_m.map(|entry| off_axis_m(entry - exit_point)),
        axial_angle_error_rad: in_plane([0, 1]),
        sagittal_angle_error_rad: in_plane([1, 2]),
        true_target_error_m: true_aimed.map(|at| (tip - at).norm()),
        true_target_lateral_m: true_aimed.map(|at| off_axis_m(at - exit_point)),
    }
}
