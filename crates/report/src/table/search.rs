//! The answer of a search, as a table and sentences.

use std::fmt::Write;

use needlebench_bench::search::PreparedSearch;
use needlebench_show::layout::wrapped;
use needlebench_show::number::percent;
use needlebench_show::plain_table;
use needlebench_study::Role;
use needlebench_study::search::{CandidateLog, Estimate, Objective, SearchLog};

/// Most rows of candidates tied with the winner.
const MOST_ROWS: usize = 8;

/// The answer, or the progress.
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
                "{name}: no recommendation: the best of {} candidates is feasible in none of {} layouts",
                log.candidates.len(),
                answer.rate.cases
            ))
        );
    }
    let rate = match objective {
        Objective::Rate => String::new(),
        _ => format!(
            ", {} {}",
            Objective::Rate.words(),
            with_interval(Objective::Rate, &answer.rate)
        ),
    };
    let _ = writeln!(
        text,
        "{}",
        wrapped(&format!(
            "{name}: best of {} candidates: {} {}{rate}, on {} held-out layouts (postures only)",
            log.candidates.len(),
            objective.words(),
            with_interval(objective, &answer.figures[0]),
            answer.figures[0].cases,
        ))
    );
    let mut listed: Vec<(usize, &str)> = if answer.front.is_empty() {
        let others = answer.equals.iter().filter(|&&id| id != answer.winner);
        std::iter::once((answer.winner, "best"))
            .chain(others.map(|&id| (id, "tied")))
            .collect()
    } else {
        let members = answer.front.iter();
        members
            .map(|member| {
                let what = match (member.is_certain, member.by_estimate) {
                    (true, _) => "Pareto-optimal",
                    (false, true) => "probably Pareto-optimal",
                    (false, false) => "possibly Pareto-optimal",
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
            unit => format!("{}\n({unit})", factor.name),
        })
        .collect();
    let figures = log.objectives.iter().map(|objective| match objective {
        Objective::Rate => "success\nrate".to_owned(),
        Objective::LesionProbability => "lesion\nprobability".to_owned(),
        Objective::Margin { .. } => format!("{}\n({})", objective.words(), objective.unit()),
        Objective::TipError { .. } => format!("tip error\n({})", objective.unit()),
    });
    let figures: Vec<String> = figures.collect();
    let has_rate = log.objectives.contains(&Objective::Rate);
    let mut header = vec![""];
    header.extend(headings.iter().map(String::as_str));
    header.extend(figures.iter().map(String::as_str));
    if !has_rate {
        header.push("success\nrate");
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
        "Table values are from the {} selection layouts and are optimistically biased.",
        winner.cases
    )];
    if answer.front.is_empty() {
        let equals = answer.equals.len() - 1;
        let undecided = answer.undecided.len();
        all.push(format!(
            "{} significantly different from the best (family-wise error rate 5 %){}.",
            match equals {
                0 => "All other finalists are".to_owned(),
                1 => "1 other finalist is not".to_owned(),
                _ => format!("{equals} other finalists are not"),
            },
            match undecided {
                0 => String::new(),
                _ => format!("; {undecided} eliminated earlier may be equivalent"),
            }
        ));
    } else {
        let certain = answer
            .front
            .iter()
            .filter(|member| member.is_certain)
            .count();
        all.push(format!(
            "{certain} of {} are Pareto-optimal (family-wise error rate 5 % over all pairs and both objectives).",
            answer.front.len()
        ));
    }
    let grid = search.grid_cases().map_or(String::new(), |grid| {
        format!(
            " ({} of an exhaustive {grid})",
            percent(log.cases as f64 / grid as f64)
        )
    });
    all.push(format!(
        "{} cases{grid} in {} generations; {} eliminated by reachability alone ({} saved).",
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
        .filter(|factor| factor.role == Role::Control)
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

/// The value of a control factor as people read it.
pub(crate) fn shown(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::String(text) => text.clone(),
        other => other.to_string().trim_end_matches(".0").to_owned(),
    }
}

/// The value of an objective, without its unit.
pub(crate) fn figure(objective: Objective, value: Option<f64>) -> String {
    match (objective, value) {
        (_, None) => "none".to_owned(),
        (Objective::Rate, Some(share)) => percent(share),
        (Objective::Margin { .. }, Some(mm)) => format!("{mm:.1}"),
        (Objective::TipError { .. }, Some(mm)) => format!("{mm:.3}"),
        (Objective::LesionProbability, Some(share)) => format!("{share:.3}"),
    }
}

fn unit(objective: Objective) -> &'static str {
    if objective.unit() == "mm" { " mm" } else { "" }
}

fn interval(objective: Objective, estimate: &Estimate) -> Option<String> {
    let interval = estimate.interval;
    match (interval.low, interval.high) {
        (Some(low), Some(high)) => Some(format!(
            "95 % CI {} to {}",
            figure(objective, Some(low)),
            figure(objective, Some(high))
        )),
        (None, Some(high)) => Some(format!(
            "97.5 % upper confidence bound {}",
            figure(objective, Some(high))
        )),
        (Some(low), None) => Some(format!(
            "97.5 % lower confidence bound {}",
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
