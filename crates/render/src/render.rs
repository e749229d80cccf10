//! The renderer: visibility first, then light for what is seen.

use std::num::NonZero;

use needlebench_parallel::in_parts;

use crate::camera::{Camera, View};
use crate::color::{self, Encoder, Light};
use crate::floor::{FloorSample, FloorView};
use crate::geometry::{Assembler, Material, Primitive};
use crate::image::Image;
use crate::label;
use crate::lamps::Lamps;
use crate::raster::{Facing, Grid, SAMPLES_PER_PIXEL, rasterise};
use crate::scene::Scene;

/// No primitive, or no further fragment.
const NONE: u32 = u32::MAX;

/// Background at the top and at the bottom of the picture, sRGB.
const BACKGROUND: [[f32; 3]; 2] = [[0.90, 0.925, 0.955], [1.0, 1.0, 1.0]];

/// Samples of a pixel.
const SAMPLES: usize = SAMPLES_PER_PIXEL * SAMPLES_PER_PIXEL;

/// What is left of the colour along the outline of a thing.
const OUTLINE: f32 = 0.35;

/// Steps in depth, as parts of the depth, that are outlined between things of one colour.
const STEP: f32 = 0.005;

/// The nearest opaque thing at a sample.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    nearness: f32,
    primitive: u32,
}

/// A translucent thing at a sample.
#[derive(Debug, Clone, Copy)]
struct Fragment {
    nearness: f32,
    primitive: u32,
    /// Next fragment of the same sample.
    next: u32,
}

/// Renders the scene as the camera sees it; the same bytes for the same input.
pub fn render(scene: &Scene, camera: &Camera) -> Image {
    let view = View::new(camera);
    let lamps = Lamps::new(&view);
    let floor = scene
        .floor
        .as_ref()
        .and_then(|floor| FloorView::new(floor, scene, &view, &lamps.key_in_world));
    let pixels = Frame::draw(scene, &view).resolve(&view, &lamps, floor.as_ref());
    let mut image = Image::from_pixels(view.width_px, pixels);
    label::draw(&mut image, &scene.labels, &view);
    image
}

/// Everything visible, sample by sample.
struct Frame {
    grid: Grid,
    materials: Vec<Material>,
    primitives: Vec<Primitive>,
    nearest: Vec<Nearest>,
    /// First fragment of each sample; empty when nothing is translucent.
    first: Vec<u32>,
    fragments: Vec<Fragment>,
}

impl Frame {
    fn draw(scene: &Scene, view: &View) -> Self {
        let grid = Grid {
            columns: view.width_px * SAMPLES_PER_PIXEL,
            rows: view.height_px * SAMPLES_PER_PIXEL,
        };
        let nothing = Nearest {
            nearness: f32::NEG_INFINITY,
            primitive: NONE,
        };
        let mut nearest = vec![nothing; grid.columns * grid.rows];
        let mut assembler = Assembler::new(view);

        let surfaces: Vec<_> = scene
            .surfaces
            .iter()
            .map(|surface| (surface, Material::new(surface.color_rgba, true)))
            .collect();
        let lines: Vec<_> = scene
            .lines
            .iter()
            .map(|line| (line, Material::new(line.color_rgba, false)))
            .collect();
        let mut solid = |primitive, corners| {
            rasterise(corners, Facing::Both, grid, |sample, nearness| {
                if nearness > nearest[sample].nearness {
                    nearest[sample] = Nearest {
                        nearness,
                        primitive,
                    };
                }
            });
        };
        for (surface, material) in surfaces.iter().filter(|(_, material)| material.is_opaque()) {
            assembler.surface(surface, *material, &mut solid);
        }
        for (line, material) in lines.iter().filter(|(_, material)| material.is_opaque()) {
            assembler.line(line, *material, &mut solid);
        }

        let mut fragments: Vec<Fragment> = Vec::new();
        let is_seen = |material: &Material| !material.is_opaque() && material.opacity > 0.0;
        let any = surfaces.iter().any(|(_, material)| is_seen(material))
            || lines.iter().any(|(_, material)| is_seen(material));
        let mut first = if any {
            vec![NONE; nearest.len()]
        } else {
            Vec::new()
        };
        let mut translucent = |primitive, corners| {
            rasterise(corners, Facing::Front, grid, |sample, nearness| {
                // Indices beyond 32 bits would need tens of gigabytes; such fragments are dropped.
                let position = u32::try_from(fragments.len()).unwrap_or(NONE);
                if nearness > nearest[sample].nearness && position != NONE {
                    fragments.push(Fragment {
                        nearness,
                        primitive,
                        next: first[sample],
                    });
                    first[sample] = position;
                }
            });
        };
        for (surface, material) in surfaces.iter().filter(|(_, material)| is_seen(material)) {
            assembler.surface(surface, *material, &mut translucent);
        }
        for (line, material) in lines.iter().filter(|(_, material)| is_seen(material)) {
            assembler.line(line, *material, &mut translucent);
        }
        let Assembler {
            materials,
            primitives,
            ..
        } = assembler;
        Self {
            grid,
            materials,
            primitives,
            nearest,
            first,
            fragments,
        }
    }

