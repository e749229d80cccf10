//! Largest losses between two studies that a comparison allows.

use needlebench_cell::nearest_name;
use needlebench_kinematics::ik::Configuration;

use crate::statistics::BEST;
use crate::{METRICS, Metric};

/// Every configuration by itself.
pub const EVERY: &str = "every";

/// What two studies are compared by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StudyMetric {
    /// Name on the command line and in files of thresholds.
    pub name: &'static str,
    /// The same in words.
    pub words: &'static str,
    /// Column whose quantiles are compared; none of a share of layouts.
    pub column: Option<Metric>,
    /// Whether more is better.
    pub more_is_better: bool,
}

const fn column(
    name: &'static str,
    words: &'static str,
    column: Metric,
    more_is_better: bool,
) -> StudyMetric {
    StudyMetric {
        name,
        words,
        column: Some(column),
        more_is_better,
    }
}

const fn share(name: &'static str, words: &'static str, more_is_better: bool) -> StudyMetric {
    StudyMetric {
        name,
        words,
        column: None,
        more_is_better,
    }
}

/// Share of the valid layouts in which any configuration is ok.
pub(crate) const WORKING_LAYOUTS: StudyMetric = share("working_layouts", "layouts that work", true);
/// Share of the valid layouts in which a configuration is ok.
pub(crate) const SUCCESS_RATE: StudyMetric = share("success_rate", "success rate", true);
/// Share of the cases whose layout cannot exist.
pub(crate) const INVALID_LAYOUTS: StudyMetric =
    share("invalid_layouts", "layouts that cannot exist", false);

/// All that two studies are compared by, in the order of reports.
pub const STUDY_METRICS: [StudyMetric; 11] = [
    WORKING_LAYOUTS,
    SUCCESS_RATE,
    INVALID_LAYOUTS,
    column("clearance", "clearance", Metric::Clearance, true),
    column(
        "certified_clearance",
        "certified clearance",
        Metric::CertifiedClearance,
        true,
    ),
    column(
        "self_clearance",
        "clearance from itself",
        Metric::SelfClearance,
        true,
    ),
    column("tip_error", "tip error", Metric::TipError, false),
    column(
        "tip_lateral",
        "tip error across the needle",
        Metric::TipLateral,
        false,
    ),
    column("tip_rms", "rms tip error", Metric::TipRms, false),
    column(
        "tip_sensitivity",
        "sensitivity of the tip",
        Metric::TipSensitivity,
        false,
    ),
    column(
        "surplus",
        "distance from breaking a rule",
        Metric::Surplus,
        true,
    ),
];

impl StudyMetric {
    /// By its name, or by the name of its column in the results.
    pub fn named(name: &str) -> Option<Self> {
        STUDY_METRICS.into_iter().find(|each| {
            each.name == name
                || each
                    .column
                    .is_some_and(|column| METRICS[column as usize].name == name)
        })
    }

    /// Unit of its values; `1` of a share.
    pub fn unit(self) -> &'static str {
        match self.column {
            None => "1",
            Some(Metric::TipSensitivity) => "mm/mrad",
            Some(_) => "mm",
        }
    }

    /// Share whose quantile is compared where none is given: the bad tail's.
    pub fn default_quantile(self) -> f64 {
        if self.more_is_better { 0.05 } else { 0.95 }
    }

    /// By how much `b` is worse than `a`; negative where it is better.
    pub fn loss(self, a: f64, b: f64) -> f64 {
        if self.more_is_better { a - b } else { b - a }
    }
}

/// How much worse a number of the second study may be.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyThreshold {
    /// The metric.
    pub metric: StudyMetric,
    /// Share whose quantile counts; none of a share of layouts.
    pub quantile: Option<f64>,
    /// [`BEST`], [`EVERY`] or a configuration's label; none of layouts.
    pub of: Option<String>,
    /// The limit.
    pub limit: StudyLimit,
    /// Metric, quantile and configuration as they were given.
    pub key: String,
    /// The limit as it was given.
    pub text: String,
}

