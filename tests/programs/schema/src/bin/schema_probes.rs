//! Writes documents at, inside and outside every limit of the published schemas, one a line, with what
//! the reader says of each. `tests/schema/check.py` compares that with an independent validator.

#[path = "../../../../../crates/scenario/tests/scenario/schema_probes.rs"]
mod probes;

use std::io::Write as _;

use needlebench_scenario::scenario::{parse_scenario, scenario_schema};
use needlebench_scenario::study::{parse_study, study_schema};
use serde_json::json;

fn main() -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    for (kind, schema) in [("scenario", scenario_schema()), ("study", study_schema())] {
        for probe in probes::probes(&schema) {
            let text = toml::to_string(&probe.document).expect("a document is TOML");
            let is_read = match kind {
                "scenario" => parse_scenario("probe.toml", &text).is_ok(),
                _ => parse_study("probe.toml", &text).is_ok(),
            };
            let line = json!({
                "schema": kind,
                "key": probe.key,
                "document": probe.document,
                "fits": probe.fits,
                "is_read": is_read,
            });
            writeln!(out, "{line}")?;
        }
    }
    Ok(())
}
