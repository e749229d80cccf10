//! The patient without the couch.

use nalgebra::Point3;
use needlebench_volume::{HuHistogram, Remark, VolumeError};

use crate::components::{Components, Connectivity};
use crate::field_of_view::FieldOfView;
use crate::mask::{IndexBox, Mask};
use crate::morphology::{dilated, opened};

use super::{Scan, below, side_in_words};

/// Between air (-1000) and skin (+40), where the blur of the scanner leaves the surface. Half-integer: no voxel is on it.
pub(crate) const SKIN_LEVEL_HU: f64 = -479.5;

/// What is thinner than twice this is cut off: the shell of a couch, tubes, blankets.
const BED_HALF_THICKNESS_M: f64 = 3e-3;

/// A patient, or a phantom, is not smaller.
const LEAST_BODY_L: f64 = 0.05;

/// Share of a volume without air that no body has: even a field of view within a chest has lungs.
const FILLED: f64 = 0.9;

/// Outside air; lungs that the field of view cuts are denser.
const OUTSIDE_HU: f64 = -940.0;

/// Air at the border of the volume that may be a lung which the field of view cuts.
const CUT_LUNG_L: f64 = 0.05;

/// Share of a lung that has a chest wall in front of it and behind it; under a body, and beside it, is one at most.
const WITHIN_WALLS: f64 = 0.5;

/// Voxels so near to a side of the field of view end there, pixels.
const RIM_PIXELS: f64 = 0.75;

/// Area of contact, or of a cut, that is worth a remark.
const WORTH_MENTIONING_M2: f64 = 1e-4;

/// The patient without the couch, with all that the skin encloses.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its voxels.
    pub mask: Mask,
    /// The least box around them.
    pub bounds: IndexBox,
    /// Centroid, as an index.
    pub centroid: [f64; 3],
    /// Where the field of view cuts it (`left`, `anterior`, ...) other than at the first and last slice.
    pub cut_sides: Vec<&'static str>,
    /// Area at which its surface touches something else that is not air, such as the couch, m^2. There the surface is
    /// known to half a voxel only.
    pub contact_m2: f64,
}

pub(super) fn find(
    scan: &Scan<'_>,
    seen: &FieldOfView,
    unseen: Option<&Mask>,
    remarks: &mut Vec<Remark>,
) -> Result<Body, VolumeError> {
    let level = below(scan.levels.skin_hu);
    let tissue = Mask::of(scan.size(), &scan.volume.hu, |hu| hu > level);
    check_units(scan, &tissue)?;
    scan.check()?;
    let solid = without_bed(scan, &tissue, remarks)?;
    scan.check()?;
    let mask = filled(scan, &solid, unseen, remarks);
    let Some(bounds) = mask.bounds() else {
        return Err(nothing_there());
    };
    let mut others = tissue;
    others.subtract(&mask);
    let contact_m2 = contact_m2(scan, &mask, &others);
    if contact_m2 > WORTH_MENTIONING_M2 {
        remarks.push(Remark::new(format!(
            "the skin is in contact with another object (couch, marker, cushion) over {:.0} cm2, \
             where its surface is accurate to half a voxel only",
            1e4 * contact_m2
        )));
    }
    let cut_sides = cut_sides(scan, seen, &solid, remarks);
    Ok(Body {
        centroid: centroid(&mask),
        mask,
        bounds,
        cut_sides,
        contact_m2,
    })
}

/// Refuses lengths and values that are none of a patient.
fn check_units(scan: &Scan<'_>, tissue: &Mask) -> Result<(), VolumeError> {
    let voxels = scan.volume.hu.len();
    if scan.litres(voxels) < LEAST_BODY_L {
        let size_mm = scan.size().into_iter().zip(scan.spacing_m);
        let size_mm: Vec<String> = size_mm
            .map(|(count, step_m)| format!("{:.2}", 1e3 * count as f64 * step_m))
            .collect();
        return Err(VolumeError::refused(format!(
            "the whole volume is {} mm large, less than {LEAST_BODY_L} l",
            size_mm.join(" x ")
        ))
        .hint("are the file's lengths in metres, where it says millimetres?"));
    }
    let share = tissue.count() as f64 / voxels as f64;
    let histogram = HuHistogram::sampled(&scan.volume.hu);
    if share < FILLED || histogram.has_air_peak() {
        return Ok(());
    }
    let air = histogram.air_peak_hu().map_or_else(
        || "nothing is below -500 HU".to_owned(),
        |peak| format!("the most frequent value below -500 HU is {peak}"),
    );
    let least = histogram.range_hu().map_or(0, |[least, _]| least);
    Err(VolumeError::refused(format!(
        "{:.0} % of the volume is denser than {SKIN_LEVEL_HU} HU and no air is around a body: {air}, the least value \
         {least}",
        1e2 * share
    ))
    .hint("values must be Hounsfield units, air -1000 and water 0: check slope and intercept of the file"))
}

