//! NIfTI-1 and -2: `.nii`, `.nii.gz`, and `.hdr` beside `.img`.
//!
//! Free texts of the header (`descrip`, `db_name`, `aux_file`, `intent_name`) are never read: some writers put
//! names there.

mod bytes;
mod fields;
mod header;
mod orientation;
mod version;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use self::bytes::ByteStream;
use self::header::Header;
use super::scalar::{Converter, Tally};
use super::{ReadOptions, reserved, zeroed};
use crate::{ImagingError, Remark, VoxelGrid};

pub(super) use self::version::begins_as_header;

/// Bytes that are converted at a time: they stay in the second cache, and hold whole numbers of any type.
const PIECE: usize = 1 << 18;

/// What a file holds, before its voxels are read.
#[derive(Debug)]
pub(super) struct Nifti {
    header: Header,
    stream: ByteStream,
    data_path: PathBuf,
}

/// Whether it is called `.nii`, `.nii.gz`, `.hdr` or `.img`, with or without `.gz`.
pub(super) fn has_name(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    [".nii", ".hdr", ".img"]
        .iter()
        .any(|end| name.ends_with(end))
}

impl Nifti {
    pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Self, ImagingError> {
        let (header_path, data_path) = bytes::pair(path);
        let mut stream = opened(
            &header_path,
            "the header must be next to the voxels, in a file of the same name ending in .hdr",
        )?;
        let header = Header::read(&mut stream, options)?;
        if header.is_pair && header_path == data_path {
            return Err(ImagingError::refused(
                "it is the header of a file pair (.hdr and .img), but is not named .hdr",
            )
            .hint("rename it to .hdr, with the voxels in .img; or convert the pair to .nii"));
        }
        let (stream, data_path) = if header.is_pair {
            let voxels = opened(
                &data_path,
                "the voxels must be next to the header, in a file of the same name ending in .img",
            )?;
            (voxels, data_path)
        } else {
            (stream, header_path)
        };
        Ok(Self {
            header,
            stream,
            data_path,
        })
    }

    pub(super) fn grid(&self) -> &VoxelGrid {
        &self.header.grid
    }

    /// What is worth knowing of the header.
    pub(super) fn remarks(&self) -> &[Remark] {
        &self.header.remarks
    }

    /// For people.
    pub(super) fn format(&self) -> String {
        let compressed = if self.stream.is_compressed() {
            ", gzip"
        } else {
            ""
        };
        let order = if self.header.stored.is_big_endian {
            "big-endian"
        } else {
            "little-endian"
        };
        format!(
            "NIfTI-{}, {}, {order}{compressed}",
            self.header.version,
            self.header.stored.kind.name()
        )
    }

    /// The voxels as HU.
    pub(super) fn hu(
        mut self,
        options: &ReadOptions,
        cancel: &AtomicBool,
    ) -> Result<(Vec<i16>, Tally, Vec<Remark>), ImagingError> {
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
    ) -> Result<(Vec<u16>, Vec<Remark>), ImagingError> {
        let count = self.header.grid.len();
        self.check_size(count * size_of::<u16>(), options)?;
        let mut labels = reserved(count)?;
        let (stored, rescale) = (self.header.stored, self.header.rescale);
        let remarks = self.each_piece(cancel, |bytes, _| {
            let mut wrong = None;
            stored.each(bytes, |number| {
                let value = number * rescale.slope + rescale.intercept;
                let is_label = (0.0..=f64::from(u16::MAX)).contains(&value) && value.fract() == 0.0;
                if !is_label {
                    wrong = wrong.or(Some(value));
                }
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "checked above"
                )]
                labels.push(value as u16);
            });
            match wrong {
                None => Ok(()),
                Some(value) => Err(ImagingError::refused(format!(
                    "{value} is not a label: labels are whole numbers from 0 to {}",
                    u16::MAX
                ))
                .hint("is it the scan or a probability map instead of a label map?")),
            }
        })?;
        Ok((labels, remarks))
    }

    /// Refuses what the file cannot hold, and what memory should not, before any memory is taken.
    fn check_size(&self, in_memory: usize, options: &ReadOptions) -> Result<(), ImagingError> {
        options.check_memory(&self.header.grid, in_memory as u64)?;
        let wanted = self.header.data_offset.saturating_add(self.wanted_bytes());
        if self.stream.most_bytes() < wanted {
            let size = self.header.grid.size();
            return Err(cut_off(
                &self.data_path,
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

    fn wanted_bytes(&self) -> u64 {
        (self.header.grid.len() as u64).saturating_mul(self.header.stored.kind.bytes() as u64)
    }

    /// Reads the voxels piece by piece: bytes, and the number of voxels that they hold.
    fn each_piece(
        &mut self,
        cancel: &AtomicBool,
        mut take: impl FnMut(&[u8], usize) -> Result<(), ImagingError>,
    ) -> Result<Vec<Remark>, ImagingError> {
        let wanted = self.wanted_bytes();
        let voxel = self.header.stored.kind.bytes();
        self.stream.skip_to(self.header.data_offset)?;
        let mut piece = vec![0; PIECE];
        let mut done = 0;
        while done < wanted {
            if cancel.load(Ordering::Relaxed) {
                return Err(ImagingError::Interrupted);
            }
            let length = usize::try_from(wanted - done).map_or(PIECE, |rest| rest.min(PIECE));
            let got = self.stream.fill(&mut piece[..length])?;
            if got < length {
                return Err(cut_off(
                    &self.data_path,
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
        let beyond = self.stream.finish(&mut piece)?;
        Ok(beyond.into_iter().map(Remark::new).collect())
    }
}

/// One of a pair, with what to do where it is missing.
fn opened(path: &Path, hint: &str) -> Result<ByteStream, ImagingError> {
    ByteStream::open(path).map_err(|problem| {
        if path.exists() {
            problem
        } else {
            problem.hint(hint)
        }
    })
}

fn cut_off(path: &Path, how: &str) -> ImagingError {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    ImagingError::refused(format!("the file is truncated: {how}"))
        .at(name)
        .hint("copy or export it again")
}
