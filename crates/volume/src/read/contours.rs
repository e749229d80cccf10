//! Closed planar contours made into voxels: those whose centres are inside.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use crate::{VolumeError, VoxelGrid};

/// From a plane up to which points are in it, as a share of the distance of slices, and in m: files round to 0.01 mm.
const FLAT: f64 = 0.05;
const FLAT_M: f64 = 5e-5;

/// Distance of contours, in slices, that are of different planes.
const SAME_PLANE: f64 = 0.02;

/// Distance of planes, in slices, from which contours are on every second slice or on fewer.
const SPARSE: f64 = 1.5;

/// Most distance of planes of one piece, m: those farther apart are different pieces.
const MOST_STEP_M: f64 = 0.0101;

/// Rounding of places, in slices.
const ROUNDING: f64 = 1e-3;

/// What is worth knowing of the contours of one structure.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ContourFacts {
    /// From contours to the slices that they are used in, at most, m; 0 where they lie in them.
    pub(super) off_slice_m: f64,
    /// Contours outside of the volume.
    pub(super) outside: usize,
    /// Slices without a contour of their own that have the nearest one.
    pub(super) filled: usize,
    /// Slices without a contour between those that have one.
    pub(super) gaps: usize,
    /// Contours that were there before, wherever they begin and whichever way they run.
    pub(super) repeated: usize,
}

/// A contour in indices of the grid.
struct Contour {
    points: Vec<[f64; 3]>,
    /// Along the axis that its plane is across.
    at: f64,
}

/// Calls `paint` with the offset of each voxel whose centre is inside: within one plane by the even-odd rule, so that
/// an inner contour is a hole. Planes that are nearest to the same slice are united. Where planes are usually farther
/// apart than slices, each slice within half of that distance has the nearest one.
///
/// # Errors
/// Contours that lie across the slices.
pub(super) fn rasterise(
    contours: &[Vec<Point3<f64>>],
    grid: &VoxelGrid,
    mut paint: impl FnMut(usize),
) -> Result<ContourFacts, VolumeError> {
    let mut facts = ContourFacts::default();
    let in_grid = |contour: &Vec<Point3<f64>>| -> Vec<[f64; 3]> {
        let points = contour.iter();
        points
            .map(|point| grid.index_from_ct(point).coords.into())
            .collect()
    };
    let contours: Vec<Vec<[f64; 3]>> = contours.iter().map(in_grid).collect();
    let across = axis_across(&contours, grid)?;
    let spacing_m = grid.spacing_m()[across];
    let mut seen = BTreeSet::new();
    let mut planes = Vec::new();
    for points in contours {
        if !seen.insert(round_trip(&points)) {
            facts.repeated += 1;
            continue;
        }
        let sum: f64 = points.iter().map(|point| point[across]).sum();
        let at = sum / points.len() as f64;
        planes.push(Contour { points, at });
    }
    planes.sort_by(|a, b| a.at.total_cmp(&b.at));
    let planes: Vec<&[Contour]> = planes.chunk_by(|a, b| b.at - a.at <= SAME_PLANE).collect();
    let reach = usual_step(&planes, spacing_m).map_or(0.0, |step| step / 2.0 + ROUNDING);
    let mut slices = BTreeSet::new();
    // Slice and distance from it, of those between planes: the nearest counts.
    let mut between = BTreeMap::new();
    for (number, plane) in planes.iter().enumerate() {
        let at = plane[0].at;
        let Some(slice) = whole(at.round()).filter(|&slice| slice < grid.size()[across]) else {
            facts.outside += plane.len();
            continue;
        };
        slices.insert(slice);
        let off_m = (at - slice as f64).abs() * spacing_m;
        if off_m > flat_m(spacing_m) {
            facts.off_slice_m = facts.off_slice_m.max(off_m);
        }
        fill(plane, grid, across, slice, &mut paint);
        if reach > 0.0 {
            let first = up_to(at - reach, grid.size()[across]);
            let end = up_to(at + reach, grid.size()[across]);
            for slice in first..end {
                let off = (at - slice as f64).abs();
                let nearest = between.entry(slice).or_insert((off, number));
                // Of two that are equally near, the first.
                if off < nearest.0 - ROUNDING {
                    *nearest = (off, number);
                }
            }
        }
    }
    between.retain(|slice, _| !slices.contains(slice));
    facts.filled = between.len();
    for (slice, (_, number)) in between {
        slices.insert(slice);
        fill(planes[number], grid, across, slice, &mut paint);
    }
    if let (Some(first), Some(last)) = (slices.first(), slices.last()) {
        facts.gaps = last - first + 1 - slices.len();
    }
    Ok(facts)
}

