//! A label map from elsewhere, by which what was found in the volume is completed.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::Point3;
use needlebench_volume::{
    LabelMap, Remark, Structure, SurfaceTissue, Volume, VolumeError, VoxelGrid, structure_of,
};

use crate::components::{Components, Connectivity};
use crate::field_of_view::FieldOfView;
use crate::mask::{IndexBox, Mask};
use crate::morphology::dilated;
use crate::segment::{
    FIRST_LESION, Label, LabelFacts, Lesion, Segmentation, Side, label_facts, label_map, paint,
};
use crate::spacing::orthogonal;

/// A structure of a label map from elsewhere.
pub(crate) struct Given {
    pub structure: Structure,
    pub bounds: IndexBox,
    pub mask: Mask,
}

/// A label map within a field of view: what was drawn beyond it, as of another series or by a program that completes
/// bodies, has neither skin around it nor values under it.
pub(crate) fn seen_labels<'a>(
    map: &'a LabelMap,
    grid: &VoxelGrid,
    seen: &FieldOfView,
    remarks: &mut Vec<Remark>,
) -> Result<Cow<'a, LabelMap>, VolumeError> {
    check_same_grid(&map.grid, grid)?;
    let Some(unseen) = seen.unseen(grid) else {
        return Ok(Cow::Borrowed(map));
    };
    let mut counts: BTreeMap<u16, usize> = BTreeMap::new();
    let mut within = map.clone();
    for voxel in unseen.voxels() {
        let label = &mut within.labels[grid.offset(voxel)];
        if *label != 0 {
            *counts.entry(*label).or_default() += 1;
            *label = 0;
        }
    }
    let known = map.names.iter().filter_map(|(label, name)| {
        structure_of(name)?;
        let ml = 1e6 * *counts.get(label)? as f64 * grid.steps_m().determinant().abs();
        Some(format!("`{name}` {ml:.1} ml"))
    });
    let known: Vec<String> = known.collect();
    if known.is_empty() {
        return Ok(Cow::Borrowed(map));
    }
    let words = format!(
        "beyond the field of view, where the scan shows nothing, it is left out: {}",
        known.join(", ")
    );
    remarks.push(Remark::new(words).at("label map"));
    Ok(Cow::Owned(within))
}

/// Structures that a label map names, each with all its labels.
pub(crate) fn given_structures(
    map: &LabelMap,
    grid: &VoxelGrid,
    remarks: &mut Vec<Remark>,
) -> Result<Vec<Given>, VolumeError> {
    check_same_grid(&map.grid, grid)?;
    if map.names.len() > MOST_LABELS {
        return Err(VolumeError::refused(format!(
            "it has {} labels, at most {MOST_LABELS} are read",
            map.names.len()
        ))
        .at("label map")
        .hint("is it an image or a probability map instead of a label map?"));
    }
    let mut structures: BTreeMap<String, (Structure, Vec<u16>)> = BTreeMap::new();
    let mut unknown = Vec::new();
    for (label, name) in &map.names {
        match structure_of(name) {
            Some(structure) => {
                let entry = structures.entry(structure.name.clone());
                entry.or_insert((structure, Vec::new())).1.push(*label);
            }
            None => unknown.push(format!("{label} `{name}`")),
        }
    }
    if !unknown.is_empty() {
        remarks.push(
            Remark::new(format!(
                "labels without a known meaning are ignored: {}",
                unknown.join(", ")
            ))
            .at("label map"),
        );
    }
    let mut given = Vec::new();
    for (structure, labels) in structures.into_values() {
        let mut wanted = vec![false; 1 << 16];
        for label in labels {
            wanted[usize::from(label)] = true;
        }
        let mask = Mask::of(grid.size(), &map.labels, |label| wanted[usize::from(label)]);
        if let Some(bounds) = mask.bounds() {
            given.push(Given {
                structure,
                mask: mask.cropped(&bounds),
                bounds,
            });
        }
    }
    Ok(given)
}

