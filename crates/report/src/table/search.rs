//! The answer of a search, as a table and sentences.

use std::fmt::Write;

use needlebench_bench::search::PreparedSearch;
use needlebench_study::Role;
use needlebench_study::search::{CandidateLog, Estimate, Objective, SearchLog};

use super::plain_table;
use crate::layout::wrapped;
use crate::number::percent;

/// Rows of those who cannot be told from the winner, at most.
const MOST_ROWS: usize = 8;

/// The answer, or how far it is.
pub(crate) fn search_text(search: &PreparedSearch, log: &SearchLog) -> String {
    let name = &search.study.file.name;
    let Some(answer) = &log.answer else {
        return format!("{name}: no answer yet after {} cases\n", log.cases);
    };
    let mut text = String::new();
    let objective = log.objectives[0];
    if !answer.is_recommended() {
        let _ = writeln!(
            text,
            "{}",
            wrapped(&format!(
                "{name}: none is recommended: the best of {} candidates works in none of {} layouts",
                log.candidates.len(),
                answer.rate.cases
            ))
        );
    }
    let _ = writeln!(
        text,
        "{}",
        wrapped(&format!(
            "{name}: {} {}, of the best of {} candidates, on {} layouts that none was compared by; {} of \
             layouts work{} (postures only)",
            objective.words(),
            with_interval(objective, &answer.figures[0]),
            log.candidates.len(),
            answer.figures[0].cases,
            figure(Objective::Rate, answer.rate.value),
            interval(Objective::Rate, &answer.rate)
                .map_or(String::new(), |interval| format!(" ({interval})")),
        ))
    );
    let mut listed: Vec<(usize, &str)> = if answer.front.is_empty() {
        let others = answer.equals.iter().filter(|&&id| id != answer.winner);
        std::iter::once((answer.winner, "best"))
            .chain(others.map(|&id| (id, "as good")))
            .collect()
    } else {
        let members = answer.front.iter();
        members
            .map(|member| {
                let what = match (member.is_certain, member.by_estimate) {
                    (true, _) => "on the front",
                    (false, true) => "on it, maybe",
                    (false, false) => "maybe",
                };
                (member.id, what)
            })
            .collect()
    };
    let more = listed.len().saturating_sub(MOST_ROWS);
    listed.truncate(MOST_ROWS);
    text.push('\n');
    text.push_str(&table(search, log, &listed));
    if more > 0 {
        let _ = writeln!(text, "and {more} more in search.json");
    }
    text.push('\n');
    for sentence in sentences(search, log) {
        let _ = writeln!(text, "{}", wrapped(&sentence));
    }
    text
}

fn table(search: &PreparedSearch, log: &SearchLog, listed: &[(usize, &str)]) -> String {
    let headings: Vec<String> = search
        .choices()
        .map(|factor| match factor.unit.as_str() {
            "" => factor.name.clone(),
            unit => format!("{}\n{unit}", factor.name),
        })
        .collect();
    let figures = log
        .objectives
        .iter()
        .map(|objective| match objective.unit() {
            "1" => "works".to_owned(),
            unit => match objective {
                Objective::Margin { .. } => format!("{}\n{unit}", objective.words()),
                _ => format!("tip error\n{unit}"),
            },
        });
    let figures: Vec<String> = figures.collect();
    let has_rate = log.objectives.contains(&Objective::Rate);
    let mut header = vec![""];
    header.extend(headings.iter().map(String::as_str));
    header.extend(figures.iter().map(String::as_str));
    if !has_rate {
        header.push("works");
    }
    let mut table = plain_table(&header);
    for (id, what) in listed {
        let candidate = &log.candidates[*id];
        let mut row = vec![(*what).to_owned()];
        row.extend(candidate.choice.iter().map(|(_, value)| shown(value)));
        row.extend(
            log.objectives
                .iter()
                .zip(&candidate.figures)
                .map(|(objective, estimate)| figure(*objective, estimate.value)),
        );
        if !has_rate {
            row.push(figure(Objective::Rate, candidate.rate.value));
        }
        table.add_row(row);
    }
    format!("{table}\n")
}

