//! Every posture of a pose, by following known ones along a path; no algebra of the arm is used.
//!
//! Forward kinematics is the product of six Denavit-Hartenberg matrices. Eight postures of one
//! generic pose of a UR3 are known; pose and lengths then move to the wanted ones through complex
//! numbers, where no two postures meet, and Newton's method follows all eight. Ends that are real
//! are the postures. All eight ends differing shows that no path has jumped onto another.
//!
//! As `make_reference.py`, but in 106 bits and along another path.

use nalgebra::{ComplexField as _, Matrix6, Vector6};
use needlebench_kinematics::{Joints, Pose, UrGeometry};
use needlebench_numerics::random::SplitMix64;

use super::double_double::{Complex, Real};

/// The least singular value of a Jacobian below which a posture is nearly singular.
const FLAT: f64 = 1e-3;

/// Each step of Newton's method is at most this share of the one before.
const CONTRACTION: f64 = 0.05;

/// Newton's method has ended with a step below this, rad: branches that differ by less would be one
/// in double precision, and where the least singular value is 1e-18 (wrist and shoulder, both 1e-9
/// away) rounding stirs them by 1e-14.
const SETTLED_RAD: f64 = 1e-11;

/// Along a path, a step that is rounding and says nothing of the next, rad.
const NO_STEP_RAD: f64 = 1e-20;

/// An end of a path is real if its imaginary part is below this, rad. A double root that the
/// rounding of the pose (1e-17) has made complex has one of 1e-9 or more.
const REAL_RAD: f64 = 1e-12;

/// Two ends nearer than this, rad, are one: a path has jumped.
const JUMPED_RAD: f64 = 1e-13;

/// Where a path ends whose end is not a single posture.
const PATH_END: f64 = 1e-24;

/// From here on a path may get stuck, at an end that is singular in several ways.
const ENDED: f64 = 1e-13;

/// Detours after which it is given up.
const MOST_DETOURS: usize = 50;

/// Cosine and sine of each joint.
type Posture = [(Complex, Complex); 6];

/// A pose, perhaps complex.
#[derive(Clone, Copy)]
pub struct Target {
    /// Rows.
    rotation: [[Complex; 3]; 3],
    position: [Complex; 3],
}

/// `d` and `a` of the six links, perhaps complex.
#[derive(Clone, Copy)]
struct Lengths {
    d: [Complex; 6],
    a: [Complex; 6],
}

/// Sines of the link twists; the cosine is 0 where they are not, and 1 elsewhere.
const TWIST_SINES: [i8; 6] = [1, 0, 0, 1, -1, 0];

struct Forward {
    /// Columns of the rotation.
    columns: [[Complex; 3]; 3],
    position: [Complex; 3],
    axes: [[Complex; 3]; 6],
    origins: [[Complex; 3]; 6],
}

fn forward(lengths: &Lengths, posture: &Posture) -> Forward {
    let unit =
        |at: usize| std::array::from_fn(|i| if i == at { Complex::ONE } else { Complex::ZERO });
    let mut columns: [[Complex; 3]; 3] = [unit(0), unit(1), unit(2)];
    let mut position = [Complex::ZERO; 3];
    let mut axes = [[Complex::ZERO; 3]; 6];
    let mut origins = axes;
    for (i, (c, s)) in posture.iter().enumerate() {
        let [x, y, z] = columns;
        axes[i] = z;
        origins[i] = position;
        let x_turned = std::array::from_fn(|j| *c * x[j] + *s * y[j]);
        let y_turned = std::array::from_fn(|j| *c * y[j] - *s * x[j]);
        position =
            std::array::from_fn(|j| position[j] + lengths.a[i] * x_turned[j] + lengths.d[i] * z[j]);
        columns = match TWIST_SINES[i] {
            0 => [x_turned, y_turned, z],
            1 => [x_turned, z, y_turned.map(|v| -v)],
            _ => [x_turned, z.map(|v| -v), y_turned],
        };
    }
    Forward {
        columns,
        position,
        axes,
        origins,
    }
}

