//! Transfer syntaxes: how elements are written, how pixels are compressed.

use std::borrow::Cow;

use dicom_encoding::Codec;
use dicom_encoding::adapters::{PixelDataObject, RawPixelData};
use dicom_encoding::transfer_syntax::TransferSyntaxIndex;
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;

use super::caught::caught;
use super::dataset::Encoding;
use super::jpeg_ls;
use crate::VolumeError;

pub(super) use crate::read::in_mib;

const IMPLICIT: &str = "1.2.840.10008.1.2";
const EXPLICIT: &str = "1.2.840.10008.1.2.1";
const BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";
const DEFLATED: &str = "1.2.840.10008.1.2.1.99";
const RLE: &str = "1.2.840.10008.1.2.5";

/// Compressions that are decoded here, by their UIDs' beginning: JPEG baseline, extended and lossless; JPEG 2000,
/// high throughput too.
const JPEG: [&str; 4] = [
    "1.2.840.10008.1.2.4.50",
    "1.2.840.10008.1.2.4.51",
    "1.2.840.10008.1.2.4.57",
    "1.2.840.10008.1.2.4.70",
];
const JPEG_2000: [&str; 5] = [
    "1.2.840.10008.1.2.4.90",
    "1.2.840.10008.1.2.4.91",
    "1.2.840.10008.1.2.4.201",
    "1.2.840.10008.1.2.4.202",
    "1.2.840.10008.1.2.4.203",
];
/// JPEG-LS. Which of the two it is does not say whether there is a loss: each stream does.
const JPEG_LS: [&str; 2] = ["1.2.840.10008.1.2.4.80", "1.2.840.10008.1.2.4.81"];
/// Whose numbers are not those that were measured.
const ALWAYS_LOSSY: [&str; 2] = ["1.2.840.10008.1.2.4.50", "1.2.840.10008.1.2.4.51"];
/// Which may be either: JPEG 2000 and its kind of high throughput.
const MAYBE_LOSSY: [&str; 2] = ["1.2.840.10008.1.2.4.91", "1.2.840.10008.1.2.4.203"];

/// How a file is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TransferSyntax {
    uid: String,
}

/// Of compressed pixels.
pub(super) struct Compressed<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) rows: u16,
    pub(super) columns: u16,
    pub(super) bits_allocated: u16,
    pub(super) bits_stored: u16,
}

impl TransferSyntax {
    pub(super) fn of(uid: &str) -> Self {
        Self {
            uid: uid.to_owned(),
        }
    }

    /// Without compression.
    pub(super) fn plain(encoding: Encoding) -> Self {
        Self::of(match encoding {
            Encoding::IMPLICIT => IMPLICIT,
            Encoding::BIG_ENDIAN => BIG_ENDIAN,
            _ => EXPLICIT,
        })
    }

    pub(super) fn encoding(&self) -> Encoding {
        match self.uid.as_str() {
            IMPLICIT => Encoding::IMPLICIT,
            BIG_ENDIAN => Encoding::BIG_ENDIAN,
            _ => Encoding::EXPLICIT,
        }
    }

    pub(super) fn is_deflated(&self) -> bool {
        self.uid == DEFLATED
    }

    /// Whether pixels are numbers as they are.
    pub(super) fn is_plain(&self) -> bool {
        [IMPLICIT, EXPLICIT, BIG_ENDIAN, DEFLATED].contains(&self.uid.as_str())
    }

    pub(super) fn is_lossy(&self) -> bool {
        ALWAYS_LOSSY.contains(&self.uid.as_str())
    }

    /// Whether the stream of a frame says that its numbers are not those that were compressed.
    pub(super) fn is_lossy_stream(&self, bytes: &[u8]) -> bool {
        JPEG_LS.contains(&self.uid.as_str()) && jpeg_ls::is_lossy(bytes)
    }

    /// Whether pixels may be lossy where a file does not say that they are not.
    pub(super) fn may_be_lossy(&self) -> bool {
        MAYBE_LOSSY.contains(&self.uid.as_str())
    }

    /// For people.
    pub(super) fn name(&self) -> String {
        match TransferSyntaxRegistry.get(&self.uid) {
            Some(syntax) => syntax.name().to_owned(),
            None => format!("unknown transfer syntax {}", self.uid),
        }
    }

    /// Refuses what cannot be decoded, and says how to convert it.
    pub(super) fn check(&self) -> Result<(), VolumeError> {
        let uid = self.uid.as_str();
        let decoded = [&JPEG[..], &JPEG_2000, &JPEG_LS].concat();
        if self.is_plain() || uid == RLE || decoded.contains(&uid) {
            return Ok(());
        }
        Err(VolumeError::refused(format!(
            "the pixels are compressed by {}, which is not supported",
            self.name()
        ))
        .hint("decompress it with gdcmconv --raw IN OUT (GDCM), or dcmconv or dcmdjpeg (DCMTK)"))
    }

