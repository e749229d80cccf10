//! What a needle passes.

/// A layer of one tissue along the needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// Length along the needle, m.
    pub length_m: f64,
    /// Stiffness: force per length per displacement, N/m2. None in gas.
    pub stiffness_n_m2: f64,
    /// Force across a bevelled tip, towards the bevel's long side, N.
    pub force_n: f64,
}

/// Layers from the skin inwards.
#[derive(Debug, Clone, PartialEq)]
pub struct Layers {
    all: Vec<Layer>,
    /// Depths of their ends, m from the skin.
    ends_m: Vec<f64>,
}

/// Why layers are none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayersError {
    /// There are none.
    #[error("no layers: there is nothing that a needle could pass")]
    None,
    /// A length.
    #[error("layer {number} is {length_m} m long: it has to be above 0 and at most 1 m")]
    Length {
        /// From 1.
        number: usize,
        /// Length, m.
        length_m: f64,
    },
    /// A stiffness.
    #[error(
        "layer {number} has a stiffness of {stiffness_n_m2} N/m2, of 0 to 1e6: was N/mm2 meant?"
    )]
    Stiffness {
        /// From 1.
        number: usize,
        /// Stiffness, N/m2.
        stiffness_n_m2: f64,
    },
    /// A force.
    #[error("layer {number} has a force of {force_n} N across the tip, of -5 to 5")]
    Force {
        /// From 1.
        number: usize,
        /// Force, N.
        force_n: f64,
    },
}

/// Softest and stiffest tissue, N/m2.
const STIFFNESSES_N_M2: std::ops::RangeInclusive<f64> = 0.0..=1e6;

/// Largest force across a tip, N.
const FORCE_N: f64 = 5.0;

impl Layers {
    /// Layers one behind the other, the first one at the skin.
    ///
    /// # Errors
    /// [`LayersError`].
    pub fn new(all: Vec<Layer>) -> Result<Self, LayersError> {
        if all.is_empty() {
            return Err(LayersError::None);
        }
        let mut ends_m = Vec::with_capacity(all.len());
        let mut end_m = 0.0;
        for (index, layer) in all.iter().enumerate() {
            let number = index + 1;
            let Layer {
                length_m,
                stiffness_n_m2,
                force_n,
            } = *layer;
            if !(length_m > 0.0 && length_m <= 1.0) {
                return Err(LayersError::Length { number, length_m });
            }
            if !STIFFNESSES_N_M2.contains(&stiffness_n_m2) {
                return Err(LayersError::Stiffness {
                    number,
                    stiffness_n_m2,
                });
            }
            if force_n.is_nan() || force_n.abs() > FORCE_N {
                return Err(LayersError::Force { number, force_n });
            }
            end_m += length_m;
            ends_m.push(end_m);
        }
        Ok(Self { all, ends_m })
    }

    /// Of layers whose lengths were checked.
    pub(crate) fn from_checked(all: Vec<Layer>) -> Self {
        let mut end_m = 0.0;
        let ends_m = all.iter().map(|layer| {
            end_m += layer.length_m;
            end_m
        });
        Self {
            ends_m: ends_m.collect(),
            all,
        }
    }

    /// In their order.
    pub fn all(&self) -> &[Layer] {
        &self.all
    }

    /// Depth of the last one's end, m.
    pub fn depth_m(&self) -> f64 {
        self.ends_m.last().copied().unwrap_or(0.0)
    }

    /// Depths at which a layer ends, m.
    pub fn ends_m(&self) -> &[f64] {
        &self.ends_m
    }

    /// The integral of the tip's force from the skin to a depth, with its sign before and behind `turn_at_m`, N m.
    pub(crate) fn impulse_nm(&self, depth_m: f64, turn_at_m: Option<f64>) -> f64 {
        let mut from_m = 0.0;
        let mut sum = 0.0;
        for (layer, &end_m) in self.all.iter().zip(&self.ends_m) {
            let to_m = end_m.min(depth_m);
            if to_m <= from_m {
                break;
            }
            let turned_m = turn_at_m.map_or(0.0, |turn_m| (to_m - turn_m.max(from_m)).max(0.0));
            sum += layer.force_n * (to_m - from_m - 2.0 * turned_m);
            from_m = end_m;
        }
        sum
    }
}
