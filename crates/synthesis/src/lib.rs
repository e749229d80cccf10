//! CT volumes of known scenes: the ground truth against which everything else is measured.
//!
//! A [`Scene`] of exact solids is seen by a [`Scanner`], effect by effect:
//!
//! 1. the slice's sensitivity over its thickness, which is independent of the slice spacing, and the mean
//!    over cells of a part of a pixel: plane cuts in closed form where one surface crosses a cell, smaller cells where
//!    several do;
//! 2. the Gaussian blur in the slice (the mean over cells counts towards it), and the overshoot along edges;
//! 3. streaks about metal;
//! 4. noise with the kernel's spectrum, stronger in the middle, shared by slices that overlap;
//! 5. clipping, the circle, rounding to integers.
//!
//! The slices may lie anyhow in `ct`, turned or sheared (a tilted gantry); thickness counts along their normal.
//! The same seed gives the same bytes, whatever the number of threads.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "images are made in f32; counts of cells and layers are rounded from lengths that were checked"
)]

mod blur;
mod noise;
mod raster;
mod scanner;
mod scene;
mod slab;
mod streaks;

use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use blur::{Blur, InPlane, blur_pixels, centred_gaussian};
use needlebench_volume::{
    AIR_HU, ImageCircle, LabelMap, Volume, VolumeError, VoxelGrid, in_slices, room_for,
};
use noise::{NoiseBuffers, NoiseSource};
use raster::{Cell, Contents, Raster, Stack};
pub use scanner::{Kernel, Noise, Overshoot, ScanPreset, Scanner, SliceProfile, Streaks};
pub use scene::{Scene, ScenePart};
use slab::{Cells, Layers, SlabPainter};
use streaks::add_streaks;

/// Scans a scene.
///
/// Takes at most `threads` threads; stops soon once `cancel` is set. The columns and rows of `grid` must be at a right
/// angle to each other.
pub fn synthesise(
    scene: &Scene,
    scanner: &Scanner,
    grid: &VoxelGrid,
    seed: u64,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<Volume, VolumeError> {
    synthesise_watched(scene, scanner, grid, seed, threads, cancel, &|| {})
}

/// The same; `on_slice` is called after each slice, from any thread.
pub fn synthesise_watched(
    scene: &Scene,
    scanner: &Scanner,
    grid: &VoxelGrid,
    seed: u64,
    threads: usize,
    cancel: &AtomicBool,
    on_slice: &(dyn Fn() + Sync),
) -> Result<Volume, VolumeError> {
    scanner.check()?;
    let frame = SliceFrame::new(grid)?;
    let raster = frame.raster(scene);
    let camera = Camera::new(scanner, grid, &frame, seed);
    let mut hu = room_for(grid)?;
    in_slices(
        &mut hu,
        frame.pixels(),
        threads,
        cancel,
        || SliceScan::new(&camera, &raster),
        |scan, index, slice| {
            scan.slice(frame.origin(&raster, index), index, slice);
            on_slice();
        },
    )?;
    Ok(Volume {
        grid: grid.clone(),
        hu,
        slice_thickness_m: Some(scanner.slice_thickness_m),
    })
}

/// What is at the centre of each voxel.
pub fn label(
    scene: &Scene,
    grid: &VoxelGrid,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<LabelMap, VolumeError> {
    let frame = SliceFrame::new(grid)?;
    let raster = frame.raster(scene);
    let mut labels = room_for(grid)?;
    in_slices(
        &mut labels,
        frame.pixels(),
        threads,
        cancel,
        Stack::default,
        |stack, index, slice| {
            let mut labeller = Labeller {
                raster: &raster,
                columns: frame.size[0],
                pixel_m: frame.pixel_m,
                origin: frame.origin(&raster, index),
            };
            labeller.label(stack, frame.size, slice);
        },
    )?;
    Ok(LabelMap {
        grid: grid.clone(),
        labels,
        names: scene.names.clone(),
    })
}

/// How the slices of a grid lie.
#[derive(Debug)]
struct SliceFrame<'g> {
    grid: &'g VoxelGrid,
    size: [usize; 2],
    pixel_m: [f64; 2],
    /// Unit vectors from a column, and from a row, to the next one.
    along: [Vector3<f64>; 2],
    /// Distance of the planes of neighbouring slices, m.
    increment_m: f64,
}

impl<'g> SliceFrame<'g> {
    fn new(grid: &'g VoxelGrid) -> Result<Self, VolumeError> {
        /// Cosine of the angle between columns and rows that counts as rounding of a file's decimals.
        const SQUARE: f64 = 1e-5;
        let [columns, rows, _] = grid.size();
        let [width_m, height_m, _] = grid.spacing_m();
        let steps = grid.steps_m();
        let along_columns = steps.column(0) / width_m;
        let along_rows = steps.column(1) / height_m;
        let cosine = along_columns.dot(&along_rows);
        if cosine.abs() > SQUARE {
            let sine = along_columns.cross(&along_rows).norm();
            let between = libm::atan2(sine, cosine).to_degrees();
            return Err(VolumeError::refused(format!(
                "columns and rows of the slices are {between:.3} degrees apart, not 90"
            )));
        }
        let along_rows = (along_rows - along_columns * cosine).normalize();
        let normal = along_columns.cross(&along_rows);
        Ok(Self {
            grid,
            size: [columns, rows],
            pixel_m: [width_m, height_m],
            along: [along_columns, along_rows],
            increment_m: normal.dot(&steps.column(2)).abs(),
        })
    }

    fn pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    fn raster(&self, scene: &Scene) -> Raster {
        Raster::new(scene, &self.along[0], &self.along[1])
    }

    /// Centre of a slice's first voxel in the raster's frame.
    fn origin(&self, raster: &Raster, slice: usize) -> Vector3<f64> {
        let first = nalgebra::Point3::new(0.0, 0.0, slice as f64);
        raster.in_frame(&self.grid.ct_from_index(&first))
    }
}

/// What all slices have in common.
#[derive(Debug)]
struct Camera<'s> {
    scanner: &'s Scanner,
    size: [usize; 2],
    pixel_m: f64,
    layers: Layers,
    blur: [Blur; 2],
    cells: Cells,
    /// Taps of the overshoot's further blur.
    further: Vec<f32>,
    noise: Option<NoiseSource>,
    circle: ImageCircle,
}

