//! Breathing in SI units.

use nalgebra::Vector3;

use crate::scenario::BreathingBlock;

/// Standard deviation of the level right after the image, and its growth per second, as shares of the amplitude: 0.40,
/// 0.56, 1.03 and 2.1 mm after 5, 15 to 30, 60 and 120 s of about 10 mm, of five recordings of regular breath
/// (Krilavicius et al., arXiv 1508.00749). Derived.
const LEVEL_AT_ONCE: f64 = 0.045;
const LEVEL_PER_S: f64 = 0.0017;

/// Drift of a lesion in the lower lung while the breath is held, phantom frame, mm/s: the diaphragm rises (PubMed
/// 9807578). Assumed for the lesion.
const TARGET_DRIFT_MM_S: [f64; 3] = [0.0, 0.0, 0.15];

/// Breathing: displacement `amplitude * (level + sin^4(pi phase)) + drift`, phantom frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breathing {
    /// Motion of the skin from expiration to inspiration, m.
    pub skin_m: Vector3<f64>,
    /// Motion of the target, m.
    pub target_m: Vector3<f64>,
    /// Time of one breath, s.
    pub period_s: f64,
    /// Mean phase of the insertion.
    pub phase: f64,
    /// Standard deviation of the phase, 0 beside a level; none if it is uniform.
    pub phase_spread: Option<f64>,
    /// Share of breaths whose phase is uniform all the same.
    pub hold_failure: f64,
    /// Standard deviation of the level at insertion, normal about 0 and the same for skin and target, as a share of the
    /// amplitude; none where the breath is at the level of the image.
    pub level_sd: Option<f64>,
    /// How far skin and target have drifted at insertion while the breath was held, m; none where that is not asked for.
    pub drift_m: Option<[Vector3<f64>; 2]>,
}

impl Breathing {
    pub(super) fn new(block: &BreathingBlock) -> Self {
        let level_sd = block.since_image_s.map(|since_s| {
            let at_once = block.level_at_once.unwrap_or(LEVEL_AT_ONCE);
            libm::hypot(at_once, block.level_per_s.unwrap_or(LEVEL_PER_S) * since_s)
        });
        let phase_spread = level_sd.map_or(block.phase_spread, |_| 0.0);
        let drift_mm_s = [
            block.skin_drift_mm_s.unwrap_or_default(),
            block.target_drift_mm_s.unwrap_or(TARGET_DRIFT_MM_S),
        ];
        let drift_m = |held_s: f64| drift_mm_s.map(|mm_s| Vector3::from(mm_s) * (1e-3 * held_s));
        Self {
            skin_m: Vector3::from(block.skin_mm) * 1e-3,
            target_m: Vector3::from(block.target_mm) * 1e-3,
            period_s: block.period_s,
            phase: block.phase,
            phase_spread: (!block.free).then_some(phase_spread),
            hold_failure: block.hold_failure,
            level_sd,
            drift_m: block.held_s.map(drift_m),
        }
    }

    /// The breath in which markers on the skin are localised, about the end of expiration.
    pub(super) fn of_markers(self, phase_spread: f64) -> Self {
        Self {
            phase: 0.0,
            phase_spread: self.phase_spread.map(|_| phase_spread),
            level_sd: None,
            drift_m: None,
            ..self
        }
    }
}
