//! What stands between people and the entry point, placed for one posture.

use nalgebra::Point3;
use needlebench_cell::{BodyKind, Cell, Frame};
use needlebench_geometry::{PreparedShape, Shape, SightTarget, separation};
use needlebench_kinematics::{Joints, Pose};

use super::grid::VoxelGrid;

/// Solids of a cell, ready for distances from points and for lines of sight.
#[derive(Debug)]
pub struct Obstacles<'c> {
    cell: &'c Cell,
    solids: Vec<Obstacle<'c>>,
    point: PreparedShape,
}

#[derive(Debug)]
struct Obstacle<'c> {
    name: &'c str,
    body: usize,
    is_robot: bool,
    target: SightTarget,
    prepared: PreparedShape,
    body_from_shape: Pose,
    /// Ball around the shape, in its frame.
    ball_center_m: Point3<f64>,
    ball_radius_m: f64,
}

/// A solid at its place.
#[derive(Debug, Clone)]
struct Placed<'o> {
    solid: &'o Obstacle<'o>,
    world_from_shape: Pose,
    shape_from_world: Pose,
    ball_center_m: Point3<f64>,
}

impl<'c> Obstacles<'c> {
    /// All solids of the cell except the access zone, which is no obstacle, and the people, whose view is evaluated.
    pub fn new(cell: &'c Cell) -> Self {
        let mut solids = Vec::new();
        for (index, body) in cell.bodies.iter().enumerate() {
            if matches!(body.kind, BodyKind::NeedleCorridor | BodyKind::Person) {
                continue;
            }
            let is_robot = body.kind == BodyKind::Base || matches!(body.frame, Frame::Link(_));
            for solid in &body.solids {
                let prepared = PreparedShape::new(&solid.shape);
                let (ball_center_m, ball_radius_m) = prepared.bounding_sphere_m();
                solids.push(Obstacle {
                    name: &solid.name,
                    body: index,
                    is_robot,
                    target: SightTarget::new(&solid.shape),
                    prepared,
                    body_from_shape: solid.parent_from_shape,
                    ball_center_m,
                    ball_radius_m,
                });
            }
        }
        Self {
            cell,
            solids,
            point: PreparedShape::new(&Shape::Sphere { radius_m: 0.0 }),
        }
    }

    /// Arm and tool alone, at joint positions `q`.
    pub fn robot(&self, q: &Joints) -> PlacedObstacles<'_> {
        self.placed(q, |solid| solid.is_robot)
    }

    /// What does not move: phantom, table, gantry, mount and obstacles.
    pub fn surroundings(&self) -> PlacedObstacles<'_> {
        self.placed(&Joints::zeros(), |solid| !solid.is_robot)
    }

    /// Everything, with the arm at joint positions `q`.
    pub fn all(&self, q: &Joints) -> PlacedObstacles<'_> {
        self.placed(q, |_| true)
    }

    fn placed(&self, q: &Joints, wanted: impl Fn(&Obstacle<'_>) -> bool) -> PlacedObstacles<'_> {
        let bodies = self.cell.world_from_bodies(q);
        let solids = self.solids.iter().filter(|solid| wanted(solid));
        PlacedObstacles {
            point: &self.point,
            solids: solids
                .map(|solid| {
                    let world_from_shape = bodies[solid.body] * solid.body_from_shape;
                    Placed {
                        solid,
                        world_from_shape,
                        shape_from_world: world_from_shape.inverse(),
                        ball_center_m: world_from_shape * solid.ball_center_m,
                    }
                })
                .collect(),
        }
    }
}

impl Placed<'_> {
    /// Whether a line from a point of one ball to a point of another may meet the solid.
    fn may_be_between(&self, from: &Ball, to: &Ball) -> bool {
        /// Of points in metres.
        const ROUNDING_M: f64 = 1e-9;
        let along = to.center_m - from.center_m;
        let to_center = self.ball_center_m - from.center_m;
        let length_squared = along.norm_squared().max(f64::MIN_POSITIVE);
        let nearest = (to_center.dot(&along) / length_squared).clamp(0.0, 1.0);
        // A line is nowhere farther from that of the centres than the larger ball reaches.
        let reach_m = self.solid.ball_radius_m + from.radius_m.max(to.radius_m) + ROUNDING_M;
        (to_center - along * nearest).norm_squared() <= reach_m * reach_m
    }

    /// Parameter, 0 at `from` and 1 at `to`, of the first point of a segment in the solid.
    fn hit(&self, from: &Point3<f64>, to: &Point3<f64>, likely: &mut usize) -> Option<f64> {
        let along = to - from;
        let length_squared = along.norm_squared().max(f64::MIN_POSITIVE);
        let to_center = self.ball_center_m - from;
        let nearest = (to_center.dot(&along) / length_squared).clamp(0.0, 1.0);
        let radius_m = self.solid.ball_radius_m;
        if (to_center - along * nearest).norm_squared() > radius_m * radius_m {
            return None;
        }
        let from = self.shape_from_world * from;
        let to = self.shape_from_world * to;
        self.solid.target.first_hit(&from, &to, likely)
    }
}

