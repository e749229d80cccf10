//! The target pose of `ik`.

use std::f64::consts::TAU;
use std::path::Path;

use nalgebra::Vector3;
use needlebench_cell::Robot;
use needlebench_clearance::ClearanceModel;
use needlebench_input::Finding;
use needlebench_kinematics::ik::Tolerance;
use needlebench_kinematics::{
    NotARotation, Pose, pose_from_matrix, pose_from_rotation_vector, rotation_vector,
};
use needlebench_planning::Planner;
use needlebench_scenario::Roll;

use super::super::urdf_overrides;
use super::IkArguments;
use super::arm::KinematicArm;
use crate::arguments::{PoseMatrix, Six};
use crate::failure::Failure;

/// A coordinate above this is in another unit.
const FARTHEST_M: f64 = 10.0;

/// Upper limit of the tolerance that follows from the digits, m and rad: that of four decimals, because 0.3 is meant
/// exactly.
const MOST_DIGITS: f64 = 1e-4;

/// Above this tolerance neighbouring postures coincide, m and rad.
const MOST_GIVEN: f64 = 1e-3;

/// The pose tolerance: that of the argument, or the resolution of the given digits, at least
/// [`Tolerance::default`] and at most [`MOST_DIGITS`].
pub(super) fn tolerance(arguments: &IkArguments) -> Result<Tolerance, Finding> {
    if let Some(given) = arguments.tolerance {
        if (0.0..=MOST_GIVEN).contains(&given) {
            return Ok(Tolerance {
                m: given,
                rad: given,
            });
        }
        let message = format!("{given:?} is outside 0 to {MOST_GIVEN:?} m and rad");
        return Err(Finding::new("--tolerance", message)
            .hint("the unit is metres and radians: 1e-6 is a micrometre and a microradian"));
    }
    // The most digits of any number tell how all are meant: 0.3 beside 0.244470 is exact.
    let finest = |half_units: &[f64]| half_units.iter().copied().fold(f64::INFINITY, f64::min);
    let (m, rad) = match (&arguments.pose, &arguments.matrix) {
        (Some(Six(_, half)), _) => (finest(&half[..3]), finest(&half[3..])),
        (None, Some(PoseMatrix(_, half))) => (
            finest(half.column(3).as_slice()),
            finest(half.fixed_columns::<3>(0).into_owned().as_slice()),
        ),
        (None, None) => (0.0, 0.0),
    };
    let default = Tolerance::default();
    let three = 3.0_f64.sqrt();
    Ok(Tolerance {
        m: (three * m).clamp(default.m, MOST_DIGITS),
        rad: (three * rad).clamp(default.rad, MOST_DIGITS),
    })
}

/// The arm, and the pose of its flange in `base_link`.
pub(super) fn target(arguments: &IkArguments) -> Result<(KinematicArm, Pose), Failure> {
    if let Some(path) = &arguments.scenario {
        return goal_pose(arguments, path);
    }
    let base_from_flange = match (&arguments.pose, &arguments.matrix) {
        (Some(pose), _) => of_vector(pose),
        (None, Some(matrix)) => of_matrix(matrix, arguments.nearest_rotation),
        (None, None) => unreachable!("clap asks for one of them without a scenario"),
    }?;
    let arm = KinematicArm::new(&arguments.arm)?;
    Ok((arm, Robot::base_link_from_base() * base_from_flange))
}

fn of_vector(Six([x, y, z, rx, ry, rz], _): &Six) -> Result<Pose, Finding> {
    let position_m = Vector3::new(*x, *y, *z);
    check_position("--pose", &position_m)?;
    let rotvec_rad = Vector3::new(*rx, *ry, *rz);
    let angle_rad = rotvec_rad.norm();
    // The controller writes at most half a turn; a little over a whole one is still rounding.
    if angle_rad > 1.01 * TAU {
        let message = format!(
            "the length of the rotation vector is {angle_rad:.4} rad, above a full turn of {TAU:.4} rad"
        );
        return Err(Finding::new("--pose", message)
            .hint("rx, ry and rz are axis times angle in radians, as shown by the controller"));
    }
    Ok(pose_from_rotation_vector(position_m, rotvec_rad))
}

fn of_matrix(PoseMatrix(matrix, _): &PoseMatrix, nearest: bool) -> Result<Pose, Finding> {
    let position_m = matrix.column(3).into_owned();
    check_position("--matrix", &position_m)?;
    let error = match pose_from_matrix(&matrix.fixed_columns::<3>(0).into_owned(), position_m) {
        Ok(pose) => return Ok(pose),
        Err(error) => error,
    };
    match error.nearest {
        Some(rotation) if nearest => Ok(Pose::from_parts(position_m.into(), rotation)),
        _ => Err(not_a_rotation(&error, &position_m)),
    }
}

fn not_a_rotation(error: &NotARotation, position_m: &Vector3<f64>) -> Finding {
    if error.is_mirrored() {
        let message = format!(
            "the matrix is mirrored: determinant {:.6}, 1 required for a rotation",
            error.determinant
        );
        return Finding::new("--matrix", message)
            .hint("an axis has the wrong sign, or two rows or columns are swapped");
    }
    let finding = Finding::new("--matrix", error.to_string());
    let Some(rotation) = error.nearest else {
        return finding.hint("its columns are linearly dependent, so there is no nearest rotation");
    };
    let [x, y, z] = (*position_m).into();
    let [rx, ry, rz] = rotation_vector(&rotation).into();
    finding.hint(format!(
        "the nearest rotation is --pose {x:?},{y:?},{z:?},{rx:?},{ry:?},{rz:?}; to use it, give that or \
         add --nearest-rotation"
    ))
}

fn check_position(argument: &str, position_m: &Vector3<f64>) -> Result<(), Finding> {
    if position_m.amax() <= FARTHEST_M {
        return Ok(());
    }
    let [x, y, z] = (*position_m).into();
    let message =
        format!("the position is {x:?}, {y:?}, {z:?} m, but no arm reaches {FARTHEST_M} m");
    Err(Finding::new(argument, message).hint("x, y and z are in metres"))
}

fn goal_pose(arguments: &IkArguments, path: &Path) -> Result<(KinematicArm, Pose), Failure> {
    let overrides = urdf_overrides(&arguments.arm.robot)?;
    let resolved = needlebench_scenario::load_scenario(path, &overrides)?;
    let name = arguments.goal.as_deref().unwrap_or_default();
    let Some(goal) = resolved.goals.iter().find(|goal| goal.name == name) else {
        let names: Vec<&str> = resolved
            .goals
            .iter()
            .map(|goal| goal.name.as_str())
            .collect();
        let file = path.display().to_string();
        return Err(
            Finding::new(file, format!("the scenario has no goal `{name}`"))
                .hint(format!("goals: {}", names.join(", ")))
                .into(),
        );
    };
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).map_err(|error| {
        Finding::new(&resolved.robot_description.source.file, error.to_string())
    })?;
    let roll_rad = match goal.roll {
        Roll::Fixed(roll_rad) => roll_rad,
        Roll::Free => 0.0,
    };
    let pose = planner.base_link_from_flange(goal, roll_rad);
    Ok((
        KinematicArm::of_robot(&resolved.cell.robot, &resolved.robot_description),
        pose,
    ))
}
