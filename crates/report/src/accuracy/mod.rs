//! The accuracy table as papers print it: Markdown, CSV, LaTeX, and lines for a terminal; with comparable
//! published values.

mod csv;
mod latex;
mod markdown;
mod terminal;

use needlebench_evaluation::accuracy::{
    AccuracyRow, AccuracyTable, QUANTITIES, Spread, TARGET_ED, Test, Tested,
};
use needlebench_scenario::published::{Anchor, Stage, anchors};

pub(crate) use csv::accuracy_csv;
pub(crate) use latex::accuracy_latex;
pub(crate) use markdown::accuracy_markdown;
pub use terminal::accuracy_text;

/// Decimals of lengths and angles, as in the papers.
const DECIMALS: usize = 2;
/// Smaller than what two decimals show.
const SHOWN: f64 = 0.005;

/// A number with two decimals; a smaller one is shown as small, not as zero.
fn number(value: f64) -> String {
    if value == 0.0 || value.abs() >= SHOWN {
        let text = format!("{value:.DECIMALS$}");
        return if text == "-0.00" {
            "0.00".to_owned()
        } else {
            text
        };
    }
    if value > 0.0 { "<0.01" } else { ">-0.01" }.to_owned()
}

/// Mean and standard deviation.
fn mean_and_sd(spread: &Spread, plus_minus: &str) -> String {
    match spread.sd {
        Some(sd) => format!("{} {plus_minus} {}", number(spread.mean), number(sd)),
        None => number(spread.mean),
    }
}

/// Range; none of a single number, which is its own.
fn range(spread: &Spread) -> Option<String> {
    (spread.count > 1).then(|| format!("{} to {}", number(spread.least), number(spread.most)))
}

/// A cell: mean, deviation and range, with the number of needles where some were not measured.
fn cell(row: &AccuracyRow, quantity: usize, plus_minus: &str) -> String {
    let Some(spread) = &row.spreads[quantity] else {
        return "-".to_owned();
    };
    let mut text = mean_and_sd(spread, plus_minus);
    if let Some(range) = range(spread) {
        text = format!("{text} ({range})");
    }
    if spread.count < row.n {
        text = format!("{text}, n = {}", spread.count);
    }
    text
}

fn hits(row: &AccuracyRow) -> String {
    row.hits.map_or_else(
        || "-".to_owned(),
        |hits| format!("{}/{}", hits.within, hits.of),
    )
}

fn p_value(tested: &Result<Tested, String>) -> String {
    match tested {
        Ok(tested) if tested.p < 0.001 => "<0.001".to_owned(),
        Ok(tested) => format!("{:.3}", tested.p),
        Err(_) => "-".to_owned(),
    }
}

/// Quantities with measured values.
fn measured(table: &AccuracyTable) -> impl Iterator<Item = usize> + '_ {
    (0..QUANTITIES.len()).filter(|quantity| table.all.spreads[*quantity].is_some())
}

/// Whether the groups are compared in anything.
fn is_tested(table: &AccuracyTable) -> bool {
    table.tests.iter().any(Result::is_ok)
}

/// Whether the table includes insertion effects, so that published errors before insertion do not compare.
fn has_insertion_effects(table: &AccuracyTable) -> bool {
    !table.insertion_effects.is_empty()
}

/// The caption, in sentences.
fn caption(table: &AccuracyTable) -> Vec<String> {
    let mut lines = vec![format!(
        "Needle placement of {} by {}: mean \u{b1} standard deviation (range).",
        table.name,
        table.by.join(" and ")
    )];
    if has_insertion_effects(table) {
        lines.push(format!(
            "Errors include those before insertion (robot and registration: of the needle's line through the \
             positioned guide) and sampled insertion effects: {}. They are not comparable with published errors before \
             insertion.",
            table.insertion_effects.join(", ")
        ));
    } else {
        lines.push(
            "All errors are before insertion (robot and registration): of the needle's line through the \
             positioned guide."
                .to_owned(),
        );
    }
    lines.extend(table.notes.iter().cloned());
    lines
}