fn sentences(search: &PreparedSearch, log: &SearchLog) -> Vec<String> {
    let answer = log.answer.as_ref().expect("it is finished");
    let winner: &CandidateLog = &log.candidates[answer.winner];
    let mut all = vec![format!(
        "Figures of the table are by the {} layouts that candidates were compared by: they flatter the best.",
        winner.cases
    )];
    if answer.front.is_empty() {
        let equals = answer.equals.len() - 1;
        let undecided = answer.undecided.len();
        all.push(format!(
            "{} told from the best, all pairs together but for 5 %{}.",
            match equals {
                0 => "All others with all layouts are".to_owned(),
                1 => "1 other with all layouts cannot be".to_owned(),
                _ => format!("{equals} others with all layouts cannot be"),
            },
            match undecided {
                0 => String::new(),
                1 => "; 1 was dropped with fewer and may be as good".to_owned(),
                _ => format!("; {undecided} were dropped with fewer and may be as good"),
            }
        ));
    } else {
        let certain = answer
            .front
            .iter()
            .filter(|member| member.is_certain)
            .count();
        all.push(format!(
            "{certain} of {} are on the front for certain, all pairs and both objectives together but for 5 %.",
            answer.front.len()
        ));
    }
    let grid = search.grid_cases().map_or(String::new(), |grid| {
        format!(
            ", {} of the {grid} of all choices with all layouts",
            percent(log.cases as f64 / grid as f64)
        )
    });
    all.push(format!(
        "{} cases{grid}, in {} generations; reach alone ruled out {}, which spared {}.",
        log.cases,
        log.generations.len(),
        counted(log.ruled_out as u64, "candidate"),
        counted(log.cases_spared, "case")
    ));
    let keys: Vec<String> = search
        .study
        .file
        .factors
        .iter()
        .filter(|factor| factor.role == Role::Choice)
        .zip(&winner.choice)
        .filter_map(|(factor, (_, value))| {
            let key = factor.key.as_ref()?;
            let added = if factor.relative { "+=" } else { "=" };
            Some(format!("{key} {added} {value}"))
        })
        .collect();
    if !keys.is_empty() {
        all.push(format!("Best: {}", keys.join(", ")));
    }
    all
}

fn counted(count: u64, what: &str) -> String {
    match count {
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}

/// A choice as people read it.
pub(crate) fn shown(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::String(text) => text.clone(),
        other => other.to_string().trim_end_matches(".0").to_owned(),
    }
}

/// A figure with its unit.
pub(crate) fn figure(objective: Objective, value: Option<f64>) -> String {
    match (objective, value) {
        (_, None) => "none".to_owned(),
        (Objective::Rate, Some(share)) => percent(share),
        (Objective::Margin { .. }, Some(mm)) => format!("{mm:.1}"),
        (Objective::TipError { .. }, Some(mm)) => format!("{mm:.3}"),
    }
}

fn unit(objective: Objective) -> &'static str {
    if objective.unit() == "mm" { " mm" } else { "" }
}

fn interval(objective: Objective, estimate: &Estimate) -> Option<String> {
    let interval = estimate.interval;
    match (interval.low, interval.high) {
        (Some(low), Some(high)) => Some(format!(
            "95 %: {} to {}",
            figure(objective, Some(low)),
            figure(objective, Some(high))
        )),
        (None, Some(high)) => Some(format!(
            "97.5 % sure: at most {}",
            figure(objective, Some(high))
        )),
        (Some(low), None) => Some(format!(
            "97.5 % sure: at least {}",
            figure(objective, Some(low))
        )),
        (None, None) => None,
    }
}

fn with_interval(objective: Objective, estimate: &Estimate) -> String {
    let value = figure(objective, estimate.value);
    let unit = unit(objective);
    match interval(objective, estimate) {
        Some(interval) => format!("{value}{unit} ({interval})"),
        None => format!("{value}{unit}"),
    }
}