/// Vessels within a lung, which belong to it.
const LUNG_VESSELS: &str = "lung_vessels";

/// First number of what was found beside a label map from elsewhere, unless that uses it.
const FIRST_OWN: u16 = 1000;

/// Most labels of a map from elsewhere: what was found beside it has numbers of its own.
const MOST_LABELS: usize = 60_000;

/// A hundredth of a voxel at the corners: what rounding of headers to single precision leaves.
const SAME_PLACE: f64 = 0.01;

fn check_same_grid(map: &VoxelGrid, volume: &VoxelGrid) -> Result<(), VolumeError> {
    let hint =
        "resample the label map to the volume (3D Slicer: Resample Image, with nearest neighbour)";
    if map.size() != volume.size() {
        let words = |[i, j, k]: [usize; 3]| format!("{i} x {j} x {k}");
        return Err(VolumeError::refused(format!(
            "it has {} voxels, the volume {}",
            words(map.size()),
            words(volume.size())
        ))
        .at("label map")
        .hint(hint));
    }
    let spacing_m = volume.spacing_m().into_iter().fold(f64::INFINITY, f64::min);
    for corner in 0..8_usize {
        let index = Point3::from([0, 1, 2].map(|axis| {
            if corner >> axis & 1 == 1 {
                volume.size()[axis] as f64 - 1.0
            } else {
                0.0
            }
        }));
        let apart_m = (map.ct_from_index(&index) - volume.ct_from_index(&index)).norm();
        if apart_m > SAME_PLACE * spacing_m {
            return Err(VolumeError::refused(format!(
                "its corners are up to {:.2} mm from the volume's",
                1e3 * apart_m
            ))
            .at("label map")
            .hint(hint));
        }
    }
    Ok(())
}

/// Whether a structure can be what it is called: an outside that holds less than half of the body is a part of it, or
/// its hull alone.
pub(crate) fn is_solid(
    each: &Given,
    found: &Segmentation,
    grid: &VoxelGrid,
    remarks: &mut Vec<Remark>,
) -> bool {
    let (has, body) = (each.mask.count(), found.body.mask.count());
    let is_solid = each.structure.tissue != SurfaceTissue::Skin || 2 * has >= body;
    if !is_solid {
        let litres = |voxels: usize| 1e3 * voxels as f64 * grid.steps_m().determinant().abs();
        let words = format!(
            "its outside has {:.2} l, the body {:.2} l: the skin is taken from the volume",
            litres(has),
            litres(body)
        );
        remarks.push(Remark::new(words).at("label map"));
    }
    is_solid
}

/// Fills an outside of a label map: where other structures have the voxels within it, it is hollow.
///
/// What it encloses in its slices is in it, also where the first or the last one cuts a lung open.
pub(crate) fn fill_outside(each: &mut Given) {
    if each.structure.tissue != SurfaceTissue::Skin {
        return;
    }
    let around = Components::of(&each.mask.complement(), Connectivity::Faces);
    let [nx, ny, _] = each.mask.size();
    let within = around.mask_of(|part| {
        let bounds = &around.parts()[part].bounds;
        bounds.first[0] > 0
            && bounds.first[1] > 0
            && bounds.last[0] < nx - 1
            && bounds.last[1] < ny - 1
    });
    each.mask.unite(&within);
}

/// Bone nearer to a bone of the label map than this is the same bone, drawn otherwise, m.
const SAME_BONE_M: f64 = 2e-3;

/// Less bone apart from that of the label map is calcified, or noise, m^3.
const LEAST_OTHER_BONE_M3: f64 = 0.5e-6;

/// What map and volume say differently is said from here on, m^3.
const WORTH_SAYING_M3: f64 = 1e-6;

