//! `needlebench schema`.

use anyhow::Result;
use clap::ValueEnum;
use needlebench_engine::{ENGINES, Engine, choose_engines, engine_names};
use serde_json::{Value, json};

use super::print_json;
use crate::exit::ExitStatus;

/// Formats that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemaFormat {
    /// Scenario files.
    Scenario,
    /// Study files.
    Study,
    /// An arm's data, `arm.toml`.
    Arm,
}

/// Prints the schema of a file format.
pub(crate) fn schema(format: SchemaFormat) -> Result<ExitStatus> {
    let mut schema = match format {
        SchemaFormat::Scenario => needlebench_cell::scenario::scenario_schema(),
        SchemaFormat::Study => needlebench_cell::study::study_schema(),
        SchemaFormat::Arm => needlebench_cell::arm::data::arm_schema(),
    };
    name_engines(&mut schema, ENGINES);
    print_json(&schema)?;
    Ok(ExitStatus::Success)
}

/// Adds the engines' names where a file may name some, and those that run where it names none.
fn name_engines(schema: &mut Value, engines: &[&'static dyn Engine]) {
    if let Some(name) = schema.pointer_mut("/definitions/EngineName") {
        name["enum"] = json!(engine_names(engines));
    }
    let by_default = choose_engines::<&str>(engines, None).map(|chosen| engine_names(&chosen));
    for (place, key) in [
        ("/properties/engines/default", "run"),
        ("/definitions/EnginesSection/properties/run", "default"),
    ] {
        if let (Some(place), Ok(names)) = (schema.pointer_mut(place), &by_default) {
            place[key] = json!(names);
        }
    }
}
