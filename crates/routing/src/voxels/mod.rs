//! Voxels of a label map as anatomy.

mod classes;
mod mediastinum;

use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_cell::scenario::NeedleRouteSection;
use needlebench_imaging::{
    Components, Connectivity, DistanceField, DistanceOptions, ImagingError, IndexBox, LabelMap,
    Mask, Remark, VoxelGrid, opened, structure_of,
};

use crate::anatomy::{
    Anatomy, Exit, LungPassage, Nearest, Obstacle, Ray, angle_rad, is_marker_near,
};
use classes::{Class, Classes, Kind, Mark};
use mediastinum::Mediastinum;

/// Distances beyond this are told as this, m: no margin asks for more.
const CAP_M: f64 = 20e-3;

/// Places on a ray that are nearer than this are not told apart, m: half of it is taken off what is found.
const STEP_M: f64 = 0.25e-3;

/// Distance of places on a ray that are looked at in any case, m.
const COARSE_M: f64 = 4e-3;

/// Radius about a place of a surface within which its normal is found, m.
const NORMAL_RADIUS_M: f64 = 6e-3;

/// Nearest that an entry may be to the first or last slice, m: the skin beyond is not known (assumed).
const END_M: f64 = 5e-3;

/// Least pocket of gas that is bowel or airway, m^3: half a millilitre (assumed). Noise under the skin makes smaller ones.
const GAS_M3: f64 = 0.5e-6;

/// Share of a lesion's surface that has to be against lung for the lesion to be in it: one at the wall has half of it.
const IN_LUNG: f64 = 0.3;

/// Share of a lesion's surface against anything but lung from which on it touches the pleura: partial volume makes less.
const TOUCHES: f64 = 0.02;

/// Structures that a needle to the lung may meet, by their names in label maps, whose absence is said.
const IN_THE_WAY: [&str; 5] = ["heart", "aorta", "liver", "spleen", "stomach"];

/// Words of what needles may go through.
const SOFT: [&str; 8] = [
    "soft",
    "muscle",
    "fat",
    "autochthon",
    "iliopsoas",
    "gluteus",
    "tissue",
    "breast",
];

/// Of two places with their distances the nearer one.
fn nearer(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    if b.1 < a.1 { b } else { a }
}

fn is_soft(name: &str) -> bool {
    let lower = name.to_lowercase();
    SOFT.iter().any(|word| lower.contains(word))
}

/// What is asked of the voxels.
#[derive(Debug, Clone, Copy)]
pub struct VoxelOptions<'a> {
    /// Labels that are lesions, by name.
    pub lesions: &'a [String],
    /// What the needle may pass through, by name: `bone`, `vessel` or `organ`, or a structure.
    pub off: &'a [String],
    /// How far the needle reaches from its target to the skin, m.
    pub needle_m: f64,
    /// Markers on the skin: middle in `ct` and radius, m.
    pub markers: &'a [(Point3<f64>, f64)],
    /// From the skin to the far end of the guide, m.
    pub outside_m: f64,
    /// Least thickness of vessels within a lung that count, m.
    pub lung_vessel_m: f64,
    /// What below each bone counts as intercostal vessels, m.
    pub below_rib_m: f64,
    /// Threads to use; nothing depends on it.
    pub threads: usize,
    /// Set by another thread to give up.
    pub cancel: &'a AtomicBool,
}

/// A label map around a target.
///
/// Distances are to the space that voxels of a structure fill, less half a voxel in the slice, by which a mask may be
/// wrong: lower bounds, by exact fields at the voxels' centres and what these allow in between.
#[derive(Debug)]
pub struct VoxelAnatomy {
    grid: VoxelGrid,
    spacing_m: [f64; 3],
    /// From frame `phantom` to `ct`.
    origin_in_ct_m: Vector3<f64>,
    /// What is looked at of the grid.
    within: IndexBox,
    /// One class for each of its voxels.
    voxels: Vec<u8>,
    classes: Classes,
    /// In the order of [`Obstacle::ALL`]; none where there is nothing.
    fields: [Option<DistanceField>; 3],
    target: Point3<f64>,
    target_lung: Option<u8>,
    touches_pleura: Option<bool>,
    mask_error_m: f64,
    /// Middle, frame `phantom`, and radius, m.
    markers: Vec<(Point3<f64>, f64)>,
    /// How far from the target the skin is looked for, m.
    reach_m: f64,
    /// Obstacles of which the label map has anything.
    knows: [bool; 3],
    remarks: Vec<Remark>,
}

