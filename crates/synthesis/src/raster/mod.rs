//! Which part of a scene is where: boxes of cells are halved until each lies within one part or is a cell.
//!
//! Parts that a box lies outside of, and faces of polyhedra that cannot cut it, are dropped on the way down; the first
//! part from the top that holds the whole box ends the list. So most of a slice is filled in large pieces, and a cell
//! asks the few faces that are near it.

mod body;
mod plane_cut;

use std::ops::Range;

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use needlebench_kinematics::Pose;

use super::Scene;
pub(super) use body::Cell;
use body::{Body, Filled, Lies};
use plane_cut::Plane;

/// Halvings of a cell in which surfaces meet: each of its edges twice. What then is left is half a cell, an eighth of a
/// millimetre, and is asked at eight points: as often on one side of a surface as on the other, where taking the shares of
/// surfaces for independent would see gaps between parts that touch.
const HALVINGS: u32 = 3;
/// Half of the edge of a point, m: what is within it of a surface is on either side of it.
const POINT_M: f64 = 1e-9;
/// Cosine of the angle up to which planes count as parallel, 0.08 degrees: of a box that both cut, less than 0.1 % is at stake.
const PARALLEL_COSINE: f64 = 1.0 - 1e-6;
/// Shares below this count as none: rounding.
const NOTHING: f64 = 1e-9;

/// The parts of a scene in a frame along the axes of the slices.
#[derive(Debug)]
pub(super) struct Raster {
    parts: Vec<RasterPart>,
    around_hu: f64,
    /// Axes of the slices in `ct`: columns, rows, normal.
    frame_from_ct: UnitQuaternion<f64>,
}

#[derive(Debug)]
struct RasterPart {
    body: Body,
    hu: f64,
    label: u16,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

/// What fills a box wholly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Material {
    pub hu: f64,
    pub label: u16,
}

/// A part that may cut a box, and its faces that may.
#[derive(Debug, Clone)]
struct Candidate {
    part: u32,
    planes: Range<u32>,
}

impl Candidate {
    fn planes_in<'s>(&self, stack: &'s Stack) -> &'s [Plane] {
        &stack.planes[self.planes.start as usize..self.planes.end as usize]
    }
}

/// Lists of the boxes that contain each other, the smallest last; each is the top of two stacks.
#[derive(Debug, Default)]
pub(super) struct Stack {
    candidates: Vec<Candidate>,
    planes: Vec<Plane>,
}

/// What may be in a box: parts that may cut it, from the top down, over what holds all of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contents {
    first: usize,
    last: usize,
    planes: usize,
    beneath: Material,
}

impl Contents {
    /// What the whole box is made of, if nothing cuts it.
    pub fn uniform(&self) -> Option<Material> {
        (self.first == self.last).then_some(self.beneath)
    }

    /// Whether one part alone may cut the box.
    pub fn is_single(&self) -> bool {
        self.last - self.first == 1
    }

    /// Label of what is beneath all that may cut the box.
    pub(crate) fn beneath_label(&self) -> u16 {
        self.beneath.label
    }
}

impl Raster {
    /// For slices whose columns and rows follow one another along these unit vectors, at a right angle to each other.
    pub fn new(scene: &Scene, along_columns: &Vector3<f64>, along_rows: &Vector3<f64>) -> Self {
        let normal = along_columns.cross(along_rows);
        let axes = Matrix3::from_columns(&[*along_columns, *along_rows, normal]);
        let ct_from_frame =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        let frame_from_ct = ct_from_frame.inverse();
        let pose = Pose::from_parts(Vector3::zeros().into(), frame_from_ct);
        let parts = scene.parts.iter().map(|part| {
            let mut solid = part.solid.clone();
            solid.parent_from_shape = pose * solid.parent_from_shape;
            let (low, high) = solid.bounding_box();
            RasterPart {
                body: Body::new(&solid),
                hu: part.hu,
                label: part.label,
                low: low.coords,
                high: high.coords,
            }
        });
        Self {
            parts: parts.collect(),
            around_hu: scene.around_hu,
            frame_from_ct,
        }
    }

    /// Where a point of `ct` is in the frame of the slices.
    pub(crate) fn in_frame(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.frame_from_ct * point.coords
    }

    /// What may be in a box, of all that there is.
    pub(crate) fn all_in(&self, cell: &Cell, stack: &mut Stack) -> Contents {
        stack.candidates.clear();
        stack.planes.clear();
        let (low, high) = (cell.centre - cell.half, cell.centre + cell.half);
        for (index, part) in self.parts.iter().enumerate().rev() {
            let is_near =
                (0..3).all(|axis| part.low[axis] <= high[axis] && low[axis] <= part.high[axis]);
            if is_near {
                let first = stack.planes.len() as u32;
                stack.planes.extend(part.body.planes());
                stack.candidates.push(Candidate {
                    part: index as u32,
                    planes: first..stack.planes.len() as u32,
                });
            }
        }
        Contents {
            first: 0,
            last: stack.candidates.len(),
            planes: stack.planes.len(),
            beneath: Material {
                hu: self.around_hu,
                label: 0,
            },
        }
    }

