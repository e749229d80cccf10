//! Manipulability and distances to singularities.

use std::f64::consts::PI;

use nalgebra::Matrix6;

use crate::{Chain, JOINT_COUNT, Joints, UrGeometry};

/// How well an arm moves its flange in every direction from a posture.
///
/// Yoshikawa, *Manipulability of robotic mechanisms*, 1985; of a geometric Jacobian with linear rows
/// over angular ones, such as [`Chain::jacobian`]. None depends on the frame, but all except
/// [`Manipulability::rotational`] and [`Manipulability::volume_m3`] depend on the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Manipulability {
    /// `sqrt(det(J J^T)) = |det J|`, m^3.
    pub volume_m3: f64,
    /// `sqrt(det(J_v J_v^T))` of the linear rows, m^3.
    pub translational_m3: f64,
    /// `sqrt(det(J_w J_w^T))` of the angular rows.
    pub rotational: f64,
    /// Least singular value of the Jacobian with lengths in characteristic lengths: the slowest
    /// motion of the flange for joint speeds of norm one.
    pub min_singular_value: f64,
    /// Ratio of the largest to the least singular value; 1 is best, `inf` at a singularity.
    pub condition_number: f64,
}

impl Manipulability {
    /// Of a Jacobian, for a length that counts as much as a radian: what the tool reaches beyond the
    /// flange, say, or the arm's own reach.
    ///
    /// NaN where the Jacobian is not finite or the length zero.
    pub fn of(jacobian: &Matrix6<f64>, characteristic_length_m: f64) -> Self {
        let mut scaled = *jacobian;
        scaled
            .fixed_rows_mut::<3>(0)
            .unscale_mut(characteristic_length_m);
        // The iteration of the decomposition never ends on NaN.
        if !scaled.iter().all(|entry| entry.is_finite()) {
            return Self {
                volume_m3: f64::NAN,
                translational_m3: f64::NAN,
                rotational: f64::NAN,
                min_singular_value: f64::NAN,
                condition_number: f64::NAN,
            };
        }
        let values = scaled.singular_values();
        // Products of singular values: the determinants of the squares lose half the digits.
        let volume = |row| jacobian.fixed_rows::<3>(row).singular_values().product();
        Self {
            volume_m3: jacobian.determinant().abs(),
            translational_m3: volume(0),
            rotational: volume(3),
            min_singular_value: values.min(),
            condition_number: values.max() / values.min(),
        }
    }
}

/// Gradient of `det J` of the flange with respect to the joints, m^3/rad.
///
/// `tr(adj(J) dJ/dq_k)` by Jacobi's formula, with the adjugate from the singular value decomposition,
/// so that it holds at singularities too. Times the sign of `det J` it is the gradient of
/// [`Manipulability::volume_m3`], which has a kink where that is zero. Agrees with central
/// differences to 1e-9 (`the_determinants_gradient_is_its_change`). NaN where `q` is not finite.
pub fn determinant_gradient(chain: &Chain, q: &Joints) -> Joints {
    let jacobian = chain.jacobian(q);
    if !jacobian.iter().all(|entry| entry.is_finite()) {
        return Joints::repeat(f64::NAN);
    }
    let adjugate = adjugate(&jacobian);
    let hessian = chain.jacobian_hessian(q);
    // tr(A B) without the product.
    Joints::from_fn(|k, _| adjugate.transpose().dot(&hessian[k]))
}

/// `det(A) A^-1`, continued to where there is no inverse: `A = U S V^T` gives
/// `det(U) det(V) V adj(S) U^T`, and the adjugate of a diagonal matrix holds products of five.
fn adjugate(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    let svd = matrix.svd(true, true);
    let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let products = Joints::from_fn(|i, _| {
        (0..JOINT_COUNT)
            .filter(|&k| k != i)
            .map(|k| svd.singular_values[k])
            .product()
    });
    let sign = (u.determinant() * v_t.determinant()).signum();
    sign * v_t.transpose() * Matrix6::from_diagonal(&products) * u.transpose()
}

/// How far a posture of a UR arm is from each of its three singularities.
///
/// For a calibrated arm they are those of its nominal geometry, and good to its deviation from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingularityDistances {
    /// Wrist: angle of `q5` from the nearest of 0 and pi, where the axes of wrist 1 and 3 are
    /// parallel, rad; at most pi/2.
    pub wrist_rad: f64,
    /// Elbow: angle of `q3` from the nearest of 0 and pi, where the arm is stretched or folded, rad;
    /// at most pi/2.
    pub elbow_rad: f64,
    /// Elbow: how much further from the shoulder the centre of wrist 1 could be, m.
    pub stretch_left_m: f64,
    /// Elbow: how much nearer to the shoulder the centre of wrist 1 could be, m.
    pub fold_left_m: f64,
    /// Shoulder: how far the centre of wrist 2 is ahead of the shoulder axis in the arm's plane,
    /// `|`[`UrGeometry::wrist_forward_m`]`| = sqrt(rho^2 - d4^2)`, m.
    pub shoulder_forward_m: f64,
    /// Shoulder: how much nearer to the shoulder axis the centre of wrist 2 could be, `rho - |d4|`, m.
    pub shoulder_approach_m: f64,
    /// Shoulder: angle of `q1` to where right and left shoulder would meet, for the same centre of
    /// wrist 2: half the angle between them, `acos(|d4| / rho)`, rad; at most pi/2.
    pub shoulder_rad: f64,
}

