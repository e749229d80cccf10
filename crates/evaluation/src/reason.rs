//! Why a configuration is recommended, in words.

use crate::metric::{Bound, Metric};
use crate::ranking_report::{GoalRanking, RankingReport, SAME_SCORE, Term};
use crate::report::ConfigurationReport;
use needlebench_cell::pair_in_words;

/// Terms that are named for the first choice and, of the runner-up's leads, against it.
const NAMED: (usize, usize) = (3, 2);
/// Share of all differences of contributions below which one is not named.
const WORTH_A_WORD: f64 = 0.1;

/// Why `first` is chosen of `all` feasible ones.
pub(crate) fn reason(
    first: &ConfigurationReport,
    second: Option<&ConfigurationReport>,
    all: &[&ConfigurationReport],
    ranking: &GoalRanking,
) -> String {
    let nearest = first.clearance.least_from_surroundings().map(|found| {
        format!(
            "clearance {} mm ({} in the {}){}",
            shown_mm(found.minimum_m),
            pair_in_words(&found.pair),
            found.phase,
            shared(found.minimum_m, all)
        )
    });
    let mut clauses = match second {
        None => vec!["the only feasible configuration".to_owned()],
        Some(second) => against(first, second, ranking),
    };
    clauses.extend(nearest);
    clauses.join("; ")
}

/// The same in one sentence: runner-up of `all` feasible ones, in what it is worse, and the clearance.
pub(crate) fn one_sentence(
    first: &ConfigurationReport,
    second: Option<&ConfigurationReport>,
    all: &[&ConfigurationReport],
    ranking: &GoalRanking,
) -> String {
    let why = second.map_or_else(
        || "the only feasible configuration".to_owned(),
        |second| beside(first, second, ranking),
    );
    // As the column of that name.
    match first.clearance.least_from_surroundings() {
        Some(found) => format!(
            "{why}; clearance {} mm ({}){}",
            shown_mm(found.minimum_m),
            pair_in_words(&found.pair),
            shared(found.minimum_m, all)
        ),
        None => why,
    }
}

fn shown_mm(metres: f64) -> String {
    format!("{:.1}", metres * 1e3)
}

/// Remark on a clearance that is identical for all, as far as it is shown: the goal determines it, so it is no reason
/// for one of them.
fn shared(clearance_m: f64, all: &[&ConfigurationReport]) -> &'static str {
    let has_it = |each: &&ConfigurationReport| {
        let least = each.clearance.least_from_surroundings();
        least.is_some_and(|least| shown_mm(least.minimum_m) == shown_mm(clearance_m))
    };
    if all.len() > 1 && all.iter().all(has_it) {
        ", identical for all feasible"
    } else {
        ""
    }
}

/// Score and place of the first choice, and what puts it before the second.
fn beside(
    first: &ConfigurationReport,
    second: &ConfigurationReport,
    ranking: &GoalRanking,
) -> String {
    let count = ranking.order.len();
    let (Some(mine), Some(theirs)) = (&first.ranking, &second.ranking) else {
        return format!("first of {count} feasible");
    };
    let (ahead, behind) = differences(mine, theirs);
    let score = mine.score * 100.0;
    if !ranking.not_told_apart.is_empty() {
        let mut apart: Vec<&Difference<'_>> = ahead.iter().chain(&behind).collect();
        apart.sort_by(|a, b| b.lead.abs().total_cmp(&a.lead.abs()));
        let apart: Vec<&str> = apart
            .iter()
            .take(2)
            .map(|each| words(each.mine.metric))
            .collect();
        let decide = if apart.is_empty() {
            String::new()
        } else {
            format!("; largest differences: {}", apart.join(", "))
        };
        return format!(
            "score {score:.1}/100, first of {count} feasible, but tied with {} (within the \
             metrics' resolution){decide}",
            and(&ranking.not_told_apart)
        );
    }
    let scores = format!(
        "score {score:.1}/100, best of {count} feasible; runner-up {} ({:.1})",
        second.label,
        theirs.score * 100.0
    );
    let leads: Vec<&str> = ahead
        .iter()
        .take(2)
        .map(|each| words(each.mine.metric))
        .collect();
    if leads.is_empty() {
        return scores;
    }
    format!("{scores} is worse in {}", leads.join(" and "))
}