    /// What may be in a box, of what may be in one around it.
    pub fn within(&self, outer: &Contents, cell: &Cell, stack: &mut Stack) -> Contents {
        // What boxes inside the outer one left is no longer wanted.
        stack.candidates.truncate(outer.last);
        stack.planes.truncate(outer.planes);
        let mut beneath = outer.beneath;
        for index in outer.first..outer.last {
            let Candidate { part, planes } = stack.candidates[index].clone();
            let first = stack.planes.len();
            let body = &self.parts[part as usize].body;
            match body.lies(cell, &mut stack.planes, planes) {
                Lies::Outside => stack.planes.truncate(first),
                Lies::Inside => {
                    stack.planes.truncate(first);
                    beneath = self.material(part);
                    break;
                }
                Lies::Across => stack.candidates.push(Candidate {
                    part,
                    planes: first as u32..stack.planes.len() as u32,
                }),
            }
        }
        Contents {
            first: outer.last,
            last: stack.candidates.len(),
            planes: stack.planes.len(),
            beneath,
        }
    }

    /// Mean of the Hounsfield units in a small box, with what may be in it.
    #[inline]
    pub fn mean_hu(&self, contents: &Contents, cell: &Cell, stack: &mut Stack) -> f64 {
        self.mean_of_single(contents, cell, stack)
            .unwrap_or_else(|| self.mean_hu_within(contents, cell, stack, HALVINGS))
    }

    /// The same, sooner, where one part alone may be in the box, and is not rough there.
    #[inline]
    fn mean_of_single(&self, contents: &Contents, cell: &Cell, stack: &Stack) -> Option<f64> {
        let [candidate] = &stack.candidates[contents.first..contents.last] else {
            return None;
        };
        let part = &self.parts[candidate.part as usize];
        match part.body.clearly_lies(cell) {
            Lies::Outside => return Some(contents.beneath.hu),
            Lies::Inside => return Some(part.hu),
            Lies::Across => {}
        }
        let filled = part.body.fills(cell, candidate.planes_in(stack));
        if filled.is_rough {
            return None;
        }
        if filled.share <= NOTHING {
            return Some(contents.beneath.hu);
        }
        let left = 1.0 - filled.share;
        Some(part.hu * (1.0 - left) + left * contents.beneath.hu)
    }

    fn mean_hu_within(
        &self,
        contents: &Contents,
        cell: &Cell,
        stack: &mut Stack,
        halvings: u32,
    ) -> f64 {
        let mut cut = PlaneCuts::default();
        let mut sum = 0.0;
        let mut is_rough = false;
        for candidate in &stack.candidates[contents.first..contents.last] {
            let part = &self.parts[candidate.part as usize];
            let filled = part.body.fills(cell, candidate.planes_in(stack));
            is_rough |= filled.is_rough;
            if filled.share > NOTHING {
                sum += part.hu * cut.take(&filled);
                if cut.left() < NOTHING {
                    break;
                }
            }
        }
        if is_rough || !cut.is_exact {
            return if halvings > 0 {
                self.mean_of_halves(contents, cell, stack, halvings - 1)
            } else {
                self.mean_of_points(contents, cell, stack)
            };
        }
        sum + cut.left() * contents.beneath.hu
    }

    /// Mean over the middles of a box's eighths.
    fn mean_of_points(&self, contents: &Contents, cell: &Cell, stack: &mut Stack) -> f64 {
        let mut sum = 0.0;
        for corner in 0..8_u8 {
            let offset = Vector3::from_fn(|axis, _| {
                let sign = if corner >> axis & 1 == 1 { 0.5 } else { -0.5 };
                sign * cell.half[axis]
            });
            let point = Cell {
                centre: cell.centre + offset,
                half: Vector3::repeat(POINT_M),
            };
            let at = self.within(contents, &point, stack);
            let top = stack.candidates[at.first..at.last].first();
            sum += top.map_or(at.beneath.hu, |candidate| {
                0.5 * (self.parts[candidate.part as usize].hu + at.beneath.hu)
            });
        }
        sum / 8.0
    }

    fn mean_of_halves(
        &self,
        contents: &Contents,
        cell: &Cell,
        stack: &mut Stack,
        halvings: u32,
    ) -> f64 {
        let mut sum = 0.0;
        for half in cell.halves() {
            let inner = self.within(contents, &half, stack);
            sum += 0.5
                * match inner.uniform() {
                    Some(material) => material.hu,
                    None => self.mean_hu_within(&inner, &half, stack, halvings),
                };
        }
        sum
    }