impl VoxelAnatomy {
    /// About a target in frame `phantom`, whose origin is at `origin_in_ct_m` in `ct`; its axes are those of `ct`, and the
    /// grid's run along them.
    ///
    /// # Errors
    /// Voxels that are not orthogonal, a target outside them or outside the body, interrupted.
    pub fn new(
        labels: &LabelMap,
        origin_in_ct_m: Vector3<f64>,
        target: Point3<f64>,
        options: &VoxelOptions<'_>,
    ) -> Result<Self, ImagingError> {
        let grid = &labels.grid;
        let spacing_m = grid.spacing_m();
        let at = grid.index_from_ct(&(target + origin_in_ct_m));
        let centre = voxel_at(&at, grid.size()).ok_or_else(|| {
            ImagingError::refused("the target is outside the scan")
                .hint("places are in mm of the scan (left, posterior, superior)")
        })?;
        let reach_m = options.needle_m + options.outside_m;
        let reach = [0, 1, 2].map(|axis| steps(reach_m / spacing_m[axis]) + 2);
        let within = IndexBox {
            first: centre,
            last: centre,
        }
        .widened(reach, grid.size());
        let classes = Classes::of(labels, options.lesions, options.off);
        let voxels = boxed(&labels.labels, grid.size(), &within, |label| {
            classes.of_label(label)
        });
        let mut anatomy = Self {
            grid: grid.clone(),
            spacing_m,
            origin_in_ct_m,
            within,
            voxels,
            classes,
            fields: [None, None, None],
            target,
            target_lung: None,
            touches_pleura: None,
            mask_error_m: 0.5 * spacing_m[0].min(spacing_m[1]),
            markers: options
                .markers
                .iter()
                .map(|(middle, radius_m)| (middle - origin_in_ct_m, *radius_m))
                .collect(),
            reach_m,
            knows: [false; 3],
            remarks: Vec::new(),
        };
        if anatomy.kind_at(centre) == Kind::Outside {
            return Err(ImagingError::refused("the target is outside the body")
                .hint("places are in mm of the scan (left, posterior, superior)"));
        }
        anatomy.look_over(labels);
        anatomy.find_lung(centre);
        anatomy.mark_mediastinum(labels, centre, options.off);
        if anatomy.target_lung.is_none() {
            anatomy.remarks.push(Remark::new(
                "the target is in no lung: needles keep clear of both lungs",
            ));
        }
        anatomy.make_fields(options)?;
        Ok(anatomy)
    }

    /// What is worth knowing of how the labels were taken.
    pub fn remarks(&self) -> &[Remark] {
        &self.remarks
    }

    /// Name of the lung that the target is in.
    pub fn target_lung(&self) -> Option<&str> {
        self.target_lung.map(|lung| self.classes.lung_name(lung))
    }

    fn offset(&self, [i, j, k]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.within.size();
        let [i0, j0, k0] = self.within.first;
        ((k - k0) * ny + (j - j0)) * nx + (i - i0)
    }

    fn class_at(&self, voxel: [usize; 3]) -> &Class {
        self.classes.get(self.voxels[self.offset(voxel)])
    }

    fn kind_at(&self, voxel: [usize; 3]) -> Kind {
        self.class_at(voxel).kind
    }

