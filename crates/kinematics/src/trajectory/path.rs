//! Joint positions along a path: quintics between knots, twice continuously differentiable.

use crate::Joints;

/// A place on a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Knot {
    /// Path parameter, from 0 at the start.
    pub s: f64,
    /// Joint positions, rad.
    pub position: Joints,
    /// d q / d s.
    pub first: Joints,
    /// d^2 q / d s^2.
    pub second: Joints,
}

/// Joint positions over a path parameter `s`, `0 <= s <= length`: metres along a straight line of the
/// tool ([`JointPath::line_ending_at`]), seconds at full speed through waypoints
/// ([`JointPath::through`]), seconds through set-points ([`super::JointTrajectory::sampled`]).
#[derive(Debug, Clone, PartialEq)]
pub struct JointPath {
    knots: Vec<Knot>,
}

/// Point of a path with its derivatives by the path parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Joint positions, rad.
    pub position: Joints,
    /// First derivative, rad per unit of the parameter.
    pub first: Joints,
    /// Second derivative.
    pub second: Joints,
    /// Third derivative.
    pub third: Joints,
}

impl JointPath {
    /// From at least two knots in ascending order, the first at 0; not sampled if its length is 0.
    pub(super) fn from_knots(knots: Vec<Knot>) -> Self {
        debug_assert!(knots.len() > 1 && knots.windows(2).all(|pair| pair[0].s <= pair[1].s));
        Self { knots }
    }

    /// Path parameter of the end.
    pub fn length(&self) -> f64 {
        self.knots[self.knots.len() - 1].s
    }

    /// Joint positions at the start, rad.
    pub fn start(&self) -> Joints {
        self.knots[0].position
    }

    /// Joint positions at the end, rad.
    pub fn end(&self) -> Joints {
        self.knots[self.knots.len() - 1].position
    }

    /// The same path with an offset added to the joints, rad: full revolutions give a 2π equivalent.
    pub fn shifted(&self, shift: &Joints) -> Self {
        let mut path = self.clone();
        for knot in &mut path.knots {
            knot.position += shift;
        }
        path
    }

    /// The same path backwards.
    pub fn reversed(&self) -> Self {
        let length = self.length();
        let knots = self.knots.iter().rev().map(|knot| Knot {
            s: length - knot.s,
            first: -knot.first,
            ..*knot
        });
        Self {
            knots: knots.collect(),
        }
    }

    /// Point at a parameter: quintic Hermite interpolation. The ends outside.
    pub fn sample(&self, s: f64) -> PathPoint {
        let index = self.interval_at(s);
        let (start, end) = self.interval(index);
        let h = end - start;
        let u = ((s - start) / h).clamp(0.0, 1.0);
        let [c0, c1, c2, c3, c4, c5] = self.coefficients(index);
        PathPoint {
            position: c0 + (c1 + (c2 + (c3 + (c4 + c5 * u) * u) * u) * u) * u,
            first: (c1 + (c2 * 2.0 + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * u)) * u) * u) * u) / h,
            second: (c2 * 2.0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * u)) * u) * u) / (h * h),
            third: (c3 * 6.0 + (c4 * 24.0 + c5 * (60.0 * u)) * u) / (h * h * h),
        }
    }

    /// Index of the interval that a parameter is in; the first or last one outside.
    pub(super) fn interval_at(&self, s: f64) -> usize {
        let next = self.knots.partition_point(|knot| knot.s <= s);
        next.clamp(1, self.intervals()) - 1
    }

    /// Number of intervals between knots.
    pub(super) fn intervals(&self) -> usize {
        self.knots.len() - 1
    }

    /// Parameters of both ends of an interval.
    pub(super) fn interval(&self, index: usize) -> (f64, f64) {
        (self.knots[index].s, self.knots[index + 1].s)
    }

    /// Coefficients of the quintic between knots `index` and `index + 1`, by rising powers of
    /// `u`, which runs from 0 to 1 between them.
    pub(super) fn coefficients(&self, index: usize) -> [Joints; 6] {
        let (a, b) = (&self.knots[index], &self.knots[index + 1]);
        let h = b.s - a.s;
        // The knots' values, first and second derivatives (by u).
        let (v0, v1) = (a.first * h, b.first * h);
        let (w0, w1) = (a.second * (h * h), b.second * (h * h));
        let d = b.position - a.position;
        [
            a.position,
            v0,
            w0 * 0.5,
            d * 10.0 - v0 * 6.0 - v1 * 4.0 - w0 * 1.5 + w1 * 0.5,
            d * -15.0 + v0 * 8.0 + v1 * 7.0 + w0 * 1.5 - w1,
            d * 6.0 - v0 * 3.0 - v1 * 3.0 - w0 * 0.5 + w1 * 0.5,
        ]
    }
}