    fn material(&self, part: u32) -> Material {
        let part = &self.parts[part as usize];
        Material {
            hu: part.hu,
            label: part.label,
        }
    }
}

/// What parts, from the top down, leave of a box that they cut by planes at one angle: the middle of a pile of sheets.
#[derive(Debug)]
struct PlaneCuts {
    is_cut: bool,
    /// Across the sheets: the first cut's normal, if it is by one plane.
    normal: Option<Vector3<f64>>,
    /// Share of the box that is taken on the normal's inner side, and where what is taken on the outer side begins.
    taken_to: f64,
    taken_from: f64,
    /// All planes are parallel.
    is_exact: bool,
}

impl Default for PlaneCuts {
    fn default() -> Self {
        Self {
            is_cut: false,
            normal: None,
            taken_to: 0.0,
            taken_from: 1.0,
            is_exact: true,
        }
    }
}

impl PlaneCuts {
    fn left(&self) -> f64 {
        (self.taken_from - self.taken_to).max(0.0)
    }

    /// Takes what the next part fills; returns how much of that was left.
    fn take(&mut self, filled: &Filled) -> f64 {
        let before = self.left();
        let mut is_turned = false;
        if filled.share < 1.0 {
            let cosine = if self.is_cut {
                let both = self.normal.zip(filled.normal);
                both.map_or(0.0, |(first, normal)| first.dot(&normal))
            } else {
                self.is_cut = true;
                self.normal = filled.normal;
                1.0
            };
            self.is_exact &= cosine.abs() > PARALLEL_COSINE;
            is_turned = cosine < 0.0;
        }
        if is_turned {
            self.taken_from = self.taken_from.min(1.0 - filled.share);
        } else {
            self.taken_to = self.taken_to.max(filled.share);
        }
        before - self.left()
    }
}

impl Cell {
    /// Its two halves along its longest edge.
    fn halves(&self) -> [Self; 2] {
        let axis = self.half.imax();
        let mut half = self.half;
        half[axis] *= 0.5;
        [-1.0, 1.0].map(|sign| {
            let mut centre = self.centre;
            centre[axis] += sign * half[axis];
            Self { centre, half }
        })
    }
}

#[cfg(test)]
mod tests {
    use needlebench_geometry::{Shape, Solid};
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    /// What lies clearly on one side of a surface, or is cut by it alone, is answered sooner, and the same.
    #[test]
    fn one_part_has_the_hounsfield_units_of_any_number_of_parts() {
        /// Cells within this of a part's middle, m.
        const WITHIN_M: f64 = 7e-3;
        let mut random = SplitMix64::new(1);
        let mut between = |low: f64, high: f64| {
            low + (high - low) * (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (radius_m, half_length_m) = (4e-3, 3e-3);
        let (mut outside, mut inside, mut cut) = (0, 0, 0);
        for shape in [
            Shape::Sphere { radius_m },
            Shape::Sphere { radius_m: 3e-4 },
            Shape::Capsule {
                radius_m,
                half_length_m,
            },
            Shape::Cylinder {
                radius_m,
                half_length_m,
            },
            Shape::Cylinder {
                radius_m,
                half_length_m: 1e-4,
            },
            Shape::Cuboid {
                half_extents_m: Vector3::new(5e-3, 4e-3, 3e-4),
            },
        ] {
            let mut scene = Scene::default();
            let turn = UnitQuaternion::from_euler_angles(0.4, -0.7, 1.9);
            let solid = Solid {
                name: String::new(),
                shape,
                parent_from_shape: Pose::from_parts(Vector3::zeros().into(), turn),
            };
            scene.push(solid, 37.3, 1);
            let raster = Raster::new(&scene, &Vector3::x(), &Vector3::y());
            let mut stack = Stack::default();
            for _ in 0..20_000 {
                let cell = Cell {
                    centre: Vector3::from_fn(|_, _| between(-WITHIN_M, WITHIN_M)),
                    half: Vector3::new(1.2e-4, 1.1e-4, 2.5e-4),
                };
                let contents = raster.all_in(&cell, &mut stack);
                if !contents.is_single() {
                    continue;
                }
                let hu = raster.mean_hu(&contents, &cell, &mut stack);
                let general = raster.mean_hu_within(&contents, &cell, &mut stack, HALVINGS);
                assert_eq!(
                    hu.to_bits(),
                    general.to_bits(),
                    "{:?}",
                    scene.parts[0].solid
                );
                if hu == scene.around_hu {
                    outside += 1;
                } else if hu == 37.3 {
                    inside += 1;
                } else {
                    cut += 1;
                }
            }
        }
        assert!(
            outside > 1000 && inside > 1000 && cut > 1000,
            "{outside} {inside} {cut}"
        );
    }
}
