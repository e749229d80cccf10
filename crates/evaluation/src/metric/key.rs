//! Names of metrics as they are measured: of a run, of a static case, of one engine.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use needlebench_scenario::study::StudyMode;

use super::entry::{Better, Metric, Source, Stage, Statistics};
use super::metrics;
use crate::report::ConfigurationReport;

/// Of what a metric is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Of {
    /// A run, or a planned or dynamic case.
    Run,
    /// A static case.
    StaticCase,
    /// One engine of a run.
    Engine(String),
}

/// A metric by the name under which a number of it is known.
#[derive(Clone)]
pub struct MetricKey {
    metric: &'static Metric,
    of: Of,
}

impl fmt::Debug for MetricKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.key())
    }
}

impl PartialEq for MetricKey {
    fn eq(&self, other: &Self) -> bool {
        self.metric.key == other.metric.key && self.of == other.of
    }
}

impl MetricKey {
    /// A metric of a run.
    pub fn of_run(metric: &'static Metric) -> Self {
        Self {
            metric,
            of: Of::Run,
        }
    }

    /// A metric of a static case; none if those do not measure it.
    pub fn of_static_case(metric: &'static Metric) -> Option<Self> {
        let key = metric.static_key?;
        let of = if key == metric.key {
            Of::Run
        } else {
            Of::StaticCase
        };
        Some(Self { metric, of })
    }

    /// A metric of one engine; none of metrics of which engines have none of their own.
    pub fn of_engine(metric: &'static Metric, engine: &str) -> Option<Self> {
        let of = Of::Engine(engine.to_owned());
        metric.each_engine.then_some(Self { metric, of })
    }

