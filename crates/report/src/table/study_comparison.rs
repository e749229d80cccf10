//! Two studies side by side.

use needlebench_show::number::percent_with;
use needlebench_show::{Cell, CellAlignment, Color, plain_table};
use needlebench_study::compare::{
    Change, Paired, StudyComparison, StudyFailure, StudySide, Transition, value_text, what,
};

/// Smallest difference of values that is shown as one, in their unit: 1 um, 0.01 %.
const SAME: f64 = 1e-3;
const SAME_SHARE: f64 = 1e-4;

fn side_text(name: &str, side: &StudySide) -> String {
    let id: String = side.study_id.chars().take(12).collect();
    format!(
        "{name}: {}: {} ({id}), {} cases, {} valid layouts",
        side.source, side.name, side.cases, side.layouts
    )
}

fn percent(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |share| percent_with(share, 2))
}

fn transition_text(what: &str, transition: &Transition) -> Option<String> {
    if transition.lost == 0 && transition.gained == 0 {
        return None;
    }
    let p = match transition.p {
        ..1e-4 => "p < 0.0001".to_owned(),
        p @ ..0.01 => format!("p = {p:.1e}"),
        p => format!("p = {p:.2}"),
    };
    let cases = |name: &str, cases: &[u64], count: u64| {
        let list: Vec<String> = cases.iter().map(ToString::to_string).collect();
        let more = if count > cases.len() as u64 {
            ", ..."
        } else {
            ""
        };
        if list.is_empty() {
            String::new()
        } else {
            format!("; {name} in cases {}{more}", list.join(", "))
        }
    };
    Some(format!(
        "{what}: lost in {} layouts ({}), gained in {} ({}), {p}{}{}",
        transition.lost,
        percent(transition.lost_share),
        transition.gained,
        percent(transition.gained_share),
        cases("lost", &transition.lost_cases, transition.lost),
        cases("gained", &transition.gained_cases, transition.gained)
    ))
}

/// What changed case by case.
fn paired_lines(paired: &Paired) -> Vec<String> {
    let mut lines = vec![format!(
        "paired comparison of the same {} cases: {} valid in both, {} valid only in A, {} valid only in B",
        paired.cases, paired.layouts, paired.became_invalid, paired.became_valid
    )];
    lines.extend(transition_text("feasible layouts", &paired.working));
    for each in &paired.configurations {
        lines.extend(transition_text(&each.label, &each.success));
    }
    // A sentence that is the same for several configurations appears once, with their names.
    let mut said: Vec<(String, Vec<&str>)> = Vec::new();
    for each in &paired.differences {
        let largest = [("worse", &each.losses), ("better", &each.gains)];
        for (way, cases) in largest {
            // A configuration that lost 1 um is no news.
            let Some(first) = cases.first().filter(|first| first.value > SAME) else {
                continue;
            };
            let sentence = format!(
                "{}: case {} {way} by {}; mean {} (B minus A, {} layouts)",
                each.words,
                first.case,
                value_text(first.value, &each.unit),
                value_text(each.mean, &each.unit),
                each.count
            );
            match said.iter_mut().find(|(known, _)| *known == sentence) {
                Some((_, of)) => of.push(&each.of),
                None => said.push((sentence, vec![&each.of])),
            }
        }
    }
    lines.extend(
        said.iter()
            .map(|(sentence, of)| format!("{sentence}: {}", of.join(", "))),
    );
    lines
}

fn is_changed(change: &Change) -> bool {
    let same = if change.unit == "1" { SAME_SHARE } else { SAME };
    change.change.is_none_or(|by| by.abs() >= same) || change.beyond_chance
}

pub(crate) fn intro(comparison: &StudyComparison) -> Vec<String> {
    let mut lines = vec![side_text("A", &comparison.a), side_text("B", &comparison.b)];
    lines.extend(comparison.notes.iter().map(|note| format!("note: {note}")));
    if let Some(reason) = &comparison.unpaired_because {
        lines.push(format!(
            "cases differ ({reason}): rates and quantiles are compared by their 95 % CI"
        ));
    }
    if let Some(paired) = &comparison.paired {
        lines.extend(paired_lines(paired));
    }
    lines
}

