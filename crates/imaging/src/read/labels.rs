//! Label maps of a CT, as 3D Slicer and TotalSegmentator write them.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::voxels::StoredVoxels;
use super::{Format, ReadOptions, dicom, format_of, nifti, zeroed};
use crate::{ImagingError, LabelMap, Remark, VoxelGrid};

/// Distance between corners up to which two grids are the same.
const SAME_CORNERS_M: f64 = 1e-5;

/// A label map on the CT's grid, and what is odd about it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadLabels {
    /// Labels of the CT's voxels.
    pub labels: LabelMap,
    /// What is odd.
    pub remarks: Vec<Remark>,
}

/// Reads a label map of the CT on `grid` from NIfTI or a DICOM segmentation.
///
/// Its voxels must be the CT's, to 0.01 mm at the corners; axes may run the other way or be in another order.
pub fn read_labels(
    path: &Path,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<ReadLabels, ImagingError> {
    match format_of(path)? {
        Format::Dicom => {
            let (labels, remarks) = dicom::read_segmentation(path, grid, options, cancel)?;
            Ok(ReadLabels { labels, remarks })
        }
        Format::Nifti => of_stored(nifti::open(path, options)?, grid, options, cancel),
    }
}

fn of_stored(
    stored: StoredVoxels,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<ReadLabels, ImagingError> {
    let mut remarks = stored.header().remarks.clone();
    let own = stored.header().grid.clone();
    let order = Order::between(&own, grid)?;
    let (values, of_bytes) = stored.labels(options, cancel)?;
    remarks.extend(of_bytes);
    let labels = if order.is_same() {
        values
    } else {
        order.applied(&values, grid)?
    };
    let mut is_used = vec![false; 1 << 16];
    for label in &labels {
        is_used[usize::from(*label)] = true;
    }
    let names = (1..=u16::MAX)
        .filter(|label| is_used[usize::from(*label)])
        .map(|label| (label, format!("label {label}")));
    Ok(ReadLabels {
        labels: LabelMap {
            grid: grid.clone(),
            labels,
            names: names.collect(),
        },
        remarks,
    })
}

/// Which axis of another grid runs along each axis of ours, and whether the other way.
#[derive(Debug, PartialEq, Eq)]
struct Order {
    size: [usize; 3],
    axes: [(usize, bool); 3],
}

impl Order {
    fn between(own: &VoxelGrid, wanted: &VoxelGrid) -> Result<Self, ImagingError> {
        let permutations = [
            [0, 1, 2],
            [1, 0, 2],
            [0, 2, 1],
            [2, 1, 0],
            [1, 2, 0],
            [2, 0, 1],
        ];
        let mut nearest_m = f64::INFINITY;
        for permutation in permutations {
            if permutation.map(|axis| own.size()[axis]) != wanted.size() {
                continue;
            }
            for flips in 0..8 {
                let order = Self {
                    size: own.size(),
                    axes: [0, 1, 2].map(|axis| (permutation[axis], flips >> axis & 1 == 1)),
                };
                let apart_m = order.farthest_corners_m(own, wanted);
                if apart_m <= SAME_CORNERS_M {
                    return Ok(order);
                }
                nearest_m = nearest_m.min(apart_m);
            }
        }
        let [a, b] = [own, wanted].map(|grid| {
            let [i, j, k] = grid.size();
            format!("{i} x {j} x {k}")
        });
        let what = if nearest_m.is_finite() {
            format!(
                "its voxel corners are up to {:.3} mm from the CT's",
                nearest_m * 1e3
            )
        } else {
            format!("it has {a} voxels, the CT {b}")
        };
        Err(
            ImagingError::refused(format!("the label map belongs to another volume: {what}"))
                .hint("export it in the geometry of the CT"),
        )
    }

    /// Index in the other grid of one in ours.
    fn index(&self, index: [usize; 3]) -> [usize; 3] {
        let mut other = [0; 3];
        for ((axis, is_flipped), at) in self.axes.into_iter().zip(index) {
            other[axis] = if is_flipped {
                self.size[axis] - 1 - at
            } else {
                at
            };
        }
        other
    }

    fn farthest_corners_m(&self, own: &VoxelGrid, wanted: &VoxelGrid) -> f64 {
        (0..8)
            .map(|corner| {
                let at = [0, 1, 2].map(|axis| {
                    if corner >> axis & 1 == 1 {
                        wanted.size()[axis] - 1
                    } else {
                        0
                    }
                });
                let place = |grid: &VoxelGrid, index: [usize; 3]| {
                    let index = index.map(|each| each as f64);
                    grid.ct_from_index(&nalgebra::Point3::from(nalgebra::Vector3::from(index)))
                };
                (place(own, self.index(at)) - place(wanted, at)).norm()
            })
            .fold(0.0, f64::max)
    }

    fn is_same(&self) -> bool {
        self.axes == [(0, false), (1, false), (2, false)]
    }

    fn applied(&self, values: &[u16], grid: &VoxelGrid) -> Result<Vec<u16>, ImagingError> {
        let mut labels = zeroed(values.len())?;
        let [columns, rows, slices] = grid.size();
        let mut out = labels.iter_mut();
        for k in 0..slices {
            for j in 0..rows {
                for (i, label) in (0..columns).zip(&mut out) {
                    let [a, b, c] = self.index([i, j, k]);
                    *label = values[(c * self.size[1] + b) * self.size[0] + a];
                }
            }
        }
        Ok(labels)
    }
}
