//! A configuration's part of the report, read by its documented keys.

use serde_json::Value;

use crate::report::ConfigurationReport;

/// A configuration as it stands in `report.json`.
#[derive(Debug, Clone, Copy)]
pub struct ConfigurationFacts<'a>(&'a Value);

impl<'a> ConfigurationFacts<'a> {
    /// Reads a member of `goals[].configurations`.
    pub fn new(configuration: &'a Value) -> Self {
        Self(configuration)
    }

    /// The JSON of a configuration, to be read by [`ConfigurationFacts::new`].
    ///
    /// A number that is not finite becomes `null` there: not measured.
    pub fn json(configuration: &ConfigurationReport) -> Value {
        serde_json::to_value(configuration).expect("reports have string keys")
    }

    /// The number at a JSON pointer.
    pub(crate) fn number(self, pointer: &str) -> Option<f64> {
        self.0.pointer(pointer)?.as_f64()
    }

    fn text(self, pointer: &str) -> Option<&'a str> {
        self.0.pointer(pointer)?.as_str()
    }

    /// Its label.
    pub fn label(self) -> Option<&'a str> {
        self.text("/label")
    }

    /// Its status: `ok`, `rejected` or `failed`.
    pub fn status(self) -> Option<&'a str> {
        self.text("/status")
    }

    /// First rule that rejects it, with what it says.
    pub fn rejection(self) -> Option<(&'a str, &'a str)> {
        let rule = self.text("/rejections/0/rule")?;
        Some((rule, self.text("/rejections/0/detail").unwrap_or_default()))
    }

    /// Largest value over the engines; none if one of them has none.
    pub(crate) fn worst_engine(self, key: &str) -> Option<f64> {
        let engines = self.0.get("engines")?.as_object()?;
        let mut worst = None;
        for engine in engines.values() {
            let value = engine.pointer(key)?.as_f64()?;
            worst = Some(worst.map_or(value, |known: f64| known.max(value)));
        }
        worst
    }

    /// Least clearance of a class over the motion: its certified bound where there is one.
    ///
    /// What was not simulated has the clearances of its final posture alone. That is another
    /// quantity, never less, and counts as not measured.
    pub(crate) fn class(self, class: &str) -> Option<f64> {
        let found = self.0.get("clearance")?.get(class)?;
        if found.get("phase").and_then(Value::as_str) == Some("final_posture") {
            return None;
        }
        let number = |key: &str| found.get(key).and_then(Value::as_f64);
        number("certified_lower_bound_m").or_else(|| number("minimum_m"))
    }

    pub(crate) fn least_of(self, classes: &[&str]) -> Option<f64> {
        let found = classes.iter().filter_map(|class| self.class(class));
        found.reduce(f64::min)
    }

    /// How well the doctor's preferences are met; none where none is stated.
    pub(crate) fn preference(self) -> Option<f64> {
        let elbow = self.0.pointer("/room/elbow_as_preferred");
        let elbow = elbow.and_then(Value::as_bool).map(f64::from);
        let side = self.number("/room/preferred_side_free_fraction");
        let stated: Vec<f64> = [elbow, side].into_iter().flatten().collect();
        (!stated.is_empty()).then(|| stated.iter().sum::<f64>() / stated.len() as f64)
    }

    /// When the arm stands in its final place.
    pub(crate) fn arrival_s(self) -> Option<f64> {
        let phases = self.0.get("motion")?.as_array()?;
        let times = phases
            .iter()
            .filter(|phase| {
                let name = phase.get("phase").and_then(Value::as_str);
                matches!(name, Some("transfer" | "approach"))
            })
            .map(|phase| phase.get("end_s").and_then(Value::as_f64));
        times.reduce(|a, b| Some(a?.max(b?))).flatten()
    }
}
