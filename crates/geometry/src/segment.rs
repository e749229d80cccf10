//! Clearance of a straight line with a radius, such as a planned needle.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_kinematics::Pose;

use crate::bounds::BoundingCapsule;
use crate::distance::{PRUNING_MARGIN_M, in_frame_of_b};
use crate::placement::Placement;
use crate::prepared::PreparedShape;
use crate::separation::Separation;
use crate::shape::Solid;

/// Solids made ready for many segments: the search tree of a mesh takes far longer to build than
/// to ask (0.3 s for 100 000 triangles).
#[derive(Debug, Clone)]
pub struct PreparedSolids(
    Vec<(PreparedShape, Pose)>,
    /// What encloses each, in the parent's frame.
    Vec<BoundingCapsule>,
);

impl PreparedSolids {
    /// Prepares the solids, in their order.
    pub fn new(solids: &[Solid]) -> Self {
        let prepared = solids
            .iter()
            .map(|solid| (PreparedShape::new(&solid.shape), solid.parent_from_shape));
        let prepared: Vec<_> = prepared.collect();
        let bounds = prepared
            .iter()
            .map(|(shape, place)| shape.bound.placed(&Placement::new(place)))
            .collect();
        Self(prepared, bounds)
    }

    /// The solid that a segment comes nearest to, of those that are wanted, with the signed distance
    /// that [`PreparedSolids::segment_clearance`] gives for it. What bounding volumes show to be
    /// farther away is left out.
    pub fn nearest_to_segment(
        &self,
        from: &Point3<f64>,
        to: &Point3<f64>,
        radius_m: f64,
        world_from_parent: &Pose,
        wanted: impl Fn(usize) -> bool,
    ) -> Option<(usize, Separation)> {
        let segment = Segment::new(from, to, radius_m);
        let bound = {
            let parent_from_world = Placement::new(&world_from_parent.inverse());
            let in_parent = parent_from_world.after(&segment.world_from_segment);
            segment.shape.bound.placed(&in_parent)
        };
        let gaps: Vec<(usize, f64)> = (0..self.0.len())
            .filter(|index| wanted(*index))
            .map(|index| (index, bound.gap_m(&self.1[index])))
            .collect();
        // The most promising one first: its distance leaves most others out.
        let &(promising, _) = gaps.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let mut best = (promising, self.to(promising, &segment, world_from_parent));
        for (index, gap_m) in gaps {
            let least_m = best.1.distance_m;
            if index == promising || gap_m > least_m + PRUNING_MARGIN_M {
                continue;
            }
            let here = self.to(index, &segment, world_from_parent);
            if here.distance_m < least_m || (here.distance_m == least_m && index < best.0) {
                best = (index, here);
            }
        }
        Some(best)
    }

    fn to(&self, index: usize, segment: &Segment, world_from_parent: &Pose) -> Separation {
        let (other, parent_from_shape) = &self.0[index];
        let world_from_solid = Placement::new(&(world_from_parent * parent_from_shape));
        let solid_from_segment = world_from_solid.inverse_after(&segment.world_from_segment);
        in_frame_of_b(&segment.shape, other, &solid_from_segment).placed(&world_from_solid)
    }

    /// Whether a point of the parent's frame is in one of them, its surface included: what [`Solid::contains`] says, for
    /// meshes by their search tree.
    pub fn contains(&self, index: usize, point: &Point3<f64>) -> bool {
        // Of some hundred parts a point is in one or none: most are told by what encloses them.
        if self.1[index].gap_to_point_m(point) > PRUNING_MARGIN_M {
            return false;
        }
        let (shape, parent_from_shape) = &self.0[index];
        if let Some(tree) = shape.surface() {
            return tree.contains(&(parent_from_shape.inverse() * point));
        }
        let here = Segment::new(point, point, 0.0);
        self.to(index, &here, &Pose::identity()).distance_m <= 0.0
    }

    /// Signed distance of a point of the parent's frame from the nearest of some of them, m; infinite from none of them.
    /// Within several that overlap it is as deep as in the one that it is deepest in.
    pub fn distance_to_point_m(&self, some: &[usize], point: &Point3<f64>) -> f64 {
        let here = Segment::new(point, point, 0.0);
        some.iter().fold(f64::INFINITY, |least_m, index| {
            if self.1[*index].gap_to_point_m(point) > least_m + PRUNING_MARGIN_M {
                return least_m;
            }
            let to = self.to(*index, &here, &Pose::identity());
            least_m.min(to.distance_m)
        })
    }

    /// [`segment_clearance`] from these solids.
    pub fn segment_clearance(
        &self,
        from: &Point3<f64>,
        to: &Point3<f64>,
        radius_m: f64,
        world_from_parent: &Pose,
    ) -> Vec<Separation> {
        let segment = Segment::new(from, to, radius_m);
        (0..self.0.len())
            .map(|index| self.to(index, &segment, world_from_parent))
            .collect()
    }
}

/// All points within a radius of a segment, in the world.
struct Segment {
    shape: PreparedShape,
    world_from_segment: Placement,
}

impl Segment {
    fn new(from: &Point3<f64>, to: &Point3<f64>, radius_m: f64) -> Self {
        let along = to - from;
        Self {
            shape: PreparedShape::segment(0.5 * along.norm(), radius_m),
            world_from_segment: Placement {
                rotation: rotation_with_z(&along),
                translation: nalgebra::center(from, to).coords,
            },
        }
    }
}

/// Signed distance of all points within `radius_m` of a segment from each of the solids, in
/// their order; A is the segment. Ends are in the world, m.
///
/// As accurate as [`separation`](crate::separation). Equal ends give a ball. Prepares the solids
/// for this one segment; see [`PreparedSolids`] for more.
pub fn segment_clearance(
    from: &Point3<f64>,
    to: &Point3<f64>,
    radius_m: f64,
    solids: &[Solid],
    world_from_parent: &Pose,
) -> Vec<Separation> {
    PreparedSolids::new(solids).segment_clearance(from, to, radius_m, world_from_parent)
}

/// A rotation that takes z to `direction`, or the identity for a zero vector.
fn rotation_with_z(direction: &Vector3<f64>) -> Matrix3<f64> {
    let Some(z) = direction.try_normalize(0.0) else {
        return Matrix3::identity();
    };
    let mut side = Vector3::zeros();
    side[z.iamin()] = 1.0;
    let x = side.cross(&z).normalize();
    Matrix3::from_columns(&[x, z.cross(&x), z])
}
