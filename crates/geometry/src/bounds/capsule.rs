//! Capsules around shapes: cheap lower bounds of a distance.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::placement::Placement;

/// All points within `radius_m` of a segment, and a ball around the same shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundingCapsule {
    /// Metres, like the rest. Middle of the segment, which is also the ball's centre.
    pub centre: Vector3<f64>,
    /// From the middle to one end.
    pub half_axis: Vector3<f64>,
    /// Around the segment.
    pub radius_m: f64,
    /// Of a ball about the centre that holds the shape too.
    pub ball_radius_m: f64,
}

impl BoundingCapsule {
    /// A segment on z with a radius around it.
    pub fn on_z(half_length_m: f64, radius_m: f64) -> Self {
        Self {
            centre: Vector3::zeros(),
            half_axis: Vector3::new(0.0, 0.0, half_length_m),
            radius_m,
            ball_radius_m: half_length_m + radius_m,
        }
    }

    /// Around a cylinder about z.
    pub(crate) fn around_cylinder(radius_m: f64, half_length_m: f64) -> Self {
        let ball_radius_m = libm::hypot(radius_m, half_length_m);
        if radius_m > half_length_m {
            return Self {
                radius_m: ball_radius_m,
                ..Self::on_z(0.0, ball_radius_m)
            };
        }
        Self {
            ball_radius_m,
            ..Self::on_z(half_length_m, radius_m)
        }
    }

    /// Around a box along the axes.
    pub(crate) fn around_cuboid(half_extents_m: &Vector3<f64>) -> Self {
        let long = half_extents_m.imax();
        let mut half_axis = Vector3::zeros();
        half_axis[long] = half_extents_m[long];
        Self {
            centre: Vector3::zeros(),
            half_axis,
            radius_m: (half_extents_m - half_axis).norm(),
            ball_radius_m: half_extents_m.norm(),
        }
    }

