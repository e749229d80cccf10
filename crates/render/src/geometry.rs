//! From scene to screen triangles: placing, clipping, widening of lines.

use nalgebra::{Matrix3, Vector3};

use crate::camera::{HalfSpace, Projected, View};
use crate::color::{self, Light};
use crate::normals::corner_normals;
use crate::scene::{Line3, SurfaceInstance};

/// Lines are this much nearer than they are, so that one lying on a surface is seen.
const LINE_BIAS: f64 = 5e-4;

/// Opacity from which on a surface is opaque.
const OPAQUE: f32 = 0.999;

/// How a surface or a line looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Material {
    pub light: Light,
    pub opacity: f32,
    /// Lines are not.
    pub shaded: bool,
}

impl Material {
    pub fn new([red, green, blue, opacity]: [f32; 4], shaded: bool) -> Self {
        Self {
            light: color::light([red, green, blue]),
            opacity: opacity.clamp(0.0, 1.0),
            shaded,
        }
    }

    pub(crate) fn is_opaque(&self) -> bool {
        self.opacity >= OPAQUE
    }
}

/// What a sample shows: a triangle before clipping, in the eye frame, or a line.
#[derive(Debug, Clone)]
pub(crate) struct Primitive {
    pub material: u32,
    corners_m: [Vector3<f32>; 3],
    normals: [Vector3<f32>; 3],
}

impl Primitive {
    /// The smooth normal at a point of the triangle; zero where it has none.
    pub fn normal(&self, point_m: &Vector3<f32>) -> Vector3<f32> {
        let [a, b, c] = &self.normals;
        if a == b && b == c {
            return *a;
        }
        let [a, b, c] = &self.corners_m;
        let (to_b, to_c, to_point) = (b - a, c - a, point_m - a);
        let cross = to_b.cross(&to_c);
        let area = cross.norm_squared();
        if area < f32::MIN_POSITIVE {
            return self.normals[0];
        }
        // Rounding and coarse samples can leave the triangle a little.
        let scaled = cross * (1.0 / area);
        let weight_b = to_point.cross(&to_c).dot(&scaled).clamp(0.0, 1.0);
        let weight_c = to_b
            .cross(&to_point)
            .dot(&scaled)
            .clamp(0.0, 1.0 - weight_b);
        let [a, b, c] = &self.normals;
        a * (1.0 - weight_b - weight_c) + b * weight_b + c * weight_c
    }
}

/// Places, clips and projects; keeps what shading needs.
#[derive(Debug)]
pub(crate) struct Assembler<'a> {
    view: &'a View,
    guards: [HalfSpace; 5],
    /// Number of primitives that others have.
    before: u32,
    pub materials: Vec<Material>,
    pub primitives: Vec<Primitive>,
}

impl<'a> Assembler<'a> {
    pub fn new(view: &'a View, before: u32) -> Self {
        let (materials, primitives) = (Vec::new(), Vec::new());
        Self {
            view,
            guards: view.guards(),
            before,
            materials,
            primitives,
        }
    }

