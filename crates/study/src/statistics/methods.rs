//! Methods of the statistics, and notes on them.

use serde::{Deserialize, Serialize};

use super::{Sampling, Summary, varies};
use crate::Factor;

/// Method of one kind of numbers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Method {
    /// The numbers.
    pub numbers: String,
    /// The method.
    pub method: String,
    /// The source.
    pub source: String,
}

const METHODS: [[&str; 3]; 9] = [
    [
        "confidence intervals of rates",
        "Clopper-Pearson, 95 %, with the effective sample size",
        "Clopper, Pearson, Biometrika 26 (1934) 404; Korn, Graubard, Surv. Methodol. 24 (1998) 193",
    ],
    [
        "effective sample size",
        "number of layouts divided by the design effect (from the spread of 256 random groups of the sampled \
         points, plus one point with the rarer outcome throughout), times the squared ratio of Student's \
         quantiles with (layouts - 1) and (groups - 1) degrees of freedom; at least the number of points, which \
         is used where all layouts are feasible or none is",
        "Korn, Graubard (1998); Kish, Survey Sampling (1965); the coverage is simulated in the tests",
    ],
    [
        "quantiles",
        "exact order statistics, linear interpolation (type 7)",
        "Hyndman, Fan, Am. Stat. 50 (1996) 361",
    ],
    [
        "confidence intervals of quantiles",
        "distribution-free, from order statistics and the binomial distribution, at least 95 %; layouts of one \
         sampled point count as one",
        "David, Nagaraja, Order Statistics (2003), section 7.1",
    ],
    [
        "main effects",
        "share of the variance between the means of levels or bins, corrected for chance (epsilon squared); \
         estimates the first-order Sobol index of an independent factor; too low by the variance within bins: \
         1/256 of the total for a response that is linear over 16 bins",
        "Kelley, Proc. Natl. Acad. Sci. 21 (1935) 554; Sobol, Math. Model. Comput. Exp. 1 (1993) 407",
    ],
    [
        "interactions",
        "epsilon squared of the cells of two factors minus that of each factor; estimates the second-order \
         Sobol index of independent factors; too low by the variance within cells",
        "Saltelli et al., Global Sensitivity Analysis (2008), chapter 1",
    ],
    [
        "maps",
        "a configuration wins a cell if the confidence interval of its share of best clearances is above that \
         of every other",
        "as the confidence intervals of rates; not corrected for the number of cells",
    ],
    [
        "candidates compared with no. 1",
        "difference of the success rates with Student's interval from random groups of the sampled points, \
         paired by point; significant only if at least 6 layouts differ, as the exact McNemar test requires; \
         not corrected for the number of candidates",
        "Wolter (2007), chapter 2; McNemar, Psychometrika 12 (1947) 153",
    ],
    [
        "best configuration of a layout",
        "the feasible configuration with the largest clearance, the first of equal ones; minimum clearance along \
         the simulated motion (planned cases: planned motion; static cases: posture)",
        "definition",
    ],
];

pub(crate) fn methods() -> Vec<Method> {
    METHODS
        .map(|[numbers, method, source]| Method {
            numbers: numbers.to_owned(),
            method: method.to_owned(),
            source: source.to_owned(),
        })
        .to_vec()
}

/// Notes on a summary.
pub(crate) fn notes(summary: &Summary, factors: &[Factor], paired: usize) -> Vec<String> {
    let mut notes = Vec::new();
    let sampled = factors
        .iter()
        .any(|factor| factor.is_sampled() && varies(factor));
    match summary.sampling {
        _ if !sampled => notes.push(
            "no factor is sampled: rates are exact for this grid; their confidence intervals assume as many \
             independent layouts"
                .to_owned(),
        ),
        Sampling::Sobol | Sampling::LatinHypercube => notes.push(
            "the points fill the space more evenly than random ones; confidence intervals assume random points and \
             are usually conservative"
                .to_owned(),
        ),
        Sampling::Random => {}
    }
    let overall = &summary.overall;
    if summary.repeats > 1 {
        let worth = overall
            .at_least
            .first()
            .map_or(0.0, |rate| rate.effective_size);
        notes.push(format!(
            "each sampled point appears in {} cases: the effective sample size of {} valid layouts is {worth:.0} \
             for the rate of feasible layouts",
            summary.repeats, overall.layouts
        ));
    }
    if overall.layouts == 0 {
        notes.push("no layout is valid: no statistics".to_owned());
    } else if overall.layouts < 30 {
        notes.push(format!(
            "small sample: {} valid layouts; rates and quantiles are only indicative",
            overall.layouts
        ));
    }
    if overall.invalid > 0 {
        notes.push(format!(
            "{} of {} layouts are invalid and excluded from all rates; factors of the remaining layouts may be \
             dependent, and effects then overlap",
            overall.invalid, overall.cases
        ));
    }
    let with_best: u64 = overall.configurations.iter().map(|each| each.best).sum();
    if with_best < overall.layouts {
        notes.push(format!(
            "statistics of the best configuration cover the {with_best} feasible layouts: read its clearance and tip \
             error together with the rate of feasible layouts"
        ));
    }
    if paired < summary.effects.axes.len() {
        notes.push(format!(
            "interactions: only of the {paired} factors with the largest main effects"
        ));
    }
    if let Some(choices) = &summary.choices {
        if !choices.paired {
            notes.push(
                "candidates were not evaluated on the same noise factors: their differences are not paired"
                    .to_owned(),
            );
        }
        if choices.validity_differs {
            notes.push(
                "candidates differ in which layouts are valid: check the invalid cases before the rates, which cover \
                 valid layouts only"
                    .to_owned(),
            );
        }
        if choices.axes.iter().any(|axis| axis.coarse) {
            notes.push(
                "sampled candidates are ranked by ranges: a range contains good and bad values"
                    .to_owned(),
            );
        }
    }
    notes
}
