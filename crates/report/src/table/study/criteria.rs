//! The criteria of a study: values, limits, verdicts, and the requirements that they verify.

use needlebench_evaluation::report::TraceOutcome;
use needlebench_scenario::requirements::Requirements;
use needlebench_show::Block;
use needlebench_show::number::{in_percent, measured};
use needlebench_study::statistics::{BEST, CriterionResult};

use super::answer::spaced;
use super::block::case_list;

/// Whether the limit of a criterion is the least that is allowed; the other limits are the most.
fn is_lower_limit(criterion: &str) -> bool {
    criterion.starts_with("min_")
}

/// The quantity of a criterion and its subject, in words: `layouts working`, `clearance of the best`.
fn in_words(result: &CriterionResult) -> String {
    let key = &result.criterion;
    let name = key
        .strip_prefix("min_")
        .or_else(|| key.strip_prefix("max_"))
        .unwrap_or(key);
    let name = spaced(name.strip_suffix("_mm").unwrap_or(name));
    match result.of.as_deref() {
        None => name,
        Some(BEST) => format!("{name} of the best"),
        Some(of) => format!("{name} of {of}"),
    }
}

fn text(result: &CriterionResult, value: f64) -> String {
    match result.unit.as_str() {
        "1" => format!("{} %", in_percent(value)),
        unit => measured(value, unit),
    }
}

fn verdict(result: &CriterionResult) -> &'static str {
    match (result.pass, result.is_judged()) {
        (true, _) => "met",
        (false, true) => "FAIL",
        (false, false) => "not evaluated",
    }
}

/// Whether a criterion is met by its estimate, but not by the unfavourable end of the interval.
fn is_met_by_estimate(result: &CriterionResult) -> bool {
    result.pass
        && result.interval.is_some_and(|interval| {
            if is_lower_limit(&result.criterion) {
                interval.low < result.limit
            } else {
                interval.high > result.limit
            }
        })
}

/// A row for each criterion; failed ones first.
pub(super) fn criteria_first(criteria: &[CriterionResult], blocks: &mut Vec<Block>) {
    if criteria.is_empty() {
        return;
    }
    let mut sorted: Vec<&CriterionResult> = criteria.iter().collect();
    sorted.sort_by_key(|each| (each.pass, !each.is_missed()));
    let row = |each: &&CriterionResult| {
        let interval = each.interval.map_or(String::new(), |interval| {
            format!(
                " ({} .. {})",
                text(each, interval.low),
                text(each, interval.high)
            )
        });
        let value = each
            .value
            .map_or("none".to_owned(), |value| text(each, value));
        let at = if is_lower_limit(&each.criterion) {
            "at least"
        } else {
            "at most"
        };
        vec![
            in_words(each),
            verdict(each).to_owned(),
            format!("{value}{interval}"),
            format!("{at} {}", text(each, each.limit)),
            each.requirement.clone().unwrap_or_default(),
        ]
    };
    let has_requirements = criteria.iter().any(|each| each.requirement.is_some());
    let columns = if has_requirements { 5 } else { 4 };
    let rows = sorted
        .iter()
        .map(|each| row(each)[..columns].to_vec())
        .collect();
    let header = ["criterion", "<", "value (95 % CI)", "limit", "<requirement"];
    blocks.push(Block::Heading("criteria".to_owned()));
    blocks.push(Block::Table {
        header: header[..columns]
            .iter()
            .map(|&each| each.to_owned())
            .collect(),
        rows,
    });
    let mut remarks = Vec::new();
    if criteria.iter().any(|each| each.confidence) {
        remarks.push("tested: the unfavourable end of the 95 % CI".to_owned());
    }
    let by_estimate = criteria
        .iter()
        .filter(|each| is_met_by_estimate(each))
        .count();
    if by_estimate > 0 {
        remarks.push(format!(
            "{by_estimate} passed {} a CI that includes the limit (sample too small); `confidence = true` tests the \
             CI bound",
            if by_estimate == 1 {
                "criterion has"
            } else {
                "criteria have"
            }
        ));
    }
    if !remarks.is_empty() {
        blocks.push(Block::Lines(remarks));
    }
}

/// The criteria in full, with their worst cases.
pub(super) fn criteria_in_full(criteria: &[CriterionResult], blocks: &mut Vec<Block>) {
    if criteria.is_empty() {
        return;
    }
    let line = |each: &CriterionResult| {
        let cases = if each.cases.is_empty() {
            String::new()
        } else {
            format!("; worst cases {}", case_list(&each.cases))
        };
        format!(
            "{} ({}): {}{cases}",
            each.criterion,
            verdict(each),
            each.detail
        )
    };
    blocks.push(Block::Heading("criteria in full".to_owned()));
    blocks.push(Block::Lines(criteria.iter().map(line).collect()));
}

/// The trace matrix: requirements, the criteria that verify them, and their outcomes.
pub(crate) fn requirements_blocks(
    requirements: &Requirements,
    criteria: &[CriterionResult],
) -> Vec<Block> {
    if requirements.is_empty() {
        return Vec::new();
    }
    let mut rows: Vec<Vec<String>> = requirements
        .iter()
        .map(|(key, requirement)| {
            let of_it = criteria.iter().filter(|each| each.criterion == *key);
            let count = |is: &dyn Fn(&CriterionResult) -> bool| {
                of_it.clone().filter(|each| is(each)).count() as u64
            };
            let met = count(&|each| each.is_judged() && each.pass);
            let missed = count(&CriterionResult::is_missed);
            let open = count(&|each| !each.is_judged());
            let outcome = TraceOutcome::of(met, missed, open).words().to_owned();
            let counts = [met, missed, open].map(|count| count.to_string());
            let mut row = vec![requirement.clone(), key.clone(), outcome];
            row.extend(counts);
            row
        })
        .collect();
    rows.sort();
    vec![
        Block::Heading("requirements".to_owned()),
        Block::table(
            [
                "requirement",
                "<criterion",
                "<outcome",
                "met",
                "failed",
                "not evaluated",
            ],
            rows,
        ),
    ]
}
