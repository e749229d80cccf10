//! The two solutions that meet at a singularity near a posture.
//!
//! Along the direction `v` that moves the flange least, by `sigma u` per radian, the flange moves by
//! `sigma t + kappa t^2 / 2` along `u`; across it, a step of Gauss and Newton of rank five serves.
//! The quadratic equation has both solutions, however near to one another, where Newton's method
//! from one side crawls.

use super::descent::{Factor, curvature, gradient, normal_matrix, product};
use super::kernel::{Kernel, Lanes, State, Target};

/// Rounds towards the place where the two meet.
const ROUNDS: u32 = 7;

/// Where both steps are shorter, the quadratic equation is right to their squares, rad.
const SETTLED_RAD: f64 = 0.02;
const CLOSELY_SETTLED_RAD: f64 = 1e-5;

/// The two meet, if at all, within this of the start, rad.
const FARTHEST_RAD: f64 = 0.5;

/// What keeps a singular matrix factorable.
const DAMPING: f64 = 1e-13;

/// Where the two would be this near to one another were the equation's sign the other one, rad^2,
/// rounding may be all, and the place where they meet is tried.
const JUST_MISSES: f64 = 1e-8;

/// Starts near the two solutions, or near the one where they meet; none if they do not.
#[inline(always)]
pub(super) fn fold(
    kernel: &Kernel,
    target: &Target,
    start: &Lanes,
    rad_per_m: f64,
) -> Option<[Lanes; 2]> {
    let weight = rad_per_m * rad_per_m;
    let mut q = *start;
    for _ in 0..ROUNDS {
        let state = kernel.state(&q);
        let error = state.error(target);
        let flat = Flat::new(&state, weight)?;
        let across = flat.across(&error);
        let meet = -flat.sigma / flat.kappa;
        if meet.is_nan() || meet.abs() > FARTHEST_RAD {
            return None;
        }
        let off = product(&across, &across).sqrt().max(meet.abs());
        let root_squared = flat.sigma * flat.sigma + 2.0 * flat.kappa * flat.along(&error);
        // Where the two nearly coincide, the equation has to be right to more digits.
        let apart = root_squared > (off * flat.kappa).powi(2);
        if off < SETTLED_RAD && (apart || off < CLOSELY_SETTLED_RAD) {
            if root_squared < -JUST_MISSES * flat.kappa * flat.kappa {
                return None;
            }
            let root = root_squared.max(0.0).sqrt();
            let back = flat.across(&flat.bend.map(|x| -0.5 * x));
            return Some([1.0, -1.0].map(|sign| {
                let t = (-flat.sigma + sign * root) / flat.kappa;
                std::array::from_fn(|i| q[i] + across[i] + t * flat.v[i] + t * t * back[i])
            }));
        }
        for i in 0..6 {
            q[i] += across[i] + meet * flat.v[i];
        }
    }
    None
}

/// The two directions of the joints that move the flange least, rad.
#[inline(always)]
pub(super) fn flattest_plane(kernel: &Kernel, q: &Lanes, rad_per_m: f64) -> Option<[Lanes; 2]> {
    let mut matrix = normal_matrix(&kernel.state(q).rows, rad_per_m * rad_per_m);
    let first = flattest(&matrix)?;
    for i in 0..6 {
        for j in 0..6 {
            matrix[i][j] += first[i] * first[j];
        }
    }
    Some([first, flattest(&matrix)?])
}

/// The flattest direction of a posture.
struct Flat {
    rows: [Lanes; 6],
    weight: f64,
    /// Of the joints, and of the flange with lengths weighted by the root of the weight.
    v: Lanes,
    u: [f64; 6],
    sigma: f64,
    kappa: f64,
    /// Second derivative of the flange's pose along `v`.
    bend: [f64; 6],
    steep: Factor,
}

impl Flat {
    #[inline(always)]
    fn new(state: &State, weight: f64) -> Option<Self> {
        let rows = state.rows;
        let root = weight.sqrt();
        let scale = [root, root, root, 1.0, 1.0, 1.0];
        let mut matrix = normal_matrix(&rows, weight);
        let v = flattest(&matrix)?;
        let mut left = [[0.0; 8]; 6];
        for i in 0..6 {
            for j in i..6 {
                let entry = scale[i] * scale[j] * product(&rows[i], &rows[j]);
                left[i][j] = entry;
                left[j][i] = entry;
            }
        }
        let u_lanes = flattest(&left)?;
        let mut u = [0.0; 6];
        u.copy_from_slice(&u_lanes[..6]);
        let bend = curvature(&rows, &v);
        let (mut sigma, mut kappa) = (0.0, 0.0);
        for i in 0..6 {
            let along = u[i] * scale[i];
            sigma += along * product(&rows[i], &v);
            kappa += along * bend[i];
        }
        for i in 0..6 {
            for j in 0..6 {
                matrix[i][j] += v[i] * v[j];
            }
        }
        Some(Self {
            rows,
            weight,
            v,
            u,
            sigma,
            kappa,
            bend,
            steep: Factor::new(&matrix, 0.0),
        })
    }

    /// The step that takes the error off but for the flattest direction.
    #[inline(always)]
    fn across(&self, error: &[f64; 6]) -> Lanes {
        let mut step = self.steep.solve(&gradient(&self.rows, error, self.weight));
        let along = product(&step, &self.v);
        for (entry, v) in step.iter_mut().zip(&self.v) {
            *entry -= along * v;
        }
        step
    }

    /// The error in the flattest direction.
    fn along(&self, error: &[f64; 6]) -> f64 {
        let root = self.weight.sqrt();
        (0..6)
            .map(|i| self.u[i] * error[i] * if i < 3 { root } else { 1.0 })
            .sum()
    }
}

/// Unit vector of the least eigenvalue, by inverse iteration.
#[inline(always)]
fn flattest(matrix: &[Lanes; 6]) -> Option<Lanes> {
    let factor = Factor::new(matrix, DAMPING);
    let mut vector = [1.0, -0.9, 0.8, 1.1, -0.7, 1.2, 0.0, 0.0];
    for _ in 0..2 {
        vector = factor.solve(&vector);
        let length = product(&vector, &vector).sqrt();
        // Written so that NaN fails too.
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        vector = vector.map(|x| x / length);
        vector[6] = 0.0;
        vector[7] = 0.0;
    }
    Some(vector)
}
