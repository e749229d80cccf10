//! The budget by Jacobians.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Point3, SymmetricEigen, Vector3, Vector6};
use needlebench_kinematics::registration::RegistrationError;
use needlebench_kinematics::{Dynamics, JOINT_COUNT, Joints, Pose};
use needlebench_scenario::imperfections::{
    AbsorbedSag, ArmPopulation, Imperfections, NeedleBending, OriginDeviations,
};

use super::breath::breath_moments;
use super::within::Errors;
use super::{BudgetCase, BudgetError, Moments};
use crate::bend::Bends;
use crate::fit::FitError;
use crate::jitter::Jitter;
use crate::settle::friction_error;
use crate::truth::{joint_friction, moved_by};
use crate::{Draw, Layout, Source, Truth};

/// Moments at skin and target, axes of the guide's exit.
///
/// Covariances are of first order in every source but the breathing, whose moments are exact, and a needle in tissue, whose
/// bends are drawn (`bends`; Jacobians in the logarithms of its coefficients would make them up to a fifth too wide). The bias
/// is that of the mean arm in its mean posture, with the second-order parts of what turns: the arm's
/// origins, its joints and the registration (milliradians over half a metre: micrometres).
pub(super) fn moments(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    bends: Option<&Bends>,
) -> Result<[Moments; 2], BudgetError> {
    Ok(errors(case, imperfections, bends)?.map(|(moments, _)| moments))
}

/// Covariance of what is off at the skin with what is off at the target, axes of the guide's exit, m^2.
pub(super) fn cross(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    [skin, target]: [&Errors; 2],
) -> Result<Matrix3<f64>, BudgetError> {
    let (_, joint_m2) = joint_of(case, imperfections, [skin, target])?;
    let mut sum = joint_m2.fixed_view::<3, 3>(0, 3).into_owned();
    // Each breath has one level and one phase for both.
    for ((skin_m, breathing), (target_m, _)) in skin.breaths.iter().zip(&target.breaths) {
        let (_, variance) = breath_moments(breathing);
        sum += skin_m * target_m.transpose() * variance;
    }
    if let (Some(skin), Some(target)) = (&skin.bend, &target.bend) {
        sum += skin.with_tip(target);
    }
    Ok(sum)
}

/// The same, with how what is off is distributed.
pub(super) fn errors(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    bends: Option<&Bends>,
) -> Result<[(Moments, Errors); 2], BudgetError> {
    let target = case.target();
    let exit = case.world_from_exit();
    let layout = Layout::new(imperfections);
    // Every variable at its mean: the arm about which the Jacobians are taken.
    let middle = Draw(vec![0.0; layout.len()]);
    let truth = Truth::new(case.cell, case.place, imperfections, &layout, &middle, 0)?;
    let joints = JointErrors::new(case, imperfections, &truth, &target);
    let from_world = case.axes_from_world();
    let points = case.planned();
    let joint_m2 = covariance(case, imperfections, &joints, &points)?;
    let bends = bends.filter(|_| imperfections.tissue().is_some());
    // A bevel looks to a side of the patient, however the guide is turned about the needle.
    let roll_0 = case.goal.world_from_guide_exit.rotation;
    let of_point = |index: usize, point: &Point3<f64>| -> Result<_, BudgetError> {
        let mut errors = Errors {
            mean_m: Vector3::zeros(),
            covariance_m2: Matrix3::zeros(),
            breaths: Vec::new(),
            drift_m: None,
            discs: Vec::new(),
            bend: bends.map(|bends| bends.at(index, |across| roll_0 * across)),
        };
        let displaced = |errors: &Joints| mean_displacement(case, &truth, &target, errors, point);
        let mut bias = displaced(&joints.bias) + case.held_off_m[index];
        for deviation in joints.principal_deviations() {
            let [ahead, behind] =
                [1.0, -1.0].map(|sign| displaced(&(joints.bias + deviation * sign)));
            bias += 0.5 * (ahead + behind) - displaced(&joints.bias);
        }
        if let Some(arms) = &imperfections.calibration {
            bias += curved_by_calibration(case, arms, &target, point);
        }
        let place = case.place.copied().unwrap_or_else(Pose::identity);
        let turn = place.rotation.to_rotation_matrix();
        let skin = imperfections.skin_markers.as_ref();
        for fit in fits(imperfections) {
            bias += turn * fit?.mean_at(&(place.inverse() * point));
        }
        if let Some(skin) = skin {
            // The phantom is believed to be where its markers have risen to.
            let risen = place.rotation * skin.breathing.skin_m;
            errors.breaths.push((risen, skin.breathing));
        }
        if let Some(error) = &imperfections.hand_eye {
            // E[w x (w x r)] / 2 = -s^2 r; the target moves, so the error is the other way.
            bias += (point.coords - place.translation.vector) * error.rotation_rad.powi(2);
        }
        if let Some(indentation) = &imperfections.indentation {
            bias -= case.goal.axis.into_inner() * indentation.mean_m[index];
        }
        if let Some(breathing) = &imperfections.breathing {
            let amplitude = [breathing.skin_m, breathing.target_m][index];
            errors
                .breaths
                .push((-(place.rotation * amplitude), *breathing));
            errors.drift_m = breathing
                .drift_m
                .map(|drift_m| -(place.rotation * drift_m[index]));
        }
        let loose = Source::Guide.is_in(imperfections);
        if let Some(clearance_m) = imperfections.guide_clearance_m.filter(|_| loose) {
            let lever = case.depths_m()[index] / case.cell.tool.guide_length_m();
            let axes = [Vector3::x(), Vector3::y()].map(|axis| exit.rotation * axis);
            errors.discs = [1.0 + lever, lever]
                .map(|times| axes.map(|axis| axis * (0.5 * clearance_m * times)))
                .into();
        }
        errors.mean_m = bias;
        errors.covariance_m2 = block(&joint_m2, index);
        let errors = errors.turned(&from_world);
        Ok((errors.moments(), errors))
    };
    let [skin, target] = &points;
    Ok([of_point(0, skin)?, of_point(1, target)?])
}