fn cross(a: &[Complex; 3], b: &[Complex; 3]) -> [Complex; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Position error, m, and axis times sine of the angle.
fn pose_error(target: &Target, at: &Forward) -> [Complex; 6] {
    let mut turn = [Complex::ZERO; 3];
    for (k, column) in at.columns.iter().enumerate() {
        let wanted = target.rotation.map(|row| row[k]);
        let crossed = cross(column, &wanted);
        turn = std::array::from_fn(|j| turn[j] + crossed[j].scaled(Real::of(0.5)));
    }
    let linear: [Complex; 3] = std::array::from_fn(|j| target.position[j] - at.position[j]);
    [linear[0], linear[1], linear[2], turn[0], turn[1], turn[2]]
}

/// Error of a posture and its geometric Jacobian (columns).
struct System {
    error: [Complex; 6],
    jacobian: [[Complex; 6]; 6],
}

impl System {
    fn at(lengths: &Lengths, target: &Target, posture: &Posture) -> Self {
        let at = forward(lengths, posture);
        let jacobian = std::array::from_fn(|i| {
            let arm = std::array::from_fn(|j| at.position[j] - at.origins[i][j]);
            let linear = cross(&at.axes[i], &arm);
            let axis = at.axes[i];
            [linear[0], linear[1], linear[2], axis[0], axis[1], axis[2]]
        });
        Self {
            error: pose_error(target, &at),
            jacobian,
        }
    }

    fn rounded(&self) -> Matrix6<nalgebra::Complex<f64>> {
        Matrix6::from_fn(|row, column| self.jacobian[column][row].rounded())
    }

    /// Newton's step, by elimination with row pivoting.
    fn step(&self) -> [Complex; 6] {
        let mut rows: [[Complex; 7]; 6] = std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                if column < 6 {
                    self.jacobian[column][row]
                } else {
                    self.error[row]
                }
            })
        });
        for k in 0..6 {
            let pivot = (k..6)
                .max_by(|a, b| rows[*a][k].size().total_cmp(&rows[*b][k].size()))
                .expect("six rows");
            rows.swap(k, pivot);
            let inverse = rows[k][k].inverse();
            let upper = rows[k];
            for row in rows.iter_mut().skip(k + 1) {
                let factor = row[k] * inverse;
                for column in k + 1..7 {
                    row[column] = row[column] - factor * upper[column];
                }
            }
        }
        let mut step = [Complex::ZERO; 6];
        for k in (0..6).rev() {
            let known = (k + 1..6).fold(Complex::ZERO, |sum, j| sum + rows[k][j] * step[j]);
            step[k] = (rows[k][6] - known) * rows[k][k].inverse();
        }
        step
    }
}

/// A posture after a step of the joints: by `2 atan(step / 2)`, which needs no sine, and which is
/// the step but for its cube.
fn turned(posture: &Posture, step: &[Complex; 6]) -> Posture {
    std::array::from_fn(|i| {
        let half = step[i].scaled(Real::of(0.5));
        let square = half * half;
        let inverse = (Complex::ONE + square).inverse();
        let (cos, sin) = ((Complex::ONE - square) * inverse, (half + half) * inverse);
        let (c, s) = posture[i];
        (c * cos - s * sin, s * cos + c * sin)
    })
}

fn largest(values: &[Complex; 6]) -> f64 {
    values.iter().map(|x| x.size()).fold(0.0, f64::max)
}

/// Corrects a posture in its steep directions only.
///
/// Where two postures or a family are near, steep and flat directions differ by many orders of
/// magnitude, and what a step leaves in the steep ones would swamp the flat ones.
fn across(lengths: &Lengths, target: &Target, posture: &Posture) -> (Posture, System) {
    let mut posture = *posture;
    let mut system = System::at(lengths, target, &posture);
    for round in 0..6 {
        let svd = system.rounded().svd_unordered(true, true);
        let values = svd.singular_values;
        if round == 0 && values.min() > FLAT {
            break;
        }
        let size = largest(&system.error);
        if size < 1e-30 {
            break;
        }
        let scaled =
            Vector6::from_fn(|i, _| (system.error[i].scaled(Real::of(1.0 / size))).rounded());
        let along = svd.u.expect("asked for").adjoint() * scaled;
        // The widest gap between singular values parts steep from flat.
        let mut sorted: [f64; 6] = values.into();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let last_steep = (0..5)
            .max_by(|a, b| {
                let gap = |i: usize| sorted[i] / sorted[i + 1].max(1e-300);
                gap(*a).total_cmp(&gap(*b))
            })
            .expect("five gaps");
        let steep = |i: usize| values[i] >= sorted[last_steep];
        let left = (0..6)
            .filter(|i| steep(*i))
            .map(|i| along[i].modulus())
            .fold(0.0, f64::max);
        if left < 1e-12 {
            break;
        }
        let parts = Vector6::from_fn(|i, _| {
            if steep(i) {
                along[i] / values[i]
            } else {
                nalgebra::Complex::new(0.0, 0.0)
            }
        });
        let step = svd.v_t.expect("asked for").adjoint() * parts;
        let step =
            std::array::from_fn(|i| Complex::of(step[i].re, step[i].im).scaled(Real::of(size)));
        posture = turned(&posture, &step);
        system = System::at(lengths, target, &posture);
    }
    (posture, system)
}

