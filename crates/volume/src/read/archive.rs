//! ZIP archives: unpacked into a folder of their own, which is read as any other, and removed.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use tempfile::TempDir;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::format::{Format, format_of};
use super::{ReadOptions, dicom, in_mib, unreadable};
use crate::VolumeError;

/// First bytes of an archive, and of one without files.
const MARKS: [&[u8]; 2] = [b"PK\x03\x04", b"PK\x05\x06"];

/// Files that an archive may hold.
const FILES: usize = 200_000;

/// Bytes unpacked at a time.
const PIECE: usize = 1 << 17;

/// The folder in which macOS stores what Windows and Linux do not have of a file.
const OF_MACOS: &str = "__MACOSX";

/// Methods of compression that few programs use.
const METHODS: [(CompressionMethod, &str); 6] = [
    (CompressionMethod::DEFLATE64, "Deflate64"),
    (CompressionMethod::BZIP2, "bzip2"),
    (CompressionMethod::LZMA, "LZMA"),
    (CompressionMethod::ZSTD, "Zstandard"),
    (CompressionMethod::XZ, "xz"),
    (CompressionMethod::PPMD, "PPMd"),
];

const UNPACK: &str = "unpack it, and name the DICOM folder or the volume in it";

/// What was in an archive, for as long as this is there.
pub(super) struct Unpacked {
    /// A folder of DICOM files, or a file of any format.
    path: PathBuf,
    _folder: TempDir,
}

