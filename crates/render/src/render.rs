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
use crate::scene::{Label, Scene};

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

/// At a sample where nothing is.
const NOTHING: Nearest = Nearest {
    nearness: f32::NEG_INFINITY,
    primitive: NONE,
};

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
    let stage = Stage::new(scene, camera);
    stage.labelled(stage.seen.iter().map(|seen| seen.color), &scene.labels)
}

/// What several pictures of one camera have in common, drawn once.
pub struct Stage {
    view: View,
    lamps: Lamps,
    floor: Option<FloorView>,
    frame: Frame<'static>,
    /// By pixel, with nothing else there.
    seen: Vec<Seen>,
}

/// A pixel of a picture.
#[derive(Debug, Clone, Copy)]
struct Seen {
    color: [u8; 3],
    /// Cell of the floor's shadow; none where no floor is seen.
    shadow: Option<u16>,
}

impl Stage {
    /// Of what stands in all pictures. Labels are each picture's own.
    pub fn new(scene: &Scene, camera: &Camera) -> Self {
        let view = View::new(camera);
        let lamps = Lamps::new(&view);
        let floor = scene
            .floor
            .as_ref()
            .and_then(|floor| FloorView::new(floor, scene, &view, &lamps.key_in_world));
        let frame = Frame::draw(scene, &view, None);
        let seen = frame.resolve(&Lit {
            view: &view,
            lamps: &lamps,
            floor: floor.as_ref(),
            encoder: &Encoder::new(),
            known: None,
        });
        Self {
            view,
            lamps,
            floor,
            frame,
            seen,
        }
    }

    /// A picture of the stage with more things on it: the same as of one scene of the stage's things and then these,
    /// but for which of two things is seen that are equally near. There is no other floor than the stage's.
    pub fn picture(&self, things: &Scene) -> Image {
        let frame = Frame::draw(things, &self.view, Some(&self.frame));
        let floor = self.floor.as_ref().map(|floor| floor.under(things));
        let floors = self.floor.as_ref().zip(floor.as_ref());
        let shaded_anew = floors.map_or_else(Vec::new, |(old, new)| new.shaded_unlike(old));
        let seen = frame.resolve(&Lit {
            view: &self.view,
            lamps: &self.lamps,
            floor: floor.as_ref(),
            encoder: &Encoder::new(),
            known: Some(Known {
                seen: &self.seen,
                shaded_anew: &shaded_anew,
            }),
        });
        self.labelled(seen.into_iter().map(|seen| seen.color), &things.labels)
    }

    fn labelled(&self, pixels: impl Iterator<Item = [u8; 3]>, labels: &[Label]) -> Image {
        let mut image = Image::from_pixels(self.view.width_px, pixels.collect());
        label::draw(&mut image, labels, &self.view);
        image
    }
}

/// In what light a frame is seen.
struct Lit<'a> {
    view: &'a View,
    lamps: &'a Lamps,
    floor: Option<&'a FloorView>,
    encoder: &'a Encoder,
    known: Option<Known<'a>>,
}

/// What a pixel is like that shows nothing but what was drawn before.
#[derive(Clone, Copy)]
struct Known<'a> {
    seen: &'a [Seen],
    /// By cell of the floor's shadow, whether it is another one around there.
    shaded_anew: &'a [bool],
}

/// Everything visible, sample by sample.
struct Frame<'a> {
    grid: Grid,
    /// What was drawn before.
    under: Option<&'a Frame<'a>>,
    /// Number of primitives that were drawn before.
    before: u32,
    materials: Vec<Material>,
    primitives: Vec<Primitive>,
    nearest: Tiles<Nearest>,
    /// First fragment of each sample.
    first: Tiles<u32>,
    fragments: Vec<Fragment>,
}

