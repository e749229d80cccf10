//! Objectives that candidates are compared by.

use needlebench_numerics::order::quantile_position;
use needlebench_scenario::study::search::ObjectiveName;
use serde::{Deserialize, Serialize};

use crate::statistics::{Interval, about_mean, clopper_pearson_with, quantile_ranks};

/// The outcome of a case with its best configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CaseWorth {
    /// The largest constraint margin of the configurations, mm; negative infinity of an invalid layout.
    pub margin_mm: f64,
    /// Whether any configuration is feasible.
    pub works: bool,
    /// The least RMS tip error of the feasible ones, mm; none where none is.
    pub tip_error_mm: Option<f64>,
    /// The largest probability of the feasible ones that the tip is in the lesion; none where none is.
    pub lesion_probability: Option<f64>,
}

/// An objective of a candidate, from the outcomes of its cases.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "name")]
pub enum Objective {
    /// A lower quantile of the margin, mm: more is better. Of type 7 of Hyndman and Fan, The American
    /// Statistician 50 (1996) 361: linear between order statistics, the first at 0 and the last at 1.
    Margin {
        /// Share of cases below it.
        quantile: f64,
    },
    /// The success rate, the share of cases with a feasible configuration: more is better.
    Rate,
    /// The mean RMS tip error, mm: less is better.
    TipError {
        /// Value of a case without a feasible configuration, mm.
        without_mm: f64,
    },
    /// The mean probability that the tip is in the lesion, 0 of a case without a feasible configuration: more is better.
    LesionProbability,
}

/// Ends of an interval; none where the sample is too small for one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ends {
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
}

/// An estimate with its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate in its unit; none where invalid layouts decide it.
    pub value: Option<f64>,
    /// Its interval.
    pub interval: Ends,
    /// Number of cases.
    pub cases: u64,
}

impl Objective {
    /// The objective that a study names.
    pub fn named(name: ObjectiveName, quantile: f64, without_mm: f64) -> Self {
        match name {
            ObjectiveName::Margin => Self::Margin { quantile },
            ObjectiveName::Rate => Self::Rate,
            ObjectiveName::TipError => Self::TipError { without_mm },
            ObjectiveName::LesionProbability => Self::LesionProbability,
        }
    }

    /// In words, with its parameter.
    pub fn words(self) -> String {
        match self {
            Self::Margin { quantile } => format!("P{:.3} margin", quantile * 100.0)
                .replace(".000 ", " ")
                .replace("00 ", " "),
            Self::Rate => "success rate".to_owned(),
            Self::TipError { .. } => "mean RMS tip error".to_owned(),
            Self::LesionProbability => "mean lesion probability".to_owned(),
        }
    }

