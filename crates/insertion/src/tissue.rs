//! Coefficients of tissues, with what is known of them.

use crate::layers::Layer;

/// What a needle is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Tissue {
    /// Under the skin, and around organs.
    Fat,
    /// Muscles of the chest wall, and other soft tissue that has no entry of its own.
    Wall,
    /// Lung, with the vessels in it.
    Lung,
    /// A lesion.
    Lesion,
    /// Gas outside the lung: neither stiffness nor force.
    Gas,
    /// Fluid, as an effusion: neither stiffness nor force.
    Fluid,
}

/// A factor: the median, and the factor that two thirds of all lie within, up and down (a lognormal's one standard
/// deviation).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factor {
    /// Median.
    pub median: f64,
    /// One standard deviation, as a factor; 1 without any spread.
    pub spread: f64,
}

/// The force across a bevelled tip in the chest wall, N, of a needle of 1.27 mm (18 G) at the median stiffness.
///
/// From the bend of a 22 G held at its hub, 8.9 mm at 80 mm in ballistic gel (Rand et al. 2016, doi 10.1002/aapm.36607):
/// 0.0482, 0.0834, 0.1392 N at 20, 60, 150 kN/m2 (`tests::published_bends_are_met`), taken to 1.27 mm in proportion to
/// the diameter. The spread is assumed.
pub const WALL_FORCE_N: Factor = Factor {
    median: 0.0853,
    spread: 1.4,
};

/// The diameter that it is of, m.
pub const REFERENCE_DIAMETER_M: f64 = 1.27e-3;

/// Force grows with the diameter to this power (assumed: 0 to 2; nobody measured it).
pub const DIAMETER_POWER: f64 = 1.0;

/// Force grows with stiffness to this power: from the same three forces.
pub const STIFFNESS_POWER: f64 = 0.53;

/// The model itself: elastic foundations are 15 to 33 % off experiments (IMECE2021-V005T05A037).
pub const MODEL: Factor = Factor {
    median: 1.0,
    spread: 1.25,
};

/// A tip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Point {
    /// With one face: the needle bends away from it.
    Bevel,
    /// Pencil, diamond, trocar: in any direction, by 0.73 instead of 7.7 to 10 mm (Rand et al. 2016).
    Symmetric,
    /// A bevel that is rolled between the fingers all the way (assumed; van Veen et al. 2012 found less at 1 Hz).
    Rolled,
}

impl Point {
    /// Share of the bevel's force.
    pub fn share(self) -> f64 {
        match self {
            Self::Bevel => 1.0,
            Self::Symmetric => 0.08,
            Self::Rolled => 0.2,
        }
    }
}

impl Tissue {
    /// All that there are.
    pub const ALL: [Self; 6] = [
        Self::Fat,
        Self::Wall,
        Self::Lung,
        Self::Lesion,
        Self::Gas,
        Self::Fluid,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fat => "fat",
            Self::Wall => "wall",
            Self::Lung => "lung",
            Self::Lesion => "lesion",
            Self::Gas => "gas",
            Self::Fluid => "fluid",
        }
    }

    /// Stiffness, N/m2. Wall: presets for biopsies in a library for needle insertion (20 kN/m2; plastisol 4.8, gelatine 150
    /// to 167). All others are assumed.
    pub fn stiffness_n_m2(self) -> Factor {
        let (median, spread) = match self {
            Self::Fat => (5e3, 1.7),
            Self::Wall | Self::Lesion => (2e4, 1.8),
            Self::Lung => (2e3, 2.0),
            Self::Gas | Self::Fluid => (0.0, 1.0),
        };
        Factor { median, spread }
    }

    /// Force across the tip at the median stiffness, as a share of that in the wall at its own (assumed: what is tough
    /// decides it, Misra et al. 2008).
    pub fn force_share(self) -> Factor {
        let (median, spread) = match self {
            Self::Wall => (1.0, 1.0),
            Self::Lesion => (1.0, 1.5),
            Self::Fat => (0.6, 1.6),
            Self::Lung => (0.25, 1.9),
            Self::Gas | Self::Fluid => (0.0, 1.0),
        };
        Factor { median, spread }
    }

    /// A layer of it with medians, for a needle of an outer diameter.
    pub fn layer(self, length_m: f64, outer_m: f64) -> Layer {
        let [stiffness, share] = [self.stiffness_n_m2(), self.force_share()];
        self.layer_of(
            length_m,
            outer_m,
            stiffness.median,
            WALL_FORCE_N.median,
            share.median,
        )
    }

    /// A layer of it with a stiffness, N/m2, the force in the wall, N, and the share of it. A stiffer tissue than the median
    /// pushes the tip farther: independent of each other, stiff tissue would look safe.
    pub fn layer_of(
        self,
        length_m: f64,
        outer_m: f64,
        stiffness_n_m2: f64,
        wall_force_n: f64,
        share: f64,
    ) -> Layer {
        let median = self.stiffness_n_m2().median;
        let stiffer = if median > 0.0 {
            libm::pow(stiffness_n_m2 / median, STIFFNESS_POWER)
        } else {
            0.0
        };
        let thicker = libm::pow(outer_m / REFERENCE_DIAMETER_M, DIAMETER_POWER);
        Layer {
            length_m,
            stiffness_n_m2,
            force_n: wall_force_n * thicker * share * stiffer,
        }
    }
}
