//! Quantities that two studies are compared by, and the thresholds of regressions.

use needlebench_input::digits_apart;

use crate::MetricColumn;

/// Every configuration by itself.
pub const EVERY: &str = "every";

/// A share of layouts or cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StudyRate {
    /// Name on the command line and in files of thresholds.
    pub name: &'static str,
    /// The same in words.
    pub words: &'static str,
    /// Whether each configuration has its own.
    pub of_configurations: bool,
    /// Whether more is better.
    pub more_is_better: bool,
}

/// Share of the valid layouts with a feasible configuration.
pub(crate) const WORKING_LAYOUTS: StudyRate = StudyRate {
    name: "working_layouts",
    words: "feasible layouts",
    of_configurations: false,
    more_is_better: true,
};
/// Share of the valid layouts in which a configuration is feasible.
pub(crate) const SUCCESS_RATE: StudyRate = StudyRate {
    name: "success_rate",
    words: "success rate",
    of_configurations: true,
    more_is_better: true,
};
/// Share of the cases with an invalid layout.
pub(crate) const INVALID_LAYOUTS: StudyRate = StudyRate {
    name: "invalid_layouts",
    words: "invalid layouts",
    of_configurations: false,
    more_is_better: false,
};

/// The rates by which studies are compared, in the order of reports.
pub const STUDY_RATES: [StudyRate; 3] = [WORKING_LAYOUTS, SUCCESS_RATE, INVALID_LAYOUTS];

/// The quantity of a threshold.
#[derive(Debug, Clone, PartialEq)]
pub enum StudySubject {
    /// A rate.
    Rate(StudyRate),
    /// The quantile of a metric, by its key, at a share, 0 to 1.
    Metric(String, f64),
}

/// How much worse a number of the second study may be.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyThreshold {
    /// Its quantity.
    pub subject: StudySubject,
    /// [`BEST`](crate::statistics::BEST), [`EVERY`] or a configuration's label; none of layouts.
    pub of: Option<String>,
    /// The limit.
    pub limit: StudyLimit,
    /// Metric, quantile and configuration as they were given.
    pub key: String,
    /// The limit as it was given.
    pub text: String,
}

impl StudyThreshold {
    /// A regression beyond its threshold, in brackets, with enough digits to show it.
    pub(crate) fn loss_text(&self, loss: f64, first: f64, unit: &str) -> String {
        match (self.limit, unit) {
            (StudyLimit::Absolute(limit), "1") => {
                format!(
                    " ({} percentage points)",
                    digits_apart(100.0 * loss, 100.0 * limit)
                )
            }
            (StudyLimit::Absolute(limit), unit) => {
                format!(" ({} {unit})", digits_apart(loss, limit))
            }
            (StudyLimit::Relative(share), _) if first != 0.0 => {
                format!(
                    " ({} %)",
                    digits_apart(100.0 * loss / first.abs(), 100.0 * share)
                )
            }
            (StudyLimit::Relative(_), _) => String::new(),
        }
    }
}

/// The limit of a regression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StudyLimit {
    /// In the unit of the metric's column.
    Absolute(f64),
    /// Share of the first value's magnitude.
    Relative(f64),
}

impl StudyLimit {
    /// Whether a regression from the first value exceeds the limit.
    pub fn is_exceeded_by(self, loss: f64, first: f64) -> bool {
        match self {
            Self::Absolute(limit) => loss > limit,
            Self::Relative(share) => loss > share * first.abs(),
        }
    }
}

/// What is compared: a rate, or the quantile of a metric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Compared<'a> {
    Rate(StudyRate),
    Quantile(&'a MetricColumn, f64),
    /// The quantile of a metric that neither study has.
    Unknown(&'a str, f64),
}

impl Compared<'_> {
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Rate(rate) => rate.name,
            Self::Quantile(column, _) => &column.key,
            Self::Unknown(key, _) => key,
        }
    }

    pub(crate) fn words(&self) -> &str {
        match self {
            Self::Rate(rate) => rate.words,
            Self::Quantile(column, _) => &column.words,
            Self::Unknown(key, _) => key,
        }
    }

    pub(crate) fn quantile(&self) -> Option<f64> {
        match self {
            Self::Rate(_) => None,
            Self::Quantile(_, p) | Self::Unknown(_, p) => Some(*p),
        }
    }

    /// Unit of the values; `1` of a share.
    pub(crate) fn unit(&self) -> &str {
        match self {
            Self::Rate(_) | Self::Unknown(..) => "1",
            Self::Quantile(column, _) => &column.unit,
        }
    }

    /// By how much `b` is worse than `a`; negative where it is better. Without a direction every
    /// change is for the worse.
    pub(crate) fn loss(&self, a: f64, b: f64) -> f64 {
        let more_is_better = match self {
            Self::Rate(rate) => Some(rate.more_is_better),
            Self::Quantile(column, _) => column.more_is_better,
            Self::Unknown(..) => None,
        };
        match more_is_better {
            Some(true) => a - b,
            Some(false) => b - a,
            None => (b - a).abs(),
        }
    }
}

/// Share whose quantile is compared where none is given: the bad tail's.
pub(crate) fn bad_tail(column: &MetricColumn) -> f64 {
    if column.more_is_better == Some(true) {
        0.05
    } else {
        0.95
    }
}
