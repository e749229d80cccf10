//! What a calibration that is measured on a sagging arm takes for geometry.

use std::sync::OnceLock;

use nalgebra::{Const, Matrix3, Matrix6, SMatrix, SVector, SymmetricEigen, Vector3, Vector6};
use needlebench_kinematics::{Chain, Dynamics, JOINT_COUNT, Joints, Pose};

use super::{GearTwist, OriginDeviations};

/// Postures that the calibration is made from. Assumed; a few hundred are what kinematic calibrations take,
/// and the fit changes little beyond.
const POSTURES: usize = 200;

/// What a radian of the flange's orientation counts beside a metre of its place, m: the reach of a tool.
const LEVER_M: f64 = 0.2;

/// Share of the largest eigenvalue below which a combination of deviations moves nothing: origins of
/// parallel axes can slide along them.
const REDUNDANT: f64 = 1e-9;

/// What calibrations that are measured on a sagging arm take for geometry: they differ by the postures that they are made
/// from, and nobody publishes those.
///
/// A calibration moves joint origins until the arm's model meets the measured poses, whatever moved these. What constant
/// deviations can imitate of a sag that changes with the posture is in the calibration already; the rest is left to the
/// sag. Deviations are those that fit best what the twist of each joint's gear does to the flange, over postures with the
/// flange above the plane of the base.
///
/// Calibrations of 200 postures scatter about their mean by 14 % of the sag that is left on a UR3; the mean is known to
/// half a percent. It is reckoned when it is asked for: some 50 ms.
#[derive(Debug)]
pub struct AbsorbedSag {
    /// The arm that was measured, with what it carried, and with gravity as it stood or hung then.
    measured: Dynamics,
    gears: GearTwist,
    taken: OnceLock<Taken>,
}

#[derive(Debug)]
struct Taken {
    mean: [OriginDeviations; JOINT_COUNT],
    modes: Vec<OriginDeviations>,
}

impl PartialEq for AbsorbedSag {
    fn eq(&self, other: &Self) -> bool {
        self.measured == other.measured && self.gears == other.gears
    }
}

impl AbsorbedSag {
    /// Number of [`AbsorbedSag::modes`]: the largest, 97 % of the scatter on a UR3.
    pub const MODES: usize = 16;

    /// Of an arm that was measured with `measured` and has these gears.
    pub(crate) fn new(measured: &Dynamics, gears: GearTwist) -> Self {
        Self {
            measured: *measured,
            gears,
            taken: OnceLock::new(),
        }
    }

    /// The mean of calibrations, by the joint that sags: goes with that joint's compliance.
    pub fn mean(&self) -> &[OriginDeviations; JOINT_COUNT] {
        &self.reckoned().mean
    }

    /// How the sum of these differs from calibration to calibration: `sum_k weight_k * modes_k` with independent standard
    /// normal weights.
    pub fn modes(&self) -> &[OriginDeviations] {
        &self.reckoned().modes
    }

    /// What one arm's calibration took, for the factor on the compliance of each joint and the weights of the modes.
    ///
    /// # Panics
    /// If there are not as many weights as modes.
    pub fn taken(&self, softness: &Joints, weights: &[f64]) -> OriginDeviations {
        assert_eq!(weights.len(), Self::MODES);
        let means = self.mean().iter().zip(softness);
        let modes = self.modes().iter().zip(weights);
        let mut taken = [Vector6::zeros(); JOINT_COUNT];
        for (part, factor) in means.chain(modes) {
            for (sum, part) in taken.iter_mut().zip(part) {
                *sum += part * *factor;
            }
        }
        taken
    }

    fn reckoned(&self) -> &Taken {
        self.taken.get_or_init(|| {
            let postures: Vec<Posture> = lattice()
                .filter(|q| is_upright(&self.measured.chain, q))
                .map(|q| Posture::new(&self.measured, &self.gears, &q))
                .collect();
            let (information, mut mean) = fitted(&postures);
            let modes = modes(&postures, &information, &summed(&mean));
            let bias = bias(&postures, &information, &mean);
            for (taken, off) in mean.iter_mut().flatten().zip(bias.iter().flatten()) {
                *taken += off;
            }
            Taken { mean, modes }
        })
    }
}

