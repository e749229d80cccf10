//! Clearance of a straight line with a radius, such as a planned needle.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_cell::shape::Solid;
use needlebench_kinematics::Pose;

use crate::core::{Placement, PreparedShape};
use crate::separation::{Separation, in_frame_of_b};

/// Solids made ready for many segments: the search tree of a mesh takes far longer to build than
/// to ask (0.3 s for 100 000 triangles).
#[derive(Debug, Clone)]
pub struct PreparedSolids(Vec<(PreparedShape, Pose)>);

impl PreparedSolids {
    /// Prepares the solids, in their order.
    pub fn new(solids: &[Solid]) -> Self {
        let prepared = solids
            .iter()
            .map(|solid| (PreparedShape::new(&solid.shape), solid.parent_from_shape));
        Self(prepared.collect())
    }

    /// [`segment_clearance`] from these solids.
    pub fn segment_clearance(
        &self,
        from: &Point3<f64>,
        to: &Point3<f64>,
        radius_m: f64,
        world_from_parent: &Pose,
    ) -> Vec<Separation> {
        let along = to - from;
        let shape = PreparedShape::segment(0.5 * along.norm(), radius_m);
        let world_from_segment = Placement {
            rotation: rotation_with_z(&along),
            translation: nalgebra::center(from, to).coords,
        };
        self.0
            .iter()
            .map(|(other, parent_from_shape)| {
                let world_from_solid = Placement::new(&(world_from_parent * parent_from_shape));
                let solid_from_segment = world_from_solid.inverse_after(&world_from_segment);
                in_frame_of_b(&shape, other, &solid_from_segment).placed(&world_from_solid)
            })
            .collect()
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