/// Completes what was found by the structures of a label map.
///
/// A structure of the map has its voxels. What was found elsewhere stays, as no map says that it is complete: one with
/// a single vertebra would else take the ribs away. Bone that was found yields to vessels, organs and lesions of the
/// map alone, and not to its lungs: a rib in a lung's label is a rib. Bone apart from that of the map is returned.
pub(crate) fn complete(
    found: &mut Segmentation,
    given: &[Given],
    grid: &VoxelGrid,
    remarks: &mut Vec<Remark>,
) -> Result<Option<Mask>, VolumeError> {
    let body = found.body.bounds;
    let size = found.body.mask.size();
    let union_of = |wanted: &dyn Fn(&Structure) -> bool| {
        let mut whole = Mask::empty(size);
        for each in given.iter().filter(|each| wanted(&each.structure)) {
            whole.unite_within(&each.bounds, &each.mask);
        }
        whole.cropped(&body)
    };
    let voxel_m3 = grid.steps_m().determinant().abs();
    let volume_m3 = |mask: &Mask| mask.count() as f64 * voxel_m3;
    let mut say = |mask: &Mask, words: &dyn Fn(String) -> String| {
        let volume_m3 = volume_m3(mask);
        if volume_m3 >= WORTH_SAYING_M3 {
            let remark = Remark::new(words(format!("{:.0} ml", 1e6 * volume_m3)));
            remarks.push(remark.at("label map"));
        }
    };

    let not_lung = union_of(&|structure| match structure.tissue {
        SurfaceTissue::Bone | SurfaceTissue::Organ => true,
        SurfaceTissue::Vessel => structure.name != LUNG_VESSELS,
        _ => false,
    });
    for (side, other) in [(Side::Left, Side::Right), (Side::Right, Side::Left)] {
        let name = side.structure();
        let [mapped, other] = [side, other].map(|side| union_of(&|it| it.name == side.structure()));
        for lung in found.lungs.lungs.iter_mut().filter(|it| it.side == side) {
            lung.mask.subtract(&not_lung);
            lung.mask.subtract(&other);
            if !mapped.is_empty() {
                let mut more = lung.mask.clone();
                more.subtract(&mapped);
                say(&more, &|volume| {
                    format!(
                        "it lacks {volume} of the `{name}` found in the volume, which stay lung"
                    )
                });
                lung.mask.unite(&mapped);
            }
        }
    }

    // A thin wall may let the air of a lung out of what was found as the body.
    let lungs = union_of(&|structure| structure.tissue == SurfaceTissue::Lung);
    let mut whole = found.body.mask.cropped(&body);
    let known = whole.clone();
    whole.unite(&lungs);
    if whole.count() > known.count() {
        // Not what the map calls a lung on the couch.
        let parts = Components::of(&whole, Connectivity::Faces);
        let mut has_body = vec![false; parts.parts().len()];
        for (part, [from, to], j, k) in parts.runs() {
            has_body[part] = has_body[part] || (from..to).any(|i| known.get([i, j, k]));
        }
        found
            .body
            .mask
            .unite_within(&body, &parts.mask_of(|part| has_body[part]));
    }

    let mapped = union_of(&|structure| structure.tissue == SurfaceTissue::Bone);
    let not_bone = union_of(&|structure| {
        matches!(
            structure.tissue,
            SurfaceTissue::Vessel | SurfaceTissue::Organ | SurfaceTissue::Lesion
        )
    });
    let mut other = found.bone.bone.clone();
    other.subtract(&mapped);
    let mut yields = other.clone();
    yields.intersect(&not_bone);
    say(&yields, &|volume| {
        format!(
            "{volume} as dense as bone are vessel, organ or lesion in it, and are taken as that"
        )
    });
    other.subtract(&not_bone);
    found.bone.bone.clone_from(&other);
    found.bone.bone.unite(&mapped);
    found.bone.blurred.subtract(&not_bone);
    found.bone.contrast.subtract(&mapped);
    found.bone.contrast.subtract(&not_bone);
    let cartilage = union_of(&|structure| structure.name == Label::Cartilage.name());
    if !cartilage.is_empty() {
        found.bone.cartilage = Mask::empty(cartilage.size());
    }
    found.bone.cartilage.subtract(&mapped);
    found.bone.cartilage.subtract(&not_bone);
    if mapped.is_empty() {
        return Ok(None);
    }
    let spacing_m = orthogonal(grid)?;
    let mut apart = other.clone();
    apart.subtract(&dilated(&mapped, SAME_BONE_M, spacing_m));
    let parts = Components::of(&apart, Connectivity::Faces);
    let is_worth =
        |part: usize| parts.parts()[part].voxels as f64 * voxel_m3 >= LEAST_OTHER_BONE_M3;
    let mut near = dilated(&parts.mask_of(is_worth), 1.5 * SAME_BONE_M, spacing_m);
    near.intersect(&other);
    say(&near, &|volume| {
        format!("it lacks {volume} of the bone found in the volume, which stay bone")
    });
    // With what is blurred around it: the surface is looked for in it.
    let mut blurred = dilated(&near, SAME_BONE_M, spacing_m);
    blurred.intersect(&found.bone.blurred);
    blurred.subtract(&mapped);
    near.unite(&blurred);
    Ok(Some(near).filter(|bone| !bone.is_empty()))
}

