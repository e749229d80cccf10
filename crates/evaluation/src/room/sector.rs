//! The piece of space about the entry point in which people work.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use needlebench_scenario::people::PatientSides;

use super::grid::VoxelGrid;
use super::obstacles::PlacedObstacles;

/// Half of a ball on the outer side of the skin, in voxels, without what the surroundings fill.
#[derive(Debug, Clone)]
pub struct Sector {
    /// The voxels around it.
    pub grid: VoxelGrid,
    /// Middle of the ball: the entry point.
    pub center_m: Point3<f64>,
    /// Outer normal of the skin there.
    pub outwards: Vector3<f64>,
    /// Radius of the ball, m.
    pub radius_m: f64,
    /// By voxel: whether it counts.
    pub inside: Vec<bool>,
    /// By voxel: the region that it belongs to, an index into `regions`.
    region: Vec<u8>,
    regions: Vec<(&'static str, Vector3<f64>)>,
}

/// Name of the region over the entry point.
pub(super) const ABOVE: &str = "above";
/// Regions with fewer voxels say nothing.
const LEAST_VOXELS: usize = 100;

/// The hemisphere by itself.
struct HalfBall {
    center_m: Point3<f64>,
    outwards: Vector3<f64>,
    radius_m: f64,
}

impl HalfBall {
    /// Whether it holds what has an offset from its middle.
    fn contains(&self, offset: &Vector3<f64>) -> bool {
        offset.norm() <= self.radius_m && offset.dot(&self.outwards) > 0.0
    }

    /// Whether anything within a distance of a point may be in it.
    fn may_meet(&self, middle: &Point3<f64>, within_m: f64) -> bool {
        /// More than rounding, m.
        const ROUNDING_M: f64 = 1e-9;
        let offset = middle - self.center_m;
        let reach_m = within_m + ROUNDING_M;
        offset.norm() <= self.radius_m + reach_m && offset.dot(&self.outwards) > -reach_m
    }
}

impl Sector {
    /// The hemisphere, less the voxels whose centre is in the surroundings.
    ///
    /// Its regions share it out: a voxel belongs to the direction, of the patient's four level sides
    /// and up, that its offset from the entry point follows most. Without a patient there is but
    /// `above` and the rest.
    pub fn new(
        center_m: Point3<f64>,
        outwards: Vector3<f64>,
        radius_m: f64,
        voxel_m: f64,
        surroundings: &PlacedObstacles<'_>,
        sides: Option<&PatientSides>,
    ) -> Self {
        let grid = VoxelGrid::about(&center_m, radius_m, voxel_m);
        let half_ball = HalfBall {
            center_m,
            outwards,
            radius_m,
        };
        let filled = surroundings.taken_of(&grid, 0.0, &|middle, half_m| {
            half_ball.may_meet(middle, half_m)
        });
        let mut regions = vec![(ABOVE, Vector3::z())];
        if let Some(sides) = sides {
            regions.extend(
                sides
                    .iter()
                    .map(|(side, direction)| (side.name(), direction)),
            );
        }
        let mut inside = Vec::with_capacity(grid.len());
        let mut region = Vec::with_capacity(grid.len());
        for (index, filled) in filled.iter().enumerate() {
            let offset = grid.center_m(index) - center_m;
            inside.push(!filled && half_ball.contains(&offset));
            let along =
                |(_, (_, direction)): &(usize, &(&str, Vector3<f64>))| offset.dot(direction);
            let most = regions
                .iter()
                .enumerate()
                .max_by(|a, b| along(a).total_cmp(&along(b)))
                .filter(|found| along(found) >= -offset.z);
            region.push(most.map_or(u8::MAX, |(at, _)| u8::try_from(at).unwrap_or(u8::MAX)));
        }
        Self {
            grid,
            center_m,
            outwards,
            radius_m,
            inside,
            region,
            regions,
        }
    }

    /// By voxel that counts: whether solids are nearer than a margin.
    pub(super) fn taken_by(&self, robot: &PlacedObstacles<'_>, margin_m: f64) -> Vec<bool> {
        let half_ball = HalfBall {
            center_m: self.center_m,
            outwards: self.outwards,
            radius_m: self.radius_m,
        };
        robot.taken_of(&self.grid, margin_m, &|middle, half_m| {
            half_ball.may_meet(middle, half_m)
        })
    }

    /// Share of the voxels that count for which `wanted` holds; 0 if none counts.
    fn share(&self, taken: &[bool], wanted: impl Fn(usize) -> bool) -> (f64, usize) {
        let (mut all, mut free) = (0_usize, 0_usize);
        for index in (0..self.inside.len()).filter(|index| self.inside[*index] && wanted(*index)) {
            all += 1;
            free += usize::from(!taken[index]);
        }
        (free as f64 / all.max(1) as f64, all)
    }

    /// Share of the sector that is not taken.
    pub fn free_fraction(&self, taken: &[bool]) -> f64 {
        self.share(taken, |_| true).0
    }

    /// Share of each region that is not taken; regions that hardly are in the sector are left out.
    pub(crate) fn free_by_region(&self, taken: &[bool]) -> BTreeMap<&'static str, f64> {
        if self.regions.len() == 1 {
            return BTreeMap::new();
        }
        (self.regions.iter().enumerate())
            .filter_map(|(at, (name, _))| {
                let (free, all) = self.share(taken, |index| usize::from(self.region[index]) == at);
                (all >= LEAST_VOXELS).then_some((*name, free))
            })
            .collect()
    }

    /// Share that is not taken of the half towards `direction`; `None` if hardly any is there.
    pub(crate) fn free_towards(&self, taken: &[bool], direction: &Vector3<f64>) -> Option<f64> {
        let towards = |index| (self.grid.center_m(index) - self.center_m).dot(direction) > 0.0;
        let (free, all) = self.share(taken, towards);
        (all >= LEAST_VOXELS).then_some(free)
    }
}