    /// Which lung the target is in: its voxel's, or the one that is around its lesion.
    fn find_lung(&mut self, centre: [usize; 3]) {
        let class = self.voxels[self.offset(centre)];
        match self.classes.get(class).kind {
            Kind::Lung(lung) => {
                self.target_lung = Some(lung);
                self.touches_pleura = Some(false);
            }
            Kind::Lesion => {
                let (mut faces, mut soft, mut lungs) = (0_usize, 0_usize, [0_usize; 256]);
                for voxel in self.all_of(class) {
                    for next in self.neighbours(voxel) {
                        match self.kind_at(next) {
                            Kind::Lesion => continue,
                            Kind::Lung(lung) => lungs[usize::from(lung)] += 1,
                            Kind::InLung => {}
                            _ => soft += 1,
                        }
                        faces += 1;
                    }
                }
                let most = (0..=u8::MAX).max_by_key(|&lung| (lungs[usize::from(lung)], lung));
                let share = |count: usize| count as f64 / faces.max(1) as f64;
                self.target_lung = most.filter(|&lung| share(lungs[usize::from(lung)]) >= IN_LUNG);
                self.touches_pleura = self.target_lung.map(|_| share(soft) > TOUCHES);
            }
            _ => {}
        }
    }

    /// What the label map has, and what it has not and a user has to know of.
    fn look_over(&mut self, labels: &LabelMap) {
        let mut seen = vec![false; 1 << 16];
        for &label in &labels.labels {
            seen[usize::from(label)] = true;
        }
        let mut unknown = Vec::new();
        let mut missing = IN_THE_WAY.to_vec();
        for (label, name) in &labels.names {
            if !seen[usize::from(*label)] {
                continue;
            }
            let class = self.classes.get(self.classes.of_label(*label));
            for obstacle in Obstacle::ALL {
                self.knows[obstacle as usize] |= class.is(obstacle, None);
            }
            let structure = structure_of(name);
            if class.kind == Kind::Soft && structure.is_none() && !is_soft(name) {
                unknown.push(format!("`{name}`"));
            }
            missing.retain(|each| structure.as_ref().is_none_or(|it| it.name != *each));
        }
        if !unknown.is_empty() {
            self.remarks.push(Remark::new(format!(
                "taken for soft tissue, through which needles may go, since nothing is known of structures of these names: {}",
                unknown.join(", ")
            )));
        }
        if !missing.is_empty() {
            self.remarks.push(Remark::new(format!(
                "the label map has no {}: nothing keeps needles out of these but the space between the lungs, where both \
                 lungs are labelled; give a label map that has them (`ct build --labels`)",
                missing.join(", ")
            )));
        }
        if !self.knows[Obstacle::Bone as usize] {
            self.remarks.push(Remark::new(
                "the label map has no bone: nothing is known of distances from it",
            ));
        }
    }

    /// Makes an organ of the soft tissue between the lungs: heart and large vessels, seen or not. A target that is in it
    /// has to be reached through it.
    fn mark_mediastinum(&mut self, labels: &LabelMap, centre: [usize; 3], off: &[String]) {
        const NAME: &str = NeedleRouteSection::MEDIASTINUM;
        if off.iter().any(|name| name == NAME) {
            return;
        }
        let Some(between) = Mediastinum::of(labels, &self.classes, &self.within) else {
            self.remarks.push(Remark::new(
                "the label map has not both lungs: the space between them, with heart and large vessels, is not known",
            ));
            return;
        };
        if self.target_lung.is_none() && between.contains(centre) {
            self.remarks.push(Remark::new(
                "the target is between the lungs: needles may go through the soft tissue there, and keep clear of what has \
                 a label of its own",
            ));
            return;
        }
        let Some(class) = self.classes.add(NAME, Kind::Organ) else {
            return;
        };
        let [nx, ny, _] = self.within.size();
        let first = self.within.first;
        for (offset, voxel) in self.voxels.iter_mut().enumerate() {
            let at = [
                first[0] + offset % nx,
                first[1] + offset / nx % ny,
                first[2] + offset / (nx * ny),
            ];
            if self.classes.get(*voxel).kind == Kind::Soft && between.contains(at) {
                *voxel = class;
                self.knows[Obstacle::Organ as usize] = true;
            }
        }
    }

