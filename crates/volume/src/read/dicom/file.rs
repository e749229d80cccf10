//! One DICOM file: where it begins, how it is written, and what is in it.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::read::DeflateDecoder;

use super::dataset::{DataSet, Elements, Encoding, Pixels};
use super::syntax::{self, TransferSyntax};
use super::tag;
use crate::VolumeError;
use crate::read::unreadable;

/// Bytes by which a file is told from others.
pub(in crate::read) const FIRST_BYTES: u64 = 256;

/// Length of the preamble and of the mark behind it.
const PREAMBLE: usize = 128;
const MARK: &[u8] = b"DICM";

/// Bytes read from the disk at a time: most headers are shorter.
const BUFFER: usize = 1 << 13;

/// What is read of a file before its pixels.
#[derive(Debug)]
pub(super) struct OpenedFile {
    pub(super) data: DataSet,
    pub(super) pixels: Option<Pixels>,
    pub(super) syntax: TransferSyntax,
    /// What kind of object it says that it is, before all else.
    pub(super) sop_class: Option<String>,
    /// What had to be assumed to read it.
    pub(super) assumed: Option<&'static str>,
}

/// Bytes to read and to seek in.
pub(super) trait Bytes: Read + Seek {}

impl<T: Read + Seek> Bytes for T {}

/// Whether bytes begin as a DICOM file does, with or without its preamble.
pub(in crate::read) fn is_dicom(first: &[u8]) -> bool {
    begin(first).is_some()
}

/// Whether the first bytes are a preamble and the mark of DICOM, whatever the preamble says: it may be that of a TIFF.
pub(in crate::read) fn has_mark(first: &[u8]) -> bool {
    first.get(PREAMBLE..PREAMBLE + MARK.len()) == Some(MARK)
}

/// Where the elements begin.
fn begin(first: &[u8]) -> Option<usize> {
    if has_mark(first) {
        return Some(PREAMBLE + MARK.len());
    }
    let head = first.get(..8)?;
    let has_vr = head[4..6].iter().all(u8::is_ascii_uppercase);
    let begins = match head[..2] {
        // The group of what describes the image, or of the transfer syntax.
        [8, 0] => has_vr || head[6..8] == [0, 0] && head[4] < 128,
        [2, 0] | [0, 8] => has_vr,
        _ => false,
    };
    begins.then_some(0)
}

/// How elements without a transfer syntax are written, by the first of them.
fn guessed(head: &[u8]) -> Encoding {
    let has_vr = head
        .get(4..6)
        .is_some_and(|vr| vr.iter().all(u8::is_ascii_uppercase));
    match (has_vr, head.first()) {
        (true, Some(0)) => Encoding::BIG_ENDIAN,
        (true, _) => Encoding::EXPLICIT,
        (false, _) => Encoding::IMPLICIT,
    }
}

impl OpenedFile {
    /// None where the file is not DICOM.
    pub(super) fn open(path: &Path, most_bytes: u64) -> Result<Option<Self>, VolumeError> {
        let file = File::open(path).map_err(unreadable)?;
        let end = file.metadata().map_err(unreadable)?.len();
        Self::read(BufReader::with_capacity(BUFFER, file), end, most_bytes)
    }