/// What all joints together have taken from them.
fn summed(by_joint: &[OriginDeviations; JOINT_COUNT]) -> OriginDeviations {
    std::array::from_fn(|joint| by_joint.iter().map(|part| part[joint]).sum())
}

/// Whether the flange is above the plane of the base: nobody measures an arm that reaches behind what its base is bolted
/// to.
fn is_upright(chain: &Chain, q: &Joints) -> bool {
    chain.base_link_from_flange(q).translation.vector.z >= 0.0
}

/// Joint positions in (-pi, pi), evenly spread: a rank-1 lattice of Korobov's, which integrates what is periodic well.
fn lattice() -> impl Iterator<Item = Joints> {
    const POINTS: u64 = 16381;
    const GENERATOR: u64 = 3624;
    let mut steps = [1; JOINT_COUNT];
    for joint in 1..JOINT_COUNT {
        steps[joint] = steps[joint - 1] * GENERATOR % POINTS;
    }
    (0..POINTS).map(move |point| {
        Joints::from_fn(|joint, _| {
            let share = ((point * steps[joint] % POINTS) as f64 + 0.5) / POINTS as f64;
            (2.0 * share - 1.0) * std::f64::consts::PI
        })
    })
}

/// All deviations of the origins in one: six of each joint.
const SIZE: usize = 6 * JOINT_COUNT;

/// What a posture tells a calibration. Orientations count as places do ([`LEVER_M`]).
#[derive(Debug)]
struct Posture {
    /// What the flange does where an origin slides along its axes, and where it turns about them, m per m and m per rad.
    moves: [[Matrix3<f64>; 2]; JOINT_COUNT],
    /// How far the twist of each gear moves the flange, m, and how far it turns it, rad.
    sags: Matrix6<f64>,
}

impl Posture {
    fn new(dynamics: &Dynamics, gears: &GearTwist, q: &Joints) -> Self {
        let chain = &dynamics.chain;
        let links = chain.link_poses(q);
        let flange = chain.base_link_from_flange(q).translation.vector;
        let twist = gears.twist_rad(&dynamics.gravity_torque(q));
        let mut sags = chain.jacobian_at(q, &Vector3::zeros());
        for joint in 0..JOINT_COUNT {
            sags.column_mut(joint).scale_mut(-twist[joint]);
        }
        let moves = std::array::from_fn(|joint| {
            let parent = if joint == 0 {
                Pose::identity()
            } else {
                links[joint - 1]
            };
            let origin = parent * chain.joints[joint].parent_from_joint;
            let axes = origin.rotation.to_rotation_matrix().into_inner();
            let arm = flange - origin.translation.vector;
            [axes, arm.cross_matrix() * -axes]
        });
        Self { moves, sags }
    }

    /// Adds what the posture knows of deviations, by the upper triangle, and of what each sag looks like.
    fn add_to(
        &self,
        information: &mut SMatrix<f64, SIZE, SIZE>,
        sides: &mut SMatrix<f64, SIZE, JOINT_COUNT>,
    ) {
        for (one, [slid, turned]) in self.moves.iter().enumerate() {
            for (other, [other_slid, other_turned]) in self.moves.iter().enumerate().skip(one) {
                let both = slid.tr_mul(other_slid);
                let (row, column) = (6 * one, 6 * other);
                let mut add = |row, column, block: Matrix3<f64>| {
                    let mut place = information.fixed_view_mut::<3, 3>(row, column);
                    place += block;
                };
                add(row, column, both);
                add(row, column + 3, slid.tr_mul(other_turned));
                add(row + 3, column, turned.tr_mul(other_slid));
                add(
                    row + 3,
                    column + 3,
                    turned.tr_mul(other_turned) + both * (LEVER_M * LEVER_M),
                );
            }
        }
        for joint in 0..JOINT_COUNT {
            let mut side = sides.column_mut(joint);
            side += self.as_deviations(&self.sags.column(joint).into_owned());
        }
    }

    /// What each deviation does to the flange: place, and turn times the lever.
    fn rows(&self) -> SMatrix<f64, SIZE, 6> {
        let mut rows = SMatrix::<f64, SIZE, 6>::zeros();
        for (joint, [slid, turned]) in self.moves.iter().enumerate() {
            let mut place = |row, column, block: Matrix3<f64>| {
                rows.fixed_view_mut::<3, 3>(6 * joint + row, column)
                    .copy_from(&block);
            };
            place(0, 0, slid.transpose());
            place(3, 0, turned.transpose());
            place(3, 3, slid.transpose() * LEVER_M);
        }
        rows
    }

