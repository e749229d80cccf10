//! The metrics: every number by which configurations are evaluated, ranked and compared, declared once.
//!
//! A metric is an entry of the [table](GROUPS): what it is called, what exactly it is, and how it is read from a
//! configuration's part of the report. All else is made from the table: rows and columns of studies, criteria, rankings
//! and Pareto sets, thresholds of comparisons, headings of tables and pages. One name is one thing: a certified bound
//! and a nearest approach, one draw of the imperfections and all of them, a posture, a planned motion and a simulated
//! one are different metrics.
//!
//! What is missing or not finite was *not measured*, and is never taken for 0.

mod entry;
mod key;
mod quantity;
mod readers;
mod resolution;
mod table;

pub use entry::{
    Asked, Better, Bound, Criterion, Draw, Heading, Metric, Missing, Precision, Role, Show, Source,
    Stage, Statistics,
};
pub use key::{MetricKey, set_measured};
pub use quantity::{Quantity, Unit};
pub use resolution::{Resolved, resolve};
pub use table::{GROUPS, Group};

/// Every metric, in the order of reports.
///
/// Where several metrics of a family would do, the later counts: it says more.
pub fn metrics() -> impl DoubleEndedIterator<Item = &'static Metric> {
    GROUPS.iter().flat_map(|group| group.metrics.iter())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use needlebench_scenario::ranking::{RankingSection, less_is_better};

    use super::*;

    #[test]
    fn one_name_is_one_metric() {
        let mut names = BTreeSet::new();
        for metric in metrics() {
            let fixed = metric.static_key.filter(|key| *key != metric.key);
            let all = [Some(metric.key), fixed];
            for name in all.into_iter().flatten() {
                assert!(names.insert(name), "{name} is the name of two metrics");
            }
        }
    }

    #[test]
    fn every_ranking_key_of_scenarios_has_metrics_that_agree_on_its_direction_and_unit() {
        let aims = RankingSection::default().aims();
        for (key, _) in aims {
            let ranked: Vec<&Metric> = metrics()
                .filter(|metric| metric.ranking_key == Some(key))
                .collect();
            assert!(!ranked.is_empty(), "no metric is ranked by {key}");
            for metric in ranked {
                let less = less_is_better(key);
                assert_eq!(metric.better == Some(Better::Less), less, "{key}");
                assert_eq!(metric.better == Some(Better::More), !less, "{key}");
                assert!(key.ends_with(metric.unit.suffix), "{key}");
            }
        }
        for metric in metrics() {
            let known = |key| aims.iter().any(|(name, _)| *name == key);
            assert!(metric.ranking_key.is_none_or(known), "{}", metric.key);
        }
    }

    #[test]
    fn what_is_ranked_or_judged_has_a_direction() {
        for metric in metrics() {
            let needs = metric.in_pareto_set
                || metric.ranking_key.is_some()
                || metric.criterion.is_some()
                || metric.statistics.by_case;
            assert!(!needs || metric.better.is_some(), "{}", metric.key);
        }
    }
}
