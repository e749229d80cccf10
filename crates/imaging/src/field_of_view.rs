//! What a scan has seen: the space of its slices, less what a scanner fills around its circle.

use std::collections::BTreeMap;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_geometry::TriangleMesh;
use needlebench_volume::{AIR_HU, Volume, VoxelGrid};

use crate::mask::Mask;
use crate::spacing::whole;

/// Slices that are looked at for padding.
const SLICES: usize = 32;

/// Straight sides that stand for a round field of view: beyond a circle of 500 mm by 0.3 mm at most.
const SIDES: usize = 64;

/// Share of a convex outline that pixels with values fill.
const IS_CONVEX: f64 = 0.985;

/// Least share of the outline that has values in each slice: half where air is clipped to the value of padding.
const IS_FILLED: f64 = 0.4;

/// Values above this are no air, HU.
const DENSE_HU: i16 = -480;

/// Blur around what is dense, pixels: values there are no noise of air.
const BLUR_PIXELS: usize = 4;

/// Share of an outline that is noise of air where it is a field of view and not the outline of a body.
const IS_NOISE: f64 = 0.01;

/// Share of a rim on the circle around it where a scanner cut it, in fine pixels and in others: the tips of an ellipse of
/// 3 by 2 are on it with a fifth, and with a third in pixels of a twentieth of its length.
const IS_ROUND: [f64; 2] = [0.35, 0.5];

/// Pixels are fine where the circle's radius has so many.
const FINE: f64 = 60.0;

/// Share of what is on that circle that is tissue where it was cut: skin that is blurred by half a pixel has half.
const IS_CUT: f64 = 0.9;

/// The same where all of the rim but this is on the circle, as where a couch or a lung is cut, too.
const IS_CUT_ALL_ROUND: f64 = 0.7;
const ALL_ROUND: f64 = 0.9;

/// Steps towards the circle around a rim: its radius to 1 %, mostly to 0.1 %.
const CIRCLE_STEPS: usize = 10_000;

/// Skin so near to a side may be the cut itself, pixels.
const RIM_PIXELS: f64 = 1.5;

/// Voxels whose centres are farther outside than this were not seen, pixels.
const UNSEEN_PIXELS: f64 = 0.25;

/// Skin so near to the centres of the first and last slice, or to a side that cuts it, is not told from the cut, m
/// (assumed).
const END_M: f64 = 5e-3;

/// A plane beyond which skin was not seen, in `ct`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Away from what was seen.
    pub normal: UnitVector3<f64>,
    /// Points `p` with `normal . p` above this are beyond, m.
    pub offset_m: f64,
}

impl Cut {
    fn depth_m(&self, point: &Point3<f64>) -> f64 {
        self.offset_m - self.normal.dot(&point.coords)
    }
}

/// What a scan has seen: a convex region through all slices.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldOfView {
    /// Through the centres of the first and the last slice.
    pub(crate) ends: [Cut; 2],
    /// Through the centres of the outermost voxels.
    pub(crate) sides: Vec<Cut>,
    /// Larger spacing within slices, m.
    pub(crate) pixel_m: f64,
}

impl FieldOfView {
    /// Of a volume with a value for each voxel, whose slices run along the patient
    /// ([`needlebench_volume::in_order`]): all voxels, or those within the convex outline outside which all slices have
    /// padding.
    pub fn of(volume: &Volume) -> Self {
        let grid = &volume.grid;
        let [nx, ny, _] = grid.size();
        let along = |normal: [f64; 3], most: f64| plane(grid, normal, most);
        let [x, y, _] = grid.spacing_m();
        let slices = seen_slices(volume);
        let round = paddings(volume, slices)
            .into_iter()
            .find_map(|padding| Outline::of(volume, slices, padding).sides([x, y]));
        let sides = match round {
            Some(sides) => sides
                .into_iter()
                .map(|([a, b], most)| along([a, b, 0.0], most))
                .collect(),
            None => vec![
                along([-1.0, 0.0, 0.0], 0.0),
                along([1.0, 0.0, 0.0], (nx - 1) as f64),
                along([0.0, -1.0, 0.0], 0.0),
                along([0.0, 1.0, 0.0], (ny - 1) as f64),
            ],
        };
        let [first, last] = slices.map(|slice| slice as f64);
        Self {
            ends: [
                along([0.0, 0.0, -1.0], -first),
                along([0.0, 0.0, 1.0], last),
            ],
            sides,
            pixel_m: x.max(y),
        }
    }