    /// What a motion of the flange is along each deviation.
    fn as_deviations(&self, moved: &Vector6<f64>) -> SVector<f64, SIZE> {
        let place = moved.fixed_rows::<3>(0);
        let turn = moved.fixed_rows::<3>(3) * (LEVER_M * LEVER_M);
        let mut along = SVector::<f64, SIZE>::zeros();
        for (joint, [slid, turned]) in self.moves.iter().enumerate() {
            let mut rows = along.fixed_rows_mut::<3>(6 * joint);
            rows.copy_from(&slid.tr_mul(&place));
            let mut rows = along.fixed_rows_mut::<3>(6 * joint + 3);
            rows.copy_from(&(turned.tr_mul(&place) + slid.tr_mul(&turn)));
        }
        along
    }

    /// How far a sag leaves the flange off, place and turn, where a calibration took some deviations for it.
    fn left(&self, sag: Vector6<f64>, taken: &OriginDeviations) -> Vector6<f64> {
        let mut left = sag;
        for ([slid, turned], taken) in self.moves.iter().zip(taken) {
            let (slide, turn) = (taken.fixed_rows::<3>(0), taken.fixed_rows::<3>(3));
            let mut place = left.fixed_rows_mut::<3>(0);
            place -= slid * slide + turned * turn;
            let mut angle = left.fixed_rows_mut::<3>(3);
            angle -= slid * turn;
        }
        left
    }
}

/// Inverse of what is known of deviations, where anything is.
struct Information {
    eigen: SymmetricEigen<f64, Const<SIZE>>,
}

impl Information {
    /// Number of combinations of deviations of which something is known.
    fn known(&self) -> usize {
        let least = REDUNDANT * self.eigen.eigenvalues.amax();
        self.eigen
            .eigenvalues
            .iter()
            .filter(|value| **value > least)
            .count()
    }

    fn solve<const COLUMNS: usize>(
        &self,
        sides: &SMatrix<f64, SIZE, COLUMNS>,
    ) -> SMatrix<f64, SIZE, COLUMNS> {
        let least = REDUNDANT * self.eigen.eigenvalues.amax();
        let mut solved = self.eigen.eigenvectors.tr_mul(sides);
        for (row, value) in self.eigen.eigenvalues.iter().enumerate() {
            let factor = if *value > least { value.recip() } else { 0.0 };
            solved.row_mut(row).scale_mut(factor);
        }
        self.eigen.eigenvectors * solved
    }
}

/// Columns of deviations as those of each joint.
fn by_sag(columns: &SMatrix<f64, SIZE, JOINT_COUNT>) -> [OriginDeviations; JOINT_COUNT] {
    std::array::from_fn(|sagging| {
        std::array::from_fn(|joint| columns.fixed_view::<6, 1>(6 * joint, sagging).into_owned())
    })
}

/// What a calibration takes that is made from some postures, by the joint that sags. The fit is of least squares in place
/// and orientation, to first order, and the smallest of those that fit equally.
fn fitted(postures: &[Posture]) -> (Information, [OriginDeviations; JOINT_COUNT]) {
    let mut normal = SMatrix::zeros();
    let mut sides = SMatrix::zeros();
    for posture in postures {
        posture.add_to(&mut normal, &mut sides);
    }
    normal.fill_lower_triangle_with_upper_triangle();
    let information = Information {
        eigen: SymmetricEigen::new(normal),
    };
    let solved = information.solve(&sides);
    (information, by_sag(&solved))
}

