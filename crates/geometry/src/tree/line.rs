//! Where a line crosses triangles: the one test that rays, clipped lines and inside tests share.

use nalgebra::Vector3;

/// A line, sheared so that it runs along one axis.
///
/// Woop, Benthin and Wald, *Watertight ray/triangle intersection*, 2013. Seen along the line, an
/// edge has it on its left or on its right; both triangles of the edge compute the same number for
/// that, to the bit and but for the sign, so that no line slips through between them or crosses
/// both. Where the number is zero, the line meets the edge or a corner exactly: then it is moved
/// aside by a length that is smaller than any number, the same for all triangles (Edelsbrunner and
/// Muecke, *Simulation of simplicity*, 1990). The crossings of a closed surface therefore always
/// come in pairs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    pub origin: Vector3<f64>,
    pub direction: Vector3<f64>,
    /// The axis that the line runs along most, after two across it; the three are right-handed
    /// about the line's direction.
    axes: [usize; 3],
    /// Of the two coordinates across by the one along.
    shear: [f64; 2],
    /// Parameter of the line by the coordinate along.
    per_m: f64,
}

/// A place at which a line crosses a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    /// Parameter of the line: 0 at its origin and 1 at the end of its direction.
    pub at: f64,
    /// Whether it passes from the triangle's inner to its outer side.
    pub leaves: bool,
}

impl Crossing {
    /// What it adds to the winding number of the line's origin.
    pub(crate) fn turns_ahead(&self) -> i32 {
        match (self.at > 0.0, self.leaves) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => -1,
        }
    }
}

impl Line {
    /// None if the direction is zero or not finite.
    pub fn new(origin: Vector3<f64>, direction: Vector3<f64>) -> Option<Self> {
        let along = direction.iamax();
        let (mut first, mut second) = ((along + 1) % 3, (along + 2) % 3);
        if direction[along] < 0.0 {
            (first, second) = (second, first);
        }
        let per_m = direction[along].recip();
        let shear = [first, second].map(|axis| direction[axis] * per_m);
        (per_m.is_finite() && per_m != 0.0).then_some(Self {
            origin,
            direction,
            axes: [first, second, along],
            shear,
            per_m,
        })
    }

    /// A vertex in the line's own coordinates.
    #[inline]
    fn seen(&self, vertex: &Vector3<f64>) -> Seen {
        let [first, second, along] = self.axes;
        let z = vertex[along] - self.origin[along];
        Seen {
            x: (vertex[first] - self.origin[first]) - self.shear[0] * z,
            y: (vertex[second] - self.origin[second]) - self.shear[1] * z,
            at: z * self.per_m,
        }
    }

    /// Where the line, in both directions, crosses a triangle.
    #[inline]
    pub fn crossing(&self, [a, b, c]: &[Vector3<f64>; 3]) -> Option<Crossing> {
        let [a, b, c] = [self.seen(a), self.seen(b), self.seen(c)];
        let sides = [b.side(&c), c.side(&a), a.side(&b)];
        let leaves = sides[0].1;
        if sides[1].1 != leaves || sides[2].1 != leaves {
            return None;
        }
        let [u, v, w] = sides.map(|side| side.0);
        let total = u + v + w;
        // A triangle that is seen from its edge.
        if total == 0.0 {
            return None;
        }
        Some(Crossing {
            at: (u * a.at + v * b.at + w * c.at) / total,
            leaves,
        })
    }
}

/// Seen along the line, which is the origin.
#[derive(Clone, Copy)]
struct Seen {
    x: f64,
    y: f64,
    /// Parameter of the line beside the vertex.
    at: f64,
}

impl Seen {
    /// Twice the area of the triangle of the line and an edge, and whether the line is on the
    /// edge's left.
    #[inline]
    fn side(&self, to: &Self) -> (f64, bool) {
        let area = self.x * to.y - to.x * self.y;
        let is_left = if area != 0.0 {
            area > 0.0
        } else if self.y != to.y {
            // The line moved along x, by far less along y.
            self.y > to.y
        } else {
            to.x > self.x
        };
        (area, is_left)
    }
}