    /// Unit of its figure; `1` of a share and of a probability.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Margin { .. } | Self::TipError { .. } => "mm",
            Self::Rate | Self::LesionProbability => "1",
        }
    }

    /// Whether more is better.
    pub fn more_is_better(self) -> bool {
        !matches!(self, Self::TipError { .. })
    }

    /// The figure with such a sign that more is better; of no cases the worst.
    pub fn score(self, values: &[CaseWorth]) -> f64 {
        if values.is_empty() {
            return f64::NEG_INFINITY;
        }
        match self {
            Self::Margin { quantile } => {
                let mut sorted: Vec<f64> = values.iter().map(|each| each.margin_mm).collect();
                sorted.sort_unstable_by(f64::total_cmp);
                lower_quantile(&sorted, quantile)
            }
            Self::Rate => mean(values, |each| f64::from(u8::from(each.works))),
            Self::TipError { without_mm } => {
                -mean(values, |each| each.tip_error_mm.unwrap_or(without_mm))
            }
            Self::LesionProbability => mean(values, CaseWorth::in_lesion),
        }
    }

    /// The most that the score can be of cases of which some are known to be out of reach: those have at most
    /// such a margin, mm, and are infeasible.
    pub fn most(self, out_of_reach: &[Option<f64>]) -> f64 {
        let best = |out: &Option<f64>| CaseWorth {
            margin_mm: out.unwrap_or(f64::INFINITY),
            works: out.is_none(),
            tip_error_mm: out.is_none().then_some(0.0),
            lesion_probability: out.is_none().then_some(1.0),
        };
        let values: Vec<CaseWorth> = out_of_reach.iter().map(best).collect();
        self.score(&values)
    }

    /// A score as the figure in its unit; none that is not finite.
    pub fn figure(self, score: f64) -> Option<f64> {
        let figure = if self.more_is_better() { score } else { -score };
        figure.is_finite().then_some(figure)
    }

    /// The figure with its interval, if the cases are independent: of a quantile by order statistics, of a
    /// share by Clopper and Pearson, both of which hold for any distribution; of a mean by Student's.
    pub fn estimate(self, values: &[CaseWorth]) -> Estimate {
        const TAIL: f64 = 0.025;
        let none = Ends {
            low: None,
            high: None,
        };
        let finite = |value: f64| value.is_finite().then_some(value);
        let of = |interval: Interval| Ends {
            low: Some(interval.low),
            high: Some(interval.high),
        };
        let n = values.len();
        let interval = match self {
            _ if n == 0 => none,
            Self::Margin { quantile } => {
                let mut sorted: Vec<f64> = values.iter().map(|each| each.margin_mm).collect();
                sorted.sort_unstable_by(f64::total_cmp);
                let (low, high) = quantile_ranks(n as u64, quantile, TAIL);
                let at = |rank: Option<u64>| {
                    let rank = usize::try_from(rank?).expect("at most the number of cases");
                    finite(sorted[rank - 1])
                };
                Ends {
                    low: at(low),
                    high: at(high),
                }
            }
            Self::Rate => of(clopper_pearson_with(self.score(values), n as f64, TAIL)),
            Self::TipError { without_mm } => {
                let of_case = |each: &CaseWorth| each.tip_error_mm.unwrap_or(without_mm);
                of_mean(values, of_case).map_or(none, of)
            }
            Self::LesionProbability => {
                let within = |interval: Interval| Interval {
                    low: interval.low.max(0.0),
                    high: interval.high.min(1.0),
                };
                of_mean(values, CaseWorth::in_lesion).map_or(none, |found| of(within(found)))
            }
        };
        Estimate {
            value: self.figure(self.score(values)),
            interval,
            cases: n as u64,
        }
    }
}

impl CaseWorth {
    /// The probability that the tip is in the lesion; 0 without a feasible configuration.
    pub(super) fn in_lesion(&self) -> f64 {
        self.lesion_probability.unwrap_or(0.0)
    }
}

/// Student's interval of a mean; none of fewer than two values.
fn of_mean(values: &[CaseWorth], of: impl Fn(&CaseWorth) -> f64) -> Option<Interval> {
    let n = values.len();
    if n < 2 {
        return None;
    }
    let mean = mean(values, &of);
    let squares = values.iter().map(|each| (of(each) - mean).powi(2));
    let variance = squares.sum::<f64>() / (n - 1) as f64;
    Some(about_mean(mean, (variance / n as f64).sqrt(), n - 1))
}

fn mean(values: &[CaseWorth], of: impl Fn(&CaseWorth) -> f64) -> f64 {
    values.iter().map(of).sum::<f64>() / values.len() as f64
}

