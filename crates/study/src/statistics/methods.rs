//! How the numbers were found, and what to keep in mind about them.

use serde::{Deserialize, Serialize};

use super::{Sampling, Summary, varies};
use crate::Factor;

/// How numbers were found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Method {
    /// Numbers that were found so.
    pub numbers: String,
    /// How.
    pub method: String,
    /// Who says so.
    pub source: String,
}

const METHODS: [[&str; 3]; 9] = [
    [
        "intervals of rates",
        "Clopper and Pearson's, 95 %, of the effective number of layouts",
        "Clopper, Pearson, Biometrika 26 (1934) 404; Korn, Graubard, Surv. Methodol. 24 (1998) 193",
    ],
    [
        "effective number of layouts",
        "layouts over the design effect, from the spread of 256 random groups of the sampled points and one \
         point more that has the rarer outcome as a whole, times the squared ratio of Student's quantiles \
         with as many degrees of freedom as layouts and as groups, less one each; never fewer than the \
         points, which are counted where all layouts work or none does",
        "Korn, Graubard (1998); Kish, Survey Sampling (1965); the coverage is simulated in the tests",
    ],
    [
        "quantiles",
        "exact order statistics, linear in between (type 7)",
        "Hyndman, Fan, Am. Stat. 50 (1996) 361",
    ],
    [
        "intervals of quantiles",
        "order statistics by the binomial distribution, at least 95 %, without any assumption on the \
         distribution; layouts of one sampled point count as one",
        "David, Nagaraja, Order Statistics (2003), section 7.1",
    ],
    [
        "main effects",
        "share of the variance between the means of levels or bins, less what chance makes of it \
         (epsilon squared); estimates the first-order Sobol index of an independent factor, too low by \
         the variance within bins: 1/256 of the whole where a response is linear over 16 bins",
        "Kelley, Proc. Natl. Acad. Sci. 21 (1935) 554; Sobol, Math. Model. Comput. Exp. 1 (1993) 407",
    ],
    [
        "interactions",
        "epsilon squared of the cells of two factors less that of each; estimates the second-order \
         Sobol index of independent factors, too low by the variance within cells",
        "Saltelli et al., Global Sensitivity Analysis (2008), chapter 1",
    ],
    [
        "maps",
        "a configuration wins a cell where the interval of its share of best clearances is above \
         that of every other",
        "as the intervals of rates; not corrected for the number of cells",
    ],
    [
        "choices against the first",
        "difference of the shares with Student's interval from random groups of the sampled points, \
         paired by the point; at least 6 layouts apart, as an exact McNemar test needs; not corrected \
         for the number of choices",
        "Wolter (2007), chapter 2; McNemar, Psychometrika 12 (1947) 153",
    ],
    [
        "best configuration of a layout",
        "the largest clearance of those that are ok, the first of equal ones: the nearest approach along \
         the simulated motion; of planned cases along the planned one, of static cases in their posture",
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

/// What to keep in mind about a summary.
pub(crate) fn notes(summary: &Summary, factors: &[Factor], paired: usize) -> Vec<String> {
    let mut notes = Vec::new();
    let sampled = factors
        .iter()
        .any(|factor| factor.is_sampled() && varies(factor));
    match summary.sampling {
        _ if !sampled => notes.push(
            "nothing is sampled: rates are exact for this grid, and their intervals are those of as \
             many independent layouts"
                .to_owned(),
        ),
        Sampling::Sobol | Sampling::LatinHypercube => notes.push(
            "the points fill the space more evenly than random ones: intervals are those of random \
             points and as a rule wider than they need be"
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
            "each sampled point appears in {} cases: {} valid layouts are worth {worth:.0} independent \
             ones for the rate of layouts that work",
            summary.repeats, overall.layouts
        ));
    }
    if overall.layouts == 0 {
        notes.push("no layout is valid: there is nothing to sum up".to_owned());
    } else if overall.layouts < 30 {
        notes.push(format!(
            "small sample: {} valid layouts; take no share or quantile for more than a hint",
            overall.layouts
        ));
    }
    if overall.invalid > 0 {
        notes.push(format!(
            "{} of {} layouts cannot exist and are in no rate; the factors of those that are left may \
             depend on each other, and effects then overlap",
            overall.invalid, overall.cases
        ));
    }
    let with_best: u64 = overall.configurations.iter().map(|each| each.best).sum();
    if with_best < overall.layouts {
        notes.push(format!(
            "the best configuration is of the {with_best} layouts that have one: look at its clearance \
             and tip error together with the rate of layouts that work"
        ));
    }
    if paired < summary.effects.axes.len() {
        notes.push(format!(
            "pairs of factors: of the {paired} with the largest main effects"
        ));
    }
    if let Some(choices) = &summary.choices {
        if !choices.paired {
            notes.push(
                "the choices did not meet the same circumstances: their differences are not paired"
                    .to_owned(),
            );
        }
        if choices.validity_differs {
            notes.push(
                "the choices differ in which layouts can exist: look at the invalid cases before the \
                 rates, which are of valid layouts"
                    .to_owned(),
            );
        }
        if choices.axes.iter().any(|axis| axis.coarse) {
            notes.push(
                "sampled choices are ranked by ranges: a range holds good and bad values"
                    .to_owned(),
            );
        }
    }
    notes
}
