//! Largest losses that a comparison allows, of runs and of studies.

use needlebench_input::{digits_apart, nearest_name};
use needlebench_kinematics::ik::Configuration;

use crate::metric::{MetricKey, Quantity};

/// Every configuration by itself.
pub const EVERY: &str = "every";
/// The best configuration of each layout.
pub const BEST: &str = "best";

/// A share of layouts or cases by which studies are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rate {
    /// Its name.
    pub name: &'static str,
    /// Whether each configuration has its own.
    pub of_configurations: bool,
}

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compared<'a> {
    /// Two runs.
    Runs,
    /// Two studies, which have such rates beside their metrics.
    Studies(&'a [Rate]),
}

/// What a threshold is on.
#[derive(Debug, Clone, PartialEq)]
pub enum Subject {
    /// A metric; in studies its quantile at a share, 0 to 1.
    Metric(MetricKey, Option<f64>),
    /// A rate of studies.
    Rate(Rate),
}

/// How much worse a number may get.
#[derive(Debug, Clone, PartialEq)]
pub struct Threshold {
    /// What it is on.
    pub subject: Subject,
    /// [`BEST`], [`EVERY`] or a configuration's label; none of layouts.
    pub of: Option<String>,
    /// The limit.
    pub limit: Loss,
    /// Metric, quantile and configuration as they were given.
    pub key: String,
    /// The limit as it was given.
    pub text: String,
    /// Unit that the limit was given in, with its size in SI.
    pub unit: (&'static str, f64),
}

/// A limit of a loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// In the metric's SI unit.
    Absolute(f64),
    /// Share of the first value's magnitude.
    Relative(f64),
}

impl Loss {
    /// Whether a loss from the first value is more than allowed.
    pub fn is_exceeded_by(self, loss: f64, first: f64) -> bool {
        match self {
            Self::Absolute(limit) => loss > limit,
            Self::Relative(share) => loss > share * first.abs(),
        }
    }

    /// The same limit of values in a unit of such a size in SI.
    #[must_use]
    pub fn in_unit(self, si: f64) -> Self {
        match self {
            Self::Absolute(limit) => Self::Absolute(limit / si),
            Self::Relative(share) => Self::Relative(share),
        }
    }
}

/// What is wrong with a threshold, and how to mend it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ThresholdError {
    /// What is wrong.
    pub message: String,
    /// How to mend it.
    pub hint: String,
}

fn wrong(message: String, hint: impl Into<String>) -> ThresholdError {
    ThresholdError {
        message,
        hint: hint.into(),
    }
}

impl Threshold {
    /// Reads a threshold: `METRIC[@PERCENT][:CONFIGURATION]` and its limit, such as `clearance` and
    /// `0.5mm`, `tip_error@95:every` and `0.1mm`, `success_rate:Right-Up-Fold` and `0.02`. Engines are
    /// those of which metrics of their own may be named.
    ///
    /// # Errors
    /// An unknown name, or a limit that is no loss in a unit of the metric.
    pub fn parse(
        key: &str,
        limit: &str,
        compared: Compared<'_>,
        engines: &[&str],
    ) -> Result<Self, ThresholdError> {
        let (rest, of) = match key.split_once(':') {
            Some((rest, of)) => (rest.trim(), Some(of.trim())),
            None => (key.trim(), None),
        };
        let (name, percent) = match rest.split_once('@') {
            Some((name, percent)) => (name.trim(), Some(percent.trim())),
            None => (rest, None),
        };
        let subject = subject(name, percent, compared, engines)?;
        let quantity = match &subject {
            Subject::Metric(metric, _) => metric.metric().quantity,
            Subject::Rate(_) => Quantity::Ratio,
        };
        let (loss, unit) = parse_limit(name, quantity, limit.trim())?;
        Ok(Self {
            of: configuration(&subject, of, compared)?,
            limit: loss,
            unit,
            subject,
            key: key.trim().to_owned(),
            text: limit.trim().to_owned(),
        })
    }

