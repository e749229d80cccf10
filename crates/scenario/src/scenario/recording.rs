//! Files written for each simulated motion: `[recording]`.

use needlebench_input::{Finding, TomlText};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EnginesSection;

/// Files written for each simulated motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordingSection {
    /// Sampling period of recordings and of clearance checks, ms.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: f64,
    /// Renders an image of each configuration.
    pub pictures: bool,
    /// Also writes each simulated motion as a log with the names of UR's real-time data exchange (RTDE).
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

/// Checks that the sampling period is not below the time step.
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
            .hint("use at least `timestep_ms` under [engines]"),
        );
    }
    findings
}
