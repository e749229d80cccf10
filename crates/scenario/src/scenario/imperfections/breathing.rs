//! Breathing: what skin and target move by while the needle goes in.

use needlebench_input::{Finding, TomlText};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the block stands.
const PLACE: &str = "imperfections.breathing";

/// Breathing motion of the phantom.
///
/// Skin and lesion move by their amplitudes times `sin^4(pi phase)` (Lujan et al., Med. Phys. 26(5), 1999): zero at
/// phase 0, the end of expiration, for which the plan is made, and maximal at 0.5.
///
/// With `since_image_s` the end of expiration is not where the image shows it: the displacement is the amplitude times
/// `level + sin^4(pi phase)`. The level is normal about 0, the same for skin and target (assumed), with a standard
/// deviation of `sqrt(level_at_once^2 + (level_per_s since_image_s)^2)`. A breath that is held is then at `phase`
/// exactly, one that fails at any phase. With `held_s` skin and target drift as well while it is held. Markers on the
/// skin keep their own phase, without level and drift.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BreathingBlock {
    /// Displacement of the skin from expiration to inspiration, phantom frame (left, posterior, superior), mm. Assumed:
    /// quiet breathing.
    #[schemars(inner(range(min = -60.0, max = 60.0)))]
    pub skin_mm: [f64; 3],
    /// Displacement of the target from expiration to inspiration, phantom frame (left, posterior, superior), mm.
    /// Assumed: a lesion in the lower lung, quiet breathing.
    #[schemars(inner(range(min = -60.0, max = 60.0)))]
    pub target_mm: [f64; 3],
    /// Breathing period, s.
    #[schemars(range(min = 0.5, max = 60.0))]
    pub period_s: f64,
    /// Mean breathing phase at insertion; 0 is the end of expiration.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub phase: f64,
    /// Standard deviation of the breathing phase at insertion. Not used with `free = true`, where the phase is uniform,
    /// nor with `since_image_s`.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub phase_spread: f64,
    /// Share of breath-holds that fail; the needle is then inserted at any phase. Assumed.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 5 % are 0.05"))]
    pub hold_failure: f64,
    /// Free breathing: the needle is inserted at any phase.
    pub free: bool,
    /// Time from the image to the insertion, s. Default: none; the end of expiration is where the image shows it, met
    /// within `phase_spread`. Beyond 120 s the level is extrapolated.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub since_image_s: Option<f64>,
    /// Standard deviation of the level right after the image, as a share of the amplitude. Default with
    /// `since_image_s`: 0.045, derived from recordings of healthy people lying down (Krilavicius et al., arXiv
    /// 1508.00749).
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 5 % are 0.05"))]
    pub level_at_once: Option<f64>,
    /// Growth of the level's standard deviation with the time since the image, as a share of the amplitude, 1/s.
    /// Default with `since_image_s`: 0.0017, from the same recordings: 0.1 of the amplitude in a minute.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub level_per_s: Option<f64>,
    /// Recordings of breath, as `needlebench breath` reads them: paths relative to this file, one marker on the skin of
    /// each patient, tables with the units of their columns in the header. Five or more give the level's law, and
    /// `period_s` (median) and the length of `skin_mm` where these are not given; all but the period are 90th
    /// percentiles over recordings. Fewer are not enough to tell: defaults stay, with a note.
    #[schemars(length(min = 1), extend("x-hint" = "five or more give a level"), inner(length(min = 1)))]
    pub recordings: Option<Vec<String>>,
    /// Time that the breath has been held at insertion, s. Default: none, and no drift.
    #[schemars(range(min = 0.0, max = 120.0))]
    pub held_s: Option<f64>,
    /// Drift of the skin while the breath is held, phantom frame (left, posterior, superior), mm/s. Default with
    /// `held_s`: none. Assumed.
    #[schemars(inner(range(min = -2.0, max = 2.0)))]
    pub skin_drift_mm_s: Option<[f64; 3]>,
    /// Drift of the target while the breath is held, phantom frame (left, posterior, superior), mm/s. Default with
    /// `held_s`: 0.15 superior, as the diaphragm rises (PubMed 9807578). Assumed: a lesion in the lower lung, less
    /// above.
    #[schemars(inner(range(min = -2.0, max = 2.0)))]
    pub target_drift_mm_s: Option<[f64; 3]>,
}

