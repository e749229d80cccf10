//! Why a configuration is recommended, in words.

use crate::metric::{Bound, Metric};
use crate::ranking_report::{GoalRanking, RankingReport, SAME_SCORE, Term};
use crate::report::ConfigurationReport;
use needlebench_cell::{pair_in_words, part_in_words};

/// Terms that are named for the first choice and, of the runner-up's leads, against it.
const NAMED: (usize, usize) = (3, 2);
/// Share of all differences of contributions below which one is not worth a word.
const WORTH_A_WORD: f64 = 0.1;

/// Why `first` is chosen of all that work.
pub(crate) fn reason(
    first: &ConfigurationReport,
    second: Option<&ConfigurationReport>,
    ranking: &GoalRanking,
) -> String {
    let nearest = first.clearance.least_from_surroundings().map(|found| {
        format!(
            "clearance {:.1} mm ({} to {} in the {})",
            found.minimum_m * 1e3,
            part_in_words(&found.pair[0]),
            part_in_words(&found.pair[1]),
            found.phase
        )
    });
    let mut clauses = match second {
        None => vec!["the only one that works".to_owned()],
        Some(second) => against(first, second, ranking),
    };
    clauses.extend(nearest);
    clauses.join("; ")
}

/// The same in one sentence: what it beats, in what, and how near anything comes.
pub(crate) fn one_sentence(
    first: &ConfigurationReport,
    second: Option<&ConfigurationReport>,
    ranking: &GoalRanking,
) -> String {
    let why = second.map_or_else(
        || "the only one that works".to_owned(),
        |second| beside(first, second, ranking),
    );
    // As the column of that name.
    match first.clearance.least_from_surroundings() {
        Some(found) => format!(
            "{why}; clearance {:.1} mm ({})",
            found.minimum_m * 1e3,
            pair_in_words(&found.pair)
        ),
        None => why,
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
        return format!("first in the table of {count} that work");
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
            format!("; what would decide is {}", apart.join(" or "))
        };
        return format!(
            "score {score:.1} of 100, first of {count} that work, but not told apart from {} (within what the metrics \
             resolve){decide}",
            and(&ranking.not_told_apart)
        );
    }
    let scores = format!(
        "score {score:.1} of 100, best of {count} that work; next is {} with {:.1}",
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
    format!("{scores}, behind in {}", leads.join(" and "))
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
            "first in the table of {count} that work: nothing that has a weight was measured for \
             all of them"
        )];
    };
    let mut clauses = vec![
        format!(
            "score {:.1} of 100, best of {count} that work",
            100.0 * mine.score
        ),
        format!("{} has {:.1}", second.label, 100.0 * theirs.score),
    ];
    let (ahead, behind) = differences(mine, theirs);
    if !ranking.not_told_apart.is_empty() {
        clauses.push(format!(
            "not told apart from {}: their scores are nearer than the resolutions of the metrics add up to",
            and(&ranking.not_told_apart)
        ));
    }
    if (mine.score - theirs.score).abs() <= SAME_SCORE {
        clauses.push("the two are even and it comes first in the table".to_owned());
    }
    for (words, terms, named) in [
        ("ahead in", &ahead, NAMED.0),
        ("behind in", &behind, NAMED.1),
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
            "not in the Pareto set: leaving effort and preferences aside {} is better in {} and \
             as good in everything else",
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
            "{} ({}{} against {}: {:+.1})",
            words(self.mine.metric),
            if proven { "proven " } else { "" },
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
        return "no change of a single weight would change the choice".to_owned();
    };
    let (words, winner) = (words(change.metric), &change.then_first);
    let (from, to) = (
        format!("{:.2}", change.weight),
        format!("{:.2}", change.even_at),
    );
    let more = change.even_at >= change.weight;
    if from == to {
        let direction = if more { "more" } else { "less" };
        return format!("the slightest {direction} weight of {words} would put {winner} first");
    }
    let direction = if more { "above" } else { "below" };
    format!("a weight of {words} {direction} {to} instead of {from} would put {winner} first")
}
