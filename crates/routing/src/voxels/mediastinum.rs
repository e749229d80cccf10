//! The space between the lungs, which no label map has to name.

use needlebench_imaging::IndexBox;
use needlebench_volume::LabelMap;

use super::classes::{Classes, Kind};

/// How far behind the front of the spine the space reaches, m: to the middle of a vertebral body, whose depth is 23 to
/// 31 mm (Panjabi et al., Spine 16:888, 1991). The descending aorta lies there; behind it the muscles of the back begin,
/// through which needles go.
const BESIDE_SPINE_M: f64 = 15e-3;

/// Half of the width in which the front of the spine is looked for, m (assumed: a vertebral body is 25 to 40 mm wide).
const SPINE_M: f64 = 10e-3;

/// Columns between the two lungs, row by row, of slices of a box.
pub(super) struct Mediastinum {
    first_slice: usize,
    /// By slice and row: first and last column.
    columns: Vec<Vec<Option<[usize; 2]>>>,
    has_one_lung: bool,
}

impl Mediastinum {
    /// Of a label map along the patient's axes (columns to the left, rows to the back) with a lung; none without.
    ///
    /// In a row of a slice it is what lies between the last voxel of the right lung and the first of the left one. Where
    /// one lung is absent, heart and vessels may be anywhere in its half of the chest: that is in it, to the skin.
    pub fn of(labels: &LabelMap, classes: &Classes, within: &IndexBox) -> Option<Self> {
        let kind = |label: u16| classes.get(classes.of_label(label)).kind;
        // Tables of a byte per label: every voxel is asked.
        let table = |wanted: &dyn Fn(Kind) -> bool| -> Vec<bool> {
            (0..=u16::MAX).map(|label| wanted(kind(label))).collect()
        };
        let has = |table: &[bool]| labels.labels.iter().any(|&label| table[usize::from(label)]);
        let [is_right, is_left] = ["lung_right", "lung_left"].map(|name| {
            let lung = classes.lung_called(name).map(Kind::Lung)?;
            Some(table(&|kind| kind == lung)).filter(|table| has(table))
        });
        let is_bone = table(&|kind| kind == Kind::Bone);
        let [nx, ny, _] = labels.grid.size();
        let spacing_m = labels.grid.spacing_m();
        let is_body = table(&|kind| !matches!(kind, Kind::Outside | Kind::Beside));
        let lungs = match (is_right, is_left) {
            (Some(is_right), Some(is_left)) => Lungs::Both { is_right, is_left },
            (Some(is_lung), None) => Lungs::Right { is_lung, is_body },
            (None, Some(is_lung)) => Lungs::Left { is_lung, is_body },
            (None, None) => return None,
        };
        let (mut columns, mut fronts) = (Vec::new(), Vec::new());
        for k in within.first[2]..=within.last[2] {
            let slice = &labels.labels[k * nx * ny..(k + 1) * nx * ny];
            let rows: Vec<Option<[usize; 2]>> = slice
                .chunks_exact(nx)
                .map(|row| lungs.between(row))
                .collect();
            let bone = |i: usize, j: usize| is_bone[usize::from(slice[j * nx + i])];
            fronts.push(front_of_spine(&rows, bone, SPINE_M / spacing_m[0], nx));
            columns.push(rows);
        }
        let known: Vec<(usize, usize)> = fronts
            .iter()
            .enumerate()
            .filter_map(|(slice, front)| Some((slice, (*front)?)))
            .collect();
        for (slice, rows) in columns.iter_mut().enumerate() {
            let nearest = known.iter().min_by_key(|(other, _)| other.abs_diff(slice));
            let Some((_, front)) = nearest else { continue };
            let last_m = *front as f64 * spacing_m[1] + BESIDE_SPINE_M;
            for (j, row) in rows.iter_mut().enumerate() {
                if j as f64 * spacing_m[1] > last_m {
                    *row = None;
                }
            }
        }
        Some(Self {
            first_slice: within.first[2],
            columns,
            has_one_lung: !matches!(lungs, Lungs::Both { .. }),
        })
    }

