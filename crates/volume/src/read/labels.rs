//! Label maps of a CT, as 3D Slicer and TotalSegmentator write them.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::archive::{self, Unpacked};
use super::format::{Format, format_of};
use super::labelled::ReadLabels;
use super::order::Order;
use super::painted::{not_found, nothing_found};
use super::voxels::StoredVoxels;
use super::{ReadOptions, dicom, label_folder};
use crate::{LabelMap, VolumeError, VoxelGrid};

/// Reads a label map of the CT on `grid` from a DICOM segmentation or RT structure set, any format of volumes, or a
/// folder with a mask of one structure in each file.
///
/// Its voxels must be the CT's, to 0.01 mm at the corners; axes may run the other way or be in another order. It may
/// have a part of the CT's voxels, as 3D Slicer crops segmentations: the others have no label. Where segments overlap,
/// the last one counts; of masks in a folder and of contours, the one that is more specific.
pub fn read_labels(
    path: &Path,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<ReadLabels, VolumeError> {
    let unpacked = archive::unpacked(path, options, cancel)?;
    let path = unpacked.as_ref().map_or(path, Unpacked::path);
    let masks = label_folder::masks(path)?;
    if !masks.is_empty() {
        let (labels, remarks) = label_folder::read(&masks, grid, options, cancel)?;
        return Ok(ReadLabels {
            labels,
            remarks,
            is_numbered_here: true,
        });
    }
    let read = match format_of(path)? {
        Format::Dicom => dicom::read_labels(path, grid, options, cancel)?,
        Format::Stored(open) => of_stored(open(path, options)?, grid, options, cancel)?,
    };
    with_names_of_all(read)
}

fn of_stored(
    stored: StoredVoxels,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<ReadLabels, VolumeError> {
    let mut remarks = stored.header().remarks.clone();
    let own = stored.header().grid.clone();
    let names = stored.header().segments.names();
    let order = Order::between(&own, grid)?;
    let (values, of_bytes) = stored.labels(options, cancel)?;
    remarks.extend(of_bytes);
    let labels = if order.is_same(grid) {
        values
    } else {
        order.applied(&values, grid, options)?
    };
    remarks.extend(order.part(grid));
    Ok(ReadLabels {
        labels: LabelMap {
            grid: grid.clone(),
            labels,
            names,
        },
        remarks,
        is_numbered_here: false,
    })
}

/// With a name for each label that voxels have, and none for others: a structure without a voxel was not found, and is
/// not to be taken for one that is there.
fn with_names_of_all(mut read: ReadLabels) -> Result<ReadLabels, VolumeError> {
    let LabelMap { labels, names, .. } = &mut read.labels;
    let mut is_used = vec![false; 1 << 16];
    for label in &*labels {
        is_used[usize::from(*label)] = true;
    }
    is_used[0] = false;
    if !is_used.contains(&true) {
        return Err(nothing_found());
    }
    let empty = names.extract_if(.., |(label, _)| !is_used[usize::from(*label)]);
    let empty: Vec<String> = empty.map(|(_, name)| name).collect();
    read.remarks.extend(not_found(&empty));
    for (label, _) in &*names {
        is_used[usize::from(*label)] = false;
    }
    let nameless = (1..=u16::MAX).filter(|label| is_used[usize::from(*label)]);
    names.extend(nameless.map(|label| (label, format!("label {label}"))));
    names.sort();
    Ok(read)
}
