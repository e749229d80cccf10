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

/// What a voxel is to this search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tissue {
    /// Bone of a sternum, or of anything that may be one.
    Bone,
    /// Lung, or what is between the lungs.
    Inside,
    /// Neither.
    Other,
}

/// Voxels of a box where internal mammary vessels are modelled.
///
/// Rows run to the back, columns to the left. In each slice they lie from `FROM_EDGE_M` to `width_m` beside both edges of
/// the sternum, and up to `DEEP_M` in front of lung and mediastinum. `middle` is the body's middle column.
pub(super) fn beside_sternum(
    within: &IndexBox,
    spacing_m: [f64; 3],
    middle: usize,
    width_m: f64,
    tissue: impl Fn([usize; 3]) -> Tissue,
) -> Vec<[usize; 3]> {
    let [first, last] = [within.first, within.last];
    let front =
        |i: usize, k: usize| (first[1]..=last[1]).find(|&j| tissue([i, j, k]) == Tissue::Inside);
    let across = |metres: f64| super::steps(metres / spacing_m[0]);
    let half = across(HALF_STERNUM_M);
    let columns = middle.saturating_sub(half).max(first[0])..=(middle + half).min(last[0]);
    let edges: Vec<Option<[usize; 2]>> = (first[2]..=last[2])
        .map(|k| {
            let has_sternum = |&i: &usize| {
                let inner = front(i, k).unwrap_or(first[1]);
                (first[1]..inner).any(|j| tissue([i, j, k]) == Tissue::Bone)
            };
            let low = columns.clone().find(has_sternum)?;
            let high = columns.clone().rev().find(has_sternum)?;
            Some([low, high])
        })
        .collect();
    let reach = super::steps(BESIDE_SLICES_M / spacing_m[2]);
    let (near, far) = (across(FROM_EDGE_M), across(width_m));
    let deep = super::steps(DEEP_M / spacing_m[1]).max(1);
    let mut found = Vec::new();
    for (slice, k) in (first[2]..=last[2]).enumerate() {
        let known = edges.iter().enumerate().filter_map(|(other, edges)| {
            let apart = other.abs_diff(slice);
            edges.filter(|_| apart <= reach).map(|edges| (apart, edges))
        });
        let Some((_, [low, high])) = known.min_by_key(|(apart, _)| *apart) else {
            continue;
        };
        let right = low.saturating_sub(far)..low.saturating_sub(near);
        let left = high + near + 1..=high + far;
        for i in right
            .chain(left)
            .filter(|i| (first[0]..=last[0]).contains(i))
        {
            let Some(inner) = front(i, k) else { continue };
            found.extend((inner.saturating_sub(deep).max(first[1])..inner).map(|j| [i, j, k]));
        }
    }
    found
}