impl Default for BreathingBlock {
    fn default() -> Self {
        Self {
            skin_mm: [0.0, -5.0, 0.0],
            target_mm: [0.0, -2.0, -8.0],
            period_s: 4.0,
            phase: 0.0,
            phase_spread: 0.08,
            hold_failure: 0.05,
            free: false,
            since_image_s: None,
            level_at_once: None,
            level_per_s: None,
            recordings: None,
            held_s: None,
            skin_drift_mm_s: None,
            target_drift_mm_s: None,
        }
    }
}

impl BreathingBlock {
    /// Checks for keys that contradict each other, or have no meaning without another.
    pub(super) fn check(&self, toml: &TomlText<'_>) -> Vec<Finding> {
        let of_level = [
            ("level_at_once", self.level_at_once.is_some()),
            ("level_per_s", self.level_per_s.is_some()),
        ];
        let of_drift = [
            ("skin_drift_mm_s", self.skin_drift_mm_s.is_some()),
            ("target_drift_mm_s", self.target_drift_mm_s.is_some()),
        ];
        let given = |keys: [(&'static str, bool); 2]| {
            let given = keys.into_iter().filter(|(_, is_given)| *is_given);
            given.map(|(key, _)| key)
        };
        let mut findings = Vec::new();
        let mut find = |key: &str, message: String, hint: &str| {
            let key = format!("{PLACE}.{key}");
            findings.push(toml.finding(&key, message).hint(hint));
        };
        if self.since_image_s.is_none() {
            let recordings = self.recordings.iter().map(|_| "recordings");
            for key in given(of_level).chain(recordings) {
                let message = format!("`{key}` has no meaning without `since_image_s`");
                find(
                    key,
                    message,
                    "`since_image_s = 60`: the time from the image to the insertion, s",
                );
            }
        }
        if self.recordings.is_some() {
            for key in given(of_level) {
                let message = format!("`{key}` contradicts `recordings`");
                let hint = "the level is that of the recordings: leave one of them out";
                find(key, message, hint);
            }
        }
        if self.held_s.is_none() {
            for key in given(of_drift) {
                let message = format!("`{key}` has no meaning without `held_s`");
                find(
                    key,
                    message,
                    "`held_s = 10`: how long the breath has been held at insertion, s",
                );
            }
        }
        if let Some(held_s) = self.held_s.filter(|_| self.free) {
            let message = format!("`held_s = {held_s}` s contradicts `free = true`");
            find(
                "held_s",
                message,
                "a patient who breathes freely holds no breath: leave one of them out",
            );
        }
        let is_usual = self.phase_spread == Self::default().phase_spread;
        let gives_phase_spread = is_given(toml, "phase_spread", is_usual);
        if self.since_image_s.is_some() && !self.free && gives_phase_spread {
            let message = format!(
                "`phase_spread = {}` contradicts `since_image_s`",
                self.phase_spread
            );
            let hint = "a held breath is at `phase`, and off by its level instead: leave out `phase_spread`";
            find("phase_spread", message, hint);
        }
        findings
    }

    /// Whether the displacement of the skin is given.
    pub(crate) fn gives_skin(&self, toml: &TomlText<'_>) -> bool {
        is_given(toml, "skin_mm", self.skin_mm == Self::default().skin_mm)
    }

    /// Whether the period is given.
    pub(crate) fn gives_period(&self, toml: &TomlText<'_>) -> bool {
        is_given(toml, "period_s", self.period_s == Self::default().period_s)
    }
}

/// What a study changes has no text: there a value counts as given where it is not the default.
fn is_given(toml: &TomlText<'_>, key: &str, is_usual: bool) -> bool {
    !is_usual || toml.span_of(&format!("{PLACE}.{key}")).is_some()
}
