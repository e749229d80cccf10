//! Whether anatomy lies as the file says: a patient who is upside down in it has left and right wrong, too.

use needlebench_volume::VolumeError;

use crate::components::{Components, Connectivity};
use crate::mask::IndexBox;

use super::Scan;
use super::body::Body;
use super::bone::Bone;
use super::lungs::Lungs;

/// Half width of what is taken for the midline, m: spine and sternum.
const MIDLINE_M: f64 = 0.03;

/// Bone of a spine, l: a sternum and calcified vessels have less.
const SPINE_L: f64 = 0.06;

/// The sternum has less than this share of the spine's bone.
const STERNUM: f64 = 0.25;

/// The trachea: it leads so far between the lungs, as a share of their height (a carina is at a third of it),
const TRACHEA_INSIDE: f64 = 0.25;

/// ends so near to where they end, or beyond, m,
const TRACHEA_END_M: f64 = 0.02;

/// is so near to the middle between them, m,
const TRACHEA_ASIDE_M: f64 = 0.03;

/// and has at most this section, m^2; gas in a stomach has more.
const TRACHEA_SECTION_M2: f64 = 7e-4;

/// Refuses a scan with the spine in front, or with the trachea leaving the lungs at their lower end.
///
/// A field of view that cuts the body in front or behind, lungs that the scan cuts, and a body without lungs say nothing.
pub(super) fn check(
    scan: &Scan<'_>,
    body: &Body,
    lungs: &Lungs,
    bone: &Bone,
) -> Result<(), VolumeError> {
    let steps = scan.volume.grid.steps_m();
    if steps[(1, 1)] == 0.0 || steps[(2, 2)] == 0.0 {
        // Axes in another order than the patient's.
        return Ok(());
    }
    let hint = "orientation or positions in the file are wrong: export the scan again, as DICOM if possible";
    let is_cut = ["anterior", "posterior"]
        .iter()
        .any(|side| body.cut_sides.contains(side));
    if !is_cut && !lungs.lungs.is_empty() {
        let [low_l, high_l] = bone_at_ends_l(scan, body, bone);
        let [front_l, back_l] = if steps[(1, 1)] > 0.0 {
            [low_l, high_l]
        } else {
            [high_l, low_l]
        };
        if front_l >= SPINE_L && back_l <= STERNUM * front_l {
            return Err(VolumeError::refused(format!(
                "the spine is in front: {:.0} ml of bone at the midline in the anterior third of the body, {:.0} ml in \
                 the posterior third",
                1e3 * front_l,
                1e3 * back_l
            ))
            .hint(hint));
        }
    }
    let [low, high] = trachea_at_ends(scan, lungs);
    let [lower, upper] = if steps[(2, 2)] > 0.0 {
        [low, high]
    } else {
        [high, low]
    };
    if lower && !upper {
        return Err(VolumeError::refused(
            "the trachea leaves the lungs at their lower end, none at their upper end",
        )
        .hint(hint));
    }
    Ok(())
}

/// Whether a tube of air leads out of both whole lungs at their first and at their last slice.
fn trachea_at_ends(scan: &Scan<'_>, lungs: &Lungs) -> [bool; 2] {
    let [left, right] = match &lungs.lungs[..] {
        [left, right] if !left.cut && !right.cut => [left, right].map(|lung| &lung.mask),
        _ => return [false; 2],
    };
    let (Some(a), Some(b)) = (left.bounds(), right.bounds()) else {
        return [false; 2];
    };
    let both = a.joined(&b);
    let [x_m, _, z_m] = scan.spacing_m;
    let height = (both.last[2] - both.first[2] + 1) as f64;
    let middle_of = |bounds: &IndexBox| 0.5 * (bounds.first[0] + bounds.last[0]) as f64;
    let middle = 0.5 * (middle_of(&a) + middle_of(&b));
    let parts = Components::of(&lungs.airways, Connectivity::Faces);
    let mut ends = [false; 2];
    for part in parts.parts() {
        let [first, last] = [part.bounds.first[2], part.bounds.last[2]];
        let inside = (last.min(both.last[2]) + 1).saturating_sub(first.max(both.first[2]));
        let section_m2 = part.voxels as f64 * scan.voxel_m3() / ((last - first + 1) as f64 * z_m);
        let aside_m = (part.centroid()[0] - middle).abs() * x_m;
        if (inside as f64) < TRACHEA_INSIDE * height
            || section_m2 > TRACHEA_SECTION_M2
            || aside_m > TRACHEA_ASIDE_M
        {
            continue;
        }
        ends[0] |= (first as f64 - both.first[2] as f64) * z_m <= TRACHEA_END_M;
        ends[1] |= (both.last[2] as f64 - last as f64) * z_m <= TRACHEA_END_M;
    }
    ends
}

/// Bone at the midline in the first and in the last third of the body along its second axis, l.
fn bone_at_ends_l(scan: &Scan<'_>, body: &Body, bone: &Bone) -> [f64; 2] {
    let within = body.mask.cropped(&body.bounds);
    let [_, rows, slices] = within.size();
    let middle = body.centroid[0] - body.bounds.first[0] as f64;
    let half = MIDLINE_M / scan.spacing_m[0];
    let in_midline = |[from, to]: [usize; 2]| {
        let low = (from as f64).max(middle - half);
        (to as f64).min(middle + half) - low
    };
    let mut ends = [0.0; 2];
    for k in 0..slices {
        let has_body = |&j: &usize| within.runs(j, k).any(|run| in_midline(run) > 0.0);
        let (Some(first), Some(last)) = ((0..rows).find(has_body), (0..rows).rev().find(has_body))
        else {
            continue;
        };
        let third = (last - first) as f64 / 3.0;
        for j in first..=last {
            let end = if ((j - first) as f64) < third {
                0
            } else if ((last - j) as f64) < third {
                1
            } else {
                continue;
            };
            let runs = bone.bone.runs(j, k).map(|run| in_midline(run).max(0.0));
            ends[end] += runs.sum::<f64>();
        }
    }
    ends.map(|voxels| 1e3 * voxels * scan.voxel_m3())
}