fn nothing_there() -> VolumeError {
    VolumeError::refused(format!(
        "no region of {LEAST_BODY_L} l is denser than {SKIN_LEVEL_HU} HU"
    ))
    .hint("is this a CT of a patient, in Hounsfield units?")
}

fn centroid(mask: &Mask) -> [f64; 3] {
    let mut sums = [0.0; 3];
    let mut count = 0.0;
    let [_, ny, nz] = mask.size();
    for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
        for [from, to] in mask.runs(j, k) {
            let length = (to - from) as f64;
            let middle = 0.5 * (from + to - 1) as f64;
            for (sum, at) in sums.iter_mut().zip([middle, j as f64, k as f64]) {
                *sum += length * at;
            }
            count += length;
        }
    }
    sums.map(|sum| sum / f64::max(count, 1.0))
}

/// Tissue of the largest part after what is thin was cut off.
fn without_bed(
    scan: &Scan<'_>,
    tissue: &Mask,
    remarks: &mut Vec<Remark>,
) -> Result<Mask, VolumeError> {
    let least = scan.voxels_of(LEAST_BODY_L);
    for radius_m in [BED_HALF_THICKNESS_M, 0.5 * BED_HALF_THICKNESS_M, 0.0] {
        let open = if radius_m > 0.0 {
            opened(tissue, radius_m, scan.spacing_m)
        } else {
            tissue.clone()
        };
        let parts = Components::of(&open, Connectivity::Faces);
        let Some(largest) = parts.largest() else {
            continue;
        };
        // A thin shell loses most of itself, and its rest is not the body.
        if parts.parts()[largest].voxels < least.max(tissue.count() / 10) {
            continue;
        }
        if radius_m < BED_HALF_THICKNESS_M {
            remarks.push(Remark::new(format!(
                "the body is mostly thinner than {:.0} mm (a shell?): only parts thinner than \
                 {:.0} mm were removed, and the couch may be part of the body",
                2e3 * BED_HALF_THICKNESS_M,
                2e3 * radius_m
            )));
        }
        let kept = parts.mask_of(|part| part == largest);
        // Rounding of the ball to voxels takes a layer off some corners.
        let layer_m = 1.5 * scan.spacing_m[0].max(scan.spacing_m[1]);
        let mut solid = dilated(&kept, layer_m, scan.spacing_m);
        solid.intersect(tissue);
        return Ok(solid);
    }
    Err(nothing_there())
}

/// With all that it encloses.
fn filled(scan: &Scan<'_>, solid: &Mask, unseen: Option<&Mask>, remarks: &mut Vec<Remark>) -> Mask {
    // What was not seen is air in all of the image, and would join a lung that it cuts to the air around the body.
    let mut open = solid.complement();
    if let Some(unseen) = unseen {
        open.subtract(unseen);
    }
    let [nx, ny, _] = scan.size();
    let around = Components::of(&open, Connectivity::Faces);
    let at_rim = unseen.map_or_else(Vec::new, |unseen| parts_beside(&around, unseen));
    let touches_side = |bounds: &IndexBox| {
        bounds.first[0] == 0
            || bounds.first[1] == 0
            || bounds.last[0] == nx - 1
            || bounds.last[1] == ny - 1
    };
    let walls = walls(solid);
    let mut sums = vec![(0.0, 0.0, 0.0); around.parts().len()];
    for (part, [from, to], j, k) in around.runs() {
        // The middle of a run stands for it: noise averages out over all runs.
        let length = (to - from) as f64;
        let middle = from.midpoint(to - 1);
        sums[part].0 += length * f64::from(scan.hu([middle, j, k]));
        sums[part].1 += length;
        let [front, back] = walls[k * nx + middle];
        if (front..back).contains(&j) {
            sums[part].2 += length;
        }
    }
    let largest = around.largest();
    let share = |part: usize, sum: f64| sum / f64::max(sums[part].1, 1.0);
    let is_outside: Vec<bool> = around
        .parts()
        .iter()
        .enumerate()
        .map(|(part, each)| {
            let at_side = touches_side(&each.bounds) || at_rim.get(part) == Some(&true);
            let lung_like = (Some(part) != largest || unseen.is_some())
                && share(part, sums[part].0) > OUTSIDE_HU
                && share(part, sums[part].2) > WITHIN_WALLS
                && scan.litres(each.voxels) > CUT_LUNG_L;
            if at_side && lung_like {
                remarks.push(Remark::new(format!(
                    "{:.1} l of air at the border of the volume was classified as a lung cut by \
                     the field of view",
                    scan.litres(each.voxels)
                )));
            }
            at_side && !lung_like
        })
        .collect();
    let mut outside = around.mask_of(|part| is_outside[part]);
    if let Some(unseen) = unseen {
        outside.unite(unseen);
    }
    outside.subtract(solid);
    let body = outside.complement();
    let parts = Components::of(&body, Connectivity::Faces);
    let largest = parts.largest();
    parts.mask_of(|part| Some(part) == largest)
}