    /// A loss from the first value that is more than allowed, in the unit of the limit and with the digits
    /// that show it.
    pub fn loss_text(&self, loss: f64, first: f64) -> String {
        let (name, size) = self.unit;
        match self.limit {
            Loss::Absolute(limit) => {
                let text = digits_apart(loss / size, limit / size);
                format!("{text} {name}").trim_end().to_owned()
            }
            Loss::Relative(share) if first != 0.0 => {
                format!(
                    "{} %",
                    digits_apart(100.0 * loss / first.abs(), 100.0 * share)
                )
            }
            Loss::Relative(_) => format!("{loss:.3e} from 0"),
        }
    }

    /// Whether it is on the same number as another.
    pub fn is_on_that_of(&self, other: &Self) -> bool {
        (&self.subject, &self.of) == (&other.subject, &other.of)
    }
}

fn subject(
    name: &str,
    percent: Option<&str>,
    compared: Compared<'_>,
    engines: &[&str],
) -> Result<Subject, ThresholdError> {
    let rates = match compared {
        Compared::Runs => &[],
        Compared::Studies(rates) => rates,
    };
    if let Some(rate) = rates.iter().find(|rate| rate.name == name) {
        return match percent {
            None => Ok(Subject::Rate(*rate)),
            Some(_) => Err(wrong(
                format!("{name} has no quantiles"),
                format!("omit the `@`: {name}=0.02"),
            )),
        };
    }
    let Some(metric) = MetricKey::named(name, engines) else {
        return Err(unknown(name, rates, engines));
    };
    let quantile = quantile(&metric, percent, compared)?;
    Ok(Subject::Metric(metric, quantile))
}

fn unknown(name: &str, rates: &[Rate], engines: &[&str]) -> ThresholdError {
    let metrics = MetricKey::all(engines).map(|metric| metric.key().into_owned());
    let rates = rates.iter().map(|rate| rate.name.to_owned());
    let names: Vec<String> = metrics.chain(rates).collect();
    let hint = match nearest_name(name, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("the metrics are {}", names.join(", ")),
    };
    wrong(format!("`{name}` is not a metric"), hint)
}

fn quantile(
    metric: &MetricKey,
    percent: Option<&str>,
    compared: Compared<'_>,
) -> Result<Option<f64>, ThresholdError> {
    let name = metric.key();
    match (compared, percent) {
        (Compared::Runs, None) => Ok(None),
        (Compared::Runs, Some(_)) => Err(wrong(
            format!("a run has no quantiles of {name}"),
            format!("omit the `@`, e.g. {name}=5%; studies have quantiles"),
        )),
        (Compared::Studies(_), None) => Ok(Some(match metric.more_is_better() {
            Some(true) => 0.05,
            _ => 0.95,
        })),
        (Compared::Studies(_), Some(text)) => {
            match text.trim_end_matches('%').trim().parse::<f64>() {
                Ok(percent) if (0.0..=100.0).contains(&percent) => Ok(Some(percent / 100.0)),
                _ => Err(wrong(
                    format!("`{text}` is not a percentage from 0 to 100"),
                    format!("e.g. {name}@5 for the 5th percentile"),
                )),
            }
        }
    }
}

fn configuration(
    subject: &Subject,
    of: Option<&str>,
    compared: Compared<'_>,
) -> Result<Option<String>, ThresholdError> {
    let of_layouts = matches!(subject, Subject::Rate(rate) if !rate.of_configurations);
    let has_best =
        matches!(subject, Subject::Metric(..)) && matches!(compared, Compared::Studies(_));
    let Some(of) = of else {
        return Ok(match (of_layouts, has_best) {
            (true, _) => None,
            (false, true) => Some(BEST.to_owned()),
            (false, false) => Some(EVERY.to_owned()),
        });
    };
    if of_layouts {
        return Err(wrong(
            format!("this is a rate of layouts, not of `{of}`"),
            "omit the `:` and what follows",
        ));
    }
    let mut known = vec![EVERY];
    known.extend(has_best.then_some(BEST));
    known.extend(Configuration::ALL.map(Configuration::label));
    if known.contains(&of) {
        return Ok(Some(of.to_owned()));
    }
    let hint = match nearest_name(of, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("one of {}", known.join(", ")),
    };
    Err(wrong(format!("`{of}` is not a configuration"), hint))
}

