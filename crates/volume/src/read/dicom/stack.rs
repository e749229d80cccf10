//! Slices put in order by where they are: positions and orientation alone say it.
//!
//! `SliceThickness`, `SpacingBetweenSlices`, `SliceLocation`, `InstanceNumber` and file names say nothing here: they are
//! wrong too often.

use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Vector3};

use super::image::{Plane, Slice};
use crate::{Remark, VolumeError, VoxelGrid};

/// Slices this close are at the same place.
const SAME_PLACE_MM: f64 = 1e-3;

/// Deviation of positions from even steps that is rounding: unremarked; and the most of it, where positions are
/// written with one decimal, and both ends of the line with them. Never more than a tenth of a step.
const UNREMARKED_MM: f64 = 0.01;
const ROUNDED_MM: f64 = 0.101;
const ROUNDED_SHARE: f64 = 0.1;

/// Deviation from a line along which slices may be stacked.
const ASIDE_MM: f64 = 0.1;

/// Distances within this share of a multiple of the usual one are one or more missing slices.
const MULTIPLE: f64 = 0.1;

/// With more gaps than this share the distances vary, rather than slices being missing.
const FEW_GAPS: f64 = 0.2;

/// Times the usual distance, beyond which there is nothing to interpolate between.
const HOLE: f64 = 3.0;

/// Slices in order, and the grid that they make.
#[derive(Debug)]
pub(super) struct Stack {
    pub(super) grid: VoxelGrid,
    pub(super) slices: Vec<Slice>,
    /// Of each slice of the grid.
    pub(super) sources: Vec<Source>,
    pub(super) remarks: Vec<Remark>,
}

/// From which a slice of the grid is made: one of the slices, or the mean of it and the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Source {
    pub(super) first: usize,
    /// Of the next one.
    pub(super) weight: f64,
}

impl Source {
    fn just(first: usize) -> Self {
        Self { first, weight: 0.0 }
    }
}

/// The plane that all slices lie in or along.
pub(super) fn plane_of(slices: &[Slice]) -> Result<&Plane, VolumeError> {
    for slice in slices {
        if let Err(problem) = &slice.plane {
            return Err(problem.clone());
        }
    }
    slices
        .first()
        .and_then(|slice| slice.plane.as_ref().ok())
        .ok_or_else(|| VolumeError::refused("there are no slices"))
}

/// How far each slice is along the normal, in mm.
fn heights_mm(slices: &[Slice], normal: &Vector3<f64>) -> Vec<f64> {
    let height = |slice: &Slice| {
        let plane = slice.plane.as_ref().ok();
        plane.map_or(0.0, |plane| normal.dot(&plane.position_mm))
    };
    slices.iter().map(height).collect()
}

/// Puts slices in order of their height.
pub(super) fn in_order(mut slices: Vec<Slice>) -> Result<Vec<Slice>, VolumeError> {
    let plane = plane_of(&slices)?;
    let normal = plane.along_row.cross(&plane.down_column);
    let heights = heights_mm(&slices, &normal);
    let mut order: Vec<usize> = (0..slices.len()).collect();
    order.sort_by(|a, b| {
        let name = |at: &usize| (&slices[*at].file.name, slices[*at].frame);
        heights[*a]
            .total_cmp(&heights[*b])
            .then_with(|| name(a).cmp(&name(b)))
    });
    let mut taken: Vec<Option<Slice>> = slices.drain(..).map(Some).collect();
    Ok(order
        .into_iter()
        .filter_map(|at| taken[at].take())
        .collect())
}

/// Neighbours at the same place, in slices that are in order.
pub(super) fn duplicates(slices: &[Slice]) -> Vec<(usize, usize)> {
    let Ok(plane) = plane_of(slices) else {
        return Vec::new();
    };
    let heights = heights_mm(slices, &plane.along_row.cross(&plane.down_column));
    (1..slices.len())
        .filter(|at| heights[*at] - heights[*at - 1] <= SAME_PLACE_MM)
        .map(|at| (at - 1, at))
        .collect()
}

