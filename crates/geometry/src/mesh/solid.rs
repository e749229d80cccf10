//! A solid that need not be convex.

use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::fidelity::Fidelity;
use super::pieces::{ConvexPieces, pieces_of};
use super::surface_index::SurfaceIndex;
use crate::tree::TriangleTree;
use crate::triangle_mesh::{ConvexMesh, TriangleMesh};

/// A solid that need not be convex: its exact surface, and convex pieces for the engines, which
/// collide with nothing else.
///
/// What takes a while, the tree that finds distances and the pieces, is made when it is first asked for.
#[derive(Debug, Clone)]
pub struct SolidMesh {
    index: SurfaceIndex,
    pieces: OnceLock<ConvexPieces>,
}

/// As its surface: the pieces are the engines'.
impl Serialize for SolidMesh {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.surface().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for SolidMesh {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        TriangleMesh::deserialize(deserializer).map(Self::new)
    }
}

impl PartialEq for SolidMesh {
    /// Solids with the same surface are the same unless they were given different pieces.
    fn eq(&self, other: &Self) -> bool {
        let same_pieces = match (self.pieces.get(), other.pieces.get()) {
            (Some(mine), Some(theirs)) => mine == theirs,
            _ => true,
        };
        self.surface() == other.surface() && same_pieces
    }
}

impl SolidMesh {
    /// The solid within a closed surface of at least one triangle.
    pub fn new(surface: TriangleMesh) -> Self {
        Self {
            index: SurfaceIndex::new(surface),
            pieces: OnceLock::new(),
        }
    }

    /// The same with convex pieces from elsewhere.
    pub fn with_pieces(surface: TriangleMesh, hulls: Vec<ConvexMesh>) -> Self {
        let index = SurfaceIndex::new(surface);
        let fidelity = Fidelity::measure(&index, &hulls);
        Self {
            index,
            pieces: OnceLock::from(ConvexPieces { hulls, fidelity }),
        }
    }

    /// Closed surface, the true one: clearances are measured to it.
    pub fn surface(&self) -> &TriangleMesh {
        self.index.mesh()
    }

    /// Its triangles in nested boxes.
    pub(crate) fn tree(&self) -> &Arc<TriangleTree> {
        self.index.tree()
    }

    /// Convex pieces that together approximate the solid in the engines. Seconds for a finely drawn surface,
    /// unless the user's cache folder has them.
    pub fn pieces(&self) -> &ConvexPieces {
        self.pieces.get_or_init(|| pieces_of(&self.index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_solids::ell;

    #[test]
    fn pieces_are_made_when_they_are_asked_for() {
        let solid = SolidMesh::new(ell());
        assert!(solid.pieces.get().is_none());
        assert_eq!(solid.pieces().hulls.len(), 2);
        assert_eq!(solid.pieces().fidelity.pieces, 2);
        assert_eq!(solid, SolidMesh::new(ell()));
        assert_ne!(solid, SolidMesh::with_pieces(ell(), Vec::new()));
    }
}