    /// Along the direction in which the points spread most, as short as its radius allows.
    pub fn around_points<'p>(points: impl Iterator<Item = &'p Vector3<f64>> + Clone) -> Self {
        let count = points.clone().count() as f64;
        let mean = points.clone().sum::<Vector3<f64>>() / count;
        let covariance = points.clone().fold(Matrix3::zeros(), |sum, point| {
            sum + (point - mean) * (point - mean).transpose()
        });
        let eigen = covariance.symmetric_eigen();
        let axis: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
        let extents = |direction: &Vector3<f64>| {
            points
                .clone()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), point| {
                    let t = direction.dot(point);
                    (lo.min(t), hi.max(t))
                })
        };
        // The middle of the points' box along the axis and across it.
        let basis = eigen.eigenvectors;
        let centre = (0..3).fold(Vector3::zeros(), |sum, i| {
            let direction: Vector3<f64> = basis.column(i).into();
            let (lo, hi) = extents(&direction);
            sum + direction * (0.5 * (lo + hi))
        });
        let split = |point: &Vector3<f64>| {
            let offset = point - centre;
            let along = axis.dot(&offset);
            (along, (offset - axis * along).norm())
        };
        let radius_m = points.clone().map(|p| split(p).1).fold(0.0, f64::max);
        let half_length_m = points
            .clone()
            .map(|p| {
                let (along, across) = split(p);
                // The rounded end reaches this much further at that distance from the axis.
                along.abs() - (radius_m * radius_m - across * across).max(0.0).sqrt()
            })
            .fold(0.0, f64::max);
        let ball_radius_m = points.map(|p| (p - centre).norm()).fold(0.0, f64::max);
        Self {
            centre,
            half_axis: axis * half_length_m,
            radius_m,
            ball_radius_m,
        }
    }

    /// A ball around the balls of others, about the middle of their common box.
    pub fn around_balls<'c>(others: impl Iterator<Item = &'c Self> + Clone) -> Self {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = Vector3::repeat(f64::NEG_INFINITY);
        for other in others.clone() {
            low = low.inf(&other.centre.add_scalar(-other.ball_radius_m));
            high = high.sup(&other.centre.add_scalar(other.ball_radius_m));
        }
        let centre = (low + high) * 0.5;
        let ball_radius_m = others
            .map(|other| (other.centre - centre).norm() + other.ball_radius_m)
            .fold(0.0, f64::max);
        Self {
            centre,
            half_axis: Vector3::zeros(),
            radius_m: ball_radius_m,
            ball_radius_m,
        }
    }

    /// Seen from the parent of the frame that it is given in.
    #[inline]
    pub fn placed(&self, placement: &Placement) -> Self {
        Self {
            centre: placement.point(&self.centre),
            half_axis: placement.rotation * self.half_axis,
            ..*self
        }
    }

    /// Whether the balls alone show the enclosed shapes to be `limit_m` apart or more.
    #[inline]
    pub fn balls_part(&self, other: &Self, limit_m: f64) -> bool {
        let reach_m = limit_m + self.ball_radius_m + other.ball_radius_m;
        reach_m < 0.0 || (self.centre - other.centre).norm_squared() >= reach_m * reach_m
    }

    /// Lower bound of the signed distance of the enclosed shapes by the capsules.
    ///
    /// Holds in penetration too: what separates the larger shapes separates the smaller.
    #[inline]
    pub fn gap_m(&self, other: &Self) -> f64 {
        self.towards(other).norm() - self.radius_m - other.radius_m
    }

    /// The same of a point.
    pub fn gap_to_point_m(&self, point: &Point3<f64>) -> f64 {
        let between = point.coords - self.centre;
        let squared = self.half_axis.norm_squared();
        let along = if squared > 0.0 {
            (between.dot(&self.half_axis) / squared).clamp(-1.0, 1.0)
        } else {
            0.0
        };
        (between - self.half_axis * along).norm() - self.radius_m
    }

    /// From the axis of one to the axis of the other by the shortest way.
    #[inline]
    pub fn towards(&self, other: &Self) -> Vector3<f64> {
        let between = self.centre - other.centre;
        let (s, t) = closest_on_segments(&between, &self.half_axis, &other.half_axis);
        other.half_axis * t - self.half_axis * s - between
    }
}

/// Squared sine below which segments count as parallel: over a metre the two lines then part by
/// no more than 1e-12 m.
const PARALLEL_SINE_SQUARED: f64 = 1e-24;

/// Parameters in [-1, 1] of the closest points `c1 + s h1` and `c2 + t h2` of two segments,
/// `between = c1 - c2`.
///
/// Ericson, *Real-Time Collision Detection*, section 5.1.9, centred.
#[inline]
pub(crate) fn closest_on_segments(
    between: &Vector3<f64>,
    h1: &Vector3<f64>,
    h2: &Vector3<f64>,
) -> (f64, f64) {
    let a = h1.norm_squared();
    let e = h2.norm_squared();
    let b = h1.dot(h2);
    let c = h1.dot(between);
    let f = h2.dot(between);
    let on_second = |s: f64| {
        if e > 0.0 {
            ((b * s + f) / e).clamp(-1.0, 1.0)
        } else {
            0.0
        }
    };
    if a <= 0.0 {
        return (0.0, on_second(0.0));
    }
    let on_first = |t: f64| ((b * t - c) / a).clamp(-1.0, 1.0);
    // By the cross product, because `a e - b^2` is mere rounding for nearly parallel segments.
    let across = h1.cross(h2);
    let sine_squared = across.norm_squared();
    let s = if sine_squared > PARALLEL_SINE_SQUARED * a * e {
        (-between.cross(h2).dot(&across) / sine_squared).clamp(-1.0, 1.0)
    } else {
        // Parallel: every overlapping place is as close, and the ends are found from any.
        0.0
    };
    let t = on_second(s);
    (on_first(t), t)
}
