//! Voxels of a label map as anatomy.

mod blocks;
mod classes;
mod mammary;
mod mediastinum;
mod normal;
mod rays;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, Vector3};
use needlebench_imaging::{
    Components, Connectivity, DistanceField, DistanceOptions, IndexBox, Label, Mask, opened,
};
use needlebench_phantom::{Passed, Phantom};
use needlebench_scenario::scenario::NeedleRouteSection;
use needlebench_volume::{LabelMap, Remark, VolumeError, VoxelGrid, structure_of};

use crate::anatomy::Obstacle;
use blocks::Blocks;
use classes::{Class, Classes, Kind, Mark};
use mediastinum::Mediastinum;
pub use normal::body_normal;

/// Distances beyond this are told as this, m: no margin asks for more.
const CAP_M: f64 = 20e-3;

/// Least pocket of gas that is bowel or airway, m^3: half a millilitre (assumed). Noise under the skin makes smaller ones.
const GAS_M3: f64 = 0.5e-6;

/// Soft tissue below this is fat, HU (assumed: fat is about -100, muscle 50).
const FAT_BELOW_HU: i16 = -30;

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

fn is_soft(name: &str) -> bool {
    let lower = name.to_lowercase();
    SOFT.iter().any(|word| lower.contains(word))
}

/// What is asked of the voxels.
#[derive(Debug, Clone, Copy)]
pub struct VoxelOptions<'a> {
    /// The patient that was built from the scan: where that ends. Without, at its first and last slice alone.
    pub patient: Option<&'a Arc<Phantom>>,
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
    /// How far from the sternum's edges internal mammary vessels are modelled, m.
    pub beside_sternum_m: f64,
    /// Hounsfield units of the label map's voxels, which tell fat from other soft tissue; without, names of labels do.
    pub hu: Option<&'a [i16]>,
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
    patient: Option<Arc<Phantom>>,
    grid: VoxelGrid,
    spacing_m: [f64; 3],
    /// From frame `phantom` to `ct`.
    origin_in_ct_m: Vector3<f64>,
    /// What is looked at of the grid.
    within: IndexBox,
    /// One class for each of its voxels.
    voxels: Vec<u8>,
    blocks: Blocks,
    classes: Classes,
    /// What a needle in each class is in.
    passed: Vec<Option<Passed>>,
    is_fat_known: bool,
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
    /// A grid that is not along the axes of `ct`, Hounsfield units of other voxels, a target outside them or outside
    /// the body, interrupted.
    pub fn new(
        labels: &LabelMap,
        origin_in_ct_m: Vector3<f64>,
        target: Point3<f64>,
        options: &VoxelOptions<'_>,
    ) -> Result<Self, VolumeError> {
        let grid = &labels.grid;
        if !grid.is_aligned() {
            return Err(VolumeError::refused(
                "the label map's axes do not run to the left, the back and the head",
            ));
        }
        if options.hu.is_some_and(|hu| hu.len() != labels.labels.len()) {
            return Err(VolumeError::refused(
                "the Hounsfield units are of other voxels than the labels",
            ));
        }
        let spacing_m = grid.spacing_m();
        let at = grid.index_from_ct(&(target + origin_in_ct_m));
        let centre = voxel_at(&at, grid.size()).ok_or_else(|| {
            VolumeError::refused("the target is outside the scan")
                .hint("coordinates are in mm in the scan's frame (left, posterior, superior)")
        })?;
        let reach_m = options.needle_m + options.outside_m;
        let reach = [0, 1, 2].map(|axis| steps(reach_m / spacing_m[axis]) + 2);
        let within = IndexBox {
            first: centre,
            last: centre,
        }
        .widened(reach, grid.size());
        let mut classes = Classes::of(labels, options.lesions, options.off);
        let fat = options
            .hu
            .map(|_| classes.add(Class::new("fat", Kind::Soft)));
        let may_be_fat: Vec<bool> = classes.all().map(Class::may_be_fat).collect();
        let voxels = boxed(grid.size(), &within, |offset| {
            let class = classes.of_label(labels.labels[offset]);
            let is_fat = |hu: &[i16]| may_be_fat[usize::from(class)] && hu[offset] < FAT_BELOW_HU;
            let split = fat.filter(|_| options.hu.is_some_and(is_fat));
            split.unwrap_or(class)
        });
        let blocks = Blocks::of(
            &voxels,
            within.size(),
            |class| classes.sides(class),
            options.threads,
        );
        let mut anatomy = Self {
            patient: options.patient.cloned(),
            grid: grid.clone(),
            spacing_m,
            origin_in_ct_m,
            within,
            voxels,
            blocks,
            classes,
            passed: Vec::new(),
            is_fat_known: false,
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
        if matches!(anatomy.kind_at(centre), Kind::Outside | Kind::Beside) {
            return Err(VolumeError::refused("the target is outside the body")
                .hint("coordinates are in mm in the scan's frame (left, posterior, superior)"));
        }
        anatomy.look_over(labels);
        anatomy.find_lung(centre);
        anatomy.mark_mediastinum(labels, centre, options.off);
        anatomy.mark_mammary(labels, options.beside_sternum_m);
        if anatomy.target_lung.is_none() {
            anatomy.remarks.push(Remark::new(
                "the target is not in a lung: needle paths avoid both lungs",
            ));
        }
        anatomy.passed = anatomy.classes.all().map(Class::passed).collect();
        let is_labelled = |name: &str| Class::new(name, Kind::Soft).passed() == Some(Passed::Fat);
        anatomy.is_fat_known =
            options.hu.is_some() || labels.names.iter().any(|(_, name)| is_labelled(name));
        anatomy.make_fields(options)?;
        Ok(anatomy)
    }

    /// Remarks on the interpretation of the labels.
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
            // In emphysema, or in a vessel.
            Kind::InLung => {
                let mut lungs = [0_usize; 256];
                for lung in (0..6).filter_map(|face| self.lung_towards(centre, face)) {
                    lungs[usize::from(lung)] += 1;
                }
                let most = (0..=u8::MAX).max_by_key(|&lung| (lungs[usize::from(lung)], lung));
                self.target_lung = most.filter(|&lung| lungs[usize::from(lung)] > 0);
                self.touches_pleura = self.target_lung.map(|_| false);
                if self.classes.get(class).mark == Mark::LungVessel {
                    self.remarks.push(Remark::new(
                        "the target is in what is taken for a vessel of the lung, which needle paths avoid: a nodule \
                         there is one only as a lesion (`ct build --lesion`, or a label map)",
                    ));
                }
            }
            Kind::Lesion => {
                let (mut faces, mut soft, mut lungs) = (0_usize, 0_usize, [0_usize; 256]);
                for voxel in self.all_of(class) {
                    for face in 0..6 {
                        let Some(next) = self.neighbour(voxel, face) else {
                            continue;
                        };
                        match self.kind_at(next) {
                            Kind::Lesion => continue,
                            Kind::Lung(lung) => lungs[usize::from(lung)] += 1,
                            Kind::InLung => {
                                if let Some(lung) = self.lung_towards(next, face) {
                                    lungs[usize::from(lung)] += 1;
                                }
                            }
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

    /// Structures that the label map has, and missing ones that a user must know of.
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
                "unknown structures are treated as soft tissue, which needle paths may cross: {}",
                unknown.join(", ")
            )));
        }
        if !missing.is_empty() {
            self.remarks.push(Remark::new(format!(
                "the label map has no {}: needle paths avoid them only in the mediastinum; \
                 provide a label map that has them (`ct build --labels`)",
                missing.join(", ")
            )));
        }
        if !self.knows[Obstacle::Bone as usize] {
            self.remarks.push(Remark::new(
                "the label map has no bone: distances to bone are unknown",
            ));
        }
    }

    /// Makes an organ of the soft tissue between the lungs: heart and large vessels, labelled or not. A target in it
    /// must be reached through it.
    fn mark_mediastinum(&mut self, labels: &LabelMap, centre: [usize; 3], off: &[String]) {
        const NAME: &str = NeedleRouteSection::MEDIASTINUM;
        if off.iter().any(|name| name == NAME) {
            return;
        }
        let Some(between) = Mediastinum::of(labels, &self.classes, &self.within) else {
            self.remarks.push(Remark::new(
                "the label map has no lung: the mediastinum, with heart and large vessels, is unknown",
            ));
            return;
        };
        if self.target_lung.is_none() && between.contains(centre) {
            self.remarks.push(Remark::new(
                "the target is in the mediastinum: needle paths may cross its soft tissue and avoid labelled structures",
            ));
            return;
        }
        if between.has_one_lung() {
            self.remarks.push(Remark::new(
                "the label map has one lung: its mediastinum is taken to fill the other half of the chest, which needle \
                 paths avoid",
            ));
        }
        let class = self.classes.add(Class::new(NAME, Kind::Organ));
        let [first, last] = [self.within.first, self.within.last];
        for (k, j) in (first[2]..=last[2]).flat_map(|k| (first[1]..=last[1]).map(move |j| (k, j))) {
            let Some([from, to]) = between.columns(j, k) else {
                continue;
            };
            let [from, to] = [from.max(first[0]), to.min(last[0])];
            if from > to {
                continue;
            }
            let offset = self.offset([from, j, k]);
            for voxel in &mut self.voxels[offset..=offset + (to - from)] {
                if self.classes.get(*voxel).kind == Kind::Soft {
                    *voxel = class;
                    self.knows[Obstacle::Organ as usize] = true;
                }
            }
        }
    }

    /// Makes vessels of the soft tissue beside the sternum, in front of lungs and mediastinum.
    fn mark_mammary(&mut self, labels: &LabelMap, width_m: f64) {
        if width_m <= 0.0 {
            return;
        }
        let is_inside = |class: &Class| match class.kind {
            Kind::Lung(_) | Kind::InLung | Kind::Lesion => true,
            Kind::Organ => class.mark != Mark::Gas,
            _ => false,
        };
        let structure = |class: &Class| structure_of(&class.name).map(|structure| structure.name);
        let named = |name: &str| -> Vec<bool> {
            let classes = self.classes.all();
            classes
                .map(|class| structure(class).as_deref() == Some(name))
                .collect()
        };
        // A label map with a sternum says which bone it is; cartilage hangs on it and is none.
        let (sternum, cartilage) = (named("sternum"), named(Label::Cartilage.name()));
        let has_sternum = self.voxels.iter().any(|&class| sternum[usize::from(class)]);
        let tissues: Vec<mammary::Tissue> = self
            .classes
            .all()
            .enumerate()
            .map(|(number, class)| {
                let is_sternum = if has_sternum {
                    sternum[number]
                } else {
                    class.kind == Kind::Bone && !cartilage[number]
                };
                if is_sternum {
                    mammary::Tissue::Bone
                } else if is_inside(class) {
                    mammary::Tissue::Inside
                } else if matches!(class.kind, Kind::Outside | Kind::Beside) {
                    mammary::Tissue::Outside
                } else {
                    mammary::Tissue::Other
                }
            })
            .collect();
        // Where it is labelled it is looked for everywhere.
        let middle = mediastinum::middle_of_body(labels, &self.classes);
        let middle = middle.filter(|_| !has_sternum);
        let tissue = |voxel| tissues[usize::from(self.voxels[self.offset(voxel)])];
        let found = mammary::beside_sternum(&self.within, self.spacing_m, middle, width_m, tissue);
        if found.is_empty() {
            return;
        }
        let class = self.classes.add(Class::new(
            "internal mammary vessels (modelled)",
            Kind::Vessel,
        ));
        for voxel in found {
            let at = self.offset(voxel);
            if self.classes.get(self.voxels[at]).kind == Kind::Soft {
                self.voxels[at] = class;
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

    fn neighbour(&self, voxel: [usize; 3], face: usize) -> Option<[usize; 3]> {
        let mut next = voxel;
        let axis = face / 2;
        next[axis] = if face.is_multiple_of(2) {
            voxel[axis].checked_sub(1)?
        } else {
            voxel[axis] + 1
        };
        self.within.contains(next).then_some(next)
    }

    /// The first lung from a voxel on in the direction of one of its faces, through vessels and air without lung.
    fn lung_towards(&self, voxel: [usize; 3], face: usize) -> Option<u8> {
        let mut at = voxel;
        loop {
            match self.kind_at(at) {
                Kind::Lung(lung) => return Some(lung),
                Kind::InLung | Kind::Lesion => at = self.neighbour(at, face)?,
                _ => return None,
            }
        }
    }

    fn mask_of(&self, wanted: impl Fn(&Class) -> bool) -> Mask {
        let wanted: Vec<bool> = self.classes.all().map(wanted).collect();
        Mask::of(self.within.size(), &self.voxels, |class| {
            wanted[usize::from(class)]
        })
    }

    fn make_fields(&mut self, options: &VoxelOptions<'_>) -> Result<(), VolumeError> {
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
    fn part_grid(&self) -> Result<VoxelGrid, VolumeError> {
        let first = self.within.first.map(|index| index as f64);
        VoxelGrid::new(
            self.within.size(),
            *self.grid.steps_m(),
            self.grid.ct_from_index(&Point3::from(first)),
        )
        .map_err(|error| VolumeError::refused(error.to_string()))
    }

    fn index_of(&self, point: &Point3<f64>) -> Point3<f64> {
        self.grid.index_from_ct(&(point + self.origin_in_ct_m))
    }

    fn diagonal_m(&self) -> f64 {
        Vector3::from(self.spacing_m).norm()
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

/// Classes of a box of voxels, by their offsets.
fn boxed([nx, ny, _]: [usize; 3], within: &IndexBox, class: impl Fn(usize) -> u8) -> Vec<u8> {
    let mut out = Vec::with_capacity(within.size().iter().product());
    for k in within.first[2]..=within.last[2] {
        for j in within.first[1]..=within.last[1] {
            let row = (k * ny + j) * nx;
            out.extend((row + within.first[0]..=row + within.last[0]).map(&class));
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