    /// Lights what is seen and mixes the samples of each pixel.
    fn resolve(&self, view: &View, lamps: &Lamps, floor: Option<&FloorView<'_>>) -> Vec<[u8; 3]> {
        let encoder = &Encoder::new();
        let mut pixels = vec![[0; 3]; view.width_px * view.height_px];
        // Pixels do not depend on each other, so the number of threads shows in the time only.
        let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
        let row = |(): &mut (), y: usize, row: &mut [[u8; 3]]| {
            self.resolve_row(view, lamps, floor, encoder, y, row);
        };
        in_parts(threads, &mut pixels, view.width_px, || (), row);
        pixels
    }

    fn resolve_row(
        &self,
        view: &View,
        lamps: &Lamps,
        floor: Option<&FloorView<'_>>,
        encoder: &Encoder,
        y: usize,
        row: &mut [[u8; 3]],
    ) {
        let background = BACKGROUND.map(color::light);
        let mut pixel = Pixel::default();
        let along = (y as f32 + 0.5) / view.height_px as f32;
        let behind = background[0] * (1.0 - along) + background[1] * along;
        for (x, shown_pixel) in row.iter_mut().enumerate() {
            let samples = self.samples(x, y);
            let nearest = samples.map(|sample| self.nearest[sample]);
            let farthest = nearest
                .iter()
                .map(|near| near.nearness)
                .fold(f32::INFINITY, f32::min);
            let center_px = [x as f64 + 0.5, y as f64 + 0.5];
            let looked = Looked {
                frame: self,
                view,
                lamps,
                behind,
                floor: floor.and_then(|floor| floor.look(center_px, farthest)),
            };
            pixel.lit.clear();
            let outlines = self.outlines(&samples, x + 1 == view.width_px);
            let alike = nearest
                .iter()
                .all(|near| near.primitive == nearest[0].primitive)
                && outlines == [false; SAMPLES]
                && self.same_fragments(&samples);
            let shown = if alike { 1 } else { SAMPLES };
            let sum: Light = (0..shown)
                .map(|place| {
                    let at_px = sample_place(x, y, place);
                    looked.light(samples[place], at_px, outlines[place], &mut pixel)
                })
                .sum();
            let light = sum / shown as f32;
            *shown_pixel = encoder.encode(&light);
        }
    }

    fn samples(&self, x: usize, y: usize) -> [usize; SAMPLES] {
        let start = y * SAMPLES_PER_PIXEL * self.grid.columns + x * SAMPLES_PER_PIXEL;
        [
            start,
            start + 1,
            start + self.grid.columns,
            start + self.grid.columns + 1,
        ]
    }

    /// Whether the samples show the same translucent things; they were drawn in the same order.
    fn same_fragments(&self, samples: &[usize; SAMPLES]) -> bool {
        if self.first.is_empty() {
            return true;
        }
        let mut next = samples.map(|sample| self.first[sample]);
        while let Some(Fragment { primitive, .. }) = self.fragments.get(next[0] as usize) {
            for position in &mut next {
                match self.fragments.get(*position as usize) {
                    Some(fragment) if fragment.primitive == *primitive => *position = fragment.next,
                    _ => return false,
                }
            }
        }
        next == [NONE; SAMPLES]
    }

    fn material(&self, primitive: u32) -> Option<&Material> {
        let primitive = self.primitives.get(primitive as usize)?;
        self.materials.get(primitive.material as usize)
    }