impl<'a> Frame<'a> {
    fn draw(scene: &Scene, view: &View, under: Option<&'a Frame<'a>>) -> Self {
        let grid = Grid {
            columns: view.width_px * SAMPLES_PER_PIXEL,
            rows: view.height_px * SAMPLES_PER_PIXEL,
        };
        let before = under.map_or(0, Frame::count);
        let mut nearest = Tiles::new(grid);
        let mut assembler = Assembler::new(view, before);

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
                let known = nearest.at(sample, |sample| opaque(None, under, sample));
                if nearness > known.nearness {
                    *known = Nearest {
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
        let mut first = Tiles::new(grid);
        let mut translucent = |primitive, corners| {
            rasterise(corners, Facing::Front, grid, |sample, nearness| {
                // Indices beyond 32 bits would need tens of gigabytes; such fragments are dropped.
                let position = u32::try_from(fragments.len()).unwrap_or(NONE);
                let behind = opaque(Some(&nearest), under, sample);
                if nearness > behind.nearness && position != NONE {
                    let first = first.at(sample, |_| NONE);
                    fragments.push(Fragment {
                        nearness,
                        primitive,
                        next: *first,
                    });
                    *first = position;
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
            under,
            before,
            materials,
            primitives,
            nearest,
            first,
            fragments,
        }
    }

    /// Number of primitives, of what was drawn before too.
    fn count(&self) -> u32 {
        self.before + u32::try_from(self.primitives.len()).unwrap_or(NONE - self.before)
    }

    /// Lights what is seen and mixes the samples of each pixel.
    fn resolve(&self, lit: &Lit<'_>) -> Vec<Seen> {
        let view = lit.view;
        let nothing = Seen {
            color: [0; 3],
            shadow: None,
        };
        let mut pixels = lit.known.map_or_else(
            || vec![nothing; view.width_px * view.height_px],
            |known| known.seen.to_vec(),
        );
        // Pixels do not depend on each other, so the number of threads shows in the time only.
        let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
        let row = |(): &mut (), y: usize, row: &mut [Seen]| self.resolve_row(lit, y, row);
        in_parts(threads, &mut pixels, view.width_px, || (), row);
        pixels
    }

    fn resolve_row(&self, lit: &Lit<'_>, y: usize, row: &mut [Seen]) {
        let view = lit.view;
        let background = BACKGROUND.map(color::light);
        let mut pixel = Pixel::default();
        let along = (y as f32 + 0.5) / view.height_px as f32;
        let behind = background[0] * (1.0 - along) + background[1] * along;
        for (x, seen) in row.iter_mut().enumerate() {
            let samples = self.samples(x, y);
            let stays = |known: &Known<'_>| {
                let is_new = |cell| known.shaded_anew[usize::from(cell)];
                !seen.shadow.is_some_and(is_new) && !self.has_new(&samples)
            };
            if lit.known.as_ref().is_some_and(stays) {
                continue;
            }
            let nearest = samples.map(|sample| self.nearest(sample));
            let farthest = nearest
                .iter()
                .map(|near| near.nearness)
                .fold(f32::INFINITY, f32::min);
            let center_px = [x as f64 + 0.5, y as f64 + 0.5];
            let looked = Looked {
                frame: self,
                view,
                lamps: lit.lamps,
                behind,
                floor: lit
                    .floor
                    .and_then(|floor| floor.look(view, center_px, farthest)),
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
            *seen = Seen {
                color: lit.encoder.encode(&light),
                shadow: looked.floor.map(|floor| floor.shadow),
            };
        }
    }

    /// Whether something was drawn at one of a pixel's samples, or beside it where an outline would be, since what is
    /// under this.
    fn has_new(&self, samples: &[usize; SAMPLES]) -> bool {
        let is_new = |sample: usize| {
            let opaque = self.nearest.get(sample);
            opaque.is_some_and(|it| it.primitive >= self.before && it.primitive != NONE)
                || self.first.get(sample).is_some_and(|first| *first != NONE)
        };
        samples.iter().any(|&sample| {
            is_new(sample) || is_new(sample + 1) || is_new(sample + self.grid.columns)
        })
    }

    /// What is opaque at a sample.
    fn nearest(&self, sample: usize) -> Nearest {
        opaque(Some(&self.nearest), self.under, sample)
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

    /// Translucent things at a sample, before what is opaque there: those of what is under this, then its own.
    fn fragments(&self, sample: usize) -> impl Iterator<Item = &Fragment> {
        let nearness = self.nearest(sample).nearness;
        let under = self.under.map(|under| (under, under.first.get(sample)));
        let all = under.into_iter().chain([(self, self.first.get(sample))]);
        all.flat_map(|(frame, first)| {
            let at = |position: &u32| frame.fragments.get(*position as usize);
            std::iter::successors(first.and_then(at), move |fragment| at(&fragment.next))
        })
        .filter(move |fragment| fragment.nearness > nearness)
    }

    /// Whether the samples show the same translucent things; they were drawn in the same order.
    fn same_fragments(&self, samples: &[usize; SAMPLES]) -> bool {
        if self.is_opaque() {
            return true;
        }
        let [mut first, mut others @ ..] = samples.map(|sample| self.fragments(sample));
        loop {
            let next = first.next().map(|fragment| fragment.primitive);
            let is_same = |other: &mut _| {
                Iterator::next(other).map(|fragment: &Fragment| fragment.primitive) == next
            };
            if !others.iter_mut().all(is_same) {
                return false;
            }
            if next.is_none() {
                return true;
            }
        }
    }

    /// Whether nothing is translucent.
    fn is_opaque(&self) -> bool {
        self.fragments.is_empty() && self.under.is_none_or(Frame::is_opaque)
    }

    /// A primitive with its material.
    fn primitive(&self, index: u32) -> Option<(&Primitive, &Material)> {
        let Some(own) = index.checked_sub(self.before) else {
            return self.under?.primitive(index);
        };
        let primitive = self.primitives.get(own as usize)?;
        Some((primitive, self.materials.get(primitive.material as usize)?))
    }

    fn material(&self, primitive: u32) -> Option<&Material> {
        Some(self.primitive(primitive)?.1)
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
            other < self.grid.columns * self.grid.rows
                && self.parted(self.nearest(sample), self.nearest(other))
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

/// What is opaque at a sample, of one's own or what was drawn before.
fn opaque(own: Option<&Tiles<Nearest>>, under: Option<&Frame<'_>>, sample: usize) -> Nearest {
    let known = own.and_then(|own| own.get(sample)).copied();
    known
        .or_else(|| Some(under?.nearest(sample)))
        .unwrap_or(NOTHING)
}

/// Samples of a tile.
const TILE: usize = 128;

/// A value of each sample; tiles in which nothing was drawn take no memory.
struct Tiles<T>(Vec<Option<Box<[T; TILE]>>>);

impl<T> Tiles<T> {
    fn new(grid: Grid) -> Self {
        let tiles = (grid.columns * grid.rows).div_ceil(TILE);
        Self((0..tiles).map(|_| None).collect())
    }

    /// The value at a sample, if anything was drawn near it.
    fn get(&self, sample: usize) -> Option<&T> {
        let tile = self.0.get(sample / TILE)?.as_ref()?;
        Some(&tile[sample % TILE])
    }

    /// The value at a sample; `before` has those of samples that were not drawn at.
    fn at(&mut self, sample: usize, before: impl Fn(usize) -> T) -> &mut T {
        let start = sample - sample % TILE;
        let tile = self.0[sample / TILE]
            .get_or_insert_with(|| Box::new(std::array::from_fn(|at| before(start + at))));
        &mut tile[sample % TILE]
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
    frame: &'a Frame<'a>,
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
        } = self.frame.nearest(sample);
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
        if !self.frame.is_opaque() {
            let mut stack = std::mem::take(&mut pixel.stack);
            stack.clear();
            stack.extend(self.frame.fragments(sample));
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
        let (thing, material) = self.frame.primitive(primitive).expect("it was drawn");
        let normal = thing.normal(&point_m.cast());
        let (light, opacity) = self.lamps.shade(material, normal, -direction.cast::<f32>());
        pixel.lit.push((primitive, light, opacity));
        (light, opacity)
    }
}
