//! What can be told from the log of a run: Fisher's information, with stated noise.
//!
//! *Calibration.* The log has the angles of the joints and the flange's pose that the controller computes from
//! them with the lengths of its own arm. Unknown is how each joint's origin, the base and the flange are displaced
//! from the nominal arm: six numbers each, 42 together, of which 30 matter (four for each joint and six for
//! the flange); the others move nothing. With a weak prior the covariance of all 42 exists, and what it
//! makes of the flange at *other* postures is what a calibration is for: it is free of how the unknowns are
//! chosen.
//!
//! *Identification.* The controller's torque is linear in the payload's mass and first moments and in the rotor
//! inertias. The current is linear in that torque, the sign of the speed and the speed, by joint:
//! `i = (moment + coulomb sign(qd) + viscous qd) / k`. Rows where a joint stands say nothing of its current, since friction
//! holds it anywhere.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{Body, Chain, Dynamics, JOINT_COUNT, Joints, Pose};

/// Unknowns of a calibration that matter: four for each joint and six for the flange.
pub(crate) const CALIBRATION_UNKNOWNS: usize = 30;

/// A value is identified where its standard deviation is below this share of it.
pub const IDENTIFIED_SHARE: f64 = 0.1;

/// Displacements: of the base, of the origins of the joints beyond the first, of the flange.
const DISPLACEMENTS: usize = 6 * (JOINT_COUNT + 1);

/// Noise of a log, and what is known before it. All assumed, from a recorded run of a UR3e.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of the flange's position about the best calibration, per axis, m: what a fit of that
    /// log left.
    pub position_m: f64,
    /// The same of its orientation, rad: that over the length of a forearm.
    pub rotation_rad: f64,
    /// Standard deviation of an origin's place before anything is measured, m: several times that of factory
    /// calibrations.
    pub origin_m: f64,
    /// The same of its orientation, rad.
    pub origin_rad: f64,
    /// Standard deviation of the controller's torque about the rigid-body model, N m.
    pub moment_nm: f64,
    /// Standard deviation of a moving joint's current about its law, A.
    pub current_a: f64,
    /// Time after which an error is another one, s.
    pub independent_s: f64,
    /// Speed above which a joint slides, rad/s.
    pub sliding_rad_s: f64,
}

/// The noise that all figures are for.
pub const NOISE: Noise = Noise {
    position_m: 1e-4,
    rotation_rad: 3e-4,
    origin_m: 3e-3,
    origin_rad: 3e-3,
    moment_nm: 0.01,
    current_a: 0.15,
    independent_s: 0.1,
    sliding_rad_s: 0.02,
};

type Sensitivity = SMatrix<f64, 6, DISPLACEMENTS>;
type Covariance = SMatrix<f64, DISPLACEMENTS, DISPLACEMENTS>;

/// How the flange's pose moves with the displacements, over the noise: position first, then orientation.
/// Columns are over what is known before, so that all of them are alike.
fn sensitivity(chain: &Chain, q: &Joints) -> Sensitivity {
    let links = chain.link_poses(q);
    let flange = chain.base_link_from_flange(q);
    let mut made = Sensitivity::zeros();
    for place in 0..=JOINT_COUNT {
        // Frames that the displacement is fixed to, and where it is.
        let (axes, at_m) = match place {
            0 => (Matrix3::identity(), links[0].translation.vector),
            JOINT_COUNT => (
                links[JOINT_COUNT - 1]
                    .rotation
                    .to_rotation_matrix()
                    .into_inner(),
                flange.translation.vector,
            ),
            joint => (
                links[joint - 1].rotation.to_rotation_matrix().into_inner(),
                links[joint].translation.vector,
            ),
        };
        let arm_m = flange.translation.vector - at_m;
        for axis in 0..3 {
            let direction: Vector3<f64> = axes.column(axis).into();
            let moved = direction * (NOISE.origin_m / NOISE.position_m);
            let turned_m = direction.cross(&arm_m) * (NOISE.origin_rad / NOISE.position_m);
            let turned = direction * (NOISE.origin_rad / NOISE.rotation_rad);
            made.fixed_view_mut::<3, 1>(0, 6 * place + axis)
                .copy_from(&moved);
            made.fixed_view_mut::<3, 1>(0, 6 * place + 3 + axis)
                .copy_from(&turned_m);
            made.fixed_view_mut::<3, 1>(3, 6 * place + 3 + axis)
                .copy_from(&turned);
        }
    }
    made
}