/// Mean and covariance of skin and target together, m and m^2, axes of the guide's exit: of first order in all that is
/// linear, and with play as its normal of the same covariance. Without breaths and bends in tissue.
pub(super) fn joint(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
) -> Result<(Vector6<f64>, Matrix6<f64>), BudgetError> {
    let [skin, target] = errors(case, imperfections, None)?.map(|(_, errors)| errors);
    joint_of(case, imperfections, [&skin, &target])
}

fn joint_of(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    [skin, target]: [&Errors; 2],
) -> Result<(Vector6<f64>, Matrix6<f64>), BudgetError> {
    let layout = Layout::new(imperfections);
    let middle = Draw(vec![0.0; layout.len()]);
    let truth = Truth::new(case.cell, case.place, imperfections, &layout, &middle, 0)?;
    let joints = JointErrors::new(case, imperfections, &truth, &case.target());
    let mut in_world_m2 = covariance(case, imperfections, &joints, &case.planned())?;
    let from_world = case.axes_from_world();
    let mut turn = Matrix6::zeros();
    for at in [0, 3] {
        turn.fixed_view_mut::<3, 3>(at, at)
            .copy_from(from_world.matrix());
    }
    in_world_m2 = turn * in_world_m2 * turn.transpose();
    // A coordinate of a uniform disc has a quarter of its radius squared.
    let discs = skin.discs.iter().zip(&target.discs);
    let axes =
        discs.flat_map(|(skin, target)| [0, 1].map(|axis| [skin[axis] * 0.5, target[axis] * 0.5]));
    let [a, b] = [skin.mean_m, target.mean_m];
    Ok((
        Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z),
        in_world_m2 + squares(axes),
    ))
}

/// Covariance of one point of two.
fn block(joint_m2: &Matrix6<f64>, index: usize) -> Matrix3<f64> {
    joint_m2
        .fixed_view::<3, 3>(3 * index, 3 * index)
        .into_owned()
}

/// Both of two matrices, one below the other.
fn stacked(both: &[Matrix3x6<f64>; 2]) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    for (index, each) in both.iter().enumerate() {
        matrix.fixed_view_mut::<3, 6>(3 * index, 0).copy_from(each);
    }
    matrix
}

