//! Structures that overlap, made into one label map: what is more specific hides what is less.

use super::{ReadOptions, zeroed};
use crate::{LabelMap, Remark, SurfaceTissue, VolumeError, VoxelGrid, structure_of};

/// Names that a sentence lists.
const LISTED: usize = 8;

/// In which order structures of these names are painted: unknown ones and the outside first, lesions last.
pub(super) fn painting_order(names: &[String]) -> Vec<usize> {
    let rank = |name: &str| match structure_of(name).map(|structure| structure.tissue) {
        None => 0,
        Some(SurfaceTissue::Skin) => 1,
        Some(SurfaceTissue::Beside) => 2,
        Some(SurfaceTissue::Lung) => 3,
        Some(SurfaceTissue::Organ) => 4,
        Some(SurfaceTissue::Vessel) => 5,
        Some(SurfaceTissue::Bone) => 6,
        Some(SurfaceTissue::Lesion) => 7,
    };
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by_key(|&at| rank(&names[at]));
    order
}

/// A label map that is painted structure by structure. Labels are the structures' numbers, from 1.
#[derive(Debug)]
pub(super) struct Painted {
    labels: Vec<u16>,
    /// Bits of voxels that are in more than one.
    several: Vec<u64>,
    /// By label, painted.
    voxels: Vec<usize>,
}

impl Painted {
    /// Of so many structures.
    pub(super) fn new(
        grid: &VoxelGrid,
        structures: usize,
        options: &ReadOptions,
    ) -> Result<Self, VolumeError> {
        if u16::try_from(structures).is_err() {
            return Err(VolumeError::refused(format!(
                "it has {structures} structures, at most {} are read",
                u16::MAX
            ))
            .hint("export fewer structures"));
        }
        options.check_memory(grid, (grid.len() * size_of::<u16>()) as u64)?;
        Ok(Self {
            labels: zeroed(grid.len())?,
            several: zeroed(grid.len().div_ceil(64))?,
            voxels: vec![0; structures + 1],
        })
    }

    /// Paints a voxel for the structure of this index.
    pub(super) fn paint(&mut self, offset: usize, structure: usize) {
        let label = u16::try_from(structure + 1).unwrap_or(u16::MAX);
        let old = std::mem::replace(&mut self.labels[offset], label);
        if old == label {
            return;
        }
        self.voxels[structure + 1] += 1;
        if old != 0 {
            self.several[offset / 64] |= 1 << (offset % 64);
        }
    }

    /// The label map, with what is to be said of it; `names` in the order of the structures.
    pub(super) fn finish(
        self,
        grid: &VoxelGrid,
        names: Vec<String>,
    ) -> Result<(LabelMap, Vec<Remark>), VolumeError> {
        let mut is_left = vec![false; self.voxels.len()];
        for &label in &self.labels {
            is_left[usize::from(label)] = true;
        }
        let mut remarks = Vec::new();
        let (mut empty, mut hidden, mut left) = (Vec::new(), Vec::new(), Vec::new());
        for (label, name) in (1_u16..).zip(names) {
            if self.voxels[usize::from(label)] == 0 {
                empty.push(name);
            } else if is_left[usize::from(label)] {
                left.push((label, name));
            } else {
                hidden.push(name);
            }
        }
        if left.is_empty() {
            return Err(nothing_found());
        }
        let several: u32 = self.several.iter().map(|bits| bits.count_ones()).sum();
        if several > 0 {
            remarks.push(Remark::new(format!(
                "{several} voxels are in several structures: lesions before bone, vessels, organs, lungs \
                 and the outside"
            )));
        }
        if !hidden.is_empty() {
            remarks.push(Remark::new(format!(
                "others have all voxels of {}",
                listed(&hidden)
            )));
        }
        remarks.extend(not_found(&empty));
        let map = LabelMap {
            grid: grid.clone(),
            labels: self.labels,
            names: left,
        };
        Ok((map, remarks))
    }
}

/// A label map in which nothing is labelled.
pub(super) fn nothing_found() -> VolumeError {
    VolumeError::refused("no voxel has a label: nothing was found in it")
        .hint("check the segmentation in the program that made it, or omit --labels")
}

/// Of structures that a label map names and does not have.
pub(super) fn not_found(names: &[String]) -> Option<Remark> {
    (!names.is_empty()).then(|| {
        Remark::new(format!(
            "nothing was found of {}: no voxels, what the volume shows of them stays",
            listed(names)
        ))
    })
}

/// Names for a sentence, not too many of them.
pub(super) fn listed(names: &[String]) -> String {
    let first = names.iter().take(LISTED).map(|name| format!("`{name}`"));
    let text = first.collect::<Vec<_>>().join(", ");
    match names.len().checked_sub(LISTED) {
        None | Some(0) => text,
        Some(more) => format!("{text} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn what_is_more_specific_is_painted_later() {
        let names = names(&[
            "lung_nodules",
            "rib_left_1",
            "thing",
            "aorta",
            "body",
            "lung_left",
            "heart",
        ]);
        assert_eq!(painting_order(&names), [2, 4, 5, 6, 3, 1, 0]);
    }

    #[test]
    fn voxels_in_several_structures_are_counted_once() {
        let grid = VoxelGrid::aligned([4, 1, 1], [1e-3; 3], Point3::origin()).unwrap();
        let mut painted = Painted::new(&grid, 4, &ReadOptions::default()).unwrap();
        for (offset, structure) in [(0, 0), (1, 0), (1, 1), (0, 1), (0, 2), (0, 2)] {
            painted.paint(offset, structure);
        }
        let (map, remarks) = painted.finish(&grid, names(&["a", "b", "c", "d"])).unwrap();
        assert_eq!(map.labels, [3, 2, 0, 0]);
        assert_eq!(map.names, [(2, "b".to_owned()), (3, "c".to_owned())]);
        let said: Vec<&str> = remarks.iter().map(|remark| &*remark.message).collect();
        assert!(said[0].starts_with("2 voxels are in several"), "{said:?}");
        assert_eq!(said[1], "others have all voxels of `a`");
        assert!(said[2].starts_with("nothing was found of `d`:"), "{said:?}");
        let empty = Painted::new(&grid, 1, &ReadOptions::default()).unwrap();
        assert_eq!(empty.finish(&grid, names(&["a"])), Err(nothing_found()));
    }
}
