//! A trace at 10 Hz.

/// Time between samples of a [`Segment`], s: breath has no more to show than 5 Hz.
pub const SAMPLE_S: f64 = 0.1;

/// Samples without a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Time of the first one, s; the others follow at [`SAMPLE_S`].
    pub start_s: f64,
    /// Displacement along the axis, m: positive towards inspiration, 0 at the mean of the recording.
    pub displacement_m: Vec<f64>,
}
