//! Convex pieces of solids that are not convex: what engines collide with.

use needlebench_cell::Cell;
use needlebench_geometry::{ConvexMesh, Shape, Solid, SolidMesh};

use crate::EngineError;

/// The convex pieces of a mesh, which an engine needs.
pub(crate) fn convex_pieces<'a>(
    solid: &Solid,
    mesh: &'a SolidMesh,
) -> Result<&'a [ConvexMesh], EngineError> {
    let hulls = &mesh.pieces().hulls;
    if hulls.is_empty() {
        return Err(EngineError::BadSolid {
            solid: solid.name.clone(),
            reason: "its mesh has no convex pieces to collide with",
        });
    }
    Ok(hulls)
}

/// How well the pieces that engines collide with stand for their solids: a sentence for each solid of the cell
/// that has some. Pieces that no engine has asked for yet are made.
pub fn pieces_in_words(cell: &Cell) -> Vec<String> {
    let collides = |body: usize| {
        let mut pairs = cell.pairs.iter();
        pairs.any(|pair| pair.class.is_physical() && [pair.a, pair.b].contains(&body))
    };
    let bodies = cell.bodies.iter().enumerate();
    bodies
        .filter(|(index, _)| collides(*index))
        .flat_map(|(_, body)| &body.solids)
        .filter_map(|solid| match &solid.shape {
            Shape::Mesh(mesh) => {
                let fidelity = mesh.pieces().fidelity.in_words();
                Some(format!("`{}`: {fidelity}", solid.name))
            }
            _ => None,
        })
        .collect()
}
