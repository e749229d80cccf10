//! Sets of postures on which inverse kinematics is tested, measured and compared.
//!
//! Generic postures, and those on which solvers fail: the three singularities of a UR arm, their
//! combinations, and joints at multiples of 90 degrees; each exact or a small distance away.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::{Joints, Pose, UrGeometry};
use needlebench_numerics::random::SplitMix64;

/// A set of postures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PoseSet {
    /// Every joint uniform in `(-pi, pi)`.
    Generic,
    /// `q5` is 0 or pi: wrist 3 is free.
    Wrist,
    /// `q3` is 0 or pi: elbow up and elbow down meet.
    Elbow,
    /// `rho = d4`: the wrist centre lies at its least distance from the shoulder axis, where right
    /// and left shoulder meet.
    Shoulder,
    /// [`PoseSet::Wrist`] and [`PoseSet::Elbow`].
    WristElbow,
    /// [`PoseSet::Wrist`] and [`PoseSet::Shoulder`].
    WristShoulder,
    /// [`PoseSet::Elbow`] and [`PoseSet::Shoulder`].
    ElbowShoulder,
    /// All three.
    WristElbowShoulder,
    /// Every joint a multiple of 90 degrees.
    QuarterTurns,
}

impl PoseSet {
    /// All sets, the generic one first.
    pub const ALL: [Self; 9] = [
        Self::Generic,
        Self::Wrist,
        Self::Elbow,
        Self::Shoulder,
        Self::WristElbow,
        Self::WristShoulder,
        Self::ElbowShoulder,
        Self::WristElbowShoulder,
        Self::QuarterTurns,
    ];

    /// What reports call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Generic => "generic",
            Self::Wrist => "wrist (q5 = 0, pi)",
            Self::Elbow => "elbow (q3 = 0, pi)",
            Self::Shoulder => "shoulder (rho = d4)",
            Self::WristElbow => "wrist and elbow",
            Self::WristShoulder => "wrist and shoulder",
            Self::ElbowShoulder => "elbow and shoulder",
            Self::WristElbowShoulder => "wrist, elbow and shoulder",
            Self::QuarterTurns => "multiples of 90 degrees",
        }
    }

    /// One posture of the set, every joint then moved by up to `away_rad` either way.
    ///
    /// Exactly singular for `away_rad = 0`, within the rounding of the joints.
    pub fn sample(self, geometry: &UrGeometry, random: &mut SplitMix64, away_rad: f64) -> Joints {
        let exact = match self {
            Self::Generic => uniform(random),
            Self::QuarterTurns => {
                Joints::from_fn(|_, _| f64::from(random.below(4)) * FRAC_PI_2 - FRAC_PI_2)
            }
            _ => self.singular(geometry, random),
        };
        exact.map(|joint| joint + away_rad * random.uniform(-1.0, 1.0))
    }

    fn singular(self, geometry: &UrGeometry, random: &mut SplitMix64) -> Joints {
        let zero_or_pi = |random: &mut SplitMix64| f64::from(random.below(2)) * PI;
        loop {
            let mut q = uniform(random);
            if matches!(
                self,
                Self::Wrist | Self::WristElbow | Self::WristShoulder | Self::WristElbowShoulder
            ) {
                q[4] = zero_or_pi(random);
            }
            if matches!(
                self,
                Self::Elbow | Self::WristElbow | Self::ElbowShoulder | Self::WristElbowShoulder
            ) {
                q[2] = zero_or_pi(random);
            }
            if matches!(
                self,
                Self::Shoulder
                    | Self::WristShoulder
                    | Self::ElbowShoulder
                    | Self::WristElbowShoulder
            ) {
                // Wrist 4 places the wrist centre on the plane through the shoulder axis:
                // a2 c2 + a3 c23 + d5 s234 = 0.
                let forward = geometry.a2 * libm::cos(q[1]) + geometry.a3 * libm::cos(q[1] + q[2]);
                let s234 = -forward / geometry.d5;
                if s234.abs() > 1.0 {
                    continue;
                }
                let c234 = (1.0 - s234 * s234).sqrt();
                let c234 = if random.below(2) == 0 { c234 } else { -c234 };
                q[3] = libm::atan2(s234, c234) - q[1] - q[2];
            }
            return q;
        }
    }
}

fn uniform(random: &mut SplitMix64) -> Joints {
    Joints::from_fn(|_, _| random.uniform(-PI, PI))
}

/// The pose with position and orientation rounded to single precision, as files and message types
/// of 32-bit floats deliver it. The quaternion is normalised again.
pub fn rounded_to_f32(pose: &Pose) -> Pose {
    #[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
    let round = |value: f64| f64::from(value as f32);
    let q = pose.rotation;
    Pose::from_parts(
        pose.translation.vector.map(round).into(),
        nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
            round(q.w),
            round(q.i),
            round(q.j),
            round(q.k),
        )),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of the three products in the shoulder's condition.
    const FORWARD_M: f64 = 1e-15;

    #[test]
    fn sets_are_where_they_say() {
        let ur3 = UrGeometry::UR3;
        let mut random = SplitMix64::new(1);
        for _ in 0..1000 {
            let q = PoseSet::WristElbowShoulder.sample(&ur3, &mut random, 0.0);
            assert!(ur3.wrist_forward_m(&q).abs() < FORWARD_M);
            assert!(libm::sin(q[2]).abs() < 1e-15 && libm::sin(q[4]).abs() < 1e-15);
            let near = PoseSet::Wrist.sample(&ur3, &mut random, 1e-6);
            assert!(libm::sin(near[4]).abs() <= 1e-6 && libm::sin(near[4]) != 0.0);
        }
    }
}
