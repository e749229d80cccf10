//! A deterministic source of variety.

pub mod solids;

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::Vector3;
use needlebench_geometry::sample_solids::ellipsoid;
use needlebench_geometry::{ConvexMesh, Shape};
use needlebench_kinematics::Pose;
use needlebench_numerics::random::SplitMix64;

/// Numbers that look random and are the same every time.
pub struct Variety(SplitMix64);

impl Variety {
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.uniform(low, high)
    }

    pub fn vector(&mut self, reach: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-reach, reach))
    }

    pub fn pose(&mut self, reach_m: f64) -> Pose {
        Pose::new(self.vector(reach_m), self.vector(PI))
    }

    /// One shape of each kind.
    pub fn shapes(&mut self) -> [Shape; 5] {
        let mut size_m = || self.between(0.01, 0.15);
        [
            Shape::Sphere { radius_m: size_m() },
            Shape::Cylinder {
                radius_m: size_m(),
                half_length_m: size_m(),
            },
            Shape::Capsule {
                radius_m: size_m(),
                half_length_m: size_m(),
            },
            Shape::Cuboid {
                half_extents_m: Vector3::new(size_m(), size_m(), size_m()),
            },
            Shape::Convex(Arc::new(ConvexMesh(ellipsoid(
                6,
                9,
                Vector3::new(size_m(), size_m(), size_m()),
            )))),
        ]
    }
}
