//! Lungs, airways and the vessels in the lungs.

use needlebench_volume::{Remark, VolumeError};

use crate::components::{Component, Components, Connectivity};
use crate::mask::{IndexBox, Mask, pack_row};
use crate::morphology::{bridged, dilated, eroded};
use crate::spacing::whole;

use super::body::Body;
use super::{Scan, side_in_words};

/// Between lung (-850) and the soft tissue around it (+40). Half-integer: no voxel is on it.
pub(crate) const LUNG_LEVEL_HU: f64 = -400.5;

/// A lung has at least so much air.
const LEAST_LUNG_L: f64 = 0.3;

/// A piece of a lung, such as a lobe behind a fissure, has at least so much.
const LEAST_PIECE_L: f64 = 0.02;

/// A merged lung has at least this share of its air on either side of the body.
const MERGED_SHARE: f64 = 0.2;

/// What is soft and has lung on both sides along two axes within this is a vessel in the lung. A dome, such as the
/// diaphragm's, loses a cap of this width: 0.13 mm of one with a radius of 60 mm.
const VESSEL_WIDTH_M: f64 = 8e-3;

/// What is soft and has lung on both sides along all three axes within this is in the lung.
const ENCLOSED_WIDTH_M: f64 = 40e-3;

/// Smoothed air is airway at the middle between air and lung if these are at least so far apart.
const AIRWAY_CONTRAST_HU: i16 = 80;

/// The airways of adults that CT shows: trachea, main and lobar bronchi.
const AIRWAYS_L: [f64; 2] = [2e-3, 0.2];

/// Trachea and main bronchi are at least so long.
const AIRWAY_LENGTH_M: f64 = 30e-3;

/// Airways, and not gas in a stomach or in the pleura, have at most this section over their length, m^2.
const AIRWAY_SECTION_M2: f64 = 7e-4;

/// The trachea has its middle so near to the midline, m,
const TRACHEA_ASIDE_M: f64 = 30e-3;

/// and above this share of their height, or this long, m: also that of a patient who is upside down in the file.
const TRACHEA_ABOVE: f64 = 0.4;
const TRACHEA_LENGTH_M: f64 = 60e-3;

/// Air in the place of a lung that is emptier than this has no lung around it (LAA-950, the level of emphysema in CT:
/// Gevenois et al., Am J Respir Crit Care Med 154:187, 1996).
const NO_LUNG_HU: i16 = -950;

/// So much of it is said and kept apart, l.
const LEAST_NO_LUNG_L: f64 = 5e-3;

/// How far from the midline it is no airway, m: beyond the lobar bronchi.
const NO_AIRWAY_M: f64 = 45e-3;

/// Two lungs have at least this share of their air on either side behind their middle: a single one crosses the midline
/// in front of the heart, and not beside the spine.
const BEHIND_SHARE: f64 = 0.1;

/// A lung with less than this share of the other's air is worth a remark.
const UNEQUAL: f64 = 0.65;

/// Bone about the midline by which a spine is seen, l.
const SPINE_L: f64 = 0.06;

/// Half of the width in which it is summed up, m.
const SPINE_M: f64 = 25e-3;

/// The midline is at least so far from the side of a chest that is not cut, m (assumed for adults).
const HALF_CHEST_M: f64 = 0.1;

/// Which lung.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// At the patient's left: larger x.
    Left,
    /// At the patient's right.
    Right,
}

impl Side {
    /// Name of the lung on this side.
    pub fn structure(self) -> &'static str {
        match self {
            Self::Left => "lung_left",
            Self::Right => "lung_right",
        }
    }
}

/// One lung, with its vessels and what else it encloses.
#[derive(Debug, Clone)]
pub struct Lung {
    /// Which one.
    pub side: Side,
    /// Its voxels, of the box of [`Lungs`].
    pub mask: Mask,
    /// Of its air, l.
    pub air_l: f64,
    /// Whether the first or the last slice cuts it.
    pub cut: bool,
}