/// Follows Newton's method; `None` unless every step is far shorter than the one before.
///
/// Gives the posture and how far its joints have moved. `limit_rad` is for the first step. Along a
/// path two steps are enough, as nothing else tells how near another posture is.
fn newton(
    lengths: &Lengths,
    target: &Target,
    posture: &Posture,
    limit_rad: f64,
    to_the_end: bool,
) -> Option<(Posture, [Complex; 6])> {
    let mut bound = limit_rad;
    let mut posture = *posture;
    let mut moved = [Complex::ZERO; 6];
    for round in 0..12 {
        let (at, system) = across(lengths, target, &posture);
        let step = system.step();
        let length = largest(&step);
        if length > bound || length.is_nan() {
            return None;
        }
        posture = turned(&at, &step);
        moved = std::array::from_fn(|i| moved[i] + step[i]);
        let done = if to_the_end {
            length < SETTLED_RAD
        } else {
            round > 0 || length < NO_STEP_RAD
        };
        if done {
            return Some((posture, moved));
        }
        bound = length * CONTRACTION;
    }
    None
}

/// Lengths and pose as numbers: six lengths, position, quaternion (w, x, y, z).
type Numbers = [Real; 13];

fn numbers(geometry: &UrGeometry, pose: &Pose) -> Numbers {
    let (p, q) = (pose.translation.vector, pose.rotation);
    [
        geometry.d1,
        geometry.a2,
        geometry.a3,
        geometry.d4,
        geometry.d5,
        geometry.d6,
        p.x,
        p.y,
        p.z,
        q.w,
        q.i,
        q.j,
        q.k,
    ]
    .map(Real::of)
}

/// Lengths and pose of numbers, the quaternion scaled to one.
fn problem(numbers: &[Complex; 13]) -> (Lengths, Target) {
    let zero = Complex::ZERO;
    let [d1, a2, a3, d4, d5, d6, px, py, pz, w, x, y, z] = *numbers;
    let scale = (w * w + x * x + y * y + z * z).inverse();
    let scale = scale + scale;
    let one = Complex::ONE;
    let term = |a: Complex, b: Complex| scale * a * b;
    let rotation = [
        [
            one - term(y, y) - term(z, z),
            term(x, y) - term(w, z),
            term(x, z) + term(w, y),
        ],
        [
            term(x, y) + term(w, z),
            one - term(x, x) - term(z, z),
            term(y, z) - term(w, x),
        ],
        [
            term(x, z) - term(w, y),
            term(y, z) + term(w, x),
            one - term(x, x) - term(y, y),
        ],
    ];
    (
        Lengths {
            d: [d1, zero, zero, d4, d5, d6],
            a: [zero, a2, a3, zero, zero, zero],
        },
        Target {
            rotation,
            position: [px, py, pz],
        },
    )
}

/// A way from the start's numbers, at `tau` = 1, to the wanted ones, at 0.
struct Path {
    start: Numbers,
    end: Numbers,
    detour: [f64; 13],
}

impl Path {
    fn at(&self, tau: f64) -> (Lengths, Target) {
        let bend = Real::of(tau) * (Real::ONE - Real::of(tau));
        problem(&std::array::from_fn(|i| {
            let straight = self.end[i] + (self.start[i] - self.end[i]) * Real::of(tau);
            Complex {
                re: straight,
                im: bend * Real::of(self.detour[i]),
            }
        }))
    }

    /// Follows one posture to the end of the path; tells whether the end is solved for.
    fn track(&self, posture: &Posture) -> Option<(Posture, bool)> {
        let (end_lengths, end_target) = self.at(0.0);
        let (mut posture, mut tau, mut share, mut try_end_below) = (*posture, 1.0, 0.02, 0.02);
        let mut slope = [Complex::ZERO; 6];
        while tau > PATH_END {
            if tau < try_end_below {
                if let Some((end, _)) = newton(&end_lengths, &end_target, &posture, 0.01, true) {
                    return Some((end, true));
                }
                try_end_below = tau * 0.1;
            }
            // Relative steps: near its end the path may pass close to a singular pose.
            let following = tau * (1.0 - share);
            let along = Real::of(following - tau);
            let predicted = slope.map(|x| x.scaled(along));
            let (lengths, target) = self.at(following);
            let guess = turned(&posture, &predicted);
            let Some((found, moved)) = newton(&lengths, &target, &guess, 0.1, false) else {
                share *= 0.5;
                if share < 1e-7 {
                    return (tau < ENDED).then_some((posture, false));
                }
                continue;
            };
            posture = found;
            let back = Real::ONE / along;
            slope = std::array::from_fn(|i| (predicted[i] + moved[i]).scaled(back));
            tau = following;
            share = f64::min(share * 1.3, 0.6);
        }
        Some((posture, false))
    }
}

