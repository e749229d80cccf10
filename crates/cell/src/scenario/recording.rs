//! What is written of each simulated motion: `[recording]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EnginesSection;
use crate::Finding;
use crate::toml_text::TomlText;

/// What is written of each simulated motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordingSection {
    /// Time between two rows of a recording, and between two clearance checks, ms.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: f64,
    /// Write a picture of each configuration.
    pub pictures: bool,
    /// Write a log of each simulated motion by the names of UR's real-time data exchange (RTDE) too.
    pub rtde: bool,
}

impl Default for RecordingSection {
    fn default() -> Self {
        Self {
            period_ms: 10.0,
            pictures: true,
            rtde: false,
        }
    }
}

/// Rows closer than the time step.
pub(super) fn check(
    toml: &TomlText<'_>,
    recording: &RecordingSection,
    engines: &EnginesSection,
) -> Vec<Finding> {
    let (period_ms, timestep_ms) = (recording.period_ms, engines.timestep_ms);
    let mut findings = Vec::new();
    if period_ms < timestep_ms {
        findings.push(
            toml.finding(
                "recording.period_ms",
                format!(
                    "`recording.period_ms` is {period_ms} ms, less than the time step of \
                     {timestep_ms} ms"
                ),
            )
            .hint("nothing happens between two time steps: `timestep_ms` under [engines]"),
        );
    }
    findings
}