    /// Stored numbers of one frame, little-endian.
    pub(super) fn decode(&self, frame: &Compressed) -> Result<Vec<u8>, VolumeError> {
        let wrong = |what: &str| {
            VolumeError::refused(format!("the {} pixels are damaged: {what}", self.name()))
                .hint("copy or export it again; or decompress it with gdcmconv --raw IN OUT (GDCM)")
        };
        let expected = usize::from(frame.rows)
            * usize::from(frame.columns)
            * usize::from(frame.bits_allocated / 8);
        if self.uid == RLE {
            return run_lengths(frame.bytes, expected, usize::from(frame.bits_allocated / 8))
                .ok_or_else(|| wrong("they do not fill the image"));
        }
        // Decoders take memory for what a stream says of itself: it has to be what the file says of it.
        let stated = self
            .stated(frame.bytes)
            .ok_or_else(|| wrong("they have an invalid beginning"))?;
        if (stated.columns, stated.rows) != (frame.columns.into(), frame.rows.into()) {
            return Err(wrong(&format!(
                "they are {} x {}, the file states {} x {}",
                stated.columns, stated.rows, frame.columns, frame.rows
            )));
        }
        if stated.components != 1 || stated.tiles > MOST_TILES {
            return Err(wrong(&format!(
                "they have {} components in {} tiles",
                stated.components, stated.tiles
            )));
        }
        // Decoders write what they have and leave the rest zero; of numbers that are too wide they write a part.
        if stated.is_subsampled {
            return Err(wrong("one number stands for several of them"));
        }
        if !stated.has_width(frame.bits_allocated) {
            return Err(wrong(&format!(
                "they have {} bits, the file states {} for each",
                stated.bits, frame.bits_allocated
            )));
        }
        if JPEG_LS.contains(&self.uid.as_str()) {
            let size = [frame.columns, frame.rows].map(usize::from);
            let values = jpeg_ls::decode(frame.bytes, size).map_err(wrong)?;
            let width = usize::from(frame.bits_allocated / 8);
            let bytes = |value| u64::from(value).to_le_bytes().into_iter().take(width);
            return Ok(values.iter().copied().flat_map::<_, _>(bytes).collect());
        }
        let Some(Codec::EncapsulatedPixelData(Some(decoder), _)) = TransferSyntaxRegistry
            .get(&self.uid)
            .map(dicom_encoding::TransferSyntax::codec)
        else {
            return Err(wrong("there is no decoder"));
        };
        let mut decoded = Vec::new();
        let object = Encapsulated {
            syntax: self,
            frame,
        };
        // Decoders index as the stream tells them; what they stumble over is the stream's fault.
        match caught(|| decoder.decode_frame(&object, 0, &mut decoded)) {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(wrong(&with_sources(&error))),
            None => return Err(wrong("the decoder failed")),
        }
        if decoded.len() != expected {
            return Err(wrong(&format!(
                "{} bytes instead of {expected}",
                decoded.len()
            )));
        }
        Ok(decoded)
    }

    /// What a stream says of itself.
    fn stated(&self, bytes: &[u8]) -> Option<Stated> {
        if JPEG_2000.contains(&self.uid.as_str()) {
            codestream_stated(bytes)
        } else {
            jpeg_stated(bytes)
        }
    }
}

/// What a compressed stream says of its image.
struct Stated {
    columns: u32,
    rows: u32,
    components: u16,
    tiles: u64,
    /// Of one number.
    bits: u16,
    /// Whether the decoder makes numbers of the width that it is asked for, rather than of whole bytes.
    is_any_width: bool,
    /// Whether a number stands for several pixels.
    is_subsampled: bool,
}

impl Stated {
    /// Whether decoded numbers are just as wide as those of the file.
    fn has_width(&self, bits_allocated: u16) -> bool {
        if self.is_any_width {
            self.bits <= bits_allocated
        } else {
            self.bits.next_multiple_of(8) == bits_allocated
        }
    }
}

/// Tiles of one slice: more are no CT's.
const MOST_TILES: u64 = 4096;

/// Of run lengths (PS3.5, annex G): one segment for each byte of a number, the highest first, into little-endian
/// numbers. None where they are damaged.
fn run_lengths(bytes: &[u8], expected: usize, bytes_each: usize) -> Option<Vec<u8>> {
    let number = |at: usize| -> Option<usize> {
        let four = bytes.get(4 * at..4 * at + 4)?;
        usize::try_from(u32::from_le_bytes(four.try_into().ok()?)).ok()
    };
    if number(0)? != bytes_each {
        return None;
    }
    let mut decoded = vec![0; expected];
    for segment in 0..bytes_each {
        let start = number(segment + 1)?;
        let end = if segment + 1 < bytes_each {
            number(segment + 2)?
        } else {
            bytes.len()
        };
        let mut codes = bytes.get(start..end)?.iter().copied();
        let mut out = decoded
            .iter_mut()
            .skip(bytes_each - 1 - segment)
            .step_by(bytes_each);
        let mut left = expected / bytes_each;
        while left > 0 {
            let code = codes.next()?;
            let (count, repeated) = match code {
                0..=127 => (usize::from(code) + 1, None),
                128 => continue,
                _ => (257 - usize::from(code), Some(codes.next()?)),
            };
            // What goes beyond the last pixel is padding of the run.
            for _ in 0..count.min(left) {
                let value = match repeated {
                    Some(value) => value,
                    None => codes.next()?,
                };
                if let Some(out) = out.next() {
                    *out = value;
                }
            }
            left -= count.min(left);
        }
    }
    Some(decoded)
}