/// Lungs and what is in them. Masks are of the box.
#[derive(Debug, Clone)]
pub struct Lungs {
    /// The box that the masks cover: the body's.
    pub bounds: IndexBox,
    /// None, one, or the left one and the right one.
    pub lungs: Vec<Lung>,
    /// Trachea and bronchi, as far as they are wider than about two voxels; their inside.
    pub airways: Mask,
    /// Soft tissue in the lungs: vessels, and nodules that nobody has pointed at.
    pub vessels: Mask,
    /// Air in the place of the lungs that has no lung around it: bullae, emphysema, a pneumothorax.
    pub no_lung: Mask,
    /// Other enclosed air: stomach, bowel.
    pub gas: Mask,
    /// Median of the air in the lungs; none without lungs.
    pub air_hu: Option<i16>,
}

/// Of the depth of the lungs' box: in front of its back quarter, where the spine is.
pub(super) const IN_FRONT: [f64; 2] = [0.1, 0.75];

impl Lungs {
    /// The least box around the lungs, as indices of the masks; none without lungs.
    pub(super) fn around(&self) -> Option<IndexBox> {
        let boxes = self.lungs.iter().filter_map(|lung| lung.mask.bounds());
        boxes.reduce(|a, b| a.joined(&b))
    }
}

pub(super) fn find(
    scan: &Scan<'_>,
    body: &Body,
    remarks: &mut Vec<Remark>,
) -> Result<Lungs, VolumeError> {
    let bounds = body.bounds;
    let mut airy = body.mask.cropped(&bounds);
    airy.subtract(&scan.denser(&airy, &bounds, scan.levels.lung_hu));
    scan.check()?;
    let parts = Components::of(&airy, Connectivity::Faces);
    let large = scan.voxels_of(LEAST_LUNG_L);
    let candidates = parts.mask_of(|part| parts.parts()[part].voxels >= large);
    let mut lungs = Lungs {
        bounds,
        lungs: Vec::new(),
        airways: Mask::empty(airy.size()),
        vessels: Mask::empty(airy.size()),
        no_lung: Mask::empty(airy.size()),
        gas: airy.clone(),
        air_hu: scan.median(&candidates, &bounds),
    };
    let Some(air_hu) = lungs.air_hu else {
        return Ok(lungs);
    };
    let midline = midline(scan, body);
    let (airways, no_lung, empty_hu) =
        empty_air(scan, &airy, &candidates, midline, &bounds, air_hu, remarks);
    lungs.airways = airways;
    scan.check()?;
    let mut air = airy.clone();
    air.subtract(&lungs.airways);
    let by_side = sides(scan, midline, &bounds, &air, empty_hu, remarks)?;
    for (side, air) in by_side {
        let air_l = scan.litres(air.count());
        if air_l < LEAST_LUNG_L {
            continue;
        }
        scan.check()?;
        let mask = with_enclosed(scan, &air);
        let [_, ny, nz] = mask.size();
        let at_end = |k: usize| (0..ny).any(|j| mask.runs(j, k).next().is_some());
        let cut = [0, nz - 1].into_iter().any(|k| {
            let in_volume = k + bounds.first[2];
            (in_volume == 0 || in_volume == scan.size()[2] - 1) && at_end(k)
        });
        lungs.gas.subtract(&air);
        lungs.lungs.push(Lung {
            side,
            mask,
            air_l,
            cut,
        });
    }
    separate(&mut lungs, &airy);
    lungs.lungs.sort_by_key(|lung| lung.side);
    for lung in &lungs.lungs {
        lungs.no_lung.unite(&lung.mask);
    }
    lungs.no_lung.intersect(&no_lung);
    note_no_lung(scan, &lungs, midline, remarks);
    lungs.gas.subtract(&lungs.airways);
    note_cut(scan, &lungs, remarks);
    Ok(lungs)
}

/// What both lungs enclose belongs to neither; soft tissue in them is vessels.
fn separate(lungs: &mut Lungs, airy: &Mask) {
    if let [one, other] = &mut lungs.lungs[..] {
        let mut both = one.mask.clone();
        both.intersect(&other.mask);
        one.mask.subtract(&both);
        other.mask.subtract(&both);
    }
    for lung in &mut lungs.lungs {
        lung.mask.subtract(&lungs.airways);
        lungs.vessels.unite(&lung.mask);
    }
    lungs.vessels.subtract(airy);
}

