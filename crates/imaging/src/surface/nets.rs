//! Manifold surface nets.
//!
//! A vertex per sheet of surface in a cell, a quadrilateral per edge of the lattice that the surface crosses (Gibson,
//! *Constrained elastic surface nets*, 1998; sheets after Nielson, *Dual marching cubes*, 2004). Where two cells
//! share a face that the surface crosses twice, and in both one sheet has both crossings, two edges of the net would
//! join the same two vertices: there each crossing of the face gets a vertex of its own. Every edge then has two faces
//! and every vertex one ring of faces, for all data.
//!
//! Cells may span several voxels: vertices lie on the trilinear surface of the voxels all the same.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::TriangleMesh;
use needlebench_volume::VoxelGrid;

use crate::mask::Mask;

use super::cases::{NO_SHEET, case, ends, pairs_on_face};
use super::field::Field;

/// Steps of Newton's method towards the trilinear surface; the first halves of them leave a micrometre.
const STEPS: usize = 4;

/// Nearer to the surface is on it.
const NEAR_M: f64 = 1e-6;

/// The surface of a field as a closed manifold in `ct`, triangles counter-clockwise seen from outside.
///
/// `stride` is the number of voxels along each axis of a cell; details between are smoothed over.
pub(crate) fn surface_net(field: &Field<'_>, grid: &VoxelGrid, stride: [usize; 3]) -> TriangleMesh {
    let mut net = Net::new(field, grid, stride);
    net.build();
    net.mesh
}

/// Voxels of a row at which the lattice has points: the first and the last one are among them, so that the flat ends
/// of what a volume cuts keep their edges.
fn sampled(size: usize, stride: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..size).step_by(stride).collect();
    if places.last() != Some(&(size - 1)) {
        places.push(size - 1);
    }
    places
}

struct Net<'a> {
    field: &'a Field<'a>,
    grid: &'a VoxelGrid,
    /// Voxels of the lattice's points along each axis; the first and the last one are outside the structure's box.
    places: [Vec<isize>; 3],
    /// Lattice points that are inside.
    lattice: Mask,
    /// Corners inside and first vertex of each cell of the last two layers.
    layers: [Vec<(u8, u32)>; 2],
    /// Vertices on faces that are crossed twice: by cell, axis of the face, and crossing.
    on_faces: BTreeMap<([usize; 3], usize, usize), u32>,
    mesh: TriangleMesh,
    /// Whether the grid's axes are left-handed.
    mirrored: bool,
}

impl<'a> Net<'a> {
    fn new(field: &'a Field<'a>, grid: &'a VoxelGrid, stride: [usize; 3]) -> Self {
        let size = field.inside.size();
        let within = [0, 1, 2].map(|axis| sampled(size[axis], stride[axis]));
        let points = [0, 1, 2].map(|axis| within[axis].len() + 2);
        let mut lattice = Mask::empty(points);
        for (k, &from_k) in within[2].iter().enumerate() {
            for (j, &from_j) in within[1].iter().enumerate() {
                for run in field.inside.runs(from_j, from_k) {
                    let run = run.map(|end| within[0].partition_point(|&i| i < end) + 1);
                    lattice.insert_run(run, j + 1, k + 1);
                }
            }
        }
        let places = std::array::from_fn(|axis| {
            let first = field.bounds.first[axis].cast_signed();
            let middle = within[axis].iter().map(|&at| first + at.cast_signed());
            let beyond = first + size[axis].cast_signed();
            std::iter::once(first - 1)
                .chain(middle)
                .chain([beyond])
                .collect()
        });
        Self {
            field,
            grid,
            places,
            layers: [0, 1].map(|_| vec![(0, 0); points[0] * points[1]]),
            lattice,
            on_faces: BTreeMap::new(),
            mesh: TriangleMesh {
                vertices_m: Vec::new(),
                triangles: Vec::new(),
            },
            mirrored: grid.steps_m().determinant() < 0.0,
        }
    }

    fn build(&mut self) {
        let [_, ny, nz] = self.lattice.size();
        for k in 0..nz - 1 {
            self.layers.swap(0, 1);
            for j in 0..ny - 1 {
                self.row_of_cells(j, k);
            }
        }
    }

