//! What of a box is the lesion.

use nalgebra::Point3;
use needlebench_volume::{VolumeError, VoxelGrid};

use crate::components::{Components, Connectivity};
use crate::distance::{DistanceField, DistanceOptions};
use crate::mask::{IndexBox, Mask};
use crate::morphology::{closed, dilated, opened};
use crate::segment::{LUNG_LEVEL_HU, Scan};

use super::local::Local;

/// A point that was clicked may be so far beside what is dense.
const BESIDE_M: f64 = 4e-3;

/// Its density is the median within this distance of the seed.
const CORE_M: f64 = 1.5e-3;

/// What is around a lesion outside of the lung is the median between these distances from its seed.
const AROUND_M: [f64; 2] = [14e-3, 21e-3];

/// A vessel is thinner than this share of the lesion, and is cut off where it leaves the lesion.
pub(super) const VESSEL_SHARE: f64 = 0.6;

/// Outside of the lung, a lesion that differs less from its surroundings cannot be told from them.
const LEAST_CONTRAST_HU: f64 = 40.0;

/// In the lung, where vessels that are thinner than a voxel and noise reach as far: ground glass of -600 HU has 250 HU.
const LEAST_IN_LUNG_HU: f64 = 150.0;

/// What is denser than ground glass by this share of its contrast to the lung is a vessel, and noise is not.
const DENSER: f64 = 1.0;

/// A lesion that holds more than so many balls of the largest one inside it has leaked.
const MOST_BALLS: f64 = 8.0;

/// How a lesion is bounded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounding {
    /// Where its surface is, from what is around it to its own density.
    pub level: f64,
    /// What is thinner than this share of it is cut off.
    pub vessel: f64,
}

/// The usual one.
pub(super) const USUAL: Bounding = Bounding {
    level: 0.5,
    vessel: VESSEL_SHARE,
};

/// A lesion of a box.
#[expect(
    clippy::struct_excessive_bools,
    reason = "facts that do not depend on each other"
)]
pub(super) struct Grown {
    pub mask: Mask,
    pub level_hu: f64,
    pub radius_m: f64,
    pub cut_at_wall: bool,
    pub cut_at_vessels: bool,
    pub leaked: bool,
    /// Whether it reaches the end of the box.
    pub goes_on: bool,
}

/// A box with a seed in it.
pub(super) struct Grower<'a> {
    /// The box as a scan of its own.
    scan: Scan<'a>,
    local: &'a Local,
    /// Size of the scan that the box is of.
    of_size: [usize; 3],
    at: [usize; 3],
    /// What is around the lesion.
    around_hu: i16,
    pub median_hu: i16,
    pub in_lung: bool,
}

impl<'a> Grower<'a> {
    /// With a seed near `at`. The density of a lung that it is in is known.
    pub(super) fn new(
        scan: &Scan<'a>,
        local: &'a Local,
        at: [usize; 3],
        lung_hu: Option<i16>,
    ) -> Result<Self, VolumeError> {
        let mut grower = Self {
            scan: Scan {
                volume: &local.volume,
                spacing_m: local.volume.grid.spacing_m(),
                levels: scan.levels,
                cancel: scan.cancel,
            },
            local,
            of_size: scan.size(),
            at,
            around_hu: 0,
            median_hu: 0,
            in_lung: lung_hu.is_some(),
        };
        grower.move_to_dense(lung_hu)?;
        let whole = IndexBox::whole(local.body.size());
        let core = grower.ball(CORE_M);
        grower.median_hu = grower.scan.median(&core, &whole).unwrap_or_default();
        grower.around_hu = lung_hu.unwrap_or_else(|| {
            let mut shell = grower.ball(AROUND_M[1]);
            shell.subtract(&grower.ball(AROUND_M[0]));
            let around = grower.scan.median(&shell, &whole);
            around.unwrap_or(grower.median_hu)
        });
        let least = if grower.in_lung {
            LEAST_IN_LUNG_HU
        } else {
            LEAST_CONTRAST_HU
        };
        if grower.contrast() < least {
            return Err(VolumeError::refused(format!(
                "at {} HU it cannot be separated from its surroundings at {} HU",
                grower.median_hu, grower.around_hu
            ))
            .hint("use a label map for its outline"));
        }
        Ok(grower)
    }

    fn contrast(&self) -> f64 {
        f64::from(self.median_hu) - f64::from(self.around_hu)
    }

