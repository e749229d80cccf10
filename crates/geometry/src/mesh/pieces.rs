//! Convex pieces of a solid, kept from one run to the next.

use serde::{Deserialize, Serialize};

use super::cache::{Kind, PIECES_FOLDER, kept};
use super::decompose::decompose;
use super::fidelity::Fidelity;
use super::surface_index::SurfaceIndex;
use crate::encoding::{decode, encode};
use crate::triangle_mesh::ConvexMesh;

/// Convex pieces that together approximate a solid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConvexPieces {
    /// The pieces; none if neither the solid nor a part of it has a hull with a volume.
    pub hulls: Vec<ConvexMesh>,
    /// Their fidelity.
    pub fidelity: Fidelity,
}

const PIECES: Kind<ConvexPieces> = Kind {
    folder: PIECES_FOLDER,
    version: b"needlebench pieces 4\n",
    worth_keeping: 500,
    encode,
    decode: |bytes, _| decode(bytes),
};

/// Pieces of a solid and their fidelity.
pub(super) fn pieces_of(solid: &SurfaceIndex) -> ConvexPieces {
    kept(&PIECES, solid.mesh(), || {
        let hulls = decompose(solid);
        let fidelity = Fidelity::measure(solid, &hulls);
        ConvexPieces { hulls, fidelity }
    })
}

#[cfg(test)]
mod tests {
    use super::super::cache::tests::{hash_of, is_kept};
    use super::*;
    use crate::sample_solids::ell;

    #[test]
    fn pieces_come_back_with_the_same_bits_and_damage_is_seen() {
        let solid = SurfaceIndex::new(ell());
        is_kept(&PIECES, solid.mesh(), || {
            let hulls = decompose(&solid);
            let fidelity = Fidelity::measure(&solid, &hulls);
            ConvexPieces { hulls, fidelity }
        });
    }

    #[test]
    fn the_version_changes_with_the_pieces() {
        let solid = SurfaceIndex::new(ell());
        let pieces = pieces_of(&solid);
        assert_eq!(hash_of(&PIECES, &pieces), "b0aad05fe2dad8e8");
    }
}
