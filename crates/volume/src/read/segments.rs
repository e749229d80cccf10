//! Segments of a label map: their names, and the layers in which they may overlap.

use std::collections::BTreeMap;

use crate::{Remark, SurfaceTissue, VolumeError, structure_of};

/// Most layers of a segmentation.
const MOST_LAYERS: usize = 4096;

/// A segment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Segment {
    pub(super) name: String,
    pub(super) layer: usize,
    /// Of its voxels in its layer.
    pub(super) value: u16,
    /// Of its voxels in the label map.
    label: u16,
}

impl Segment {
    /// With its value as its label.
    pub(super) fn new(name: String, layer: usize, value: u16) -> Self {
        Self {
            name,
            layer,
            value,
            label: value,
        }
    }
}

/// The segments of a file, in its order; none of one with labels alone.
#[derive(Debug)]
pub(super) struct Segments {
    layers: usize,
    segments: Vec<Segment>,
}

impl Segments {
    /// Of a file that has no names of its labels.
    pub(super) const NONE: Self = Self {
        layers: 1,
        segments: Vec::new(),
    };

    /// Of `layers` numbers at each voxel. Where values repeat from layer to layer, labels are the numbers of the segments.
    pub(super) fn new(
        layers: usize,
        mut segments: Vec<Segment>,
        remarks: &mut Vec<Remark>,
    ) -> Result<Self, VolumeError> {
        if layers > MOST_LAYERS {
            return Err(VolumeError::refused(format!(
                "it has {layers} layers, at most {MOST_LAYERS} are read"
            ))
            .hint("export fewer segments"));
        }
        let mut values = BTreeMap::new();
        let mut repeats = false;
        for (number, segment) in (1_usize..).zip(&segments) {
            if segment.layer >= layers {
                return Err(VolumeError::refused(format!(
                    "segment {number} is in layer {}, but there are {layers}",
                    segment.layer
                ))
                .hint("export it again"));
            }
            if let Some((other, layer)) = values.insert(segment.value, (number, segment.layer)) {
                if layer == segment.layer {
                    return Err(VolumeError::refused(format!(
                        "segments {other} and {number} have the same value {} in one layer",
                        segment.value
                    ))
                    .hint("export it again"));
                }
                repeats = true;
            }
        }
        if repeats {
            for (label, segment) in (1_u16..).zip(&mut segments) {
                segment.label = label;
            }
            remarks.push(Remark::new(
                "values repeat from layer to layer: labels are the numbers of the segments, from 1",
            ));
        }
        Ok(Self { layers, segments })
    }

    /// Numbers at each voxel.
    pub(super) fn layers(&self) -> usize {
        self.layers
    }

    /// Labels with their names, in the order of the labels.
    pub(super) fn names(&self) -> Vec<(u16, String)> {
        let names = self.segments.iter();
        let mut names: Vec<_> = names.map(|each| (each.label, each.name.clone())).collect();
        names.sort();
        names
    }

    /// Makes labels of the layers; none where the values are the labels.
    pub(super) fn painter(&self) -> Option<Painter> {
        if self.layers == 1 {
            return None;
        }
        let mut ranks = vec![BTreeMap::new(); self.layers];
        for (rank, segment) in self.segments.iter().enumerate() {
            ranks[segment.layer].insert(segment.value, rank);
        }
        Some(Painter {
            ranks,
            labels: self.segments.iter().map(|each| each.label).collect(),
            layer: 0,
            last: None,
            overlaps: false,
            overlapping: 0,
            unknown: 0,
        })
    }
}

/// Makes labels of values that come voxel by voxel, layer by layer: of overlapping segments the last one.
#[derive(Debug)]
pub(super) struct Painter {
    /// Of each layer: places of the segments in their order, by value.
    ranks: Vec<BTreeMap<u16, usize>>,
    labels: Vec<u16>,
    layer: usize,
    last: Option<usize>,
    overlaps: bool,
    overlapping: u64,
    unknown: u64,
}

impl Painter {
    /// Takes a value, and gives the label of the voxel after its last one.
    pub(super) fn take(&mut self, value: u16) -> Option<u16> {
        if value != 0 {
            match (self.ranks[self.layer].get(&value), self.last) {
                (None, _) => self.unknown += 1,
                (Some(rank), None) => self.last = Some(*rank),
                (Some(rank), Some(last)) => {
                    self.overlapping += u64::from(!self.overlaps);
                    self.overlaps = true;
                    self.last = Some(last.max(*rank));
                }
            }
        }
        self.layer += 1;
        if self.layer < self.ranks.len() {
            return None;
        }
        self.layer = 0;
        self.overlaps = false;
        Some(self.last.take().map_or(0, |rank| self.labels[rank]))
    }

    /// What is worth knowing of what it took.
    pub(super) fn remarks(&self) -> Vec<Remark> {
        let mut remarks = Vec::new();
        if self.overlapping > 0 {
            remarks.push(in_several(self.overlapping));
        }
        if self.unknown > 0 {
            remarks.push(Remark::new(format!(
                "{} values belong to no segment and are ignored",
                self.unknown
            )));
        }
        remarks
    }
}

/// Of voxels in which segments overlap.
pub(super) fn in_several(voxels: u64) -> Remark {
    Remark::new(format!(
        "{voxels} voxels are in several segments: the last one is used"
    ))
}

/// Whether a name is a lesion's.
pub(super) fn is_lesion(name: &str) -> bool {
    structure_of(name).is_some_and(|structure| structure.tissue == SurfaceTissue::Lesion)
}

/// What a segment is called: its label; its coded type and side where the label has no known meaning and those have.
/// One that is coded as a lesion has a lesion's name, whatever place its label names.
pub(super) fn name_of(
    label: Option<&String>,
    coded_type: Option<String>,
    side: Option<String>,
    number: usize,
) -> String {
    let coded = coded_type.map(|name| match side {
        Some(side) => format!("{name} {side}"),
        None => name,
    });
    if let Some(coded) = coded.as_ref().filter(|coded| is_lesion(coded)) {
        // Lesions of one type are several: each keeps its own name, too.
        return match label {
            Some(label) if is_lesion(label) => label.clone(),
            Some(label) => format!("{coded} {label}"),
            None => format!("{coded} {number}"),
        };
    }
    let mut names = label.into_iter().chain(&coded);
    let known = names.find(|name| structure_of(name).is_some());
    let name = known.or(label).or(coded.as_ref());
    name.cloned().unwrap_or_else(|| format!("segment {number}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_coded_as_a_lesion_is_called_one_whatever_its_place() {
        for (label, coded, wanted) in [
            (Some("Lung left"), Some("Neoplasm"), "Neoplasm Lung left"),
            (Some("liver"), Some("Mass"), "Mass liver"),
            (Some("nodule 3"), Some("Neoplasm"), "nodule 3"),
            (None, Some("Neoplasm"), "Neoplasm 7"),
            (Some("Lung left"), Some("Organ"), "Lung left"),
            (Some("thing"), Some("Liver"), "Liver"),
            (None, None, "segment 7"),
        ] {
            let label = label.map(str::to_owned);
            let name = name_of(label.as_ref(), coded.map(str::to_owned), None, 7);
            assert_eq!(name, wanted);
        }
    }
}