/// What is known of a calibration after some postures; grows posture by posture.
#[derive(Debug, Clone)]
pub(crate) struct Calibration<'a> {
    chain: &'a Chain,
    /// Of the displacements over what is known before.
    covariance: Covariance,
    information: Covariance,
}

impl<'a> Calibration<'a> {
    pub fn new(chain: &'a Chain) -> Self {
        Self {
            chain,
            covariance: Covariance::identity(),
            information: Covariance::zeros(),
        }
    }

    pub fn of(chain: &'a Chain, postures: &[Joints]) -> Self {
        let mut made = Self::new(chain);
        for q in postures {
            made.add(q);
        }
        made
    }

    /// By how much a posture raises the logarithm of the information's determinant.
    pub fn gain(&self, q: &Joints) -> f64 {
        let rows = sensitivity(self.chain, q);
        let spread = rows * self.covariance * rows.transpose() + SMatrix::<f64, 6, 6>::identity();
        libm::log(spread.determinant().max(1.0))
    }

    pub fn add(&mut self, q: &Joints) {
        let rows = sensitivity(self.chain, q);
        self.information += rows.transpose() * rows;
        let whole = self.information + Covariance::identity();
        // Above the identity, so it has one.
        if let Some(cholesky) = whole.cholesky() {
            self.covariance = cholesky.inverse();
        }
    }

    /// Root mean square error of the flange's place at a posture, m.
    fn flange_m(&self, q: &Joints) -> f64 {
        let rows = sensitivity(self.chain, q);
        let places = rows.fixed_rows::<3>(0);
        (places * self.covariance * places.transpose())
            .trace()
            .sqrt()
            * NOISE.position_m
    }

    /// At other postures, which are not empty.
    pub fn summary(&self, elsewhere: &[Joints]) -> CalibrationInformation {
        let mut eigenvalues: Vec<f64> = self
            .information
            .symmetric_eigenvalues()
            .iter()
            .copied()
            .collect();
        eigenvalues.sort_by(|a, b| b.total_cmp(a));
        let (largest, least) = (eigenvalues[0], eigenvalues[CALIBRATION_UNKNOWNS - 1]);
        // Below rounding nothing is known of the unknown that is known least.
        let is_known = least > largest * 1e-13;
        let errors: Vec<f64> = elsewhere.iter().map(|q| self.flange_m(q)).collect();
        let mean_square =
            errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
        CalibrationInformation {
            condition: is_known.then(|| (largest / least).sqrt()),
            flange_rms_m: mean_square.sqrt(),
            flange_worst_m: errors.iter().copied().fold(0.0, f64::max),
        }
    }
}

/// How well a calibration is determined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationInformation {
    /// Ratio of the largest to the least singular value over the 30 unknowns that matter, lengths over 3 mm and
    /// angles over 3 mrad; none where not all of them are determined.
    pub condition: Option<f64>,
    /// Error of the flange that the calibrated arm has at other postures, root mean square, m.
    pub flange_rms_m: f64,
    /// The largest of it, m.
    pub flange_worst_m: f64,
}

/// How well the payload is determined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PayloadInformation {
    /// Standard deviation of the mass, kg.
    pub mass_kg: f64,
    /// Standard deviation of the centre of mass along the axis that is known least, m.
    pub centre_m: f64,
}