    /// Whether one lung is absent, and its half of the chest is part of it.
    pub fn has_one_lung(&self) -> bool {
        self.has_one_lung
    }

    /// First and last column of a row of a slice of the box that are in it.
    pub fn columns(&self, j: usize, k: usize) -> Option<[usize; 2]> {
        self.columns[k - self.first_slice][j]
    }

    /// Whether a voxel of the box is in it.
    pub fn contains(&self, [i, j, k]: [usize; 3]) -> bool {
        let columns = self.columns(j, k);
        columns.is_some_and(|[first, last]| (first..=last).contains(&i))
    }
}

/// The lungs of a map, by label, and where only one is, what is of the body.
enum Lungs {
    Both {
        is_right: Vec<bool>,
        is_left: Vec<bool>,
    },
    Right {
        is_lung: Vec<bool>,
        is_body: Vec<bool>,
    },
    Left {
        is_lung: Vec<bool>,
        is_body: Vec<bool>,
    },
}

impl Lungs {
    /// First and last column of what is between them in a row; where one is absent, from the other one's side of the
    /// chest to the skin: a lung may reach over to the other side, with the heart between its parts.
    fn between(&self, row: &[u16]) -> Option<[usize; 2]> {
        match self {
            Self::Both { is_right, is_left } => {
                let last = last_in(row, is_right)?;
                let next = first_in(row, is_left)?;
                (last + 1 < next).then(|| [last + 1, next - 1])
            }
            Self::Right { is_lung, is_body } => {
                Some([first_in(row, is_lung)?, last_in(row, is_body)?])
            }
            Self::Left { is_lung, is_body } => {
                Some([first_in(row, is_body)?, last_in(row, is_lung)?])
            }
        }
    }
}

fn first_in(row: &[u16], wanted: &[bool]) -> Option<usize> {
    row.iter().position(|&label| wanted[usize::from(label)])
}

fn last_in(row: &[u16], wanted: &[bool]) -> Option<usize> {
    row.iter().rposition(|&label| wanted[usize::from(label)])
}

/// The mean column of the body.
pub(super) fn middle_of_body(labels: &LabelMap, classes: &Classes) -> Option<usize> {
    let is_body: Vec<bool> = (0..=u16::MAX)
        .map(|label| {
            let kind = classes.get(classes.of_label(label)).kind;
            !matches!(kind, Kind::Outside | Kind::Beside)
        })
        .collect();
    let [nx, _, _] = labels.grid.size();
    let (mut sum, mut count) = (0.0, 0.0);
    for row in labels.labels.chunks_exact(nx) {
        if let (Some(first), Some(last)) = (first_in(row, &is_body), last_in(row, &is_body)) {
            let width = (last - first + 1) as f64;
            sum += 0.5 * (first + last) as f64 * width;
            count += width;
        }
    }
    (count > 0.0).then(|| super::steps(sum / count))
}

/// The row where bone begins behind the middle of the space, in the median of the columns there; none where most have none.
fn front_of_spine(
    rows: &[Option<[usize; 2]>],
    bone: impl Fn(usize, usize) -> bool,
    half_columns: f64,
    nx: usize,
) -> Option<usize> {
    let (mut count, mut across, mut deep) = (0.0, 0.0, 0.0);
    for (j, row) in rows.iter().enumerate() {
        if let Some([first, last]) = row {
            count += 1.0;
            across += 0.5 * (first + last) as f64;
            deep += j as f64;
        }
    }
    if count == 0.0 {
        return None;
    }
    let (middle, from) = (across / count, super::steps(deep / count));
    let first = super::steps((middle - half_columns).max(0.0));
    let last = super::steps(middle + half_columns).min(nx - 1);
    let mut found: Vec<usize> = (first..=last)
        .filter_map(|i| (from..rows.len()).find(|&j| bone(i, j)))
        .collect();
    found.sort_unstable();
    (2 * found.len() > last - first).then(|| found[found.len() / 2])
}
