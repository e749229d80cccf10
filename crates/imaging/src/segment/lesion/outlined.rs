//! Lesions whose outline comes from elsewhere.

use std::sync::atomic::AtomicBool;

use nalgebra::Matrix3;
use needlebench_volume::{Volume, VolumeError};

use crate::mask::{IndexBox, Mask};
use crate::segment::{Levels, Scan, Segmentation};
use crate::spacing::orthogonal;

use super::local::Local;
use super::{Lesion, MARGIN, not_a_grid};

impl Lesion {
    /// Of the voxels of a mask of a box. It is in the lung if one holds most of them.
    pub(crate) fn outlined(
        name: String,
        volume: &Volume,
        found: &Segmentation,
        bounds: IndexBox,
        mask: &Mask,
        cancel: &AtomicBool,
    ) -> Result<Self, VolumeError> {
        let scan = Scan {
            volume,
            spacing_m: orthogonal(&volume.grid)?,
            levels: Levels::default(),
            cancel,
        };
        let wide = bounds.widened([MARGIN; 3], scan.size());
        let mut here = Mask::empty(wide.size());
        let within = IndexBox {
            first: [0, 1, 2].map(|axis| bounds.first[axis] - wide.first[axis]),
            last: [0, 1, 2].map(|axis| bounds.last[axis] - wide.first[axis]),
        };
        here.unite_within(&within, mask);
        let in_lung = found.lungs.lungs.iter().any(|lung| {
            let mut whole = Mask::empty(scan.size());
            whole.unite_within(&found.lungs.bounds, &lung.mask);
            let mut part = whole.cropped(&wide);
            part.intersect(&here);
            2 * part.count() > here.count()
        });
        let ball = 3.0 / (4.0 * std::f64::consts::PI) * here.count() as f64 * scan.voxel_m3();
        Ok(Self {
            name,
            in_lung,
            median_hu: scan.median(&here, &wide).unwrap_or_default(),
            level_hu: None,
            inscribed_radius_m: libm::cbrt(ball),
            cut_at_wall: false,
            cut_at_vessels: false,
            leaked: false,
            fine: Local::own(&scan, &wide).map_err(|error| not_a_grid(&error))?,
            fine_mask: here.clone(),
            spread_m2: Matrix3::zeros(),
            mask: here,
            bounds: wide,
        })
    }
}
