//! Rays through the voxels: what they pass, and what they come near to.

use std::sync::Arc;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_imaging::DistanceField;
use needlebench_phantom::{LayersError, PassedLayer, Phantom};

use super::blocks::{BLOCK, BodySide};
use super::classes::{Kind, Mark};
use super::normal::mean_normal;
use super::{CAP_M, VoxelAnatomy, steps};
use crate::anatomy::{
    Anatomy, Exit, LungPassage, Nearest, Obstacle, Ray, angle_rad, is_marker_near,
};

/// Places on a ray that are nearer than this are not told apart, m: half of it is taken off what is found.
const STEP_M: f64 = 0.25e-3;

/// Distance of places on a ray that are looked at in any case, m.
const COARSE_M: f64 = 4e-3;

/// Places on a ray that are looked at in any case, at most: on what is longer than all needles they are farther apart.
const MOST_PLACES: usize = 128;

/// More than a stretch between two such places can be halved before its parts are not told apart.
const MOST_HALVES: usize = 32;

/// Nearest that an entry may be to the first or last slice, m: the skin beyond is not known (assumed).
const END_M: f64 = 5e-3;

/// Of two places with their distances the nearer one.
fn nearer(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    if b.1 < a.1 { b } else { a }
}

/// A ray in indices.
struct Line {
    start: Point3<f64>,
    per_m: Vector3<f64>,
}

impl Line {
    fn at(&self, along_m: f64) -> Point3<f64> {
        self.start + along_m * self.per_m
    }
}

/// The way of a line through a box of cells with unit sides, the first of which begins at the origin.
struct Steps {
    start: [f64; 3],
    per_m: [f64; 3],
    cells: [usize; 3],
}

impl Steps {
    /// Calls with each cell on a stretch, from nearer to farther, and where the line enters and leaves it, m, until it is
    /// told to stop or the box ends; whether it came to the end of the stretch.
    fn walk(
        &self,
        [from_m, to_m]: [f64; 2],
        mut visit: impl FnMut([usize; 3], [f64; 2]) -> bool,
    ) -> bool {
        let mut cell = [0_usize; 3];
        let mut next_m = [f64::INFINITY; 3];
        let mut pace_m = [f64::INFINITY; 3];
        for axis in 0..3 {
            let at = self.start[axis] + from_m * self.per_m[axis];
            let low = at.floor();
            if !(0.0..self.cells[axis] as f64).contains(&low) {
                return false;
            }
            cell[axis] = steps(low);
            let rate = self.per_m[axis];
            if rate.abs() > 1e-12 {
                let edge = if rate > 0.0 { low + 1.0 } else { low };
                next_m[axis] = from_m + (edge - at) / rate;
                pace_m[axis] = 1.0 / rate.abs();
            }
        }
        let mut here_m = from_m;
        loop {
            let sooner = usize::from(next_m[1] < next_m[0]);
            let axis = if next_m[2] < next_m[sooner] {
                2
            } else {
                sooner
            };
            let leaves_m = next_m[axis].min(to_m);
            if !visit(cell, [here_m, leaves_m]) || leaves_m >= to_m {
                return true;
            }
            here_m = leaves_m;
            next_m[axis] += pace_m[axis];
            if self.per_m[axis] > 0.0 {
                if cell[axis] + 1 == self.cells[axis] {
                    return false;
                }
                cell[axis] += 1;
            } else {
                if cell[axis] == 0 {
                    return false;
                }
                cell[axis] -= 1;
            }
        }
    }

    /// Where the line leaves the box, m.
    fn end_m(&self) -> f64 {
        let ends = (0..3).map(|axis| {
            let rate = self.per_m[axis];
            let edge = if rate > 0.0 {
                self.cells[axis] as f64
            } else {
                0.0
            };
            if rate.abs() > 1e-12 {
                (edge - self.start[axis]) / rate
            } else {
                f64::INFINITY
            }
        });
        ends.fold(f64::INFINITY, f64::min)
    }
}

impl VoxelAnatomy {
    /// A ray as voxels see it.
    fn line(&self, ray: &Ray) -> Line {
        let start = self.index_of(&ray.target);
        Line {
            start,
            per_m: self.index_of(&ray.at(1.0)) - start,
        }
    }