/// Solids at their places.
#[derive(Debug, Clone)]
pub struct PlacedObstacles<'o> {
    point: &'o PreparedShape,
    solids: Vec<Placed<'o>>,
}

/// Lines of sight past solids; one line is quicker for those before it, and finds the same.
#[derive(Debug)]
pub struct SightLines<'p>(Vec<InSight<'p>>);

/// A solid that lines may meet.
#[derive(Debug)]
struct InSight<'p> {
    index: usize,
    placed: &'p Placed<'p>,
    /// What let the last line pass.
    likely: usize,
}

/// All points within a distance of one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    pub center_m: Point3<f64>,
    pub radius_m: f64,
}

impl SightLines<'_> {
    /// First solid on the way from one point to another: parameter of the place, 0 at `from` and 1
    /// at `to`, and the solid's index.
    pub fn first_on_the_way(
        &mut self,
        from: &Point3<f64>,
        to: &Point3<f64>,
    ) -> Option<(f64, usize)> {
        let mut first: Option<(f64, usize)> = None;
        for solid in &mut self.0 {
            let hit = solid.placed.hit(from, to, &mut solid.likely);
            if let Some(t) = hit
                && first.is_none_or(|(known, _)| t < known)
            {
                first = Some((t, solid.index));
            }
        }
        first
    }

    /// Whether anything is between two points.
    pub(crate) fn is_in_the_way(&mut self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let mut solids = self.0.iter_mut();
        solids.any(|solid| solid.placed.hit(from, to, &mut solid.likely).is_some())
    }
}

/// Indices of solids that may matter for a piece of space.
pub(super) type Near = Vec<usize>;

