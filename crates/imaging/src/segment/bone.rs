//! Bone, and vessels with contrast medium.

use needlebench_volume::{Remark, VolumeError};

use crate::components::{Components, Connectivity};
use crate::mask::{IndexBox, Mask};
use crate::morphology::closed;
use crate::spacing::whole;
use crate::surface::{local_level, refine};

use super::body::Body;
use super::lungs::{IN_FRONT, Lungs, is_between};
use super::{Scan, blood, cartilage};

/// Denser than soft tissue and blood without contrast medium.
pub(crate) const BONE_LEVEL_HU: f64 = 190.5;

/// What is around bone and counts for its level: soft tissue, not lung.
pub(crate) const SOFT_FROM_HU: i16 = -200;

/// What is bone has some voxels that are denser than this: hysteresis against noise.
const SURE_HU: i16 = 280;

/// Cortical bone; blood with contrast medium is less dense.
const CORTICAL_HU: i16 = 450;

/// A bone has at least this share of cortical voxels.
const CORTICAL_SHARE: f64 = 0.02;

/// Less is noise, calcification or an artefact, mm^3.
const LEAST_BONE_MM3: f64 = 50.0;

/// Heart and great vessels with contrast medium have at least this; less is calcified, or bone that thick slices blur.
const LEAST_CONTRAST_L: f64 = 1e-3;

/// Gaps in the shell of a bone that are closed.
const CLOSING_M: f64 = 1.2e-3;

/// Marrow that a shell encloses.
const MOST_MARROW_L: f64 = 0.3;

/// Larger parts are never things on the skin: markers, leads, wires.
const MOST_ON_SKIN_L: f64 = 3e-3;
/// What is nearer to the outside than this is on the skin, m: bones have more cover.
const ON_SKIN_M: f64 = 2.5e-3;
/// Share of a part that is so near if it lies on the skin.
const ON_SKIN_SHARE: f64 = 0.2;

/// A part that is not surely bone or contrast medium and is worth a remark.
const UNSURE_L: f64 = 1e-3;

/// Bone and what is as dense. Masks are of the box.
#[derive(Debug, Clone)]
pub struct Bone {
    /// The box that the masks cover: the body's.
    pub bounds: IndexBox,
    /// Bone with its marrow.
    pub bone: Mask,
    /// The same with what is blurred around it: all above the level. Its surface is looked for in it.
    pub blurred: Mask,
    /// Blood with contrast medium: dense, but nowhere as dense as cortical bone.
    pub contrast: Mask,
    /// Costal cartilage.
    pub cartilage: Mask,
    /// Between muscle and cartilage, HU.
    pub cartilage_level_hu: f64,
}

pub(super) fn find(
    scan: &Scan<'_>,
    body: &Body,
    lungs: &Lungs,
    remarks: &mut Vec<Remark>,
) -> Result<Bone, VolumeError> {
    let bounds = body.bounds;
    let mut dense = scan.denser(&body.mask.cropped(&bounds), &bounds, scan.levels.bone_hu);
    scan.check()?;
    let pools = blood::find(scan, body, lungs, &dense, &bounds)?;
    dense.subtract(&pools);
    scan.check()?;
    let parts = Components::of(&dense, Connectivity::Faces);
    let facts = densities(scan, &parts, &bounds);
    let least = whole((1e-9 * LEAST_BONE_MM3 / scan.voxel_m3()).ceil()).max(1);
    let near_outside = near_outside(scan, &parts, body);
    let kinds: Vec<Kind> = parts
        .parts()
        .iter()
        .zip(facts.iter().zip(near_outside))
        .map(|(part, (facts, near_outside))| {
            if part.voxels < least || facts.sure == 0 {
                Kind::Speck
            } else if near_outside as f64 >= ON_SKIN_SHARE * part.voxels as f64 {
                Kind::OnSkin
            } else if facts.cortical as f64 >= CORTICAL_SHARE * part.voxels as f64 {
                Kind::Bone
            } else if part.voxels >= scan.voxels_of(LEAST_CONTRAST_L)
                && is_between(scan, body, lungs, part, IN_FRONT)
            {
                Kind::Contrast
            } else {
                Kind::Unsure
            }
        })
        .collect();
    note_unsure(scan, &parts, &kinds, &pools, remarks);
    let of_kind = |wanted: &[Kind]| parts.mask_of(|part| wanted.contains(&kinds[part]));
    let mut blurred = solid(scan, &of_kind(&[Kind::Bone, Kind::Unsure]))?;
    blurred.subtract(&pools);
    scan.check()?;
    let (hu, grid) = (&scan.volume.hu, &scan.volume.grid);
    let levels = local_level(hu, grid, &blurred, &bounds, |hu| hu > SOFT_FROM_HU);
    let bone = levels.map_or_else(
        || blurred.clone(),
        |levels| {
            let mut bone = refine(hu, grid, &blurred, &bounds, &levels);
            bone.intersect(&blurred);
            bone
        },
    );
    let mut contrast = of_kind(&[Kind::Contrast]);
    contrast.subtract(&blurred);
    contrast.unite(&pools);
    if bone.is_empty() {
        remarks.push(Remark::new(format!(
            "no bone found: nothing in the body is denser than {SURE_HU} HU"
        )));
    }
    let (cartilage, cartilage_level_hu) =
        cartilage::find(scan, body, lungs, [&blurred, &contrast], &bounds)?;
    Ok(Bone {
        bounds,
        bone,
        blurred,
        contrast,
        cartilage,
        cartilage_level_hu,
    })
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Speck,
    /// A thing on the skin.
    OnSkin,
    Bone,
    Contrast,
    Unsure,
}

