//! Points, segments and triangles of vertices, and their points closest to the origin.

use nalgebra::Vector3;

use super::difference::Vertex;

/// Up to three vertices and the weights of their point closest to the origin, all positive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Simplex {
    vertices: [Vertex; 3],
    weights: [f64; 3],
    len: usize,
    /// The point closest to the origin.
    pub closest: Vector3<f64>,
}

/// The part of some vertices, by their numbers, that carries their point closest to the origin.
#[derive(Clone, Copy)]
struct Part {
    numbers: [usize; 3],
    weights: [f64; 3],
    len: usize,
    closest: Vector3<f64>,
}

impl Simplex {
    pub fn corner(a: &Vertex) -> Self {
        Self {
            vertices: [*a; 3],
            weights: [1.0, 0.0, 0.0],
            len: 1,
            closest: a.x,
        }
    }

    /// The part of a triangle that carries its point closest to the origin.
    pub fn triangle(vertices: &[Vertex; 3]) -> Self {
        let [a, b, c] = vertices;
        let all = [&a.x, &b.x, &c.x];
        let inside_or_at_a = Part::on_triangle(&all, [0, 1, 2], &face_normal(&a.x, &b.x, &c.x));
        let opposite = Part::on_edge(&all, 1, 2);
        let part = if opposite.is_closer_than(&inside_or_at_a) {
            opposite
        } else {
            inside_or_at_a
        };
        Self {
            vertices: part.numbers.map(|number| vertices[number]),
            weights: part.weights,
            len: part.len,
            closest: part.closest,
        }
    }

    pub(crate) fn is_closer_than(&self, other: &Self) -> bool {
        self.closest.norm_squared() < other.closest.norm_squared()
    }

    pub fn contains(&self, vertex: &Vertex) -> bool {
        self.vertices[..self.len].iter().any(|v| v.x == vertex.x)
    }

    /// Where the closest difference is on core A.
    pub(crate) fn on_a(&self) -> Vector3<f64> {
        (0..self.len).fold(Vector3::zeros(), |sum, i| {
            sum + self.vertices[i].a * self.weights[i]
        })
    }

    /// The vertices that carry the point closest to the origin once `new` is added, or `None`
    /// if the origin is inside the tetrahedron that they form.
    ///
    /// `new` is a support point towards the origin, hence always part of the result.
    #[inline]
    pub fn with(&self, new: &Vertex) -> Option<Self> {
        let [a, b, c] = &self.vertices;
        let all = [&new.x, &a.x, &b.x, &c.x];
        let part = match self.len {
            1 => Part::on_edge(&all, 0, 1),
            2 => Part::on_triangle(&all, [0, 1, 2], &face_normal(all[0], all[1], all[2])),
            _ => {
                let mut best: Option<Part> = None;
                for (second, third, opposite) in [(1, 2, 3), (2, 3, 1), (3, 1, 2)] {
                    let normal = face_normal(all[0], all[second], all[third]);
                    let inside = normal.dot(&(all[opposite] - all[0]));
                    let origin = -normal.dot(all[0]);
                    // The origin is behind the face; a flat tetrahedron has no behind.
                    if origin * inside > 0.0 {
                        continue;
                    }
                    let face = Part::on_triangle(&all, [0, second, third], &normal);
                    if best.is_none_or(|best| face.is_closer_than(&best)) {
                        best = Some(face);
                    }
                }
                best?
            }
        };
        Some(Self {
            vertices: part.numbers.map(|number| match number {
                0 => *new,
                known => self.vertices[known - 1],
            }),
            weights: part.weights,
            len: part.len,
            closest: part.closest,
        })
    }
}

impl Part {
    fn is_closer_than(&self, other: &Self) -> bool {
        self.closest.norm_squared() < other.closest.norm_squared()
    }

    #[inline]
    fn corner(all: &[&Vector3<f64>], a: usize) -> Self {
        Self {
            numbers: [a; 3],
            weights: [1.0, 0.0, 0.0],
            len: 1,
            closest: *all[a],
        }
    }

    #[inline]
    fn on_edge(all: &[&Vector3<f64>], a: usize, b: usize) -> Self {
        let edge = all[b] - all[a];
        let along = -edge.dot(all[a]);
        let length_squared = edge.norm_squared();
        if along <= 0.0 {
            Self::corner(all, a)
        } else if along >= length_squared {
            Self::corner(all, b)
        } else {
            let t = along / length_squared;
            Self {
                numbers: [a, b, b],
                weights: [1.0 - t, t, 0.0],
                len: 2,
                closest: all[a] + edge * t,
            }
        }
    }

    /// Without the edge opposite to the first vertex.
    #[inline]
    fn on_triangle(all: &[&Vector3<f64>], numbers: [usize; 3], normal: &Vector3<f64>) -> Self {
        let [a, b, c] = numbers.map(|number| all[number]);
        // Areas of the origin's projection with each edge.
        let wa = b.cross(&(c - b)).dot(normal);
        let wb = c.cross(&(a - c)).dot(normal);
        let wc = a.cross(&(b - a)).dot(normal);
        if wa > 0.0 && wb > 0.0 && wc > 0.0 {
            let sum = wa + wb + wc;
            let weights = [wa / sum, wb / sum, wc / sum];
            return Self {
                numbers,
                weights,
                len: 3,
                closest: a * weights[0] + b * weights[1] + c * weights[2],
            };
        }
        let one = Self::on_edge(all, numbers[0], numbers[1]);
        let other = Self::on_edge(all, numbers[0], numbers[2]);
        if other.is_closer_than(&one) {
            other
        } else {
            one
        }
    }
}

fn face_normal(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}