/// Quantile of type 7 of ascending values, of which some may be infinite.
pub(super) fn lower_quantile(sorted: &[f64], p: f64) -> f64 {
    let (index, share) = quantile_position(sorted.len() as u64, p);
    let index = usize::try_from(index).expect("an index of a list");
    let low = sorted[index];
    match sorted.get(index + 1) {
        Some(&high) if share > 0.0 && low.is_finite() => low + share * (high - low),
        _ => low,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(margins: &[f64]) -> Vec<CaseWorth> {
        let value = |&margin_mm: &f64| CaseWorth {
            margin_mm,
            works: margin_mm >= 0.0,
            tip_error_mm: (margin_mm >= 0.0).then_some(0.5),
            lesion_probability: (margin_mm >= 0.0).then_some(0.75),
        };
        margins.iter().map(value).collect()
    }

    /// `numpy.quantile(x, q)` (NumPy 2, method "linear", which is type 7).
    #[test]
    fn quantiles_are_those_of_numpy() {
        let x: Vec<f64> = (0..20).map(|k| f64::from(k * k) - 30.0).collect();
        for (p, expected) in [(0.05, -29.05), (0.25, -7.25), (0.5, 60.5), (0.0, -30.0)] {
            let found = Objective::Margin { quantile: p }.score(&values(&x));
            assert!((found - expected).abs() < 1e-12, "{p}: {found}");
        }
    }

    #[test]
    fn layouts_that_cannot_exist_are_worse_than_any() {
        let mut some = vec![f64::NEG_INFINITY; 3];
        some.extend([5.0; 17]);
        let margin = Objective::Margin { quantile: 0.05 };
        assert_eq!(margin.score(&values(&some)), f64::NEG_INFINITY);
        assert_eq!(margin.estimate(&values(&some)).value, None);
        assert_eq!(margin.score(&[]), f64::NEG_INFINITY);
    }

    #[test]
    fn what_is_out_of_reach_bounds_every_objective() {
        let out = [None, Some(-3.0), None, None];
        assert_eq!(Objective::Rate.most(&out), 0.75);
        let tip = Objective::TipError { without_mm: 8.0 };
        assert_eq!(tip.most(&out), -2.0);
        assert_eq!(Objective::LesionProbability.most(&out), 0.75);
        let low = Objective::Margin { quantile: 0.0 };
        assert_eq!(low.most(&out), -3.0);
        let middle = Objective::Margin { quantile: 0.5 };
        assert_eq!(middle.most(&out), f64::INFINITY);
    }

    #[test]
    fn quantiles_have_intervals_of_order_statistics() {
        let x: Vec<f64> = (1..=100).map(f64::from).collect();
        let found = Objective::Margin { quantile: 0.05 }.estimate(&values(&x));
        // Of B(100, 0.05): P(B <= 0) = 0.0059, P(B <= 1) = 0.037; P(B >= 11) = 0.0115, P(B >= 10) = 0.0282.
        assert_eq!(found.interval.low, Some(1.0));
        assert_eq!(found.interval.high, Some(11.0));
        let few = Objective::Margin { quantile: 0.05 }.estimate(&values(&x[..40]));
        assert_eq!(few.interval.low, None, "no end where the sample has none");
    }

    /// `scipy.stats.t.interval(0.95, 7, 0.65625, x.std(ddof=1) / sqrt(8))`, of seven 0.75 and one 0; of few cases the
    /// upper end would be above 1.
    #[test]
    fn lesion_probabilities_have_students_interval_within_0_and_1() {
        let mut margins = vec![1.0; 7];
        margins.push(-1.0);
        let found = Objective::LesionProbability.estimate(&values(&margins));
        assert_eq!(found.value, Some(0.656_25));
        assert!((found.interval.low.unwrap() - 0.434_566_5).abs() < 1e-6);
        assert!((found.interval.high.unwrap() - 0.877_933_5).abs() < 1e-6);
        let few = Objective::LesionProbability.estimate(&values(&[1.0, -1.0]));
        assert_eq!(
            (few.interval.low, few.interval.high),
            (Some(0.0), Some(1.0))
        );
        let none = Objective::LesionProbability.estimate(&values(&[1.0]));
        assert_eq!(none.interval.low, None);
    }

    #[test]
    fn objectives_are_called_by_what_they_ask() {
        assert_eq!(Objective::Margin { quantile: 0.05 }.words(), "P5 margin");
        assert_eq!(Objective::Margin { quantile: 0.025 }.words(), "P2.5 margin");
    }
}