/// A limit of a loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StudyLimit {
    /// In the metric's unit.
    Absolute(f64),
    /// Share of the first value's magnitude.
    Relative(f64),
}

/// What is wrong with a threshold, and how to mend it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct StudyThresholdError {
    /// What is wrong.
    pub message: String,
    /// How to mend it.
    pub hint: String,
}

fn wrong(message: String, hint: impl Into<String>) -> StudyThresholdError {
    StudyThresholdError {
        message,
        hint: hint.into(),
    }
}

impl StudyThreshold {
    /// Whether a loss from the first value is more than it allows.
    pub fn is_exceeded_by(&self, loss: f64, first: f64) -> bool {
        match self.limit {
            StudyLimit::Absolute(limit) => loss > limit,
            StudyLimit::Relative(share) => loss > share * first.abs(),
        }
    }

    /// Reads a threshold: `METRIC[@PERCENT][:CONFIGURATION]` and its limit, such as
    /// `clearance@5` and `1mm`, `tip_error@95:every` and `0.1mm`, `success_rate:Right-Up-Fold` and
    /// `0.02`.
    ///
    /// # Errors
    /// In words, with a hint.
    pub fn parse(key: &str, limit: &str) -> Result<Self, StudyThresholdError> {
        let (rest, of) = match key.split_once(':') {
            Some((rest, of)) => (rest.trim(), Some(of.trim())),
            None => (key.trim(), None),
        };
        let (name, percent) = match rest.split_once('@') {
            Some((name, percent)) => (name.trim(), Some(percent.trim())),
            None => (rest, None),
        };
        let metric = StudyMetric::named(name).ok_or_else(|| {
            let names = STUDY_METRICS.map(|metric| metric.name);
            let hint = match nearest_name(name, names) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("studies are compared by {}", names.join(", ")),
            };
            wrong(format!("`{name}` is no metric of a study"), hint)
        })?;
        let quantile = quantile(metric, percent)?;
        let of = configuration(metric, of)?;
        Ok(Self {
            metric,
            quantile,
            of,
            limit: parse_limit(metric, limit)?,
            key: key.to_owned(),
            text: limit.trim().to_owned(),
        })
    }
}

fn quantile(
    metric: StudyMetric,
    percent: Option<&str>,
) -> Result<Option<f64>, StudyThresholdError> {
    match (metric.column, percent) {
        (None, None) => Ok(None),
        (None, Some(_)) => Err(wrong(
            format!("{} has no quantiles", metric.name),
            format!("leave out the `@`: {}=0.02", metric.name),
        )),
        (Some(_), None) => Ok(Some(metric.default_quantile())),
        (Some(_), Some(text)) => match text.trim_end_matches('%').trim().parse::<f64>() {
            Ok(percent) if (0.0..=100.0).contains(&percent) => Ok(Some(percent / 100.0)),
            _ => Err(wrong(
                format!("`{text}` is no percentage from 0 to 100"),
                format!("such as {}@5 for the 5 % quantile", metric.name),
            )),
        },
    }
}

fn configuration(
    metric: StudyMetric,
    of: Option<&str>,
) -> Result<Option<String>, StudyThresholdError> {
    let takes_one = metric.column.is_some() || metric == SUCCESS_RATE;
    let Some(of) = of else {
        return Ok(match (takes_one, metric.column) {
            (false, _) => None,
            (true, None) => Some(EVERY.to_owned()),
            (true, Some(_)) => Some(BEST.to_owned()),
        });
    };
    if !takes_one {
        return Err(wrong(
            format!("{} is of layouts, not of `{of}`", metric.name),
            "leave out the `:` and what follows",
        ));
    }
    let labels = Configuration::ALL.map(Configuration::label);
    let mut known = vec![EVERY];
    if metric.column.is_some() {
        known.push(BEST);
    }
    known.extend(labels);
    if known.contains(&of) {
        return Ok(Some(of.to_owned()));
    }
    let hint = match nearest_name(of, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("one of {}", known.join(", ")),
    };
    Err(wrong(format!("`{of}` is no configuration"), hint))
}

