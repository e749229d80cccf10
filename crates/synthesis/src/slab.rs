//! What one slice sees of a scene: the mean over its thickness, on cells of a part of a pixel.

use nalgebra::Vector3;

use super::raster::{Cell, Contents, Raster, Stack};
use super::scanner::SliceProfile;

/// Layers of a slice are at most this thick, m: second order in it over radii is kept, 0.5 um for 2.5 mm.
const LAYER_M: f64 = 0.5e-3;
/// Where the bell is cut off, in thicknesses: 2.9 standard deviations.
const BELL_REACH: f64 = 1.25;

/// Cells of a block that one surface crosses and that are asked one by one (measured).
const ASKED_CELLS: usize = 16;

/// Layers of a slice, and how much each counts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layers {
    /// Of one layer, m.
    thickness_m: f64,
    /// Sum of the weights of all layers below each one, and of all.
    weight_below: Vec<f64>,
}

impl Layers {
    pub fn new(profile: SliceProfile, slice_thickness_m: f64) -> Self {
        let extent_m = match profile {
            SliceProfile::Box => slice_thickness_m,
            SliceProfile::Bell => 2.0 * BELL_REACH * slice_thickness_m,
        };
        let count = (extent_m / LAYER_M).ceil().max(1.0);
        let thickness_m = extent_m / count;
        // Integral of the profile from its middle, up to a factor.
        let integral = |height_m: f64| match profile {
            SliceProfile::Box => height_m,
            SliceProfile::Bell => {
                let sigma_m = slice_thickness_m / (8.0 * std::f64::consts::LN_2).sqrt();
                needlebench_numerics::normal::probability_below(height_m / sigma_m)
            }
        };
        let from_bottom = |layer: usize| {
            integral(layer as f64 * thickness_m - 0.5 * extent_m) - integral(-0.5 * extent_m)
        };
        let count = count as usize;
        let all = from_bottom(count);
        Self {
            thickness_m,
            weight_below: (0..=count).map(|layer| from_bottom(layer) / all).collect(),
        }
    }

    fn count(&self) -> usize {
        self.weight_below.len() - 1
    }
}

/// Cells in a slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cells {
    /// Columns and rows of cells.
    pub size: [usize; 2],
    /// Edges of a cell, m.
    pub edge_m: [f64; 2],
}

/// Boxes of cells and layers, from one of each to all of a slice.
#[derive(Debug, Clone, Copy)]
struct Block {
    low: [usize; 3],
    high: [usize; 3],
}

impl Block {
    fn count(&self) -> usize {
        (0..3)
            .map(|axis| self.high[axis] - self.low[axis])
            .product()
    }
}

/// Makes the slices of a scene one at a time.
#[derive(Debug)]
pub(super) struct SlabPainter<'r> {
    raster: &'r Raster,
    layers: &'r Layers,
    cells: Cells,
    /// Corner of the slice's first cell and layer in the raster's frame.
    corner: Vector3<f64>,
    stack: Stack,
}

impl<'r> SlabPainter<'r> {
    pub fn new(raster: &'r Raster, layers: &'r Layers, cells: Cells) -> Self {
        Self {
            raster,
            layers,
            cells,
            corner: Vector3::zeros(),
            stack: Stack::default(),
        }
    }

    /// Adds to `image`, which has a value for each cell, what a slice sees whose first cell has its centre there.
    pub fn paint(&mut self, first_centre: Vector3<f64>, image: &mut [f32]) {
        let [columns, rows] = self.cells.size;
        let layers = self.layers.count();
        let [width_m, height_m] = self.cells.edge_m;
        let half_slice_m = 0.5 * layers as f64 * self.layers.thickness_m;
        self.corner = first_centre - Vector3::new(0.5 * width_m, 0.5 * height_m, half_slice_m);
        let all = Block {
            low: [0; 3],
            high: [columns, rows, layers],
        };
        let cell = self.cell(&all);
        let outer = self.raster.all_in(&cell, &mut self.stack);
        let contents = self.raster.within(&outer, &cell, &mut self.stack);
        self.paint_block(&all, &contents, image);
    }

    fn paint_block(&mut self, block: &Block, contents: &Contents, image: &mut [f32]) {
        if let Some(material) = contents.uniform() {
            self.fill(block, material.hu, image);
            return;
        }
        // Of one surface, asking each cell is quicker than halving further.
        let count = block.count();
        if count == 1 || (count <= ASKED_CELLS && contents.is_single()) {
            self.paint_cells(block, contents, image);
            return;
        }
        let axis = self.longest_axis(block);
        let middle = usize::midpoint(block.low[axis], block.high[axis]);
        let (mut lower, mut upper) = (*block, *block);
        lower.high[axis] = middle;
        upper.low[axis] = middle;
        for half in [lower, upper] {
            let cell = self.cell(&half);
            let inner = self.raster.within(contents, &cell, &mut self.stack);
            self.paint_block(&half, &inner, image);
        }
    }

    fn paint_cells(&mut self, block: &Block, contents: &Contents, image: &mut [f32]) {
        for layer in block.low[2]..block.high[2] {
            for row in block.low[1]..block.high[1] {
                for column in block.low[0]..block.high[0] {
                    let one = Block {
                        low: [column, row, layer],
                        high: [column + 1, row + 1, layer + 1],
                    };
                    let cell = self.cell(&one);
                    let hu = self.raster.mean_hu(contents, &cell, &mut self.stack);
                    self.fill(&one, hu, image);
                }
            }
        }
    }

    fn edge_m(&self, axis: usize) -> f64 {
        match axis {
            2 => self.layers.thickness_m,
            _ => self.cells.edge_m[axis],
        }
    }

    fn cell(&self, block: &Block) -> Cell {
        let half = Vector3::from_fn(|axis, _| {
            0.5 * self.edge_m(axis) * (block.high[axis] - block.low[axis]) as f64
        });
        let low = Vector3::from_fn(|axis, _| self.edge_m(axis) * block.low[axis] as f64);
        Cell {
            centre: self.corner + low + half,
            half,
        }
    }

    /// Along which a block of more than one cell is halved.
    fn longest_axis(&self, block: &Block) -> usize {
        let length_m = |axis: usize| match block.high[axis] - block.low[axis] {
            1 => 0.0,
            count => count as f64 * self.edge_m(axis),
        };
        let longer = |a: usize, b: usize| if length_m(b) > length_m(a) { b } else { a };
        longer(longer(0, 1), 2)
    }

    fn fill(&self, block: &Block, hu: f64, image: &mut [f32]) {
        let weight =
            self.layers.weight_below[block.high[2]] - self.layers.weight_below[block.low[2]];
        let value = (hu * weight) as f32;
        for row in block.low[1]..block.high[1] {
            let start = row * self.cells.size[0];
            for cell in &mut image[start + block.low[0]..start + block.high[0]] {
                *cell += value;
            }
        }
    }
}