/// An error with what caused it.
fn with_sources(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text = format!("{text}: {error}");
        source = error.source();
    }
    text
}

/// Of JPEG 2000: the SIZ marker behind the start of the codestream, which may stand in a file's boxes.
fn codestream_stated(bytes: &[u8]) -> Option<Stated> {
    let at = bytes
        .windows(4)
        .position(|four| four == [0xFF, 0x4F, 0xFF, 0x51])?;
    let number = |offset: usize| -> Option<u32> {
        let four = bytes.get(at + offset..at + offset + 4)?;
        Some(u32::from_be_bytes(four.try_into().ok()?))
    };
    // Markers, length and capabilities come before them. Ends and begins of the image, then size and begin of tiles.
    let (right, bottom, left, top) = (number(8)?, number(12)?, number(16)?, number(20)?);
    let (tile_width, tile_height) = (number(24)?, number(28)?);
    let [high, low, depth, step_x, step_y] = *bytes.get(at + 40..at + 45)? else {
        return None;
    };
    if tile_width == 0 || tile_height == 0 {
        return None;
    }
    Some(Stated {
        columns: right.checked_sub(left)?,
        rows: bottom.checked_sub(top)?,
        components: u16::from_be_bytes([high, low]),
        tiles: u64::from(right.div_ceil(tile_width)) * u64::from(bottom.div_ceil(tile_height)),
        // The highest bit is the sign's.
        bits: u16::from(depth & 0x7F) + 1,
        is_any_width: true,
        is_subsampled: [step_x, step_y] != [1, 1],
    })
}

/// Of JPEG: the frame header (SOF0 to SOF15 but the tables' markers; SOF55 of JPEG-LS).
fn jpeg_stated(bytes: &[u8]) -> Option<Stated> {
    let mut at = 2;
    loop {
        let [0xFF, marker, high, low] = *bytes.get(at..at + 4)? else {
            return None;
        };
        let is_ls = marker == jpeg_ls::FRAME;
        let is_frame =
            is_ls || (0xC0..=0xCF).contains(&marker) && ![0xC4, 0xC8, 0xCC].contains(&marker);
        if is_frame {
            let [bits, a, b, c, d, components] = *bytes.get(at + 4..at + 10)? else {
                return None;
            };
            return Some(Stated {
                columns: u16::from_be_bytes([c, d]).into(),
                rows: u16::from_be_bytes([a, b]).into(),
                components: components.into(),
                tiles: 1,
                bits: bits.into(),
                is_any_width: is_ls,
                is_subsampled: false,
            });
        }
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
    }
}

/// One frame as decoders want it.
struct Encapsulated<'a> {
    syntax: &'a TransferSyntax,
    frame: &'a Compressed<'a>,
}

impl PixelDataObject for Encapsulated<'_> {
    fn transfer_syntax_uid(&self) -> &str {
        &self.syntax.uid
    }

    fn rows(&self) -> Option<u16> {
        Some(self.frame.rows)
    }

    fn cols(&self) -> Option<u16> {
        Some(self.frame.columns)
    }

    fn samples_per_pixel(&self) -> Option<u16> {
        Some(1)
    }

    fn bits_allocated(&self) -> Option<u16> {
        Some(self.frame.bits_allocated)
    }

    fn bits_stored(&self) -> Option<u16> {
        Some(self.frame.bits_stored)
    }

    fn photometric_interpretation(&self) -> Option<&str> {
        Some("MONOCHROME2")
    }

    fn number_of_frames(&self) -> Option<u32> {
        Some(1)
    }

    fn number_of_fragments(&self) -> Option<u32> {
        Some(1)
    }

    fn fragment(&self, fragment: usize) -> Option<Cow<'_, [u8]>> {
        (fragment == 0).then_some(Cow::Borrowed(self.frame.bytes))
    }

    fn offset_table(&self) -> Option<Cow<'_, [u32]>> {
        Some(Cow::Borrowed(&[]))
    }

    fn raw_pixel_data(&self) -> Option<RawPixelData> {
        Some(RawPixelData {
            fragments: [self.frame.bytes.to_vec()].into_iter().collect(),
            offset_table: [].into_iter().collect(),
        })
    }
}
