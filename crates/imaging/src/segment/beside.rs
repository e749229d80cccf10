//! What is in the scan and not of the patient's trunk: arms, the couch, cushions.

use nalgebra::Point3;
use needlebench_volume::{BesideKind, Lying, Remark, VolumeError};

use crate::components::{Component, Components, Connectivity};
use crate::mask::{IndexBox, Mask};
use crate::morphology::dilated;
use crate::spacing::whole;

use super::body::Body;
use super::{Scan, couch};

/// Shells of couches and cushions are denser than this even where thick slices blur them; air with noise is not, HU.
const SHELL_HU: i16 = -700;

/// What is so near to the body is the blur of its skin, voxels.
const SKIN_VOXELS: f64 = 1.5;

/// Foam is as light as air: what lies between the upper and the lower side of a shell counts as it, up to so much, m.
const SHELL_GAP_M: f64 = 0.08;

/// Holes in a shell that blur makes are closed across the patient up to so much, m.
const SHELL_HOLE_M: f64 = 0.01;

/// Smaller things beside the body are left out: markers, folds of cloth, voxels of the skin's own blur, l.
const LEAST_L: f64 = 1e-3;

/// An arm has at least so much bone in it, l: the humerus of a child has 20 ml for each 100 mm (assumed),
const ARM_BONE_L: f64 = 2e-3;

/// which is denser than this, HU,
const ARM_BONE_HU: i16 = 250;

/// and is at least this share of it: cortical bone is 5 to 10 % of an arm's section (assumed).
const ARM_BONE_SHARE: f64 = 0.01;

/// Most of an arm is fat, muscle and bone, above this, HU; cushions and the core of a couch are foam.
const ARM_SOFT_HU: i16 = -200;

/// Share of an arm that is denser than that.
const ARM_SOFT_SHARE: f64 = 0.7;

/// Of an arm no more than this is bone; rails and frames are metal.
const ARM_MOST_BONE_SHARE: f64 = 0.5;

/// A couch is at least so wide on each side of where a back parts it, m (assumed): no rail is,
const COUCH_WIDTH_M: f64 = 0.06;

/// and goes through at least this share of the slices.
const COUCH_SHARE: f64 = 0.8;

/// All of a kind beside the body.
#[derive(Debug, Clone)]
pub struct Beside {
    /// What it is.
    pub kind: BesideKind,
    /// The box that the mask covers.
    pub bounds: IndexBox,
    /// Its voxels.
    pub mask: Mask,
}

/// Tells apart what is denser than air beside a body.
pub(super) fn find(
    scan: &Scan<'_>,
    body: &Body,
    unseen: Option<&Mask>,
    lying: Lying,
    remarks: &mut Vec<Remark>,
) -> Result<Vec<Beside>, VolumeError> {
    let mut dense = Mask::of(scan.size(), &scan.volume.hu, |hu| hu > SHELL_HU);
    // The blur of the skin is not beside it.
    let layer_m = SKIN_VOXELS * scan.spacing_m.into_iter().fold(0.0, f64::max);
    let reach = scan.spacing_m.map(|step_m| whole(layer_m / step_m) + 1);
    let near = body.bounds.widened(reach, scan.size());
    let skin = dilated(&body.mask.cropped(&near), layer_m, scan.spacing_m);
    let mut whole_skin = Mask::empty(scan.size());
    whole_skin.unite_within(&near, &skin);
    dense.subtract(&whole_skin);
    scan.check()?;
    let parts = Components::of(&dense, Connectivity::Faces);
    let densities = densities(scan, &parts);
    let is_arm = |part: usize| is_arm(scan, &parts.parts()[part], &densities[part]);
    let arms = parts.mask_of(is_arm);
    // Only shells of the others are dense: each is what lies between its upper and its lower side.
    let [left, posterior] = [scan.axis_along(0), scan.axis_along(1)];
    let gap = scan.voxels_across(SHELL_GAP_M, posterior);
    let mut others = parts.mask_of(|part| !is_arm(part));
    whole_skin.unite(&arms);
    whole_skin.unite(&body.mask);
    bridge(&mut others, posterior, gap, &whole_skin);
    let hole = scan.voxels_across(SHELL_HOLE_M, left);
    bridge(&mut others, left, hole, &whole_skin);
    scan.check()?;
    let parts = Components::of(&others, Connectivity::Faces);
    let least = scan.voxels_of(LEAST_L);
    let of_others = |wanted: BesideKind| {
        parts.mask_of(|part| {
            let part = &parts.parts()[part];
            part.voxels >= least && kind(scan, part) == wanted
        })
    };
    let couch = of_others(BesideKind::Couch);
    let assumed = unseen.map_or_else(
        || Mask::empty(scan.size()),
        |unseen| {
            couch::beyond(
                scan,
                unseen,
                lying,
                body,
                Some(&couch).filter(|it| !it.is_empty()),
            )
        },
    );
    let found = [
        (BesideKind::Arms, arms),
        (BesideKind::Couch, couch),
        (BesideKind::Objects, of_others(BesideKind::Objects)),
        (BesideKind::AssumedCouch, assumed),
    ];
    let found = found.into_iter().filter_map(|(kind, mask)| {
        let bounds = mask.bounds()?;
        let mask = mask.cropped(&bounds);
        Some(Beside { kind, bounds, mask })
    });
    let found: Vec<Beside> = found.collect();
    for each in &found {
        remarks.push(in_words(scan, each));
    }
    Ok(found)
}