/// Lungs that were not found, or have little air. `is_given` says what a label map has.
pub(super) fn note_absent(
    lungs: &Lungs,
    is_given: &dyn Fn(&str) -> bool,
    remarks: &mut Vec<Remark>,
) {
    let sides = [Side::Left, Side::Right];
    let has = |side: &Side| {
        lungs.lungs.iter().any(|lung| lung.side == *side) || is_given(side.structure())
    };
    if sides.iter().all(has) && sides.iter().any(|side| is_given(side.structure())) {
        return;
    }
    match &lungs.lungs[..] {
        [] => remarks.push(Remark::new(format!(
            "no lung with {LEAST_LUNG_L} l of air found"
        ))),
        [lung] => remarks.push(Remark::new(format!(
            "one lung found, on the patient's {} side: the other one is absent, without air, or was not scanned, and \
             routes stay out of its half of the chest",
            match lung.side {
                Side::Left => "left",
                Side::Right => "right",
            }
        ))),
        [one, other] => {
            let (less, more) = if one.air_l < other.air_l {
                (one, other)
            } else {
                (other, one)
            };
            if less.air_l < UNEQUAL * more.air_l {
                remarks.push(Remark::new(format!(
                    "{} has {:.1} l of air, the other lung {:.1} l: effusion, collapse, resection, or a part that was \
                     not scanned; what is in its place counts as soft tissue",
                    less.side.structure(),
                    less.air_l,
                    more.air_l
                )));
            }
        }
        _ => {}
    }
}

fn note_cut(scan: &Scan<'_>, lungs: &Lungs, remarks: &mut Vec<Remark>) {
    for lung in lungs.lungs.iter().filter(|lung| lung.cut) {
        let ends = [0, scan.size()[2] - 1];
        let side = side_in_words(
            scan.volume,
            2,
            lung.mask
                .bounds()
                .is_some_and(|b| b.last[2] + lungs.bounds.first[2] == ends[1]),
        );
        remarks.push(Remark::new(format!(
            "the {} lung is cut at the {side} end of the volume",
            match lung.side {
                Side::Left => "left",
                Side::Right => "right",
            }
        )));
    }
}

fn note_no_lung(scan: &Scan<'_>, lungs: &Lungs, midline: f64, remarks: &mut Vec<Remark>) {
    if lungs.no_lung.is_empty() {
        return;
    }
    let axis = scan.axis_along(0);
    let beyond = share_beyond(&lungs.no_lung, axis, midline);
    let left = if runs_left(scan, axis) {
        beyond
    } else {
        1.0 - beyond
    };
    let all_ml = 1e3 * scan.litres(lungs.no_lung.count());
    let sides = [("left", left), ("right", 1.0 - left)]
        .into_iter()
        .filter(|(_, share)| share * all_ml >= 1.0)
        .map(|(side, share)| format!("{:.0} ml on the patient's {side} side", share * all_ml));
    remarks.push(Remark::new(format!(
        "air without lung around it (below {NO_LUNG_HU} HU): {}; bullae, emphysema or a pneumothorax, which routes do \
         not cross",
        sides.collect::<Vec<_>>().join(", ")
    )));
}