    /// Half-integer.
    fn level_at(&self, share: f64) -> f64 {
        (f64::from(self.around_hu) + share * self.contrast()).floor() + 0.5
    }

    /// Voxels of the body within a distance of the seed.
    fn ball(&self, radius_m: f64) -> Mask {
        ball(&self.local.body, self.at, radius_m, self.scan.spacing_m)
    }

    /// To the nearest voxel that is denser than lung. Its mean with its neighbours counts, for noise.
    fn move_to_dense(&mut self, lung_hu: Option<i16>) -> Result<(), VolumeError> {
        let level = lung_hu.map_or(LUNG_LEVEL_HU, |hu| f64::from(hu) + LEAST_IN_LUNG_HU);
        let distance = |to: [usize; 3]| -> f64 {
            (0..3)
                .map(|axis| {
                    (to[axis].abs_diff(self.at[axis]) as f64 * self.scan.spacing_m[axis]).powi(2)
                })
                .sum()
        };
        let near = self.ball(BESIDE_M);
        let dense = near
            .voxels()
            .filter(|&at| self.mean_hu(at) > level)
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        match dense {
            Some(at) => {
                self.at = at;
                Ok(())
            }
            None => Err(VolumeError::refused(format!(
                "the point is in air, {} HU, with nothing denser than {level:.0} HU within {:.0} mm",
                self.scan.hu(self.at),
                1e3 * BESIDE_M
            ))
            .hint("set the point at the centre of the lesion")),
        }
    }

    /// Mean of a voxel and those beside it, HU.
    fn mean_hu(&self, at: [usize; 3]) -> f64 {
        let window = IndexBox {
            first: at,
            last: at,
        }
        .widened([1; 3], self.local.body.size());
        let (mut sum, mut count) = (0.0, 0.0);
        for k in window.first[2]..=window.last[2] {
            for j in window.first[1]..=window.last[1] {
                let row = self.scan.row([window.first[0], window.last[0] + 1], j, k);
                sum += row.iter().map(|&hu| f64::from(hu)).sum::<f64>();
                count += row.len() as f64;
            }
        }
        sum / count
    }

    /// What is within the lung's hull, where there is one, and denser than the level.
    pub(super) fn grow(
        &self,
        hull: Option<&Mask>,
        bounding: Bounding,
    ) -> Result<Grown, VolumeError> {
        self.scan.check()?;
        let level_hu = self.level_at(bounding.level);
        let whole = IndexBox::whole(self.local.body.size());
        let mut region = self
            .scan
            .within(&self.local.body, &whole, |hu| f64::from(hu) > level_hu);
        let unbounded = region.clone();
        if let Some(hull) = hull {
            region.intersect(hull);
        }
        let around = component_at(&region, self.at);
        let faint = self.without_dense(&around);
        let (top, radius_m) = self.deepest(&faint)?;
        let (mut mask, cut_at_vessels) =
            self.without_vessels(&faint, top, radius_m, bounding.vessel);
        if faint.count() < around.count() {
            // Vessels through it, and a dense core, are of it.
            mask = closed(&mask, bounding.vessel * radius_m, self.scan.spacing_m);
            mask.intersect(&around);
        }
        let mut cut_at_wall = false;
        if hull.is_some() {
            let layer_m = 1.5 * self.scan.spacing_m[0].max(self.scan.spacing_m[1]);
            let mut beyond = dilated(&mask, layer_m, self.scan.spacing_m);
            beyond.intersect(&unbounded);
            beyond.subtract(&region);
            cut_at_wall = !beyond.is_empty();
        }
        let goes_on = self.touches_border(&mask);
        let leaked = goes_on || self.is_no_ball(&mask, radius_m);
        if leaked {
            mask.intersect(&ball(
                &self.local.body,
                top,
                2.0 * radius_m,
                self.scan.spacing_m,
            ));
            mask = component_at(&mask, top);
        }
        Ok(Grown {
            mask,
            level_hu,
            radius_m,

            cut_at_wall,
            cut_at_vessels,
            leaked,
            goes_on,
        })
    }

    /// Ground glass without the vessels in it, which are far denser; anything else as it is.
    fn without_dense(&self, around: &Mask) -> Mask {
        if !self.in_lung || f64::from(self.median_hu) > LUNG_LEVEL_HU {
            return around.clone();
        }
        let whole = IndexBox::whole(around.size());
        let most = f64::from(self.median_hu) + DENSER * self.contrast();
        let faint = self.scan.within(around, &whole, |hu| f64::from(hu) < most);
        let mut faint = component_at(&faint, self.at);
        if faint.is_empty() {
            faint = around.clone();
        }
        faint
    }