impl SingularityDistances {
    /// Of a posture, each to a few units in the last place of the joints and lengths that it comes
    /// from, near singularities too (`distances_keep_their_digits_next_to_a_singularity`).
    pub fn of(geometry: &UrGeometry, q: &Joints) -> Self {
        let (a2, a3, d4) = (geometry.a2, geometry.a3, geometry.d4.abs());
        let product = 4.0 * a2 * a3;
        let (sine, cosine) = libm::sincos(0.5 * q[2]);
        // Differences of squares as products: the plain differences lose half the digits.
        let (stretched, folded) = (a2 + a3, a2 - a3);
        let reach_m = libm::hypot(stretched * cosine, folded * sine);
        let forward_m = geometry.wrist_forward_m(q).abs();
        Self {
            wrist_rad: from_half_turns(q[4]),
            elbow_rad: from_half_turns(q[2]),
            stretch_left_m: product * sine * sine / (stretched.abs() + reach_m),
            fold_left_m: left(product * cosine * cosine, reach_m + folded.abs()),
            shoulder_forward_m: forward_m,
            shoulder_approach_m: left(forward_m * forward_m, libm::hypot(forward_m, d4) + d4),
            shoulder_rad: libm::atan2(forward_m, d4),
        }
    }
}

impl UrGeometry {
    /// Determinant of the Jacobian, m^3: `a2 a3 sin(q3) sin(q5)` times
    /// [`UrGeometry::wrist_forward_m`].
    ///
    /// Its three factors are the three singularities: elbow, wrist, shoulder. Equals
    /// `chain().jacobian(q).determinant()` to 1e-15 for a UR3
    /// (`the_determinant_is_the_product_of_the_three_singularities`).
    pub fn jacobian_determinant_m3(&self, q: &Joints) -> f64 {
        self.a2 * self.a3 * libm::sin(q[2]) * libm::sin(q[4]) * self.wrist_forward_m(q)
    }
}

/// A quotient that is 0, not NaN, where both are: equal links folded onto one another, `d4 = 0`.
fn left(difference_of_squares: f64, sum: f64) -> f64 {
    if sum == 0.0 {
        0.0
    } else {
        difference_of_squares / sum
    }
}