impl PlacedObstacles<'_> {
    /// Name of a solid.
    pub(super) fn name(&self, index: usize) -> &str {
        self.solids[index].solid.name
    }

    /// All solids.
    pub(super) fn everything(&self) -> Near {
        (0..self.solids.len()).collect()
    }

    /// Signed distance of a point from a solid, or infinity if it is certainly more than `beyond_m`.
    fn distance_m(&self, index: usize, point: &Point3<f64>, beyond_m: f64) -> f64 {
        let placed = &self.solids[index];
        let ball_gap_m = (placed.ball_center_m - point).norm() - placed.solid.ball_radius_m;
        if ball_gap_m > beyond_m {
            return f64::INFINITY;
        }
        // A point's depth in a surface is its distance from it: no direction has to be searched for.
        if let Some(surface) = placed.solid.prepared.surface() {
            let local = placed.shape_from_world * point;
            let distance_m = (surface.nearest(&local) - local).norm();
            return if surface.contains(&local) {
                -distance_m
            } else {
                distance_m
            };
        }
        let at = Pose::translation(point.x, point.y, point.z);
        separation(
            self.point,
            &at,
            &placed.solid.prepared,
            &placed.world_from_shape,
        )
        .distance_m
    }

    /// Whether a point is in a solid, or on it.
    pub(super) fn is_inside(&self, index: usize, point: &Point3<f64>) -> bool {
        self.distance_m(index, point, 0.0) <= 0.0
    }

    /// Point of a solid that is nearest to a point.
    pub(super) fn point_of(&self, index: usize, point: &Point3<f64>) -> Point3<f64> {
        let placed = &self.solids[index];
        let at = Pose::translation(point.x, point.y, point.z);
        let solid = &placed.solid.prepared;
        separation(self.point, &at, solid, &placed.world_from_shape).point_on_b
    }

    /// Nearest of the solids within `reach_m` of a point: its signed distance and index, and all
    /// that are within reach.
    pub(super) fn within(
        &self,
        near: &[usize],
        point: &Point3<f64>,
        reach_m: f64,
    ) -> (Option<(f64, usize)>, Near) {
        let mut nearest: Option<(f64, usize)> = None;
        let mut kept = Near::new();
        for &index in near {
            let distance_m = self.distance_m(index, point, reach_m);
            if distance_m <= reach_m {
                kept.push(index);
                if nearest.is_none_or(|(known_m, _)| distance_m < known_m) {
                    nearest = Some((distance_m, index));
                }
            }
        }
        (nearest, kept)
    }

    /// Lines of sight past the solids.
    pub fn lines(&self) -> SightLines<'_> {
        self.lines_past(|_| true)
    }

    /// Lines of sight from points of one ball to points of another: the same, without the solids that none can meet.
    pub(super) fn lines_between(&self, from: &Ball, to: &Ball) -> SightLines<'_> {
        self.lines_past(|placed| placed.may_be_between(from, to))
    }

    fn lines_past(&self, counts: impl Fn(&Placed<'_>) -> bool) -> SightLines<'_> {
        let all = self.solids.iter().enumerate();
        let counted = all.filter(|(_, placed)| counts(placed));
        SightLines(
            counted
                .map(|(index, placed)| InSight {
                    index,
                    placed,
                    likely: usize::MAX,
                })
                .collect(),
        )
    }

    /// Voxels whose centre is nearer to a solid than the margin, in the grid's order.
    ///
    /// The same as asking for every centre by itself. Blocks are decided at once where the distance
    /// of their middle says so: it changes by no more than one walks.
    pub fn taken(&self, grid: &VoxelGrid, margin_m: f64) -> Vec<bool> {
        self.taken_of(grid, margin_m, &|_, _| true)
    }

    /// The same of the voxels that count; of others it is not said. `counts` is whether any voxel may, of those whose
    /// centres are within a distance of a point.
    pub(super) fn taken_of(
        &self,
        grid: &VoxelGrid,
        margin_m: f64,
        counts: &impl Fn(&Point3<f64>, f64) -> bool,
    ) -> Vec<bool> {
        let mut taken = vec![false; grid.len()];
        let whole = Block {
            low: [0; 3],
            size: grid.cells,
        };
        let asked = Asked {
            grid,
            margin_m,
            counts,
        };
        self.take(&asked, whole, &self.everything(), &mut taken);
        taken
    }

    fn take(
        &self,
        asked: &Asked<'_, impl Fn(&Point3<f64>, f64) -> bool>,
        block: Block,
        near: &[usize],
        taken: &mut [bool],
    ) {
        if block.size.contains(&0) {
            return;
        }
        let Asked {
            grid,
            margin_m,
            counts,
        } = *asked;
        let (middle, half_m) = block.ball(grid);
        if !counts(&middle, half_m) {
            return;
        }
        let (nearest, kept) = self.within(near, &middle, margin_m + half_m);
        let Some((distance_m, _)) = nearest else {
            return;
        };
        let is_voxel = block.size == [1; 3];
        if distance_m + half_m < margin_m {
            block.for_each(grid, |index| taken[index] = true);
        } else if !is_voxel {
            for part in block.halves() {
                self.take(asked, part, &kept, taken);
            }
        }
    }
}

/// Which voxels are asked for, and how near is near.
struct Asked<'a, C> {
    grid: &'a VoxelGrid,
    margin_m: f64,
    counts: &'a C,
}

/// A box of voxels.
#[derive(Debug, Clone, Copy)]
struct Block {
    low: [usize; 3],
    size: [usize; 3],
}

impl Block {
    /// Ball about the centres of all voxels.
    fn ball(&self, grid: &VoxelGrid) -> (Point3<f64>, f64) {
        let low = grid.center_at_m(self.low);
        let high = grid.center_at_m(std::array::from_fn(|axis| {
            self.low[axis] + self.size[axis] - 1
        }));
        (nalgebra::center(&low, &high), 0.5 * (high - low).norm())
    }

    /// Two halves across the longest side.
    fn halves(&self) -> [Self; 2] {
        let axis = (0..3).max_by_key(|axis| self.size[*axis]).unwrap_or(0);
        let (mut first, mut second) = (*self, *self);
        first.size[axis] /= 2;
        second.size[axis] -= first.size[axis];
        second.low[axis] += first.size[axis];
        [first, second]
    }

    fn for_each(&self, grid: &VoxelGrid, mut visit: impl FnMut(usize)) {
        for z in 0..self.size[2] {
            for y in 0..self.size[1] {
                for x in 0..self.size[0] {
                    visit(grid.index([self.low[0] + x, self.low[1] + y, self.low[2] + z]));
                }
            }
        }
    }
}