/// Whether slices that are in order are as far apart everywhere, as far as rounding leaves them so.
pub(super) fn are_even(slices: &[Slice]) -> bool {
    let Ok(plane) = plane_of(slices) else {
        return false;
    };
    let heights = heights_mm(slices, &plane.along_row.cross(&plane.down_column));
    let gaps = heights.windows(2).map(|pair| pair[1] - pair[0]);
    let least = gaps.clone().fold(f64::INFINITY, f64::min);
    let greatest = gaps.fold(0.0, f64::max);
    greatest - least <= (2.0 * ROUNDED_MM).min(ROUNDED_SHARE * greatest)
}

/// Whether slices of one group lie among those of another one. Those of each are in order.
pub(super) fn are_interleaved(groups: &[Vec<Slice>]) -> bool {
    let Some(plane) = groups.first().and_then(|group| plane_of(group).ok()) else {
        return false;
    };
    let normal = plane.along_row.cross(&plane.down_column);
    let mut ranges: Vec<[f64; 2]> = groups
        .iter()
        .map(|group| heights_mm(group, &normal))
        .filter_map(|heights| Some([*heights.first()?, *heights.last()?]))
        .collect();
    ranges.sort_by(|a, b| a[0].total_cmp(&b[0]));
    ranges.windows(2).any(|pair| pair[1][0] < pair[0][1])
}

/// The grid of slices that are in order.
pub(super) fn stack(slices: Vec<Slice>, fill_gaps: bool) -> Result<Stack, VolumeError> {
    let plane = plane_of(&slices)?.clone();
    let normal = plane.along_row.cross(&plane.down_column);
    let heights = heights_mm(&slices, &normal);
    if let Some((a, b)) = duplicates(&slices).first() {
        return Err(same_place(&slices[*a], &slices[*b], heights[*a]));
    }
    let mut remarks = Vec::new();
    if slices.len() == 1 {
        return single(slices, &plane, &normal);
    }
    let last = heights.len() - 1;
    let [first_position, last_position] = [0, last].map(|at| {
        slices[at]
            .plane
            .as_ref()
            .map_or_else(|_| Vector3::zeros(), |plane| plane.position_mm)
    });
    // Along which slices are stacked, for a mm along the normal: leans where the gantry was tilted.
    let along = (last_position - first_position) / (heights[last] - heights[0]);
    check_line(&slices, &heights, &along)?;
    let steps = steps(&slices, &heights, fill_gaps, &mut remarks)?;
    let size = [
        usize::from(slices[0].file.columns),
        usize::from(slices[0].file.rows),
        steps.sources.len(),
    ];
    Ok(Stack {
        grid: grid(&plane, along * steps.step_mm, size)?,
        slices,
        sources: steps.sources,
        remarks,
    })
}

fn grid(plane: &Plane, step_mm: Vector3<f64>, size: [usize; 3]) -> Result<VoxelGrid, VolumeError> {
    let steps_mm = Matrix3::from_columns(&[
        plane.along_row * plane.spacing_mm[1],
        plane.down_column * plane.spacing_mm[0],
        step_mm,
    ]);
    VoxelGrid::new(size, steps_mm / 1e3, Point3::from(plane.position_mm / 1e3)).map_err(|problem| {
        VolumeError::refused(problem.to_string())
            .at("(0020,0032), (0020,0037)")
            .hint("export the series again")
    })
}

