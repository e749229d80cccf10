//! The part of a scan around a lesion, with slices in between.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_volume::{NotAGrid, Volume, VoxelGrid};

use crate::mask::{IndexBox, Mask};
use crate::morphology::closed;
use crate::segment::{Scan, Segmentation};
use crate::spacing::whole;

/// Slices that are put in between, at most: 5 mm over pixels of 0.6 mm.
const MOST_PARTS: usize = 8;

/// Share of lung around a seed from which on the lesion is one in the lung.
const LUNG_SHARE: f64 = 0.1;

/// A box of a scan. Slices are put in between, linear between theirs, so that voxels are about as high as wide: a vessel that
/// leaves a lesion between two thick slices is cut off where it leaves, and not a slice further.
pub(super) struct Local {
    /// Its voxels.
    pub volume: Volume,
    /// In the scan.
    pub bounds: IndexBox,
    /// Steps from a slice of the scan to the next one.
    pub parts: usize,
    /// Voxels of the body.
    pub body: Mask,
}

impl Local {
    pub(super) fn new(
        scan: &Scan<'_>,
        found: &Segmentation,
        bounds: IndexBox,
    ) -> Result<Self, NotAGrid> {
        let pixel_m = scan.spacing_m[0].max(scan.spacing_m[1]);
        let parts = whole((scan.spacing_m[2] / pixel_m).round()).clamp(1, MOST_PARTS);
        let grid = refined(&scan.volume.grid, &bounds, parts)?;
        let [nx, ny, nz] = grid.size();
        let mut hu = Vec::with_capacity(grid.len());
        for k in 0..nz {
            let share = (k % parts) as f64 / parts as f64;
            let below = bounds.first[2] + k / parts;
            for j in 0..ny {
                let columns = [bounds.first[0], bounds.first[0] + nx];
                let row = |k: usize| scan.row(columns, bounds.first[1] + j, k);
                if k % parts == 0 {
                    hu.extend_from_slice(row(below));
                } else {
                    let pairs = row(below).iter().zip(row(below + 1));
                    hu.extend(pairs.map(|(&low, &high)| between(low, high, share)));
                }
            }
        }
        let body = found.body.mask.cropped(&bounds);
        let body = stretched(&body, parts, |_, either| either);
        Ok(Self {
            volume: Volume {
                grid,
                hu,
                slice_thickness_m: scan.volume.slice_thickness_m,
            },
            bounds,
            parts,
            body,
        })
    }