impl<'s> Camera<'s> {
    fn new(scanner: &'s Scanner, grid: &VoxelGrid, frame: &SliceFrame<'_>, seed: u64) -> Self {
        let size = frame.size;
        let blur = frame
            .pixel_m
            .map(|pixel_m| Blur::new(scanner.psf_sigma_m, pixel_m));
        let cells = Cells {
            size: [0, 1].map(|axis| blur[axis].cells_for(size[axis])),
            edge_m: [blur[0].cell_m, blur[1].cell_m],
        };
        let pixel_m = grid.spacing_m()[0];
        let slices_m = [scanner.slice_thickness_m, frame.increment_m];
        Self {
            scanner,
            size,
            pixel_m,
            layers: Layers::new(scanner.slice_profile, scanner.slice_thickness_m),
            blur,
            cells,
            further: scanner.overshoot.map_or_else(Vec::new, |overshoot| {
                centred_gaussian(overshoot.sigma_m / pixel_m)
            }),
            noise: scanner
                .noise
                .map(|noise| NoiseSource::new(&noise, size, pixel_m, slices_m, seed)),
            circle: ImageCircle::new(size),
        }
    }
}

/// Makes slices, one after the other.
struct SliceScan<'c> {
    camera: &'c Camera<'c>,
    painter: SlabPainter<'c>,
    in_plane: InPlane,
    cells: Vec<f32>,
    image: Vec<f32>,
    blurred: Vec<f32>,
    noise: NoiseBuffers,
}

impl<'c> SliceScan<'c> {
    fn new(camera: &'c Camera<'c>, raster: &'c Raster) -> Self {
        let pixels = camera.size[0] * camera.size[1];
        Self {
            camera,
            painter: SlabPainter::new(raster, &camera.layers, camera.cells),
            in_plane: InPlane::new(&camera.blur, camera.size),
            cells: vec![0.0; camera.cells.size[0] * camera.cells.size[1]],
            image: vec![0.0; pixels],
            blurred: Vec::new(),
            noise: NoiseBuffers::default(),
        }
    }

    fn slice(&mut self, origin: Vector3<f64>, index: usize, slice: &mut [i16]) {
        let [across, down] = &self.camera.blur;
        let first_cell = origin + Vector3::new(across.first_m(), down.first_m(), 0.0);
        self.cells.fill(0.0);
        self.painter.paint(first_cell, &mut self.cells);
        self.in_plane.apply(&self.cells, &mut self.image);
        self.overshoot();
        if let Some(streaks) = &self.camera.scanner.streaks {
            let columns = self.camera.size[0];
            add_streaks(&mut self.image, columns, self.camera.pixel_m, streaks);
        }
        self.add_noise(index);
        self.store(slice);
    }

