//! Distance of two cores that lie apart (Gilbert, Johnson, Keerthi), with a certificate.

use nalgebra::Vector3;

use crate::core::{Difference, Vertex};

/// Width of the certificate, m: the reported distance is a proven lower bound and at most this
/// much below the distance of the witness points.
///
/// Not reached only where rounding stops progress first; what is then left is asserted by
/// `tests/against_coal.rs`.
pub(crate) const CERTIFIED_GAP_M: f64 = 1e-10;

/// Distance below which cores count as touching and are passed on to the depth solver, m.
const TOUCHING_M: f64 = 1e-11;

/// Bound on the iterations; smooth pairs take about 20.
const MAX_ITERATIONS: usize = 200;

/// What is known of the signed distance of two cores.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Gap {
    /// The cores are apart.
    Apart(CoreSeparation),
    /// The distance is certainly larger than the cutoff.
    BeyondCutoff,
    /// The cores touch or overlap.
    Overlap,
}

/// Signed distance of two cores, in the frame of B.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CoreSeparation {
    /// Signed distance, m.
    pub distance_m: f64,
    /// Unit vector from A to B.
    pub normal: Vector3<f64>,
    /// Witness on core A.
    pub on_a: Vector3<f64>,
    /// Witness on core B.
    pub on_b: Vector3<f64>,
}

/// Distance of the cores unless they overlap or are farther apart than `cutoff_m`.
///
/// `towards_b` is a guess of the direction from A to B; it only saves time.
pub(crate) fn distance(
    difference: &mut Difference<'_>,
    towards_b: &Vector3<f64>,
    cutoff_m: f64,
) -> Gap {
    // Support planes bound the distance from below: no difference is closer than its plane.
    let mut lower_m = f64::NEG_INFINITY;

    let guess = towards_b.norm();
    let first = if guess > 0.0 {
        let normal = towards_b / guess;
        let vertex = difference.support(&normal);
        lower_m = -normal.dot(&vertex.x);
        if lower_m > cutoff_m {
            return Gap::BeyondCutoff;
        }
        vertex
    } else {
        difference.support(&Vector3::x())
    };
    let mut simplex = Simplex::corner(&first);
    let mut upper_m = first.x.norm();
    for _ in 0..MAX_ITERATIONS {
        if upper_m <= TOUCHING_M {
            return Gap::Overlap;
        }
        let normal = simplex.closest / -upper_m;
        let vertex = difference.support(&normal);
        lower_m = lower_m.max(-normal.dot(&vertex.x));
        if lower_m > cutoff_m {
            return Gap::BeyondCutoff;
        }
        if upper_m - lower_m <= CERTIFIED_GAP_M || simplex.contains(&vertex) {
            break;
        }
        let Some(reduced) = simplex.with(&vertex) else {
            return Gap::Overlap;
        };
        let reduced_m = reduced.closest.norm();
        if reduced_m >= upper_m {
            break;
        }
        simplex = reduced;
        upper_m = reduced_m;
    }
    if lower_m <= 0.0 {
        return Gap::Overlap;
    }
    let on_a = simplex.on_a();
    Gap::Apart(CoreSeparation {
        distance_m: lower_m,
        normal: simplex.closest / -upper_m,
        on_a,
        on_b: on_a - simplex.closest,
    })
}

/// Up to three vertices and the weights of their point closest to the origin, all positive.
#[derive(Debug, Clone, Copy)]
struct Simplex {
    vertices: [Vertex; 3],
    weights: [f64; 3],
    len: usize,
    /// The point closest to the origin.
    closest: Vector3<f64>,
}

impl Simplex {
    fn corner(a: &Vertex) -> Self {
        Self {
            vertices: [*a; 3],
            weights: [1.0, 0.0, 0.0],
            len: 1,
            closest: a.x,
        }
    }

    fn contains(&self, vertex: &Vertex) -> bool {
        self.vertices[..self.len].iter().any(|v| v.x == vertex.x)
    }

    /// Where the closest difference is on core A.
    fn on_a(&self) -> Vector3<f64> {
        (0..self.len).fold(Vector3::zeros(), |sum, i| {
            sum + self.vertices[i].a * self.weights[i]
        })
    }

    /// The vertices that carry the point closest to the origin once `new` is added, or `None`
    /// if the origin is inside the tetrahedron that they form.
    ///
    /// `new` is a support point towards the origin, hence always part of the result.
    fn with(&self, new: &Vertex) -> Option<Self> {
        let [a, b, c] = &self.vertices;
        match self.len {
            1 => Some(Self::on_edge(new, a)),
            2 => Some(Self::on_triangle(new, a, b, &face_normal(new, a, b))),
            _ => {
                let mut best: Option<Self> = None;
                for (second, third, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
                    let normal = face_normal(new, second, third);
                    let inside = normal.dot(&(opposite.x - new.x));
                    let origin = -normal.dot(&new.x);
                    // The origin is behind the face; a flat tetrahedron has no behind.
                    if origin * inside > 0.0 {
                        continue;
                    }
                    let face = Self::on_triangle(new, second, third, &normal);
                    if best.is_none_or(|best| face.is_closer_than(&best)) {
                        best = Some(face);
                    }
                }
                best
            }
        }
    }

    fn is_closer_than(&self, other: &Self) -> bool {
        self.closest.norm_squared() < other.closest.norm_squared()
    }

    fn on_edge(a: &Vertex, b: &Vertex) -> Self {
        let edge = b.x - a.x;
        let along = -edge.dot(&a.x);
        let length_squared = edge.norm_squared();
        if along <= 0.0 {
            Self::corner(a)
        } else if along >= length_squared {
            Self::corner(b)
        } else {
            let t = along / length_squared;
            Self {
                vertices: [*a, *b, *b],
                weights: [1.0 - t, t, 0.0],
                len: 2,
                closest: a.x + edge * t,
            }
        }
    }

    fn on_triangle(a: &Vertex, b: &Vertex, c: &Vertex, normal: &Vector3<f64>) -> Self {
        // Areas of the origin's projection with each edge.
        let wa = b.x.cross(&(c.x - b.x)).dot(normal);
        let wb = c.x.cross(&(a.x - c.x)).dot(normal);
        let wc = a.x.cross(&(b.x - a.x)).dot(normal);
        if wa > 0.0 && wb > 0.0 && wc > 0.0 {
            let sum = wa + wb + wc;
            let weights = [wa / sum, wb / sum, wc / sum];
            return Self {
                vertices: [*a, *b, *c],
                weights,
                len: 3,
                closest: a.x * weights[0] + b.x * weights[1] + c.x * weights[2],
            };
        }
        let one = Self::on_edge(a, b);
        let other = Self::on_edge(a, c);
        if other.is_closer_than(&one) {
            other
        } else {
            one
        }
    }
}

fn face_normal(a: &Vertex, b: &Vertex, c: &Vertex) -> Vector3<f64> {
    (b.x - a.x).cross(&(c.x - a.x))
}