/// The first and the last voxel of a mask along the second axis, for each column of each slice.
fn walls(mask: &Mask) -> Vec<[usize; 2]> {
    let [nx, ny, nz] = mask.size();
    let mut found = vec![[ny, 0]; nx * nz];
    for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
        for [from, to] in mask.runs(j, k) {
            for [first, last] in &mut found[k * nx + from..k * nx + to] {
                *first = (*first).min(j);
                *last = j;
            }
        }
    }
    found
}

/// Which parts touch a mask within their slices.
fn parts_beside(parts: &Components, mask: &Mask) -> Vec<bool> {
    let mut found = vec![false; parts.parts().len()];
    let [nx, ny, _] = mask.size();
    for (part, [from, to], j, k) in parts.runs() {
        if found[part] {
            continue;
        }
        let ends = [from.checked_sub(1), Some(to).filter(|&i| i < nx)];
        let above = [j.checked_sub(1), Some(j + 1).filter(|&j| j < ny)];
        let at_end = ends.into_iter().flatten().any(|i| mask.get([i, j, k]));
        found[part] = at_end
            || above
                .into_iter()
                .flatten()
                .any(|j| (from..to).any(|i| mask.get([i, j, k])));
    }
    found
}

/// Area of the faces between two masks that do not overlap, other than along k, m^2.
fn contact_m2(scan: &Scan<'_>, one: &Mask, other: &Mask) -> f64 {
    let [_, ny, nz] = one.size();
    let [mut along_i, mut along_j] = [0_u32; 2];
    for k in 0..nz {
        for j in 0..ny {
            let beside = other.row(j, k);
            if beside.iter().all(|&word| word == 0) {
                continue;
            }
            let row = one.row(j, k);
            for (at, &word) in beside.iter().enumerate() {
                let up = word << 1 | at.checked_sub(1).map_or(0, |at| beside[at] >> 63);
                let down = word >> 1 | beside.get(at + 1).map_or(0, |next| next << 63);
                along_i += (row[at] & up).count_ones() + (row[at] & down).count_ones();
            }
            for near in [j.checked_sub(1), Some(j + 1).filter(|&j| j < ny)]
                .into_iter()
                .flatten()
            {
                let pairs = one.row(near, k).iter().zip(beside);
                along_j += pairs.map(|(a, b)| (a & b).count_ones()).sum::<u32>();
            }
        }
    }
    let [x, y, z] = scan.spacing_m;
    f64::from(along_i) * y * z + f64::from(along_j) * x * z
}

/// Where the sides of the field of view cut the body.
fn cut_sides(
    scan: &Scan<'_>,
    seen: &FieldOfView,
    solid: &Mask,
    remarks: &mut Vec<Remark>,
) -> Vec<&'static str> {
    let grid = &scan.volume.grid;
    let [_, ny, nz] = scan.size();
    let [x, y, z] = scan.spacing_m;
    let near_m = RIM_PIXELS * x.max(y);
    // Towards -i, +i, -j, +j.
    let mut areas_m2 = [0.0; 4];
    let mut add = |voxel: [usize; 3], face: usize, area_m2: f64| {
        let place = grid.ct_from_index(&Point3::from(voxel.map(|index| index as f64)));
        let Some((depth_m, normal)) = seen.nearest_side(&place) else {
            return;
        };
        let along = grid.steps_m().column(face / 2).normalize();
        let outwards = if face % 2 == 1 { along } else { -along };
        // What a stair of voxels has of the side's area.
        let share = outwards.dot(&normal);
        if depth_m < near_m && share > 0.0 {
            areas_m2[face] += share * area_m2;
        }
    };
    for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
        for [from, to] in solid.runs(j, k) {
            add([from, j, k], 0, y * z);
            add([to - 1, j, k], 1, y * z);
        }
        for (face, near) in [(2, j.checked_sub(1)), (3, Some(j + 1).filter(|&j| j < ny))] {
            for (at, &word) in solid.row(j, k).iter().enumerate() {
                let beside = near.map_or(0, |near| solid.row(near, k)[at]);
                let mut open = word & !beside;
                while open != 0 {
                    let bit = open.trailing_zeros() as usize;
                    add([64 * at + bit, j, k], face, x * z);
                    open &= open - 1;
                }
            }
        }
    }
    let mut sides = Vec::new();
    for (face, area_m2) in areas_m2.into_iter().enumerate() {
        if area_m2 > WORTH_MENTIONING_M2 {
            let side = side_in_words(scan.volume, face / 2, face % 2 == 1);
            remarks.push(Remark::new(format!(
                "the field of view cuts the body on its {side} side, over {:.0} cm2: no skin was seen there, where \
                 nothing may enter and clearances are not evaluated",
                1e4 * area_m2
            )));
            sides.push(side);
        }
    }
    sides
}