/// How well the values of one joint are determined: standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointInformation {
    /// Of the rotor inertia, kg m^2.
    pub rotor_kgm2: f64,
    /// Of the torque constant, as a share of it; none where the arm's data have none.
    pub torque_constant_share: Option<f64>,
    /// Of the sliding friction, N m.
    pub coulomb_nm: Option<f64>,
    /// Of the viscous friction, N m s/rad.
    pub viscous_nms_rad: Option<f64>,
    /// Least and largest torque of gravity while the joint stands, N m.
    pub gravity_nm: [f64; 2],
}

/// How well payload and drives are determined by a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// Of what is at the flange in the last run, the tool included.
    pub payload: PayloadInformation,
    /// By joint.
    pub joints: [JointInformation; JOINT_COUNT],
}

/// What the rows of torque and current say, row by row.
struct Rows {
    /// Payload's mass and first moments, then rotors.
    moment: SMatrix<f64, 10, 10>,
    /// `1/k`, `coulomb/k`, `viscous/k` by joint.
    current: [Matrix3<f64>; JOINT_COUNT],
    gravity_nm: [[f64; 2]; JOINT_COUNT],
}

impl Identification {
    /// Of a run that is made once with each of some tools, by an arm with these torque constants.
    pub fn of(
        without_tool: &Dynamics,
        tools: &[Body],
        flange: &Pose,
        trajectory: &JointTrajectory,
        constants_nm_a: Option<&[f64; JOINT_COUNT]>,
    ) -> Self {
        let mut rows = Rows {
            moment: SMatrix::zeros(),
            current: [Matrix3::zeros(); JOINT_COUNT],
            gravity_nm: [[f64::INFINITY, f64::NEG_INFINITY]; JOINT_COUNT],
        };
        for (index, tool) in tools.iter().enumerate() {
            let carrying = carrying(without_tool, tool, flange);
            rows.add(
                without_tool,
                &carrying,
                flange,
                trajectory,
                index + 1 == tools.len(),
            );
        }
        rows.summary(
            tools.last().map_or(0.0, |tool| tool.mass_kg),
            constants_nm_a,
        )
    }
}

/// The arm with something at its flange.
fn carrying(arm: &Dynamics, tool: &Body, flange: &Pose) -> Dynamics {
    let mut made = *arm;
    let last = &mut made.bodies[JOINT_COUNT - 1];
    *last = last.combined_with(&tool.transformed(flange));
    made
}

/// Dynamics of unit changes of what is at the flange: its mass, and its first moments along three axes, with
/// its inertia about the flange unchanged.
fn unit_payloads(arm: &Dynamics, flange: &Pose) -> [Dynamics; 4] {
    let only = |body: Body| {
        let mut made = *arm;
        made.armature_kgm2 = Joints::zeros();
        made.bodies = [Body::massless(); JOINT_COUNT];
        made.bodies[JOINT_COUNT - 1] = body.transformed(flange);
        made
    };
    let at = |com_m: Vector3<f64>| Body {
        mass_kg: 1.0,
        com_m,
        inertia_kgm2: com_m * com_m.transpose() - Matrix3::identity() * com_m.norm_squared(),
    };
    [
        only(at(Vector3::zeros())),
        only(at(Vector3::x())),
        only(at(Vector3::y())),
        only(at(Vector3::z())),
    ]
}

