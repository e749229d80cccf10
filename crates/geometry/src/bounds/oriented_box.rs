//! Boxes along axes of their own.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::placement::Placement;

/// By how much a ray may miss a box by rounding and still count, relative and in m.
const RAY_SLACK: f64 = 1e-9;

/// A box along axes of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrientedBox {
    /// Middle, m.
    pub centre: Vector3<f64>,
    /// From the centre to the middles of three faces, at right angles.
    half: [Vector3<f64>; 3],
    /// `1 / |half|^2`, or zero.
    inverse_squared: [f64; 3],
}

impl OrientedBox {
    /// About the origin along the axes.
    pub fn upright(half_extents_m: &Vector3<f64>) -> Self {
        let half = [0, 1, 2].map(|i| Vector3::ith(i, half_extents_m[i]));
        Self::from_half(Vector3::zeros(), half)
    }

    /// Around points, with its longest half axis.
    ///
    /// Along the principal axes of the points, or upright where that box has less surface.
    pub fn around<'p>(
        points: &(impl Iterator<Item = &'p Vector3<f64>> + Clone),
    ) -> (Self, Vector3<f64>) {
        let vertices = || points.clone();
        let count = vertices().count() as f64;
        let mean = vertices().sum::<Vector3<f64>>() / count;
        let covariance = vertices().fold(Matrix3::zeros(), |sum, vertex| {
            let offset = vertex - mean;
            sum + offset * offset.transpose()
        });
        let eigen = covariance.symmetric_eigen();
        let turned: [Vector3<f64>; 3] = [0, 1, 2].map(|i| eigen.eigenvectors.column(i).into());
        let upright = [Vector3::x(), Vector3::y(), Vector3::z()];
        // Corners that spread alike have principal axes by chance; then those of the mesh may fit
        // better, as for a box.
        let [one, other] = [turned, upright].map(|axes| {
            let mut centre = Vector3::zeros();
            let mut half = [Vector3::zeros(); 3];
            for (axis, half) in axes.iter().zip(&mut half) {
                let (low, high) =
                    vertices().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
                        let t = axis.dot(v);
                        (lo.min(t), hi.max(t))
                    });
                centre += axis * (0.5 * (low + high));
                *half = axis * (0.5 * (high - low));
            }
            (centre, half)
        });
        let area = |half: &[Vector3<f64>; 3]| {
            let [a, b, c] = half.each_ref().map(Vector3::norm);
            a * b + b * c + c * a
        };
        let (centre, half) = if area(&other.1) < area(&one.1) {
            other
        } else {
            one
        };
        let squared = half.map(|half| half.norm_squared());
        let longest = (0..3).fold(
            0,
            |best, i| if squared[i] > squared[best] { i } else { best },
        );
        (Self::from_half(centre, half), half[longest])
    }

    fn from_half(centre: Vector3<f64>, half: [Vector3<f64>; 3]) -> Self {
        let inverse_squared = half.map(|half| {
            let squared = half.norm_squared();
            if squared > 0.0 { squared.recip() } else { 0.0 }
        });
        Self {
            centre,
            half,
            inverse_squared,
        }
    }

    /// Seen from the parent of the frame that the box is given in.
    #[inline]
    pub fn placed(&self, placement: &Placement) -> Self {
        Self {
            centre: placement.point(&self.centre),
            half: self.half.map(|half| placement.rotation * half),
            ..*self
        }
    }

    /// Its eight corners.
    pub fn corners(&self) -> [Vector3<f64>; 8] {
        std::array::from_fn(|i| {
            (0..3).fold(self.centre, |corner, axis| {
                let sign = if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
                corner + self.half[axis] * sign
            })
        })
    }

    /// Half of the diagonal, m.
    #[inline]
    pub fn radius_m(&self) -> f64 {
        self.half
            .iter()
            .map(Vector3::norm_squared)
            .sum::<f64>()
            .sqrt()
    }

    /// Largest `direction . x` over the box.
    #[inline]
    pub fn high(&self, direction: &Vector3<f64>) -> f64 {
        direction.dot(&self.centre) + self.reach(direction)
    }

    /// Least `direction . x` over the box.
    #[inline]
    pub fn low(&self, direction: &Vector3<f64>) -> f64 {
        direction.dot(&self.centre) - self.reach(direction)
    }

    #[inline]
    fn reach(&self, direction: &Vector3<f64>) -> f64 {
        direction.dot(&self.half[0]).abs()
            + direction.dot(&self.half[1]).abs()
            + direction.dot(&self.half[2]).abs()
    }

    /// Point of the box nearest to `point`.
    #[inline]
    pub fn nearest(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let offset = point - self.centre;
        (0..3).fold(self.centre, |nearest, i| {
            let along = offset.dot(&self.half[i]) * self.inverse_squared[i];
            nearest + self.half[i] * along.clamp(-1.0, 1.0)
        })
    }

    /// Where a line enters the box within a range of its parameter, or `None` if it misses it there.
    #[inline]
    pub(crate) fn enters(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        [from, until]: [f64; 2],
    ) -> Option<f64> {
        let offset = origin - self.centre;
        let (mut enter, mut leave) = (from, until);
        for half in &self.half {
            let squared = half.norm_squared() * (1.0 + RAY_SLACK) + RAY_SLACK * RAY_SLACK;
            let (at, rate) = (offset.dot(half), direction.dot(half));
            if rate == 0.0 {
                if at.abs() > squared {
                    return None;
                }
                continue;
            }
            let (one, other) = ((-squared - at) / rate, (squared - at) / rate);
            enter = enter.max(one.min(other));
            leave = leave.min(one.max(other));
        }
        (enter <= leave + RAY_SLACK * (1.0 + leave.abs())).then_some(enter)
    }
}
