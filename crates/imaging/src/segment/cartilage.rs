//! Costal cartilage: denser than muscle, less dense than bone, as thick as a finger, and hanging on ribs or sternum.

use needlebench_volume::VolumeError;

use crate::components::{Components, Connectivity};
use crate::mask::{IndexBox, Mask};
use crate::morphology::{dilated, eroded, opened};

use super::Scan;
use super::body::Body;
use super::lungs::Lungs;

/// What is searched for muscle, HU: its most frequent value is it. Fat is less dense.
const SOFT_HU: [i16; 2] = [20, 100];

/// From muscle to the middle between it and cartilage, HU: that of adults is 80 to 130 (assumed; what is calcified is
/// found as bone).
const ABOVE_MUSCLE_HU: f64 = 26.5;

/// Where there is no muscle to measure, HU.
const USUAL_LEVEL_HU: f64 = 80.5;

/// How far beyond the box around the lungs it is looked for: in front of them and along the costal arch, m.
const BESIDE_LUNGS_M: f64 = 60e-3;

/// Noise is averaged over this in each direction, m.
const SMOOTH_M: f64 = 1.5e-3;

/// Cartilage is thicker than twice this; blur around bone, skin and fasciae are not, m.
const THIN_M: f64 = 3e-3;

/// It is thinner than twice this; liver, heart and kidneys with contrast medium are not, m.
const THICK_M: f64 = 11e-3;

/// Share of a piece that may be thicker.
const THICK_SHARE: f64 = 0.02;

/// Share of a piece that may be as near to blood with contrast medium as cartilage is to bone: the wall of a heart is all
/// around its blood.
const BLOOD_SHARE: f64 = 0.1;

/// How far it is from rib or sternum at most, m.
const FROM_BONE_M: f64 = 4e-3;

/// Cartilage of one rib or more, l.
const LEAST_PIECE_L: f64 = 1e-3;

/// All of it in an adult is 100 to 200 ml (assumed): with less than this, and both lungs, its absence is said, l.
pub(super) const USUAL_L: f64 = 20e-3;

/// Costal cartilage in a box, in the front half of the body, and the level between muscle and it.
pub(super) fn find(
    scan: &Scan<'_>,
    body: &Body,
    lungs: &Lungs,
    [bone, blood]: [&Mask; 2],
    bounds: &IndexBox,
) -> Result<(Mask, f64), VolumeError> {
    let mut found = Mask::empty(bone.size());
    let Some(front) = front(scan, body, lungs, bounds) else {
        return Ok((found, USUAL_LEVEL_HU));
    };
    let within = IndexBox {
        first: [0, 1, 2].map(|axis| front.first[axis] + bounds.first[axis]),
        last: [0, 1, 2].map(|axis| front.last[axis] + bounds.first[axis]),
    };
    let here = body.mask.cropped(&within);
    let Some(muscle_hu) = muscle_hu(scan, &here, &within) else {
        return Ok((found, USUAL_LEVEL_HU));
    };
    let level = f64::from(muscle_hu) + ABOVE_MUSCLE_HU;
    let (bone, blood) = (bone.cropped(&front), blood.cropped(&front));
    let mut candidates = smooth_above(scan, &within, level);
    candidates.intersect(&here);
    scan.check()?;
    // Around bone, its blur is as dense as cartilage.
    let layer_m = 1.01 * scan.spacing_m[0].max(scan.spacing_m[1]);
    candidates.subtract(&bone);
    candidates.subtract(&blood);
    let mut apart = candidates.clone();
    for dense in [&bone, &blood] {
        apart.subtract(&dilated(dense, layer_m, scan.spacing_m));
    }
    // At least a layer of voxels within the slice.
    let thin_m = THIN_M.max(layer_m);
    let core = opened(&apart, thin_m, scan.spacing_m);
    scan.check()?;
    let thick = eroded(&core, THICK_M, scan.spacing_m);
    let near_m = FROM_BONE_M.max(2.0 * layer_m);
    let near_bone = dilated(&bone, near_m, scan.spacing_m);
    let near_blood = dilated(&blood, near_m, scan.spacing_m);
    let pieces = Components::of(&apart, Connectivity::Faces);
    let mut facts = vec![Piece::default(); pieces.parts().len()];
    for (part, [from, to], j, k) in pieces.runs() {
        let count = |mask: &Mask| (from..to).filter(|&i| mask.get([i, j, k])).count();
        facts[part].core += count(&core);
        facts[part].thick += count(&thick);
        facts[part].near_bone += count(&near_bone);
        facts[part].near_blood += count(&near_blood);
    }
    let least = scan.voxels_of(LEAST_PIECE_L);
    let mut whole = pieces.mask_of(|part| {
        let (voxels, piece) = (pieces.parts()[part].voxels, &facts[part]);
        voxels >= least
            && piece.core > 0
            && piece.near_bone > 0
            && piece.thick as f64 <= THICK_SHARE * voxels as f64
            && piece.near_blood as f64 <= BLOOD_SHARE * voxels as f64
    });
    // What hangs on it by noise alone is none; what the opening took off its corners, and what is next to bone, is.
    whole.intersect(&core);
    whole = dilated(&whole, 2.0 * layer_m, scan.spacing_m);
    whole.intersect(&candidates);
    found.unite_within(&front, &whole);
    Ok((found, level))
}

