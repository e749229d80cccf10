//! A folder with a mask of one structure in each file, as TotalSegmentator writes them.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use super::format::{Format, format_of};
use super::order::Order;
use super::painted::{Painted, painting_order};
use super::{ReadOptions, unreadable};
use crate::{LabelMap, Remark, VolumeError, VoxelGrid};

/// How the names of masks end; `.gz` may follow.
const ENDS: [&str; 7] = [".nii", ".nrrd", ".nhdr", ".mha", ".mhd", ".mgh", ".mgz"];

/// Most files of a folder.
const MOST_FILES: usize = 4096;

/// A file, and the name of its structure.
#[derive(Debug)]
struct MaskFile {
    path: PathBuf,
    name: String,
}

/// A folder, with its masks in the order of their names.
#[derive(Debug, Default)]
pub(super) struct MaskFolder {
    masks: Vec<MaskFile>,
    /// Other files.
    others: Vec<PathBuf>,
}

impl MaskFolder {
    pub(super) fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// That there is DICOM, too: a segmentation of which nothing is read.
    fn dicom(&self) -> Option<Remark> {
        let is_dicom = |path: &&PathBuf| matches!(format_of(path), Ok(Format::Dicom));
        let mut dicom = self.others.iter().filter(is_dicom);
        let first = dicom.next()?.file_name()?.to_string_lossy().into_owned();
        Some(Remark::new(format!(
            "DICOM files beside the masks are ignored ({}, such as `{first}`): a segmentation among them is read by \
             its own name",
            1 + dicom.count()
        )))
    }
}

/// The masks of a folder; none if it is no folder, or has no volume in it.
pub(super) fn masks(path: &Path) -> Result<MaskFolder, VolumeError> {
    let (mut masks, mut others) = (Vec::new(), Vec::new());
    if !path.is_dir() {
        return Ok(MaskFolder::default());
    }
    for entry in path.read_dir().map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if !path.is_file() {
            continue;
        }
        match structure_name(&path) {
            Some(name) => masks.push(MaskFile { path, name }),
            None => others.push(path),
        }
    }
    if masks.len() > MOST_FILES {
        return Err(VolumeError::refused(format!(
            "the folder has {} volumes, at most {MOST_FILES} masks are read",
            masks.len()
        ))
        .hint("name the folder of one segmentation"));
    }
    masks.sort_by(|a, b| a.path.cmp(&b.path));
    others.sort();
    Ok(MaskFolder { masks, others })
}

/// The name of a file without what its format adds.
fn structure_name(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    let lower = name.to_ascii_lowercase();
    let bare = lower.strip_suffix(".gz").unwrap_or(&lower);
    let bare = ENDS.iter().find_map(|end| bare.strip_suffix(end))?;
    let bare = bare.strip_suffix(".seg").unwrap_or(bare);
    // Programs leave hidden files behind.
    let is_shown = !bare.is_empty() && !bare.starts_with('.');
    is_shown.then(|| name.get(..bare.len()).unwrap_or(bare).to_owned())
}

/// Reads the masks one after another; the label of each is its number, from 1.
pub(super) fn read(
    folder: &MaskFolder,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<(LabelMap, Vec<Remark>), VolumeError> {
    let masks = &folder.masks;
    let names: Vec<String> = masks.iter().map(|mask| mask.name.clone()).collect();
    let mut painted = Painted::new(grid, masks.len(), options)?;
    let mut remarks = Vec::new();
    for at in painting_order(&names) {
        let file = masks[at].path.file_name().unwrap_or_default();
        let file = file.to_string_lossy().into_owned();
        let of_file = paint(&masks[at].path, at, &mut painted, grid, options, cancel)
            .map_err(|error| error.at(file.clone()))?;
        for mut remark in of_file {
            remark.message = format!("{file}: {}", remark.message);
            remarks.push(remark);
        }
    }
    remarks.insert(
        0,
        Remark::new(format!(
            "a folder with masks of {} structures, named by their files",
            masks.len()
        )),
    );
    let (map, of_map) = painted.finish(grid, names)?;
    remarks.extend(of_map);
    remarks.extend(folder.dicom());
    Ok((map, remarks))
}

/// Paints one mask: all its voxels that are not 0, which have one value.
fn paint(
    path: &Path,
    structure: usize,
    painted: &mut Painted,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<Vec<Remark>, VolumeError> {
    let Format::Stored(open) = format_of(path)? else {
        return Err(
            VolumeError::refused("it is DICOM, although it is not named so")
                .hint("name it by itself, or convert it to NIfTI"),
        );
    };
    let stored = open(path, options)?;
    let mut remarks = stored.header().remarks.clone();
    let own = stored.header().grid.clone();
    let order = Order::between(&own, grid)?;
    let (first, steps) = order.steps(grid);
    let [nx, ny, _] = own.size();
    let (mut value, mut other) = (0, 0);
    let of_bytes = stored.each_label(options, cancel, |at, label| {
        if value == 0 {
            value = label;
        } else if value != label {
            other = label;
        }
        let index = [at % nx, at / nx % ny, at / (nx * ny)];
        let step: isize = (0..3)
            .map(|axis| index[axis].cast_signed() * steps[axis])
            .sum();
        painted.paint(first.wrapping_add_signed(step), structure);
    })?;
    if other != 0 {
        return Err(VolumeError::refused(format!(
            "it has several labels, {} and {} among them: in a folder each file has the mask of one structure",
            value.min(other),
            value.max(other)
        ))
        .hint("name a label map with all structures by its file, not by its folder"));
    }
    remarks.extend(of_bytes);
    remarks.extend(order.part(grid));
    Ok(remarks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_are_named_by_files_without_their_format() {
        for (file, name) in [
            ("rib_left_7.nii.gz", Some("rib_left_7")),
            ("Lung.NII", Some("Lung")),
            ("Heart.seg.nrrd", Some("Heart")),
            ("aorta.mha", Some("aorta")),
            ("statistics.json", None),
            (".nii.gz", None),
            ("._rib_left_7.nii.gz", None),
            ("rib_left_7.gz", None),
        ] {
            let found = structure_name(Path::new(file));
            assert_eq!(found.as_deref(), name, "{file}");
        }
    }
}
