//! What a file does not say itself.

/// Unit of positions in a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthUnit {
    /// m
    Metre,
    /// mm
    Millimetre,
}

impl LengthUnit {
    pub(crate) fn to_m(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => 1e-3,
        }
    }
}

/// What a file does not say itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Columns of a table: time, then one or three coordinates, by name, or by number from 1.
    pub columns: Option<Vec<String>>,
    /// Unit of the positions in a table whose column names have none.
    pub unit: Option<LengthUnit>,
    /// Topic of the positions in an MCAP file that has several.
    pub topic: Option<String>,
}