    fn overshoot(&mut self) {
        let Some(overshoot) = self.camera.scanner.overshoot else {
            return;
        };
        self.blurred.resize(self.image.len(), 0.0);
        blur_pixels(
            &self.image,
            self.camera.size[0],
            &self.camera.further,
            &mut self.blurred,
        );
        let share = overshoot.share as f32;
        for (value, blurred) in self.image.iter_mut().zip(&self.blurred) {
            *value += share * (*value - blurred);
        }
    }

    fn add_noise(&mut self, index: usize) {
        let (Some(source), Some(noise)) = (&self.camera.noise, &self.camera.scanner.noise) else {
            return;
        };
        let columns = self.camera.size[0];
        let falls = 1.0 - noise.rim_share;
        let rows = source.rows(index, &mut self.noise);
        for (j, (image, noise)) in self.image.chunks_exact_mut(columns).zip(rows).enumerate() {
            for (i, (value, noise)) in image.iter_mut().zip(noise).enumerate() {
                let here = 1.0 - falls * self.camera.circle.share(i, j).min(1.0);
                *value += here as f32 * noise;
            }
        }
    }

    fn store(&self, slice: &mut [i16]) {
        let [least, greatest] = self.camera.scanner.range_hu.map(f32::from);
        for (stored, value) in slice.iter_mut().zip(&self.image) {
            *stored = rounded(value.clamp(least, greatest));
        }
        if self.camera.scanner.has_circle {
            let columns = self.camera.size[0];
            for (j, row) in slice.chunks_exact_mut(columns).enumerate() {
                for (i, stored) in row.iter_mut().enumerate() {
                    if self.camera.circle.share(i, j) > 1.0 {
                        *stored = AIR_HU;
                    }
                }
            }
        }
    }
}

/// To the nearest integer, of values that an `i16` holds.
#[inline]
fn rounded(value: f32) -> i16 {
    // Cutting off is one instruction, rounding is a call on machines without SSE 4.1.
    const ABOVE_ALL: f32 = 32768.5;
    (((value + ABOVE_ALL) as i32) - 32768) as i16
}

/// Labels the centres of a slice's pixels.
struct Labeller<'r> {
    raster: &'r Raster,
    columns: usize,
    pixel_m: [f64; 2],
    origin: Vector3<f64>,
}

/// Columns and rows of some pixels.
#[derive(Debug, Clone, Copy)]
struct Pixels {
    low: [usize; 2],
    high: [usize; 2],
}

impl Labeller<'_> {
    fn label(&mut self, stack: &mut Stack, size: [usize; 2], slice: &mut [u16]) {
        let all = Pixels {
            low: [0; 2],
            high: size,
        };
        let cell = self.centres(&all);
        let outer = self.raster.all_in(&cell, stack);
        let contents = self.raster.within(&outer, &cell, stack);
        self.label_pixels(&all, &contents, stack, slice);
    }

    fn label_pixels(
        &mut self,
        pixels: &Pixels,
        contents: &Contents,
        stack: &mut Stack,
        slice: &mut [u16],
    ) {
        let count = [0, 1].map(|axis| pixels.high[axis] - pixels.low[axis]);
        if let Some(material) = contents.uniform() {
            for row in pixels.low[1]..pixels.high[1] {
                let start = row * self.columns;
                slice[start + pixels.low[0]..start + pixels.high[0]].fill(material.label);
            }
            return;
        }
        let axis =
            usize::from(count[1] as f64 * self.pixel_m[1] > count[0] as f64 * self.pixel_m[0]);
        let axis = if count[axis] > 1 { axis } else { 1 - axis };
        if count[axis] == 1 {
            // The centre is on a surface within rounding.
            slice[pixels.low[1] * self.columns + pixels.low[0]] = contents.beneath_label();
            return;
        }
        let middle = usize::midpoint(pixels.low[axis], pixels.high[axis]);
        let (mut lower, mut upper) = (*pixels, *pixels);
        lower.high[axis] = middle;
        upper.low[axis] = middle;
        for half in [lower, upper] {
            let inner = self.raster.within(contents, &self.centres(&half), stack);
            self.label_pixels(&half, &inner, stack, slice);
        }
    }

    /// The box that the centres of some pixels span.
    fn centres(&self, pixels: &Pixels) -> Cell {
        let edge =
            |axis: usize| (pixels.high[axis] - 1 - pixels.low[axis]) as f64 * self.pixel_m[axis];
        let half = Vector3::new(0.5 * edge(0), 0.5 * edge(1), 0.0);
        let low = Vector3::new(
            pixels.low[0] as f64 * self.pixel_m[0],
            pixels.low[1] as f64 * self.pixel_m[1],
            0.0,
        );
        Cell {
            centre: self.origin + low + half,
            half,
        }
    }
}
