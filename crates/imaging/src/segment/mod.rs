//! Tissues of a CT volume of the chest, by Hounsfield units and shape, without learning.

mod beside;
mod blood;
mod body;
mod bone;
mod cartilage;
mod couch;
mod labels;
mod lesion;
mod lungs;
mod upright;

use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_volume::{Lying, Orientation, Remark, Volume, VolumeError};

use crate::field_of_view::FieldOfView;
use crate::mask::{IndexBox, Mask};
use crate::spacing::{orthogonal, whole};

pub use beside::Beside;
pub use body::Body;
pub(crate) use body::SKIN_LEVEL_HU;
pub use bone::Bone;
pub(crate) use bone::{BONE_LEVEL_HU, SOFT_FROM_HU};
pub(crate) use labels::label_facts;
pub use labels::{FIRST_LESION, Label, LabelFacts, label_map, paint};
pub use lesion::{Lesion, LesionSeed};
pub(crate) use lesion::{centre_covariance_m2, grow_lesion};
pub(crate) use lungs::LUNG_LEVEL_HU;
pub use lungs::{Lung, Lungs, Side};

/// What is in a volume.
#[derive(Debug, Clone)]
pub struct Segmentation {
    /// The patient without the couch.
    pub body: Body,
    /// Arms, couch and what else is beside the patient.
    pub beside: Vec<Beside>,
    /// Lungs, airways, vessels in the lungs.
    pub lungs: Lungs,
    /// Bone, and vessels with contrast medium.
    pub bone: Bone,
    /// What a user has to know.
    pub remarks: Vec<Remark>,
}

impl Segmentation {
    /// Says what was not found; `is_given` tells what a label map has.
    pub(crate) fn note_absent(
        &self,
        volume: &Volume,
        is_given: &dyn Fn(&str) -> bool,
        remarks: &mut Vec<Remark>,
    ) {
        lungs::note_absent(&self.lungs, is_given, remarks);
        let voxel_l = 1e3 * volume.grid.steps_m().determinant().abs();
        let cartilage_l = self.bone.cartilage.count() as f64 * voxel_l;
        let is_known = is_given(Label::Cartilage.name());
        if !is_known && self.lungs.lungs.len() == 2 && cartilage_l < cartilage::USUAL_L {
            remarks.push(Remark::new(
                "hardly any costal cartilage found (muscle-like density, noise, or calcified): a route beside the \
                 sternum may pass some",
            ));
        }
    }
}

/// Where surfaces run, HU: at half-integers, so that no voxel is on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levels {
    /// Between air and skin.
    pub skin_hu: f64,
    /// Between lung and soft tissue.
    pub lung_hu: f64,
    /// Above it is bone, or blood with contrast medium. The surface of bone runs at its own middle.
    pub bone_hu: f64,
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            skin_hu: SKIN_LEVEL_HU,
            lung_hu: LUNG_LEVEL_HU,
            bone_hu: BONE_LEVEL_HU,
        }
    }
}

impl Levels {
    /// The same at the nearest half-integers.
    ///
    /// # Errors
    /// If they are not in the order of lung, soft tissue and bone, or beyond what 16 bits hold.
    fn checked(&self) -> Result<Self, VolumeError> {
        let Self {
            skin_hu,
            lung_hu,
            bone_hu,
        } = *self;
        let sound = [skin_hu, lung_hu, bone_hu]
            .iter()
            .all(|level| (-990.0..3000.0).contains(level));
        if !sound || skin_hu >= bone_hu || lung_hu >= bone_hu {
            return Err(VolumeError::refused(format!(
                "levels of {skin_hu} HU (skin), {lung_hu} HU (lung) and {bone_hu} HU (bone)"
            ))
            .hint("skin and lung below bone, all between -990 and 3000 HU"));
        }
        let half = |level: f64| level.floor() + 0.5;
        Ok(Self {
            skin_hu: half(skin_hu),
            lung_hu: half(lung_hu),
            bone_hu: half(bone_hu),
        })
    }
}

/// Finds body, lungs, airways, vessels and bone in what a scan has `seen` of a patient, lying on back, front or side.
///
/// # Errors
/// If the grid is sheared or its slices do not run along the patient, nothing is denser than air, or it was told to stop.
pub fn segment(
    volume: &Volume,
    seen: &FieldOfView,
    lying: Lying,
    levels: &Levels,
    cancel: &AtomicBool,
) -> Result<Segmentation, VolumeError> {
    check_complete(volume)?;
    let scan = Scan {
        volume,
        spacing_m: orthogonal(&volume.grid)?,
        levels: levels.checked()?,
        cancel,
    };
    let mut remarks = Vec::new();
    let unseen = seen.unseen(&volume.grid);
    let body = body::find(&scan, seen, unseen.as_ref(), &mut remarks)?;
    let beside = beside::find(&scan, &body, unseen.as_ref(), lying, &mut remarks)?;
    let lungs = lungs::find(&scan, &body, &mut remarks)?;
    let bone = bone::find(&scan, &body, &lungs, &mut remarks)?;
    upright::check(&scan, &body, &lungs, &bone)?;
    Ok(Segmentation {
        body,
        beside,
        lungs,
        bone,
        remarks,
    })
}