    /// Calls with each voxel on a stretch of a ray, from nearer to farther, and where the ray enters and leaves it, m,
    /// until it is told to stop or what is looked at ends; whether it came to the end of the stretch.
    fn walk(
        &self,
        ray: &Ray,
        from_to_m: [f64; 2],
        mut visit: impl FnMut(u8, [f64; 2]) -> bool,
    ) -> bool {
        let steps = self.steps(ray, self.within.size(), 1.0);
        steps.walk(from_to_m, |voxel, at_m| {
            visit(self.class_within(voxel), at_m)
        })
    }

    /// Class of a voxel by its place in the box.
    fn class_within(&self, [i, j, k]: [usize; 3]) -> u8 {
        let [nx, ny, _] = self.within.size();
        self.voxels[(k * ny + j) * nx + i]
    }

    /// The way of a ray through cells of so many voxels a side.
    fn steps(&self, ray: &Ray, cells: [usize; 3], side: f64) -> Steps {
        let line = self.line(ray);
        let first = self.within.first.map(|index| index as f64);
        Steps {
            start: [0, 1, 2].map(|axis| (line.start[axis] - first[axis] + 0.5) / side),
            per_m: [0, 1, 2].map(|axis| line.per_m[axis] / side),
            cells,
        }
    }

    /// The first voxel on a stretch of a ray that is of the body, or is not: where the ray enters it, m, and its index.
    fn first_on(
        &self,
        ray: &Ray,
        from_to_m: [f64; 2],
        side: BodySide,
    ) -> Option<(f64, [usize; 3])> {
        let voxels = self.steps(ray, self.within.size(), 1.0);
        let mut found = None;
        let blocks = self.steps(ray, self.blocks.size, BLOCK as f64);
        blocks.walk(from_to_m, |block, stretch_m| {
            if self.blocks.has(block, side) {
                voxels.walk(stretch_m, |voxel, [enters_m, _]| {
                    if self.blocks.is(self.class_within(voxel), side) {
                        found = Some((enters_m, voxel));
                    }
                    found.is_none()
                });
            }
            found.is_none()
        });
        let first = self.within.first;
        found.map(|(enters_m, voxel)| (enters_m, [0, 1, 2].map(|axis| first[axis] + voxel[axis])))
    }

    /// See [`mean_normal`].
    fn normal_near(&self, at: &Point3<f64>, is_inside: impl Fn(Kind) -> bool) -> UnitVector3<f64> {
        let kinds = self.classes.all().map(|class| is_inside(class.kind));
        let inside: Vec<bool> = kinds.collect();
        mean_normal(
            &self.grid,
            &self.within,
            &self.voxels,
            &self.index_of(at),
            |class| inside[usize::from(class)],
        )
    }

    /// Least value of a field along a stretch, and where: a lower bound.
    ///
    /// No distance changes by more than the way. Between two places so far apart as `l` none is therefore less than half of
    /// what their distances have together beyond `l`; where that could be less than what is known, it is looked at in
    /// the middle, down to [`STEP_M`], half of which is taken off.
    fn least_along(
        &self,
        field: &DistanceField,
        ray: &Ray,
        [from_m, to_m]: [f64; 2],
    ) -> (f64, f64) {
        let line = self.line(ray);
        let first = Vector3::from(self.within.first.map(|index| index as f64));
        let at = |along_m: f64| {
            (
                along_m,
                field.at_least_of_index(&(line.at(along_m) - first)),
            )
        };
        let told =
            |(along_m, least_m): (f64, f64)| (least_m - 0.5 * STEP_M - self.mask_error_m, along_m);
        let count = steps(((to_m - from_m) / COARSE_M).ceil()).clamp(1, MOST_PLACES - 1);
        let mut known = [(0.0, 0.0); MOST_PLACES];
        let places = &mut known[..=count];
        let mut least = (from_m, f64::INFINITY);
        for (index, place) in places.iter_mut().enumerate() {
            *place = at(from_m + (to_m - from_m) * index as f64 / count as f64);
            least = nearer(least, *place);
            // Nothing is nearer than what is passed through.
            if least.1 <= 0.0 {
                return told(least);
            }
        }
        // Halves that are left to look at, the first ones last: each is half as long as the one before.
        let mut left = [[(0.0, 0.0); 2]; MOST_HALVES];
        for two in places.windows(2).rev() {
            left[0] = [two[0], two[1]];
            let mut waiting = 1;
            while waiting > 0 {
                waiting -= 1;
                let [a, b] = left[waiting];
                let apart_m = b.0 - a.0;
                if apart_m <= STEP_M || 0.5 * (a.1 + b.1 - apart_m) >= least.1 {
                    continue;
                }
                let middle = at(0.5 * (a.0 + b.0));
                least = nearer(least, middle);
                if least.1 <= 0.0 {
                    return told(least);
                }
                let halves = [[a, middle], [middle, b]];
                let nearer_first = usize::from(a.1 < b.1);
                left[waiting] = halves[nearer_first];
                left[waiting + 1] = halves[1 - nearer_first];
                waiting += 2;
            }
        }
        told(least)
    }