fn same_place(a: &Slice, b: &Slice, height_mm: f64) -> VolumeError {
    if Arc::ptr_eq(&a.file, &b.file) {
        let why = if a.file.has_frame_groups {
            "they are of several phases, or of bolus tracking"
        } else {
            "no frame has a position of its own"
        };
        return VolumeError::refused(format!(
            "frames {} and {} of {} have the same position: {why}",
            a.frame + 1,
            b.frame + 1,
            a.file.frames
        ))
        .at(a.file.name.clone())
        .hint("export one phase as one file for each slice, or as enhanced CT with a position for each frame");
    }
    VolumeError::refused(format!(
        "two slices are at the same position, {height_mm:.3} mm along the slice normal"
    ))
    .at(format!("{}, {}", shown(a), shown(b)))
    .hint("remove one of the two from the folder; phases of one series are told apart by acquisition or time")
}

/// A slice, for people.
fn shown(slice: &Slice) -> String {
    if slice.file.frames > 1 {
        format!("{} frame {}", slice.file.name, slice.frame + 1)
    } else {
        slice.file.name.clone()
    }
}

/// Slice spacing assumed for a single slice of unknown thickness, where it does not affect anything in the slice.
const ASSUMED_MM: f64 = 1.0;

fn single(slices: Vec<Slice>, plane: &Plane, normal: &Vector3<f64>) -> Result<Stack, VolumeError> {
    let slice = &slices[0];
    let size = [
        usize::from(slice.file.columns),
        usize::from(slice.file.rows),
        1,
    ];
    let message = match slice.thickness_mm {
        Some(mm) => format!(
            "there is one slice, which is no volume (to read a series, name its folder): its thickness, {mm} mm, is \
             used as slice spacing"
        ),
        None => format!(
            "there is one slice of unknown thickness, which is no volume (to read a series, name its folder): a slice \
             spacing of {ASSUMED_MM} mm is assumed"
        ),
    };
    let step_mm = slice.thickness_mm.unwrap_or(ASSUMED_MM);
    Ok(Stack {
        grid: grid(plane, normal * step_mm, size)?,
        remarks: vec![Remark::new(message)],
        slices,
        sources: vec![Source::just(0)],
    })
}

fn check_line(slices: &[Slice], heights: &[f64], along: &Vector3<f64>) -> Result<(), VolumeError> {
    let first = plane_of(slices)?.position_mm;
    for (slice, height) in slices.iter().zip(heights) {
        let expected = first + along * (height - heights[0]);
        let aside_mm = slice
            .plane
            .as_ref()
            .map_or(0.0, |plane| (plane.position_mm - expected).norm());
        if aside_mm > ASIDE_MM {
            return Err(VolumeError::refused(format!(
                "the slice is {aside_mm:.2} mm off the line of the others"
            ))
            .at(shown(slice))
            .hint("slices of two scans may be mixed: use those of one"));
        }
    }
    Ok(())
}

struct Steps {
    step_mm: f64,
    sources: Vec<Source>,
}

/// Even steps through slices that need not be quite even.
fn steps(
    slices: &[Slice],
    heights: &[f64],
    fill_gaps: bool,
    remarks: &mut Vec<Remark>,
) -> Result<Steps, VolumeError> {
    let gaps: Vec<f64> = heights.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = gaps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual_mm = sorted[(sorted.len() - 1) / 2];
    let multiples: Vec<f64> = gaps.iter().map(|gap| (gap / usual_mm).round()).collect();
    let missing = multiples.iter().filter(|multiple| **multiple > 1.0).count();
    let are_multiples = gaps.iter().zip(&multiples).all(|(gap, multiple)| {
        *multiple >= 1.0 && (gap - multiple * usual_mm).abs() <= MULTIPLE * usual_mm
    });
    let sources = if are_multiples
        && missing > 0
        && missing as f64 <= (FEW_GAPS * gaps.len() as f64).max(1.0)
    {
        filled(slices, heights, &multiples, fill_gaps, remarks)?
    } else {
        (0..slices.len()).map(Source::just).collect()
    };
    let places = |source: &Source| {
        let next = heights.get(source.first + 1).copied();
        let height = heights[source.first];
        height + source.weight * (next.unwrap_or(height) - height)
    };
    let step_mm = (heights[heights.len() - 1] - heights[0]) / (sources.len() - 1) as f64;
    let apart_mm = sources
        .iter()
        .enumerate()
        .map(|(at, source)| (places(source) - heights[0] - at as f64 * step_mm).abs())
        .fold(0.0, f64::max);
    if apart_mm <= UNREMARKED_MM {
        return Ok(Steps { step_mm, sources });
    }
    if apart_mm <= ROUNDED_MM.min(ROUNDED_SHARE * step_mm) {
        remarks.push(Remark::new(format!(
            "slice positions deviate by up to {apart_mm:.3} mm from a uniform spacing of \
             {step_mm:.4} mm (rounding): the uniform spacing is used"
        )));
        return Ok(Steps { step_mm, sources });
    }
    resampled(slices, heights, &gaps, usual_mm, remarks)
}

