//! The floor: a grid that fades out, with the soft shadow of the objects above it.

use nalgebra::{Point2, Point3, Vector3};

use crate::camera::{Projected, View};
use crate::color::{self, Light};
use crate::raster::{Facing, Grid, SAMPLES_PER_PIXEL, rasterise};
use crate::scene::{Floor, Scene};

/// Cells of the shadow along each side of the floor's square.
const SHADOW_CELLS: usize = 256;

/// Reach of one blurring, in cells; two of them make a soft rim.
const BLUR_CELLS: usize = 3;

/// Part of the light that the middle of a shadow takes away.
const SHADOW_DEPTH: f32 = 0.3;

/// Part of the light that a grid line takes away.
const LINE_DEPTH: f32 = 0.22;

/// Floor colour, sRGB.
const COLOR: [f32; 3] = [0.93, 0.935, 0.94];

/// A floor ready to be looked at.
#[derive(Debug)]
pub(crate) struct FloorView {
    floor: Floor,
    light: Light,
    /// Towards the light, in the world.
    towards_light: Vector3<f64>,
    /// Starts of the rays in the world, m.
    starts: Linear,
    /// Directions of the rays in the world, per metre of depth.
    directions: Linear,
    /// What is over the floor, 0 to 1, row by row along y.
    cover: Vec<f32>,
    /// Its shadow, the same with soft rims.
    shadow: Vec<f32>,
}

/// A vector that changes linearly across the picture, as starts and directions of rays do.
#[derive(Debug, Clone, Copy)]
struct Linear {
    at_zero: Vector3<f64>,
    per_px: [Vector3<f64>; 2],
}

impl Linear {
    fn new(vector_at: impl Fn(f64, f64) -> Vector3<f64>) -> Self {
        let at_zero = vector_at(0.0, 0.0);
        Self {
            at_zero,
            per_px: [vector_at(1.0, 0.0) - at_zero, vector_at(0.0, 1.0) - at_zero],
        }
    }

    fn at(&self, x_px: f64, y_px: f64) -> Vector3<f64> {
        self.at_zero + self.per_px[0] * x_px + self.per_px[1] * y_px
    }
}

/// The floor at a pixel of the picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FloorSample {
    pub nearness: f32,
    pub light: Light,
    pub opacity: f32,
    /// Cell of the shadow, the first of the four that it is interpolated from.
    pub shadow: u16,
}

impl FloorView {
    /// `towards_light` is in the world and points upwards. `None` when the floor is seen from below
    /// or has no size.
    pub fn new(
        floor: &Floor,
        scene: &Scene,
        view: &View,
        towards_light: &Vector3<f64>,
    ) -> Option<Self> {
        let sound = floor.radius_m > 0.0 && floor.spacing_m > 0.0 && view.eye_m.z > floor.z_m;
        let world_from_eye = view.eye_from_world.transpose();
        if !sound {
            return None;
        }
        let mut cover = vec![0.0; SHADOW_CELLS * SHADOW_CELLS];
        cast(&mut cover, floor, scene, towards_light);
        Some(Self {
            floor: *floor,
            light: color::light(COLOR),
            towards_light: *towards_light,
            starts: Linear::new(|x_px, y_px| {
                view.eye_m.coords + world_from_eye * view.ray(x_px, y_px).0
            }),
            directions: Linear::new(|x_px, y_px| world_from_eye * view.ray(x_px, y_px).1),
            shadow: softened(&cover),
            cover,
        })
    }

    /// The same floor with further things over it.
    pub fn under(&self, things: &Scene) -> Self {
        let mut cover = self.cover.clone();
        cast(&mut cover, &self.floor, things, &self.towards_light);
        Self {
            shadow: softened(&cover),
            cover,
            ..*self
        }
    }

    /// By cell of the shadow, whether a place there is shaded otherwise than on another floor.
    pub fn shaded_unlike(&self, other: &Self) -> Vec<bool> {
        let differs = |cell: usize| self.shadow.get(cell) != other.shadow.get(cell);
        (0..self.shadow.len())
            .map(|cell| corners(cell).into_iter().any(differs))
            .collect()
    }

    /// What a place of the picture shows of the floor, if that is nearer than `nearness`.
    pub fn look(&self, view: &View, [x_px, y_px]: [f64; 2], nearness: f32) -> Option<FloorSample> {
        let (start_m, direction) = (self.starts.at(x_px, y_px), self.directions.at(x_px, y_px));
        let depth_m = (self.floor.z_m - start_m.z) / direction.z;
        #[expect(clippy::cast_possible_truncation, reason = "depths are stored as f32")]
        let floor_nearness = view.nearness(depth_m) as f32;
        if !(depth_m > 0.0 && depth_m.is_finite() && floor_nearness > nearness) {
            return None;
        }
        let hit_m = Point2::from((start_m + direction * depth_m).xy());
        let off_center = (hit_m - self.floor.center_m).norm() / self.floor.radius_m;
        if off_center >= 1.0 {
            return None;
        }
        // How far the hit moves from pixel to pixel.
        let moved = |axis: usize| {
            let (start, turn) = (self.starts.per_px[axis], self.directions.per_px[axis]);
            let deeper = -(start.z + depth_m * turn.z) / direction.z;
            (start + turn * depth_m + direction * deeper).xy().abs()
        };
        let pixel_m = moved(0).sup(&moved(1));
        let line = self
            .line(hit_m.x, pixel_m.x)
            .max(self.line(hit_m.y, pixel_m.y));
        let fade = ((1.0 - off_center) / 0.6).min(1.0);
        #[expect(clippy::cast_possible_truncation, reason = "colours are f32")]
        let (fade, line) = ((fade * fade * (3.0 - 2.0 * fade)) as f32, line as f32);
        let (shade, shadow) = self.shadow_at(&hit_m);
        let dimmed = (1.0 - LINE_DEPTH * line) * (1.0 - SHADOW_DEPTH * shade);
        Some(FloorSample {
            nearness: floor_nearness,
            light: self.light * dimmed,
            opacity: fade,
            shadow,
        })
    }

