//! Lesions grown from a point inside.

use std::sync::atomic::AtomicBool;

use nalgebra::Point3;

use crate::components::{Components, Connectivity};
use crate::distance::{DistanceField, DistanceOptions};
use crate::error::{ImagingError, Remark};
use crate::mask::{IndexBox, Mask};
use crate::morphology::{closed, dilated, opened};
use crate::spacing::{orthogonal, whole};
use crate::volume::Volume;

use super::{Scan, Segmentation};

/// How far from its seed a lesion may reach.
const REACH_M: f64 = 35e-3;

/// A point that was clicked may be so far beside what is soft.
const BESIDE_M: f64 = 4e-3;

/// Its density is the median within this distance of the seed.
const CORE_M: f64 = 1.5e-3;

/// The wall of the lung is carried on across a lesion by a ball of this radius: a lesion of 20 mm that touches the
/// wall loses a cap of 2 mm at most.
const WALL_RADIUS_M: f64 = 25e-3;

/// A vessel is thinner than this share of the lesion, and is cut off where it leaves the lesion.
const VESSEL_SHARE: f64 = 0.6;

/// Share of lung around a seed from which on the lesion is one in the lung.
const LUNG_SHARE: f64 = 0.1;

/// Outside of the lung, a lesion that differs less from its surroundings cannot be told from them.
const LEAST_CONTRAST_HU: f64 = 40.0;

/// A lesion that holds more than so many balls of the largest one inside it has leaked.
const MOST_BALLS: f64 = 8.0;

/// Where a lesion is, pointed at by a person.
#[derive(Debug, Clone, PartialEq)]
pub struct LesionSeed {
    /// What it is called.
    pub name: String,
    /// A point inside, in `ct`, m.
    pub point_m: Point3<f64>,
}

/// A lesion.
#[derive(Debug, Clone)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "facts that do not depend on each other"
)]
pub struct Lesion {
    /// What it is called.
    pub name: String,
    /// The box that the mask covers.
    pub bounds: IndexBox,
    /// Its voxels.
    pub mask: Mask,
    /// Whether it is in the lung.
    pub in_lung: bool,
    /// Its median, HU.
    pub median_hu: i16,
    /// Where its surface is: the middle between it and what is around it. Half-integer.
    pub level_hu: f64,
    /// Radius of the largest ball inside it, to half a voxel, m.
    pub inscribed_radius_m: f64,
    /// Whether it was cut where it meets the wall of the lung.
    pub cut_at_wall: bool,
    /// Whether it was cut where vessels leave it.
    pub cut_at_vessels: bool,
    /// Whether it ran into what is around it and was bounded by a ball: its size is not known then.
    pub leaked: bool,
}

/// Grows a lesion from a point inside.
///
/// # Errors
/// If the point is outside the body or in air, or nothing sets the lesion apart from what is around it.
pub(crate) fn grow_lesion(
    volume: &Volume,
    found: &Segmentation,
    seed: &LesionSeed,
    cancel: &AtomicBool,
    remarks: &mut Vec<Remark>,
) -> Result<Lesion, ImagingError> {
    let scan = Scan {
        volume,
        spacing_m: orthogonal(&volume.grid)?,
        levels: super::Levels::default(),
        cancel,
    };
    let grower = Grower::new(&scan, found, seed).map_err(|error| error.at(place(seed)))?;
    grower.grow(remarks).map_err(|error| error.at(place(seed)))
}

fn place(seed: &LesionSeed) -> String {
    let mm = seed.point_m * 1e3;
    format!(
        "lesion `{}` at [{:.1}, {:.1}, {:.1}] mm",
        seed.name, mm.x, mm.y, mm.z
    )
}

struct Grower<'a> {
    scan: &'a Scan<'a>,
    seed: &'a LesionSeed,
    /// Of the seed, within the box.
    at: [usize; 3],
    bounds: IndexBox,
    body: Mask,
    /// Lungs with what they enclose.
    lungs: Vec<Mask>,
    lung_hu: Option<i16>,
    median_hu: i16,
}

