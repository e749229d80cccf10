//! Voxels of a file with a header, whatever its format: sizes held against the file and the memory first, then piece by
//! piece.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::bytes::ByteStream;
use super::scalar::{Converter, Rescale, Stored, Tally};
use super::segments::Segments;
use super::{ReadOptions, reserved, zeroed};
use crate::{Remark, VolumeError, VoxelGrid};

/// Bytes that are converted at a time: they stay in the second cache, and hold whole numbers of any type.
const PIECE: usize = 1 << 18;

/// What a header says of the voxels.
#[derive(Debug)]
pub(super) struct Header {
    /// Name of the format, for people.
    pub(super) format: String,
    pub(super) stored: Stored,
    pub(super) rescale: Rescale,
    /// Of the first voxel in the stream.
    pub(super) data_offset: u64,
    pub(super) grid: VoxelGrid,
    /// What is worth knowing of the header.
    pub(super) remarks: Vec<Remark>,
    /// Whether the format has something else after the voxels.
    pub(super) has_trailer: bool,
    /// Of a segmentation.
    pub(super) segments: Segments,
}

impl Header {
    /// Bytes that the voxels have.
    pub(super) fn wanted_bytes(&self) -> u64 {
        (self.grid.len() as u64)
            .saturating_mul(self.segments.layers() as u64)
            .saturating_mul(self.stored.kind.bytes() as u64)
    }
}

/// What a file holds, before its voxels are read.
#[derive(Debug)]
pub(super) struct StoredVoxels {
    header: Header,
    stream: ByteStream,
    file_name: String,
}

impl StoredVoxels {
    /// Of the file at `path`, which `stream` reads.
    pub(super) fn new(header: Header, stream: ByteStream, path: &Path) -> Self {
        Self {
            header,
            stream,
            file_name: path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        }
    }

    pub(super) fn header(&self) -> &Header {
        &self.header
    }

    /// For people.
    pub(super) fn format(&self) -> String {
        let Header { format, stored, .. } = &self.header;
        let order = if stored.is_big_endian {
            "big-endian"
        } else {
            "little-endian"
        };
        let compressed = match self.stream.compression() {
            Some(name) => format!(", {name}"),
            None => String::new(),
        };
        format!("{format}, {}, {order}{compressed}", stored.kind.name())
    }

    /// The voxels as HU.
    pub(super) fn hu(
        mut self,
        options: &ReadOptions,
        cancel: &AtomicBool,
    ) -> Result<(Vec<i16>, Tally, Vec<Remark>), VolumeError> {
        let layers = self.header.segments.layers();
        if layers > 1 {
            return Err(VolumeError::refused(format!(
                "it is a segmentation with {layers} layers, not a CT"
            ))
            .hint("a segmentation completes a CT, as --labels of ct build"));
        }
        let count = self.header.grid.len();
        self.check_size(count * size_of::<i16>(), options)?;
        let converter = Converter::new(self.header.stored, self.header.rescale, None, count);
        let mut hu = zeroed(count)?;
        let mut tally = Tally::default();
        let mut rest = hu.as_mut_slice();
        let remarks = self.each_piece(cancel, |bytes, count| {
            let (out, after) = std::mem::take(&mut rest).split_at_mut(count);
            converter.convert(bytes, out, &mut tally);
            rest = after;
            Ok(())
        })?;
        Ok((hu, tally, remarks))
    }

    /// The voxels as labels: whole numbers from 0 to 65535.
    pub(super) fn labels(
        mut self,
        options: &ReadOptions,
        cancel: &AtomicBool,
    ) -> Result<(Vec<u16>, Vec<Remark>), VolumeError> {
        let count = self.header.grid.len();
        self.check_size(count * size_of::<u16>(), options)?;
        let mut painter = self.header.segments.painter();
        if let Some(painter) = &mut painter {
            let mut labels = reserved(count)?;
            let mut at = 0;
            // Values of all layers, with what is 0 between them.
            let mut remarks = self.each_value(cancel, |next, value| {
                labels.extend((at..next).filter_map(|_| painter.take(0)));
                labels.extend(painter.take(value));
                at = next + 1;
            })?;
            let values = count * self.header.segments.layers();
            labels.extend((at..values).filter_map(|_| painter.take(0)));
            remarks.extend(painter.remarks());
            return Ok((labels, remarks));
        }
        let mut labels = zeroed(count)?;
        let remarks = self.each_value(cancel, |at, label| labels[at] = label)?;
        Ok((labels, remarks))
    }