/// Angle from the nearest multiple of a half turn, rad.
fn from_half_turns(angle_rad: f64) -> f64 {
    (angle_rad - PI * (angle_rad / PI).round()).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UrModel;
    use crate::pose_sets::PoseSet;
    use needlebench_numerics::random::SplitMix64;

    /// Twenty times the rounding of a determinant below 0.03 m^3 from entries of about 1.
    const DETERMINANT_M3: f64 = 1e-15;

    /// Fifty times the rounding of a value of about 1 over the step of 6e-6 rad.
    const DIFFERENCES: f64 = 1e-9;

    const STEP_RAD: f64 = 6e-6;

    fn postures(away_rad: f64) -> impl Iterator<Item = Joints> {
        let mut random = SplitMix64::new(7);
        PoseSet::ALL.into_iter().flat_map(move |set| {
            (0..50)
                .map(|_| set.sample(&UrGeometry::UR3, &mut random, away_rad))
                .collect::<Vec<_>>()
        })
    }

    /// Central differences of a function of the joints.
    fn change(q: &Joints, value: impl Fn(&Joints) -> f64) -> Joints {
        Joints::from_fn(|k, _| {
            let mut step = Joints::zeros();
            step[k] = STEP_RAD;
            (value(&(q + step)) - value(&(q - step))) / (2.0 * STEP_RAD)
        })
    }

    #[test]
    fn the_determinant_is_the_product_of_the_three_singularities() {
        let chain = UrGeometry::UR3.chain();
        for q in postures(0.0).chain(postures(1e-3)) {
            let closed = UrGeometry::UR3.jacobian_determinant_m3(&q);
            let error = chain.jacobian(&q).determinant() - closed;
            assert!(error.abs() < DETERMINANT_M3, "{error:e}");
        }
        for geometry in UrModel::ALL.map(UrModel::geometry) {
            let q = Joints::new(0.3, -1.1, 1.4, 0.5, -0.9, 2.0);
            let closed = geometry.jacobian_determinant_m3(&q);
            let error = geometry.chain().jacobian(&q).determinant() / closed - 1.0;
            assert!(error.abs() < 1e-13, "{error:e}");
        }
    }

    #[test]
    fn the_determinants_gradient_is_its_change() {
        let chain = UrGeometry::UR3.chain();
        for q in postures(0.0).chain(postures(1e-4)) {
            let differences = change(&q, |q| UrGeometry::UR3.jacobian_determinant_m3(q));
            assert!((determinant_gradient(&chain, &q) - differences).amax() < DIFFERENCES);
            let numerical = change(&q, |q| chain.jacobian(q).determinant());
            assert!((determinant_gradient(&chain, &q) - numerical).amax() < DIFFERENCES);
        }
    }

    #[test]
    fn volumes_are_yoshikawas() {
        let chain = UrGeometry::UR3.chain();
        for q in postures(1e-2) {
            let jacobian = chain.jacobian(&q);
            let measures = Manipulability::of(&jacobian, 1.0);
            let (linear, angular) = (jacobian.fixed_rows::<3>(0), jacobian.fixed_rows::<3>(3));
            let product: f64 = jacobian.singular_values().product();
            assert!((measures.volume_m3 - product).abs() < DETERMINANT_M3);
            let squared = (linear * linear.transpose()).determinant();
            assert!((measures.translational_m3.powi(2) - squared).abs() < DETERMINANT_M3);
            let squared = (angular * angular.transpose()).determinant();
            assert!((measures.rotational.powi(2) - squared).abs() < 100.0 * DETERMINANT_M3);
        }
    }

    #[test]
    fn joint_speeds_of_norm_one_move_the_flange_no_slower_than_the_least_singular_value() {
        let chain = UrGeometry::UR3.chain();
        let length_m = 0.3;
        let mut random = SplitMix64::new(8);
        for q in postures(1e-2) {
            let jacobian = chain.jacobian(&q);
            let measures = Manipulability::of(&jacobian, length_m);
            let largest = measures.condition_number * measures.min_singular_value;
            for _ in 0..10 {
                let qd = Joints::from_fn(|_, _| random.uniform(-1.0, 1.0)).normalize();
                let twist = jacobian * qd;
                let speed = libm::hypot(
                    twist.fixed_rows::<3>(0).norm() / length_m,
                    twist.fixed_rows::<3>(3).norm(),
                );
                assert!(speed >= measures.min_singular_value && speed <= largest * (1.0 + 1e-14));
            }
        }
        let stretched = Manipulability::of(&chain.jacobian(&Joints::zeros()), length_m);
        assert!(stretched.condition_number > 1e15 && stretched.volume_m3 < DETERMINANT_M3);
        let nowhere = Manipulability::of(&Matrix6::repeat(f64::NAN), length_m);
        assert!(nowhere.condition_number.is_nan() && nowhere.volume_m3.is_nan());
    }

    #[test]
    fn distances_are_what_forward_kinematics_shows() {
        const LENGTH_M: f64 = 1e-15;
        let ur3 = UrGeometry::UR3;
        let chain = ur3.chain();
        for q in postures(0.1) {
            let of = SingularityDistances::of(&ur3, &q);
            let links = chain.link_poses(&q);
            let origin = |i: usize| links[i].translation.vector;
            // Wrist 1's origin, back by d4 along its axis: in the plane of upper arm and forearm.
            let wrist_1 = origin(3) - links[3].rotation * nalgebra::Vector3::z() * ur3.d4;
            let reach_m = (wrist_1 - origin(1)).norm();
            let (longest, shortest) = (ur3.a2 + ur3.a3, ur3.a2 - ur3.a3);
            assert!((of.stretch_left_m - (longest.abs() - reach_m)).abs() < LENGTH_M);
            assert!((of.fold_left_m - (reach_m - shortest.abs())).abs() < 10.0 * LENGTH_M);
            let rho_m = libm::hypot(origin(4).x, origin(4).y);
            assert!((of.shoulder_approach_m - (rho_m - ur3.d4)).abs() < 2.0 * LENGTH_M);
            assert!(
                (of.shoulder_rad - libm::atan(of.shoulder_forward_m / ur3.d4)).abs() < LENGTH_M
            );
            assert!((libm::sin(of.wrist_rad) - libm::sin(q[4]).abs()).abs() < LENGTH_M);
            assert!((libm::sin(of.elbow_rad) - libm::sin(q[2]).abs()).abs() < LENGTH_M);
        }
    }

    #[test]
    fn distances_keep_their_digits_next_to_a_singularity() {
        let ur3 = UrGeometry::UR3;
        let small = 1e-9;
        let of = SingularityDistances::of(&ur3, &Joints::new(0.0, -1.0, small, 0.4, -small, 0.0));
        assert_eq!((of.wrist_rad, of.elbow_rad), (small, small));
        // Half of a2 a3 / (a2 + a3) q3^2, to second order.
        let expected = 0.5 * ur3.a2 * ur3.a3 / (ur3.a2 + ur3.a3).abs() * small * small;
        assert!((of.stretch_left_m / expected - 1.0).abs() < 1e-14);
    }
}