fn parse_limit(metric: StudyMetric, limit: &str) -> Result<StudyLimit, StudyThresholdError> {
    let text = limit.trim();
    // The unit starts with the first letter that is none of a number such as `1e-3`.
    let end = text
        .char_indices()
        .map(|(index, _)| index)
        .chain([text.len()])
        .rev()
        .find(|&end| text[..end].trim_end().parse::<f64>().is_ok());
    let example = match metric.unit() {
        "1" => "such as 0.02, or 2% of the first value",
        "mm" => "such as 0.5mm, 10um or 5%",
        _ => "such as 0.1mm/mrad or 5%",
    };
    let number = end.and_then(|end| Some((text[..end].trim_end().parse::<f64>().ok()?, end)));
    let Some((value, end)) = number else {
        return Err(wrong(
            format!("`{text}` is not a number with a unit"),
            example,
        ));
    };
    if !value.is_finite() || value < 0.0 {
        return Err(wrong(
            format!("`{text}` is not a loss: it has to be finite and not negative"),
            example,
        ));
    }
    let scale = match (text[end..].trim(), metric.unit()) {
        ("%", _) => return Ok(StudyLimit::Relative(value / 100.0)),
        ("", "1") | ("mm", "mm") | ("mm/mrad", "mm/mrad") => 1.0,
        ("um", "mm") => 1e-3,
        ("m", "mm") => 1e3,
        ("cm", "mm") => 10.0,
        (unit, _) => {
            return Err(wrong(
                format!("`{unit}` is not a unit of {}", metric.name),
                example,
            ));
        }
    };
    Ok(StudyLimit::Absolute(value * scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_have_a_metric_a_quantile_and_a_configuration() {
        let parse = |key, limit| StudyThreshold::parse(key, limit).unwrap();
        let found = parse("clearance", "1mm");
        assert_eq!(
            (found.quantile, found.of.as_deref()),
            (Some(0.05), Some(BEST))
        );
        assert_eq!(found.limit, StudyLimit::Absolute(1.0));
        let found = parse("tip_error_mm@99:every", "100 um");
        assert_eq!(
            (found.quantile, found.of.as_deref()),
            (Some(0.99), Some(EVERY))
        );
        assert_eq!(found.limit, StudyLimit::Absolute(100.0 * 1e-3));
        let found = parse("success_rate:Right-Up-Fold", "0.02");
        assert_eq!(
            (found.quantile, found.of.as_deref()),
            (None, Some("Right-Up-Fold"))
        );
        assert_eq!(parse("success_rate", "0").of.as_deref(), Some(EVERY));
        assert_eq!(
            parse("working_layouts", "2%").limit,
            StudyLimit::Relative(0.02)
        );
    }

    #[test]
    fn wrong_thresholds_say_what_to_write() {
        for (key, limit, message, hint) in [
            (
                "clearence",
                "1mm",
                "`clearence`",
                "did you mean `clearance`?",
            ),
            ("clearance", "1", "`` is not a unit", "0.5mm"),
            ("clearance", "-1mm", "not negative", "0.5mm"),
            ("clearance@105", "1mm", "`105`", "clearance@5"),
            (
                "clearance:Right-Up-Fld",
                "1mm",
                "`Right-Up-Fld`",
                "`Right-Up-Fold`?",
            ),
            ("success_rate@5", "0.1", "no quantiles", "success_rate=0.02"),
            ("success_rate:best", "0.1", "`best`", "did you mean"),
            ("working_layouts:every", "0.1", "of layouts", "leave out"),
            ("success_rate", "1mm", "`mm` is not a unit", "0.02"),
        ] {
            let error = StudyThreshold::parse(key, limit).unwrap_err();
            assert!(error.message.contains(message), "{error:?}");
            assert!(
                error.hint.contains(hint) || key.contains("best"),
                "{error:?}"
            );
        }
    }
}