    /// Uphill in the distance to the surface, from the seed: the middle of the largest ball there, and its radius.
    fn deepest(&self, region: &Mask) -> Result<([usize; 3], f64), VolumeError> {
        let seed = IndexBox {
            first: self.at,
            last: self.at,
        };
        let bounds = region.bounds().unwrap_or(seed).joined(&seed);
        let bounds = bounds.widened([1; 3], region.size());
        let part = region.cropped(&bounds);
        let grid = VoxelGrid::aligned(part.size(), self.scan.spacing_m, Point3::origin())
            .map_err(|error| VolumeError::refused(error.to_string()))?;
        let options = DistanceOptions {
            cap_m: super::REACHES_M[2],
            threads: 1,
            cancel: self.scan.cancel,
        };
        let whole = IndexBox::whole(part.size());
        let field = DistanceField::new(&grid, &part.complement(), whole, &options)?;
        let field_at = |at: [usize; 3]| {
            let inside = bounds.contains(at);
            let index = [0, 1, 2].map(|axis| at[axis].saturating_sub(bounds.first[axis]));
            field.at_voxel(index).filter(|_| inside)
        };
        let depth = |at: [usize; 3]| field_at(at).unwrap_or(0.0);
        let mut at = self.at;
        loop {
            let window = IndexBox {
                first: at,
                last: at,
            }
            .widened([2; 3], region.size());
            let mut best = at;
            for k in window.first[2]..=window.last[2] {
                for j in window.first[1]..=window.last[1] {
                    for i in window.first[0]..=window.last[0] {
                        if depth([i, j, k]) > depth(best) {
                            best = [i, j, k];
                        }
                    }
                }
            }
            if best == at {
                break;
            }
            at = best;
        }
        // From the middle of the last voxel inside to the surface: half a step back from the first one outside.
        let half = 0.5 * self.scan.spacing_m[0].min(self.scan.spacing_m[1]);
        Ok((at, (depth(at) - half).max(half)))
    }

    /// What a ball reaches that does not fit into vessels, and whether that cut something off.
    fn without_vessels(
        &self,
        around: &Mask,
        top: [usize; 3],
        radius_m: f64,
        share: f64,
    ) -> (Mask, bool) {
        let coarsest = self.scan.spacing_m.iter().copied().fold(0.0, f64::max);
        let ball_m = share * radius_m;
        if ball_m < coarsest {
            return (around.clone(), false);
        }
        let open = component_at(&opened(around, ball_m, self.scan.spacing_m), top);
        // Rounding of the ball to voxels takes a layer off some corners.
        let mut mask = dilated(&open, 1.5 * self.scan.spacing_m[0], self.scan.spacing_m);
        mask.intersect(around);
        let mut rest = around.clone();
        rest.subtract(&mask);
        let cut = rest.count() > mask.count() / 50;
        (mask, cut)
    }

    fn is_no_ball(&self, mask: &Mask, radius_m: f64) -> bool {
        let ball_m3 = 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
        let volume_m3 = mask.count() as f64 * self.scan.voxel_m3();
        volume_m3 > MOST_BALLS * ball_m3 && volume_m3 > 1e-6
    }

    /// Whether it goes on beyond the box. The volume's own end is no leak.
    fn touches_border(&self, mask: &Mask) -> bool {
        let size = mask.size();
        let of = &self.local.bounds;
        mask.bounds().is_some_and(|bounds| {
            (0..3).any(|axis| {
                let first = bounds.first[axis] == 0 && of.first[axis] > 0;
                let end = of.last[axis] < self.of_size[axis] - 1;
                first || bounds.last[axis] == size[axis] - 1 && end
            })
        })
    }
}

fn ball(body: &Mask, at: [usize; 3], radius_m: f64, spacing_m: [f64; 3]) -> Mask {
    let mut point = Mask::empty(body.size());
    point.insert(at);
    let mut ball = dilated(&point, radius_m, spacing_m);
    ball.intersect(body);
    ball
}

/// The component that a voxel is of; nothing if it is of none.
fn component_at(mask: &Mask, at: [usize; 3]) -> Mask {
    let parts = Components::of(mask, Connectivity::Faces);
    let wanted = parts.part_at(at);
    parts.mask_of(|part| Some(part) == wanted)
}
