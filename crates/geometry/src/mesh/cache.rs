//! Convex pieces kept in the user's cache folder, as making them takes a while.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use nalgebra::Point3;
use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use super::decompose::decompose;
use super::fidelity::Fidelity;
use super::surface_index::SurfaceIndex;
use crate::shape::{ConvexMesh, TriangleMesh};

/// First bytes of a file, and of what its name is the hash of: changes whenever the pieces do.
const VERSION: &[u8] = b"needlebench pieces 2\n";

/// Meshes with fewer triangles are not worth a file.
const WORTH_KEEPING: usize = 500;

/// Pieces of a solid and how well they stand for it: from the cache if they are there, with the
/// same bits. A cache that cannot be read or written, or that is damaged, only costs time.
pub(super) fn pieces_of(solid: &SurfaceIndex) -> (Vec<ConvexMesh>, Fidelity) {
    let make = || {
        let pieces = decompose(solid);
        let fidelity = Fidelity::measure(solid, &pieces);
        (pieces, fidelity)
    };
    if solid.mesh().triangles.len() < WORTH_KEEPING {
        return make();
    }
    let Some(folder) = folder() else {
        return make();
    };
    let path = folder.join(name_of(solid.mesh()));
    if let Some(known) = fs::read(&path).ok().and_then(|bytes| decoded(&bytes)) {
        return known;
    }
    let (pieces, fidelity) = make();
    // Nothing is lost but the time that it would have saved.
    let _ = keep(&folder, &path, &encoded(&pieces, &fidelity));
    (pieces, fidelity)
}

/// Writes a file that others may look for at the same time: whole or not at all.
fn keep(folder: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut file = NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path)?;
    Ok(())
}

/// Name of the file with the pieces of a mesh: a hash of what they are made of.
fn name_of(mesh: &TriangleMesh) -> String {
    let digest = Sha256::digest(mesh_bytes(VERSION, mesh));
    let mut name = String::with_capacity(64);
    for byte in digest {
        write!(name, "{byte:02x}").expect("a string takes all");
    }
    name
}

/// `pieces` in `NEEDLEBENCH_CACHE_DIR`, or else in `needlebench` in the user's cache folder.
fn folder() -> Option<PathBuf> {
    let variable = |name: &str| env::var_os(name).filter(|value| !value.is_empty());
    let cache = variable("NEEDLEBENCH_CACHE_DIR")
        .map(PathBuf::from)
        .or_else(|| {
            let user = if cfg!(windows) {
                variable("LOCALAPPDATA").map(PathBuf::from)
            } else {
                let home = variable("HOME").map(PathBuf::from);
                let below = if cfg!(target_os = "macos") {
                    "Library/Caches"
                } else {
                    ".cache"
                };
                let named = variable("XDG_CACHE_HOME").map(PathBuf::from);
                named
                    .filter(|path| path.is_absolute())
                    .or(home.map(|home| home.join(below)))
            };
            user.map(|user| user.join("needlebench"))
        });
    cache.map(|cache| cache.join("pieces"))
}

fn mesh_bytes(start: &[u8], mesh: &TriangleMesh) -> Vec<u8> {
    let mut bytes = start.to_vec();
    for count in [mesh.vertices_m.len(), mesh.triangles.len()] {
        bytes.extend((count as u64).to_le_bytes());
    }
    let numbers = mesh
        .vertices_m
        .iter()
        .flat_map(|vertex| [vertex.x, vertex.y, vertex.z]);
    bytes.extend(numbers.flat_map(f64::to_le_bytes));
    let indices = mesh.triangles.iter().flatten();
    bytes.extend(indices.flat_map(|index| index.to_le_bytes()));
    bytes
}

/// Version, hash of the rest, fidelity, number of pieces, pieces.
fn encoded(pieces: &[ConvexMesh], fidelity: &Fidelity) -> Vec<u8> {
    let numbers = [
        fidelity.overhang_m,
        fidelity.mean_overhang_m,
        fidelity.uncovered_m,
        fidelity.spacing_m,
    ];
    let mut rest: Vec<u8> = numbers.into_iter().flat_map(f64::to_le_bytes).collect();
    rest.extend((pieces.len() as u64).to_le_bytes());
    for piece in pieces {
        rest = mesh_bytes(&rest, &piece.0);
    }
    [VERSION, &Sha256::digest(&rest), &rest].concat()
}

fn decoded(bytes: &[u8]) -> Option<(Vec<ConvexMesh>, Fidelity)> {
    let hashed = bytes.strip_prefix(VERSION)?;
    let (hash, rest) = hashed.split_at_checked(32)?;
    if Sha256::digest(rest).as_slice() != hash {
        return None;
    }
    let mut reader = Reader(rest);
    let [overhang_m, mean_overhang_m, uncovered_m, spacing_m] = [
        reader.number()?,
        reader.number()?,
        reader.number()?,
        reader.number()?,
    ];
    let count = reader.count()?;
    let pieces: Vec<ConvexMesh> = (0..count)
        .map(|_| {
            let (vertices, triangles) = (reader.count()?, reader.count()?);
            let vertices_m = (0..vertices)
                .map(|_| {
                    Some(Point3::new(
                        reader.number()?,
                        reader.number()?,
                        reader.number()?,
                    ))
                })
                .collect::<Option<_>>()?;
            let triangles = (0..triangles)
                .map(|_| Some([reader.index()?, reader.index()?, reader.index()?]))
                .collect::<Option<_>>()?;
            Some(ConvexMesh(TriangleMesh {
                vertices_m,
                triangles,
            }))
        })
        .collect::<Option<_>>()?;
    let fidelity = Fidelity {
        pieces: pieces.len(),
        overhang_m,
        mean_overhang_m,
        uncovered_m,
        spacing_m,
    };
    reader.0.is_empty().then_some((pieces, fidelity))
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    fn number(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn index(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn count(&mut self) -> Option<usize> {
        self.take()
            .and_then(|bytes| usize::try_from(u64::from_le_bytes(bytes)).ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_solids::ell;

    #[test]
    fn pieces_come_back_with_the_same_bits_and_damage_is_seen() {
        let solid = SurfaceIndex::new(ell());
        let pieces = decompose(&solid);
        let fidelity = Fidelity::measure(&solid, &pieces);
        let mut bytes = encoded(&pieces, &fidelity);
        assert_eq!(decoded(&bytes), Some((pieces, fidelity)));
        assert_eq!(decoded(&bytes[..bytes.len() - 1]), None);
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        assert_eq!(decoded(&bytes), None);
    }
}
