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
    pub fn triangle([a, b, c]: &[Vertex; 3]) -> Self {
        let inside_or_at_a = Self::on_triangle(a, b, c, &face_normal(a, b, c));
        let opposite = Self::on_edge(b, c);
        if opposite.is_closer_than(&inside_or_at_a) {
            opposite
        } else {
            inside_or_at_a
        }
    }

    pub fn contains(&self, vertex: &Vertex) -> bool {
        self.vertices[..self.len].iter().any(|v| v.x == vertex.x)
    }

    /// Where the closest difference is on core A.
    pub fn on_a(&self) -> Vector3<f64> {
        (0..self.len).fold(Vector3::zeros(), |sum, i| {
            sum + self.vertices[i].a * self.weights[i]
        })
    }

    /// The vertices that carry the point closest to the origin once `new` is added, or `None`
    /// if the origin is inside the tetrahedron that they form.
    ///
    /// `new` is a support point towards the origin, hence always part of the result.
    pub fn with(&self, new: &Vertex) -> Option<Self> {
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

    pub fn is_closer_than(&self, other: &Self) -> bool {
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

    /// Without the edge opposite to `a`.
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