    fn all_of(&self, class: u8) -> impl Iterator<Item = [usize; 3]> + '_ {
        let [nx, ny, _] = self.within.size();
        let [i0, j0, k0] = self.within.first;
        let found = self.voxels.iter().enumerate();
        found
            .filter(move |(_, each)| **each == class)
            .map(move |(offset, _)| {
                [
                    i0 + offset % nx,
                    j0 + offset / nx % ny,
                    k0 + offset / (nx * ny),
                ]
            })
    }

    fn neighbours(&self, voxel: [usize; 3]) -> impl Iterator<Item = [usize; 3]> + '_ {
        (0..6_usize).filter_map(move |face| {
            let mut next = voxel;
            let axis = face / 2;
            next[axis] = if face % 2 == 0 {
                voxel[axis].checked_sub(1)?
            } else {
                voxel[axis] + 1
            };
            self.within.contains(next).then_some(next)
        })
    }

    fn mask_of(&self, wanted: impl Fn(&Class) -> bool) -> Mask {
        let wanted: Vec<bool> = self.classes.all().map(wanted).collect();
        Mask::of(self.within.size(), &self.voxels, |class| {
            wanted[usize::from(class)]
        })
    }

    fn make_fields(&mut self, options: &VoxelOptions<'_>) -> Result<(), ImagingError> {
        let lung = self.target_lung;
        let is_off = |obstacle: Obstacle| options.off.iter().any(|name| name == obstacle.name());
        let bone = self.mask_of(|class| class.kind == Kind::Bone);
        let mut vessels = self.mask_of(|class| class.kind == Kind::Vessel);
        let in_lung = self.mask_of(|class| class.mark == Mark::LungVessel);
        let spacing_m = self.spacing_m;
        if !in_lung.is_empty() && options.lung_vessel_m > 0.0 {
            vessels.unite(&opened(&in_lung, 0.5 * options.lung_vessel_m, spacing_m));
        }
        if options.below_rib_m > 0.0 && !bone.is_empty() {
            let below = steps(options.below_rib_m / spacing_m[2]);
            vessels.unite(&lowered(&bone, below));
            vessels.subtract(&bone);
        }
        let mut organs = self.mask_of(|class| match class.kind {
            Kind::Organ => class.mark != Mark::Gas,
            Kind::Lung(other) => lung != Some(other),
            _ => false,
        });
        let gas = self.mask_of(|class| class.mark == Mark::Gas);
        let pockets = Components::of(&gas, Connectivity::Faces);
        let least = GAS_M3 / spacing_m.iter().product::<f64>();
        organs.unite(&pockets.mask_of(|part| pockets.parts()[part].voxels as f64 >= least));
        let part_grid = self.part_grid()?;
        // Distances are asked for as far as the needle reaches; beyond, where the guide is, labels are enough.
        let at = self.index_of(&self.target);
        let at = [0, 1, 2].map(|axis| steps(at[axis]).saturating_sub(self.within.first[axis]));
        let reach = [0, 1, 2].map(|axis| steps(options.needle_m / spacing_m[axis]) + 2);
        let near = IndexBox {
            first: at,
            last: at,
        }
        .widened(reach, self.within.size());
        let distance = DistanceOptions {
            cap_m: CAP_M,
            threads: options.threads,
            cancel: options.cancel,
        };
        for (obstacle, mask) in Obstacle::ALL.into_iter().zip([bone, vessels, organs]) {
            if !mask.is_empty() && !is_off(obstacle) {
                let field = DistanceField::to_boxes(&part_grid, &mask, near, &distance)?;
                self.fields[obstacle as usize] = Some(field);
            }
        }
        Ok(())
    }

    /// The grid of what is looked at.
    fn part_grid(&self) -> Result<VoxelGrid, ImagingError> {
        let first = self.within.first.map(|index| index as f64);
        VoxelGrid::new(
            self.within.size(),
            *self.grid.steps_m(),
            self.grid.ct_from_index(&Point3::from(first)),
        )
        .map_err(|error| ImagingError::refused(error.to_string()))
    }

    fn index_of(&self, point: &Point3<f64>) -> Point3<f64> {
        self.grid.index_from_ct(&(point + self.origin_in_ct_m))
    }

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
        [from_m, to_m]: [f64; 2],
        mut visit: impl FnMut(u8, [f64; 2], [usize; 3]) -> bool,
    ) -> bool {
        let line = self.line(ray);
        let index = line.at(from_m);
        let mut voxel = [0_usize; 3];
        let mut next_m = [f64::INFINITY; 3];
        let mut pace_m = [f64::INFINITY; 3];
        for axis in 0..3 {
            let nearest = (index[axis] + 0.5).floor();
            let [first, last] = [self.within.first[axis], self.within.last[axis]];
            if !(first as f64..=last as f64).contains(&nearest) {
                return false;
            }
            voxel[axis] = steps(nearest);
            let rate = line.per_m[axis];
            if rate.abs() > 1e-12 {
                let edge = nearest + 0.5_f64.copysign(rate);
                next_m[axis] = from_m + (edge - index[axis]) / rate;
                pace_m[axis] = 1.0 / rate.abs();
            }
        }
        let [nx, ny, _] = self.within.size();
        let strides = [1, nx, nx * ny];
        let mut offset = self.offset(voxel);
        let mut here_m = from_m;
        loop {
            let axis = (0..3).fold(0, |best, axis| {
                if next_m[axis] < next_m[best] {
                    axis
                } else {
                    best
                }
            });
            let leaves_m = next_m[axis].min(to_m);
            if !visit(self.voxels[offset], [here_m, leaves_m], voxel) || leaves_m >= to_m {
                return true;
            }
            here_m = leaves_m;
            next_m[axis] += pace_m[axis];
            let ends = [self.within.first[axis], self.within.last[axis]];
            if line.per_m[axis] > 0.0 {
                if voxel[axis] == ends[1] {
                    return false;
                }
                voxel[axis] += 1;
                offset += strides[axis];
            } else {
                if voxel[axis] == ends[0] {
                    return false;
                }
                voxel[axis] -= 1;
                offset -= strides[axis];
            }
        }
    }

    /// Outward normal of a set of voxels near a place: away from where it is around it.
    fn normal_near(&self, at: &Point3<f64>, is_inside: impl Fn(Kind) -> bool) -> UnitVector3<f64> {
        let inside: Vec<bool> = self
            .classes
            .all()
            .map(|class| is_inside(class.kind))
            .collect();
        let centre = self.index_of(at);
        let mut sum = Vector3::zeros();
        let range = |axis: usize| {
            let reach = NORMAL_RADIUS_M / self.spacing_m[axis];
            let [first, last] = [self.within.first[axis], self.within.last[axis]];
            steps(centre[axis] - reach).max(first)..=steps(centre[axis] + reach + 1.0).min(last)
        };
        let step = self.grid.steps_m();
        let along = |axis: usize, index: usize| (index as f64 - centre[axis]) * step.column(axis);
        for k in range(2) {
            let slice = along(2, k);
            for j in range(1) {
                let row = slice + along(1, j);
                let (columns, from) = (range(0), *range(0).start());
                if columns.is_empty() {
                    continue;
                }
                let offset = self.offset([from, j, k]);
                for i in columns {
                    let away = row + along(0, i);
                    if away.norm_squared() <= NORMAL_RADIUS_M * NORMAL_RADIUS_M {
                        let is_inside = inside[usize::from(self.voxels[offset + i - from])];
                        sum += if is_inside { -away } else { away };
                    }
                }
            }
        }
        UnitVector3::try_new(sum, 1e-12).unwrap_or_else(Vector3::z_axis)
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
        let count = ((to_m - from_m) / COARSE_M).ceil().max(1.0);
        let mut places = Vec::with_capacity(steps(count) + 1);
        let mut step = 0.0;
        while step <= count {
            places.push(at(from_m + (to_m - from_m) * step / count));
            step += 1.0;
        }
        let mut least = places.iter().copied().fold((from_m, f64::INFINITY), nearer);
        // The last ones first.
        let mut left: Vec<[(f64, f64); 2]> =
            places.windows(2).map(|two| [two[0], two[1]]).collect();
        while let Some([a, b]) = left.pop() {
            let apart_m = b.0 - a.0;
            if apart_m <= STEP_M || 0.5 * (a.1 + b.1 - apart_m) >= least.1 {
                continue;
            }
            let middle = at(0.5 * (a.0 + b.0));
            least = nearer(least, middle);
            left.push([a, middle]);
            left.push([middle, b]);
            if a.1 < b.1 {
                let last = left.len() - 1;
                left.swap(last - 1, last);
            }
        }
        (least.1 - 0.5 * STEP_M - self.mask_error_m, least.0)
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

    fn diagonal_m(&self) -> f64 {
        Vector3::from(self.spacing_m).norm()
    }
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

/// To whole steps, 0 for less.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within the grid, or 0"
)]
fn steps(value: f64) -> usize {
    value.floor().max(0.0) as usize
}