impl Rows {
    fn add(
        &mut self,
        arm: &Dynamics,
        carrying: &Dynamics,
        flange: &Pose,
        trajectory: &JointTrajectory,
        is_last: bool,
    ) {
        let units = unit_payloads(arm, flange);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "minutes in tenths of a second"
        )]
        let count = (trajectory.duration_s() / NOISE.independent_s) as u32;
        for k in 0..=count {
            let state = trajectory.sample(f64::from(k) * NOISE.independent_s);
            let torque = |of: &Dynamics| {
                of.inverse_dynamics(&state.position, &state.velocity, &state.acceleration)
            };
            let moment_nm = torque(carrying);
            if is_last {
                let [mass, x, y, z] = units.each_ref().map(torque);
                let columns = [mass, x - mass, y - mass, z - mass];
                for joint in 0..JOINT_COUNT {
                    let mut row = SVector::<f64, 10>::zeros();
                    for (at, column) in columns.iter().enumerate() {
                        row[at] = column[joint];
                    }
                    row[4 + joint] = state.acceleration[joint];
                    self.moment += row * row.transpose();
                }
            }
            for joint in 0..JOINT_COUNT {
                let speed = state.velocity[joint];
                if speed == 0.0 {
                    let [least, most] = &mut self.gravity_nm[joint];
                    *least = least.min(moment_nm[joint]);
                    *most = most.max(moment_nm[joint]);
                }
                if speed.abs() < NOISE.sliding_rad_s {
                    continue;
                }
                let row = Vector3::new(moment_nm[joint], speed.signum(), speed);
                self.current[joint] += row * row.transpose();
            }
        }
    }

    fn summary(&self, mass_kg: f64, constants_nm_a: Option<&[f64; JOINT_COUNT]>) -> Identification {
        let deviations = |inverse: Option<SMatrix<f64, 10, 10>>| {
            inverse.map_or([f64::INFINITY; 10], |inverse| {
                std::array::from_fn(|i| NOISE.moment_nm * inverse[(i, i)].max(0.0).sqrt())
            })
        };
        let moment: [f64; 10] = deviations(inverse_scaled(&self.moment));
        let joints = std::array::from_fn(|joint| {
            let found = inverse_scaled(&self.current[joint]);
            let of = |i: usize| {
                let constant = constants_nm_a?[joint];
                let deviation = found.map_or(f64::INFINITY, |inverse| {
                    NOISE.current_a * inverse[(i, i)].max(0.0).sqrt()
                });
                Some(constant * deviation)
            };
            JointInformation {
                rotor_kgm2: moment[4 + joint],
                torque_constant_share: of(0),
                coulomb_nm: of(1),
                viscous_nms_rad: of(2),
                gravity_nm: self.gravity_nm[joint],
            }
        });
        let moments = moment[1..4].iter().copied().fold(0.0, f64::max);
        Identification {
            payload: PayloadInformation {
                mass_kg: moment[0],
                centre_m: moments / mass_kg,
            },
            joints,
        }
    }
}

/// Inverse of an information matrix whose unknowns have different units; none where something is not determined
/// at all.
fn inverse_scaled<const N: usize>(information: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    /// Least eigenvalue, of columns of length one, that is not rounding.
    const ROUNDING: f64 = 1e-12;
    let scale: SVector<f64, N> = SVector::from_fn(|i, _| information[(i, i)].sqrt());
    if scale.min() <= 0.0 {
        return None;
    }
    let alike = SMatrix::<f64, N, N>::from_fn(|i, j| information[(i, j)] / (scale[i] * scale[j]));
    let inverse = alike.cholesky()?.inverse();
    if (0..N).any(|i| inverse[(i, i)] > ROUNDING.recip()) {
        return None;
    }
    Some(SMatrix::from_fn(|i, j| {
        inverse[(i, j)] / (scale[i] * scale[j])
    }))
}

#[cfg(test)]
mod tests {
    use needlebench_kinematics::{UrModel, pose_from_rotation_vector, rotation_vector};
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    fn random_postures(count: usize) -> Vec<Joints> {
        let mut random = SplitMix64::new(7);
        (0..count)
            .map(|_| Joints::from_fn(|_, _| random.uniform(-3.0, 3.0)))
            .collect()
    }

    /// Of 42 displacements 12 move nothing that the others do not: the redundancy that the literature knows.
    #[test]
    fn thirty_displacements_matter() {
        for model in [UrModel::Ur3e, UrModel::Ur10e] {
            let chain = model.geometry().chain();
            let made = Calibration::of(&chain, &random_postures(40));
            let mut eigenvalues: Vec<f64> = made
                .information
                .symmetric_eigenvalues()
                .iter()
                .copied()
                .collect();
            eigenvalues.sort_by(|a, b| b.total_cmp(a));
            assert!(eigenvalues[29] > 1e-7 * eigenvalues[0], "{eigenvalues:?}");
            assert!(eigenvalues[30] < 1e-12 * eigenvalues[0], "{eigenvalues:?}");
        }
    }

