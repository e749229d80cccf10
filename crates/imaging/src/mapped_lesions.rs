//! Lesions that come in a label map.

use std::cmp::Reverse;
use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_volume::{Remark, SurfaceTissue, Volume, VolumeError};

use crate::components::{Components, Connectivity};
use crate::label_map::Given;
use crate::mask::IndexBox;
use crate::segment::{Lesion, LesionSeed, Segmentation};

/// Fewer voxels are a slip of who drew them.
const LEAST_VOXELS: usize = 8;

/// Most lesions that a label map may have: each is a goal with a surface of its own. More are noise of a segmentation.
pub(crate) const MOST_LESIONS: usize = 100;

/// Connected parts of a label.
struct Parts {
    given: Given,
    parts: Components,
}

impl Parts {
    /// The part that a seed is in.
    fn of_seed(&self, seed: &LesionSeed, volume: &Volume) -> Option<usize> {
        let grid = &volume.grid;
        let voxel = grid.voxel_at(&grid.index_from_ct(&seed.point_m))?;
        let bounds = &self.given.bounds;
        let is_near = bounds.contains(voxel);
        is_near
            .then(|| [0, 1, 2].map(|axis| voxel[axis] - bounds.first[axis]))
            .and_then(|voxel| self.parts.part_at(voxel))
    }
}

/// Takes the lesions out of a label map: each connected part is one, and has the name of the seed that is in it, or that of
/// its label, with a number where there are several. Seeds in one are answered by it, and taken away. Of more than
/// [`MOST_LESIONS`] those with a seed are taken, and then the largest.
pub(crate) fn mapped_lesions(
    given: &mut Vec<Given>,
    volume: &Volume,
    found: &Segmentation,
    seeds: &mut Vec<LesionSeed>,
    cancel: &AtomicBool,
    remarks: &mut Vec<Remark>,
) -> Result<Vec<Lesion>, VolumeError> {
    let is_lesion = |each: &mut Given| each.structure.tissue == SurfaceTissue::Lesion;
    let mut labels = Vec::new();
    for given in given.extract_if(.., is_lesion) {
        go_on(cancel)?;
        let parts = Components::of(&given.mask, Connectivity::Faces);
        labels.push(Parts { given, parts });
    }
    let (mut large, mut small) = (Vec::new(), 0);
    for (label, each) in labels.iter().enumerate() {
        let seeded: Vec<_> = seeds
            .iter()
            .filter_map(|it| each.of_seed(it, volume))
            .collect();
        for (part, it) in each.parts.parts().iter().enumerate() {
            if it.voxels < LEAST_VOXELS {
                small += 1;
            } else {
                large.push((!seeded.contains(&part), Reverse(it.voxels), label, part));
            }
        }
    }
    let count = large.len();
    large.sort_unstable();
    large.truncate(MOST_LESIONS);
    let mut taken: Vec<_> = large
        .iter()
        .map(|&(.., label, part)| (label, part))
        .collect();
    taken.sort_unstable();
    let mut lesions: Vec<Lesion> = Vec::new();
    let (mut label_before, mut number) = (None, 0);
    for &(label, part) in &taken {
        go_on(cancel)?;
        let Parts { given, parts } = &labels[label];
        number = if label_before == Some(label) {
            number + 1
        } else {
            1
        };
        label_before = Some(label);
        let own = &given.structure.name;
        let mut name = if taken.iter().filter(|(other, _)| *other == label).count() > 1 {
            format!("{own}_{number}")
        } else {
            own.clone()
        };
        let is_in_it = |seed: &LesionSeed| labels[label].of_seed(seed, volume) == Some(part);
        if let Some(first) = seeds.iter().find(|seed| is_in_it(seed)) {
            name.clone_from(&first.name);
        }
        seeds.retain(|seed| !is_in_it(seed));
        let is_taken = |name: &str| {
            seeds.iter().any(|seed| seed.name == name)
                || lesions.iter().any(|lesion| lesion.name == name)
        };
        while is_taken(&name) {
            name.push_str("_map");
        }
        let within = parts.parts()[part].bounds;
        let place = |at: [usize; 3]| [0, 1, 2].map(|axis| at[axis] + given.bounds.first[axis]);
        let bounds = IndexBox {
            first: place(within.first),
            last: place(within.last),
        };
        let mask = parts.mask_of(|other| other == part).cropped(&within);
        lesions.push(Lesion::outlined(
            name, volume, found, bounds, &mask, cancel,
        )?);
    }
    let mut say = |words: String| remarks.push(Remark::new(words).at("label map"));
    if !lesions.is_empty() {
        let names: Vec<&str> = lesions.iter().map(|lesion| lesion.name.as_str()).collect();
        say(format!(
            "lesions with its outlines: {} ({})",
            lesions.len(),
            names.join(", ")
        ));
    }
    if count > lesions.len() {
        say(format!(
            "it has {count} separate lesions: the largest {} are used, {} are omitted and are no \
             goals; is it a lesion map, and not noise?",
            lesions.len(),
            count - lesions.len()
        ));
    }
    if small > 0 {
        say(format!(
            "{small} parts of lesions with less than {LEAST_VOXELS} voxels are omitted"
        ));
    }
    Ok(lesions)
}

fn go_on(cancel: &AtomicBool) -> Result<(), VolumeError> {
    if cancel.load(Ordering::Relaxed) {
        return Err(VolumeError::Interrupted);
    }
    Ok(())
}
