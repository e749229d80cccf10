//! Internal mammary vessels, which plain CT does not show: modelled beside the sternum.

use needlebench_imaging::IndexBox;

/// From the sternum's edge to the first of the vessels, m (assumed).
const FROM_EDGE_M: f64 = 5e-3;

/// In front of lung and mediastinum they fill this, m (assumed: artery and two veins, behind the cartilages).
const DEEP_M: f64 = 6e-3;

/// Half of the greatest width of a sternum, m (assumed); what is farther from the midline is rib or cartilage.
const HALF_STERNUM_M: f64 = 30e-3;

/// Slices farther than this from the last one with a sternum are above or below it, m.
const BESIDE_SLICES_M: f64 = 15e-3;

/// The sternum's edges are those of its widest part within so much above and below, m (assumed).
const STRAIGHT_M: f64 = 40e-3;

/// A sternum lies within this behind the skin, m (assumed), also where no lung is seen behind it.
const BEHIND_SKIN_M: f64 = 70e-3;

/// Lung or mediastinum farther than this behind the sternum is not what lies behind its cartilages, m (assumed).
const FROM_STERNUM_M: f64 = 25e-3;

/// What a voxel is to this search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tissue {
    /// Bone of a sternum, or of anything that may be one.
    Bone,
    /// Lung, a lesion, or what is between the lungs.
    Inside,
    /// Not of the body.
    Outside,
    /// None of these.
    Other,
}

/// A sternum in a slice: its columns and its last row.
#[derive(Debug, Clone, Copy)]
struct Sternum {
    columns: [usize; 2],
    back: usize,
}

/// Voxels of a box where internal mammary vessels are modelled.
///
/// Rows run to the back, columns to the left. In each slice they lie from `FROM_EDGE_M` beside both edges of the sternum
/// to `width_m` beside those of its widest part near it, and up to `DEEP_M` in front of lung and mediastinum, or behind the sternum where neither is near. The
/// sternum is looked for about the `middle` column, or everywhere without one.
pub(super) fn beside_sternum(
    within: &IndexBox,
    spacing_m: [f64; 3],
    middle: Option<usize>,
    width_m: f64,
    tissue: impl Fn([usize; 3]) -> Tissue,
) -> Vec<[usize; 3]> {
    let [first, last] = [within.first, within.last];
    let across = |metres: f64| super::steps(metres / spacing_m[0]);
    let rows = |metres: f64| super::steps(metres / spacing_m[1]).max(1);
    let (deep, far_behind) = (rows(DEEP_M), rows(FROM_STERNUM_M));
    let half = across(HALF_STERNUM_M);
    let columns = middle.map_or(first[0]..=last[0], |middle| {
        middle.saturating_sub(half).max(first[0])..=(middle + half).min(last[0])
    });
    let front =
        |i: usize, k: usize| (first[1]..=last[1]).find(|&j| tissue([i, j, k]) == Tissue::Inside);
    let sternum_at = |i: usize, k: usize| -> Option<usize> {
        let skin = (first[1]..=last[1]).find(|&j| tissue([i, j, k]) != Tissue::Outside)?;
        let end = (skin + rows(BEHIND_SKIN_M)).min(last[1] + 1);
        let end = front(i, k).map_or(end, |front| front.min(end));
        (skin..end).rfind(|&j| tissue([i, j, k]) == Tissue::Bone)
    };
    let sterna: Vec<Option<Sternum>> = (first[2]..=last[2])
        .map(|k| {
            let found = columns.clone().filter_map(|i| Some((i, sternum_at(i, k)?)));
            found.fold(None, |sternum: Option<Sternum>, (i, back)| {
                let low = sternum.map_or(i, |sternum| sternum.columns[0]);
                let back = sternum.map_or(back, |sternum| sternum.back.max(back));
                Some(Sternum {
                    columns: [low, i],
                    back,
                })
            })
        })
        .collect();
    let reach = super::steps(BESIDE_SLICES_M / spacing_m[2]);
    let straight = super::steps(STRAIGHT_M / spacing_m[2]);
    let (near, far) = (across(FROM_EDGE_M), across(width_m));
    let mut found = Vec::new();
    for (slice, k) in (first[2]..=last[2]).enumerate() {
        let known = sterna.iter().enumerate().filter_map(|(other, sternum)| {
            let apart = other.abs_diff(slice);
            sternum
                .filter(|_| apart <= reach)
                .map(|sternum| (apart, sternum))
        });
        let Some((_, sternum)) = known.min_by_key(|(apart, _)| *apart) else {
            continue;
        };
        let [low, high] = sternum.columns;
        // They run straight on where the sternum becomes narrow.
        let wide = sterna
            .iter()
            .enumerate()
            .filter_map(|(other, sternum)| sternum.filter(|_| other.abs_diff(slice) <= straight));
        let [widest_low, widest_high] = wide.fold([low, high], |[a, b], sternum| {
            [a.min(sternum.columns[0]), b.max(sternum.columns[1])]
        });
        let right = widest_low.saturating_sub(far)..low.saturating_sub(near);
        let left = high + near + 1..=widest_high + far;
        let columns = right.chain(left);
        for i in columns.filter(|i| (first[0]..=last[0]).contains(i)) {
            let inner = front(i, k).filter(|&front| front <= sternum.back + far_behind);
            let inner = inner.unwrap_or(sternum.back + 1 + deep).min(last[1] + 1);
            found.extend((inner.saturating_sub(deep).max(first[1])..inner).map(|j| [i, j, k]));
        }
    }
    found
}