    /// The same of bytes.
    pub(super) fn read(
        mut input: impl Bytes,
        end: u64,
        most_bytes: u64,
    ) -> Result<Option<Self>, VolumeError> {
        let first = peek(&mut input, 0)?;
        let Some(at) = begin(&first) else {
            return Ok(None);
        };
        let (meta, start) =
            Elements::new(&mut input, at as u64, end, Encoding::EXPLICIT)?.meta()?;
        let head = peek(&mut input, start)?;
        let sop_class = meta.text(tag::META_SOP_CLASS);
        let mut assumed = None;
        let syntax = if let Some(uid) = meta.text(tag::TRANSFER_SYNTAX) {
            TransferSyntax::of(&uid)
        } else {
            assumed = Some("the file states no transfer syntax: determined from its first bytes");
            TransferSyntax::plain(guessed(&head))
        };
        if syntax.is_deflated() {
            let bytes = inflated(&mut input, start, most_bytes)?;
            let end = bytes.len() as u64;
            let (data, pixels) =
                Elements::new(Cursor::new(bytes), 0, end, syntax.encoding())?.data()?;
            return Ok(Some(Self {
                data,
                pixels,
                syntax,
                sop_class,
                assumed,
            }));
        }
        let mut encoding = syntax.encoding();
        match (encoding, guessed(&head)) {
            (Encoding::EXPLICIT, Encoding::IMPLICIT) => {
                assumed = Some(
                    "the file states explicit VRs, but its elements have none: read as implicit",
                );
                encoding = Encoding::IMPLICIT;
            }
            (Encoding::IMPLICIT, Encoding::EXPLICIT) => {
                assumed = Some(
                    "the file states implicit VRs, but its elements have them: read as explicit",
                );
                encoding = Encoding::EXPLICIT;
            }
            _ => {}
        }
        let (data, pixels) = Elements::new(&mut input, start, end, encoding)?.data()?;
        Ok(Some(Self {
            data,
            pixels,
            syntax,
            sop_class,
            assumed,
        }))
    }
}

/// The bytes in which offsets of pixels count.
pub(super) fn pixel_bytes(
    path: &Path,
    syntax: &TransferSyntax,
    most_bytes: u64,
) -> Result<Box<dyn Bytes>, VolumeError> {
    let mut file = File::open(path).map_err(unreadable)?;
    if !syntax.is_deflated() {
        return Ok(Box::new(file));
    }
    let end = file.metadata().map_err(unreadable)?.len();
    let first = peek(&mut file, 0)?;
    let at = begin(&first).unwrap_or(0) as u64;
    let (_, start) = Elements::new(&mut file, at, end, Encoding::EXPLICIT)?.meta()?;
    Ok(Box::new(Cursor::new(inflated(
        &mut file, start, most_bytes,
    )?)))
}

/// The first bytes from a place on, as many as there are.
fn peek(input: &mut (impl Read + Seek), at: u64) -> Result<Vec<u8>, VolumeError> {
    let mut first = Vec::new();
    input.seek(SeekFrom::Start(at)).map_err(unreadable)?;
    input
        .by_ref()
        .take(FIRST_BYTES)
        .read_to_end(&mut first)
        .map_err(unreadable)?;
    Ok(first)
}

fn inflated(
    input: &mut (impl Read + Seek),
    start: u64,
    most_bytes: u64,
) -> Result<Vec<u8>, VolumeError> {
    input.seek(SeekFrom::Start(start)).map_err(unreadable)?;
    let mut bytes = Vec::new();
    let got = DeflateDecoder::new(input)
        .take(most_bytes.saturating_add(1))
        .read_to_end(&mut bytes);
    if let Err(error) = got
        && bytes.is_empty()
    {
        return Err(
            VolumeError::refused(format!("the deflated data set is damaged: {error}"))
                .hint("copy or export it again"),
        );
    }
    if bytes.len() as u64 > most_bytes {
        return Err(VolumeError::refused(format!(
            "the deflated data set is larger than the limit of {}",
            syntax::in_mib(most_bytes)
        ))
        .hint("raise the limit with --max-memory"));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_files_are_not_taken_for_dicom() {
        for first in [
            &b""[..],
            b"solid part",
            b"\x5c\x01\x00\x00aaaaaaaa",
            b"PK\x03\x04aaaaaaaa",
            b"{\"a\": 1234}",
        ] {
            assert!(!is_dicom(first), "{first:?}");
        }
        assert!(is_dicom(b"\x08\x00\x05\x00CS\x0a\x00ISO_IR 100"));
        assert!(is_dicom(b"\x08\x00\x08\x00\x16\x00\x00\x00ORIGINAL"));
    }
}
