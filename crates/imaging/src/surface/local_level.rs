//! The middle between a structure and what is around it, place by place.

use needlebench_volume::VoxelGrid;

use crate::components::{Components, Connectivity};
use crate::mask::{IndexBox, Mask, set_bits};
use crate::morphology::{dilated, eroded};

use super::field::LocalLevel;

/// Edge of a block that has one level.
const BLOCK_M: f64 = 12e-3;

/// What is around the structure is looked at between these distances from it: beyond its blur, before its neighbours.
const AROUND_M: [f64; 2] = [1.6e-3, 4e-3];

/// Of the values inside: what the edge's blur leaves alone. Half of a rib's voxels are at its edge.
const INSIDE_QUANTILE: f64 = 0.8;

/// Voxels from its surface within which a voxel's own value says whether it is inside: its neighbours, edges included.
const LAYER: f64 = 1.5;

/// Smaller pieces and holes are noise.
const SPECK_M3: f64 = 50e-9;

/// Fewer values say nothing.
const LEAST_VALUES: usize = 20;

/// Levels of a structure that is denser than what is around it, from the values inside it and around it.
///
/// `around` says which voxels count as its surroundings (soft tissue, not air). `None` if there is not enough of either.
pub(crate) fn local_level(
    hu: &[i16],
    grid: &VoxelGrid,
    inside: &Mask,
    bounds: &IndexBox,
    around: impl Fn(i16) -> bool,
) -> Option<LocalLevel> {
    let spacing_m = grid.spacing_m();
    let block = spacing_m.map(|step| crate::spacing::whole(BLOCK_M / step).max(1));
    let size = [0, 1, 2].map(|axis| bounds.size()[axis].div_ceil(block[axis]));
    let mut values: [Vec<Vec<i16>>; 2] = [0, 1].map(|_| vec![Vec::new(); size.iter().product()]);
    let mut shell = dilated(inside, AROUND_M[1], spacing_m);
    shell.subtract(&dilated(inside, AROUND_M[0], spacing_m));
    let [_, ny, nz] = inside.size();
    let rows = (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k)));
    for (j, k) in rows {
        let [x, y, z] = bounds.first;
        let row = &hu[grid.offset([x, j + y, k + z])..];
        let first = (k / block[2] * size[1] + j / block[1]) * size[0];
        for [from, to] in inside.runs(j, k) {
            for at in from / block[0]..=(to - 1) / block[0] {
                let [from, to] = [from.max(at * block[0]), to.min((at + 1) * block[0])];
                values[0][first + at].extend_from_slice(&row[from..to]);
            }
        }
        for i in set_bits(shell.row(j, k)) {
            if around(row[i]) {
                values[1][first + i / block[0]].push(row[i]);
            }
        }
    }
    let mut all = [0, 1].map(|side| values[side].iter().flatten().copied().collect::<Vec<i16>>());
    let whole = [
        quantile(&mut all[0], INSIDE_QUANTILE)?,
        quantile(&mut all[1], 0.5)?,
    ];
    let [inside, around] = values.map(IntoIterator::into_iter);
    let levels = inside.zip(around).map(|(mut inside, mut around)| {
        let inside = quantile(&mut inside, INSIDE_QUANTILE).unwrap_or(whole[0]);
        let around = quantile(&mut around, 0.5).unwrap_or(whole[1]);
        0.5 * (inside + around)
    });
    Some(LocalLevel::new(bounds.first, block, size, levels.collect()))
}

/// A structure by its levels instead of by the threshold that found it: within a voxel or so of its surface a voxel is
/// inside if it is above the level; deeper it is inside, and specks that come loose are dropped.
pub fn refine(
    hu: &[i16],
    grid: &VoxelGrid,
    inside: &Mask,
    bounds: &IndexBox,
    levels: &LocalLevel,
) -> Mask {
    let spacing_m = grid.spacing_m();
    // In voxels: in thick slices what is deep within its slice may be at the surface of the next one.
    let mut refined = eroded(inside, LAYER, [1.0; 3]);
    let mut band = dilated(inside, LAYER, [1.0; 3]);
    band.subtract(&refined);
    for [i, j, k] in band.voxels() {
        let [x, y, z] = bounds.first;
        let voxel = [i + x, j + y, k + z];
        if f32::from(hu[grid.offset(voxel)]) > levels.at(voxel) {
            refined.insert([i, j, k]);
        }
    }
    let parts = Components::of(&refined, Connectivity::Faces);
    let voxel_m3: f64 = spacing_m.iter().product();
    refined = parts.mask_of(|part| parts.parts()[part].voxels as f64 * voxel_m3 >= SPECK_M3);
    let holes = Components::of(&refined.complement(), Connectivity::Faces);
    let largest = holes.largest();
    refined.unite(&holes.mask_of(|part| {
        Some(part) != largest && holes.parts()[part].voxels as f64 * voxel_m3 < SPECK_M3
    }));
    refined
}

fn quantile(values: &mut [i16], share: f64) -> Option<f32> {
    if values.len() < LEAST_VALUES {
        return None;
    }
    let at = crate::spacing::whole(share * values.len() as f64).min(values.len() - 1);
    let (_, &mut value, _) = values.select_nth_unstable(at);
    Some(f32::from(value))
}