/// Fills gaps of at most so many voxels along an axis, unless something else is in them.
fn bridge(mask: &mut Mask, axis: usize, most: usize, other: &Mask) {
    let Some(bounds) = mask.bounds() else {
        return;
    };
    let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
    for at_a in bounds.first[a]..=bounds.last[a] {
        for at_b in bounds.first[b]..=bounds.last[b] {
            let mut voxel = [0; 3];
            (voxel[a], voxel[b]) = (at_a, at_b);
            let mut last = None;
            for at in bounds.first[axis]..=bounds.last[axis] {
                voxel[axis] = at;
                if mask.get(voxel) {
                    let from = last.map_or(at, |last: usize| last + 1);
                    for between in if at - from <= most { from..at } else { at..at } {
                        voxel[axis] = between;
                        mask.insert(voxel);
                    }
                    last = Some(at);
                } else if other.get(voxel) {
                    last = None;
                }
            }
        }
    }
}

/// Voxels of a part by their density.
#[derive(Debug, Clone, Copy, Default)]
struct Density {
    bone: usize,
    soft: usize,
}

fn densities(scan: &Scan<'_>, parts: &Components) -> Vec<Density> {
    let mut densities = vec![Density::default(); parts.parts().len()];
    for (part, run, j, k) in parts.runs() {
        for &hu in scan.row(run, j, k) {
            densities[part].bone += usize::from(hu > ARM_BONE_HU);
            densities[part].soft += usize::from(hu > ARM_SOFT_HU);
        }
    }
    densities
}

fn is_arm(scan: &Scan<'_>, part: &Component, density: &Density) -> bool {
    let share = |voxels: usize| voxels as f64 / part.voxels as f64;
    scan.litres(density.bone) >= ARM_BONE_L
        && (ARM_BONE_SHARE..=ARM_MOST_BONE_SHARE).contains(&share(density.bone))
        && share(density.soft) >= ARM_SOFT_SHARE
}

/// What something is that is no arm.
fn kind(scan: &Scan<'_>, part: &Component) -> BesideKind {
    let [left, up] = [scan.axis_along(0), scan.axis_along(2)];
    let size = part.bounds.size();
    let is_couch = size[left] as f64 * scan.spacing_m[left] >= COUCH_WIDTH_M
        && size[up] as f64 >= COUCH_SHARE * scan.size()[up] as f64;
    if is_couch {
        BesideKind::Couch
    } else {
        BesideKind::Objects
    }
}

fn in_words(scan: &Scan<'_>, found: &Beside) -> Remark {
    let what = match found.kind {
        BesideKind::Arms => "soft tissue with bone apart from the body: arms",
        BesideKind::Couch => "as wide as a couch, through the scan",
        BesideKind::Objects => "neither arm nor couch: cushion, rail, tube?",
        BesideKind::AssumedCouch => {
            "couch assumed beyond the field of view, where nothing was seen"
        }
    };
    let litres = scan.litres(found.mask.count());
    let [low, high] = [found.bounds.first, found.bounds.last].map(|corner| {
        let corner = Point3::from(corner.map(|index| index as f64));
        1e3 * scan.volume.grid.ct_from_index(&corner)
    });
    let (low, high) = (low.inf(&high), low.sup(&high));
    Remark::new(format!(
        "beside the body, {litres:.2} l within [{:.0}, {:.0}, {:.0}] to [{:.0}, {:.0}, {:.0}] mm: {what}; an \
         obstacle of robot and needle",
        low.x, low.y, low.z, high.x, high.y, high.z
    ))
}