    /// Distance from the nearest side, m, negative beyond it, and its outward normal.
    pub(crate) fn nearest_side(&self, point: &Point3<f64>) -> Option<(f64, UnitVector3<f64>)> {
        let sides = self.sides.iter();
        sides
            .map(|side| (side.depth_m(point), side.normal))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Voxels of a grid outside a round field of view; none if all within the image was seen.
    pub(crate) fn unseen(&self, grid: &VoxelGrid) -> Option<Mask> {
        if self.sides.len() < SIDES {
            return None;
        }
        let [nx, ny, nz] = grid.size();
        let step = grid.steps_m().column(0).into_owned();
        let rim_m = UNSEEN_PIXELS * self.pixel_m;
        let mut seen = Mask::empty([nx, ny, nz]);
        for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
            let first = grid.ct_from_index(&Point3::new(0.0, j as f64, k as f64));
            // A convex region: in a row, from one column to another.
            let (mut from, mut to) = (0.0, (nx - 1) as f64);
            for side in &self.sides {
                let depth_m = side.depth_m(&first) + rim_m;
                let per_column_m = side.normal.dot(&step);
                if per_column_m > 0.0 {
                    to = f64::min(to, depth_m / per_column_m);
                } else if per_column_m < 0.0 {
                    from = f64::max(from, depth_m / per_column_m);
                } else if depth_m < 0.0 {
                    to = -1.0;
                }
            }
            let [from, to] = [from.ceil(), to.floor() + 1.0];
            if from < to {
                seen.insert_run([from, to].map(whole), j, k);
            }
        }
        Some(seen.complement())
    }

    /// Skin so near to a side may be the cut itself, m.
    pub(crate) fn rim_m(&self) -> f64 {
        RIM_PIXELS * self.pixel_m
    }

    /// Planes beyond which a skin was not seen: both ends, and the sides that it reaches.
    pub fn cuts(&self, skin: &TriangleMesh) -> Vec<Cut> {
        let inset = |cut: &Cut, by_m: f64| Cut {
            offset_m: cut.offset_m - by_m,
            ..*cut
        };
        let rim_m = self.rim_m();
        let reaches = |cut: &&Cut| skin.vertices_m.iter().any(|at| cut.depth_m(at) < rim_m);
        let ends = self.ends.iter().map(|end| inset(end, END_M));
        let sides = self.sides.iter().filter(reaches);
        let sides = sides.map(|side| inset(side, rim_m.max(END_M)));
        ends.chain(sides).collect()
    }
}

/// The plane `normal . index = most` of a grid, in `ct`.
fn plane(grid: &VoxelGrid, normal: [f64; 3], most: f64) -> Cut {
    // Along a row of the inverse of the steps: an index grows by 1 over a step, whatever the others do.
    let steps = grid.steps_m();
    let [i, j, k] = [0, 1, 2].map(|axis| steps.column(axis).into_owned());
    let volume = i.dot(&j.cross(&k));
    let rows = [j.cross(&k), k.cross(&i), i.cross(&j)].map(|row| row / volume);
    let normal: Vector3<f64> = (0..3).map(|axis| normal[axis] * rows[axis]).sum();
    let length = normal.norm();
    Cut {
        normal: UnitVector3::new_normalize(normal),
        offset_m: (most + normal.dot(&grid.first_m().coords)) / length,
    }
}

/// First and last slice that has more than one value: one of air or padding alone shows nothing.
fn seen_slices(volume: &Volume) -> [usize; 2] {
    let [nx, ny, nz] = volume.grid.size();
    let is_seen = |k: &usize| {
        let slice = &volume.hu[k * nx * ny..(k + 1) * nx * ny];
        slice[0] > DENSE_HU || slice.iter().any(|&hu| hu != slice[0])
    };
    let first = (0..nz).find(is_seen).unwrap_or(0);
    let last = (0..nz).rev().find(is_seen).unwrap_or(nz - 1);
    [first, last]
}

/// Slices of a range that are looked at.
fn looked_at([first, last]: [usize; 2]) -> impl Iterator<Item = usize> {
    (first..=last).step_by((last - first + 1).div_ceil(SLICES))
}