/// How far the mean of calibrations of [`POSTURES`] is from what one of very many would take, by the joint that sags: each
/// bends towards the postures that it has, by their leverage (Cox and Snell, *J. R. Stat. Soc. B* 30(2), 1968). A small
/// correction, of a share of the postures.
fn bias(
    postures: &[Posture],
    information: &Information,
    mean: &[OriginDeviations; JOINT_COUNT],
) -> [OriginDeviations; JOINT_COUNT] {
    const EVERY: usize = 8;
    let mut pulled = SMatrix::<f64, SIZE, JOINT_COUNT>::zeros();
    for posture in postures.iter().step_by(EVERY) {
        let rows = posture.rows();
        let leverage = rows.tr_mul(&information.solve(&rows));
        for (sagging, taken) in mean.iter().enumerate() {
            let mut left = posture.left(posture.sags.column(sagging).into(), taken);
            left.fixed_rows_mut::<3>(3).scale_mut(LEVER_M);
            let mut column = pulled.column_mut(sagging);
            column -= rows * (leverage * left);
        }
    }
    let share = (postures.len() * EVERY) as f64 / POSTURES as f64;
    let solved = information.solve(&pulled) * share;
    by_sag(&solved)
}

/// How calibrations of [`POSTURES`] differ from their mean: the largest modes of the covariance of a least-squares fit
/// over postures that are drawn (White, *Econometrica* 48(4), 1980), each with its standard deviation.
fn modes(
    postures: &[Posture],
    information: &Information,
    mean: &OriginDeviations,
) -> Vec<OriginDeviations> {
    let mut scatter = SMatrix::<f64, SIZE, SIZE>::zeros();
    for posture in postures {
        let left = posture.left(posture.sags.column_sum(), mean);
        let pull = posture.as_deviations(&left);
        scatter.syger(1.0, &pull, &pull, 1.0);
    }
    scatter.fill_upper_triangle_with_lower_triangle();
    // Of sums over all postures, and of a calibration that has fewer and loses as many degrees of freedom as it fits
    // (MacKinnon and White, *Journal of Econometrics* 29(3), 1985: HC1); a posture has six.
    let fitted = information.known() as f64 / 6.0;
    let share = postures.len() as f64 / (POSTURES as f64 - fitted);
    let half = information.solve(&scatter);
    let covariance = information.solve(&half.transpose()) * share;
    let weights = SVector::<f64, SIZE>::from_fn(|row, _| if row % 6 < 3 { 1.0 } else { LEVER_M });
    let weighted = covariance.component_mul(&(weights * weights.transpose()));
    let eigen = SymmetricEigen::new(0.5 * (weighted + weighted.transpose()));
    let mut order: Vec<usize> = (0..SIZE).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let mode = |index: usize| {
        let deviation = eigen.eigenvalues[index].max(0.0).sqrt();
        std::array::from_fn(|joint| {
            Vector6::from_fn(|axis, _| {
                let row = 6 * joint + axis;
                eigen.eigenvectors[(row, index)] * deviation / weights[row]
            })
        })
    };
    order
        .into_iter()
        .take(AbsorbedSag::MODES)
        .map(mode)
        .collect()
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::super::ArmPopulation;
    use super::*;
    use needlebench_cell::Robot;

    const GRAVITY_M_S2: f64 = 9.80665;

    fn gears() -> GearTwist {
        GearTwist::linear(Joints::from(
            [1e4, 1e4, 4.7e3, 2.7e3, 2.7e3, 2.7e3].map(f64::recip),
        ))
    }

    /// The bare arm.
    fn measured(robot: &Robot, gravity_m_s2: Vector3<f64>) -> Dynamics {
        Dynamics {
            chain: robot.chain,
            bodies: robot.bodies,
            armature_kgm2: Joints::zeros(),
            gravity_m_s2,
        }
    }

    /// Root mean square distance of the flange from where the controller has it, and of its orientation by the
    /// same lever, over the postures of the fit: the whole non-linear arm, with its twist, under a chain that
    /// the controller believes in.
    fn rms_m(robot: &Robot, believed: &OriginDeviations, gravity_m_s2: Vector3<f64>) -> f64 {
        let dynamics = measured(robot, gravity_m_s2);
        let believed = ArmPopulation::moved(&robot.chain, believed);
        let mut random = SplitMix64::new(11);
        let squares = (0..POSTURES).map(|_| {
            let q = drawn(&robot.chain, &mut random);
            let sagged = q - gears().twist_rad(&dynamics.gravity_torque(&q));
            let real = robot.chain.base_link_from_flange(&sagged);
            let believed = believed.base_link_from_flange(&q);
            let turned = LEVER_M * real.rotation.angle_to(&believed.rotation);
            let moved = real.translation.vector - believed.translation.vector;
            moved.norm_squared() + turned * turned
        });
        (squares.sum::<f64>() / POSTURES as f64).sqrt()
    }

    fn drawn(chain: &Chain, random: &mut SplitMix64) -> Joints {
        use std::f64::consts::PI;
        loop {
            let q = Joints::from_fn(|_, _| random.uniform(-PI, PI));
            if is_upright(chain, &q) {
                return q;
            }
        }
    }

    /// Root mean square of what the flange is off by between two sets of deviations, m, over postures of its own.
    fn apart_m(chain: &Chain, one: &OriginDeviations, other: &OriginDeviations) -> f64 {
        let mut random = SplitMix64::new(5);
        let [one, other] = [one, other].map(|each| ArmPopulation::moved(chain, each));
        let squares = (0..POSTURES).map(|_| {
            let q = drawn(chain, &mut random);
            let places = [&one, &other].map(|each| each.base_link_from_flange(&q).translation);
            (places[0].vector - places[1].vector).norm_squared()
        });
        (squares.sum::<f64>() / POSTURES as f64).sqrt()
    }

    /// The mean is of the arm and not of the postures, and single calibrations scatter about it as the modes say.
    #[test]
    fn calibrations_of_other_postures_have_the_same_mean_and_spread() {
        const SINGLES: usize = 300;
        let robot = crate::load_robot(&crate::Overrides::default()).unwrap();
        let dynamics = measured(&robot, -Vector3::z() * GRAVITY_M_S2);
        let sag = AbsorbedSag::new(&dynamics, gears());
        let mean = sag.taken(&Joints::repeat(1.0), &[0.0; AbsorbedSag::MODES]);
        let left_m = rms_m(&robot, &mean, dynamics.gravity_m_s2);

        let mut random = SplitMix64::new(4);
        let singles: Vec<OriginDeviations> = (0..SINGLES)
            .map(|_| {
                let drawn = (0..POSTURES).map(|_| drawn(&robot.chain, &mut random));
                let drawn = drawn.map(|q| Posture::new(&dynamics, &gears(), &q));
                summed(&fitted(&drawn.collect::<Vec<_>>()).1)
            })
            .collect();
        let other_mean = std::array::from_fn(|joint| {
            singles.iter().map(|one| one[joint]).sum::<Vector6<f64>>() / SINGLES as f64
        });
        let off = apart_m(&robot.chain, &mean, &other_mean) / left_m;
        let squares = singles
            .iter()
            .map(|one| apart_m(&robot.chain, &mean, one).powi(2));
        let scatter = (squares.sum::<f64>() / SINGLES as f64).sqrt() / left_m;
        let none = [Vector6::zeros(); JOINT_COUNT];
        let squares = sag
            .modes()
            .iter()
            .map(|mode| apart_m(&robot.chain, &none, mode).powi(2));
        let by_modes = squares.sum::<f64>().sqrt() / left_m;
        // The other mean is itself known to a seventeenth of the scatter.
        assert!(off < 0.02, "{off}");
        assert!(
            (by_modes / scatter - 1.0).abs() < 0.08,
            "{by_modes} {scatter}"
        );
    }

    #[test]
    fn calibration_under_gravity_takes_a_part_of_the_sag_and_not_all() {
        let robot = crate::load_robot(&crate::Overrides::default()).unwrap();
        let none = [Vector6::zeros(); JOINT_COUNT];
        // Upright, hanging, and on a wall.
        for down in [-Vector3::z(), Vector3::z(), Vector3::x()] {
            let gravity_m_s2 = down * GRAVITY_M_S2;
            let rms_m = |believed: &OriginDeviations| rms_m(&robot, believed, gravity_m_s2);
            let sag = AbsorbedSag::new(&measured(&robot, gravity_m_s2), gears());
            let absorbed = sag.taken(&Joints::repeat(1.0), &[0.0; AbsorbedSag::MODES]);
            let (before, after) = (rms_m(&none), rms_m(&absorbed));
            assert!(after < 0.8 * before, "{before} {after}");
            assert!(after > 0.0);
            // Neither less nor more of it fits better.
            for share in [0.7, 1.3] {
                let other = absorbed.map(|each| each * share);
                assert!(rms_m(&other) > after, "{share}");
            }
        }
    }
}
