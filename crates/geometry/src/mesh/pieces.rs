//! Convex pieces of a solid, kept from one run to the next.

use super::cache::{Kind, kept};
use super::decompose::decompose;
use super::fidelity::Fidelity;
use super::surface_index::SurfaceIndex;
use crate::encoding::{Encode, Reader};
use crate::triangle_mesh::ConvexMesh;

/// Convex pieces that together stand for a solid.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexPieces {
    /// The pieces; none if neither the solid nor a part of it has a hull with a volume.
    pub hulls: Vec<ConvexMesh>,
    /// How well they stand for it.
    pub fidelity: Fidelity,
}

const PIECES: Kind<ConvexPieces> = Kind {
    folder: "pieces",
    version: b"needlebench pieces 3\n",
    worth_keeping: 500,
    encode: |pieces, _| encoded_pieces(pieces),
    decode: |reader, _| decoded_pieces(reader),
};

/// Pieces of a solid and how well they stand for it.
pub(super) fn pieces_of(solid: &SurfaceIndex) -> ConvexPieces {
    kept(&PIECES, solid.mesh(), || {
        let hulls = decompose(solid);
        let fidelity = Fidelity::measure(solid, &hulls);
        ConvexPieces { hulls, fidelity }
    })
}

/// Fidelity, number of pieces, pieces.
fn encoded_pieces(pieces: &ConvexPieces) -> Vec<u8> {
    let Fidelity {
        pieces: _,
        overhang_m,
        mean_overhang_m,
        uncovered_m,
        spacing_m,
    } = pieces.fidelity;
    let mut bytes = Vec::new();
    for number in [overhang_m, mean_overhang_m, uncovered_m, spacing_m] {
        number.encode(&mut bytes);
    }
    pieces.hulls.len().encode(&mut bytes);
    for hull in &pieces.hulls {
        hull.0.encode(&mut bytes);
    }
    bytes
}

fn decoded_pieces(reader: &mut Reader<'_>) -> Option<ConvexPieces> {
    let [overhang_m, mean_overhang_m, uncovered_m, spacing_m] = [
        reader.number()?,
        reader.number()?,
        reader.number()?,
        reader.number()?,
    ];
    let count = reader.count()?;
    let hulls = reader.list(count, 16, |reader| reader.mesh().map(ConvexMesh))?;
    let fidelity = Fidelity {
        pieces: hulls.len(),
        overhang_m,
        mean_overhang_m,
        uncovered_m,
        spacing_m,
    };
    Some(ConvexPieces { hulls, fidelity })
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
        assert_eq!(hash_of(&PIECES, solid.mesh(), &pieces), "55828a7291e64a72");
    }
}
