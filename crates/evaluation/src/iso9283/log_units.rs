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