/// Where the patient's midline is, as an index along the axis to the left of a mask of the body's box.
///
/// Of a body that the field of view cuts at its left or right, the spine's; where that was not seen either, the side
/// that is cut.
fn midline(scan: &Scan<'_>, body: &Body) -> f64 {
    let axis = scan.axis_along(0);
    let middle = body.centroid[axis] - body.bounds.first[axis] as f64;
    let is_cut = |side: &str| body.cut_sides.contains(&side);
    if is_cut("left") == is_cut("right") {
        return middle;
    }
    let within = body.mask.cropped(&body.bounds);
    let mut counts = vec![0_usize; body.bounds.size()[axis]];
    // In the back half: in front of it a heart with contrast medium is as dense.
    let depth = scan.axis_along(1);
    let centre = body.centroid[depth] - body.bounds.first[depth] as f64;
    let runs_back = scan.volume.grid.steps_m()[(1, depth)] > 0.0;
    let dense = scan.denser(&within, &body.bounds, scan.levels.bone_hu);
    for voxel in dense.voxels() {
        if (voxel[depth] as f64 > centre) == runs_back {
            counts[voxel[axis]] += 1;
        }
    }
    // What is missing is on the side that is cut: the midline is not nearer to the other side than the middle of the rest.
    let aside = scan.voxels_across(HALF_CHEST_M, axis) as f64;
    let is_at_end = is_cut("left") == runs_left(scan, axis);
    let is_towards_cut = |at: usize| {
        let at = at as f64;
        if is_at_end {
            at >= middle.max(aside)
        } else {
            at <= middle.min(counts.len() as f64 - aside)
        }
    };
    let half = scan.voxels_across(SPINE_M, axis);
    let around = |at: usize| -> usize {
        let last = (at + half).min(counts.len() - 1);
        counts[at.saturating_sub(half)..=last].iter().sum()
    };
    let best = (0..counts.len()).filter(|&at| is_towards_cut(at));
    let best = best.max_by_key(|&at| (around(at), usize::MAX - at));
    match best.filter(|&at| scan.litres(around(at)) >= SPINE_L) {
        Some(at) => at as f64,
        None if is_at_end => counts.len() as f64,
        None => 0.0,
    }
}

/// Air that is clearly emptier than lung: trachea and bronchi by size, length and place, what has no lung around it, and
/// the level between such air and lung.
fn empty_air(
    scan: &Scan<'_>,
    airy: &Mask,
    candidates: &Mask,
    midline: f64,
    bounds: &IndexBox,
    lung_hu: i16,
    remarks: &mut Vec<Remark>,
) -> (Mask, Mask, Option<i16>) {
    let none = Mask::empty(airy.size());
    let contrast = lung_hu.saturating_add(1000);
    if contrast < AIRWAY_CONTRAST_HU {
        remarks.push(Remark::new(format!(
            "the air in the lungs is at {lung_hu} HU, as in the airways: neither these nor a pneumothorax were separated"
        )));
        return (none.clone(), none, None);
    }
    let level = i32::from(lung_hu) - i32::from(contrast) / 2;
    let core = emptier_than(scan, airy, bounds, level);
    let parts = Components::of(&core, Connectivity::Faces);
    let mut in_lungs = vec![false; parts.parts().len()];
    for (part, [from, _], j, k) in parts.runs() {
        in_lungs[part] = in_lungs[part] || candidates.get([from, j, k]);
    }
    let level_hu = i16::try_from(level).ok();
    let Some(around) = candidates.bounds() else {
        return (none.clone(), none, level_hu);
    };
    let [across, up] = [0, 2].map(|axis| scan.axis_along(axis));
    let aside_m = |part: usize| {
        (parts.parts()[part].centroid()[across] - midline).abs() * scan.spacing_m[across]
    };
    let is_trachea = |part: usize| {
        let each = &parts.parts()[part];
        let height = (each.centroid()[up] - around.first[up] as f64) / around.size()[up] as f64;
        let runs_up = scan.volume.grid.steps_m()[(2, up)] > 0.0;
        let height = if runs_up { height } else { 1.0 - height };
        aside_m(part) <= TRACHEA_ASIDE_M
            && (height >= TRACHEA_ABOVE
                || each.bounds.size()[up] as f64 * scan.spacing_m[up] >= TRACHEA_LENGTH_M)
    };
    let is_airway = |part: usize| {
        let each = &parts.parts()[part];
        let length_m = (0..3)
            .map(|axis| each.bounds.size()[axis] as f64 * scan.spacing_m[axis])
            .fold(0.0, f64::max);
        let litres = scan.litres(each.voxels);
        (AIRWAYS_L[0]..=AIRWAYS_L[1]).contains(&litres)
            && length_m >= AIRWAY_LENGTH_M
            && each.voxels as f64 * scan.voxel_m3() / length_m <= AIRWAY_SECTION_M2
            && (is_trachea(part) || in_lungs[part] && aside_m(part) <= NO_AIRWAY_M)
    };
    // The rim of their inside is as dense as lung by partial volume.
    let layer_m = 1.5 * scan.spacing_m[0].max(scan.spacing_m[1]);
    let with_rim = |inside: &Mask| {
        let mut whole = dilated(inside, layer_m, scan.spacing_m);
        whole.intersect(airy);
        whole
    };
    // The trachea is the largest of them; bronchi hang on it or are cut off by noise.
    let inside = parts.mask_of(is_airway);
    if inside.is_empty() {
        remarks.push(Remark::new(
            "no airways found: they may be part of the lungs",
        ));
    }
    let airways = with_rim(&inside);
    let least = scan.voxels_of(LEAST_NO_LUNG_L);
    let maybe = parts
        .mask_of(|part| in_lungs[part] && !is_airway(part) && parts.parts()[part].voxels >= least);
    if maybe.is_empty() {
        return (airways, none, level_hu);
    }
    let empty = emptier_than(scan, &maybe, bounds, i32::from(NO_LUNG_HU));
    let pockets = Components::of(&empty, Connectivity::Faces);
    let mut no_lung = with_rim(&pockets.mask_of(|part| pockets.parts()[part].voxels >= least));
    no_lung.subtract(&airways);
    (airways, no_lung, level_hu)
}