    fn add_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        index(self.materials.len() - 1)
    }

    fn add_primitive(&mut self, primitive: Primitive) -> u32 {
        self.primitives.push(primitive);
        self.before.saturating_add(index(self.primitives.len() - 1))
    }

    /// Calls `draw` with each visible piece of the surface and the primitive it belongs to.
    pub fn surface(
        &mut self,
        surface: &SurfaceInstance,
        material: Material,
        mut draw: impl FnMut(u32, [Projected; 3]),
    ) {
        let material = self.add_material(material);
        let pose = &surface.world_from_surface;
        let eye_from_surface: Matrix3<f64> =
            self.view.eye_from_world * pose.rotation.to_rotation_matrix().matrix();
        let origin_m = self.view.eye_point(&pose.translation.vector.into());
        let placed: Vec<(Vector3<f64>, u8)> = surface
            .mesh
            .vertices_m
            .iter()
            .map(|vertex_m| {
                let eye_point = eye_from_surface * vertex_m.coords + origin_m;
                (eye_point, outside(&self.guards, &eye_point))
            })
            .collect();
        let turn = eye_from_surface.cast::<f32>();

        for (triangle, normals) in surface
            .mesh
            .triangles
            .iter()
            .zip(corner_normals(&surface.mesh))
        {
            let [Some(a), Some(b), Some(c)] = triangle.map(|index| placed.get(index as usize))
            else {
                continue;
            };
            let corners_m = [a.0, b.0, c.0];
            let not_finite = |corner: &Vector3<f64>| !corner.sum().is_finite();
            if a.1 & b.1 & c.1 != 0 || corners_m.iter().any(not_finite) {
                continue;
            }
            let primitive = self.add_primitive(Primitive {
                material,
                corners_m: corners_m.map(Vector3::cast),
                normals: normals.map(|normal| turn * normal.cast::<f32>()),
            });
            if a.1 | b.1 | c.1 == 0 {
                draw(
                    primitive,
                    corners_m.map(|corner| self.view.project(&corner)),
                );
            } else {
                let polygon = clipped(&self.guards, &corners_m);
                let projected: Vec<Projected> = polygon
                    .iter()
                    .map(|corner| self.view.project(corner))
                    .collect();
                for side in 2..projected.len() {
                    draw(
                        primitive,
                        [projected[0], projected[side - 1], projected[side]],
                    );
                }
            }
        }
    }

    /// Calls `draw` with the two triangles of a line, if it is visible.
    pub fn line(
        &mut self,
        line: &Line3,
        material: Material,
        mut draw: impl FnMut(u32, [Projected; 3]),
    ) {
        let ends = [line.from_m, line.to_m].map(|end_m| self.view.eye_point(&end_m));
        if !(ends[0] + ends[1]).sum().is_finite() || line.width_px.is_nan() {
            return;
        }
        let Some([from, to]) = clipped_segment(&self.guards, ends) else {
            return;
        };
        let [from, to] = [from, to].map(|end| {
            let nearer = end * (1.0 - LINE_BIAS);
            Projected {
                nearness: self.view.project(&nearer).nearness,
                ..self.view.project(&end)
            }
        });
        let (along_x, along_y) = (to.x_px - from.x_px, to.y_px - from.y_px);
        let length_px = libm::hypot(along_x, along_y);
        if length_px < 1e-6 {
            return;
        }
        let half_px = line.width_px.clamp(0.5, 100.0) / (2.0 * length_px);
        let corner = |end: Projected, side: f64| Projected {
            x_px: end.x_px - side * half_px * along_y,
            y_px: end.y_px + side * half_px * along_x,
            ..end
        };
        let material = self.add_material(material);
        let zeros = [Vector3::zeros(); 3];
        let primitive = self.add_primitive(Primitive {
            material,
            corners_m: zeros,
            normals: zeros,
        });
        let [a, b, c, d] =
            [(from, -1.0), (to, -1.0), (to, 1.0), (from, 1.0)].map(|(end, side)| corner(end, side));
        // Counter-clockwise as seen, so that translucent lines face the front.
        draw(primitive, [a, c, b]);
        draw(primitive, [a, d, c]);
    }
}

/// Indices fit: a picture of 2^32 triangles would need hundreds of gigabytes.
fn index(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}

/// One bit for each half space that the point is not in.
fn outside(guards: &[HalfSpace; 5], eye_point: &Vector3<f64>) -> u8 {
    guards
        .iter()
        .enumerate()
        .filter(|(_, guard)| guard.depth(eye_point) < 0.0)
        .fold(0, |bits, (position, _)| bits | 1 << position)
}

/// The part of a convex polygon inside all half spaces (Sutherland and Hodgman).
fn clipped(guards: &[HalfSpace; 5], polygon: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut kept = polygon.to_vec();
    for guard in guards {
        let whole = std::mem::take(&mut kept);
        for (position, corner) in whole.iter().enumerate() {
            let next = &whole[(position + 1) % whole.len()];
            let (here, there) = (guard.depth(corner), guard.depth(next));
            if here >= 0.0 {
                kept.push(*corner);
            }
            if (here >= 0.0) != (there >= 0.0) {
                kept.push(corner + (next - corner) * (here / (here - there)));
            }
        }
    }
    kept
}

/// The part of a segment inside all half spaces.
fn clipped_segment(
    guards: &[HalfSpace; 5],
    [from, to]: [Vector3<f64>; 2],
) -> Option<[Vector3<f64>; 2]> {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for guard in guards {
        let (here, there) = (guard.depth(&from), guard.depth(&to));
        match (here >= 0.0, there >= 0.0) {
            (true, true) => {}
            (true, false) => last = last.min(here / (here - there)),
            (false, true) => first = first.max(here / (here - there)),
            (false, false) => return None,
        }
    }
    (first < last).then(|| [first, last].map(|along| from + (to - from) * along))
}