#[derive(Debug, Clone, Copy, Default)]
struct Density {
    sure: usize,
    cortical: usize,
}

fn densities(scan: &Scan<'_>, parts: &Components, bounds: &IndexBox) -> Vec<Density> {
    let mut facts = vec![Density::default(); parts.parts().len()];
    for (part, run, j, k) in parts.runs() {
        let there = run.map(|i| i + bounds.first[0]);
        for &hu in scan.row(there, j + bounds.first[1], k + bounds.first[2]) {
            facts[part].sure += usize::from(hu > SURE_HU);
            facts[part].cortical += usize::from(hu > CORTICAL_HU);
        }
    }
    facts
}

/// How many voxels of each small part have the outside next to them, along one of the axes.
fn near_outside(scan: &Scan<'_>, parts: &Components, body: &Body) -> Vec<usize> {
    let mut counts = vec![0; parts.parts().len()];
    let most = scan.voxels_of(MOST_ON_SKIN_L);
    let reach = scan
        .spacing_m
        .map(|step_m| whole(ON_SKIN_M / step_m).max(1));
    let size = scan.size();
    let is_near = |voxel: [usize; 3]| {
        (0..3).any(|axis| {
            (1..=reach[axis]).any(|steps| {
                let beside = |at: Option<usize>| {
                    let Some(at) = at.filter(|&at| at < size[axis]) else {
                        // Beyond the volume nothing is known.
                        return false;
                    };
                    let mut next = voxel;
                    next[axis] = at;
                    !body.mask.get(next)
                };
                beside(voxel[axis].checked_sub(steps)) || beside(Some(voxel[axis] + steps))
            })
        })
    };
    for (part, run, j, k) in parts.runs() {
        if parts.parts()[part].voxels > most {
            continue;
        }
        let [i0, j0, k0] = body.bounds.first;
        for i in run {
            counts[part] += usize::from(is_near([i + i0, j + j0, k + k0]));
        }
    }
    counts
}

fn note_unsure(
    scan: &Scan<'_>,
    parts: &Components,
    kinds: &[Kind],
    pools: &Mask,
    remarks: &mut Vec<Remark>,
) {
    let sum = |wanted: Kind| {
        let of_kind = parts
            .parts()
            .iter()
            .zip(kinds)
            .filter(|(_, kind)| **kind == wanted);
        scan.litres(of_kind.map(|(part, _)| part.voxels).sum())
    };
    let contrast_l = sum(Kind::Contrast) + scan.litres(pools.count());
    if contrast_l > UNSURE_L {
        remarks.push(Remark::new(format!(
            "{:.0} ml have the density of contrast-enhanced blood (above {BONE_LEVEL_HU} HU): classified as vessels by \
             their place between the lungs, their thickness, and surroundings that are less dense",
            1e3 * contrast_l
        )));
    }
    let unsure_l = sum(Kind::Unsure);
    if unsure_l > UNSURE_L {
        remarks.push(Remark::new(format!(
            "{:.0} ml classified as bone are almost entirely below {CORTICAL_HU} HU: possibly \
             contrast-enhanced vessels",
            1e3 * unsure_l
        )));
    }
}

/// With gaps in the shell closed and the marrow inside.
fn solid(scan: &Scan<'_>, shell: &Mask) -> Result<Mask, VolumeError> {
    let Some(bounds) = shell.bounds() else {
        return Ok(shell.clone());
    };
    let margin = [0, 1, 2].map(|axis| scan.voxels_across(CLOSING_M, axis) + 1);
    let around = bounds.widened(margin, shell.size());
    let tight = closed(&shell.cropped(&around), CLOSING_M, scan.spacing_m);
    scan.check()?;
    let holes = Components::of(&tight.complement(), Connectivity::Faces);
    let most = scan.voxels_of(MOST_MARROW_L);
    let size = tight.size();
    let marrow = holes.mask_of(|part| {
        let hole = &holes.parts()[part];
        // A bone that the first or the last slice cuts is open there.
        let inside = (0..2)
            .all(|axis| hole.bounds.first[axis] > 0 && hole.bounds.last[axis] < size[axis] - 1);
        inside && hole.voxels <= most
    });
    let mut solid = shell.clone();
    solid.unite_within(&around, &tight);
    solid.unite_within(&around, &marrow);
    Ok(solid)
}
