//! Convex polyhedra: farthest vertex along a direction.

use nalgebra::{Point3, Vector3};

/// Below this many vertices a plain scan is faster than walking from vertex to vertex.
const SCAN_VERTICES: usize = 24;

/// Highest rise of a vertex over a neighbouring facet at which the surface still counts as
/// convex, relative to the hull's extent: rounding of coordinates, no more.
const CONVEX_TOLERANCE: f64 = 1e-12;

/// Vertices of a convex polyhedron and, if its surface proved convex, who is next to whom.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Polyhedron {
    vertices: Vec<Vector3<f64>>,
    /// Neighbours of vertex `i` are `neighbours[starts[i]..starts[i + 1]]`; empty: scan.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// Where a walk without a hint begins: the farthest vertices along +-x, +-y, +-z.
    seeds: [u32; 6],
}

impl Polyhedron {
    pub fn new(vertices: &[Point3<f64>], triangles: &[[u32; 3]]) -> Self {
        let vertices: Vec<_> = vertices.iter().map(|vertex| vertex.coords).collect();
        let mut hull = Self {
            vertices,
            starts: Vec::new(),
            neighbours: Vec::new(),
            seeds: [0; 6],
        };
        if hull.vertices.is_empty() {
            // An empty mesh is the loader's error; a point keeps every query defined.
            hull.vertices.push(Vector3::zeros());
        }
        if hull.vertices.len() >= SCAN_VERTICES && is_convex_surface(&hull.vertices, triangles) {
            hull.link(triangles);
        }
        hull
    }

    pub fn vertices_m(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    #[inline]
    pub fn support(&self, direction: &Vector3<f64>, hint: &mut usize) -> Vector3<f64> {
        if self.starts.is_empty() {
            return self.vertices[self.scan(direction)];
        }
        if *hint >= self.vertices.len() {
            let axis = direction.iamax();
            *hint = self.seeds[2 * axis + usize::from(direction[axis] < 0.0)] as usize;
        }
        let mut best = direction.dot(&self.vertices[*hint]);
        // On a convex surface a vertex with no farther neighbour is the farthest of all.
        loop {
            let mut next = *hint;
            let range = self.starts[*hint] as usize..self.starts[*hint + 1] as usize;
            for &neighbour in &self.neighbours[range] {
                let value = direction.dot(&self.vertices[neighbour as usize]);
                if value > best {
                    best = value;
                    next = neighbour as usize;
                }
            }
            if next == *hint {
                return self.vertices[next];
            }
            *hint = next;
        }
    }

    fn scan(&self, direction: &Vector3<f64>) -> usize {
        let mut best = (f64::NEG_INFINITY, 0);
        for (i, vertex) in self.vertices.iter().enumerate() {
            let value = direction.dot(vertex);
            if value > best.0 {
                best = (value, i);
            }
        }
        best.1
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "indices come from a mesh that numbers its vertices in u32"
    )]
    fn link(&mut self, triangles: &[[u32; 3]]) {
        for axis in 0..3 {
            for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
                let mut direction = Vector3::zeros();
                direction[axis] = sign;
                self.seeds[2 * axis + side] = self.scan(&direction) as u32;
            }
        }
        // Each edge of a closed surface runs once in either direction.
        let mut edges: Vec<_> = directed_edges(triangles).collect();
        edges.sort_unstable();
        self.starts = (0..=self.vertices.len())
            .map(|i| edges.partition_point(|&(from, _)| (from as usize) < i) as u32)
            .collect();
        self.neighbours = edges.into_iter().map(|(_, to)| to).collect();
    }
}

fn directed_edges(triangles: &[[u32; 3]]) -> impl Iterator<Item = (u32, u32)> {
    triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
}

/// Whether the triangles are a closed surface with the topology of a sphere that bends outwards
/// at every edge: what a walk along the edges needs to be right. Local convexity of a closed
/// surface is global convexity (Tietze and Nakajima).
fn is_convex_surface(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> bool {
    let count = vertices.len();
    if triangles.iter().flatten().any(|&i| i as usize >= count) {
        return false;
    }
    // Each directed edge with the vertex opposite to it.
    let mut edges: Vec<_> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b, c), (b, c, a), (c, a, b)])
        .collect();
    edges.sort_unstable();
    if edges
        .windows(2)
        .any(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1))
    {
        return false;
    }
    let mut used = vec![false; count];
    for &(from, _, _) in &edges {
        used[from as usize] = true;
    }
    // Euler's formula V - E + F = 2, with E half of the directed edges.
    if !used.iter().all(|&used| used) || 2 * (count + triangles.len()) != edges.len() + 4 {
        return false;
    }
    let extent = vertices
        .iter()
        .map(|vertex| (vertex - vertices[0]).norm())
        .fold(0.0, f64::max);
    edges.iter().all(|&(from, to, opposite)| {
        let Ok(twin) = edges.binary_search_by(|&(a, b, _)| (a, b).cmp(&(to, from))) else {
            return false;
        };
        let [a, b, c, d] = [from, to, opposite, edges[twin].2].map(|i| vertices[i as usize]);
        let normal = (b - a).cross(&(c - a));
        normal.dot(&(d - a)) <= CONVEX_TOLERANCE * extent * normal.norm()
    })
}
