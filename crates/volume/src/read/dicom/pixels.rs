//! Pixels of slices, decoded and turned into HU, some slices at a time.

use std::io::{Read, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_parallel::in_parts;

use super::dataset::Pixels;
use super::file::{self, Bytes};
use super::image::{ImageFile, Slice, named};
use super::stack::Source;
use super::syntax::{Compressed, TransferSyntax};
use crate::VolumeError;
use crate::read::scalar::{Converter, Stored, Tally};
use crate::read::{ReadOptions, reserved, unreadable, zeroed};

/// What compression can make of a byte at most: the decoders' own limit.
const MOST_INFLATION: u64 = 64;

/// Below that no decoder asks.
const SMALL: u64 = 16 << 20;

/// Bytes of one frame.
pub(super) fn frame_bytes(image: &ImageFile, stored: &Stored) -> u64 {
    u64::from(image.rows) * u64::from(image.columns) * stored.kind.bytes() as u64
}

/// Refuses slices whose pixels are not all there, before memory is taken for them.
pub(super) fn check(slices: &[Slice]) -> Result<(), VolumeError> {
    for slice in slices {
        let image = &*slice.file;
        let stored = image
            .stored
            .clone()
            .map_err(|problem| named(problem, &image.name))?;
        slice.rescale.clone()?;
        check_frame(slice, &stored).map_err(|problem| named(problem, &image.name))?;
    }
    Ok(())
}

fn check_frame(slice: &Slice, stored: &Stored) -> Result<(), VolumeError> {
    let image = &*slice.file;
    image.syntax.check()?;
    let wanted = frame_bytes(image, stored);
    match &image.pixels {
        None => Err(
            VolumeError::refused("it has no pixels, or they are floating-point")
                .hint("copy or export it again"),
        ),
        Some(Pixels::Plain { bytes, .. }) => {
            if !image.syntax.is_plain() {
                return Err(VolumeError::refused(format!(
                    "the file states pixels compressed by {}, but they are not compressed",
                    image.syntax.name()
                ))
                .hint("copy or export it again"));
            }
            let all = wanted * (slice.frame as u64 + 1);
            if *bytes < all {
                return Err(VolumeError::refused(format!(
                    "the file is truncated: {bytes} bytes of pixels, but {} x {} x {} need {all}",
                    image.columns,
                    image.rows,
                    slice.frame + 1
                ))
                .hint("copy or export it again"));
            }
            Ok(())
        }
        Some(Pixels::Fragments { .. }) => {
            let pieces = pieces(image, slice.frame)?;
            let bytes: u64 = pieces.iter().map(|(_, bytes)| bytes).sum();
            if wanted > SMALL && wanted > bytes * MOST_INFLATION {
                return Err(VolumeError::refused(format!(
                    "{bytes} compressed bytes are not {} x {} pixels",
                    image.columns, image.rows
                ))
                .hint("copy or export it again"));
            }
            Ok(())
        }
    }
}

/// Where the compressed bytes of a frame are.
fn pieces(image: &ImageFile, frame: usize) -> Result<&[(u64, u64)], VolumeError> {
    let Some(Pixels::Fragments { pieces, starts }) = &image.pixels else {
        return Ok(&[]);
    };
    if image.frames == 1 {
        return Ok(pieces);
    }
    if pieces.len() == image.frames {
        return Ok(&pieces[frame..=frame]);
    }
    let unknown = || {
        VolumeError::refused(format!(
            "{} compressed fragments for {} frames, without an offset table",
            pieces.len(),
            image.frames
        ))
        .hint("decompress it with gdcmconv --raw IN OUT (GDCM)")
    };
    // Offsets count from the first piece's item; bytes of all begin 8 behind their item. Pieces are in order.
    let origin = pieces.first().ok_or_else(unknown)?.0;
    let index = |frame: usize| {
        let start = origin + u64::from(*starts.get(frame)?);
        pieces.binary_search_by_key(&start, |(at, _)| *at).ok()
    };
    let first = index(frame).ok_or_else(unknown)?;
    let next = if frame + 1 == image.frames {
        pieces.len()
    } else {
        index(frame + 1).ok_or_else(unknown)?
    };
    pieces.get(first..next).ok_or_else(unknown)
}

/// The file that was read last: frames of one file follow one another, and one that is deflated is inflated once.
#[derive(Default)]
pub(super) struct LastFile(Option<(PathBuf, Box<dyn Bytes>)>);

impl LastFile {
    /// Bytes of a file from `at` on, behind what is in the buffer.
    fn append(
        &mut self,
        image: &ImageFile,
        options: &ReadOptions,
        at: u64,
        bytes: u64,
        buffer: &mut Vec<u8>,
    ) -> Result<(), VolumeError> {
        let input = self.of(&image.path, &image.syntax, options.max_bytes)?;
        let start = buffer.len();
        let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
        buffer.resize(start.saturating_add(bytes), 0);
        input
            .seek(SeekFrom::Start(at))
            .and_then(|_| input.read_exact(&mut buffer[start..]))
            .map_err(unreadable)
    }

    fn of(
        &mut self,
        path: &Path,
        syntax: &TransferSyntax,
        max_bytes: u64,
    ) -> Result<&mut Box<dyn Bytes>, VolumeError> {
        let known = self.0.take().filter(|(known, _)| known == path);
        let known = match known {
            Some(known) => known,
            None => (path.to_owned(), file::pixel_bytes(path, syntax, max_bytes)?),
        };
        Ok(&mut self.0.insert(known).1)
    }
}

/// Stored numbers of a frame, and how they are stored once decoded.
pub(super) fn stored_frame(
    slice: &Slice,
    options: &ReadOptions,
    last: &mut LastFile,
    buffer: &mut Vec<u8>,
) -> Result<Stored, VolumeError> {
    let image = &*slice.file;
    read_frame(slice, options, last, buffer).map_err(|problem| named(problem, &image.name))
}

fn read_frame(
    slice: &Slice,
    options: &ReadOptions,
    last: &mut LastFile,
    buffer: &mut Vec<u8>,
) -> Result<Stored, VolumeError> {
    let image = &*slice.file;
    let stored = image.stored.clone()?;
    buffer.clear();
    #[expect(clippy::single_match_else, reason = "two ways of the same weight")]
    match &image.pixels {
        Some(Pixels::Plain { offset, .. }) => {
            let bytes = frame_bytes(image, &stored);
            let at = offset + bytes * slice.frame as u64;
            last.append(image, options, at, bytes, buffer)?;
            Ok(stored)
        }
        _ => {
            for (at, bytes) in pieces(image, slice.frame)? {
                last.append(image, options, *at, *bytes, buffer)?;
            }
            let bits = u16::try_from(stored.kind.bytes() * 8).unwrap_or(0);
            if image.syntax.is_lossy_stream(buffer) {
                image.has_lossy_stream.store(true, Ordering::Relaxed);
            }
            let used = stored.bits.and_then(|(used, _)| u16::try_from(used).ok());
            *buffer = image.syntax.decode(&Compressed {
                bytes: buffer,
                rows: image.rows,
                columns: image.columns,
                bits_allocated: bits,
                bits_stored: used.unwrap_or(bits),
            })?;
            Ok(Stored {
                is_big_endian: false,
                ..stored
            })
        }
    }
}

/// Calls `take` with 0 or 1 for each pixel of a frame of single bits. Frames follow one another without a gap, so that
/// one may begin within a byte.
pub(super) fn bits(
    slice: &Slice,
    options: &ReadOptions,
    last: &mut LastFile,
    buffer: &mut Vec<u8>,
    mut take: impl FnMut(u16),
) -> Result<(), VolumeError> {
    let image = &*slice.file;
    let wrong = |what: &str| named(VolumeError::refused(what), &image.name);
    let Some(Pixels::Plain { offset, bytes }) = &image.pixels else {
        return Err(wrong("compressed single-bit pixels are not supported"));
    };
    let count = u64::from(image.rows) * u64::from(image.columns);
    let first = count * slice.frame as u64;
    let (start, end) = (first / 8, (first + count).div_ceil(8));
    if end > *bytes {
        return Err(wrong("the file is truncated: pixels are missing"));
    }
    buffer.clear();
    last.append(image, options, offset + start, end - start, buffer)
        .map_err(|problem| named(problem, &image.name))?;
    let skipped = usize::try_from(first % 8).unwrap_or(0);
    for bit in skipped..skipped + usize::try_from(count).unwrap_or(0) {
        take(u16::from(buffer[bit / 8] >> (bit % 8) & 1));
    }
    Ok(())
}

/// What a thread keeps from one slice to the next.
#[derive(Default)]
struct Kept {
    conversion: Conversion,
    last: LastFile,
    buffer: Vec<u8>,
}

/// One converter at a time: slices of a series mostly have the same.
#[derive(Default)]
struct Conversion(Option<(ConversionKey, Converter)>);

/// How numbers are stored; slope and intercept, and the range of padding, by their bits.
type ConversionKey = (Stored, [u64; 2], Option<[u64; 2]>);

impl Conversion {
    fn of(&mut self, slice: &Slice, stored: Stored) -> Result<&Converter, VolumeError> {
        let rescale = slice.rescale.clone()?;
        let padding = applicable_padding(slice);
        let pixels = usize::from(slice.file.rows) * usize::from(slice.file.columns);
        let key = (
            stored,
            [rescale.slope.to_bits(), rescale.intercept.to_bits()],
            padding.map(|range| range.map(f64::to_bits)),
        );
        if self.0.as_ref().is_none_or(|(known, _)| *known != key) {
            self.0 = Some((key, Converter::new(stored, rescale, padding, pixels)));
        }
        match &self.0 {
            Some((_, converter)) => Ok(converter),
            None => Err(VolumeError::refused("there is no converter")),
        }
    }
}

/// HU that padding may stand for: what is denser than that may be tissue, however it was declared.
const PADDING_BELOW_HU: f64 = -900.0;

/// The padding that a file declares, where it can be no tissue.
pub(super) fn applicable_padding(slice: &Slice) -> Option<[f64; 2]> {
    let range = slice.file.padding?;
    let rescale = slice.rescale.as_ref().ok()?;
    let hu = |number: f64| number * rescale.slope + rescale.intercept;
    let greatest = hu(range[0]).max(hu(range[1]));
    (greatest <= PADDING_BELOW_HU).then_some(range)
}

/// All slices of a grid as HU.
pub(super) fn hu(
    slices: &[Slice],
    sources: &[Source],
    options: &ReadOptions,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<(Vec<i16>, Tally), VolumeError> {
    let plane = usize::from(slices[0].file.rows) * usize::from(slices[0].file.columns);
    let is_plain =
        sources.len() == slices.len() && sources.iter().all(|source| source.weight == 0.0);
    let read = |slice: &Slice, kept: &mut Kept, out: &mut [i16], tally: &mut Tally| {
        let stored = stored_frame(slice, options, &mut kept.last, &mut kept.buffer)?;
        let converter = kept.conversion.of(slice, stored)?;
        converter.convert(&kept.buffer, out, tally);
        Ok(())
    };
    let (measured, tally) = in_threads(slices, plane, threads, cancel, read)?;
    if is_plain {
        return Ok((measured, tally));
    }
    let mut hu: Vec<i16> = reserved(plane * sources.len())?;
    for source in sources {
        if cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        let first = &measured[source.first * plane..][..plane];
        if source.weight == 0.0 {
            hu.extend(first);
            continue;
        }
        let next = &measured[(source.first + 1) * plane..][..plane];
        hu.extend(first.iter().zip(next).map(|(a, b)| {
            let mean = f64::from(*a) * (1.0 - source.weight) + f64::from(*b) * source.weight;
            #[expect(
                clippy::cast_possible_truncation,
                reason = "between two values of 16 bits"
            )]
            let mean = mean.round_ties_even() as i16;
            mean
        }));
    }
    Ok((hu, tally))
}