    /// All names, in the order of reports, with those of each engine.
    pub fn all<'a>(engines: &'a [&str]) -> impl Iterator<Item = Self> + 'a {
        metrics().flat_map(move |metric| {
            let of_static = Self::of_static_case(metric).filter(|each| each.of == Of::StaticCase);
            let of_engines = engines.iter();
            let of_engines = of_engines.filter_map(move |engine| Self::of_engine(metric, engine));
            of_static
                .into_iter()
                .chain([Self::of_run(metric)])
                .chain(of_engines)
        })
    }

    /// The names of columns of studies that compute cases in such modes and engines.
    pub fn columns(modes: &[StudyMode], engines: &[&str]) -> Vec<Self> {
        Self::all(engines)
            .filter(|each| modes.iter().any(|mode| each.has_column_in(*mode)))
            .collect()
    }

    /// The metric of a name, or of a column's name.
    pub fn named(name: &str, engines: &[&str]) -> Option<Self> {
        Self::all(engines).find(|each| each.key() == name || each.column() == name)
    }

    /// The metric, whatever it is of.
    pub fn metric(&self) -> &'static Metric {
        self.metric
    }

    /// Whether it is of one engine alone.
    pub fn is_of_engine(&self) -> bool {
        matches!(self.of, Of::Engine(_))
    }

    /// Name in reports and on the command line.
    pub fn key(&self) -> Cow<'static, str> {
        match &self.of {
            Of::Run => self.metric.key.into(),
            Of::StaticCase => self.metric.static_key.unwrap_or(self.metric.key).into(),
            Of::Engine(engine) => format!("{}_{engine}", self.metric.key).into(),
        }
    }

    /// The same in words.
    pub fn words(&self) -> String {
        match &self.of {
            Of::Run => self.metric.words.to_owned(),
            Of::StaticCase => format!("{}, static", self.family_words()),
            Of::Engine(engine) => format!("{} {engine}", self.metric.words),
        }
    }

    /// Words of the plainest member of its family.
    fn family_words(&self) -> &'static str {
        let mut all = metrics();
        let plain = all.find(|metric| metric.key == self.metric.family);
        plain.unwrap_or(self.metric).words
    }

    /// Name of its column in studies, with the unit.
    pub fn column(&self) -> String {
        format!("{}{}", self.key(), self.metric.unit.suffix)
    }

    /// Name in results in SI units, with the unit: `tip_rms_m`.
    pub fn si_name(&self) -> String {
        format!("{}{}", self.key(), self.metric.unit.si_suffix())
    }

    /// What exactly it is, with its unit in studies.
    pub fn description(&self) -> String {
        let unit = match self.metric.unit.symbol {
            "1" => String::new(),
            symbol => format!(", {symbol}"),
        };
        format!("{}{unit}", self.definition())
    }

    /// What exactly it is.
    pub fn definition(&self) -> String {
        let metric = self.metric;
        let basis = match &self.of {
            _ if metric.static_key == Some(metric.key) => {
                "the same for all configurations".to_owned()
            }
            Of::Run => metric.basis(),
            Of::StaticCase => {
                let basis = metric.basis();
                let draw = basis.split_once("; ").map_or("", |(_, draw)| draw);
                let posture =
                    "of the posture that a plan would try first, without 2 pi equivalents";
                format!("{posture}; {draw}")
                    .trim_end_matches("; ")
                    .to_owned()
            }
            Of::Engine(engine) => format!("simulated in {engine}"),
        };
        format!("{}; {basis}", metric.definition)
    }

    /// What a study's statistics do with it.
    pub fn statistics(&self) -> Statistics {
        match self.of {
            Of::Run => self.metric.statistics,
            Of::StaticCase => self.metric.static_statistics,
            Of::Engine(_) => Statistics::NONE,
        }
    }

    /// Whether more of it is better; none where neither is.
    pub fn more_is_better(&self) -> Option<bool> {
        self.metric.better.map(|better| better == Better::More)
    }

    /// Whether a row of a case that was computed so may have it.
    pub fn is_measured_in(&self, mode: StudyMode) -> bool {
        let of_static = || Self::of_static_case(self.metric).is_some_and(|each| each == *self);
        match mode {
            StudyMode::Static => of_static(),
            StudyMode::Planned => self.of == Of::Run,
            StudyMode::Dynamic => self.of != Of::StaticCase,
        }
    }

    /// Whether studies with such cases have a column of it.
    fn has_column_in(&self, mode: StudyMode) -> bool {
        let metric = self.metric;
        let of_stage = match (metric.modes, metric.stage) {
            (_, _) if mode == StudyMode::Static => true,
            (Some(modes), _) => modes.contains(&mode),
            (None, Stage::Simulated) => mode == StudyMode::Dynamic,
            (None, Stage::FinalPosture | Stage::PlannedMotion) => true,
        };
        of_stage && self.is_measured_in(mode)
    }

    /// Value of a configuration in SI units; none if it was not measured. Of a static case the
    /// configuration is that of its posture.
    pub fn read(&self, configuration: &ConfigurationReport) -> Option<f64> {
        match (&self.of, self.metric.source) {
            (Of::Engine(engine), Source::Engines(read)) => {
                let value = read(configuration.engines.get(engine)?);
                value.filter(|value| value.is_finite())
            }
            (Of::Engine(_), Source::Configuration(_)) => None,
            _ => self.metric.read(configuration),
        }
    }

    /// The same in the unit of its column.
    pub fn read_column(&self, configuration: &ConfigurationReport) -> Option<f64> {
        Some(self.read(configuration)? / self.metric.unit.si)
    }
}

/// Everything that was measured of a configuration of a run, in SI units.
fn readings(configuration: &ConfigurationReport) -> impl Iterator<Item = (MetricKey, f64)> {
    let engines: Vec<&str> = configuration.engines.keys().map(String::as_str).collect();
    let keys: Vec<MetricKey> = MetricKey::all(&engines)
        .filter(|each| each.of != Of::StaticCase)
        .collect();
    let read = |each: MetricKey| {
        let value = each.read(configuration)?;
        Some((each, value))
    };
    keys.into_iter().filter_map(read)
}

/// Sets what a report says of what was measured, by keys, and by names with units.
pub fn set_measured(configuration: &mut ConfigurationReport) {
    let (mut metrics, mut measured) = (BTreeMap::new(), BTreeMap::new());
    for (key, value) in readings(configuration) {
        metrics.insert(key.key().into_owned(), value);
        measured.insert(key.si_name(), value);
    }
    configuration.metrics = metrics;
    configuration.measured = measured;
}
