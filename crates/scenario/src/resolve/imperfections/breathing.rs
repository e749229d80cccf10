//! Breathing in SI units, and what recordings say of it.

use std::path::Path;

use nalgebra::Vector3;
use needlebench_breath::{
    LevelLaw, OverRecordings, ReadOptions, over_recordings, read_recording, statistics,
};
use needlebench_input::{Finding, Location, ModelSource, TomlText};

use crate::scenario::BreathingBlock;

/// Key of the recordings.
const RECORDINGS: &str = "imperfections.breathing.recordings";

/// The level's law is of recordings up to this time, s.
const LAW_UP_TO_S: f64 = 120.0;

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
    /// Whether the level is that of recordings, and not assumed.
    pub is_level_measured: bool,
    /// How far skin and target have drifted at insertion while the breath was held, m; none where that is not asked
    /// for.
    pub drift_m: Option<[Vector3<f64>; 2]>,
}

impl Breathing {
    pub(super) fn new(
        toml: &TomlText<'_>,
        block: &BreathingBlock,
        recorded: Option<&RecordedBreath>,
        notes: &mut Vec<String>,
    ) -> Self {
        let told = recorded.and_then(|recorded| recorded.told.as_ref());
        let level_sd = block.since_image_s.map(|since_s| {
            let law = told.map_or_else(
                || LevelLaw {
                    at_once: block.level_at_once.unwrap_or(LEVEL_AT_ONCE),
                    per_s: block.level_per_s.unwrap_or(LEVEL_PER_S),
                },
                |told| told.law,
            );
            law.after(since_s)
        });
        let mut skin_m = Vector3::from(block.skin_mm) * 1e-3;
        let mut period_s = block.period_s;
        if let Some(told) = told {
            // A marker says how far the skin moves, not where to.
            if !block.gives_skin(toml) {
                skin_m *= told.amplitude_m / skin_m.norm();
            }
            if !block.gives_period(toml) {
                period_s = told.period_s;
            }
        }
        notes.extend(recorded.map(|recorded| recorded.note(skin_m.norm(), period_s)));
        if let Some(since_s) = block.since_image_s.filter(|since_s| *since_s > LAW_UP_TO_S) {
            notes.push(format!(
                "level of the breath after {since_s} s extrapolated: its law is of recordings up to {LAW_UP_TO_S} s"
            ));
        }
        let phase_spread = level_sd.map_or(block.phase_spread, |_| 0.0);
        let drift_mm_s = [
            block.skin_drift_mm_s.unwrap_or_default(),
            block.target_drift_mm_s.unwrap_or(TARGET_DRIFT_MM_S),
        ];
        let drift_m = |held_s: f64| drift_mm_s.map(|mm_s| Vector3::from(mm_s) * (1e-3 * held_s));
        Self {
            skin_m,
            target_m: Vector3::from(block.target_mm) * 1e-3,
            period_s,
            phase: block.phase,
            phase_spread: (!block.free).then_some(phase_spread),
            hold_failure: block.hold_failure,
            level_sd,
            is_level_measured: told.is_some(),
            drift_m: block.held_s.map(drift_m),
        }
    }

    /// The breath in which markers on the skin are localised, about the end of expiration.
    pub(super) fn of_markers(self, phase_spread: f64) -> Self {
        Self {
            phase: 0.0,
            phase_spread: self.phase_spread.map(|_| phase_spread),
            level_sd: None,
            is_level_measured: false,
            drift_m: None,
            ..self
        }
    }
}

/// What recordings of breath say.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RecordedBreath {
    told: Option<Told>,
    /// How many there are, or why they say nothing.
    basis: String,
    /// What is doubtful about each.
    doubts: Vec<String>,
    /// The files.
    pub sources: Vec<ModelSource>,
}

/// What they tell, over recordings.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Told {
    /// Of the level, as a share of the amplitude: of the 90th percentiles.
    law: LevelLaw,
    /// 90th percentile.
    amplitude_m: f64,
    /// Median.
    period_s: f64,
}

impl RecordedBreath {
    /// Reads the recordings of a block.
    ///
    /// # Errors
    /// The first thing that is wrong with a file.
    pub(crate) fn read(
        toml: &TomlText<'_>,
        files: &[String],
        base: &Path,
    ) -> Result<Self, Finding> {
        let (mut names, mut all, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        let mut doubts = Vec::new();
        for (index, file) in files.iter().enumerate() {
            let path = base.join(file);
            let location = Location::Disk(path.clone());
            let shown = location.display();
            if !location.is_there() {
                let key = format!("{RECORDINGS}[{index}]");
                let finding = toml.finding(&key, format!("cannot read `{shown}`: no such file"));
                return Err(finding.hint("the path is relative to the scenario"));
            }
            let recording = read_recording(&path, &ReadOptions::default())
                .map_err(|findings| in_scenario(findings, &shown))?;
            let found = statistics(&recording)?;
            let findings = recording.findings.iter().chain(&found.findings);
            doubts.extend(findings.map(Finding::to_string));
            sources.push(ModelSource {
                file: shown.clone(),
                sha256: recording.sha256.unwrap_or_default(),
            });
            names.push(shown);
            all.push(found);
        }
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let over = over_recordings(&names, &all);
        let told = Told::new(&over);
        let basis = match (&told, over.not_enough) {
            (Some(_), _) => format!("{} recordings", over.recordings),
            (None, Some(why)) => why,
            (None, None) => {
                "fewer than five recordings are long enough for a level at two times".to_owned()
            }
        };
        Ok(Self {
            told,
            basis,
            doubts,
            sources,
        })
    }

    fn note(&self, skin_m: f64, period_s: f64) -> String {
        let basis = &self.basis;
        let mut note = match &self.told {
            Some(Told { law, .. }) => format!(
                "breath from {basis}: level with a standard deviation of {:.3} of the amplitude at once and {:.4} more \
                 per second (90th percentile over recordings), skin {:.1} mm, period {period_s:.1} s; assumed by the \
                 scenario and its defaults: motion of the target, failed holds, drift while the breath is held",
                law.at_once,
                law.per_s,
                1e3 * skin_m,
            ),
            None => format!(
                "recordings of breath: {basis}: not enough to tell, the level is the default"
            ),
        };
        for doubt in &self.doubts {
            note.push_str("; ");
            note.push_str(doubt);
        }
        note
    }
}

impl Told {
    fn new(over: &OverRecordings) -> Option<Self> {
        let find = |statistic: &str| {
            over.quantiles
                .iter()
                .find(|each| each.statistic == statistic)
        };
        Some(Self {
            law: over.level_law_of_amplitude?,
            amplitude_m: find("amplitude_m")?.p90,
            period_s: find("period_s")?.median,
        })
    }
}

/// What is wrong with a recording; options of the command line are none of a scenario.
fn in_scenario(findings: Vec<Finding>, shown: &str) -> Finding {
    let first = findings.into_iter().next();
    let mut finding = first.unwrap_or_else(|| Finding::new(shown, "no recording of breath"));
    if finding
        .hint
        .as_ref()
        .is_some_and(|hint| hint.contains("--"))
    {
        finding.hint =
            Some("name the columns time and x_mm, y_mm, z_mm, or time and position_mm".to_owned());
    }
    finding
}
