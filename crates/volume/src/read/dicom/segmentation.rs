//! DICOM segmentations as label maps.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::find;
use super::image::{Segmentation, Slice, named};
use super::pixels::{self, LastFile};
use crate::read::scalar::{Kind, Stored};
use crate::read::segments::in_several;
use crate::read::{ReadOptions, zeroed};
use crate::{LabelMap, Remark, VolumeError, VoxelGrid};

/// Distance of a pixel from the voxel that it labels.
const SAME_PLACE_M: f64 = 1e-5;

/// Share of a fraction's greatest value from which a voxel belongs to the segment.
const HALF: f64 = 0.5;

/// Reads a segmentation of the CT on `grid`; slices without a frame have no labels.
pub(super) fn read(
    path: &Path,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<(LabelMap, Vec<Remark>), VolumeError> {
    let found = find(path, options, cancel)?;
    if let Some(problem) = found.broken.into_iter().next() {
        return Err(problem);
    }
    let slices = found.slices;
    let Some(segmentation) = slices
        .first()
        .and_then(|slice| slice.file.segmentation.as_ref())
    else {
        return Err(
            VolumeError::refused("not a segmentation: there is no SegmentationType")
                .at("(0062,0001)")
                .hint(
                    "a label map is read from DICOM SEG or RTSTRUCT, NIfTI, NRRD, MetaImage or MGH",
                ),
        );
    };
    let mut remarks = Vec::new();
    let threshold = threshold(segmentation, &mut remarks)?;
    options.check_memory(grid, (grid.len() * size_of::<u16>()) as u64)?;
    let mut labels = zeroed(grid.len())?;
    let mut overlapping = 0_u64;
    let (mut last, mut buffer) = (LastFile::default(), Vec::new());
    for slice in &slices {
        if cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        let mut place =
            Placing::of(slice, grid).map_err(|problem| named(problem, &shown(slice)))?;
        let label = match &threshold {
            None => None,
            Some(_) => Some(number_of(slice, segmentation)?),
        };
        read_frame(slice, options, &mut last, &mut buffer, |value| {
            let Some(at) = place.next() else { return };
            let new = match (label, threshold) {
                (Some(label), Some(threshold)) => {
                    if f64::from(value) < threshold {
                        return;
                    }
                    label
                }
                _ => value,
            };
            let old: &mut u16 = &mut labels[at];
            if *old != 0 && new != 0 && *old != new {
                overlapping += 1;
            }
            if new != 0 {
                *old = new;
            }
        })?;
    }
    if overlapping > 0 {
        remarks.push(in_several(overlapping));
    }
    let mut names = segmentation.segments.clone();
    names.sort();
    Ok((
        LabelMap {
            grid: grid.clone(),
            labels,
            names,
        },
        remarks,
    ))
}

fn shown(slice: &Slice) -> String {
    format!("{} frame {}", slice.file.name, slice.frame + 1)
}

/// Value from which a voxel is in the frame's segment; none where values are labels.
fn threshold(
    segmentation: &Segmentation,
    remarks: &mut Vec<Remark>,
) -> Result<Option<f64>, VolumeError> {
    match segmentation.kind.as_str() {
        "BINARY" => Ok(Some(1.0)),
        "LABELMAP" => Ok(None),
        "FRACTIONAL" => {
            let threshold = f64::from(segmentation.greatest_fraction) * HALF;
            remarks.push(
                Remark::new(format!(
                    "the segmentation is fractional: voxels of at least {threshold} of {} belong \
                     to a segment",
                    segmentation.greatest_fraction
                ))
                .at("(0062,0001)"),
            );
            Ok(Some(threshold))
        }
        other => Err(VolumeError::refused(format!(
            "segmentations of type {other} are not supported"
        ))
        .at("(0062,0001)")
        .hint("export it as BINARY, FRACTIONAL or LABELMAP, or as NIfTI")),
    }
}

fn number_of(slice: &Slice, segmentation: &Segmentation) -> Result<u16, VolumeError> {
    let number = slice.segment.and_then(|number| u16::try_from(number).ok());
    match (number, segmentation.segments.as_slice()) {
        (Some(number), _) if number > 0 => Ok(number),
        (None, [(only, _)]) => Ok(*only),
        _ => Err(
            VolumeError::refused("the segment of the frame is not stated")
                .at(format!("{}, (0062,000B)", shown(slice))),
        ),
    }
}

/// Offsets in the grid of a frame's pixels, row by row.
struct Placing<'a> {
    grid: &'a VoxelGrid,
    first: [i64; 3],
    along_row: [i64; 3],
    down_column: [i64; 3],
    columns: i64,
    at: i64,
}