/// End of a path.
struct End {
    joints: [f64; 6],
    imaginary: [f64; 6],
    settled: bool,
}

impl End {
    fn of(posture: &Posture, settled: bool) -> Self {
        let angles = posture.map(|(c, s)| Complex::angle(c, s));
        Self {
            joints: angles.map(|angle| angle.0),
            imaginary: angles.map(|angle| angle.1),
            settled,
        }
    }

    fn apart(&self, other: &Self) -> f64 {
        (0..6)
            .map(|i| {
                let imaginary = (self.imaginary[i] - other.imaginary[i]).abs();
                let turn = (self.joints[i] - other.joints[i]).rem_euclid(std::f64::consts::TAU);
                imaginary.max(turn.min(std::f64::consts::TAU - turn))
            })
            .fold(0.0, f64::max)
    }
}

/// A pose of a UR3 with its eight postures, from which paths start.
pub struct Start {
    pub pose: Pose,
    pub postures: [Joints; 8],
}

impl Start {
    /// Every real posture of a pose as its doubles say, exactly; where wrist 3 is free, those
    /// members of the family that the paths ended at are among them or not, by chance.
    pub fn postures_of(
        &self,
        geometry: &UrGeometry,
        pose: &Pose,
        random: &mut SplitMix64,
    ) -> Vec<Joints> {
        let start = numbers(&UrGeometry::UR3, &self.pose);
        let mut end = numbers(geometry, pose);
        let aligned = self.pose.rotation.coords.dot(&pose.rotation.coords) >= 0.0;
        if !aligned {
            end[9..].iter_mut().for_each(|x| *x = -*x);
        }
        for _ in 0..MOST_DETOURS {
            let detour = std::array::from_fn(|i| {
                let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
                // Lengths and positions in m, the quaternion without unit.
                let size = [0.05, 0.3, 0.8][usize::from(i >= 6) + usize::from(i >= 9)];
                sign * size * random.uniform(0.5, 1.5)
            });
            let path = Path { start, end, detour };
            if let Some(ends) = self.ends(&path) {
                return ends
                    .iter()
                    .filter(|end| end.settled && end.imaginary.iter().all(|x| x.abs() < REAL_RAD))
                    .map(|end| Joints::from_column_slice(&end.joints))
                    .collect();
            }
        }
        panic!("no way to {pose} along which the postures stay apart");
    }

    /// The eight ends, or `None` if two paths have ended at the same one.
    fn ends(&self, path: &Path) -> Option<Vec<End>> {
        let (lengths, target) = path.at(1.0);
        let mut ends: Vec<End> = Vec::new();
        for posture in &self.postures {
            let posture = std::array::from_fn(|i| {
                let (sin, cos) = Real::sin_cos(posture[i]);
                (Complex::real(cos), Complex::real(sin))
            });
            let (posture, _) = newton(&lengths, &target, &posture, 1e-6, true)
                .expect("the postures of the start are its");
            let (posture, settled) = path.track(&posture)?;
            let end = End::of(&posture, settled);
            if settled
                && ends
                    .iter()
                    .any(|other| other.settled && other.apart(&end) < JUMPED_RAD)
            {
                return None;
            }
            ends.push(end);
        }
        Some(ends)
    }
}

/// Position error, m, and angle, rad, of a posture, in 106 bits; small angles only.
pub fn miss(geometry: &UrGeometry, pose: &Pose, joints: &Joints) -> (f64, f64) {
    let (lengths, target) = problem(&numbers(geometry, pose).map(Complex::real));
    let posture = std::array::from_fn(|i| {
        let (sin, cos) = Real::sin_cos(joints[i]);
        (Complex::real(cos), Complex::real(sin))
    });
    let at = forward(&lengths, &posture);
    let error = pose_error(&target, &at);
    let norm = |part: &[Complex]| {
        part.iter()
            .fold(Real::ZERO, |sum, x| sum + x.re * x.re)
            .sqrt()
            .value()
    };
    // Half a turn has no sine: the trace tells.
    let trace = (0..3)
        .flat_map(|j| (0..3).map(move |k| (j, k)))
        .fold(0.0, |sum, (j, k)| {
            sum + target.rotation[j][k].re.value() * at.columns[k][j].re.value()
        });
    let angle = norm(&error[3..]);
    (
        norm(&error[..3]),
        if trace > 2.0 {
            angle
        } else {
            std::f64::consts::PI
        },
    )
}