/// What padding may be: that of readers, and the value that most pixels at the border of the image have, as -1024 HU,
/// which scanners store where they saw nothing.
fn paddings(volume: &Volume, slices: [usize; 2]) -> Vec<i16> {
    let [nx, ny, _] = volume.grid.size();
    let mut counts: BTreeMap<i16, usize> = BTreeMap::new();
    for k in looked_at(slices) {
        let slice = &volume.hu[k * nx * ny..(k + 1) * nx * ny];
        let rows = [0, ny - 1].into_iter();
        let rows = rows.flat_map(|j| slice[j * nx..(j + 1) * nx].iter());
        let columns = (0..ny).flat_map(|j| [&slice[j * nx], &slice[j * nx + nx - 1]]);
        for &hu in rows.chain(columns) {
            *counts.entry(hu).or_default() += 1;
        }
    }
    let usual = counts.into_iter().filter(|(hu, _)| *hu <= DENSE_HU);
    let usual = usual.max_by_key(|(_, count)| *count).map(|(hu, _)| hu);
    let mut found = vec![AIR_HU];
    found.extend(usual.filter(|&hu| hu != AIR_HU));
    found
}

/// Pixels that have another value than padding in any slice.
struct Outline {
    size: [usize; 2],
    has_value: Vec<bool>,
    is_dense: Vec<bool>,
    /// Pixels with a value in the slice that has the fewest.
    fewest: usize,
}

impl Outline {
    fn of(volume: &Volume, slices: [usize; 2], padding: i16) -> Self {
        let [nx, ny, _] = volume.grid.size();
        let slice = |k: usize| &volume.hu[k * nx * ny..(k + 1) * nx * ny];
        let mut made = Self {
            size: [nx, ny],
            has_value: vec![false; nx * ny],
            is_dense: vec![false; nx * ny],
            fewest: nx * ny,
        };
        for k in looked_at(slices) {
            let mut count = 0;
            let pixels = made.has_value.iter_mut().zip(&mut made.is_dense);
            for (&hu, (has_value, is_dense)) in slice(k).iter().zip(pixels) {
                *has_value |= hu != padding;
                *is_dense |= hu > DENSE_HU;
                count += usize::from(hu != padding);
            }
            made.fewest = made.fewest.min(count);
        }
        made
    }