impl<'a> Placing<'a> {
    fn of(slice: &Slice, grid: &'a VoxelGrid) -> Result<Self, VolumeError> {
        let plane = slice.plane.clone()?;
        let first_m = nalgebra::Point3::from(plane.position_mm / 1e3);
        let step_i = plane.along_row * plane.spacing_mm[1] / 1e3;
        let step_j = plane.down_column * plane.spacing_mm[0] / 1e3;
        let whole = |point: &nalgebra::Point3<f64>| -> [i64; 3] {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "saturates, and is far outside then"
            )]
            let index = [0, 1, 2].map(|axis| grid.index_from_ct(point)[axis].round() as i64);
            index
        };
        let columns = i64::from(slice.file.columns);
        let rows = i64::from(slice.file.rows);
        let first = whole(&first_m);
        let minus =
            |a: [i64; 3], b: [i64; 3]| [0, 1, 2].map(|axis| a[axis].saturating_sub(b[axis]));
        let placing = Self {
            grid,
            first,
            along_row: minus(whole(&(first_m + step_i)), first),
            down_column: minus(whole(&(first_m + step_j)), first),
            columns,
            at: 0,
        };
        for (i, j) in [
            (0, 0),
            (columns - 1, 0),
            (0, rows - 1),
            (columns - 1, rows - 1),
        ] {
            let pixel_m = first_m + step_i * i as f64 + step_j * j as f64;
            let voxel = placing.voxel(i, j);
            let center =
                nalgebra::Point3::from(nalgebra::Vector3::from(voxel.map(|each| each as f64)));
            let apart_m = (grid.ct_from_index(&center) - pixel_m).norm();
            let is_inside = (0..3).all(|axis| {
                usize::try_from(voxel[axis]).is_ok_and(|index| index < grid.size()[axis])
            });
            if apart_m > SAME_PLACE_M || !is_inside {
                return Err(VolumeError::refused(format!(
                    "a corner of the segmentation is {:.3} mm from the CT's nearest voxel{}: it \
                     belongs to another volume",
                    apart_m * 1e3,
                    if is_inside {
                        ""
                    } else {
                        ", and outside the CT"
                    }
                ))
                .hint("export the segmentation in the geometry of the CT"));
            }
        }
        Ok(placing)
    }

    fn voxel(&self, i: i64, j: i64) -> [i64; 3] {
        [0, 1, 2].map(|axis| {
            self.first[axis]
                .saturating_add(self.along_row[axis].saturating_mul(i))
                .saturating_add(self.down_column[axis].saturating_mul(j))
        })
    }

    fn next(&mut self) -> Option<usize> {
        let voxel = self.voxel(self.at % self.columns, self.at / self.columns);
        self.at += 1;
        let index = voxel.map(|each| usize::try_from(each).unwrap_or(usize::MAX));
        (0..3)
            .all(|axis| index[axis] < self.grid.size()[axis])
            .then(|| self.grid.offset(index))
    }
}

/// Calls `take` with each pixel of a frame.
fn read_frame(
    slice: &Slice,
    options: &ReadOptions,
    last: &mut LastFile,
    buffer: &mut Vec<u8>,
    mut take: impl FnMut(u16),
) -> Result<(), VolumeError> {
    if slice.file.is_bits() {
        return pixels::bits(slice, options, last, buffer, take);
    }
    pixels::check(std::slice::from_ref(slice))?;
    let stored = pixels::stored_frame(slice, options, last, buffer)?;
    if !matches!(
        stored,
        Stored {
            kind: Kind::U8 | Kind::U16,
            ..
        }
    ) {
        return Err(named(
            VolumeError::refused("labels are unsigned numbers of 8 or 16 bits, or single bits"),
            &slice.file.name,
        ));
    }
    stored.each(buffer, |number| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "16 bits at most"
        )]
        take(number as u16);
    });
    Ok(())
}
