//! CMA-ES in a box: an evolution strategy that learns along which directions to look, and how far.
//!
//! Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772 (2016): equation numbers and default
//! parameters (table 1, positive weights alone) are its. What is drawn outside of the box is reflected at its sides, and counts as
//! if it had been drawn there. All draws come from the seed by number of generation, point and coordinate.
//! Only the order of the better half of a generation counts: what the worse half is worth need not be known.

use needlebench_numerics::normal;
use needlebench_numerics::random::SplitMix64;

/// A distribution of points in the unit cube, and what it has learnt.
#[derive(Debug, Clone)]
pub struct CmaEs {
    seed: u64,
    /// Whether points are kept in the unit cube.
    bounded: bool,
    weights: Vec<f64>,
    population: usize,
    mu_eff: f64,
    c_sigma: f64,
    d_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    chi: f64,
    mean: Vec<f64>,
    sigma: f64,
    covariance: Vec<Vec<f64>>,
    /// Columns are the axes of the distribution.
    axes: Vec<Vec<f64>>,
    /// Deviations along the axes.
    scales: Vec<f64>,
    path_sigma: Vec<f64>,
    path_c: Vec<f64>,
    generation: u64,
}

impl CmaEs {
    /// Begins at a point with a deviation, both in units of the box, with `4 + 3 ln(dimensions)` points in
    /// a generation (equation 48).
    pub fn new(start: &[f64], sigma: f64, seed: u64) -> Self {
        let natural = 4.0 + (3.0 * libm::log(start.len() as f64)).floor();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "4 to about 20"
        )]
        let population = natural as usize;
        Self::with_population(start, sigma, seed, population)
    }

    fn with_population(start: &[f64], sigma: f64, seed: u64, population: usize) -> Self {
        let dimensions = start.len();
        let n = dimensions as f64;
        let parents = population / 2;
        // Equations 49 to 53, with positive weights alone.
        let raw: Vec<f64> = (1..=parents)
            .map(|i| libm::log(0.5 * (population as f64 + 1.0)) - libm::log(i as f64))
            .collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|weight| weight / sum).collect();
        let mu_eff = 1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>();
        // Equations 55 to 58.
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n);
        let c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + mu_eff);
        let c_mu =
            (2.0 * (mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0) * (n + 2.0) + mu_eff)).min(1.0 - c_1);
        Self {
            seed,
            bounded: true,
            weights,
            population,
            mu_eff,
            c_sigma,
            d_sigma,
            c_c,
            c_1,
            c_mu,
            chi: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            mean: start.to_vec(),
            sigma,
            covariance: identity(dimensions),
            axes: identity(dimensions),
            scales: vec![1.0; dimensions],
            path_sigma: vec![0.0; dimensions],
            path_c: vec![0.0; dimensions],
            generation: 0,
        }
    }

    /// Number of points of a generation.
    pub fn population(&self) -> usize {
        self.population
    }

    /// Number of points of a generation whose order counts.
    pub fn parents(&self) -> usize {
        self.weights.len()
    }

    /// The middle of the distribution.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Deviation along the longest axis, in units of the box.
    pub fn spread(&self) -> f64 {
        self.sigma * self.scales.iter().copied().fold(0.0, f64::max)
    }

    /// Points of the next generation: the same ones until [`CmaEs::tell`].
    pub fn ask(&self) -> Vec<Vec<f64>> {
        (0..self.population)
            .map(|point| {
                let numbers: Vec<f64> = (0..self.mean.len())
                    .map(|axis| self.scales[axis] * self.normal(point, axis))
                    .collect();
                (0..self.mean.len())
                    .map(|k| {
                        let step: f64 = numbers
                            .iter()
                            .enumerate()
                            .map(|(axis, number)| self.axes[k][axis] * number)
                            .sum();
                        let x = self.mean[k] + self.sigma * step;
                        if self.bounded { reflected(x) } else { x }
                    })
                    .collect()
            })
            .collect()
    }

    fn normal(&self, point: usize, axis: usize) -> f64 {
        let place = (self.generation << 32) | ((point as u64) << 16) | axis as u64;
        let mixed = self.seed ^ place.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let seed = SplitMix64::new(mixed).next_u64();
        normal::quantile(SplitMix64::new(seed).open_unit())
    }

    /// Learns from a generation: its better points, the best first, at least [`CmaEs::parents`] of them.
    ///
    /// # Panics
    /// With fewer points.
    pub fn tell(&mut self, better: &[Vec<f64>]) {
        assert!(better.len() >= self.parents());
        let n = self.mean.len();
        let steps: Vec<Vec<f64>> = better[..self.parents()]
            .iter()
            .map(|point| {
                let pairs = point.iter().zip(&self.mean);
                pairs.map(|(x, mean)| (x - mean) / self.sigma).collect()
            })
            .collect();
        // Equations 41 and 42.
        let step: Vec<f64> = (0..n)
            .map(|k| {
                let pairs = self.weights.iter().zip(&steps);
                pairs.map(|(weight, step)| weight * step[k]).sum()
            })
            .collect();
        for (mean, step) in self.mean.iter_mut().zip(&step) {
            *mean += self.sigma * step;
        }
        // Equation 43: C^-1/2 of the step.
        let along: Vec<f64> = (0..n)
            .map(|axis| {
                let sum: f64 = (0..n).map(|k| self.axes[k][axis] * step[k]).sum();
                sum / self.scales[axis]
            })
            .collect();
        let keep = 1.0 - self.c_sigma;
        let gain = (self.c_sigma * (2.0 - self.c_sigma) * self.mu_eff).sqrt();
        for k in 0..n {
            let whitened: f64 = (0..n).map(|axis| self.axes[k][axis] * along[axis]).sum();
            self.path_sigma[k] = keep * self.path_sigma[k] + gain * whitened;
        }
        let length = norm(&self.path_sigma);
        self.generation += 1;
        // Equation 45, and the figure's h_sigma.
        let dimensions = n as f64;
        let expected = (1.0 - libm::pow(keep, 2.0 * self.generation as f64)).sqrt();
        let h = if length / expected < (1.4 + 2.0 / (dimensions + 1.0)) * self.chi {
            1.0
        } else {
            0.0
        };
        let gain = h * (self.c_c * (2.0 - self.c_c) * self.mu_eff).sqrt();
        for (path, step) in self.path_c.iter_mut().zip(&step) {
            *path = (1.0 - self.c_c) * *path + gain * step;
        }
        // Equation 47.
        let lost = (1.0 - h) * self.c_c * (2.0 - self.c_c);
        let old = 1.0 + self.c_1 * lost - self.c_1 - self.c_mu;
        for row in 0..n {
            for column in 0..=row {
                let pairs = self.weights.iter().zip(&steps);
                let of_steps: f64 = pairs
                    .map(|(weight, step)| weight * step[row] * step[column])
                    .sum();
                let value = old * self.covariance[row][column]
                    + self.c_1 * self.path_c[row] * self.path_c[column]
                    + self.c_mu * of_steps;
                self.covariance[row][column] = value;
                self.covariance[column][row] = value;
            }
        }
        // Equation 44.
        self.sigma *= libm::exp(self.c_sigma / self.d_sigma * (length / self.chi - 1.0));
        let (values, axes) = symmetric_eigen(&self.covariance);
        self.axes = axes;
        // Rounding may leave a tiny negative one.
        self.scales = values.iter().map(|value| value.max(1e-20).sqrt()).collect();
    }
}

