//! Which metrics tables and pages show, and how.

use needlebench_evaluation::metric::{Asked, Bound, Heading, Metric, MetricKey, Show, metrics};
use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_show::number::{millimetres, percent_with, small_length};

use super::engine_headings::EngineHeading;

/// A metric's value in SI units as tables show it.
pub(crate) fn metric_text(show: Show, value: f64) -> String {
    match show {
        Show::Millimetres => millimetres(value),
        Show::SmallLength => small_length(value),
        Show::Seconds | Show::Number => format!("{value:.2}"),
        Show::Percent => percent_with(value, 0),
        Show::Degrees => format!("{:.1}", value.to_degrees()),
    }
}

/// What a column shows: a metric, or what comes nearest to it where a configuration does not have it.
///
/// The clearance of a configuration that was not simulated is that of its planned motion, and of its
/// posture where it has no motion.
pub(crate) struct Shown {
    key: MetricKey,
    /// What is shown instead, what says most first.
    otherwise: Vec<MetricKey>,
}

impl Shown {
    fn new(key: MetricKey) -> Self {
        let metric = key.metric();
        let is_weaker = |other: &&Metric| {
            metric.bound == Bound::Attained
                && other.family == metric.family
                && other.bound == Bound::Attained
                && other.stage < metric.stage
        };
        Self {
            otherwise: metrics()
                .rev()
                .filter(is_weaker)
                .map(MetricKey::of_run)
                .collect(),
            key,
        }
    }

    /// The keys in `configurations[].metrics`, the first of which that is there is shown.
    pub fn keys(&self) -> Vec<String> {
        let keys = [&self.key].into_iter().chain(&self.otherwise);
        keys.map(|key| key.key().into_owned()).collect()
    }

    /// What it is.
    pub fn metric(&self) -> &'static Metric {
        self.key.metric()
    }

    /// What exactly it is, in words.
    pub fn description(&self) -> String {
        self.key.description()
    }

    pub fn more_is_better(&self) -> bool {
        self.key.more_is_better() == Some(true)
    }

    /// Number and text of a configuration.
    pub fn value(&self, configuration: &ConfigurationReport) -> Option<(f64, String)> {
        let mut keys = [&self.key].into_iter().chain(&self.otherwise);
        let value = keys.find_map(|key| key.read(configuration))?;
        Some((value, metric_text(self.metric().show, value)))
    }

    /// Whether there is anything to say of a goal: of true targets there is not where none is known.
    pub(crate) fn says_something(&self, goal: &GoalReport) -> bool {
        let mut all = goal.configurations.iter();
        self.metric().asked != Asked::OfTrueTargets || all.any(|each| self.value(each).is_some())
    }

    /// The text, or a dash.
    pub fn text(&self, configuration: &ConfigurationReport) -> String {
        let value = self.value(configuration);
        value.map_or_else(|| "-".to_owned(), |(_, text)| text)
    }
}

/// The metrics that have a heading, with it, in the order of their places; those of which each engine
/// has its own once for each engine.
pub(crate) fn shown_metrics(
    engines: &[EngineHeading],
    heading: impl Fn(&Heading) -> Option<(u8, &'static str)>,
) -> impl Iterator<Item = (String, Shown)> {
    let mut all: Vec<(u8, &'static str, &'static Metric)> = metrics()
        .filter_map(|metric| {
            let (place, heading) = heading(&metric.heading)?;
            Some((place, heading, metric))
        })
        .collect();
    all.sort_by_key(|(place, ..)| *place);
    all.into_iter().flat_map(|(_, heading, metric)| {
        if !heading.contains("{engine}") {
            return vec![(heading.to_owned(), Shown::new(MetricKey::of_run(metric)))];
        }
        let of_engine = |engine: &EngineHeading| {
            let key = MetricKey::of_engine(metric, &engine.name)?;
            Some((heading.replace("{engine}", &engine.title), Shown::new(key)))
        };
        engines.iter().filter_map(of_engine).collect()
    })
}
