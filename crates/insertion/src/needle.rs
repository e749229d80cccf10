//! Needles: sizes, and how stiff they are.

use std::f64::consts::PI;

/// Young's modulus of stainless steel, Pa; 5 % from one alloy to another.
pub const STEEL_PA: f64 = 200e9;

/// Nominal outer and inner diameters of regular walls, mm, by gauge (chart of the Birmingham gauge for needles).
const SIZES_MM: [(u8, f64, f64); 7] = [
    (16, 1.651, 1.194),
    (17, 1.473, 1.067),
    (18, 1.270, 0.838),
    (19, 1.067, 0.686),
    (20, 0.908, 0.603),
    (21, 0.819, 0.514),
    (22, 0.718, 0.413),
];

/// A needle's gauge, 16 to 22.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Gauge(u8);

impl Gauge {
    /// All that there are, the thickest first.
    pub const ALL: [Self; 7] = [
        Self(16),
        Self(17),
        Self(18),
        Self(19),
        Self(20),
        Self(21),
        Self(22),
    ];

    /// None where there is no such gauge in the chart.
    pub fn new(gauge: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|each| each.0 == gauge)
    }

    /// Its number.
    pub fn number(self) -> u8 {
        self.0
    }

    /// Nominal outer and inner diameter of a regular wall, m.
    pub fn diameters_m(self) -> [f64; 2] {
        let found = SIZES_MM.iter().find(|(gauge, ..)| *gauge == self.0);
        let (_, outer_mm, inner_mm) = found.expect("the chart has every gauge");
        [outer_mm * 1e-3, inner_mm * 1e-3]
    }

    /// A needle of this gauge, of steel, with a solid stylet in it.
    pub fn needle(self) -> Needle {
        let [outer_m, inner_m] = self.diameters_m();
        Needle {
            outer_m,
            inner_m,
            has_stylet: true,
            young_pa: STEEL_PA,
        }
    }
}

/// A cannula, with or without its stylet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Needle {
    /// Outer diameter, m.
    pub outer_m: f64,
    /// Inner diameter, m.
    pub inner_m: f64,
    /// A solid stylet of the inner diameter is in it. The two slide on each other: their stiffnesses add.
    pub has_stylet: bool,
    /// Young's modulus, Pa.
    pub young_pa: f64,
}

/// Why a needle is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NeedleError {
    /// Outer diameter.
    #[error("an outer diameter of {0} m: a needle is 0.1 to 5 mm thick")]
    Outer(f64),
    /// Inner diameter.
    #[error("an inner diameter of {inner_m} m in a needle of {outer_m} m")]
    Inner {
        /// Inner diameter, m.
        inner_m: f64,
        /// Outer diameter, m.
        outer_m: f64,
    },
    /// Young's modulus.
    #[error("a Young's modulus of {0} Pa: steel has 2e11, nitinol 5e10 to 7.5e10")]
    Young(f64),
}

impl Needle {
    /// Checks its sizes.
    ///
    /// # Errors
    /// [`NeedleError`].
    pub fn check(&self) -> Result<(), NeedleError> {
        let Self {
            outer_m,
            inner_m,
            young_pa,
            ..
        } = *self;
        if !(1e-4..=5e-3).contains(&outer_m) {
            return Err(NeedleError::Outer(outer_m));
        }
        if !(0.0..outer_m).contains(&inner_m) {
            return Err(NeedleError::Inner { inner_m, outer_m });
        }
        if !(1e9..=1e12).contains(&young_pa) {
            return Err(NeedleError::Young(young_pa));
        }
        Ok(())
    }

    /// Bending stiffness EI, N m2: of a tube, and of the rod in it.
    pub fn bending_stiffness_nm2(&self) -> f64 {
        let fourth = |diameter_m: f64| (diameter_m * diameter_m) * (diameter_m * diameter_m);
        let bore = if self.has_stylet {
            0.0
        } else {
            fourth(self.inner_m)
        };
        self.young_pa * PI / 64.0 * (fourth(self.outer_m) - bore)
    }
}