/// What a label without a known meaning may name.
const SOFT_LABEL: u16 = Label::SoftTissue as u16;

/// The label map of what was found and given, by the rules of [`complete`]; lesions stand before both.
pub(crate) fn completed_labels(
    volume: &Volume,
    found: &Segmentation,
    lesions: &[Lesion],
    given: &LabelMap,
) -> (LabelMap, Vec<LabelFacts>) {
    let (own, _) = label_map(volume, found, &[]);
    let mut is_used = vec![false; 1 << 16];
    for &label in &given.labels {
        is_used[usize::from(label)] = true;
    }
    for (label, _) in &given.names {
        is_used[usize::from(*label)] = true;
    }
    let mut map = given.clone();
    let mut numbers: Vec<u16> = vec![0; 1 << 16];
    let unused = (FIRST_OWN..=u16::MAX).filter(|&label| !is_used[usize::from(label)]);
    for (number, (label, name)) in unused.zip(&own.names) {
        numbers[usize::from(*label)] = number;
        map.names.push((number, name.clone()));
    }
    let mut tissues: Vec<Option<SurfaceTissue>> = vec![None; 1 << 16];
    for (label, name) in &given.names {
        tissues[usize::from(*label)] = structure_of(name).map(|structure| structure.tissue);
    }
    let stays_in_lung = [
        Label::Airways,
        Label::LungVessels,
        Label::Bone,
        Label::ContrastVessels,
        Label::Cartilage,
        Label::NoLung,
    ]
    .map(|label| label as u16);
    for (label, own) in map.labels.iter_mut().zip(&own.labels) {
        let is_given = match tissues[usize::from(*label)] {
            _ if *label == 0 => false,
            Some(SurfaceTissue::Lung) => !stays_in_lung.contains(own),
            // The outside alone, or no known meaning: nothing that was found within the body.
            Some(SurfaceTissue::Skin) => matches!(*own, 0 | SOFT_LABEL),
            None => *own == SOFT_LABEL,
            Some(_) => true,
        };
        if !is_given {
            *label = numbers[usize::from(*own)];
        }
    }
    for &number in &numbers {
        is_used[usize::from(number)] = true;
    }
    // After those of others, where a map leaves none before.
    let unused = (FIRST_LESION..=u16::MAX).filter(|&label| !is_used[usize::from(label)]);
    for (label, lesion) in unused.zip(lesions) {
        paint(&mut map, &lesion.bounds, &lesion.mask, label);
        map.names.push((label, lesion.name.clone()));
    }
    map.names.sort();
    let mut facts = label_facts(&map);
    // Its lesions have labels of their own now.
    facts.retain(|fact| {
        let tissue = tissues[usize::from(fact.label)];
        tissue != Some(SurfaceTissue::Lesion) || fact.voxels > 0
    });
    map.names
        .retain(|(label, _)| facts.iter().any(|fact| fact.label == *label));
    (map, facts)
}
