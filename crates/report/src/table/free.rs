//! A judged motion that leads to no goal.

use needlebench_bench::judge::free::FreeReport;
use needlebench_cell::pair_in_words;
use needlebench_show::number::value_and_limit;
use needlebench_show::{Block, blocks_text};

use super::class_words::class_in_words;
use super::judged::peaks;
use super::verdict::capitals;

/// The motion as text: the verdict, what failed, the clearances, the joints' limits.
pub fn free_text(report: &FreeReport) -> String {
    let mut lines = vec![summary(report)];
    for failed in report.criteria.iter().filter(|each| !each.pass) {
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let (value, limit) =
            value_and_limit(number(failed.value), number(failed.limit), failed.unit);
        let (criterion, detail) = (&failed.criterion, &failed.detail);
        lines.push(format!(
            "  FAILED {criterion}: {value}, limit {limit} ({detail})"
        ));
    }
    for open in &report.not_judged {
        lines.push(format!(
            "  NOT EVALUATED {}: {}",
            open.criterion, open.reason
        ));
    }
    lines.push(format!(
        "motion {}: {}, {} points, {:.3} s; interpolation: {}",
        report.source.file,
        report.source.format,
        report.source.points,
        report.duration_s,
        report.between
    ));
    lines.push(peaks(&report.peaks));
    let mut blocks = vec![Block::Lines(lines)];
    let rows = report.clearance.classes.iter().map(|(class, found)| {
        let millimetres = |length_m: f64| format!("{:.2}", length_m * 1e3);
        vec![
            class_in_words(class).to_owned(),
            millimetres(found.minimum_m),
            found
                .certified_lower_bound_m
                .map_or("-".to_owned(), millimetres),
            found
                .time_s
                .map_or("-".to_owned(), |time_s| format!("{time_s:.3}")),
            pair_in_words(&found.pair),
        ]
    });
    let header = [
        "minimum\nclearance",
        "motion\n(mm)",
        "certified\n(mm)",
        "at (s)",
        "<between",
    ];
    blocks.push(Block::table(header, rows.collect()));
    let notes = report.notes.iter().map(|note| format!("note: {note}"));
    blocks.push(Block::Lines(notes.collect()));
    blocks_text(&blocks)
}

fn summary(report: &FreeReport) -> String {
    let word = capitals(report.verdict);
    let met = report.criteria.iter().filter(|each| each.pass).count();
    let all = report.criteria.len() + report.not_judged.len();
    format!(
        "{word} {}: {met} of {all} criteria met, clearances and joints alone",
        report.scenario
    )
}
