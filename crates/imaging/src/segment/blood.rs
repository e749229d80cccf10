//! Blood with contrast medium in heart and great vessels, which touches bone and is as dense.

use std::borrow::Cow;

use needlebench_volume::VolumeError;

use crate::components::{Component, Components, Connectivity};
use crate::mask::{IndexBox, Mask};
use crate::morphology::{dilated, eroded};

use super::Scan;
use super::body::Body;
use super::lungs::{IN_FRONT, Lungs, grow_back, is_between};

/// Great vessels are thicker than twice this, ribs and the sternum's halves are not, m.
const CORE_M: f64 = 4e-3;

/// The core of a chamber of the heart or of a great vessel, l; that of a vertebra is not much more.
const LEAST_CORE_L: f64 = 5e-3;

/// Where nothing has at least this core, nobody has given contrast medium, l.
const LEAST_POOL_L: f64 = 20e-3;

/// The brightest blood that is told from bone, HU: beside an injection it is brighter, and stays bone.
const BRIGHTEST_HU: i16 = 650;

/// Blood is looked for above this where none of it is wholly as dense as bone, HU,
const FAINT_HU: f64 = 100.5;

/// and has contrast medium above this, HU: liver and spleen reach 120 in their venous phase.
const LEAST_HU: i16 = 130;

/// Blood is so even, HU, or so many standard deviations of its noise.
const EVEN_HU: f64 = 70.0;
const EVEN_SD: f64 = 3.5;

/// Gaps in the shell of a bone through which its marrow does not become blood, m.
const LEAK_M: f64 = 2e-3;

/// Marrow is surrounded by what is denser than it; blood is not. This share of the surroundings decides.
const SHELL_SHARE: f64 = 0.4;

/// Heart and great vessels are no wider than this share of the lungs; a skeleton of even density is.
const WIDEST: f64 = 0.8;

/// Where the descending aorta is, beside the spine: pools there are as dense as one in front, to this share.
const BESIDE_SPINE: [f64; 2] = [0.75, 0.95];
const AS_DENSE: f64 = 0.3;

/// Dense voxels of a box that are blood with contrast medium; empty where there is no pool of it between the lungs.
///
/// Pools are found by place (between the lungs), thickness, evenness, and by surroundings that are less dense. What
/// else is dense and hangs on them is theirs as far as no bone is nearer, along dense voxels.
pub(super) fn find(
    scan: &Scan<'_>,
    body: &Body,
    lungs: &Lungs,
    dense: &Mask,
    bounds: &IndexBox,
) -> Result<Mask, VolumeError> {
    let mut blood = between_lungs(scan, body, lungs, dense, bounds, i16::MIN)?;
    let mut dense = Cow::Borrowed(dense);
    if blood.is_empty() {
        // As dense as where bone begins: half of its voxels are below that by noise.
        let faint = scan.denser(&body.mask.cropped(bounds), bounds, FAINT_HU);
        blood = between_lungs(scan, body, lungs, &faint, bounds, LEAST_HU)?;
        dense.to_mut().unite(&blood);
    }
    if blood.is_empty() {
        return Ok(blood);
    }
    scan.check()?;
    // Bone is what is clearly denser than any blood, and what does not touch it.
    let parts = Components::of(&dense, Connectivity::Faces);
    let mut touched = vec![false; parts.parts().len()];
    for voxel in blood.voxels() {
        if let Some(part) = parts.part_at(voxel) {
            touched[part] = true;
        }
    }
    let with_blood = parts.mask_of(|part| touched[part]);
    let brightest = brightest_of(scan, &blood, bounds);
    let mut bone = scan.within(&with_blood, bounds, |hu| hu > brightest);
    bone.subtract(&blood);
    let mut halves = [blood, bone];
    grow_back(scan, &mut halves, &with_blood)?;
    let [blood, _] = halves;
    Ok(blood)
}