fn identity(n: usize) -> Vec<Vec<f64>> {
    (0..n)
        .map(|row| (0..n).map(|k| f64::from(u8::from(k == row))).collect())
        .collect()
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A coordinate reflected at 0 and 1 until it is between them.
fn reflected(x: f64) -> f64 {
    let folded = x.abs() % 2.0;
    if folded > 1.0 { 2.0 - folded } else { folded }
}

/// Eigenvalues of a symmetric matrix and, as columns, its eigenvectors: Jacobi's rotations, row by row until
/// nothing is left off the diagonal (Golub and Van Loan, "Matrix computations", algorithm 8.5.2).
fn symmetric_eigen(matrix: &[Vec<f64>]) -> (Vec<f64>, Vec<Vec<f64>>) {
    /// It converges quadratically, in six to ten.
    const MOST_SWEEPS: usize = 60;
    let n = matrix.len();
    let mut a = matrix.to_vec();
    let mut v = identity(n);
    for _ in 0..MOST_SWEEPS {
        let off: f64 = (0..n)
            .flat_map(|row| a[row][..row].iter())
            .map(|x| x * x)
            .sum();
        let on: f64 = (0..n).map(|k| a[k][k] * a[k][k]).sum();
        if off <= 1e-30 * on {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q] == 0.0 {
                    continue;
                }
                let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
                let c = 1.0 / (1.0 + t * t).sqrt();
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (upper, lower) = a.split_at_mut(q);
                for (x, y) in upper[p].iter_mut().zip(&mut lower[0]) {
                    (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
                }
                for row in &mut v {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
    }
    ((0..n).map(|k| a[k][k]).collect(), v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_put_the_matrix_together() {
        let matrix = [
            vec![4.0, 1.0, -2.0],
            vec![1.0, 2.0, 0.0],
            vec![-2.0, 0.0, 3.0],
        ];
        let (values, vectors) = symmetric_eigen(&matrix);
        for row in 0..3 {
            for column in 0..3 {
                let found: f64 = (0..3)
                    .map(|k| vectors[row][k] * values[k] * vectors[column][k])
                    .sum();
                assert!((found - matrix[row][column]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn coordinates_are_reflected_into_the_box() {
        for (x, expected) in [
            (0.3, 0.3),
            (-0.25, 0.25),
            (1.25, 0.75),
            (2.5, 0.5),
            (-1.5, 0.5),
        ] {
            assert_eq!(reflected(x), expected);
        }
    }

    fn sphere(x: &[f64]) -> f64 {
        x.iter().map(|x| x * x).sum()
    }

    fn rosenbrock(x: &[f64]) -> f64 {
        x.windows(2)
            .map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2))
            .sum()
    }

    /// An ellipsoid with axes from 1 to 1000, reflected by Householder's matrix of (1, 2, ..., n).
    fn ellipsoid(x: &[f64]) -> f64 {
        let n = x.len();
        let normal: Vec<f64> = (1..=n).map(|k| k as f64).collect();
        let square: f64 = normal.iter().map(|v| v * v).sum();
        let along: f64 = normal.iter().zip(x).map(|(v, x)| v * x).sum();
        (0..n)
            .map(|k| {
                let y = x[k] - 2.0 * normal[k] * along / square;
                libm::pow(10.0, 6.0 * k as f64 / (n - 1) as f64) * y * y
            })
            .sum()
    }

    /// Evaluations until a function is below 1e-9, without bounds, median of 21 seeds.
    fn evaluations(f: fn(&[f64]) -> f64, n: usize, start: f64) -> usize {
        let mut counts: Vec<usize> = (0..21)
            .map(|seed| {
                let mut cma = CmaEs::new(&vec![start; n], 0.5, seed);
                cma.bounded = false;
                let mut count = 0;
                loop {
                    let mut points = cma.ask();
                    for point in &points {
                        count += 1;
                        if f(point) < 1e-9 || count > 100_000 {
                            return count;
                        }
                    }
                    points.sort_by(|a, b| f(a).total_cmp(&f(b)));
                    cma.tell(&points);
                }
            })
            .collect();
        counts.sort_unstable();
        counts[10]
    }

    /// The same with pycma 4.5.0, `CMA_active = False`: `tests/validation/search/pycma.py`.
    #[test]
    fn it_needs_as_many_evaluations_as_pycma() {
        /// Medians of 21 runs of either differ by a few percent among themselves.
        const SHARE: f64 = 0.15;
        for (name, f, start, by_dimension) in [
            ("sphere", sphere as fn(&[f64]) -> f64, 1.0, PYCMA[0]),
            ("rosenbrock", rosenbrock, 0.0, PYCMA[1]),
            ("ellipsoid", ellipsoid, 1.0, PYCMA[2]),
        ] {
            for (n, expected) in [4, 8].into_iter().zip(by_dimension) {
                let found = evaluations(f, n, start) as f64;
                assert!(
                    (found / expected - 1.0).abs() < SHARE,
                    "{name} in {n}: {found}, pycma {expected}"
                );
            }
        }
    }

    const PYCMA: [[f64; 2]; 3] = [[569.0, 1218.0], [1421.0, 4223.0], [1520.0, 4062.0]];

    #[test]
    fn an_optimum_on_the_side_of_the_box_is_found() {
        // The least of a sphere about a point outside is on the side nearest to it.
        let f = |x: &[f64]| {
            let away = [x[0] - 1.4, x[1] - 0.3, x[2] + 0.2];
            sphere(&away)
        };
        for seed in 0..10 {
            let mut cma = CmaEs::new(&[0.5; 3], 0.3, seed);
            for _ in 0..150 {
                let mut points = cma.ask();
                assert!(points.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
                points.sort_by(|a, b| f(a).total_cmp(&f(b)));
                cma.tell(&points);
            }
            let found = cma.mean();
            for (found, expected) in found.iter().zip([1.0, 0.3, 0.0]) {
                assert!((found - expected).abs() < 1e-3, "{seed}: {:?}", cma.mean());
            }
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_points() {
        let points = |seed| CmaEs::new(&[0.5; 4], 0.3, seed).ask();
        assert_eq!(points(7), points(7));
        assert_ne!(points(7), points(8));
    }
}
