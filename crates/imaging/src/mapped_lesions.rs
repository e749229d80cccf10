//! Lesions that come in a label map.

use std::sync::atomic::AtomicBool;

use crate::components::{Components, Connectivity};
use crate::error::{ImagingError, Remark};
use crate::label_map::Given;
use crate::mask::IndexBox;
use crate::segment::{Lesion, LesionSeed, Segmentation};
use crate::structures::SurfaceTissue;
use crate::volume::Volume;

/// Fewer voxels are a slip of who drew them.
const LEAST_VOXELS: usize = 8;

/// Takes the lesions out of a label map: each connected part is one, and has the name of the seed that is in it, or that of
/// its label, with a number where there are several. Seeds in one are answered by it, and taken away.
pub(crate) fn mapped_lesions(
    given: &mut Vec<Given>,
    volume: &Volume,
    found: &Segmentation,
    seeds: &mut Vec<LesionSeed>,
    cancel: &AtomicBool,
    remarks: &mut Vec<Remark>,
) -> Result<Vec<Lesion>, ImagingError> {
    let is_lesion = |each: &mut Given| each.structure.tissue == SurfaceTissue::Lesion;
    let mut lesions: Vec<Lesion> = Vec::new();
    let mut small = 0;
    for each in given.extract_if(.., is_lesion) {
        let parts = Components::of(&each.mask, Connectivity::Faces);
        let sizes = parts.parts().iter().map(|part| part.voxels);
        let large = sizes
            .clone()
            .filter(|&voxels| voxels >= LEAST_VOXELS)
            .count();
        small += sizes.len() - large;
        let mut number = 0;
        for (at, part) in parts.parts().iter().enumerate() {
            if part.voxels < LEAST_VOXELS {
                continue;
            }
            number += 1;
            let own = &each.structure.name;
            let mut name = if large > 1 {
                format!("{own}_{number}")
            } else {
                own.clone()
            };
            let mask = parts.mask_of(|other| other == at);
            let is_in_it = |seed: &LesionSeed| {
                let voxel = volume
                    .grid
                    .voxel_at(&volume.grid.index_from_ct(&seed.point_m));
                voxel.is_some_and(|voxel| {
                    each.bounds.contains(voxel)
                        && mask.get([0, 1, 2].map(|axis| voxel[axis] - each.bounds.first[axis]))
                })
            };
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
            let bounds = IndexBox {
                first: [0, 1, 2].map(|axis| part.bounds.first[axis] + each.bounds.first[axis]),
                last: [0, 1, 2].map(|axis| part.bounds.last[axis] + each.bounds.first[axis]),
            };
            let mask = mask.cropped(&part.bounds);
            lesions.push(Lesion::outlined(
                name, volume, found, bounds, &mask, cancel,
            )?);
        }
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
    if small > 0 {
        say(format!(
            "{small} parts of lesions with less than {LEAST_VOXELS} voxels are omitted"
        ));
    }
    Ok(lesions)
}