impl<'a> Grower<'a> {
    fn new(
        scan: &'a Scan<'a>,
        found: &Segmentation,
        seed: &'a LesionSeed,
    ) -> Result<Self, ImagingError> {
        let index = scan.volume.grid.index_from_ct(&seed.point_m);
        let size = scan.size();
        let inside = |axis: usize| (-0.5..size[axis] as f64 - 0.5).contains(&index[axis]);
        if !(0..3).all(inside) {
            return Err(ImagingError::refused("the point is outside the volume")
                .hint("points are in millimetres, in the patient's LPS frame"));
        }
        let voxel = [0, 1, 2].map(|axis| whole(index[axis].round()).min(size[axis] - 1));
        if !found.body.mask.get(voxel) {
            return Err(ImagingError::refused("the point is outside the body")
                .hint("points are in millimetres, in the patient's LPS frame"));
        }
        let reach = [0, 1, 2].map(|axis| scan.voxels_across(REACH_M, axis) + 1);
        let bounds = IndexBox {
            first: voxel,
            last: voxel,
        }
        .widened(reach, size);
        let lungs = found.lungs.lungs.iter().map(|lung| {
            let mut whole = Mask::empty(size);
            whole.unite_within(&found.lungs.bounds, &lung.mask);
            whole.cropped(&bounds)
        });
        let mut grower = Self {
            scan,
            seed,
            at: [0, 1, 2].map(|axis| voxel[axis] - bounds.first[axis]),
            body: found.body.mask.cropped(&bounds),
            lungs: lungs.filter(|lung| !lung.is_empty()).collect(),
            lung_hu: found.lungs.air_hu,
            bounds,
            median_hu: 0,
        };
        grower.move_to_soft()?;
        let core = grower.ball(CORE_M);
        grower.median_hu = scan.median(&core, &bounds).unwrap_or_default();
        Ok(grower)
    }

    fn hu(&self, at: [usize; 3]) -> i16 {
        self.scan
            .hu([0, 1, 2].map(|axis| at[axis] + self.bounds.first[axis]))
    }

    /// Voxels of the body within a distance of the seed.
    fn ball(&self, radius_m: f64) -> Mask {
        let mut point = Mask::empty(self.body.size());
        point.insert(self.at);
        let mut ball = dilated(&point, radius_m, self.scan.spacing_m);
        ball.intersect(&self.body);
        ball
    }

    /// To the nearest voxel that is not air.
    fn move_to_soft(&mut self) -> Result<(), ImagingError> {
        let distance = |to: [usize; 3]| -> f64 {
            (0..3)
                .map(|axis| {
                    (to[axis].abs_diff(self.at[axis]) as f64 * self.scan.spacing_m[axis]).powi(2)
                })
                .sum()
        };
        let near = self.ball(BESIDE_M);
        let soft = near
            .voxels()
            .filter(|&at| f64::from(self.hu(at)) > super::LUNG_LEVEL_HU)
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        match soft {
            Some(at) => {
                self.at = at;
                Ok(())
            }
            None => Err(ImagingError::refused(format!(
                "the point is in air, {} HU, with nothing denser within {:.0} mm",
                self.hu(self.at),
                1e3 * BESIDE_M
            ))
            .hint("set the point at the centre of the lesion")),
        }
    }

    fn grow(mut self, remarks: &mut Vec<Remark>) -> Result<Lesion, ImagingError> {
        self.scan.check()?;
        let hull = self.lung_hull();
        let in_lung = hull.is_some();
        let level_hu = self.level(in_lung)?;
        let mut region = self
            .scan
            .within(&self.body, &self.bounds, |hu| f64::from(hu) > level_hu);
        let unbounded = region.clone();
        let mut cut_at_wall = false;
        if let Some(hull) = hull {
            region.intersect(&hull);
        }
        let around = component_at(&region, self.at);
        let (top, radius_m) = self.deepest(&around)?;
        let (mut mask, cut_at_vessels) = self.without_vessels(&around, top, radius_m);
        let layer_m = 1.5 * self.scan.spacing_m[0].max(self.scan.spacing_m[1]);
        if in_lung {
            let mut beyond = dilated(&mask, layer_m, self.scan.spacing_m);
            beyond.intersect(&unbounded);
            beyond.subtract(&region);
            cut_at_wall = !beyond.is_empty();
        }
        let leaked = self.has_leaked(&mask, radius_m);
        if leaked {
            self.at = top;
            mask.intersect(&self.ball(2.0 * radius_m));
            mask = component_at(&mask, top);
            remarks.push(
                Remark::new(format!(
                    "it merges with its surroundings at {level_hu} HU: limited to a sphere of \
                     {:.0} mm; its size is unknown",
                    4e3 * radius_m
                ))
                .at(place(self.seed)),
            );
        }
        Ok(Lesion {
            name: self.seed.name.clone(),
            bounds: self.bounds,
            mask,
            in_lung,
            median_hu: self.median_hu,
            level_hu,
            inscribed_radius_m: radius_m,
            cut_at_wall,
            cut_at_vessels,
            leaked,
        })
    }