/// The voxel that holds an index, if one does.
fn voxel_at(index: &Point3<f64>, size: [usize; 3]) -> Option<[usize; 3]> {
    let mut voxel = [0; 3];
    for axis in 0..3 {
        let nearest = (index[axis] + 0.5).floor();
        if !(nearest >= 0.0 && nearest < size[axis] as f64) {
            return None;
        }
        voxel[axis] = steps(nearest);
    }
    Some(voxel)
}

/// Classes of a box of voxels.
fn boxed(
    labels: &[u16],
    [nx, ny, _]: [usize; 3],
    within: &IndexBox,
    class: impl Fn(u16) -> u8,
) -> Vec<u8> {
    let mut out = Vec::with_capacity(within.size().iter().product());
    for k in within.first[2]..=within.last[2] {
        for j in within.first[1]..=within.last[1] {
            let row = (k * ny + j) * nx;
            let row = &labels[row + within.first[0]..=row + within.last[0]];
            out.extend(row.iter().map(|&label| class(label)));
        }
    }
    out
}

/// What lies up to so many slices below a set: towards the feet.
fn lowered(set: &Mask, slices: usize) -> Mask {
    let mut below = Mask::empty(set.size());
    for [i, j, k] in set.voxels() {
        for down in 1..=slices.min(k) {
            below.insert([i, j, k - down]);
        }
    }
    below
}