/// The points of a closed contour, in an order that depends neither on the first one nor on the direction.
fn round_trip(points: &[[f64; 3]]) -> Vec<[u64; 3]> {
    // One zero, not two.
    let bits = |point: &[f64; 3]| point.map(|at| (at + 0.0).to_bits());
    let mut there: Vec<[u64; 3]> = points.iter().map(bits).collect();
    there.dedup();
    while there.len() > 1 && there.first() == there.last() {
        there.pop();
    }
    let mut back = there.clone();
    back.reverse();
    for way in [&mut there, &mut back] {
        let first = least_rotation(way);
        way.rotate_left(first);
    }
    there.min(back)
}

/// Where the rotation begins that comes first in order; of long ones, too, in time that grows with their length alone.
fn least_rotation<T: Ord>(items: &[T]) -> usize {
    let count = items.len();
    let (mut a, mut b, mut same) = (0, 1, 0);
    while a < count && b < count && same < count {
        match items[(a + same) % count].cmp(&items[(b + same) % count]) {
            Ordering::Equal => {
                same += 1;
                continue;
            }
            Ordering::Greater => a += same + 1,
            Ordering::Less => b += same + 1,
        }
        if a == b {
            b += 1;
        }
        same = 0;
    }
    a.min(b)
}

/// The usual distance of planes, in slices, where it is more than that of slices: contours were drawn, or kept, on some
/// slices alone.
fn usual_step(planes: &[&[Contour]], spacing_m: f64) -> Option<f64> {
    let mut steps: Vec<f64> = planes
        .windows(2)
        .map(|pair| pair[1][0].at - pair[0][0].at)
        .collect();
    steps.sort_by(f64::total_cmp);
    let usual = *steps.get(steps.len().checked_sub(1)? / 2)?;
    (usual > SPARSE && usual * spacing_m <= MOST_STEP_M).then_some(usual)
}

fn flat_m(spacing_m: f64) -> f64 {
    FLAT_M.max(FLAT * spacing_m)
}

