//! What a calibration that is measured on a sagging arm takes for geometry.

use nalgebra::{DMatrix, DVector, SymmetricEigen, Vector3, Vector6};
use needlebench_kinematics::{Dynamics, JOINT_COUNT, Joints, Pose};

use super::{GearTwist, OriginDeviations};
use crate::{Robot, Tool};

/// Postures that the calibration is made from. Assumed; a few hundred are what kinematic calibrations take,
/// and the fit changes little beyond.
const POSTURES: usize = 200;

/// What a radian of the flange's orientation counts beside a metre of its place, m: the reach of a tool.
const LEVER_M: f64 = 0.2;

/// Share of the largest eigenvalue below which a combination of deviations moves nothing: origins of
/// parallel axes can slide along them.
const REDUNDANT: f64 = 1e-9;

/// A point of Halton's sequence (bases 2, 3, 5, 7, 11, 13) as joint positions in (-pi, pi).
fn halton(point: u32) -> Joints {
    const BASES: [u32; JOINT_COUNT] = [2, 3, 5, 7, 11, 13];
    Joints::from_fn(|joint, _| {
        let base = BASES[joint];
        let (mut left, mut place, mut share) = (point, 1.0, 0.0);
        while left > 0 {
            place /= f64::from(base);
            share += place * f64::from(left % base);
            left /= base;
        }
        (2.0 * share - 1.0) * std::f64::consts::PI
    })
}

/// Origin deviations that fit best, over [`POSTURES`] points of Halton's sequence in front of the base's plane, what the twist of
/// each joint's gear does to the flange: one set for each joint that twists.
///
/// A calibration moves joint origins until the arm's model meets the measured poses, whatever moved these.
/// What constant deviations can imitate of a sag that changes with the posture is in the calibration
/// already; the rest is left to the sag. The fit is of least squares in place and orientation
/// ([`LEVER_M`]), to first order, and the smallest of those that fit equally. `tool` is what the arm
/// carried, if it did, and `gravity_m_s2` is in the frame of `base_link`, as it stood or hung then.
pub(crate) fn absorbed_sag(
    robot: &Robot,
    tool: Option<&Tool>,
    gears: &GearTwist,
    gravity_m_s2: Vector3<f64>,
) -> [OriginDeviations; JOINT_COUNT] {
    let chain = &robot.chain;
    let mut bodies = robot.bodies;
    if let Some(tool) = tool {
        let carried = tool.body.transformed(&chain.wrist_3_from_flange);
        bodies[JOINT_COUNT - 1] = bodies[JOINT_COUNT - 1].combined_with(&carried);
    }
    let dynamics = Dynamics {
        chain: *chain,
        bodies,
        armature_kgm2: Joints::zeros(),
        gravity_m_s2,
    };
    let size = 6 * JOINT_COUNT;
    let mut normal = DMatrix::zeros(size, size);
    let mut sides = DMatrix::zeros(size, JOINT_COUNT);
    let (mut seen, mut point) = (0, 0);
    while seen < POSTURES {
        point += 1;
        let q = halton(point);
        let links = chain.link_poses(&q);
        let flange = chain.base_link_from_flange(&q).translation.vector;
        // Nobody measures an arm that reaches behind what its base is bolted to.
        if flange.z < 0.0 {
            continue;
        }
        seen += 1;
        let twist = gears.twist_rad(&dynamics.gravity_torque(&q));
        let jacobian = chain.jacobian_at(&q, &Vector3::zeros());
        let mut rows = DMatrix::zeros(6, size);
        for joint in 0..JOINT_COUNT {
            let parent = if joint == 0 {
                Pose::identity()
            } else {
                links[joint - 1]
            };
            let origin = parent * chain.joints[joint].parent_from_joint;
            let local = origin.inverse_transform_point(&flange.into()).coords;
            for axis in 0..3 {
                let unit = Vector3::ith(axis, 1.0);
                let along = origin.rotation * unit;
                let swung = origin.rotation * unit.cross(&local);
                let (slides, turns) = (6 * joint + axis, 6 * joint + 3 + axis);
                rows.view_mut((0, slides), (3, 1)).copy_from(&along);
                rows.view_mut((0, turns), (3, 1)).copy_from(&swung);
                rows.view_mut((3, turns), (3, 1))
                    .copy_from(&(along * LEVER_M));
            }
        }
        for joint in 0..JOINT_COUNT {
            let mut moved: Vector6<f64> = jacobian.column(joint) * -twist[joint];
            moved.fixed_rows_mut::<3>(3).scale_mut(LEVER_M);
            let mut side = sides.column_mut(joint);
            side += rows.transpose() * DVector::from_column_slice(moved.as_slice());
        }
        normal += rows.transpose() * &rows;
    }
    let eigen = SymmetricEigen::new(normal);
    let least = REDUNDANT * eigen.eigenvalues.amax();
    let solved = eigen.eigenvectors.transpose() * sides;
    let solved = DMatrix::from_fn(size, JOINT_COUNT, |row, joint| {
        let value = eigen.eigenvalues[row];
        if value > least {
            solved[(row, joint)] / value
        } else {
            0.0
        }
    });
    let solved = eigen.eigenvectors * solved;
    std::array::from_fn(|sagging| {
        std::array::from_fn(|joint| Vector6::from_fn(|row, _| solved[(6 * joint + row, sagging)]))
    })
}