impl Unpacked {
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

/// The content of a path that is a ZIP archive; none of any other.
pub(super) fn unpacked(
    path: &Path,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<Option<Unpacked>, VolumeError> {
    if !path.metadata().map_err(unreadable)?.is_file() || !is_archive(path)? {
        return Ok(None);
    }
    let file = File::open(path).map_err(unreadable)?;
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(damaged)?;
    if archive.len() > FILES {
        return Err(
            VolumeError::refused(format!("the ZIP archive holds more than {FILES} files"))
                .hint("unpack it, and name the folder of one study or series"),
        );
    }
    if archive.has_duplicate_names() {
        // Of files with one name the last alone would be seen: slices would be missing.
        return Err(VolumeError::refused(
            "several files of the ZIP archive have the same name: unpacked, they would replace each other",
        )
        .hint("export it again, each file with a name of its own"));
    }
    let folder = tempfile::Builder::new()
        .prefix("needlebench-")
        .tempdir()
        .map_err(not_written)?;
    let mut files = Vec::new();
    let mut left = options.max_bytes;
    for at in 0..archive.len() {
        let name = name_of(&mut archive, at)?;
        let Some(name) = name else { continue };
        let shown = name.display().to_string();
        let target = folder.path().join(&name);
        let unpack = unpack(&mut archive, at, &target, &mut left, options, cancel);
        unpack.map_err(|problem| problem.at(shown))?;
        files.push(target);
    }
    files.sort();
    let path = content(folder.path(), &files)?;
    Ok(Some(Unpacked {
        path,
        _folder: folder,
    }))
}

fn is_archive(path: &Path) -> Result<bool, VolumeError> {
    let mut first = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(dicom::FIRST_BYTES)
        .read_to_end(&mut first)
        .map_err(unreadable)?;
    // A preamble of DICOM may be anything.
    Ok(MARKS.iter().any(|mark| first.starts_with(mark)) && !dicom::has_mark(&first))
}

/// Where a file of an archive is to be; none of folders, links and what is hidden.
fn name_of(
    archive: &mut ZipArchive<BufReader<File>>,
    at: usize,
) -> Result<Option<PathBuf>, VolumeError> {
    let entry = archive.by_index_raw(at).map_err(damaged)?;
    if entry.is_dir() || entry.is_symlink() {
        return Ok(None);
    }
    let name = entry.enclosed_name().ok_or_else(|| {
        VolumeError::refused("a file of the ZIP archive has a name outside of it").hint(UNPACK)
    })?;
    let is_hidden = |part: Component| {
        part.as_os_str() == OF_MACOS || part.as_os_str().as_encoded_bytes().starts_with(b".")
    };
    if name.components().any(is_hidden) {
        return Ok(None);
    }
    if entry.encrypted() {
        return Err(VolumeError::refused("the ZIP archive is encrypted")
            .at(name.display().to_string())
            .hint("unpack it with its password, and name the folder"));
    }
    let method = entry.compression();
    if ![CompressionMethod::Stored, CompressionMethod::Deflated].contains(&method) {
        let known = METHODS.iter().find(|(known, _)| *known == method);
        let what = known.map_or(format!("{method:?}"), |(_, name)| (*name).to_owned());
        return Err(VolumeError::refused(format!(
            "the ZIP archive is compressed by {what}, which is not supported"
        ))
        .at(name.display().to_string())
        .hint(UNPACK));
    }
    Ok(Some(name))
}

/// Writes a file of an archive, of no more bytes than are left.
fn unpack(
    archive: &mut ZipArchive<BufReader<File>>,
    at: usize,
    target: &Path,
    left: &mut u64,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<(), VolumeError> {
    let too_large = || {
        VolumeError::refused(format!(
            "the files of the ZIP archive have more than the {} allowed",
            in_mib(options.max_bytes)
        ))
        .hint("unpack it and name the folder of one series, or raise the limit with --max-memory")
    };
    let mut entry = archive.by_index(at).map_err(damaged)?;
    if entry.size() > *left {
        return Err(too_large());
    }
    if let Some(folder) = target.parent() {
        fs::create_dir_all(folder).map_err(not_written)?;
    }
    let file = File::create_new(target).map_err(not_written)?;
    let mut file = BufWriter::new(file);
    let mut piece = vec![0; PIECE];
    loop {
        if cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        let got = entry
            .read(&mut piece)
            .map_err(|error| damaged(error.into()))?;
        if got == 0 {
            break;
        }
        // Whatever the archive states of it.
        *left = left.checked_sub(got as u64).ok_or_else(too_large)?;
        file.write_all(&piece[..got]).map_err(not_written)?;
    }
    file.flush().map_err(not_written)
}

fn damaged(error: ZipError) -> VolumeError {
    let again = "copy or download it again";
    match error {
        ZipError::UnsupportedArchive(ZipError::PASSWORD_REQUIRED) => {
            VolumeError::refused("the ZIP archive is encrypted")
                .hint("unpack it with its password, and name the folder")
        }
        ZipError::UnsupportedArchive(what) => {
            VolumeError::refused(format!("the ZIP archive is not supported: {what}")).hint(UNPACK)
        }
        error => VolumeError::refused(format!("the ZIP archive is damaged or cut off: {error}"))
            .hint(again),
    }
}

#[expect(clippy::needless_pass_by_value, reason = "errors are mapped by it")]
fn not_written(error: std::io::Error) -> VolumeError {
    VolumeError::refused(format!(
        "the ZIP archive cannot be unpacked into a temporary folder: {error}"
    ))
    .hint(UNPACK)
}

/// What is read of the files in a folder: all of it, where there is DICOM; else the only volume.
fn content(folder: &Path, files: &[PathBuf]) -> Result<PathBuf, VolumeError> {
    match files {
        [] => {
            return Err(VolumeError::refused("the ZIP archive has no files")
                .hint("copy or download it again"));
        }
        [only] => return Ok(only.clone()),
        _ => {}
    }
    let mut volumes = Vec::new();
    for file in files {
        match format_of(file) {
            Ok(Format::Dicom) => return Ok(folder.to_owned()),
            Ok(Format::Stored(_)) if !is_beside_header(file) => volumes.push(file),
            _ => {}
        }
    }
    match volumes.as_slice() {
        [] => Ok(folder.to_owned()),
        [only] => Ok((*only).clone()),
        [first, second, ..] => {
            let name = |file: &Path| {
                file.strip_prefix(folder)
                    .unwrap_or(file)
                    .display()
                    .to_string()
            };
            Err(VolumeError::refused(format!(
                "the ZIP archive holds {} volumes, such as {} and {}",
                volumes.len(),
                name(first),
                name(second)
            ))
            .hint("unpack it, and name one of them; the folder, if they are masks of one structure each"))
        }
    }
}

/// Whether a file has the voxels of a NIfTI header beside it.
fn is_beside_header(file: &Path) -> bool {
    file.extension() == Some(OsStr::new("img")) && file.with_extension("hdr").is_file()
}
