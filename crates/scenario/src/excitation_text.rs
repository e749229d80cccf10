//! The text of a scenario for an excitation run in another scenario's cell.

use std::fmt::Write;
use std::path::Path;

use needlebench_input::{Finding, TomlText};
use toml::{Table, Value};

use crate::Overrides;
use crate::scenario::ExcitationSection;

/// What such a run does not have, or does not use.
const LEFT_OUT: [&str; 8] = [
    "goals",
    "iso9283",
    "excitation",
    "events",
    "ranking",
    "people",
    "expected",
    "criteria",
];

/// Criteria that make sense without goals.
const CRITERIA: [&str; 4] = [
    "max_peak_torque_ratio",
    "allow_contact",
    "max_engine_difference_peak_mm",
    "max_engine_difference_settled_mm",
];

/// The cell of a scenario, to be given a run.
#[derive(Debug, Clone)]
pub struct ExcitationText {
    /// All sections but the run's own.
    table: Table,
}

impl ExcitationText {
    /// Of a scenario's text; `base` is the folder that its paths are relative to, and paths become absolute.
    ///
    /// # Errors
    /// A text that is no TOML.
    pub fn new(
        file: &str,
        text: &str,
        base: &Path,
        overrides: &Overrides,
    ) -> Result<Self, Finding> {
        TomlText::parse(file, text)?;
        let mut table: Table = text
            .parse()
            .map_err(|error| Finding::new(file, format!("not TOML: {error}")))?;
        let kept = table.get("criteria").and_then(Value::as_table).map(|all| {
            let of_use = all
                .iter()
                .filter(|(key, _)| CRITERIA.contains(&key.as_str()));
            of_use
                .map(|(key, value)| (key.clone(), value.clone()))
                .collect::<Table>()
        });
        for name in LEFT_OUT {
            table.remove(name);
        }
        if let Some(kept) = kept.filter(|kept| !kept.is_empty()) {
            table.insert("criteria".to_owned(), kept.into());
        }
        for (key, value) in &mut table {
            if !["name", "description"].contains(&key.as_str()) {
                make_absolute(value, base);
            }
        }
        let here = Path::new("");
        if overrides.robot_urdf.is_some() || overrides.arm.is_some() {
            let robot = table.entry("robot").or_insert_with(|| Table::new().into());
            if let Some(robot) = robot.as_table_mut() {
                for name in ["urdf", "arm", "calibration"] {
                    robot.remove(name);
                }
                let urdf = overrides.robot_urdf.as_ref();
                for (name, given) in [
                    ("urdf", urdf.map(|path| path.display().to_string())),
                    ("arm", overrides.arm.clone()),
                ] {
                    if let Some(given) = given {
                        let mut value = Value::String(given);
                        make_absolute(&mut value, here);
                        robot.insert(name.to_owned(), value);
                    }
                }
            }
        }
        if let Some(path) = &overrides.calibration {
            let robot = table.entry("robot").or_insert_with(|| Table::new().into());
            if let Some(robot) = robot.as_table_mut() {
                let mut value = Value::String(path.display().to_string());
                make_absolute(&mut value, here);
                robot.insert("calibration".to_owned(), value);
            }
        }
        Ok(Self { table })
    }

    /// The name of the cell's own scenario.
    pub fn name(&self) -> Option<&str> {
        self.table.get("name")?.as_str()
    }

    /// The scenario with a run, under a name and with a comment at its head. `remarks` are written beside the
    /// postures, as many as there are of either.
    pub fn with(
        &self,
        name: &str,
        description: &str,
        head: &str,
        start_deg: Option<[f64; 6]>,
        section: &ExcitationSection,
        remarks: &[String],
    ) -> String {
        let mut table = self.table.clone();
        table.insert("name".to_owned(), name.into());
        table.insert("description".to_owned(), description.into());
        if let Some(start_deg) = start_deg {
            let mut start = Table::new();
            let values = start_deg.iter().map(|deg| Value::Float(*deg));
            start.insert("joints_deg".to_owned(), Value::Array(values.collect()));
            table.insert("start".to_owned(), start.into());
        }
        let mut text = String::new();
        for line in head.lines() {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{}", format!("# {line}").trim_end());
        }
        text.push_str(&table.to_string());
        text.push('\n');
        let _ = write_section(&mut text, section, remarks);
        text
    }
}

fn write_section(
    text: &mut String,
    section: &ExcitationSection,
    remarks: &[String],
) -> std::fmt::Result {
    writeln!(text, "[excitation]")?;
    writeln!(
        text,
        "# Shoulder pan to wrist 3, in the order in which they are visited."
    )?;
    writeln!(text, "postures_deg = [")?;
    for (index, posture) in section.postures_deg.iter().enumerate() {
        let remark = remarks.get(index);
        let remark = remark.map_or(String::new(), |remark| format!(" # {remark}"));
        writeln!(text, "    [{}],{remark}", numbers(posture))?;
    }
    writeln!(text, "]")?;
    writeln!(text, "dwell_s = {:?}", section.dwell_s)?;
    writeln!(text, "speeds_deg_s = [{}]", numbers(&section.speeds_deg_s))?;
    let sweeps = numbers(&section.sweep_speeds_deg_s);
    writeln!(text, "sweep_speeds_deg_s = [{sweeps}]")?;
    if let Some(period_ms) = section.period_ms {
        writeln!(text, "period_ms = {period_ms:?}")?;
    }
    writeln!(text, "clearance_mm = {:?}", section.clearance_mm)?;
    writeln!(text, "self_clearance_mm = {:?}", section.self_clearance_mm)?;
    for sweep in &section.sweeps {
        writeln!(text, "\n[[excitation.sweeps]]")?;
        writeln!(text, "joint = \"{}\"", sweep.joint)?;
        writeln!(text, "posture = {}", sweep.posture)?;
        writeln!(text, "by_deg = {:?}", sweep.by_deg)?;
    }
    for payload in &section.payloads {
        writeln!(text, "\n[[excitation.payloads]]")?;
        writeln!(text, "mass_kg = {:?}", payload.mass_kg)?;
        if let Some(centre) = payload.centre_mm {
            writeln!(text, "centre_mm = [{}]", numbers(&centre))?;
        }
        if let Some(size) = payload.size_mm {
            writeln!(text, "size_mm = [{}]", numbers(&size))?;
        }
    }
    Ok(())
}

fn numbers(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    texts.join(", ")
}

/// Makes the paths of files in a value absolute: texts that name something which is there.
fn make_absolute(value: &mut Value, base: &Path) {
    match value {
        Value::String(text) => {
            let path = base.join(&*text);
            let looks_like_a_path = text.contains(['.', '/', '\\']);
            if looks_like_a_path
                && path.exists()
                && let Ok(absolute) = std::path::absolute(&path)
                && let Some(absolute) = absolute.to_str()
            {
                absolute.clone_into(text);
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|each| make_absolute(each, base)),
        Value::Table(table) => {
            for (_, each) in table.iter_mut() {
                make_absolute(each, base);
            }
        }
        _ => {}
    }
}