/// Voxels whose mean with their neighbours along i, j and k is below a level.
fn emptier_than(scan: &Scan<'_>, airy: &Mask, bounds: &IndexBox, level: i32) -> Mask {
    let [nx, ny, nz] = scan.size();
    let mut found = Mask::empty(airy.size());
    let [columns, rows, slices] = airy.size();
    let mut sums = vec![0; columns];
    for (j, k) in (0..slices).flat_map(|k| (0..rows).map(move |j| (j, k))) {
        let [at_j, at_k] = [j + bounds.first[1], k + bounds.first[2]];
        if at_j == 0 || at_j == ny - 1 || airy.row(j, k).iter().all(|&word| word == 0) {
            continue;
        }
        sums.fill(0);
        // At the first and the last slice, the slice itself stands for its neighbour; at the first and the last
        // column there is no voxel to be found.
        for (step, at_j, at_k) in [
            (-1, at_j, at_k),
            (0, at_j, at_k),
            (1, at_j, at_k),
            (0, at_j - 1, at_k),
            (0, at_j + 1, at_k),
            (0, at_j, at_k.saturating_sub(1)),
            (0, at_j, (at_k + 1).min(nz - 1)),
        ] {
            let row = scan.row([0, nx], at_j, at_k);
            let first = bounds.first[0].saturating_add_signed(step);
            let from = usize::from(bounds.first[0] == 0 && step < 0);
            for (sum, &hu) in sums[from..].iter_mut().zip(&row[first..]) {
                *sum += i32::from(hu);
            }
        }
        for at in [0, nx - 1] {
            if let Some(at) = at.checked_sub(bounds.first[0]).filter(|&at| at < columns) {
                sums[at] = i32::MAX;
            }
        }
        let row = found.row_mut(j, k);
        pack_row(&sums, row, |sum| sum < 7 * level);
        for (word, &airy) in row.iter_mut().zip(airy.row(j, k)) {
            *word &= airy;
        }
    }
    found
}

