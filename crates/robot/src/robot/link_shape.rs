//! From a link's collision mesh to its shape.

use std::sync::Arc;

use needlebench_geometry::mesh::{
    HullError, check_thickness, convex_hull, inverted_part, mend, open_edges, size_m, volume_m3,
};
use needlebench_geometry::{Shape, TriangleMesh};

/// Share of a surface that mending may add.
const MENDABLE: f64 = 0.01;

/// Size of a link above which its mesh is in another unit, m: the largest arm reaches 1.75 m.
const LARGEST_LINK_M: f64 = 3.0;

/// Size of a link below which its mesh is in another unit, m: less than any part that one collides with.
const SMALLEST_LINK_M: f64 = 1e-3;

/// Why a mesh is no shape of a link.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum LinkShapeError {
    #[error(
        "it is {largest_m:.1} m large: if it is in millimetres, set scale=\"0.001 0.001 0.001\""
    )]
    TooLarge { largest_m: f64 },
    #[error("it is {largest_mm:.4} mm large: if it is already in metres, omit the scale")]
    TooSmall { largest_mm: f64 },
    #[error(transparent)]
    Hull(#[from] HullError),
}

/// The shape of a link's collision mesh, and what to say about it.
///
/// Meshes of robots come from CAD with seams: corners on the edges of neighbours, slivers that lost
/// their area. They are mended, and said to be, as long as that adds hardly any surface. A mesh
/// that is open beyond that, or inside out, stands as its convex hull, which contains it.
pub(crate) fn shape_of_link(
    mesh: &TriangleMesh,
    link: &str,
) -> Result<(Shape, Vec<String>), LinkShapeError> {
    let largest_m = size_m(mesh).max();
    if largest_m > LARGEST_LINK_M {
        return Err(LinkShapeError::TooLarge { largest_m });
    }
    if largest_m < SMALLEST_LINK_M {
        return Err(LinkShapeError::TooSmall {
            largest_mm: largest_m * 1e3,
        });
    }
    let hull_of = |mesh: &TriangleMesh, why: String| {
        let hull = convex_hull(&mesh.vertices_m)?;
        let note = format!(
            "collision mesh of '{link}' is used as its convex hull ({} vertices), which contains \
             it{why}",
            hull.0.vertices_m.len()
        );
        Ok((Shape::Convex(Arc::new(hull)), vec![note]))
    };
    let open = open_edges(mesh);
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
    if let Some(inverted) = inverted_part(&mended.mesh) {
        return hull_of(mesh, format!(": {inverted}"));
    }
    if volume_m3(&mended.mesh) <= 0.0 {
        return hull_of(mesh, ": its surface encloses no volume".to_owned());
    }
    let triangles = mended.mesh.triangles.len();
    check_thickness(&mended.mesh.vertices_m)?;
    let shape = Shape::of_surface(mended.mesh);
    let mut notes = Vec::new();
    if mended.loops > 0 {
        notes.push(format!(
            "collision mesh of '{link}': {} seams ({open} open edges) were closed, which added \
             {:.3} % to its surface",
            mended.loops,
            mended.filled_share * 1e2
        ));
    }
    notes.push(match &shape {
        Shape::Convex(hull) => format!(
            "collision mesh of '{link}' is convex: it is used as its convex hull ({} vertices)",
            hull.0.vertices_m.len()
        ),
        _ => format!("collision mesh of '{link}' is used as it is ({triangles} triangles)"),
    });
    Ok((shape, notes))
}

#[cfg(test)]
mod tests {
    use needlebench_geometry::sample_solids::{bowl, cuboid, ell, inverted, torus};

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

    #[test]
    fn hollow_mesh_is_its_surface_and_has_pieces() {
        let (shape, notes) = link(&ell());
        let Shape::Mesh(mesh) = shape else {
            panic!("{shape:?}")
        };
        assert_eq!(*mesh.surface(), ell());
        assert_eq!(mesh.pieces().hulls.len(), 2);
        assert!(notes[0].contains("as it is (20 triangles)"), "{notes:?}");
    }

    #[test]
    fn seam_is_closed_and_told() {
        let mut mesh = torus(48, 24);
        mesh.triangles.remove(100);
        let (shape, notes) = link(&mesh);
        let Shape::Mesh(solid) = shape else {
            panic!("{shape:?}")
        };
        assert_eq!(solid.surface().triangles.len(), mesh.triangles.len() + 1);
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
        let why = shape_of_link(&mesh, "forearm_link")
            .unwrap_err()
            .to_string();
        assert!(
            why.contains("100.0 m") && why.contains("scale=\"0.001"),
            "{why}"
        );
    }
}