    /// Cells that the surface crosses, 64 at a time.
    fn row_of_cells(&mut self, j: usize, k: usize) {
        let words = self.lattice.words_per_row();
        for word in 0..words {
            let rows = [[j, k], [j + 1, k], [j, k + 1], [j + 1, k + 1]];
            let both = rows.map(|[j, k]| {
                let row = self.lattice.row(j, k);
                let next = row.get(word + 1).map_or(0, |next| next << 63);
                (row[word], row[word] >> 1 | next)
            });
            let any = both.iter().fold(0, |any, (a, b)| any | a | b);
            let all = both.iter().fold(u64::MAX, |all, (a, b)| all & a & b);
            let mut crossed = any & !all;
            while crossed != 0 {
                let bit = crossed.trailing_zeros() as usize;
                crossed &= crossed - 1;
                // Bits 0, 2, 4, 6 of the lower i, and 1, 3, 5, 7 of the upper one.
                let corners = both.iter().enumerate().fold(0_u8, |corners, (at, (a, b))| {
                    let pair = (a >> bit & 1) | (b >> bit & 1) << 1;
                    corners | u8::try_from(pair << (2 * at)).unwrap_or_default()
                });
                self.cell([64 * word + bit, j, k], corners);
            }
        }
    }

    fn cell(&mut self, cell: [usize; 3], corners: u8) {
        let first = self.next_vertex();
        let width = self.lattice.size()[0];
        self.layers[1][cell[1] * width + cell[0]] = (corners, first);
        let case = case(corners);
        for sheet in 0..case.sheets {
            let mut sum = Vector3::zeros();
            let mut count = 0.0;
            for edge in (0..12).filter(|&edge| case.sheet_of_edge[edge] == sheet) {
                sum += self.crossing(cell, edge);
                count += 1.0;
            }
            let place = self.onto_surface(sum / count, cell);
            self.push(place);
        }
        for axis in 0..3 {
            // The edge from the cell's first corner is the last one of four cells to see.
            let [low, high] = [corners & 1, corners >> (1 << axis) & 1];
            if low != high {
                self.face_around(cell, axis, low == 1);
            }
        }
    }

    fn next_vertex(&self) -> u32 {
        u32::try_from(self.mesh.vertices_m.len()).expect("a net has fewer than 4 billion vertices")
    }

    fn push(&mut self, place: Vector3<f64>) {
        let vertex = self.grid.ct_from_index(&Point3::from(place));
        self.mesh.vertices_m.push(vertex);
    }

    /// Voxel of a lattice point.
    fn voxel(&self, point: [usize; 3]) -> [isize; 3] {
        [0, 1, 2].map(|axis| self.places[axis][point[axis]])
    }

    /// Where the surface crosses an edge of a cell, as an index of the grid.
    fn crossing(&self, cell: [usize; 3], edge: usize) -> Vector3<f64> {
        let axis = edge / 4;
        let [low, _] = ends(edge);
        let from = self.voxel([0, 1, 2].map(|axis| cell[axis] + (low >> axis & 1)));
        let mut at = from;
        let inside = self.field.is_inside(at);
        // The first voxel that is on the other side: there is one, the end of the edge.
        let step = self.places[axis][cell[axis] + 1] - from[axis];
        for _ in 1..step {
            at[axis] += 1;
            if self.field.is_inside(at) != inside {
                at[axis] -= 1;
                break;
            }
        }
        self.field.crossing(at, axis)
    }

    /// Onto the trilinear surface, if it is in the cell.
    fn onto_surface(&self, start: Vector3<f64>, cell: [usize; 3]) -> Vector3<f64> {
        let low = Vector3::from(self.voxel(cell).map(|index| index as f64));
        let high = Vector3::from(self.voxel(cell.map(|at| at + 1)).map(|index| index as f64));
        let squares = Vector3::from(self.grid.spacing_m()).map(|step| step * step);
        let mut place = start;
        let mut best = (f64::INFINITY, start);
        let mut known = None;
        for _ in 0..STEPS {
            let (value, gradient) = self.field.at(&place, &mut known);
            if value.abs() < best.0 {
                best = (value.abs(), place);
            }
            // The shortest way in metres, not in voxels.
            let way = gradient.component_div(&squares);
            let rate = gradient.dot(&way);
            // The way that is left, squared, is the square of the value over the rate.
            if rate <= 0.0 || value * value <= NEAR_M * NEAR_M * rate {
                break;
            }
            place = (place - way * (value / rate)).sup(&low).inf(&high);
        }
        best.1
    }