/// Calls `read` for each slice, with the part of the result that is its own. The first slice with a problem says
/// which it is, whatever the number of threads.
fn in_threads<F>(
    slices: &[Slice],
    plane: usize,
    threads: usize,
    cancel: &AtomicBool,
    read: F,
) -> Result<(Vec<i16>, Tally), VolumeError>
where
    F: Fn(&Slice, &mut Kept, &mut [i16], &mut Tally) -> Result<(), VolumeError> + Sync,
{
    let mut hu: Vec<i16> = zeroed(plane * slices.len())?;
    // Slices of one file stay together, so that each thread opens it once.
    let each = slices.len().div_ceil(threads.max(1));
    let work = |(): &mut (), part: usize, hu: &mut [i16]| {
        let mut tally = Tally::default();
        let mut kept = Kept::default();
        for (slice, out) in slices[part * each..].iter().zip(hu.chunks_mut(plane)) {
            if cancel.load(Ordering::Relaxed) {
                return Err(VolumeError::Interrupted);
            }
            read(slice, &mut kept, out, &mut tally)?;
        }
        Ok(tally)
    };
    let outcomes = in_parts(threads, &mut hu, plane * each, || (), work);
    let mut tally = Tally::default();
    for outcome in outcomes {
        tally.add(&outcome?);
    }
    Ok((hu, tally))
}