/// Quantity, A, B, change, and whether it is significant.
pub(crate) fn row(change: &Change) -> [String; 5] {
    let text =
        |value: Option<f64>| value.map_or("-".to_owned(), |value| value_text(value, &change.unit));
    let loss = change.loss.unwrap_or_default();
    let way = match (is_changed(change), loss > 0.0) {
        (false, _) => "same",
        (true, true) => "worse",
        (true, false) => "better",
    };
    let sure = if is_changed(change) && !change.beyond_chance {
        " (not significant)"
    } else {
        ""
    };
    let difference = change.change.map_or("-".to_owned(), |by| {
        let sign = if by > 0.0 { "+" } else { "" };
        format!("{sign}{}", value_text(by, &change.unit))
    });
    [
        what(change),
        text(change.a),
        text(change.b),
        difference,
        format!("{way}{sure}"),
    ]
}

pub(crate) fn shown(comparison: &StudyComparison, all: bool) -> Vec<&Change> {
    let changes = comparison.changes.iter();
    changes.filter(|change| all || is_changed(change)).collect()
}

pub(crate) fn failure_text(failure: &StudyFailure) -> String {
    let cases: Vec<String> = failure.cases.iter().map(ToString::to_string).collect();
    if cases.is_empty() {
        failure.detail.clone()
    } else {
        format!("{}; see cases {} of B", failure.detail, cases.join(", "))
    }
}

/// Rates and quantiles that one screen lists; further ones are counted.
const MOST_LISTED: usize = 16;

/// How much of a comparison is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Listed {
    /// One screen of what changed.
    Screen,
    /// All that changed.
    Changed,
    /// All, including what did not change.
    All,
}

/// The comparison as text, its verdict first.
pub fn study_comparison_text(comparison: &StudyComparison, listed: Listed) -> String {
    let mut lines = vec![verdict(comparison)];
    let failures = comparison.failures.iter();
    lines.extend(failures.map(|failure| format!("  FAILED {}", failure_text(failure))));
    lines.extend(intro(comparison));
    let all = listed == Listed::All;
    let mut rows = shown(comparison, all);
    let same = comparison.changes.len() - rows.len();
    let mut more = 0;
    if listed == Listed::Screen && rows.len() > MOST_LISTED {
        // Significantly worse first, then significantly better, then what is not significant.
        rows.sort_by_key(|change| {
            (
                !change.beyond_chance,
                change.loss.is_none_or(|loss| loss <= 0.0),
            )
        });
        more = rows.len() - MOST_LISTED;
        rows.truncate(MOST_LISTED);
    }
    if !rows.is_empty() {
        let mut table = plain_table(&["quantity", "A", "B", "B minus A", ""]);
        for change in rows {
            let [what, a, b, difference, outcome] = row(change);
            let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
            let outcome = match outcome.as_str() {
                "worse" => Cell::new(outcome).fg(Color::Red),
                "better" => Cell::new(outcome).fg(Color::Green),
                _ => Cell::new(outcome),
            };
            table.add_row(vec![
                Cell::new(what),
                right(a),
                right(b),
                right(difference),
                outcome,
            ]);
        }
        lines.push(table.to_string());
    }
    if more > 0 {
        lines.push(format!("{more} more changes: --wide"));
    }
    if !all {
        lines.push(format!("{same} rates and quantiles unchanged"));
    }
    lines.push(String::new());
    for threshold in comparison.thresholds.iter().filter(|each| each.pass) {
        lines.push(format!(
            "threshold {} = {}: {}",
            threshold.threshold, threshold.limit, threshold.detail
        ));
    }
    lines.join("\n").trim_end().to_owned()
}

/// The verdict in a line: regressions, and how many rates and quantiles changed.
pub(crate) fn verdict(comparison: &StudyComparison) -> String {
    let beyond = |worse: bool| {
        let changes = shown(comparison, false).into_iter();
        let sure = changes.filter(|change| change.beyond_chance);
        sure.filter(|change| (change.loss.unwrap_or_default() > 0.0) == worse)
            .count()
    };
    let (word, losses) = match comparison.failures.len() {
        0 => ("PASS", "no regression beyond the thresholds".to_owned()),
        1 => ("FAIL", "1 regression".to_owned()),
        count => ("FAIL", format!("{count} regressions")),
    };
    format!(
        "{word}: {losses}; {} rates and quantiles: {} significantly worse, {} significantly better",
        comparison.changes.len(),
        beyond(true),
        beyond(false)
    )
}