#[cfg(test)]
mod tests {
    use super::super::ArmPopulation;
    use super::*;

    fn gears() -> GearTwist {
        GearTwist::linear(Joints::from(
            [1e4, 1e4, 4.7e3, 2.7e3, 2.7e3, 2.7e3].map(f64::recip),
        ))
    }

    fn sum(parts: &[OriginDeviations; JOINT_COUNT]) -> OriginDeviations {
        std::array::from_fn(|joint| parts.iter().map(|part| part[joint]).sum())
    }

    /// Root mean square distance of the flange from where the controller has it, and of its orientation by the
    /// same lever, over the postures of the fit: the whole non-linear arm, with its twist, under a chain that
    /// the controller believes in.
    fn rms_m(robot: &Robot, believed: &OriginDeviations, gravity_m_s2: Vector3<f64>) -> f64 {
        let dynamics = Dynamics {
            chain: robot.chain,
            bodies: robot.bodies,
            armature_kgm2: Joints::zeros(),
            gravity_m_s2,
        };
        let believed = ArmPopulation::moved(&robot.chain, believed);
        let upright = (1..).map(halton).filter(|q| {
            let flange = robot.chain.base_link_from_flange(q);
            flange.translation.vector.z >= 0.0
        });
        let squares = upright.take(POSTURES).map(|q| {
            let sagged = q - gears().twist_rad(&dynamics.gravity_torque(&q));
            let real = robot.chain.base_link_from_flange(&sagged);
            let believed = believed.base_link_from_flange(&q);
            let turned = LEVER_M * real.rotation.angle_to(&believed.rotation);
            let moved = real.translation.vector - believed.translation.vector;
            moved.norm_squared() + turned * turned
        });
        (squares.sum::<f64>() / POSTURES as f64).sqrt()
    }

    #[test]
    fn calibration_under_gravity_takes_a_part_of_the_sag_and_not_all() {
        const GRAVITY_M_S2: f64 = 9.80665;
        let robot = crate::load_robot(&crate::Overrides::default()).unwrap();
        let none = [Vector6::zeros(); JOINT_COUNT];
        // Upright, hanging, and on a wall.
        for down in [-Vector3::z(), Vector3::z(), Vector3::x()] {
            let gravity_m_s2 = down * GRAVITY_M_S2;
            let rms_m = |believed: &OriginDeviations| rms_m(&robot, believed, gravity_m_s2);
            let absorbed = sum(&absorbed_sag(&robot, None, &gears(), gravity_m_s2));
            let (before, after) = (rms_m(&none), rms_m(&absorbed));
            assert!(after < 0.8 * before, "{before} {after}");
            assert!(after > 0.0);
            // It is a minimum: neither less nor more of it fits better.
            for share in [0.8, 1.2] {
                let other = absorbed.map(|each| each * share);
                assert!(rms_m(&other) > after, "{share}");
            }
        }
    }
}