/// Definitions of the columns, in sentences.
fn footnotes(table: &AccuracyTable) -> Vec<String> {
    let mut lines = vec![
        "ND: normal distance of the planned point from the needle's line; ED: Euclidean distance, at the entry \
         to the intersection of the line with the skin, at the target to the tip. Depth: positive if deeper. \
         Axial, sagittal: angle in these planes of the patient. Standard deviation with n - 1; range: minimum to \
         maximum."
            .to_owned(),
    ];
    let columns = table.columns.iter().flatten();
    let is_static = columns.clone().any(|name| name.contains("_static"));
    let is_predicted = columns.clone().any(|name| name.contains("_predicted"));
    let is_simulated = columns.clone().any(|name| name.starts_with("tip_error"))
        && table.columns[TARGET_ED]
            .iter()
            .any(|name| !name.contains("_static") && !name.contains("_predicted"));
    let mut kinds = Vec::new();
    if is_simulated {
        kinds.push("simulated, after settling");
    }
    if is_predicted {
        kinds.push(
            "from static equilibrium at the end of the planned motion (columns with _predicted)",
        );
    }
    if is_static {
        kinds.push(
            "from static equilibrium in final postures only, without a motion (columns with _static)",
        );
    }
    if !kinds.is_empty() {
        lines.push(format!("Errors are {}.", kinds.join(", and ")));
    }
    let absent: Vec<&str> = (0..QUANTITIES.len())
        .filter(|quantity| table.all.spreads[*quantity].is_none())
        .map(|quantity| QUANTITIES[quantity].heading)
        .collect();
    if !absent.is_empty() {
        lines.push(format!("Not measured here: {}.", absent.join(", ")));
    }
    let mut rows = table.groups.iter().chain([&table.all]);
    let has_gap = |row: &AccuracyRow| measured(table).any(|at| row.spreads[at].is_none());
    if rows.any(has_gap) {
        lines.push("A dash: not measured.".to_owned());
    }
    match &table.hit_radius {
        Some(radius) => lines.push(format!(
            "Hits: tip within {} mm of the target ({}), of the needles with a measured ED.",
            radius.radius_mm, radius.source
        )),
        None => lines.push("Hits: no radius given (--hit-radius MM).".to_owned()),
    }
    lines.push(tests_in_words(table));
    lines.push(
        "Slice thickness: not applicable, no image is taken. Corrections: not applicable, no needle is \
         inserted."
            .to_owned(),
    );
    lines
}

fn tests_in_words(table: &AccuracyTable) -> String {
    if table.groups.len() < 2 {
        return "p: not tested: only one group.".to_owned();
    }
    let mut tests: Vec<Test> = table.tests.iter().flatten().map(|each| each.test).collect();
    tests.dedup();
    if let Some(test) = tests.first() {
        let what = match test {
            Test::Friedman => "on the draws that all groups share, one mean per draw and group",
            Test::KruskalWallis => "one mean per draw and group",
        };
        return format!("p: {} test between the groups, {what}.", test.name());
    }
    let error = &table.tests[TARGET_ED];
    let why = error.as_ref().err().map_or("", String::as_str);
    format!("p: not tested: {why}.")
}

/// Published values: those before insertion, and the others.
fn published() -> (Vec<&'static Anchor>, Vec<&'static Anchor>) {
    anchors()
        .iter()
        .partition(|each| each.stage == Stage::BeforeInsertion)
}

const BEFORE: &str = "Published errors before insertion";
const APART: &str = "Published errors not before insertion, not comparable with this table";

/// The note above the published errors before insertion.
fn before_in_words(table: &AccuracyTable) -> &'static str {
    if has_insertion_effects(table) {
        "Not comparable with this table, which includes insertion effects."
    } else {
        "Errors of robot and registration, as in this table. Compare equal quantities only; each row names what \
         was measured."
    }
}

/// A published figure with its unit.
fn figure(anchor: &Anchor, plus_minus: &str) -> String {
    let value = format!("{}", anchor.value);
    let sd = anchor
        .sd
        .map_or(String::new(), |sd| format!(" {plus_minus} {sd}"));
    let statistic = match anchor.statistic.as_str() {
        "mean" => String::new(),
        other => format!(" ({other})"),
    };
    format!("{value}{sd} {}{statistic}", anchor.unit)
}

/// Our own values that compare with published ones.
fn own_figures(table: &AccuracyTable, plus_minus: &str) -> Vec<(String, String)> {
    ["target_nd", "target_ed"]
        .iter()
        .filter_map(|key| {
            let at = QUANTITIES.iter().position(|each| each.key == *key)?;
            let spread = table.all.spreads[at].as_ref()?;
            let text = format!("{} mm", mean_and_sd(spread, plus_minus));
            Some((QUANTITIES[at].heading.to_owned(), text))
        })
        .collect()
}

#[cfg(test)]
mod tests;
