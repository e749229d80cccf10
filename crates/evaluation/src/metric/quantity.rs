//! What metrics measure, and the units that people give and read them in.

/// What a metric measures, with its SI unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// m.
    Length,
    /// rad.
    Angle,
    /// s.
    Time,
    /// N.
    Force,
    /// m/rad, the same number as mm/mrad.
    LengthPerAngle,
    /// m^3.
    Volume,
    /// A plain number.
    Ratio,
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

impl Quantity {
    /// Differences up to this, in SI units, are none where a metric states no other: 0.001 deg, 1 um, and
    /// a millionth of whatever else there is.
    pub(super) const fn resolution(self) -> f64 {
        match self {
            Self::Angle => 1e-3 * DEGREE,
            _ => 1e-6,
        }
    }

    /// Unit in reports.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Length => "m",
            Self::Angle => "rad",
            Self::Time => "s",
            Self::Force => "N",
            Self::LengthPerAngle => "m/rad",
            Self::Volume => "m^3",
            Self::Ratio => "1",
        }
    }

    /// A value as people read it: mm, degrees and so on, with its unit.
    pub fn text(self, value: f64) -> String {
        match self {
            Self::Length => length_text(value),
            Self::Angle if value != 0.0 && value.to_degrees().abs() < 0.01 => {
                format!("{:.3e} deg", value.to_degrees())
            }
            Self::Angle => format!("{:.2} deg", value.to_degrees()),
            Self::Time => format!("{value:.2} s"),
            Self::Force => format!("{value:.2} N"),
            Self::LengthPerAngle => format!("{value:.2} mm/mrad"),
            Self::Volume => format!("{value:.2e} m^3"),
            Self::Ratio => format!("{value:.2}"),
        }
    }

    /// Units that people may give it in, with their size in SI.
    pub fn units(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Length => &[
                ("mm", 1e-3),
                ("m", 1.0),
                ("cm", 1e-2),
                ("um", 1e-6),
                ("nm", 1e-9),
            ],
            Self::Angle => &[("deg", DEGREE), ("rad", 1.0), ("mrad", 1e-3)],
            Self::Time => &[("s", 1.0), ("ms", 1e-3)],
            Self::Force => &[("N", 1.0), ("mN", 1e-3)],
            Self::LengthPerAngle => &[("mm/mrad", 1.0), ("m/rad", 1.0), ("mm/deg", 1e-3 / DEGREE)],
            Self::Volume => &[("m^3", 1.0)],
            Self::Ratio => &[("", 1.0)],
        }
    }

    /// Unit in tables of results, unless a metric has another one.
    pub(super) const fn column_unit(self) -> Unit {
        match self {
            Self::Length => Unit::MILLIMETRE,
            Self::Angle => Unit::DEGREE,
            Self::Time => Unit::SECOND,
            Self::Force => Unit::NEWTON,
            Self::LengthPerAngle => Unit::MILLIMETRE_PER_MILLIRADIAN,
            Self::Volume => Unit::CUBIC_METRE,
            Self::Ratio => Unit::ONE,
        }
    }
}

fn length_text(metres: f64) -> String {
    let magnitude = metres.abs();
    if magnitude >= 1e-4 {
        format!("{:.1} mm", metres * 1e3)
    } else if magnitude >= 1e-7 {
        format!("{:.1} um", metres * 1e6)
    } else if magnitude >= 1e-10 {
        format!("{:.1} nm", metres * 1e9)
    } else if magnitude > 0.0 {
        "< 0.1 nm".to_owned()
    } else {
        "0 mm".to_owned()
    }
}

/// Unit of a column, and of a key of the scenario's `[ranking]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// As people write it; `1` of a plain number.
    pub symbol: &'static str,
    /// End of a column's name.
    pub suffix: &'static str,
    /// Its size in SI.
    pub si: f64,
}

impl Unit {
    pub(super) const MILLIMETRE: Self = Self::new("mm", "_mm", 1e-3);
    pub(super) const MICROMETRE: Self = Self::new("um", "_um", 1e-6);
    pub(super) const DEGREE: Self = Self::new("deg", "_deg", DEGREE);
    pub(super) const SECOND: Self = Self::new("s", "_s", 1.0);
    pub(super) const NEWTON: Self = Self::new("N", "_n", 1.0);
    pub(super) const MILLIMETRE_PER_MILLIRADIAN: Self = Self::new("mm/mrad", "_mm_mrad", 1.0);
    pub(super) const CUBIC_METRE: Self = Self::new("m^3", "_m3", 1.0);
    pub(super) const ONE: Self = Self::new("1", "", 1.0);
    pub(super) const RATIO: Self = Self::new("1", "_ratio", 1.0);

    const fn new(symbol: &'static str, suffix: &'static str, si: f64) -> Self {
        Self { symbol, suffix, si }
    }

    /// End of a name of a value in SI units: `_m` where columns have `_mm`.
    pub fn si_suffix(self) -> &'static str {
        match self.suffix {
            "_mm" | "_um" => "_m",
            "_deg" => "_rad",
            "_mm_mrad" => "_m_per_rad",
            same => same,
        }
    }

    /// A value in SI units with the seven digits that a column of a study keeps of it.
    pub fn as_column(self, value: f64) -> f64 {
        #[expect(clippy::cast_possible_truncation, reason = "as columns are")]
        let column = (value / self.si) as f32;
        f64::from(column) * self.si
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_unit_is_one_that_limits_may_be_given_in() {
        for quantity in [
            Quantity::Length,
            Quantity::Angle,
            Quantity::Time,
            Quantity::Force,
            Quantity::LengthPerAngle,
            Quantity::Volume,
            Quantity::Ratio,
        ] {
            let unit = quantity.column_unit();
            // What is no SI unit has another name in SI.
            let is_si = (unit.si - 1.0).abs() < f64::EPSILON;
            let keeps_its_name = unit.si_suffix() == unit.suffix;
            assert!(!keeps_its_name || is_si, "{unit:?}");
            let symbol = if unit.symbol == "1" { "" } else { unit.symbol };
            assert!(quantity.units().contains(&(symbol, unit.si)), "{unit:?}");
        }
    }
}
