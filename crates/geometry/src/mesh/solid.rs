//! From a triangle mesh to the shape of a solid.

use std::sync::Arc;

use super::cache::pieces_of;
use super::decompose::as_convex;
use super::fidelity::Fidelity;
use super::hull::HullError;
use super::surface_index::SurfaceIndex;
use crate::shape::{Shape, SolidMesh, TriangleMesh};

/// Vertices of the largest convex mesh that stays one.
const MOST_CONVEX_VERTICES: usize = 2000;

/// Whether engines will collide with a shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// They will: it needs convex pieces.
    Collision,
    /// Only distances to its surface are wanted.
    Distance,
}

/// The shape of a sound, closed surface, and what to say about it.
///
/// A convex one is the exact hull; all others are their own surface and have convex pieces for the
/// engines.
///
/// # Errors
/// [`HullError::NoPieces`] if engines cannot collide with it.
pub fn shape_of_surface(
    surface: TriangleMesh,
    purpose: Use,
) -> Result<(Shape, Option<Fidelity>), HullError> {
    let small = surface.vertices_m.len() <= MOST_CONVEX_VERTICES;
    if small && let Some(hull) = as_convex(&surface) {
        return Ok((Shape::Convex(Arc::new(hull)), None));
    }
    if purpose == Use::Distance {
        let pieces = Vec::new();
        return Ok((Shape::Mesh(Arc::new(SolidMesh { surface, pieces })), None));
    }
    let index = SurfaceIndex::new(surface);
    let (pieces, fidelity) = pieces_of(&index);
    if pieces.is_empty() {
        return Err(HullError::NoPieces);
    }
    let surface = index.into_mesh();
    let shape = Shape::Mesh(Arc::new(SolidMesh { surface, pieces }));
    Ok((shape, Some(fidelity)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use nalgebra::Point3;

    use super::*;
    use crate::sample_solids::ell;

    /// Rings of points in planes, in single precision as an STL has them: where incremental hulls
    /// make faces without an area.
    #[test]
    fn rings_of_a_long_ellipsoid_are_a_convex_solid() {
        let (rings, spokes) = (12_u32, 24_u32);
        #[expect(clippy::cast_possible_truncation, reason = "what is tested")]
        let single = |value: f64| f64::from(value as f32) * 1e-3;
        let mut vertices_m = vec![Point3::new(0.0, 0.06, single(-150.0))];
        for ring in 1..rings {
            let (sine, cosine) = (PI * f64::from(ring) / f64::from(rings)).sin_cos();
            for spoke in 0..spokes {
                let (y, x) = (TAU * f64::from(spoke) / f64::from(spokes)).sin_cos();
                vertices_m.push(Point3::new(
                    single(20.0 * sine * x),
                    single(60.0 + 20.0 * sine * y),
                    single(-150.0 * cosine),
                ));
            }
        }
        vertices_m.push(Point3::new(0.0, 0.06, single(150.0)));
        let last = u32::try_from(vertices_m.len()).unwrap() - 1;
        let at = |ring: u32, spoke: u32| 1 + (ring - 1) * spokes + spoke % spokes;
        let mut triangles = Vec::new();
        for spoke in 0..spokes {
            triangles.push([0, at(1, spoke + 1), at(1, spoke)]);
            triangles.push([last, at(rings - 1, spoke), at(rings - 1, spoke + 1)]);
            for ring in 1..rings - 1 {
                let [a, b] = [at(ring, spoke), at(ring, spoke + 1)];
                let [c, d] = [at(ring + 1, spoke), at(ring + 1, spoke + 1)];
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        let surface = TriangleMesh {
            vertices_m,
            triangles,
        };
        let (shape, _) = shape_of_surface(surface.clone(), Use::Collision).unwrap();
        match shape {
            Shape::Convex(hull) => assert!(hull.0.vertices_m.len() <= surface.vertices_m.len()),
            Shape::Mesh(mesh) => assert_eq!(mesh.surface, surface),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn surface_for_distances_alone_has_no_pieces() {
        let (shape, fidelity) = shape_of_surface(ell(), Use::Distance).unwrap();
        let Shape::Mesh(mesh) = shape else {
            panic!("{shape:?}")
        };
        assert!(mesh.pieces.is_empty() && fidelity.is_none());
    }
}
