//! The couch where the field of view does not show it.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use needlebench_volume::Lying;

use crate::mask::Mask;
use crate::spacing::whole;

use super::Scan;
use super::body::Body;

/// Radius of a couch's hollow where too little of it is seen, m (assumed): of those of scanners 0.3 to 0.6 m.
const RADIUS_M: f64 = 0.4;

/// Its curve is taken from what is seen of it if that is at least so wide, m (assumed).
const SEEN_WIDTH_M: f64 = 0.1;

/// No couch is more hollow, m.
const LEAST_RADIUS_M: f64 = 0.25;

/// It is taken to be so thick, m (assumed): where it is seen in part, and where it may also be lower than the patient.
const THICK_M: f64 = 0.03;
const THICK_UNSEEN_M: f64 = 0.1;

/// What a body lies on is seen if the field of view goes on so far below it, m.
const BELOW_M: f64 = 0.05;

/// It ends where the field of view does if it comes so near to that, m.
const END_M: f64 = 8e-3;

/// How a cross-section of a couch runs: the height of its upper side over an axis across it, both in m from the first
/// voxel and towards the patient.
struct Hollow {
    /// Height at the middle, slope, and half of the curvature.
    polynomial: Vector3<f64>,
    middle_m: f64,
}

impl Hollow {
    fn height_m(&self, across_m: f64) -> f64 {
        let x = across_m - self.middle_m;
        self.polynomial.dot(&Vector3::new(1.0, x, x * x))
    }
}

/// Axes of a grid about a patient who lies on something.
struct Axes {
    across: usize,
    upwards: usize,
    /// Whether indices grow upwards.
    rises: bool,
    steps_m: [f64; 2],
}

impl Axes {
    fn of(scan: &Scan<'_>, lying: Lying) -> Self {
        let (across, upwards, sign) = match lying {
            Lying::Supine => (0, 1, -1.0),
            Lying::Prone => (0, 1, 1.0),
            Lying::LeftSide => (1, 0, -1.0),
            Lying::RightSide => (1, 0, 1.0),
        };
        let [across, along] = [across, upwards].map(|axis| scan.axis_along(axis));
        let step = scan.volume.grid.steps_m()[(upwards, along)];
        Self {
            across,
            upwards: along,
            rises: step * sign > 0.0,
            steps_m: [scan.spacing_m[across], scan.spacing_m[along]],
        }
    }

    fn height_m(&self, index: usize) -> f64 {
        let height_m = index as f64 * self.steps_m[1];
        if self.rises { height_m } else { -height_m }
    }

    /// Indices along the second axis between two heights.
    fn indices(&self, [low_m, high_m]: [f64; 2], size: usize) -> std::ops::Range<usize> {
        let [a, b] = if self.rises {
            [low_m, high_m]
        } else {
            [-high_m, -low_m]
        };
        let index = |m: f64| whole((m / self.steps_m[1]).max(0.0)).min(size);
        index(a)..index(b + self.steps_m[1])
    }

    /// The highest voxel of a mask in each column across it, where there is one in any slice: the mean over slices, m.
    fn upper_side_m(&self, mask: &Mask) -> Vec<(usize, f64)> {
        let mut highest = vec![BTreeMap::<usize, f64>::new(); mask.size()[self.across]];
        for voxel in mask.voxels() {
            let height_m = self.height_m(voxel[self.upwards]);
            let of_slice = highest[voxel[self.across]].entry(voxel[2]);
            let so_far = of_slice.or_insert(height_m);
            *so_far = so_far.max(height_m);
        }
        let columns = highest.into_iter().enumerate();
        columns
            .filter(|(_, slices)| !slices.is_empty())
            .map(|(column, slices)| {
                let mean_m = slices.values().sum::<f64>() / slices.len() as f64;
                (column, mean_m)
            })
            .collect()
    }
}

