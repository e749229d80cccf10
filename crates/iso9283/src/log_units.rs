//! What a tracker's log does not say of its columns.

/// Units of columns whose names do not say them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LogUnits {
    /// Unit of lengths.
    pub length: Option<&'static str>,
    /// Unit of angles.
    pub angle: Option<&'static str>,
    /// What columns `rx`, `ry`, `rz` mean.
    pub rotation: Option<RotationColumns>,
}

/// What columns `rx`, `ry`, `rz` mean: the same names are in use for different things.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RotationColumns {
    /// Axis times angle, as a UR controller shows poses.
    RotationVector,
    /// Turns about the fixed axes x, then y, then z, as SpatialAnalyzer shows frames.
    FixedXyz,
}

/// What a unit is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dimension {
    Length,
    Angle,
    Time,
}

/// Units that headings have: how they are written, of what, and the power of ten and the factor to SI.
const UNITS: [(&str, Dimension, i32, f64); 12] = [
    ("m", Dimension::Length, 0, 1.0),
    ("mm", Dimension::Length, -3, 1.0),
    ("um", Dimension::Length, -6, 1.0),
    ("µm", Dimension::Length, -6, 1.0),
    ("in", Dimension::Length, 0, 0.0254),
    ("inch", Dimension::Length, 0, 0.0254),
    ("rad", Dimension::Angle, 0, 1.0),
    ("mrad", Dimension::Angle, 0, 1e-3),
    ("deg", Dimension::Angle, 0, 1.0_f64.to_radians()),
    ("°", Dimension::Angle, 0, 1.0_f64.to_radians()),
    ("s", Dimension::Time, 0, 1.0),
    ("ms", Dimension::Time, -3, 1.0),
];

/// Whether a word is a unit.
pub(super) fn is_unit(word: &str) -> bool {
    UNITS.iter().any(|(unit, ..)| *unit == word)
}

/// Power of ten and factor to SI of a unit.
pub(super) fn to_si(unit: &str, of: Dimension) -> Option<(i32, f64)> {
    let mut units = UNITS.iter();
    units
        .find(|(name, what, ..)| (*name, *what) == (unit, of))
        .map(|(_, _, places, factor)| (*places, *factor))
}
