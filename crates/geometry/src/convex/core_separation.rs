//! Signed distance of two cores with its witnesses.

use nalgebra::Vector3;

/// Signed distance of two cores, in the frame of B.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CoreSeparation {
    /// Signed distance, m.
    pub distance_m: f64,
    /// Unit vector from A to B.
    pub normal: Vector3<f64>,
    /// Witness on core A.
    pub on_a: Vector3<f64>,
    /// Witness on core B.
    pub on_b: Vector3<f64>,
}