/// The air of each lung: pieces by the side of the body that they are on, and a piece that is on both cut in two.
fn sides(
    scan: &Scan<'_>,
    middle: f64,
    bounds: &IndexBox,
    air: &Mask,
    empty_hu: Option<i16>,
    remarks: &mut Vec<Remark>,
) -> Result<Vec<(Side, Mask)>, VolumeError> {
    let pieces = Components::of(air, Connectivity::Faces);
    let axis = scan.axis_along(0);
    let mut left = Mask::empty(air.size());
    let mut right = Mask::empty(air.size());
    let least = scan.voxels_of(LEAST_PIECE_L);
    for (part, piece) in pieces.parts().iter().enumerate() {
        if piece.voxels < least {
            continue;
        }
        let mask = pieces.mask_of(|each| each == part);
        let is_gas = || {
            let middle_hu = scan.median(&mask, bounds);
            empty_hu.is_some_and(|level| middle_hu.is_some_and(|middle| middle < level))
        };
        // Gas in a stomach is emptier than the lung above it.
        if piece.voxels < scan.voxels_of(LEAST_LUNG_L) && is_gas() {
            continue;
        }
        let share = share_beyond(&mask, axis, middle);
        let crosses = share.min(1.0 - share) >= MERGED_SHARE;
        if !crosses || !is_behind_both(scan, &mask, axis, middle) {
            if crosses {
                remarks.push(Remark::new(
                    "one lung reaches across the midline in front, and there is none beside the spine on the other \
                     side: taken for a single lung",
                ));
            }
            let is_left = (piece.centroid()[axis] > middle) == runs_left(scan, axis);
            (if is_left { &mut left } else { &mut right }).unite(&mask);
            continue;
        }
        scan.check()?;
        let (halves, how) = split(scan, &mask, axis, middle)?;
        remarks.push(Remark::new(format!(
            "the lungs are connected; they were separated {how}"
        )));
        for half in halves {
            let beyond = share_beyond(&half, axis, middle) > 0.5;
            (if beyond == runs_left(scan, axis) {
                &mut left
            } else {
                &mut right
            })
            .unite(&half);
        }
    }
    Ok(vec![(Side::Left, left), (Side::Right, right)])
}

/// Whether a piece of air has some on both sides of the midline in its back half.
fn is_behind_both(scan: &Scan<'_>, mask: &Mask, axis: usize, middle: f64) -> bool {
    let Some(bounds) = mask.bounds() else {
        return false;
    };
    let back = scan.axis_along(1);
    let half = usize::midpoint(bounds.first[back], bounds.last[back]);
    let mut behind = bounds;
    if scan.volume.grid.steps_m()[(1, back)] > 0.0 {
        behind.first[back] = half;
    } else {
        behind.last[back] = half;
    }
    let share = share_beyond(
        &mask.cropped(&behind),
        axis,
        middle - behind.first[axis] as f64,
    );
    share.min(1.0 - share) >= BEHIND_SHARE
}

/// Whether an axis of the grid runs to the patient's left.
fn runs_left(scan: &Scan<'_>, axis: usize) -> bool {
    scan.volume.grid.steps_m()[(0, axis)] > 0.0
}

/// Share of a mask's voxels whose index along an axis is beyond a place.
fn share_beyond(mask: &Mask, axis: usize, place: f64) -> f64 {
    let [_, ny, nz] = mask.size();
    let (mut beyond, mut all) = (0, 0);
    for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
        for [from, to] in mask.runs(j, k) {
            all += to - from;
            beyond += match axis {
                0 => (from..to).filter(|&i| i as f64 > place).count(),
                1 if j as f64 > place => to - from,
                2 if k as f64 > place => to - from,
                _ => 0,
            };
        }
    }
    beyond as f64 / f64::max(f64::from(u32::try_from(all).unwrap_or(u32::MAX)), 1.0)
}

/// Parts a mask at its narrowest place: worn away until it falls apart, then grown back from the pieces.
fn split(
    scan: &Scan<'_>,
    mask: &Mask,
    axis: usize,
    middle: f64,
) -> Result<([Mask; 2], String), VolumeError> {
    let total = mask.count();
    for radius_mm in [0.8, 1.2, 1.6, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0] {
        scan.check()?;
        let worn = eroded(mask, 1e-3 * radius_mm, scan.spacing_m);
        let pieces = Components::of(&worn, Connectivity::Faces);
        let mut order: Vec<usize> = (0..pieces.parts().len()).collect();
        order.sort_by_key(|&part| std::cmp::Reverse(pieces.parts()[part].voxels));
        let [Some(&one), Some(&other)] = [order.first(), order.get(1)] else {
            continue;
        };
        let [a, b] = [one, other].map(|part| &pieces.parts()[part]);
        let apart = (a.centroid()[axis] > middle) != (b.centroid()[axis] > middle);
        if !apart || b.voxels < total / 10 {
            continue;
        }
        let mut halves = [one, other].map(|part| pieces.mask_of(|each| each == part));
        grow_back(scan, &mut halves, mask)?;
        let how = format!(
            "where their connection is narrowest, at most {:.1} mm wide",
            2.0 * radius_mm
        );
        return Ok((halves, how));
    }
    let mut halves = [Mask::empty(mask.size()), Mask::empty(mask.size())];
    for voxel in mask.voxels() {
        halves[usize::from(voxel[axis] as f64 > middle)].insert(voxel);
    }
    Ok((
        halves,
        "at the midline of the body, because their connection is wide".to_owned(),
    ))
}