/// The limit, and the unit that it is given in.
fn parse_limit(
    name: &str,
    quantity: Quantity,
    text: &str,
) -> Result<(Loss, (&'static str, f64)), ThresholdError> {
    let units = quantity.units();
    let example = match quantity {
        Quantity::Ratio => "e.g. 0.02, or 2% of the first value".to_owned(),
        _ => format!("e.g. 0.5{0} or 5%", units[0].0),
    };
    // The unit starts with the first letter that is none of a number such as `1e-3`.
    let end = text
        .char_indices()
        .map(|(index, _)| index)
        .chain([text.len()])
        .rev()
        .find(|&end| text[..end].trim_end().parse::<f64>().is_ok());
    let number = end.and_then(|end| Some((text[..end].trim_end().parse::<f64>().ok()?, end)));
    let Some((value, end)) = number else {
        let message = format!("`{text}` is not a number with a unit");
        return Err(wrong(message, example));
    };
    if !value.is_finite() || value < 0.0 {
        return Err(wrong(
            format!("`{text}` is not a loss: a finite, non-negative value is required"),
            example,
        ));
    }
    let unit = text[end..].trim();
    if unit == "%" {
        return Ok((Loss::Relative(value / 100.0), ("%", 1.0)));
    }
    if let Some(known) = units.iter().find(|(name, _)| *name == unit) {
        return Ok((Loss::Absolute(value * known.1), *known));
    }
    // No loss at all is the same in every unit.
    if unit.is_empty() && value == 0.0 {
        return Ok((Loss::Absolute(0.0), units[0]));
    }
    let known = units.iter().map(|(name, _)| *name);
    let known = known.filter(|name| !name.is_empty()).chain(["%"]);
    let known: Vec<&str> = known.collect();
    Err(wrong(
        format!("`{unit}` is not a unit of {name}"),
        format!("give one of {}, {example}", known.join(", ")),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATES: [Rate; 2] = [
        Rate {
            name: "working_layouts",
            of_configurations: false,
        },
        Rate {
            name: "success_rate",
            of_configurations: true,
        },
    ];
    const STUDIES: Compared<'_> = Compared::Studies(&RATES);

    fn parse(key: &str, limit: &str, compared: Compared<'_>) -> Result<Threshold, ThresholdError> {
        Threshold::parse(key, limit, compared, &["rapier", "mujoco"])
    }

    fn limit(metric: &str, text: &str) -> Loss {
        parse(metric, text, Compared::Runs).unwrap().limit
    }

    fn hint(key: &str, text: &str, compared: Compared<'_>) -> String {
        let error = parse(key, text, compared).unwrap_err();
        format!("{error}; {}", error.hint)
    }

    #[test]
    fn limits_come_out_in_si_units() {
        assert_eq!(limit("clearance", "0.5mm"), Loss::Absolute(0.5e-3));
        assert_eq!(limit("clearance", " 1e-3 m "), Loss::Absolute(1e-3));
        assert_eq!(limit("tip_error", "10um"), Loss::Absolute(10.0 * 1e-6));
        assert_eq!(limit("motion_time", "100 ms"), Loss::Absolute(0.1));
        assert_eq!(
            limit("hand_cone", "180deg"),
            Loss::Absolute(std::f64::consts::PI)
        );
        assert_eq!(limit("joint_margin", "0.05"), Loss::Absolute(0.05));
        assert_eq!(limit("joint_margin", "5%"), Loss::Relative(0.05));
        assert_eq!(limit("tip_error_rapier", "5%"), Loss::Relative(0.05));
    }

    #[test]
    fn no_loss_at_all_needs_no_unit() {
        for metric in ["self_clearance", "motion_time", "hand_cone", "joint_margin"] {
            assert_eq!(limit(metric, "0"), Loss::Absolute(0.0), "{metric}");
        }
        assert!(parse("self_clearance", "1", Compared::Runs).is_err());
    }

    #[test]
    fn a_loss_is_told_with_the_digits_that_exceed_its_limit() {
        let text = |key, given, loss, first| {
            let threshold = parse(key, given, Compared::Runs).unwrap();
            assert!(threshold.limit.is_exceeded_by(loss, first));
            threshold.loss_text(loss, first)
        };
        assert_eq!(
            text("clearance", "10.001mm", 10.0014e-3, 0.02),
            "10.0014 mm"
        );
        assert_eq!(text("clearance", "10um", 10.0014e-3, 0.02), "10000 um");
        assert_eq!(text("motion_time", "10%", 0.400_02, 4.0), "10.0005 %");
        assert_eq!(text("self_clearance", "0", 1e-9, 0.02), "1.00e-6 mm");
    }

    #[test]
    fn wrong_thresholds_say_what_to_write() {
        let hint = |key, text| hint(key, text, Compared::Runs);
        assert!(hint("clearence", "1mm").contains("did you mean `clearance`?"));
        assert!(hint("xyz", "1mm").contains("the metrics are roll_static, "));
        assert!(
            hint("clearance", "1s").contains("`s` is not a unit of clearance; give one of mm, m,")
        );
        assert!(hint("clearance", "1").contains("give one of mm, m,"));
        assert!(hint("motion_time", "1m").contains("give one of s, ms, %"));
        assert!(hint("clearance", "mm").contains("0.5mm"));
        for wrong in ["-1mm", "nan", "inf", "infmm"] {
            assert!(hint("clearance", wrong).contains("finite"), "{wrong}");
        }
        assert!(hint("clearance@5", "1mm").contains("a run has no quantiles"));
        assert!(hint("clearance:best", "1mm").contains("`best` is not a configuration"));
        assert!(hint("success_rate", "0.1").contains("`success_rate` is not a metric"));
    }

    #[test]
    fn share_is_of_the_first_value() {
        let limit = limit("clearance", "10%");
        assert!(!limit.is_exceeded_by(0.99e-3, 10e-3));
        assert!(limit.is_exceeded_by(1.01e-3, 10e-3));
        assert!(limit.is_exceeded_by(1e-9, 0.0));
    }

    #[test]
    fn thresholds_of_studies_have_a_quantile_and_a_configuration() {
        let parse = |key, limit| parse(key, limit, STUDIES).unwrap();
        let quantile = |found: &Threshold| match &found.subject {
            Subject::Metric(_, quantile) => *quantile,
            Subject::Rate(_) => None,
        };
        let found = parse("clearance", "1mm");
        assert_eq!(
            (quantile(&found), found.of.as_deref()),
            (Some(0.05), Some(BEST))
        );
        let found = parse("tip_error_mm@99:every", "100 um");
        assert_eq!(
            (quantile(&found), found.of.as_deref()),
            (Some(0.99), Some(EVERY))
        );
        assert_eq!(
            found.limit.in_unit(1e-3),
            Loss::Absolute(100.0 * 1e-6 / 1e-3)
        );
        let found = parse("success_rate:Right-Up-Fold", "0.02");
        assert_eq!(found.of.as_deref(), Some("Right-Up-Fold"));
        assert_eq!(parse("success_rate", "0").of.as_deref(), Some(EVERY));
        assert_eq!(parse("working_layouts", "2%").of, None);
    }

    #[test]
    fn wrong_thresholds_of_studies_say_what_to_write() {
        for (key, limit, message, help) in [
            ("clearance@105", "1mm", "`105`", "clearance@5"),
            (
                "clearance:Right-Up-Fld",
                "1mm",
                "`Right-Up-Fld`",
                "`Right-Up-Fold`?",
            ),
            ("success_rate@5", "0.1", "no quantiles", "success_rate=0.02"),
            ("success_rate:best", "0.1", "`best`", ""),
            ("working_layouts:every", "0.1", "of layouts", "omit"),
            ("success_rate", "1mm", "`mm` is not a unit", "0.02"),
        ] {
            let found = hint(key, limit, STUDIES);
            assert!(found.contains(message) && found.contains(help), "{found}");
        }
    }
}