/// The axis of the grid that all contours are across: mostly that of the slices.
fn axis_across(contours: &[Vec<[f64; 3]>], grid: &VoxelGrid) -> Result<usize, VolumeError> {
    let widest = |axis: usize| {
        let width = |contour: &Vec<[f64; 3]>| {
            let along = contour.iter().map(|point| point[axis]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
            high - low
        };
        contours.iter().map(width).fold(0.0, f64::max)
    };
    let is_across = |axis: &usize| {
        let spacing_m = grid.spacing_m()[*axis];
        widest(*axis) * spacing_m <= flat_m(spacing_m)
    };
    [2, 0, 1].into_iter().find(is_across).ok_or_else(|| {
        VolumeError::refused(format!(
            "its contours are oblique to the slices: one spans {:.1} of them",
            widest(2)
        ))
        .hint(
            "draw it on the slices of the scan, or export it as a label map (3D Slicer: .seg.nrrd)",
        )
    })
}

/// Paints the voxels of a slice that are inside of the contours of a plane.
fn fill(
    plane: &[Contour],
    grid: &VoxelGrid,
    across: usize,
    slice: usize,
    paint: &mut impl FnMut(usize),
) {
    let [u, v] = match across {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    };
    let [columns, rows] = [grid.size()[u], grid.size()[v]];
    // Of each row: where inside becomes outside, and the other way round.
    let mut turns = vec![false; (columns + 1) * rows];
    for Contour { points, .. } in plane {
        let before = points.last().into_iter().chain(points);
        for (a, b) in before.zip(points) {
            // The same both ways, so that the two sides of a keyhole's slit are one.
            let [low, high] = if a[v] <= b[v] { [a, b] } else { [b, a] };
            let first = up_to(low[v], rows);
            let end = up_to(high[v], rows);
            for row in first..end {
                let share = (row as f64 - low[v]) / (high[v] - low[v]);
                let column = up_to(low[u] + share * (high[u] - low[u]), columns);
                turns[row * (columns + 1) + column] ^= true;
            }
        }
    }
    let mut index = [0; 3];
    index[across] = slice;
    for (row, turns) in turns.chunks_exact(columns + 1).enumerate() {
        index[v] = row;
        let mut is_inside = false;
        for (column, turns) in turns[..columns].iter().enumerate() {
            is_inside ^= turns;
            if is_inside {
                index[u] = column;
                paint(grid.offset(index));
            }
        }
    }
}

/// The first whole number from here on, as an index from 0 to `most`.
fn up_to(at: f64, most: usize) -> usize {
    whole(at.ceil().max(0.0)).unwrap_or(most).min(most)
}

/// A number without fraction as an index; none below 0 and far outside.
fn whole(at: f64) -> Option<usize> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked"
    )]
    (0.0..4e9).contains(&at).then_some(at as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> VoxelGrid {
        VoxelGrid::aligned([8, 6, 5], [1e-3, 2e-3, 4e-3], Point3::new(-0.01, 0.02, 0.0)).unwrap()
    }

    /// At these indices of a slice.
    fn contour(points: &[[f64; 2]], slice: f64) -> Vec<Point3<f64>> {
        let place =
            |point: &[f64; 2]| grid().ct_from_index(&Point3::new(point[0], point[1], slice));
        points.iter().map(place).collect()
    }

    fn square(from: f64, to: f64) -> [[f64; 2]; 4] {
        [[from, from], [to, from], [to, to], [from, to]]
    }

    /// Offsets, and the facts.
    fn inside(contours: &[Vec<Point3<f64>>]) -> (Vec<usize>, ContourFacts) {
        let mut all = Vec::new();
        let facts = rasterise(contours, &grid(), |offset| all.push(offset)).unwrap();
        all.sort_unstable();
        (all, facts)
    }

    fn offsets(slice: usize, voxels: impl IntoIterator<Item = [usize; 2]>) -> Vec<usize> {
        let mut all: Vec<usize> = voxels
            .into_iter()
            .map(|[i, j]| grid().offset([i, j, slice]))
            .collect();
        all.sort_unstable();
        all
    }

    fn block(from: usize, to: usize) -> Vec<[usize; 2]> {
        (from..to)
            .flat_map(|i| (from..to).map(move |j| [i, j]))
            .collect()
    }

    #[test]
    fn voxels_are_inside_by_their_centres() {
        let (all, facts) = inside(&[contour(&square(0.6, 3.4), 1.0)]);
        assert_eq!(all, offsets(1, block(1, 4)));
        assert_eq!(facts, ContourFacts::default());
        // On an edge: of two squares that share it, one has the centre.
        let part = |from: f64, to: f64| {
            let corners = [[from, -0.5], [to, -0.5], [to, 2.5], [from, 2.5]];
            inside(&[contour(&corners, 1.0)]).0
        };
        let (left, right) = (part(-0.5, 3.0), part(3.0, 5.5));
        assert_eq!(left.len() + right.len(), 18);
        assert!(left.iter().all(|offset| !right.contains(offset)));
    }

    #[test]
    fn holes_are_inner_contours_and_keyholes() {
        let ring: Vec<[usize; 2]> = block(0, 5)
            .into_iter()
            .filter(|it| !block(2, 3).contains(it))
            .collect();
        let inner = contour(&square(1.5, 2.5), 2.0);
        let (all, _) = inside(&[contour(&square(-0.5, 4.5), 2.0), inner]);
        assert_eq!(all, offsets(2, ring.iter().copied()));
        // In by a slit through centres of voxels, and out by the same.
        let mut keyhole = square(-0.5, 4.5).to_vec();
        keyhole.push([-0.5, -0.5]);
        keyhole.extend([[1.5, 1.5], [1.5, 2.5], [2.5, 2.5], [2.5, 1.5], [1.5, 1.5]]);
        let (all, _) = inside(&[contour(&keyhole, 2.0)]);
        assert_eq!(all, offsets(2, ring));
    }

    #[test]
    fn what_does_not_fit_the_slices_is_counted() {
        let near = contour(&square(0.6, 3.4), 1.3);
        let far = contour(&square(3.6, 5.4), 0.9);
        let again = near.clone();
        let (all, facts) = inside(&[
            near,
            far,
            again,
            contour(&square(0.6, 1.4), 4.0),
            contour(&square(0.6, 1.4), 7.0),
        ]);
        let both = block(1, 4).into_iter().chain(block(4, 6));
        let mut wanted = offsets(1, both);
        wanted.extend(offsets(4, [[1, 1]]));
        assert_eq!(all, wanted);
        assert!((facts.off_slice_m - 1.2e-3).abs() < 1e-9, "{facts:?}");
        assert_eq!((facts.outside, facts.gaps, facts.repeated), (1, 2, 1));
    }

    #[test]
    fn slices_between_sparse_contours_have_the_nearest_one() {
        // 4 mm apart: every second one, of 8 mm.
        let (all, facts) = inside(&[
            contour(&square(0.6, 3.4), 1.0),
            contour(&square(3.6, 5.4), 3.0),
        ]);
        let mut wanted = Vec::new();
        for slice in 0..3 {
            wanted.extend(offsets(slice, block(1, 4)));
        }
        for slice in 3..5 {
            wanted.extend(offsets(slice, block(4, 6)));
        }
        assert_eq!(all, wanted);
        assert_eq!((facts.filled, facts.gaps), (3, 0), "{facts:?}");
        // On every slice but one, or as far apart as different pieces, they are as they are.
        for heights in [&[0.0, 1.0, 3.0][..], &[0.0, 3.0]] {
            let contours = heights.iter().map(|&at| contour(&square(0.6, 3.4), at));
            let (all, facts) = inside(&contours.collect::<Vec<_>>());
            assert_eq!(all.len(), 9 * heights.len());
            assert_eq!((facts.filled, facts.gaps), (0, 4 - heights.len()));
        }
    }

    #[test]
    fn the_same_contour_from_another_start_or_the_other_way_is_a_repeat() {
        let corners = square(0.6, 3.4);
        let plain = contour(&corners, 1.0);
        for turn in 0..4 {
            let mut again = plain.clone();
            again.rotate_left(turn);
            let mut back = again.clone();
            back.reverse();
            // With the first point at the end, too.
            let mut closed = again.clone();
            closed.push(again[0]);
            let (all, facts) = inside(&[plain.clone(), again, back, closed]);
            assert_eq!(all, offsets(1, block(1, 4)));
            assert_eq!(facts.repeated, 3);
        }
        let other = contour(&square(0.7, 2.4), 1.0);
        assert_eq!(inside(&[plain, other]).1.repeated, 0);
    }

    #[test]
    fn the_least_rotation_is_found() {
        for text in [
            "a", "ba", "abab", "bbab", "cabcab", "aaaab", "bababa", "zzzz",
        ] {
            let letters = text.as_bytes();
            let rotated = |first: usize| [&letters[first..], &letters[..first]].concat();
            let wanted = (0..letters.len()).map(rotated).min();
            assert_eq!(Some(rotated(least_rotation(letters))), wanted, "{text}");
        }
    }

    #[test]
    fn contours_may_be_across_any_axis_and_not_oblique() {
        let place = |j, k| grid().ct_from_index(&Point3::new(3.0, j, k));
        let sagittal = vec![
            place(0.6, 0.6),
            place(3.4, 0.6),
            place(3.4, 3.4),
            place(0.6, 3.4),
        ];
        let (all, _) = inside(&[sagittal]);
        let mut wanted: Vec<usize> = (1..4)
            .flat_map(|k| (1..4).map(move |j| grid().offset([3, j, k])))
            .collect();
        wanted.sort_unstable();
        assert_eq!(all, wanted);
        let mut oblique = contour(&square(0.6, 3.4), 1.0);
        for point in &mut oblique {
            point.z += 0.5 * point.x;
        }
        let error = rasterise(&[oblique], &grid(), |_| {}).unwrap_err();
        assert!(error.to_string().contains("oblique"), "{error}");
    }
}
