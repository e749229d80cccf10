//! What takes a while to make of a mesh, kept in the user's cache folder: its tree here, its pieces in
//! [`pieces`](super::pieces).
//!
//! A file is named by a hash of all that it is made from, version included, and holds the hash of its
//! contents; it is written whole or not at all. What cannot be read or written, or is damaged, only costs
//! time. Folders are bounded: the oldest files make room. A hash that lies beside what it is of shows damage, not intent:
//! a folder that others may write to is not read.

use std::env;
use std::fmt::{self, Write as _};
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use crate::encoding::encode;
use crate::tree::TriangleTree;
use crate::triangle_mesh::TriangleMesh;

/// What is kept of meshes.
pub(super) struct Kind<T> {
    /// Folder of its files.
    pub folder: &'static str,
    /// First bytes of a file, and of what its name is the hash of: changes whenever what is made does.
    pub version: &'static [u8],
    /// Meshes with fewer triangles are not worth a file.
    pub worth_keeping: usize,
    pub encode: fn(&T) -> Vec<u8>,
    pub decode: fn(&[u8], &TriangleMesh) -> Option<T>,
}

/// Trees of triangles.
const TREES: Kind<TriangleTree> = Kind {
    folder: "trees",
    version: b"needlebench tree 2\n",
    worth_keeping: 10_000,
    encode: TriangleTree::encoded,
    decode: TriangleTree::decoded,
};

/// Most bytes of a folder.
const MOST_BYTES: u64 = 1 << 28;

/// The tree of a mesh.
pub(super) fn tree_of(mesh: &TriangleMesh) -> TriangleTree {
    kept(&TREES, mesh, || TriangleTree::new(mesh))
}

/// From the cache if it is there, with the same bits.
pub(super) fn kept<T>(kind: &Kind<T>, mesh: &TriangleMesh, make: impl FnOnce() -> T) -> T {
    let cache = folder().filter(|_| mesh.triangles.len() >= kind.worth_keeping);
    let Some(cache) = cache else {
        return make();
    };
    kept_in(&cache.join(kind.folder), kind, mesh, make)
}

fn kept_in<T>(folder: &Path, kind: &Kind<T>, mesh: &TriangleMesh, make: impl FnOnce() -> T) -> T {
    let path = folder.join(name_of(kind.version, mesh));
    let known = match other_writers(folder) {
        Ok(None) => fs::read(&path).ok(),
        Ok(Some(OtherWriters::Owner { .. })) => return make(),
        // Of a version that did not keep it private, or for all to fill: begun anew.
        Ok(Some(OtherWriters::Mode(_))) => fs::remove_dir_all(folder).ok().and(None),
        Err(_) => None,
    };
    if let Some(known) = known.and_then(|bytes| opened(kind, mesh, &bytes)) {
        return known;
    }
    let made = make();
    // Nothing is lost but the time that it would have saved.
    let _ = keep(folder, &path, &sealed(kind, &made));
    made
}

/// Version, hash of the rest, the rest.
fn sealed<T>(kind: &Kind<T>, thing: &T) -> Vec<u8> {
    let rest = (kind.encode)(thing);
    [kind.version, &Sha256::digest(&rest), &rest].concat()
}

fn opened<T>(kind: &Kind<T>, mesh: &TriangleMesh, bytes: &[u8]) -> Option<T> {
    let hashed = bytes.strip_prefix(kind.version)?;
    let (hash, rest) = hashed.split_at_checked(32)?;
    if Sha256::digest(rest).as_slice() != hash {
        return None;
    }
    (kind.decode)(rest, mesh)
}

/// Writes a file that others may look for at the same time: whole or not at all.
fn keep(folder: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    private_folder(folder)?;
    let mut file = NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path)?;
    make_room(folder, MOST_BYTES)
}

/// A folder that its owner alone looks into: surfaces of patients are kept here.
fn private_folder(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::DirBuilderExt;
        builder.mode(0o700);
    }
    builder.create(folder)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Made by a version that did not keep it private.
        fs::set_permissions(folder, fs::Permissions::from_mode(0o700))?;
    }
    Ok(())
}

