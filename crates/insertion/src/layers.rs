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
}

/// The integral of the tip's force from the skin on, with its sign before and behind a turn.
pub(crate) struct Impulse<'l> {
    layers: std::slice::Iter<'l, Layer>,
    /// Where the tip is turned and has not been yet, m.
    turn_at_m: f64,
    sign: f64,
    /// The last layer that was reached: its end, m, and its force, N.
    end_m: f64,
    layer_n: f64,
    /// Of one force: from where, with what is summed up to there, to where.
    from_m: f64,
    sum_nm: f64,
    to_m: f64,
    force_n: f64,
}

impl<'l> Impulse<'l> {
    pub fn new(layers: &'l Layers, turn_at_m: Option<f64>) -> Self {
        Self {
            layers: layers.all.iter(),
            turn_at_m: turn_at_m.unwrap_or(f64::INFINITY),
            sign: 1.0,
            end_m: 0.0,
            layer_n: 0.0,
            from_m: 0.0,
            sum_nm: 0.0,
            to_m: 0.0,
            force_n: 0.0,
        }
    }

    /// Up to a depth that is not before the last one, N m.
    #[inline(always)]
    pub fn until_nm(&mut self, depth_m: f64) -> f64 {
        while depth_m > self.to_m {
            self.go_on();
        }
        self.sum_nm + self.force_n * (depth_m - self.from_m)
    }

    /// Into the next layer, or behind the turn.
    #[inline(never)]
    fn go_on(&mut self) {
        self.sum_nm += self.force_n * (self.to_m - self.from_m);
        self.from_m = self.to_m;
        if self.from_m >= self.turn_at_m {
            (self.turn_at_m, self.sign) = (f64::INFINITY, -1.0);
        }
        if self.from_m >= self.end_m {
            let next = self.layers.next();
            self.end_m += next.map_or(f64::INFINITY, |layer| layer.length_m);
            self.layer_n = next.map_or(0.0, |layer| layer.force_n);
        }
        self.to_m = self.end_m.min(self.turn_at_m);
        self.force_n = self.layer_n * self.sign;
    }
}