/// With single missing slices between their neighbours.
fn filled(
    slices: &[Slice],
    heights: &[f64],
    multiples: &[f64],
    fill_gaps: bool,
    remarks: &mut Vec<Remark>,
) -> Result<Vec<Source>, VolumeError> {
    let mut sources = Vec::new();
    for (at, multiple) in multiples.iter().enumerate() {
        sources.push(Source::just(at));
        if *multiple <= 1.0 {
            continue;
        }
        let (below, above) = (heights[at], heights[at + 1]);
        let between = format!("{} and {}", shown(&slices[at]), shown(&slices[at + 1]));
        let what = format!(
            "{} missing between {below:.2} and {above:.2} mm (slice {})",
            if *multiple == 2.0 {
                "a slice is".to_owned()
            } else {
                format!("{} slices are", multiple - 1.0)
            },
            sources.len() + 1
        );
        if *multiple > 2.0 || !fill_gaps {
            let hint = if *multiple > 2.0 {
                "export the series again; a gap of more than one slice is not interpolated"
            } else {
                "export the series again, or interpolate the slice with --fill-gaps"
            };
            return Err(VolumeError::refused(what).at(between).hint(hint));
        }
        remarks.push(Remark::new(format!("{what}: interpolated")).at(between));
        sources.push(Source {
            first: at,
            weight: 0.5,
        });
    }
    sources.push(Source::just(multiples.len()));
    Ok(sources)
}

/// Even steps of the least distance, interpolated between slices.
fn resampled(
    slices: &[Slice],
    heights: &[f64],
    gaps: &[f64],
    usual_mm: f64,
    remarks: &mut Vec<Remark>,
) -> Result<Steps, VolumeError> {
    if let Some(at) = gaps.iter().position(|gap| *gap > HOLE * usual_mm) {
        return Err(VolumeError::refused(format!(
            "there is no slice between {:.2} and {:.2} mm, but the slice spacing is {usual_mm:.3} \
             mm elsewhere",
            heights[at],
            heights[at + 1]
        ))
        .at(format!(
            "{} and {}",
            shown(&slices[at]),
            shown(&slices[at + 1])
        ))
        .hint("export the series again"));
    }
    let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = gaps.iter().copied().fold(0.0, f64::max);
    let step_mm = least.max(usual_mm / HOLE);
    let first = heights[0];
    let mut sources = Vec::new();
    let mut at = 0;
    loop {
        let height = first + sources.len() as f64 * step_mm;
        while at + 2 < heights.len() && heights[at + 1] <= height {
            at += 1;
        }
        let weight = (height - heights[at]) / gaps[at];
        if weight > 1.0 + 1e-6 {
            break;
        }
        sources.push(Source {
            first: at,
            weight: weight.clamp(0.0, 1.0),
        });
    }
    remarks.push(Remark::new(format!(
        "slice spacing of {least:.3} to {greatest:.3} mm: interpolated to a uniform {step_mm:.3} \
         mm"
    )));
    Ok(Steps { step_mm, sources })
}