/// Whether there is a value for each voxel, in slices along the patient.
pub(crate) fn check_complete(volume: &Volume) -> Result<(), VolumeError> {
    let orientation = Orientation::of(&volume.grid);
    let [_, _, (along, _)] = orientation.axes();
    if along != 2 {
        return Err(VolumeError::refused(format!(
            "its axes are {orientation}: slices do not run from feet to head"
        ))
        .hint("put the voxels in the order of the patient's axes first (`in_order`)"));
    }
    if volume.hu.len() == volume.grid.len() {
        return Ok(());
    }
    Err(VolumeError::refused(format!(
        "the grid has {} voxels, the data {}",
        volume.grid.len(),
        volume.hu.len()
    )))
}

/// A volume that is looked at.
struct Scan<'a> {
    volume: &'a Volume,
    spacing_m: [f64; 3],
    levels: Levels,
    cancel: &'a AtomicBool,
}

impl Scan<'_> {
    fn size(&self) -> [usize; 3] {
        self.volume.grid.size()
    }

    /// The axis of the grid that runs most along one of the patient's: 0 left, 1 posterior, 2 superior.
    fn axis_along(&self, of_patient: usize) -> usize {
        let steps_m = self.volume.grid.steps_m();
        steps_m.row(of_patient).transpose().iamax()
    }

    fn voxel_m3(&self) -> f64 {
        self.spacing_m.iter().product()
    }

    fn litres(&self, voxels: usize) -> f64 {
        1e3 * voxels as f64 * self.voxel_m3()
    }

    /// Voxels that make up a volume, at least one.
    fn voxels_of(&self, litres: f64) -> usize {
        whole((1e-3 * litres / self.voxel_m3()).ceil()).max(1)
    }

    /// Whole voxels across a width along an axis.
    fn voxels_across(&self, width_m: f64, axis: usize) -> usize {
        whole(width_m / self.spacing_m[axis])
    }

    /// Hounsfield units of the voxels `from..to` of a row.
    fn row(&self, [from, to]: [usize; 2], j: usize, k: usize) -> &[i16] {
        let start = self.volume.grid.offset([0, j, k]);
        &self.volume.hu[start + from..start + to]
    }

    fn hu(&self, voxel: [usize; 3]) -> i16 {
        self.volume.hu[self.volume.grid.offset(voxel)]
    }

    /// Voxels of a mask of a box that are denser than a level, which is at a half-integer.
    fn denser(&self, part: &Mask, bounds: &IndexBox, level: f64) -> Mask {
        let level = below(level);
        let mut found = Mask::of_box(self.size(), &self.volume.hu, bounds, |hu| hu > level);
        found.intersect(part);
        found
    }

    /// Voxels of a mask of a box whose value is wanted, as a mask of the box.
    fn within(&self, part: &Mask, bounds: &IndexBox, wanted: impl Fn(i16) -> bool) -> Mask {
        let mut found = Mask::empty(part.size());
        let [_, ny, nz] = part.size();
        for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
            for [from, to] in part.runs(j, k) {
                let there = [from, to].map(|i| i + bounds.first[0]);
                let values = self.row(there, j + bounds.first[1], k + bounds.first[2]);
                for (i, _) in values
                    .iter()
                    .enumerate()
                    .filter(|(_, value)| wanted(**value))
                {
                    found.insert([from + i, j, k]);
                }
            }
        }
        found
    }

    /// Median of the values at the voxels of a mask of a box; none if it has none.
    fn median(&self, part: &Mask, bounds: &IndexBox) -> Option<i16> {
        let mut histogram = vec![0_usize; 1 << 16];
        let mut count = 0;
        let [_, ny, nz] = part.size();
        for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
            for [from, to] in part.runs(j, k) {
                let there = [from, to].map(|i| i + bounds.first[0]);
                for &value in self.row(there, j + bounds.first[1], k + bounds.first[2]) {
                    histogram[usize::from(value.wrapping_add(i16::MIN).cast_unsigned())] += 1;
                }
                count += to - from;
            }
        }
        let mut below = 0;
        let at = histogram.iter().position(|&each| {
            below += each;
            2 * below > count
        })?;
        u16::try_from(at)
            .ok()
            .map(|at| at.cast_signed().wrapping_add(i16::MIN))
    }

    fn check(&self) -> Result<(), VolumeError> {
        if self.cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        Ok(())
    }
}

/// The whole number below a level, which is within 16 bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "levels are checked to be within 16 bits"
)]
fn below(level: f64) -> i16 {
    level.floor() as i16
}

/// The direction in words in which an axis of the grid runs, at its start or its end.
fn side_in_words(volume: &Volume, axis: usize, at_end: bool) -> &'static str {
    let step = volume.grid.steps_m().column(axis).into_owned();
    let along = step.iamax();
    match (along, (step[along] > 0.0) == at_end) {
        (0, true) => "left",
        (0, false) => "right",
        (1, true) => "posterior",
        (1, false) => "anterior",
        (_, true) => "upper",
        (_, false) => "lower",
    }
}