/// What is known of a piece: its voxels that are in no thin part, in a thick one, near bone, near blood.
#[derive(Debug, Clone, Copy, Default)]
struct Piece {
    core: usize,
    thick: usize,
    near_bone: usize,
    near_blood: usize,
}

/// In front of the middle of the body, from above the lungs to below them, in indices of the body's box; none without
/// lungs.
fn front(scan: &Scan<'_>, body: &Body, lungs: &Lungs, bounds: &IndexBox) -> Option<IndexBox> {
    let axis = scan.axis_along(1);
    let middle = crate::spacing::whole(body.centroid[axis] - bounds.first[axis] as f64);
    let beyond = [0, 1, 2].map(|axis| scan.voxels_across(BESIDE_LUNGS_M, axis));
    let mut front = lungs.around()?.widened(beyond, bounds.size());
    // Also before a lung that is absent.
    let across = scan.axis_along(0);
    [front.first[across], front.last[across]] = [0, bounds.size()[across] - 1];
    if scan.volume.grid.steps_m()[(1, axis)] > 0.0 {
        front.last[axis] = middle;
    } else {
        front.first[axis] = middle;
    }
    (front.first[axis] < front.last[axis]).then_some(front)
}

/// The most frequent value of soft tissue that is not fat, over a window of 11.
fn muscle_hu(scan: &Scan<'_>, here: &Mask, within: &IndexBox) -> Option<i16> {
    let [from, to] = SOFT_HU;
    let mut counts = vec![0_usize; usize::from(to.abs_diff(from)) + 1];
    let [_, ny, nz] = here.size();
    for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
        for run in here.runs(j, k) {
            let there = run.map(|i| i + within.first[0]);
            for &hu in scan.row(there, j + within.first[1], k + within.first[2]) {
                if (from..=to).contains(&hu) {
                    counts[usize::from(hu.abs_diff(from))] += 1;
                }
            }
        }
    }
    let smooth = |at: usize| -> usize {
        counts[at.saturating_sub(5)..(at + 6).min(counts.len())]
            .iter()
            .sum()
    };
    let best = (0..counts.len()).max_by_key(|&at| (smooth(at), usize::MAX - at))?;
    let step = i16::try_from(best).ok()?;
    (smooth(best) > 0).then(|| from + step)
}

/// Voxels of a box of the volume whose mean with those around them is above a level.
fn smooth_above(scan: &Scan<'_>, within: &IndexBox, level: f64) -> Mask {
    let size = within.size();
    let reach = [0, 1, 2].map(|axis| scan.voxels_across(SMOOTH_M, axis));
    let mut values = vec![0_i32; size.iter().product()];
    for (row, (k, j)) in values
        .chunks_exact_mut(size[0])
        .zip((0..size[2]).flat_map(|k| (0..size[1]).map(move |j| (k, j))))
    {
        let run = [within.first[0], within.last[0] + 1];
        let from = scan.row(run, j + within.first[1], k + within.first[2]);
        for (to, &hu) in row.iter_mut().zip(from) {
            *to = i32::from(hu);
        }
    }
    let mut line = Vec::new();
    let mut stride = 1;
    for axis in 0..3 {
        if reach[axis] > 0 {
            for start in (0..values.len()).filter(|at| (at / stride).is_multiple_of(size[axis])) {
                line.clear();
                line.extend(values[start..].iter().step_by(stride).take(size[axis]));
                running_sums(&line, reach[axis], |at, sum| {
                    values[start + at * stride] = sum;
                });
            }
        }
        stride *= size[axis];
    }
    let count: usize = reach.iter().map(|reach| 2 * reach + 1).product();
    let limit = level * count as f64;
    Mask::of(size, &values, |sum| f64::from(sum) > limit)
}

/// The sum about each place of a line; at its ends, the last value stands for what is beyond.
fn running_sums(line: &[i32], reach: usize, mut put: impl FnMut(usize, i32)) {
    let last = line.len() - 1;
    let at = |index: usize| line[index.saturating_sub(reach).min(last)];
    let mut sum: i32 = (0..=2 * reach).map(at).sum();
    for index in 0..line.len() {
        put(index, sum);
        sum += at(index + 2 * reach + 1) - at(index);
    }
}

#[cfg(test)]
mod tests {
    use super::running_sums;

    #[test]
    fn sums_run_along_a_line_and_repeat_its_ends() {
        let mut sums = vec![0; 4];
        running_sums(&[1, 2, 3, 10], 1, |at, sum| sums[at] = sum);
        assert_eq!(sums, [4, 6, 15, 23]);
        running_sums(&[5], 2, |at, sum| sums[at] = sum);
        assert_eq!(sums[0], 25);
    }
}