/// Sum of the squares of pairs of vectors that go together.
fn squares(columns: impl Iterator<Item = [Vector3<f64>; 2]>) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for [skin, target] in columns {
        let column = Vector6::new(skin.x, skin.y, skin.z, target.x, target.y, target.z);
        sum += column * column.transpose();
    }
    sum
}

/// Covariance of first order of skin and target together, world, m^2: of all sources that are linear. Breaths, play and
/// tissue are not.
fn covariance(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    joints: &JointErrors,
    points: &[Point3<f64>; 2],
) -> Result<Matrix6<f64>, BudgetError> {
    let q = case.target();
    let jacobians = points.each_ref().map(|point| tip_jacobian(case, &q, point));
    let jacobian = stacked(&jacobians);
    let mut sum = jacobian * joints.rigid_covariance * jacobian.transpose();
    sum += elasticity(case, imperfections, joints, &jacobians, points);
    if let Some(arms) = &imperfections.calibration {
        let origins = world_from_origins(case, &q);
        let modes = arms.modes.iter();
        sum += squares(modes.map(|mode| {
            points
                .each_ref()
                .map(|point| moved_with(&origins, mode, point))
        }));
    }
    let place = case.place.copied().unwrap_or_else(Pose::identity);
    let turn = place.rotation.to_rotation_matrix();
    for fit in fits(imperfections) {
        let fit = fit?;
        let moves = points
            .each_ref()
            .map(|point| turn * fit.moves_at(&(place.inverse() * point)));
        let moves = stacked(&moves);
        sum += moves * fit.covariance() * moves.transpose();
    }
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    if let Some(error) = &imperfections.hand_eye {
        let arms = points
            .each_ref()
            .map(|point| point.coords - place.translation.vector);
        sum += squares(axes.iter().map(|axis| [axis * error.translation_m; 2]));
        sum += squares(
            axes.iter()
                .map(|axis| arms.map(|arm| axis.cross(&arm) * error.rotation_rad)),
        );
    }
    if let Some(seen) = &imperfections.imaging {
        let root_m = turn * seen.root_m;
        sum += squares((0..3).map(|k| [Vector3::zeros(), root_m.column(k).into_owned()]));
    }
    // As the goal has the needle, which is where the posture has it.
    if let Some(NeedleBending::Cantilever(needle)) = &imperfections.needle {
        let lateral = [Vector3::x(), Vector3::y()]
            .map(|axis| case.goal.world_from_guide_exit.rotation * axis);
        let depths_m = case.depths_m();
        let bent_m = depths_m.map(|depth_m| {
            needle.side_force_n * needle.compliance_m_per_n(depth_m, depths_m[1]) * FRAC_1_SQRT_2
        });
        sum += squares(
            lateral
                .iter()
                .map(|axis| bent_m.map(|bent_m| axis * bent_m)),
        );
    }
    if let Some(indentation) = &imperfections.indentation {
        let inwards = case.goal.axis.into_inner();
        let [skin_m, target_m] = indentation.spread_m;
        let columns = [
            [inwards * skin_m, Vector3::zeros()],
            [Vector3::zeros(), inwards * target_m],
        ];
        sum += squares(columns.into_iter());
    }
    Ok(sum)
}

/// Errors of the fits to markers that are seen, and to those that move with the skin.
fn fits(
    imperfections: &Imperfections,
) -> impl Iterator<Item = Result<FitError, RegistrationError>> + '_ {
    let seen = imperfections.registration.iter();
    let skin = imperfections.skin_markers.iter();
    let moving = skin.map(|skin| FitError::of_shifts(&skin.markers, skin.shift_m));
    seen.map(FitError::of_localisation).chain(moving)
}

/// Linear Jacobian of a point of the last link, world, m/rad.
fn tip_jacobian(case: &BudgetCase<'_>, q: &Joints, point: &Point3<f64>) -> Matrix3x6<f64> {
    let robot = &case.cell.robot;
    let in_flange = robot.world_from_flange(q).inverse() * point;
    let jacobian = robot.chain.jacobian_at(q, &in_flange.coords);
    let turn = robot.world_from_base_link.rotation.to_rotation_matrix();
    turn * jacobian.fixed_rows::<3>(0)
}