/// Whether a part lies between the lungs, where heart and great vessels are: its middle within the box of both, and
/// between two shares of its depth.
pub(super) fn is_between(
    scan: &Scan<'_>,
    body: &Body,
    lungs: &Lungs,
    part: &Component,
    shares: [f64; 2],
) -> bool {
    let Some(mut bounds) = lungs.around() else {
        return false;
    };
    if lungs.lungs.len() == 1 {
        // The other half of the chest is as wide.
        let across = scan.axis_along(0);
        let far = 2.0 * (body.centroid[across] - body.bounds.first[across] as f64);
        let mirrored = |index: usize| whole((far - index as f64).max(0.0));
        let [first, last] = [bounds.first[across], bounds.last[across]];
        bounds.first[across] = first.min(mirrored(last));
        bounds.last[across] = last.max(mirrored(first));
    }
    let middle = part.centroid();
    let within = |axis: usize| {
        (bounds.first[axis] as f64..=bounds.last[axis] as f64).contains(&middle[axis])
    };
    let posterior = scan.axis_along(1);
    let depth =
        (middle[posterior] - bounds.first[posterior] as f64) / (bounds.size()[posterior] as f64);
    let runs_back = scan.volume.grid.steps_m()[(1, posterior)] > 0.0;
    let depth = if runs_back { depth } else { 1.0 - depth };
    (0..3).all(within) && (shares[0]..shares[1]).contains(&depth)
}

/// Grows two masks within a third one, a layer at a time in turn, until all that they reach is theirs.
pub(super) fn grow_back(
    scan: &Scan<'_>,
    halves: &mut [Mask; 2],
    within: &Mask,
) -> Result<(), VolumeError> {
    let layer_m = 1.01 * scan.spacing_m.iter().copied().fold(0.0, f64::max);
    loop {
        let mut grew = false;
        for turn in 0..2 {
            let mut grown = dilated(&halves[turn], layer_m, scan.spacing_m);
            grown.intersect(within);
            grown.subtract(&halves[1 - turn]);
            grew |= grown != halves[turn];
            halves[turn] = grown;
        }
        scan.check()?;
        if !grew {
            return Ok(());
        }
    }
}

/// With the soft tissue that it encloses: vessels and nodules.
fn with_enclosed(scan: &Scan<'_>, air: &Mask) -> Mask {
    let Some(bounds) = air.bounds() else {
        return air.clone();
    };
    let part = air.cropped(&bounds);
    let gap = |width_m: f64, axis: usize| scan.voxels_across(width_m, axis);
    let along = |width_m: f64| [0, 1, 2].map(|axis| bridged(&part, axis, gap(width_m, axis)));
    let [i, j, k] = along(VESSEL_WIDTH_M);
    let mut enclosed = i.clone();
    enclosed.intersect(&j);
    for pair in [[&i, &k], [&j, &k]] {
        let mut both = pair[0].clone();
        both.intersect(pair[1]);
        enclosed.unite(&both);
    }
    let [mut all, j, k] = along(ENCLOSED_WIDTH_M);
    all.intersect(&j);
    all.intersect(&k);
    enclosed.unite(&all);
    enclosed.unite(&part);
    enclosed.unite(&holes(&enclosed));
    let mut filled = air.clone();
    filled.unite_within(&bounds, &enclosed);
    filled
}

/// What a mask encloses.
fn holes(mask: &Mask) -> Mask {
    let size = mask.size();
    let around = Components::of(&mask.complement(), Connectivity::Faces);
    around.mask_of(|part| {
        let bounds = &around.parts()[part].bounds;
        (0..3).all(|axis| bounds.first[axis] > 0 && bounds.last[axis] < size[axis] - 1)
    })
}