    /// Whether two neighbouring samples show things that an outline separates.
    ///
    /// Parts of one colour that merge, as the pieces of a bone or a link do, are not separated.
    fn parted(&self, one: Nearest, other: Nearest) -> bool {
        if one.primitive == other.primitive {
            return false;
        }
        match (self.material(one.primitive), self.material(other.primitive)) {
            (Some(material), Some(another)) => {
                let step = (one.nearness - other.nearness).abs();
                !std::ptr::eq(material, another)
                    && (material.light != another.light || step > STEP * one.nearness.abs())
            }
            (one, other) => one.is_some() != other.is_some(),
        }
    }

    /// Whether another thing begins to the right of or below each sample of a pixel.
    fn outlines(&self, samples: &[usize; SAMPLES], last_column: bool) -> [bool; SAMPLES] {
        let begins = |sample: usize, other: usize| {
            self.nearest
                .get(other)
                .is_some_and(|&other| self.parted(self.nearest[sample], other))
        };
        let mut outlines = [false; SAMPLES];
        for (place, &sample) in samples.iter().enumerate() {
            let at_rim = last_column && place % SAMPLES_PER_PIXEL == SAMPLES_PER_PIXEL - 1;
            outlines[place] = (!at_rim && begins(sample, sample + 1))
                || begins(sample, sample + self.grid.columns);
        }
        outlines
    }
}

/// Place of a sample in the picture, px.
fn sample_place(x: usize, y: usize, place: usize) -> [f64; 2] {
    let at =
        |pixel: usize, step: usize| pixel as f64 + (step as f64 + 0.5) / SAMPLES_PER_PIXEL as f64;
    [
        at(x, place % SAMPLES_PER_PIXEL),
        at(y, place / SAMPLES_PER_PIXEL),
    ]
}

/// What has been computed for a pixel already; its samples mostly show the same things.
#[derive(Default)]
struct Pixel {
    lit: Vec<(u32, Light, f32)>,
    stack: Vec<Fragment>,
}

/// A pixel being looked at.
struct Looked<'a> {
    frame: &'a Frame,
    view: &'a View,
    lamps: &'a Lamps,
    /// Background.
    behind: Light,
    floor: Option<FloorSample>,
}

impl Looked<'_> {
    /// The light that comes from one sample.
    fn light(&self, sample: usize, at_px: [f64; 2], outline: bool, pixel: &mut Pixel) -> Light {
        let Nearest {
            nearness,
            primitive,
        } = self.frame.nearest[sample];
        let mut light = self.behind;
        if primitive != NONE {
            light = self.lit(primitive, nearness, at_px, pixel).0;
        }
        if let Some(floor) = self.floor.filter(|floor| floor.nearness > nearness) {
            light += (floor.light - light) * floor.opacity;
        }
        if outline {
            light *= OUTLINE;
        }
        if let Some(&first) = self.frame.first.get(sample) {
            let mut stack = std::mem::take(&mut pixel.stack);
            stack.clear();
            let mut next = first;
            while let Some(fragment) = self.frame.fragments.get(next as usize) {
                stack.push(*fragment);
                next = fragment.next;
            }
            stack.sort_unstable_by(|a, b| {
                a.nearness
                    .total_cmp(&b.nearness)
                    .then(a.primitive.cmp(&b.primitive))
            });
            for fragment in &stack {
                let (over, opacity) = self.lit(fragment.primitive, fragment.nearness, at_px, pixel);
                light += (over - light) * opacity;
            }
            pixel.stack = stack;
        }
        light
    }

    /// Light and opacity of a primitive, computed once per pixel.
    fn lit(
        &self,
        primitive: u32,
        nearness: f32,
        at_px: [f64; 2],
        pixel: &mut Pixel,
    ) -> (Light, f32) {
        if let Some((_, light, opacity)) = pixel.lit.iter().find(|lit| lit.0 == primitive) {
            return (*light, *opacity);
        }
        let (start, direction) = self.view.ray(at_px[0], at_px[1]);
        let point_m = start + direction * self.view.depth_m(f64::from(nearness));
        let thing = &self.frame.primitives[primitive as usize];
        let material = &self.frame.materials[thing.material as usize];
        let normal = thing.normal(&point_m.cast());
        let (light, opacity) = self.lamps.shade(material, normal, -direction.cast::<f32>());
        pixel.lit.push((primitive, light, opacity));
        (light, opacity)
    }
}