/// Who else may have put what lies in a folder there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OtherWriters {
    /// It belongs to another user than this one and root.
    Owner {
        /// Number of the one that it belongs to.
        owner: u32,
        /// Number of this one.
        user: u32,
    },
    /// A group or everybody may write to it: the bits of its mode.
    Mode(u32),
}

impl fmt::Display for OtherWriters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Owner { owner, user } => {
                write!(f, "belongs to user {owner}, and this is user {user}")
            }
            Self::Mode(mode) => write!(f, "is writable by others (mode {mode:03o})"),
        }
    }
}

/// Who else may have put what lies in a folder there; `None` is nobody, as far as the system tells.
///
/// # Errors
/// The folder cannot be asked about, as one that does not exist.
pub fn other_writers(folder: &Path) -> io::Result<Option<OtherWriters>> {
    let metadata = fs::metadata(folder)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let (owner, user) = (metadata.uid(), rustix::process::geteuid().as_raw());
        if owner != user && owner != 0 {
            return Ok(Some(OtherWriters::Owner { owner, user }));
        }
        let mode = metadata.mode() & 0o777;
        if mode & 0o022 != 0 {
            return Ok(Some(OtherWriters::Mode(mode)));
        }
    }
    #[cfg(not(unix))]
    let _ = metadata;
    Ok(None)
}

/// Folders of what is kept of meshes, and how many bytes they hold.
pub fn kept_meshes() -> Vec<(PathBuf, u64)> {
    let Some(folder) = folder() else {
        return Vec::new();
    };
    let size = |folder: &Path| -> io::Result<u64> {
        fs::read_dir(folder)?
            .map(|entry| Ok(entry?.metadata()?.len()))
            .sum()
    };
    KEPT.map(|name| folder.join(name))
        .into_iter()
        .filter_map(|folder| {
            let bytes = size(&folder).ok()?;
            Some((folder, bytes))
        })
        .collect()
}

/// Removes what is kept of meshes: it is made again where it is needed.
///
/// # Errors
/// What cannot be removed.
pub fn forget_kept_meshes() -> io::Result<()> {
    for (folder, _) in kept_meshes() {
        fs::remove_dir_all(folder)?;
    }
    Ok(())
}

/// Folders of all kinds.
const KEPT: [&str; 2] = [TREES.folder, PIECES_FOLDER];

/// Folder of the pieces.
pub(super) const PIECES_FOLDER: &str = "pieces";

/// Removes the files that were written first, as long as there is more than `most_bytes`.
fn make_room(folder: &Path, most_bytes: u64) -> io::Result<()> {
    let mut files: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let about = entry.metadata()?;
        files.push((about.modified()?, about.len(), entry.path()));
    }
    files.sort();
    let mut bytes: u64 = files.iter().map(|file| file.1).sum();
    for (_, size, path) in files {
        if bytes <= most_bytes {
            break;
        }
        fs::remove_file(path)?;
        bytes -= size;
    }
    Ok(())
}

/// Name of the file of a mesh: a hash of what it is made of.
fn name_of(version: &[u8], mesh: &TriangleMesh) -> String {
    let mut name = String::with_capacity(64);
    for byte in Sha256::digest([version, &encode(mesh)].concat()) {
        write!(name, "{byte:02x}").expect("a string takes all");
    }
    name
}

