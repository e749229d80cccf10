//! Volumes and label maps from DICOM, NIfTI, NRRD, MetaImage and MGH.
//!
//! Headers are read first: the memory that they require is checked against the file and a limit before allocation.
//! Where a file leaves room for a guess it is refused; what is used although something about it is odd comes with a
//! [`Remark`].

mod archive;
mod bytes;
mod contours;
mod dicom;
mod fields;
mod foreign;
mod format;
mod label_folder;
mod label_names;
mod labelled;
mod labels;
mod metaimage;
mod mgh;
mod nifti;
mod nrrd;
mod order;
mod painted;
mod placing;
mod plausibility;
mod scalar;
mod segments;
mod text_header;
mod voxels;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use self::archive::Unpacked;
use self::format::{Format, format_of};
use self::scalar::Tally;
use self::voxels::StoredVoxels;
use crate::patient_position::PatientPosition;
use crate::{Orientation, Remark, Volume, VolumeError, VoxelGrid};

pub use label_names::read_label_names;
pub use labelled::ReadLabels;
pub use labels::read_labels;

/// How to read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    /// Which series of a folder: its label in the list that a refusal names, or its UID.
    pub series: Option<String>,
    /// Interpolate single missing slices, which are refused otherwise.
    pub fill_gaps: bool,
    /// How the voxels of a file run that does not say it.
    pub assume_orientation: Option<Orientation>,
    /// Most bytes that the voxels may take in memory.
    pub max_bytes: u64,
    /// Of a label map: the scan that it is of.
    pub scan: ScanIdentity,
}

/// By what DICOM tells whether two files are of one scan.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ScanIdentity {
    /// UID of the frame in which places are.
    pub frame_of_reference: Option<String>,
    /// UID of the series.
    pub series_uid: Option<String>,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            series: None,
            fill_gaps: false,
            assume_orientation: None,
            max_bytes: 4 << 30,
            scan: ScanIdentity::default(),
        }
    }
}

impl ReadOptions {
    /// Refuses what takes more memory than allowed.
    fn check_memory(&self, grid: &VoxelGrid, bytes: u64) -> Result<(), VolumeError> {
        if bytes <= self.max_bytes {
            return Ok(());
        }
        let [columns, rows, slices] = grid.size();
        Err(VolumeError::refused(format!(
            "{columns} x {rows} x {slices} voxels need {} of memory, the limit is {}",
            in_mib(bytes),
            in_mib(self.max_bytes)
        ))
        .hint("crop or subsample it beforehand, or raise the limit with --max-memory"))
    }
}

/// What to do about a header that says nothing sensible.
const DAMAGED: &str = "the header is damaged: copy or export it again";

/// Rounded up, lest what is above a limit looks as if it were not.
fn in_mib(bytes: u64) -> String {
    format!("{} MiB", bytes.div_ceil(1 << 20))
}

/// Room for values; an error where the machine has none.
fn reserved<T>(count: usize) -> Result<Vec<T>, VolumeError> {
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| {
        VolumeError::refused(format!(
            "not enough memory for the voxels ({})",
            in_mib((count * size_of::<T>()) as u64)
        ))
        .hint("crop or subsample it beforehand")
    })?;
    Ok(values)
}

/// The same, filled with zeros.
fn zeroed<T: Clone + Default>(count: usize) -> Result<Vec<T>, VolumeError> {
    // Taken anew: memory that comes as zeros need not be written to become so.
    drop(reserved::<T>(count)?);
    Ok(vec![T::default(); count])
}

/// A volume, and what there is to know of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadVolume {
    /// The voxels, on the file's own grid: oblique or sheared where that is. See [`crate::resample`].
    pub volume: Volume,
    /// What is odd.
    pub remarks: Vec<Remark>,
    /// Where it comes from.
    pub description: Description,
}

/// Where a volume comes from. Nothing of it names the patient.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Description {
    /// Format, type of the stored numbers, compression.
    pub format: String,
    /// `CT`, where the file says it.
    pub modality: Option<String>,
    /// Label of the series within its folder.
    pub series: Option<String>,
    /// Reconstruction kernel, by its manufacturer's name.
    pub kernel: Option<String>,
    /// Peak voltage of the tube.
    pub tube_voltage_v: Option<f64>,
    /// How the patient lay in the scanner.
    pub patient_position: Option<PatientPosition>,
    /// Files that the voxels are from.
    pub files: usize,
    /// Voxels that the scanner did not see: air in the volume, and not to be counted in statistics.
    pub padding_voxels: u64,
    /// Which scan it is, for label maps of it; in no output.
    #[serde(skip)]
    pub identity: ScanIdentity,
}

/// Reads a CT: a DICOM file, a folder of DICOM files, NIfTI (`.nii`, `.nii.gz`, `.hdr` with `.img`), NRRD (`.nrrd`, `.nhdr`),
/// MetaImage (`.mha`, `.mhd`), MGH (`.mgh`, `.mgz`), or a ZIP archive of one of them.
///
/// An archive is unpacked into a temporary folder, which is removed afterwards.
///
/// The result is the same whatever the number of `threads`.
pub fn read_volume(
    path: &Path,
    options: &ReadOptions,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<ReadVolume, VolumeError> {
    let _stage = tracing::debug_span!("read", file = %path.display()).entered();
    let unpacked = archive::unpacked(path, options, cancel)?;
    let path = unpacked.as_ref().map_or(path, Unpacked::path);
    let mut read = match format_of(path)? {
        Format::Dicom => dicom::read(path, options, threads, cancel),
        Format::Stored(open) => of_stored(open(path, options)?, options, cancel),
    }?;
    if unpacked.is_some() {
        read.description.format.push_str(", in a ZIP archive");
    }
    let grid = &read.volume.grid;
    tracing::info!(
        format = read.description.format,
        files = read.description.files,
        size = ?grid.size(),
        spacing_mm = ?grid.spacing_m().map(|each| each * 1e3),
        "volume read"
    );
    for remark in &read.remarks {
        tracing::debug!("{remark:?}");
    }
    Ok(read)
}

/// What the system says of a file or a folder.
#[expect(clippy::needless_pass_by_value, reason = "errors are mapped by it")]
fn unreadable(error: std::io::Error) -> VolumeError {
    VolumeError::refused(format!("cannot be read: {error}"))
        .hint("check that it exists, is complete and readable")
}

/// The volume of a file with one.
fn of_stored(
    stored: StoredVoxels,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<ReadVolume, VolumeError> {
    if let Some(series) = &options.series {
        return Err(VolumeError::refused(format!(
            "series {series} is requested, but a {} file has one volume",
            stored.header().format
        ))
        .hint("omit --series"));
    }
    let mut remarks = stored.header().remarks.clone();
    let grid = stored.header().grid.clone();
    let format = stored.format();
    let (hu, tally, of_bytes) = stored.hu(options, cancel)?;
    remarks.extend(of_bytes);
    let volume = Volume {
        grid,
        hu,
        slice_thickness_m: None,
    };
    remarks.extend(plausibility::remarks(&volume, &tally));
    Ok(ReadVolume {
        volume,
        remarks,
        description: Description {
            format,
            files: 1,
            padding_voxels: tally.padding + tally.not_numbers,
            ..Description::default()
        },
    })
}