    /// A box of a scan as a volume of its own, with no slices in between.
    pub(super) fn own(scan: &Scan<'_>, bounds: &IndexBox) -> Result<Volume, NotAGrid> {
        let grid = refined(&scan.volume.grid, bounds, 1)?;
        let [nx, ny, nz] = grid.size();
        let columns = [bounds.first[0], bounds.first[0] + nx];
        let places = (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k)));
        let rows = places.map(|(j, k)| scan.row(columns, bounds.first[1] + j, bounds.first[2] + k));
        Ok(Volume {
            hu: rows.flatten().copied().collect(),
            grid,
            slice_thickness_m: scan.volume.slice_thickness_m,
        })
    }

    /// The lung that a voxel of the box is in, with its wall carried on across what grows into it by a ball of a radius;
    /// none if it is in none.
    pub(super) fn lung_hull(
        &self,
        scan: &Scan<'_>,
        found: &Segmentation,
        at: [usize; 3],
        wall_m: f64,
    ) -> Option<Mask> {
        let by = [0, 1, 2].map(|axis| scan.voxels_across(wall_m, axis) + 1);
        let wide = self.bounds.widened(by.map(|by| 2 * by), scan.size());
        let lungs = &found.lungs;
        let seen = wide.common(&lungs.bounds);
        let from = |of: &IndexBox, origin: [usize; 3], more: [usize; 3]| IndexBox {
            first: [0, 1, 2].map(|axis| (of.first[axis] + more[axis]).saturating_sub(origin[axis])),
            last: [0, 1, 2].map(|axis| (of.last[axis] + more[axis]).saturating_sub(origin[axis])),
        };
        let inner = from(&seen, lungs.bounds.first, [0; 3]);
        // With room for the ball on the other side of the wall: beyond the end of a box it would not be worn away again.
        let place = from(&seen, wide.first, by);
        let mine = from(&self.bounds, wide.first, by);
        let size = [0, 1, 2].map(|axis| wide.size()[axis] + 2 * by[axis]);
        let nearest = [at[0], at[1], (at[2] + self.parts / 2) / self.parts];
        let whole_lungs = lungs.lungs.iter().map(|lung| {
            let mut mask = Mask::empty(size);
            mask.unite_within(&place, &lung.mask.cropped(&inner));
            mask
        });
        let near: Vec<Mask> = whole_lungs.filter(|lung| !lung.is_empty()).collect();
        let voxels: usize = near.iter().map(|lung| lung.cropped(&mine).count()).sum();
        let body = self.body.count() as f64 / self.parts as f64;
        if (voxels as f64) < LUNG_SHARE * body {
            return None;
        }
        // One by one: together they would enclose what is between them.
        let mut hulls = near
            .iter()
            .map(|lung| closed(lung, wall_m, scan.spacing_m).cropped(&mine));
        let hull = hulls
            .find(|hull| hull.get([nearest[0], nearest[1], nearest[2].min(hull.size()[2] - 1)]))?;
        let mut fine = stretched(&hull, self.parts, |both, _| both);
        if self.parts > 1 {
            // Between a slice in it and one that is not, air tells.
            let mut airy = stretched(&hull, self.parts, |_, either| either);
            let whole = IndexBox::whole(airy.size());
            let air = Mask::of_box(airy.size(), &self.volume.hu, &whole, |hu| {
                f64::from(hu) < crate::segment::LUNG_LEVEL_HU
            });
            airy.intersect(&air);
            fine.unite(&airy);
        }
        Some(fine)
    }

    /// The voxels of a mask of the box that are the scan's own.
    pub(super) fn in_scan(&self, mask: &Mask) -> Mask {
        let size = self.bounds.size();
        let mut out = Mask::empty(size);
        for k in 0..size[2] {
            for j in 0..size[1] {
                out.row_mut(j, k)
                    .copy_from_slice(mask.row(j, k * self.parts));
            }
        }
        out
    }

    /// A part of the box that holds a mask, with a margin in voxels, and the mask in it.
    pub(super) fn cropped(&self, mask: &Mask, margin: usize) -> Result<(Volume, Mask), NotAGrid> {
        let size = mask.size();
        let bounds = mask.bounds().unwrap_or(IndexBox::whole(size));
        let bounds = bounds.widened([margin; 3], size);
        let grid = refined(&self.volume.grid, &bounds, 1)?;
        let [nx, ny, nz] = grid.size();
        let mut hu = Vec::with_capacity(grid.len());
        for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
            let [i, j, k] = [bounds.first[0], bounds.first[1] + j, bounds.first[2] + k];
            let from = self.volume.grid.offset([i, j, k]);
            hu.extend_from_slice(&self.volume.hu[from..from + nx]);
        }
        let volume = Volume {
            grid,
            hu,
            slice_thickness_m: self.volume.slice_thickness_m,
        };
        Ok((volume, mask.cropped(&bounds)))
    }
}

/// The grid of a box, with so many steps from slice to slice.
fn refined(grid: &VoxelGrid, bounds: &IndexBox, parts: usize) -> Result<VoxelGrid, NotAGrid> {
    let [nx, ny, nz] = bounds.size();
    let finer = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / parts as f64));
    let first = Point3::from(bounds.first.map(|index| index as f64));
    VoxelGrid::new(
        [nx, ny, (nz - 1) * parts + 1],
        grid.steps_m() * finer,
        grid.ct_from_index(&first),
    )
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "between two values of 16 bits"
)]
fn between(low: i16, high: i16, share: f64) -> i16 {
    let value = f64::from(low) + share * (f64::from(high) - f64::from(low));
    value.round() as i16
}

/// With slices in between, made of the words that both neighbours have, and those that either has.
fn stretched(mask: &Mask, parts: usize, how: impl Fn(u64, u64) -> u64) -> Mask {
    let [nx, ny, nz] = mask.size();
    let mut out = Mask::empty([nx, ny, (nz - 1) * parts + 1]);
    for k in 0..out.size()[2] {
        let (below, above) = (k / parts, k.div_ceil(parts));
        for j in 0..ny {
            let pairs = mask.row(j, below).iter().zip(mask.row(j, above));
            for (to, (&low, &high)) in out.row_mut(j, k).iter_mut().zip(pairs) {
                *to = how(low & high, low | high);
            }
        }
    }
    out
}
