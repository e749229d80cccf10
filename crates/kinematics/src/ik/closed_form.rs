//! Closed form for a nominal UR arm: all eight configurations of a flange pose.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::{Configuration, Elbow, Shoulder, Wrist, wrap_angle};
use crate::{Joints, Pose, UrGeometry};

/// `|sin q5|` below which wrist 3 counts as free: its axis is parallel to wrist 1's within the
/// rounding of the pose.
const FREE_WRIST_SINE: f64 = 1e-12;

/// Rounding of a squared length over the arm's reach, relative: below it a root is zero.
const SQUARED_LENGTH_ROUNDING: f64 = 1e-14;

/// One solution of the closed form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosedFormSolution {
    /// Which of the eight it is.
    pub configuration: Configuration,
    /// Joint positions, rad, each in `(-pi, pi]`.
    pub joints: Joints,
    /// Wrist 3 may take any value near this one: at `q5 = 0` or `pi` only `q6` plus or minus
    /// `q2 + q3 + q4` is determined, and this is one member of a family.
    pub wrist_3_is_free: bool,
    /// A root was zero: the configuration with the other sign is the same one and is left out.
    pub merged: bool,
}

/// Why a configuration does not exist at a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unreachable {
    /// The wrist centre is nearer to the shoulder axis than `d4`.
    WristTooNear {
        /// By how much, m.
        missing_m: f64,
    },
    /// Wrist 1 is farther from the shoulder than upper arm and forearm reach.
    ElbowTooShort {
        /// By how much, m.
        missing_m: f64,
    },
    /// Wrist 1 is nearer to the shoulder than the difference of upper arm and forearm.
    ElbowTooLong {
        /// By how much, m.
        missing_m: f64,
    },
}

impl Unreachable {
    /// Distance by which the pose misses, m.
    pub fn missing_m(self) -> f64 {
        match self {
            Self::WristTooNear { missing_m }
            | Self::ElbowTooShort { missing_m }
            | Self::ElbowTooLong { missing_m } => missing_m,
        }
    }
}

/// What an answer of the closed form is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Certificate {
    /// Every branch was decided in double precision, beyond the error bounds: no branch is missing
    /// and none is too many.
    Complete,
    /// As [`Certificate::Complete`], but a sign needed extended precision.
    DecidedInExtendedPrecision,
    /// Two or more configurations are one posture within the rounding of the pose.
    MergedBranches,
    /// Wrist 3 is free: a row stands for a family.
    FreeJoint,
    /// No configuration reaches the pose.
    NearestOnly,
}

/// All configurations of one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedForm {
    /// By the index of a configuration in [`Configuration::ALL`].
    solutions: [Option<ClosedFormSolution>; 8],
    unreachable: [Option<Unreachable>; 8],
    certificate: Certificate,
}

impl ClosedForm {
    /// What the answer is worth.
    pub fn certificate(&self) -> Certificate {
        self.certificate
    }

    /// Configurations that exist, in the order of [`Configuration::ALL`].
    pub fn solutions(&self) -> impl Iterator<Item = ClosedFormSolution> {
        self.solutions.iter().flatten().copied()
    }

    /// One configuration, if it exists and is not the same posture as an earlier one.
    pub fn solution(&self, configuration: Configuration) -> Option<ClosedFormSolution> {
        self.solutions[configuration.index()]
    }

    /// Configurations that do not reach the pose, and why, in the order of [`Configuration::ALL`].
    pub fn unreachable(&self) -> impl Iterator<Item = (Configuration, Unreachable)> {
        Configuration::ALL
            .into_iter()
            .zip(self.unreachable)
            .filter_map(|(configuration, reason)| Some((configuration, reason?)))
    }
}