    /// How much of a pixel a grid line across one axis covers, 0 to 1.
    fn line(&self, at_m: f64, pixel_m: f64) -> f64 {
        let spacing_m = self.floor.spacing_m;
        // Where lines would merge into a grey, they fade instead.
        let distinct = 1.0 - 4.0 * pixel_m / spacing_m;
        if distinct <= 0.0 {
            return 0.0;
        }
        let off_m = (at_m - (at_m / spacing_m).round() * spacing_m).abs();
        distinct * (1.1 - off_m / pixel_m.max(1e-9)).clamp(0.0, 1.0)
    }

    /// Shadow at a place of the floor, interpolated, and the first of the cells that it is from.
    fn shadow_at(&self, at_m: &Point2<f64>) -> (f32, u16) {
        let cells = cells(&self.floor, at_m).map(|cell| cell - 0.5);
        let last = (SHADOW_CELLS - 1) as f64;
        let low = cells.map(|cell| cell.floor().clamp(0.0, last - 1.0));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the cells, of which there are 2^16"
        )]
        let (first, along) = (
            low[1] as u16 * SHADOW_CELLS as u16 + low[0] as u16,
            [0, 1].map(|axis| (cells[axis] - low[axis]).clamp(0.0, 1.0) as f32),
        );
        let mix = |from: f32, to: f32, along: f32| from + (to - from) * along;
        let [a, b, c, d] = corners(usize::from(first)).map(|cell| self.shadow[cell]);
        let shade = mix(mix(a, b, along[0]), mix(c, d, along[0]), along[1]);
        (shade, first)
    }
}

/// A place of the floor in cells of the shadow.
fn cells(floor: &Floor, at_m: &Point2<f64>) -> [f64; 2] {
    let scale = SHADOW_CELLS as f64 / (2.0 * floor.radius_m);
    let offset_m = at_m - floor.center_m;
    [offset_m.x, offset_m.y].map(|offset_m| (offset_m + floor.radius_m) * scale)
}

/// A cell of the shadow and its neighbours along x, along y and along both.
fn corners(cell: usize) -> [usize; 4] {
    [cell, cell + 1, cell + SHADOW_CELLS, cell + SHADOW_CELLS + 1]
}

/// Adds the surfaces of the scene to what is over the floor, in the direction of the light.
fn cast(cover: &mut [f32], floor: &Floor, scene: &Scene, towards_light: &Vector3<f64>) {
    let grid = Grid {
        columns: SHADOW_CELLS,
        rows: SHADOW_CELLS,
    };
    let fall = towards_light / towards_light.z;
    for surface in &scene.surfaces {
        let opacity = surface.color_rgba[3].clamp(0.0, 1.0);
        let fallen = |vertex_m: &Point3<f64>| {
            let world_m = surface.world_from_surface * vertex_m;
            let cast_m = world_m - fall * (world_m.z - floor.z_m).max(0.0);
            let [x, y] = cells(floor, &cast_m.xy()).map(|cell| cell / SAMPLES_PER_PIXEL as f64);
            Projected {
                x_px: x,
                y_px: y,
                nearness: 0.0,
            }
        };
        let casts: Vec<Projected> = surface.mesh.vertices_m.iter().map(fallen).collect();
        for triangle in &surface.mesh.triangles {
            let corners = triangle.map(|index| casts.get(index as usize).copied());
            if let [Some(a), Some(b), Some(c)] = corners {
                rasterise([a, b, c], Facing::Both, grid, |cell, _| {
                    cover[cell] = opacity.max(cover[cell]);
                });
            }
        }
    }
}

/// The shadow of what is over the floor.
fn softened(cover: &[f32]) -> Vec<f32> {
    (0..4).fold(cover.to_vec(), |shadow, _| blurred_transposed(&shadow))
}

/// Blurs along the rows and transposes.
fn blurred_transposed(cover: &[f32]) -> Vec<f32> {
    let mut result = vec![0.0; cover.len()];
    for (y, row) in cover.chunks_exact(SHADOW_CELLS).enumerate() {
        for x in 0..SHADOW_CELLS {
            let window = &row[x.saturating_sub(BLUR_CELLS)..(x + BLUR_CELLS + 1).min(SHADOW_CELLS)];
            result[x * SHADOW_CELLS + y] = window.iter().sum::<f32>() / (2 * BLUR_CELLS + 1) as f32;
        }
    }
    result
}