/// How far the mean arm, its joints off by `errors`, carries a point of the last link from where the
/// nominal arm has it, world.
fn mean_displacement(
    case: &BudgetCase<'_>,
    truth: &Truth,
    target: &Joints,
    errors: &Joints,
    point: &Point3<f64>,
) -> Vector3<f64> {
    let robot = &case.cell.robot;
    let in_flange = robot.world_from_flange(target).inverse() * point;
    let real = truth.chain.base_link_from_flange(&(target + errors));
    robot.world_from_base_link * real * in_flange - point
}

/// Errors of the joints at rest: real minus commanded, rad.
struct JointErrors {
    bias: Joints,
    /// Of all.
    covariance: Matrix6<f64>,
    /// Of all but the gears.
    rigid_covariance: Matrix6<f64>,
    /// Standard deviation of each joint's twist, rad.
    sag_spread: Joints,
    /// What becomes of errors of the joints when the weight has followed them: a joint that yields moves the
    /// load of all, `(I + D dg/dq)^-1` with what servo and gear yield by, `D`, rad/(N m).
    followed: Matrix6<f64>,
}

/// Step of the derivative of gravity's torque, rad.
const GRADIENT_STEP_RAD: f64 = 1e-4;

/// How the torque that holds the arm changes with its posture, N m/rad.
fn gravity_gradient(real: &Dynamics, q: &Joints) -> Matrix6<f64> {
    let mut gradient = Matrix6::zeros();
    for joint in 0..JOINT_COUNT {
        let mut step = Joints::zeros();
        step[joint] = GRADIENT_STEP_RAD;
        let change = real.gravity_torque(&(q + step)) - real.gravity_torque(&(q - step));
        gradient.set_column(joint, &(change / (2.0 * GRADIENT_STEP_RAD)));
    }
    gradient
}

impl JointErrors {
    fn new(
        case: &BudgetCase<'_>,
        imperfections: &Imperfections,
        truth: &Truth,
        target: &Joints,
    ) -> Self {
        let kp = Joints::from(case.servo.gains.kp_nm_per_rad);
        let mut bias = Joints::zeros();
        let mut covariance = Matrix6::zeros();
        let believed = case.servo.dynamics.gravity_torque(target);
        let gears = &truth.actuation.gears;
        let real = truth.dynamics(case.cell);
        // The weight of the arm where it has sagged to.
        let upright = real.gravity_torque(target);
        let load = real.gravity_torque(&(target - gears.twist_rad(&upright)));
        // What a torque that the controller does not know does: servo and gear in series.
        let yields = kp.map(f64::recip) + gears.slope_rad_per_nm(&load);
        let unknown = load - believed;
        let sag = gears.twist_rad(&load);
        bias -= unknown.component_div(&kp) + sag;
        let elasticity = imperfections.elasticity.as_ref();
        let sag_spread = sag * elasticity.map_or(0.0, |each| each.spread);
        let gradient = gravity_gradient(&real, target);
        let stiff = Matrix6::identity() + Matrix6::from_diagonal(&yields) * gradient;
        // A servo that cannot hold its weight is refused elsewhere.
        let followed = stiff.try_inverse().unwrap_or_else(Matrix6::identity);
        if let Some(payload) = imperfections.payload {
            let mut column = |body: needlebench_kinematics::Body| {
                let other = Truth {
                    tool_body: body,
                    ..truth.clone()
                };
                let change = other.dynamics(case.cell).gravity_torque(target) - upright;
                let moved = yields.component_mul(&change);
                covariance += moved * moved.transpose();
            };
            let mut heavier = truth.tool_body;
            heavier.mass_kg += payload.mass_spread_kg;
            column(heavier);
            for axis in 0..3 {
                let mut shifted = truth.tool_body;
                shifted.com_m[axis] += payload.com_spread_m;
                column(shifted);
            }
        }
        if let (Some(block), Some(resting)) =
            (&imperfections.friction, case.friction(imperfections))
        {
            let model = joint_friction(block, Joints::repeat(1.0));
            let error = |scale: f64| friction_error(&kp, &model, &Joints::repeat(scale), &resting);
            bias -= error(1.0);
            // Central difference over one standard deviation: the spring-back is not linear.
            let spread = 0.5 * (error(1.0 + block.spread) - error(1.0 - block.spread));
            covariance += Matrix6::from_diagonal(&spread.component_mul(&spread));
        }
        covariance = followed * covariance * followed.transpose();
        if let Some(encoder) = imperfections.encoder {
            let squared = |values: &Joints| values.component_mul(values);
            let still = squared(&encoder.zero_spread_rad) + squared(&encoder.resolution_rad) / 12.0;
            covariance += Matrix6::from_diagonal(&still);
            if let Some(jitter) = Jitter::new(case.servo, &real, truth, target, case.timestep_s) {
                covariance += jitter.covariance();
            }
        }
        Self {
            bias,
            covariance: covariance + Matrix6::from_diagonal(&sag_spread.component_mul(&sag_spread)),
            rigid_covariance: covariance,
            sag_spread,
            followed,
        }
    }