/// What speaks for the first choice and against it beside the second.
fn against(
    first: &ConfigurationReport,
    second: &ConfigurationReport,
    ranking: &GoalRanking,
) -> Vec<String> {
    let count = ranking.order.len();
    let (Some(mine), Some(theirs)) = (&first.ranking, &second.ranking) else {
        return vec![format!(
            "first of {count} feasible: no metric with a weight was measured for all of them"
        )];
    };
    let mut clauses = vec![
        format!(
            "score {:.1}/100, best of {count} feasible",
            100.0 * mine.score
        ),
        format!("runner-up {} ({:.1})", second.label, 100.0 * theirs.score),
    ];
    let (ahead, behind) = differences(mine, theirs);
    if !ranking.not_told_apart.is_empty() {
        clauses.push(format!(
            "tied with {}: scores differ by less than the metrics' resolutions add up to",
            and(&ranking.not_told_apart)
        ));
    }
    if (mine.score - theirs.score).abs() <= SAME_SCORE {
        clauses.push("scores are equal and it is listed first".to_owned());
    }
    for (words, terms, named) in [
        ("better in", &ahead, NAMED.0),
        ("worse in", &behind, NAMED.1),
    ] {
        let terms: Vec<String> = terms.iter().take(named).map(Difference::text).collect();
        if !terms.is_empty() {
            clauses.push(format!("{words} {}", terms.join(", ")));
        }
    }
    clauses.push(robustness(ranking));
    if let Some(dominance) = &first.dominated_by {
        let better: Vec<&str> = dominance.better_in.iter().map(|key| words(key)).collect();
        clauses.push(format!(
            "not in the Pareto set (effort and preferences excluded): {} is better in {} and equal \
             in everything else",
            dominance.label,
            better.join(", ")
        ));
    }
    clauses
}

/// `A`, `A and B`, `A, B and C`.
fn and(labels: &[String]) -> String {
    match labels.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
        None => String::new(),
    }
}

fn words(key: &'static str) -> &'static str {
    Metric::of_key(key).map_or(key, |metric| metric.words)
}

/// Contributions that differ, of one metric.
struct Difference<'a> {
    mine: &'a Term,
    theirs: &'a Term,
    lead: f64,
}

impl Difference<'_> {
    fn text(&self) -> String {
        let metric = Metric::of_key(self.mine.metric);
        let text =
            |value: f64| metric.map_or(value.to_string(), |metric| metric.quantity.text(value));
        // A table beside it has what was attained, which is a little more.
        let proven = metric.is_some_and(|metric| metric.bound == Bound::Certified);
        format!(
            "{} ({}{} vs. {}: {:+.1})",
            words(self.mine.metric),
            if proven { "certified " } else { "" },
            text(self.mine.value),
            text(self.theirs.value),
            100.0 * self.lead
        )
    }
}

/// Where the first is ahead of the second and where it is behind, largest difference first.
fn differences<'a>(
    mine: &'a RankingReport,
    theirs: &'a RankingReport,
) -> (Vec<Difference<'a>>, Vec<Difference<'a>>) {
    let mut all: Vec<Difference<'_>> = mine
        .terms
        .iter()
        .zip(&theirs.terms)
        .map(|(mine, theirs)| Difference {
            mine,
            theirs,
            lead: mine.contribution - theirs.contribution,
        })
        .filter(|difference| difference.lead.abs() > SAME_SCORE)
        .collect();
    let total: f64 = all.iter().map(|difference| difference.lead.abs()).sum();
    all.retain(|difference| difference.lead.abs() >= WORTH_A_WORD * total);
    all.sort_by(|a, b| b.lead.abs().total_cmp(&a.lead.abs()));
    all.into_iter()
        .partition(|difference| difference.lead > 0.0)
}

fn robustness(ranking: &GoalRanking) -> String {
    let Some(change) = &ranking.smallest_weight_change else {
        return "no single weight change would alter the choice".to_owned();
    };
    let (words, winner) = (words(change.metric), &change.then_first);
    let (from, to) = (
        format!("{:.2}", change.weight),
        format!("{:.2}", change.even_at),
    );
    let more = change.even_at >= change.weight;
    if from == to {
        let direction = if more { "increase" } else { "decrease" };
        return format!(
            "the slightest {direction} in the weight of {words} would put {winner} first"
        );
    }
    let direction = if more { "above" } else { "below" };
    format!("a weight of {words} {direction} {to} (now {from}) would put {winner} first")
}