/// Pools between the lungs, of what is dense; empty where they are too small together, or less dense than blood with
/// contrast medium.
fn between_lungs(
    scan: &Scan<'_>,
    body: &Body,
    lungs: &Lungs,
    dense: &Mask,
    bounds: &IndexBox,
    least_hu: i16,
) -> Result<Mask, VolumeError> {
    let none = Mask::empty(dense.size());
    let Some(around) = lungs.around() else {
        return Ok(none);
    };
    let part = dense.cropped(&around);
    let core = Components::of(&eroded(&part, CORE_M, scan.spacing_m), Connectivity::Faces);
    scan.check()?;
    let (least, pool) = (scan.voxels_of(LEAST_CORE_L), scan.voxels_of(LEAST_POOL_L));
    if core.parts().iter().all(|part| part.voxels < pool) {
        return Ok(none);
    }
    let across = scan.axis_along(0);
    let (mut blood, mut levels) = (none.clone(), Vec::new());
    for shares in [IN_FRONT, BESIDE_SPINE] {
        for (number, _) in core
            .parts()
            .iter()
            .enumerate()
            .filter(|(_, part)| part.voxels >= least)
        {
            scan.check()?;
            let mut seed = none.clone();
            seed.unite_within(&around, &core.mask_of(|part| part == number));
            let Some(middle) = scan.median(&seed, bounds).filter(|&hu| hu >= least_hu) else {
                continue;
            };
            let is_as_dense =
                |level: &i16| f64::from(middle.abs_diff(*level)) <= AS_DENSE * f64::from(*level);
            if shares == BESIDE_SPINE && !levels.iter().any(is_as_dense) {
                continue;
            }
            let found = pools(scan, dense, bounds, &seed, middle, &|part| {
                let wide = part.bounds.size()[across] as f64;
                wide <= WIDEST * around.size()[across] as f64
                    && is_between(scan, body, lungs, part, shares)
            })?;
            if !found.is_empty() {
                levels.push(middle);
                blood.unite(&found);
            }
        }
    }
    Ok(if blood.count() < pool { none } else { blood })
}

/// The pools of blood about a core of this median: even, in their place, and not enclosed in a shell.
fn pools(
    scan: &Scan<'_>,
    dense: &Mask,
    bounds: &IndexBox,
    seed: &Mask,
    middle: i16,
    is_in_place: &dyn Fn(&Component) -> bool,
) -> Result<Mask, VolumeError> {
    let none = Mask::empty(dense.size());
    if middle > BRIGHTEST_HU {
        return Ok(none);
    }
    let spread = spread_hu(scan, seed, bounds, middle);
    let even = EVEN_HU.max(EVEN_SD * spread);
    let is_even = |hu: i16| (f64::from(hu) - f64::from(middle)).abs() <= even;
    let same = scan.within(dense, bounds, is_even);
    // At least a layer of voxels.
    let leak_m = scan.spacing_m.iter().copied().fold(LEAK_M, f64::max);
    let open = Components::of(&eroded(&same, leak_m, scan.spacing_m), Connectivity::Faces);
    scan.check()?;
    let mut seeded = vec![false; open.parts().len()];
    for voxel in seed.voxels() {
        if let Some(part) = open.part_at(voxel) {
            seeded[part] = true;
        }
    }
    let least = scan.voxels_of(LEAST_CORE_L);
    let mut found = none;
    for (number, part) in open.parts().iter().enumerate() {
        if !seeded[number] || part.voxels < least || !is_in_place(part) {
            continue;
        }
        let mut pool = dilated(&open.mask_of(|each| each == number), leak_m, scan.spacing_m);
        pool.intersect(&same);
        if shell_share(scan, &pool, bounds, middle) < SHELL_SHARE {
            found.unite(&pool);
        }
    }
    Ok(found)
}

/// Standard deviation of the values at the voxels of a mask, by their median deviation: edges do not count.
fn spread_hu(scan: &Scan<'_>, part: &Mask, bounds: &IndexBox, middle: i16) -> f64 {
    /// Of a normal distribution, over its median deviation.
    const SD: f64 = 1.4826;
    let mut counts = vec![0_usize; 1 << 16];
    let mut all = 0;
    for voxel in part.voxels() {
        let there = [0, 1, 2].map(|axis| voxel[axis] + bounds.first[axis]);
        counts[usize::from(scan.hu(there).abs_diff(middle))] += 1;
        all += 1;
    }
    let mut below = 0;
    let median = counts.iter().position(|&each| {
        below += each;
        2 * below > all
    });
    SD * median.unwrap_or(0) as f64
}

/// Share of the voxels around a mask that are denser than a level.
fn shell_share(scan: &Scan<'_>, part: &Mask, bounds: &IndexBox, level: i16) -> f64 {
    let layer_m = 1.01 * scan.spacing_m.iter().copied().fold(0.0, f64::max);
    let mut around = dilated(part, layer_m, scan.spacing_m);
    around.subtract(part);
    let denser = scan.within(&around, bounds, |hu| hu > level);
    denser.count() as f64 / around.count().max(1) as f64
}

/// What hardly any blood is denser than.
fn brightest_of(scan: &Scan<'_>, blood: &Mask, bounds: &IndexBox) -> i16 {
    /// Of all of it.
    const SHARE: f64 = 0.999;
    let mut values: Vec<i16> = blood
        .voxels()
        .map(|voxel| scan.hu([0, 1, 2].map(|axis| voxel[axis] + bounds.first[axis])))
        .collect();
    values.sort_unstable();
    let at = crate::spacing::whole(SHARE * values.len() as f64);
    values
        .get(at)
        .or(values.last())
        .copied()
        .unwrap_or(i16::MAX)
}