    /// Name of the structure of an obstacle that is nearest to a place.
    fn name_near(&self, at: &Point3<f64>, obstacle: Obstacle, within_m: f64) -> String {
        let index = self.index_of(at);
        let range = |axis: usize| {
            let reach = within_m / self.spacing_m[axis] + 1.0;
            let [first, last] = [self.within.first[axis], self.within.last[axis]];
            steps(index[axis] - reach).max(first)..=steps(index[axis] + reach).min(last)
        };
        let mut nearest: Option<(f64, u8)> = None;
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    let class = self.voxels[self.offset([i, j, k])];
                    if !self.classes.get(class).is(obstacle, self.target_lung) {
                        continue;
                    }
                    let place = [i, j, k].map(|index| index as f64);
                    let way: Vec<f64> = (0..3)
                        .map(|axis| (place[axis] - index[axis]) * self.spacing_m[axis])
                        .collect();
                    let way_m = Vector3::from_column_slice(&way).norm();
                    if nearest.is_none_or(|(best_m, _)| way_m < best_m) {
                        nearest = Some((way_m, class));
                    }
                }
            }
        }
        match nearest {
            Some((way_m, class)) if way_m <= within_m + self.diagonal_m() => {
                self.classes.get(class).name.clone()
            }
            // Nothing that has a label: what is modelled below ribs.
            _ => "intercostal vessels below a rib (modelled)".to_owned(),
        }
    }
}