    /// The lung that the seed is in, with its wall carried on across what grows into it; none if it is in none.
    fn lung_hull(&self) -> Option<Mask> {
        let voxels: usize = self.lungs.iter().map(Mask::count).sum();
        if (voxels as f64) < LUNG_SHARE * self.body.count() as f64 {
            return None;
        }
        // One by one: together they would enclose what is between them.
        self.lungs
            .iter()
            .map(|lung| closed(lung, WALL_RADIUS_M, self.scan.spacing_m))
            .find(|hull| hull.get(self.at))
    }

    /// Middle between the lesion and what is around it.
    fn level(&self, in_lung: bool) -> Result<f64, ImagingError> {
        let around_hu = if let Some(lung_hu) = self.lung_hu.filter(|_| in_lung) {
            lung_hu
        } else {
            let mut shell = self.ball(0.6 * REACH_M);
            shell.subtract(&self.ball(0.4 * REACH_M));
            self.scan
                .median(&shell, &self.bounds)
                .unwrap_or(self.median_hu)
        };
        let contrast = f64::from(self.median_hu) - f64::from(around_hu);
        if contrast < LEAST_CONTRAST_HU {
            return Err(ImagingError::refused(format!(
                "at {} HU it cannot be separated from its surroundings at {around_hu} HU",
                self.median_hu
            ))
            .hint("use a label map for its outline"));
        }
        Ok((f64::from(around_hu) + 0.5 * contrast).floor() + 0.5)
    }

    /// Uphill in the distance to the surface, from the seed: the middle of the largest ball there, and its radius.
    fn deepest(&self, region: &Mask) -> Result<([usize; 3], f64), ImagingError> {
        let grid = &self.scan.volume.grid;
        let mut outside = Mask::empty(self.scan.size());
        outside.unite_within(&self.bounds, &region.complement());
        let options = DistanceOptions {
            cap_m: REACH_M,
            threads: 1,
            cancel: self.scan.cancel,
        };
        let field = DistanceField::new(grid, &outside, self.bounds, &options)?;
        let depth = |at: [usize; 3]| {
            let voxel = [0, 1, 2].map(|axis| at[axis] + self.bounds.first[axis]);
            field.at_voxel(voxel).unwrap_or(0.0)
        };
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
    fn without_vessels(&self, around: &Mask, top: [usize; 3], radius_m: f64) -> (Mask, bool) {
        let coarsest = self.scan.spacing_m.iter().copied().fold(0.0, f64::max);
        let ball_m = VESSEL_SHARE * radius_m;
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

    fn has_leaked(&self, mask: &Mask, radius_m: f64) -> bool {
        let ball_m3 = 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
        let volume_m3 = mask.count() as f64 * self.scan.voxel_m3();
        let size = mask.size();
        let at_border = mask.bounds().is_some_and(|bounds| {
            (0..3).any(|axis| {
                // The volume's own end is no leak.
                let first = bounds.first[axis] == 0 && self.bounds.first[axis] > 0;
                let end = self.bounds.last[axis] < self.scan.size()[axis] - 1;
                first || bounds.last[axis] == size[axis] - 1 && end
            })
        });
        at_border || volume_m3 > MOST_BALLS * ball_m3 && volume_m3 > 1e-6
    }
}

/// The component that a voxel is of; nothing if it is of none.
fn component_at(mask: &Mask, at: [usize; 3]) -> Mask {
    let parts = Components::of(mask, Connectivity::Faces);
    let wanted = parts.part_at(at);
    parts.mask_of(|part| Some(part) == wanted)
}