/// Solves `base_from_flange(q) = pose` for a nominal arm; `pose` is in the controller's base frame.
///
/// Equations 9 to 38 with equation 11's sign, equation 24's sign of `r1` and equation 36's indices
/// corrected. Where wrist 3 is free, the member nearest to `seed` (or to zero) is taken that keeps
/// the elbow reachable. Residual on 1e5 random poses: below 1e-14 m and rad away from
/// singularities (`every_solution_reproduces_the_pose`).
pub fn closed_form(geometry: &UrGeometry, pose: &Pose, seed: Option<&Joints>) -> ClosedForm {
    let mut found = ClosedForm {
        solutions: [None; 8],
        unreachable: [None; 8],
        certificate: Certificate::Complete,
    };
    let rotation = pose.rotation.to_rotation_matrix().into_inner();
    let position = pose.translation.vector;
    // Wrist 2's centre, from which wrist 3's axis leads to the flange.
    let centre = position - rotation.column(2) * geometry.d6;
    let rho_squared = centre.x.powi(2) + centre.y.powi(2);
    let root_squared = rho_squared - geometry.d4.powi(2);
    let rounding = SQUARED_LENGTH_ROUNDING * (rho_squared + geometry.d4.powi(2));
    if root_squared < -rounding {
        let missing_m = geometry.d4.abs() - rho_squared.sqrt();
        let reason = Unreachable::WristTooNear { missing_m };
        found.unreachable = [Some(reason); 8];
        found.certificate = Certificate::NearestOnly;
        return found;
    }
    let shoulders_merge = root_squared <= rounding;
    let root = root_squared.max(0.0).sqrt();
    let shoulders: &[Shoulder] = if shoulders_merge {
        &[Shoulder::Right]
    } else {
        &[Shoulder::Right, Shoulder::Left]
    };
    for &shoulder in shoulders {
        let q1 = geometry.d4.atan2(shoulder.sign() * root) + centre.y.atan2(centre.x); // eq 9
        let frame = ShoulderFrame {
            shoulder,
            q1: wrap_angle(q1),
            merged: shoulders_merge,
        };
        frame.solve(geometry, &rotation, &centre, seed, &mut found);
    }
    if found.solutions().any(|solution| solution.wrist_3_is_free) {
        found.certificate = Certificate::FreeJoint;
    } else if found.solutions().any(|solution| solution.merged) {
        found.certificate = Certificate::MergedBranches;
    } else if found.solutions().next().is_none() {
        found.certificate = Certificate::NearestOnly;
    }
    found
}

struct ShoulderFrame {
    shoulder: Shoulder,
    q1: f64,
    merged: bool,
}

impl ShoulderFrame {
    fn solve(
        &self,
        geometry: &UrGeometry,
        rotation: &Matrix3<f64>,
        centre: &Vector3<f64>,
        seed: Option<&Joints>,
        found: &mut ClosedForm,
    ) {
        let (s1, c1) = self.q1.sin_cos();
        // The axis of joints 2, 3 and 4, and the arm plane's forward direction.
        let axis = Vector3::new(s1, -c1, 0.0);
        let forward = Vector3::new(c1, s1, 0.0);
        let (n, o, a) = (rotation.column(0), rotation.column(1), rotation.column(2));
        let (n1, o1, c5) = (n.dot(&axis), o.dot(&axis), a.dot(&axis));
        let s5_magnitude = n1.hypot(o1);
        let free = s5_magnitude < FREE_WRIST_SINE;
        let wrists: &[Wrist] = if free {
            &[Wrist::Fold]
        } else {
            &[Wrist::Fold, Wrist::Unfold]
        };
        for &wrist in wrists {
            let sign = wrist.sign(self.shoulder);
            let in_plane = |v: Vector3<f64>| (v.dot(&forward), v.z);
            let (q5, q6) = if free {
                let q5 = if c5 > 0.0 { 0.0 } else { PI };
                let q6 = free_wrist_3(
                    geometry,
                    in_plane(*centre - Vector3::z() * geometry.d1),
                    in_plane(o.into_owned()),
                    in_plane(n.into_owned()),
                    seed.map_or(0.0, |q| q[5]),
                );
                (q5, q6)
            } else {
                (
                    (sign * s5_magnitude).atan2(c5),
                    (-o1 * sign).atan2(n1 * sign),
                ) // eq 10, 11
            };
            let (s5, c5) = q5.sin_cos();
            let (s6, c6) = q6.sin_cos();
            let q234 = (n.z * c5 * c6 - a.z * s5 - o.z * c5 * s6).atan2(o.z * c6 + n.z * s6); // eq 19
            let wrist_1 = centre + (o * c6 + n * s6) * geometry.d5; // eq 20-22
            let (r1, r2) = in_plane(wrist_1 - Vector3::z() * geometry.d1); // eq 24 signed, 25
            self.elbows(geometry, wrist, (r1, r2), [q234, q5, q6], free, found);
        }
        if free {
            // Both signs of zero are the same wrist: `Unfold` would repeat `Fold`.
            for solution in found.solutions.iter_mut().flatten() {
                if solution.wrist_3_is_free {
                    solution.merged = true;
                }
            }
        }
    }