    /// Calls `take` with the place in the data and the label of each voxel that has one.
    pub(super) fn each_label(
        mut self,
        options: &ReadOptions,
        cancel: &AtomicBool,
        take: impl FnMut(usize, u16),
    ) -> Result<Vec<Remark>, VolumeError> {
        let layers = self.header.segments.layers();
        if layers > 1 {
            return Err(VolumeError::refused(format!(
                "it has {layers} layers, the mask of one structure has one"
            ))
            .hint("name a segmentation by its file, not by its folder"));
        }
        self.check_size(0, options)?;
        self.each_value(cancel, take)
    }

    /// Values that are not 0, with their places in the data.
    fn each_value(
        &mut self,
        cancel: &AtomicBool,
        mut take: impl FnMut(usize, u16),
    ) -> Result<Vec<Remark>, VolumeError> {
        /// Bytes that are looked at together: most of a mask is 0. A whole number of values of any type.
        const LOOK: usize = 1 << 10;
        let (stored, rescale) = (self.header.stored, self.header.rescale);
        let is_zero_nothing = rescale.intercept == 0.0;
        let width = stored.kind.bytes();
        let mut at = 0;
        self.each_piece(cancel, |bytes, _| {
            let mut wrong = None;
            for some in bytes.chunks(LOOK) {
                if is_zero_nothing && some.iter().all(|byte| *byte == 0) {
                    at += some.len() / width;
                    continue;
                }
                stored.each(some, |number| {
                    let value = number * rescale.slope + rescale.intercept;
                    let is_label =
                        (0.0..=f64::from(u16::MAX)).contains(&value) && value.fract() == 0.0;
                    if !is_label {
                        wrong = wrong.or(Some(value));
                    }
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "checked above"
                    )]
                    let label = value as u16;
                    if label != 0 {
                        take(at, label);
                    }
                    at += 1;
                });
            }
            match wrong {
                None => Ok(()),
                Some(value) => Err(VolumeError::refused(format!(
                    "{value} is not a label: labels are whole numbers from 0 to {}",
                    u16::MAX
                ))
                .hint("is it the scan or a probability map instead of a label map?")),
            }
        })
    }

    /// Refuses what the file cannot hold, and what memory should not, before any memory is taken.
    fn check_size(&self, in_memory: usize, options: &ReadOptions) -> Result<(), VolumeError> {
        options.check_memory(&self.header.grid, in_memory as u64)?;
        let wanted = self
            .header
            .data_offset
            .saturating_add(self.header.wanted_bytes());
        if self.stream.most_bytes() < wanted {
            let size = self.header.grid.size();
            return Err(cut_off(
                &self.file_name,
                &format!(
                    "the header requires {wanted} bytes ({} x {} x {} voxels of {} bytes), but the \
                     file has at most {}",
                    size[0],
                    size[1],
                    size[2],
                    self.header.stored.kind.bytes(),
                    self.stream.most_bytes()
                ),
            ));
        }
        Ok(())
    }

    /// Reads the voxels piece by piece: bytes, and the number of voxels that they hold.
    fn each_piece(
        &mut self,
        cancel: &AtomicBool,
        mut take: impl FnMut(&[u8], usize) -> Result<(), VolumeError>,
    ) -> Result<Vec<Remark>, VolumeError> {
        let wanted = self.header.wanted_bytes();
        let voxel = self.header.stored.kind.bytes();
        self.stream.skip_to(self.header.data_offset)?;
        let mut piece = vec![0; PIECE];
        let mut done = 0;
        while done < wanted {
            if cancel.load(Ordering::Relaxed) {
                return Err(VolumeError::Interrupted);
            }
            let length = usize::try_from(wanted - done).map_or(PIECE, |rest| rest.min(PIECE));
            let got = self.stream.fill(&mut piece[..length])?;
            if got < length {
                return Err(cut_off(
                    &self.file_name,
                    &format!(
                        "it ends after {} of {} voxels",
                        (done + got as u64) / voxel as u64,
                        wanted / voxel as u64
                    ),
                ));
            }
            take(&piece[..length], length / voxel)?;
            done += length as u64;
        }
        let beyond = self.stream.finish(&mut piece, self.header.has_trailer)?;
        Ok(beyond.into_iter().map(Remark::new).collect())
    }
}

fn cut_off(name: &str, how: &str) -> VolumeError {
    VolumeError::refused(format!("the file is truncated: {how}"))
        .at(name)
        .hint("copy or export it again")
}