    /// Against displaced chains themselves.
    #[test]
    fn sensitivities_are_the_differences_of_displaced_chains() {
        const STEP: f64 = 1e-6;
        let chain = UrModel::Ur3e.geometry().chain();
        for q in random_postures(5) {
            let rows = sensitivity(&chain, &q);
            let before = chain.base_link_from_flange(&q);
            for place in 0..=JOINT_COUNT {
                for axis in 0..6 {
                    let mut t = SVector::<f64, 6>::zeros();
                    t[axis] = STEP;
                    let (move_m, turn) = (t.fixed_rows::<3>(0), t.fixed_rows::<3>(3));
                    let mut displaced = chain;
                    // About the origin that is displaced, along the axes of the link before it.
                    let displace = |origin: &Pose| {
                        let turned = pose_from_rotation_vector(Vector3::zeros(), turn.into_owned());
                        Pose::from_parts(
                            (origin.translation.vector + move_m).into(),
                            turned.rotation * origin.rotation,
                        )
                    };
                    if place < JOINT_COUNT {
                        let joint = &mut displaced.joints[place];
                        joint.parent_from_joint = displace(&joint.parent_from_joint);
                    } else {
                        displaced.wrist_3_from_flange = displace(&chain.wrist_3_from_flange);
                    }
                    let after = displaced.base_link_from_flange(&q);
                    let moved = (after.translation.vector - before.translation.vector) / STEP;
                    let turned =
                        rotation_vector(&(after.rotation * before.rotation.inverse())) / STEP;
                    let scale = if axis < 3 {
                        NOISE.origin_m
                    } else {
                        NOISE.origin_rad
                    };
                    let column = rows.column(6 * place + axis);
                    let expected_m = column.fixed_rows::<3>(0) * (NOISE.position_m / scale);
                    let expected = column.fixed_rows::<3>(3) * (NOISE.rotation_rad / scale);
                    assert!((moved - expected_m).norm() < 1e-5, "{place} {axis}");
                    assert!((turned - expected).norm() < 1e-5, "{place} {axis}");
                }
            }
        }
    }

    /// The unit columns make the torque of any payload, but for its inertia about the flange.
    #[test]
    fn torque_is_linear_in_mass_and_first_moments() {
        let chain = UrModel::Ur3e.geometry().chain();
        let arm = Dynamics {
            chain,
            bodies: [Body::massless(); JOINT_COUNT],
            armature_kgm2: Joints::zeros(),
            gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
        };
        let flange = chain.wrist_3_from_flange;
        let com_m = Vector3::new(0.02, -0.03, 0.05);
        // A body whose inertia about the flange is nothing.
        let body = Body {
            mass_kg: 1.3,
            com_m,
            inertia_kgm2: (com_m * com_m.transpose() - Matrix3::identity() * com_m.norm_squared())
                * 1.3,
        };
        let whole = carrying(&arm, &body, &flange);
        let units = unit_payloads(&arm, &flange);
        let postures = random_postures(6);
        for pair in postures.windows(3) {
            let [q, qd, qdd] = [pair[0], pair[1], pair[2]];
            let [mass, x, y, z] = units
                .each_ref()
                .map(|unit| unit.inverse_dynamics(&q, &qd, &qdd));
            let h = com_m * 1.3;
            let sum = mass * 1.3 + (x - mass) * h.x + (y - mass) * h.y + (z - mass) * h.z;
            let expected = whole.inverse_dynamics(&q, &qd, &qdd);
            assert!((sum - expected).amax() < 1e-12, "{sum} {expected}");
        }
    }
}