    fn elbows(
        &self,
        geometry: &UrGeometry,
        wrist: Wrist,
        (r1, r2): (f64, f64),
        [q234, q5, q6]: [f64; 3],
        free: bool,
        found: &mut ClosedForm,
    ) {
        let (a2, a3) = (geometry.a2, geometry.a3);
        let reach_squared = r1.powi(2) + r2.powi(2);
        // 1 - cos q3 and 1 + cos q3 without cancellation at the stretched and the folded elbow.
        let one_minus = ((a2 + a3).powi(2) - reach_squared) / (2.0 * a2 * a3);
        let one_plus = (reach_squared - (a2 - a3).powi(2)) / (2.0 * a2 * a3);
        let rounding =
            SQUARED_LENGTH_ROUNDING * (reach_squared + (a2 + a3).powi(2)) / (2.0 * a2 * a3);
        let configuration = |elbow| Configuration {
            shoulder: self.shoulder,
            elbow,
            wrist,
        };
        let unreachable = if one_minus < -rounding {
            let missing_m = reach_squared.sqrt() - (a2 + a3).abs();
            Some(Unreachable::ElbowTooShort { missing_m })
        } else if one_plus < -rounding {
            let missing_m = (a2 - a3).abs() - reach_squared.sqrt();
            Some(Unreachable::ElbowTooLong { missing_m })
        } else {
            None
        };
        if let Some(reason) = unreachable {
            for elbow in [Elbow::Down, Elbow::Up] {
                found.unreachable[configuration(elbow).index()] = Some(reason);
            }
            return;
        }
        let elbows_merge = one_minus <= rounding || one_plus <= rounding;
        let elbows: &[Elbow] = if elbows_merge {
            &[Elbow::Down]
        } else {
            &[Elbow::Down, Elbow::Up]
        };
        let c3 = 0.5 * (one_plus - one_minus); // eq 31
        let s3_magnitude = (one_minus * one_plus).max(0.0).sqrt();
        for &elbow in elbows {
            let s3 = elbow.sign(self.shoulder) * s3_magnitude; // eq 32
            let q3 = s3.atan2(c3); // eq 33
            let q2 = r2.atan2(r1) - (a3 * s3).atan2(a2 + a3 * c3); // eq 34-36
            let q4 = q234 - q2 - q3; // eq 38
            found.solutions[configuration(elbow).index()] = Some(ClosedFormSolution {
                configuration: configuration(elbow),
                joints: Joints::from_column_slice(&[self.q1, q2, q3, q4, q5, q6].map(wrap_angle)),
                wrist_3_is_free: free,
                merged: self.merged || elbows_merge,
            });
        }
    }
}

/// Nearest `q6` to `wanted` that leaves the elbow reachable, where wrist 3 is free.
///
/// `centre`, `o` and `n` are (forward, up) components in the arm's plane. Wrist 1's centre then
/// runs on a circle of radius `d5` about `centre`, so its distance from the shoulder is a cosine
/// of the angle `phi` between the two, and the reachable `phi` form a symmetric pair of intervals.
fn free_wrist_3(
    geometry: &UrGeometry,
    centre: (f64, f64),
    o: (f64, f64),
    n: (f64, f64),
    wanted: f64,
) -> f64 {
    /// Share of the reachable interval kept clear at each end, where the elbow is singular.
    const MARGIN: f64 = 0.01;
    let distance = centre.0.hypot(centre.1);
    let d5 = geometry.d5.abs();
    if distance * d5 < 1e-12 {
        return wanted;
    }
    let reach = |length: f64| {
        ((length.powi(2) - distance.powi(2) - d5.powi(2)) / (2.0 * distance * d5)).clamp(-1.0, 1.0)
    };
    let (near, far) = (
        reach((geometry.a2 - geometry.a3).abs()),
        reach((geometry.a2 + geometry.a3).abs()),
    );
    let angle_of = |cosine: f64| (1.0 - cosine * cosine).max(0.0).sqrt().atan2(cosine);
    let (mut least, mut most) = (angle_of(far), angle_of(near));
    let slack = MARGIN * (most - least);
    // At 0 and pi the interval does not end at a singular elbow but meets its mirror image.
    if least > 0.0 {
        least += slack;
    }
    if most < PI {
        most -= slack;
    }
    let centre_angle = centre.1.atan2(centre.0);
    // Direction of `o cos q6 + n sin q6`: starts at `o` and turns towards `n`.
    let start = o.1.atan2(o.0);
    let turn = (o.0 * n.1 - o.1 * n.0).signum();
    let offset = if geometry.d5 < 0.0 { PI } else { 0.0 };
    let phi = wrap_angle(start + turn * wanted + offset - centre_angle);
    let reachable = phi.abs().clamp(least, most).copysign(phi);
    wrap_angle(wanted + turn * (reachable - phi))
}