    /// The polygon around an edge of the lattice, through the four cells at it.
    fn face_around(&mut self, cell: [usize; 3], axis: usize, outwards: bool) {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let mut ring = [cell; 4];
        // Counter-clockwise seen from the end of the axis.
        ring[0][u] -= 1;
        ring[0][v] -= 1;
        ring[1][v] -= 1;
        ring[3][u] -= 1;
        // Between which cells lies the face with that normal: 0 and 1 across u, and so on.
        let normals = [u, v, u, v];
        let mut polygon: Vec<(u32, bool)> = Vec::with_capacity(8);
        for at in 0..4 {
            polygon.push((self.vertex(ring[at], cell, axis), false));
            if let Some(extra) =
                self.on_face([ring[at], ring[(at + 1) % 4]], normals[at], cell, axis)
            {
                polygon.push((extra, true));
            }
        }
        if outwards == self.mirrored {
            polygon.reverse();
        }
        self.triangulate(&mut polygon);
    }

    fn triangulate(&mut self, polygon: &mut [(u32, bool)]) {
        // From a vertex on a face, which lies beside the line between its neighbours; else across the shorter diagonal.
        let start = polygon
            .iter()
            .position(|&(_, extra)| extra)
            .unwrap_or_else(|| {
                let place = |at: usize| self.mesh.vertices_m[polygon[at].0 as usize];
                let [one, other] =
                    [(0, 2), (1, 3)].map(|(a, b)| (place(a) - place(b)).norm_squared());
                usize::from(other < one)
            });
        polygon.rotate_left(start);
        for pair in polygon[1..].windows(2) {
            self.mesh
                .triangles
                .push([polygon[0].0, pair[0].0, pair[1].0]);
        }
    }

    fn known(&self, cell: [usize; 3], newest: [usize; 3]) -> (u8, u32) {
        let layer = usize::from(cell[2] == newest[2]);
        self.layers[layer][cell[1] * self.lattice.size()[0] + cell[0]]
    }

    /// Number within a cell of the edge from the newest cell's first corner along an axis.
    fn edge_in(cell: [usize; 3], newest: [usize; 3], axis: usize) -> usize {
        let beyond = |axis: usize| newest[axis] - cell[axis];
        axis * 4 + beyond((axis + 1) % 3) + 2 * beyond((axis + 2) % 3)
    }

    /// Vertex of the sheet of a cell that crosses the edge.
    fn vertex(&self, cell: [usize; 3], newest: [usize; 3], axis: usize) -> u32 {
        let (corners, first) = self.known(cell, newest);
        let sheet = case(corners).sheet_of_edge[Self::edge_in(cell, newest, axis)];
        debug_assert_ne!(sheet, NO_SHEET);
        first + u32::from(sheet)
    }

    /// The vertex on the face between two cells, if the surface crosses the face twice and in both cells one sheet has
    /// both crossings.
    fn on_face(
        &mut self,
        cells: [[usize; 3]; 2],
        normal: usize,
        newest: [usize; 3],
        axis: usize,
    ) -> Option<u32> {
        let [low, high] = if cells[0][normal] < cells[1][normal] {
            cells
        } else {
            [cells[1], cells[0]]
        };
        let (corners_low, _) = self.known(low, newest);
        let (corners_high, _) = self.known(high, newest);
        let pairs = pairs_on_face(corners_high, normal, 0)?;
        let pairs_low = pairs_on_face(corners_low, normal, 1)?;
        let is_one = |corners: u8, pairs: [[usize; 2]; 2]| {
            let sheet_of_edge = &case(corners).sheet_of_edge;
            sheet_of_edge[pairs[0][0]] == sheet_of_edge[pairs[1][0]]
        };
        if !is_one(corners_high, pairs) || !is_one(corners_low, pairs_low) {
            return None;
        }
        let edge = Self::edge_in(high, newest, axis);
        let pair = usize::from(!pairs[0].contains(&edge));
        if let Some(&vertex) = self.on_faces.get(&(high, normal, pair)) {
            return Some(vertex);
        }
        let vertex = self.next_vertex();
        let [a, b] = pairs[pair].map(|edge| self.crossing(high, edge));
        self.push(0.5 * (a + b));
        self.on_faces.insert((high, normal, pair), vertex);
        Some(vertex)
    }
}
