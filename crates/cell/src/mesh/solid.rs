//! From a triangle mesh to the shape of a solid.

use std::sync::Arc;

use super::cache::pieces_of;
use super::hull::robust_hull;
use super::{Fidelity, SurfaceIndex, check, convex_hull, is_convex, mend, size_m, volume_m3};
use crate::shape::{ConvexMesh, Shape, SolidMesh, TriangleMesh};

/// Share of a surface that mending may add.
const MENDABLE: f64 = 0.01;

/// Size of a link above which its mesh is in another unit, m: the largest arm reaches 1.75 m.
const LARGEST_LINK_M: f64 = 3.0;

/// Vertices of the largest convex mesh that stays one.
const MOST_CONVEX_VERTICES: usize = 2000;

/// Whether engines will collide with a shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Use {
    /// They will: it needs convex pieces.
    Collision,
    /// Only distances to its surface are wanted.
    Distance,
}

/// The shape of a sound, closed surface, and what to say about it.
///
/// A convex one is the exact hull; all others are their own surface and have convex pieces for the
/// engines.
pub(crate) fn shape_of_surface(
    surface: TriangleMesh,
    purpose: Use,
) -> Result<(Shape, Option<Fidelity>), String> {
    let small = surface.vertices_m.len() <= MOST_CONVEX_VERTICES;
    if small && is_convex(&surface) {
        // Where rounding breaks the hull, as points in rings and planes can, the surface itself is
        // convex already; it only has corners more than it needs.
        let hull = convex_hull(&surface.vertices_m).unwrap_or(ConvexMesh(surface));
        return Ok((Shape::Convex(Arc::new(hull)), None));
    }
    if purpose == Use::Distance {
        let pieces = Vec::new();
        return Ok((Shape::Mesh(Arc::new(SolidMesh { surface, pieces })), None));
    }
    let index = SurfaceIndex::new(surface);
    let (pieces, fidelity) = pieces_of(&index);
    if pieces.is_empty() {
        return Err("it has no convex hull with a volume".to_owned());
    }
    let surface = index.into_mesh();
    let shape = Shape::Mesh(Arc::new(SolidMesh { surface, pieces }));
    Ok((shape, Some(fidelity)))
}

/// The shape of a link's collision mesh, and what to say about it.
///
/// Meshes of robots come from CAD with seams: corners on the edges of neighbours, slivers that lost
/// their area. They are mended, and said to be, as long as that adds hardly any surface. A mesh
/// that is open beyond that, or inside out, stands as its convex hull, which contains it.
pub(crate) fn shape_of_link(
    mesh: &TriangleMesh,
    link: &str,
) -> Result<(Shape, Vec<String>), String> {
    let largest_m = size_m(mesh).max();
    if largest_m > LARGEST_LINK_M {
        return Err(format!(
            "it is {largest_m:.1} m large: is it in millimetres? Then set \
             scale=\"0.001 0.001 0.001\""
        ));
    }
    let hull_of = |mesh: &TriangleMesh, why: String| {
        let hull = convex_hull(&mesh.vertices_m).or_else(|_| robust_hull(&mesh.vertices_m, 0.0))?;
        let note = format!(
            "collision mesh of '{link}' is used as its convex hull ({} vertices), which contains \
             it{why}",
            hull.0.vertices_m.len()
        );
        Ok((Shape::Convex(Arc::new(hull)), vec![note]))
    };
    let open = check::open_edges(mesh);
    let mended = mend(mesh.clone());
    if mended.filled_share > MENDABLE {
        return hull_of(
            mesh,
            format!(
                ": its surface is open ({open} edges, {:.0} % of the surface is missing)",
                mended.filled_share * 1e2
            ),
        );
    }
    if let Some(inverted) = check::inverted(&mended.mesh) {
        return hull_of(mesh, format!(": {inverted}"));
    }
    if volume_m3(&mended.mesh) <= 0.0 {
        return hull_of(mesh, ": its surface encloses no volume".to_owned());
    }
    let triangles = mended.mesh.triangles.len();
    let (shape, fidelity) = shape_of_surface(mended.mesh, Use::Collision)?;
    let mut notes = Vec::new();
    if mended.loops > 0 {
        notes.push(format!(
            "collision mesh of '{link}': {} seams ({open} open edges) were closed, which added \
             {:.3} % to its surface",
            mended.loops,
            mended.filled_share * 1e2
        ));
    }
    notes.push(match fidelity {
        None => format!(
            "collision mesh of '{link}' is convex: it is used as its convex hull ({} vertices)",
            match &shape {
                Shape::Convex(hull) => hull.0.vertices_m.len(),
                _ => 0,
            }
        ),
        Some(found) => format!(
            "collision mesh of '{link}' ({triangles} triangles): {}",
            found.in_words()
        ),
    });
    Ok((shape, notes))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use nalgebra::Point3;

    use super::super::test_meshes::{bowl, cuboid, ell, inverted};
    use super::*;

    fn link(mesh: &TriangleMesh) -> (Shape, Vec<String>) {
        shape_of_link(mesh, "forearm_link").unwrap()
    }

    #[test]
    fn convex_mesh_is_its_hull() {
        let (shape, notes) = link(&cuboid([0.03, 0.02, 0.01]));
        assert!(matches!(shape, Shape::Convex(_)), "{shape:?}");
        assert!(notes[0].contains("convex hull (8 vertices)"), "{notes:?}");
    }

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
    fn hollow_mesh_is_its_surface_and_has_pieces() {
        let (shape, notes) = link(&ell());
        let Shape::Mesh(mesh) = shape else {
            panic!("{shape:?}")
        };
        assert_eq!(mesh.surface, ell());
        assert_eq!(mesh.pieces.len(), 2);
        assert!(notes[0].contains("2 convex pieces"), "{notes:?}");
    }

    #[test]
    fn seam_is_closed_and_told() {
        let mut mesh = super::super::test_meshes::torus(48, 24);
        mesh.triangles.remove(100);
        let (shape, notes) = link(&mesh);
        let Shape::Mesh(solid) = shape else {
            panic!("{shape:?}")
        };
        assert_eq!(solid.surface.triangles.len(), mesh.triangles.len() + 1);
        assert!(
            notes[0].contains("1 seams (3 open edges) were closed"),
            "{notes:?}"
        );
    }

    #[test]
    fn open_mesh_and_one_inside_out_stand_as_their_hulls_and_it_is_told() {
        let mut open = ell();
        open.triangles.truncate(18);
        let (shape, notes) = link(&open);
        assert!(matches!(shape, Shape::Convex(_)));
        assert!(notes[0].contains("its surface is open"), "{notes:?}");
        let (shape, notes) = link(&inverted(bowl()));
        assert!(matches!(shape, Shape::Convex(_)));
        assert!(notes[0].contains("inside out"), "{notes:?}");
    }

    #[test]
    fn link_in_millimetres_is_refused_with_the_scale() {
        let mut mesh = ell();
        for vertex in &mut mesh.vertices_m {
            *vertex *= 1e3;
        }
        let why = shape_of_link(&mesh, "forearm_link").unwrap_err();
        assert!(
            why.contains("100.0 m") && why.contains("scale=\"0.001"),
            "{why}"
        );
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