    /// Sides of a field of view that is less than the image: normals in index, scaled to m, and the most along them.
    fn sides(&self, [x, y]: [f64; 2]) -> Option<Vec<([f64; 2], f64)>> {
        let [nx, ny] = self.size;
        let count = self.has_value.iter().filter(|&&has| has).count();
        let is_part = count > 0 && count < nx * ny;
        if !is_part || (self.fewest as f64) < IS_FILLED * count as f64 {
            return None;
        }
        // First and last pixel of each row.
        let rows: Vec<(usize, usize, usize)> = (0..ny)
            .filter_map(|j| {
                let row = &self.has_value[j * nx..(j + 1) * nx];
                let first = row.iter().position(|&has| has)?;
                let last = row.iter().rposition(|&has| has)?;
                Some((j, first, last))
            })
            .collect();
        let sides: Vec<([f64; 2], f64)> = (0..SIDES)
            .map(|side| {
                let angle = std::f64::consts::TAU * side as f64 / SIDES as f64;
                let [a, b] = [x * libm::cos(angle), y * libm::sin(angle)];
                let ends = rows.iter().flat_map(|&(j, first, last)| {
                    [first, last].map(|i| a * i as f64 + b * j as f64)
                });
                ([a, b], ends.fold(f64::NEG_INFINITY, f64::max))
            })
            .collect();
        let rounding = 1e-6 * x.max(y);
        let is_within = |i: usize, j: usize| {
            let mut all = sides.iter();
            all.all(|([a, b], most)| a * i as f64 + b * j as f64 <= most + rounding)
        };
        let within = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j)));
        let within = within.filter(|&(i, j)| is_within(i, j)).count();
        let is_convex = count as f64 >= IS_CONVEX * within as f64;
        (is_convex && self.is_field_of_view(count, [x, y])).then_some(sides)
    }

    /// Whether air has noise within the outline, or a circle cuts tissue: else it is that of a body in air without noise.
    fn is_field_of_view(&self, count: usize, spacing: [f64; 2]) -> bool {
        let [nx, ny] = self.size;
        let is_near_dense = |i: usize, j: usize| {
            let reach = |at: usize, size: usize| {
                at.saturating_sub(BLUR_PIXELS)..=(at + BLUR_PIXELS).min(size - 1)
            };
            reach(j, ny).any(|j| reach(i, nx).any(|i| self.is_dense[j * nx + i]))
        };
        let pixels = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j)));
        let with_value = pixels.filter(|&(i, j)| self.has_value[j * nx + i]);
        let air = with_value.filter(|&(i, j)| !self.is_dense[j * nx + i] && !is_near_dense(i, j));
        air.count() as f64 >= IS_NOISE * count as f64 || self.is_cut_by_circle(spacing)
    }

    /// Whether the rim is tissue on a circle: a sharp outline of another form is that of a body.
    fn is_cut_by_circle(&self, [x, y]: [f64; 2]) -> bool {
        let rim = self.rim();
        let places: Vec<[f64; 2]> = rim
            .iter()
            .map(|&(i, j)| [x * i as f64, y * j as f64])
            .collect();
        let Some(&first) = places.first() else {
            return false;
        };
        // Towards the farthest, by ever less: Badoiu and Clarkson, SODA 2003.
        let squared = |[x, y]: [f64; 2], at: &[f64; 2]| (at[0] - x).powi(2) + (at[1] - y).powi(2);
        let farthest = |centre: [f64; 2]| {
            let all = places.iter();
            all.max_by(|a, b| squared(centre, a).total_cmp(&squared(centre, b)))
        };
        let mut centre = first;
        for step in 0..CIRCLE_STEPS {
            if let Some(far) = farthest(centre) {
                let share = 1.0 / (step + 2) as f64;
                centre = [0, 1].map(|axis| centre[axis] + share * (far[axis] - centre[axis]));
            }
        }
        let radius = farthest(centre).map_or(0.0, |far| squared(centre, far).sqrt());
        let (mut on_circle, mut cut) = (0, 0);
        for (&(i, j), place) in rim.iter().zip(&places) {
            if squared(centre, place).sqrt() >= radius - RIM_PIXELS * x.max(y) {
                on_circle += 1;
                cut += usize::from(self.is_dense[j * self.size[0] + i]);
            }
        }
        let [fine, coarse] = IS_ROUND;
        let is_round = if radius >= FINE * x.max(y) {
            fine
        } else {
            coarse
        };
        let share_on_circle = f64::from(on_circle) / rim.len() as f64;
        let is_cut = if share_on_circle >= ALL_ROUND {
            IS_CUT_ALL_ROUND
        } else {
            IS_CUT
        };
        share_on_circle >= is_round && cut as f64 >= is_cut * f64::from(on_circle)
    }

    /// Pixels with a value beside one without.
    fn rim(&self) -> Vec<(usize, usize)> {
        let [nx, ny] = self.size;
        let is_rim = |&(i, j): &(usize, usize)| {
            let beside = [
                (i > 0).then(|| j * nx + i - 1),
                (i + 1 < nx).then(|| j * nx + i + 1),
                (j > 0).then(|| (j - 1) * nx + i),
                (j + 1 < ny).then(|| (j + 1) * nx + i),
            ];
            self.has_value[j * nx + i] && beside.into_iter().flatten().any(|at| !self.has_value[at])
        };
        let pixels = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j)));
        pixels.filter(is_rim).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 3] = [120, 100, 6];
    const SPACING_M: [f64; 3] = [2e-3, 2e-3, 4e-3];
    /// Off the middle of the image, mm.
    const CENTRE_MM: [f64; 2] = [130.0, 90.0];
    const RADIUS_MM: f64 = 80.0;

    /// A volume by place within the slice, mm, and noise of -20 to 20 HU.
    fn volume(hu: impl Fn([f64; 2], i16) -> i16) -> Volume {
        let [nx, ny, nz] = SIZE;
        let voxels = (0..nx * ny * nz).map(|at| {
            let place = [(at % nx) as f64 * 2.0, (at / nx % ny) as f64 * 2.0];
            let noise = (at.wrapping_mul(2_654_435_761) >> 7) % 41;
            hu(place, i16::try_from(noise).unwrap() - 20)
        });
        Volume {
            hu: voxels.collect(),
            grid: VoxelGrid::aligned(SIZE, SPACING_M, Point3::origin()).unwrap(),
            slice_thickness_m: None,
        }
    }

    fn from_centre_mm([x, y]: [f64; 2]) -> f64 {
        libm::hypot(x - CENTRE_MM[0], y - CENTRE_MM[1])
    }

    /// Least distance of the centre from a side, m.
    fn from_sides_m(seen: &FieldOfView) -> f64 {
        let [x, y] = CENTRE_MM;
        let centre = Point3::new(1e-3 * x, 1e-3 * y, 8e-3);
        seen.nearest_side(&centre).unwrap().0
    }

    #[test]
    fn circle_off_the_middle_is_found_to_a_pixel() {
        let scan = volume(|place, noise| {
            if from_centre_mm(place) > RADIUS_MM {
                AIR_HU
            } else {
                AIR_HU + noise
            }
        });
        let seen = FieldOfView::of(&scan);
        assert_eq!(seen.sides.len(), SIDES);
        let off_m = from_sides_m(&seen) - 1e-3 * RADIUS_MM;
        assert!((-2e-3..=0.0).contains(&off_m), "{off_m}");
        // What scanners store where they saw nothing, beside air with noise and without.
        for noise_of_air in [1, 0] {
            let scan = volume(|place, noise| {
                if from_centre_mm(place) > RADIUS_MM {
                    -1024
                } else {
                    AIR_HU + noise_of_air * noise
                }
            });
            let seen = FieldOfView::of(&scan);
            assert_eq!(seen.sides.len(), SIDES);
            assert_eq!(from_sides_m(&seen) - 1e-3 * RADIUS_MM, off_m);
        }
        // A body that fills the circle, too.
        let scan = volume(|place, _| {
            if from_centre_mm(place) > RADIUS_MM {
                AIR_HU
            } else {
                40
            }
        });
        assert_eq!(FieldOfView::of(&scan).sides.len(), SIDES);
    }

    #[test]
    fn body_in_air_without_noise_that_a_circle_cuts_left_and_right_is_cut() {
        let scan = volume(|place, _| {
            let is_within = from_centre_mm(place) < RADIUS_MM;
            let is_body = (20.0..160.0).contains(&place[1]);
            if is_within && is_body { 40 } else { AIR_HU }
        });
        let seen = FieldOfView::of(&scan);
        assert_eq!(seen.sides.len(), SIDES);
    }

    #[test]
    fn outline_of_a_body_in_air_without_noise_is_no_field_of_view() {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "between air and soft tissue"
        )]
        let scan = volume(|place, _| {
            // Blurred over 6 mm.
            let share = ((RADIUS_MM - from_centre_mm(place)) / 6.0).clamp(0.0, 1.0);
            (-1000.0 + 1040.0 * share) as i16
        });
        assert_eq!(FieldOfView::of(&scan).sides.len(), 4);
        // An ellipse with a sharp rim.
        let scan = volume(|[x, y], _| {
            let [x, y] = [(x - CENTRE_MM[0]) / 90.0, (y - CENTRE_MM[1]) / 60.0];
            if x * x + y * y > 1.0 { AIR_HU } else { 40 }
        });
        assert_eq!(FieldOfView::of(&scan).sides.len(), 4);
        // In coarse pixels.
        let mut scan = volume(|[x, y], _| {
            let [x, y] = [(x - 120.0) / 36.0, (y - 100.0) / 24.0];
            if x * x + y * y > 1.0 { AIR_HU } else { 40 }
        });
        let steps = nalgebra::Matrix3::from_diagonal(&Vector3::new(8e-3, 8e-3, 8e-3));
        scan.grid = VoxelGrid::new(SIZE, steps, Point3::origin()).unwrap();
        assert_eq!(FieldOfView::of(&scan).sides.len(), 4);
        let scan = volume(|_, noise| AIR_HU + noise);
        assert_eq!(FieldOfView::of(&scan).sides.len(), 4);
    }

    #[test]
    fn sides_of_leaning_slices_lean() {
        let mut scan = volume(|_, noise| AIR_HU + noise);
        let steps = nalgebra::Matrix3::new(2e-3, 0.0, 0.0, 0.0, 2e-3, 1e-3, 0.0, 0.0, 4e-3);
        scan.grid = VoxelGrid::new(SIZE, steps, Point3::origin()).unwrap();
        let seen = FieldOfView::of(&scan);
        // Voxels in the middle of a side, of the first and the last slice, are on it.
        for k in [0.0, 5.0] {
            let place = scan.grid.ct_from_index(&Point3::new(60.0, 99.0, k));
            let (depth_m, normal) = seen.nearest_side(&place).unwrap();
            assert!(depth_m.abs() < 1e-12, "{depth_m}");
            assert!(normal.y > 0.9 && normal.z < -0.1, "{normal:?}");
        }
    }
}