    /// Deviations along the principal axes of the covariance, one standard deviation each.
    fn principal_deviations(&self) -> [Joints; JOINT_COUNT] {
        let eigen = SymmetricEigen::new(self.covariance);
        std::array::from_fn(|k| eigen.eigenvectors.column(k) * eigen.eigenvalues[k].max(0.0).sqrt())
    }
}

/// Poses of the joints' origins at a posture, world.
fn world_from_origins(case: &BudgetCase<'_>, q: &Joints) -> [Pose; JOINT_COUNT] {
    let robot = &case.cell.robot;
    let links = robot.world_from_links(q);
    std::array::from_fn(|i| {
        let parent = if i == 0 {
            robot.world_from_base_link
        } else {
            links[i - 1]
        };
        parent * robot.chain.joints[i].parent_from_joint
    })
}

/// How a deviation of all joints' origins moves a point.
fn moved_with(
    origins: &[Pose; JOINT_COUNT],
    deviations: &OriginDeviations,
    point: &Point3<f64>,
) -> Vector3<f64> {
    let moved = (0..JOINT_COUNT).map(|i| moved_by(&origins[i], &deviations[i], point));
    moved.sum()
}

/// Covariance of two points under gears of uncertain compliance, world: of each joint what its twist does,
/// less what a calibration has taken of it for geometry; and of which calibration that was.
fn elasticity(
    case: &BudgetCase<'_>,
    imperfections: &Imperfections,
    joints: &JointErrors,
    jacobians: &[Matrix3x6<f64>; 2],
    points: &[Point3<f64>; 2],
) -> Matrix6<f64> {
    let Some(elasticity) = &imperfections.elasticity else {
        return Matrix6::zeros();
    };
    let origins = world_from_origins(case, &case.target());
    let moved = |taken: &OriginDeviations| {
        points
            .each_ref()
            .map(|point| moved_with(&origins, taken, point))
    };
    let absorbed = elasticity.absorbed.as_deref();
    let columns = (0..JOINT_COUNT).map(|joint| {
        let twist = joints.followed.column(joint) * joints.sag_spread[joint];
        let taken = absorbed.map_or_else(
            || [Vector3::zeros(); 2],
            |absorbed| moved(&absorbed.mean()[joint]),
        );
        std::array::from_fn(|at| jacobians[at] * twist + taken[at] * elasticity.spread)
    });
    let modes = absorbed.map_or(&[][..], AbsorbedSag::modes);
    squares(columns.chain(modes.iter().map(moved)))
}

/// Second-order part of the mean of a point under a population of arms, world.
fn curved_by_calibration(
    case: &BudgetCase<'_>,
    arms: &ArmPopulation,
    q: &Joints,
    point: &Point3<f64>,
) -> Vector3<f64> {
    let robot = &case.cell.robot;
    let in_flange = robot.world_from_flange(q).inverse() * point;
    let at = |deviations: &[nalgebra::Vector6<f64>; JOINT_COUNT]| -> Point3<f64> {
        let chain = ArmPopulation::moved(&robot.chain, deviations);
        robot.world_from_base_link * chain.base_link_from_flange(q) * in_flange
    };
    let centre = at(&arms.mean);
    let curved = arms.modes.iter().map(|mode| {
        let [ahead, behind] = [1.0, -1.0]
            .map(|sign| at(&std::array::from_fn(|i| arms.mean[i] + mode[i] * sign)) - centre);
        0.5 * (ahead + behind)
    });
    curved.sum()
}