/// What is taken for the couch beyond a field of view that cuts it: its upper side goes on in a parabola through what is
/// seen of it. Where none of it is seen, it is taken to touch the lowest of what is seen of the body.
pub(super) fn beyond(
    scan: &Scan<'_>,
    unseen: &Mask,
    lying: Lying,
    body: &Body,
    couch: Option<&Mask>,
) -> Mask {
    let axes = Axes::of(scan, lying);
    let size = scan.size();
    let mut found = Mask::empty(size);
    let (hollow, [first, last]) = if let Some(couch) = couch {
        let side = axes.upper_side_m(couch);
        let [Some(&(first, _)), Some(&(last, _))] = [side.first(), side.last()] else {
            return found;
        };
        (hollow_of(&axes, &side), [first, last])
    } else {
        if is_seen_below(scan, unseen, &axes, body) {
            return found;
        }
        let middle = whole(body.centroid[axes.across]);
        let hollow = Hollow {
            polynomial: Vector3::new(lowest_m(&axes, body), 0.0, 0.5 / RADIUS_M),
            middle_m: middle as f64 * axes.steps_m[0],
        };
        (hollow, [middle, middle])
    };
    let rows_at = |column: usize, thick_m: f64| {
        let top_m = hollow.height_m(column as f64 * axes.steps_m[0]);
        axes.indices([top_m - thick_m, top_m], size[axes.upwards])
    };
    let voxel_at = |column: usize, row: usize, k: usize| {
        let mut voxel = [0, 0, k];
        (voxel[axes.across], voxel[axes.upwards]) = (column, row);
        voxel
    };
    // Where it ends though the field of view goes on, it ends.
    let reach = whole(END_M / axes.steps_m[0]) + 1;
    let is_cut = |end: usize, k: usize| {
        let beside = if end == first {
            end.saturating_sub(reach)
        } else {
            (end + reach).min(size[axes.across] - 1)
        };
        let mut rows = rows_at(end, 0.0);
        couch.is_none() || rows.is_empty() || rows.any(|row| unseen.get(voxel_at(beside, row, k)))
    };
    let thick_m = couch.map_or(THICK_UNSEEN_M, |_| THICK_M);
    let columns = 0..size[axes.across];
    for column in columns.filter(|&it| it < first || it > last || couch.is_none()) {
        let end = if column < first { first } else { last };
        for k in (0..size[2]).filter(|&k| is_cut(end, k)) {
            let voxels = rows_at(column, thick_m).map(|row| voxel_at(column, row, k));
            voxels
                .filter(|&voxel| unseen.get(voxel))
                .for_each(|voxel| found.insert(voxel));
        }
    }
    found
}

fn lowest_m(axes: &Axes, body: &Body) -> f64 {
    let ends = [body.bounds.first, body.bounds.last];
    let [a, b] = ends.map(|corner| axes.height_m(corner[axes.upwards]));
    a.min(b)
}

/// Whether the field of view shows what a body lies on: there is nothing, then.
fn is_seen_below(scan: &Scan<'_>, unseen: &Mask, axes: &Axes, body: &Body) -> bool {
    let below_m = lowest_m(axes, body) - BELOW_M;
    let size = scan.size();
    let rows = axes.indices([below_m, below_m], size[axes.upwards]);
    let mut voxel = body.bounds.first;
    voxel[axes.across] = whole(body.centroid[axes.across]);
    rows.into_iter().any(|row| {
        voxel[axes.upwards] = row;
        !unseen.get(voxel)
    })
}

/// The parabola by least squares through the upper side, as hollow as couches are.
fn hollow_of(axes: &Axes, side: &[(usize, f64)]) -> Hollow {
    let places = side
        .iter()
        .map(|&(column, m)| (column as f64 * axes.steps_m[0], m));
    let places: Vec<(f64, f64)> = places.collect();
    let count = places.len() as f64;
    let middle_m = places.iter().map(|place| place.0).sum::<f64>() / count;
    let width_m =
        places.last().map_or(0.0, |last| last.0) - places.first().map_or(0.0, |first| first.0);
    let fixed = |curve: f64, slope: f64| {
        let rest = places.iter().map(|(x, y)| {
            let x = x - middle_m;
            y - slope * x - curve * x * x
        });
        Vector3::new(rest.sum::<f64>() / count, slope, curve)
    };
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (x, y) in &places {
        let x = x - middle_m;
        let row = Vector3::new(1.0, x, x * x);
        normal += row * row.transpose();
        right += row * *y;
    }
    let fitted = normal.cholesky().map(|factor| factor.solve(&right));
    let polynomial = match fitted.filter(|_| width_m >= SEEN_WIDTH_M) {
        Some(fitted) => {
            let curve = fitted.z.clamp(0.0, 0.5 / LEAST_RADIUS_M);
            fixed(curve, fitted.y)
        }
        None => fixed(0.5 / RADIUS_M, 0.0),
    };
    Hollow {
        polynomial,
        middle_m,
    }
}