impl Anatomy for VoxelAnatomy {
    fn kind(&self) -> &'static str {
        "voxels"
    }

    fn target(&self) -> Point3<f64> {
        self.target
    }

    fn exit(&self, ray: &Ray) -> Exit {
        let mut depth_m = 0.0;
        let mut found = None;
        self.walk(
            ray,
            [0.0, self.reach_m],
            |class, [enters_m, leaves_m], voxel| {
                depth_m = leaves_m;
                if self.classes.get(class).kind == Kind::Outside {
                    found = Some((enters_m, voxel));
                }
                found.is_none()
            },
        );
        let Some((skin_m, voxel)) = found else {
            // It ends within the body: far beyond the needle, or where the scan does.
            return Exit::End(depth_m);
        };
        let last = self.grid.size()[2] - 1;
        let from_end = voxel[2].min(last - voxel[2]) as f64 * self.spacing_m[2];
        if from_end < END_M {
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
        let mut is_there = false;
        self.walk(ray, [past_m, to_m.max(past_m)], |class, _, _| {
            is_there = self.classes.get(class).kind != Kind::Outside;
            !is_there
        });
        is_there
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
        self.normal_near(&ray.at(depth_m), |kind| kind != Kind::Outside)
    }

    fn lungs(&self, ray: &Ray, from_to_m: [f64; 2]) -> LungPassage {
        let mut passage = LungPassage::default();
        // From the target outwards: what was passed last is what the needle enters from.
        let mut inside = self.target_lung;
        let mut lobe: Option<u8> = None;
        let mut entered_m = None;
        self.walk(ray, from_to_m, |class, [enters_m, leaves_m], _| {
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

    fn leaves_lung_m(&self, ray: &Ray, within_m: f64) -> Option<f64> {
        let lung = self.target_lung?;
        let back = Ray {
            outwards: -ray.outwards,
            ..*ray
        };
        let mut left_m = None;
        self.walk(&back, [0.0, within_m], |class, [enters_m, _], _| {
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