impl Anatomy for VoxelAnatomy {
    fn kind(&self) -> &'static str {
        "voxels"
    }

    fn target(&self) -> Point3<f64> {
        self.target
    }

    fn exit(&self, ray: &Ray) -> Exit {
        let Some((skin_m, voxel)) = self.first_on(ray, [0.0, self.reach_m], BodySide::Outside)
        else {
            // It ends within the body: far beyond the needle, or where the scan does.
            let end_m = self.steps(ray, self.within.size(), 1.0).end_m();
            return Exit::End(end_m.min(self.reach_m));
        };
        let last = self.grid.size()[2] - 1;
        let from_end = voxel[2].min(last - voxel[2]) as f64 * self.spacing_m[2];
        let is_seen = |patient: &Arc<Phantom>| patient.is_skin_seen(&ray.at(skin_m));
        if from_end < END_M || !self.patient.as_ref().is_none_or(is_seen) {
            Exit::End(skin_m)
        } else {
            Exit::Skin(skin_m)
        }
    }

    fn is_body_between(&self, ray: &Ray, [from_m, to_m]: [f64; 2]) -> bool {
        if is_marker_near(&self.markers, ray, [from_m, to_m]) {
            return true;
        }
        // Past the voxel that the skin cuts.
        let past_m = from_m + self.diagonal_m();
        let stretch_m = [past_m, to_m.max(past_m)];
        // What touches the skin begins right there.
        let beside = self.first_on(ray, [from_m, to_m], BodySide::Beside);
        beside.is_some() || self.first_on(ray, stretch_m, BodySide::Body).is_some()
    }

    fn knows(&self, obstacle: Obstacle) -> bool {
        self.knows[obstacle as usize]
    }

    fn distance_m(&self, ray: &Ray, from_to_m: [f64; 2], obstacle: Obstacle) -> f64 {
        self.fields[obstacle as usize]
            .as_ref()
            .map_or(f64::INFINITY, |field| {
                self.least_along(field, ray, from_to_m).0
            })
    }

    fn nearest(&self, ray: &Ray, from_to_m: [f64; 2], obstacle: Obstacle) -> Option<Nearest> {
        let field = self.fields[obstacle as usize].as_ref()?;
        let (distance_m, where_m) = self.least_along(field, ray, from_to_m);
        let radius_m = distance_m.max(0.0) + self.mask_error_m + self.diagonal_m();
        (radius_m < CAP_M).then(|| Nearest {
            name: self.name_near(&ray.at(where_m), obstacle, radius_m),
            distance_m,
        })
    }

    fn skin_normal(&self, ray: &Ray, depth_m: f64) -> UnitVector3<f64> {
        self.normal_near(&ray.at(depth_m), |kind| {
            !matches!(kind, Kind::Outside | Kind::Beside)
        })
    }

    fn lungs(&self, ray: &Ray, from_to_m: [f64; 2]) -> LungPassage {
        let mut passage = LungPassage::default();
        // From the target outwards: what was passed last is what the needle enters from.
        let mut inside = self.target_lung;
        let mut lobe: Option<u8> = None;
        let mut entered_m = None;
        self.walk(ray, from_to_m, |class, [enters_m, leaves_m]| {
            let found = self.classes.get(class);
            let now = match found.kind {
                Kind::Lung(lung) => Some(lung),
                Kind::Lesion | Kind::InLung => inside,
                _ => None,
            };
            if let (Some(lung), false) = (inside, now == inside) {
                passage.entries += 1;
                entered_m = Some((enters_m, lung));
                lobe = None;
            }
            if now.is_some() {
                passage.within_m += leaves_m - enters_m;
            }
            if matches!(found.kind, Kind::Lung(_)) {
                if let Some(before) = lobe
                    && before != class
                {
                    let [a, b] = [before, class].map(|each| self.classes.get(each).name.clone());
                    passage.fissures.push(format!("{a} to {b}"));
                }
                lobe = Some(class);
            }
            if found.mark == Mark::Bulla && passage.bullae.last() != Some(&found.name) {
                passage.bullae.push(found.name.clone());
            }
            if found.mark == Mark::Fissure && passage.fissures.last() != Some(&found.name) {
                passage.fissures.push(found.name.clone());
            }
            inside = now;
            true
        });
        passage.pleura_angle_rad = entered_m.map(|(along_m, lung)| {
            let normal = self.normal_near(&ray.at(along_m), |kind| match kind {
                Kind::Lung(each) => each == lung,
                Kind::InLung | Kind::Lesion => true,
                _ => false,
            });
            angle_rad(&ray.outwards, &normal)
        });
        passage
    }

    fn layers(&self, ray: &Ray, from_to_m: [f64; 2]) -> Result<Vec<PassedLayer>, LayersError> {
        let (mut inwards, mut bone) = (Vec::new(), None);
        self.walk(ray, from_to_m, |class, [enters_m, leaves_m]| {
            let tissue = self.passed[usize::from(class)];
            inwards.extend(tissue.map(|tissue| PassedLayer {
                tissue,
                length_m: leaves_m - enters_m,
            }));
            bone = tissue.is_none().then(|| &self.classes.get(class).name);
            bone.is_none()
        });
        match bone {
            Some(name) => Err(LayersError::Bone(name.clone())),
            None => Ok(PassedLayer::layers(
                inwards.into_iter().rev(),
                self.is_fat_known,
            )),
        }
    }

    fn leaves_lung_m(&self, ray: &Ray, within_m: f64) -> Option<f64> {
        let lung = self.target_lung?;
        let back = Ray {
            outwards: -ray.outwards,
            ..*ray
        };
        let mut left_m = None;
        self.walk(&back, [0.0, within_m], |class, [enters_m, _]| {
            let stays = match self.classes.get(class).kind {
                Kind::Lung(each) => each == lung,
                Kind::Lesion | Kind::InLung => true,
                _ => false,
            };
            if !stays {
                left_m = Some(enters_m);
            }
            stays
        });
        left_m
    }

    fn touches_pleura(&self) -> Option<bool> {
        self.touches_pleura
    }
}