/// `NEEDLEBENCH_CACHE_DIR`, or else `needlebench` in the user's cache folder.
fn folder() -> Option<PathBuf> {
    let variable = |name: &str| env::var_os(name).filter(|value| !value.is_empty());
    variable("NEEDLEBENCH_CACHE_DIR")
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
        })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::sample_solids::{bowl, ell, torus};

    /// A folder with the file of one mesh, asked for once.
    fn filled<T: PartialEq + std::fmt::Debug>(
        kind: &Kind<T>,
        mesh: &TriangleMesh,
        make: impl Fn() -> T,
    ) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(kept_in(folder.path(), kind, mesh, &make), make());
        let path = folder.path().join(name_of(kind.version, mesh));
        (folder, path)
    }

    /// What is kept has the same bits as what is made, is not made again, and is made anew wherever its file
    /// was damaged.
    pub fn is_kept<T: PartialEq + std::fmt::Debug>(
        kind: &Kind<T>,
        mesh: &TriangleMesh,
        make: impl Fn() -> T,
    ) {
        let (folder, path) = filled(kind, mesh, &make);
        let again = || kept_in(folder.path(), kind, mesh, || panic!("it is there"));
        assert_eq!(again(), make());
        let sound = fs::read(&path).unwrap();
        let cut = sound[..sound.len() - 1].to_vec();
        let longer = [&sound[..], &[0]].concat();
        let mut turned = Vec::new();
        for at in [0, kind.version.len(), sound.len() / 2, sound.len() - 1] {
            let mut bytes = sound.clone();
            bytes[at] ^= 1;
            turned.push(bytes);
        }
        for broken in turned.into_iter().chain([cut, longer, Vec::new()]) {
            fs::write(&path, broken).unwrap();
            let mut made = false;
            let found = kept_in(folder.path(), kind, mesh, || {
                made = true;
                make()
            });
            assert!(made);
            assert_eq!(found, make());
            assert_eq!(fs::read(&path).unwrap(), sound, "the file is mended");
        }
    }

    #[test]
    fn trees_come_back_with_the_same_bits_and_damage_is_seen() {
        for mesh in [ell(), bowl(), torus(24, 12)] {
            is_kept(&TREES, &mesh, || TriangleTree::new(&mesh));
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_others_may_have_written_is_not_read() {
        use std::os::unix::fs::PermissionsExt;
        let mesh = ell();
        let (folder, path) = filled(&TREES, &mesh, || TriangleTree::new(&mesh));
        let wrong = TriangleTree::new(&bowl());
        fs::write(&path, sealed(&TREES, &wrong)).unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).unwrap();
        let found = kept_in(folder.path(), &TREES, &mesh, || TriangleTree::new(&mesh));
        assert_eq!(found, TriangleTree::new(&mesh));
        let again = || kept_in(folder.path(), &TREES, &mesh, || panic!("it is there"));
        assert_eq!(again(), found);
        assert_eq!(other_writers(folder.path()).unwrap(), None);
    }

    #[test]
    fn another_mesh_has_another_file() {
        let (one, mut other) = (ell(), ell());
        other.vertices_m[3].x += 1e-15;
        assert_ne!(one, other);
        assert_ne!(name_of(b"1", &one), name_of(b"1", &other));
        assert_ne!(name_of(b"1", &one), name_of(b"2", &one));
    }

    /// Beginning of the hash of the file of a thing, in hexadecimal digits. A file that no longer says what is
    /// made now would be a wrong answer: who changes what is made changes its version, and this.
    pub fn hash_of<T>(kind: &Kind<T>, thing: &T) -> String {
        let hash = Sha256::digest(sealed(kind, thing));
        let mut text = String::new();
        for byte in &hash[..8] {
            write!(text, "{byte:02x}").unwrap();
        }
        text
    }

    #[test]
    fn the_version_of_trees_changes_with_them() {
        let mesh = ell();
        let tree = TriangleTree::new(&mesh);
        assert_eq!(hash_of(&TREES, &tree), "8e0aa9e422ed283e");
    }

    #[test]
    fn the_oldest_files_make_room() {
        let folder = tempfile::tempdir().unwrap();
        for (age, name) in ["c", "a", "d", "b"].into_iter().enumerate() {
            let path = folder.path().join(name);
            fs::write(&path, [0; 100]).unwrap();
            let written = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(age as u64);
            let file = fs::File::options().write(true).open(path).unwrap();
            file.set_modified(written).unwrap();
        }
        make_room(folder.path(), 250).unwrap();
        let mut left: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["b", "d"]);
    }
}
