//! `needlebench schema`.

use anyhow::Result;
use clap::ValueEnum;
use needlebench_engine::{ENGINES, Engine, choose_engines, engine_names};
use needlebench_report::{metric_descriptions, metrics_markdown, schema_markdown};
use serde_json::{Value, json};

use super::print_json;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::print_text;

/// The formats with a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemaFormat {
    /// Scenario files.
    Scenario,
    /// Study files.
    Study,
    /// Arm data files, `arm.toml`.
    Arm,
    /// Metrics: names and definitions of the values in reports and studies.
    Metrics,
}

/// Version of the schemas. It rises if a valid file becomes invalid or changes its meaning; additions do not change it.
/// `tests/schema/released` has the schema of each version.
pub(crate) const SCHEMA_VERSION: u32 = 1;

impl SchemaFormat {
    /// Name in the command line and in the schema's identifier.
    fn name(self) -> &'static str {
        match self {
            Self::Scenario => "scenario",
            Self::Study => "study",
            Self::Arm => "arm",
            Self::Metrics => "metrics",
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Scenario => "Keys of a scenario",
            Self::Study => "Keys of a study",
            Self::Arm => "Keys of an arm's data",
            Self::Metrics => "Metrics",
        }
    }
}

/// Prints a schema as JSON or Markdown.
pub(crate) fn schema(format: SchemaFormat, markdown: bool) -> Result<ExitStatus, Failure> {
    if !markdown {
        print_json(&document(format))?;
    } else if format == SchemaFormat::Metrics {
        print_text(metrics_markdown().trim_end())?;
    } else {
        print_text(schema_markdown(format.title(), &document(format)).trim_end())?;
    }
    Ok(ExitStatus::Success)
}

/// The schema of a format, or the descriptions of the metrics.
pub(super) fn document(format: SchemaFormat) -> Value {
    let mut schema = match format {
        SchemaFormat::Scenario => needlebench_scenario::scenario::scenario_schema(),
        SchemaFormat::Study => needlebench_scenario::study::study_schema(),
        SchemaFormat::Arm => needlebench_robot::arm::data::arm_schema(),
        SchemaFormat::Metrics => {
            return json!({ "schema_version": 1, "metrics": metric_descriptions() });
        }
    };
    name_engines(&mut schema, ENGINES);
    // A name, not a location: no request is necessary.
    let name = format.name();
    schema["$id"] = json!(format!("urn:needlebench:schema:{name}:{SCHEMA_VERSION}"));
    schema
}

/// Adds the names of the engines, and the default ones.
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
