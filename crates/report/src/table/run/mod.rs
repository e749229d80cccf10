//! What a run prints: one screen, or all tables.

mod screen;

use std::collections::BTreeSet;
use std::fmt::Write;

use needlebench_cell::{Amount, Rule, part_in_words, rule_in_words};
use needlebench_engine::Engine;
use needlebench_evaluation::excitation;
use needlebench_evaluation::iso9283::SUBJECT;
use needlebench_evaluation::metric::Heading;
use needlebench_evaluation::report::{
    ConfigurationReport, CriterionResult, GoalReport, RejectionReport, Report, RouteReport, Status,
};
use needlebench_show::number::value_and_limit;
use needlebench_show::{Cell, CellAlignment, Color, Table, blocks_text, layout, plain_table};
use needlebench_uncertainty::budget::ErrorBudget;

use super::budget::{ALLOWED_M, CLINICAL_LATERAL_M, CLINICAL_M, budget_text, budgets, mm};
use super::engine_headings::{EngineHeading, engine_headings};
use super::events::events_text;
use super::judged::judged_blocks;
use super::needle::needle_blocks;
use super::probability::probability_blocks;
use super::ranking::comparison_text;
use super::shown::{Shown, shown_metrics};
use super::true_target::true_target_in_words;
use super::verdict::{capitals, counts, missed_as_expected, status};

pub use screen::report_screen;

/// All tables of a report; `engines` are those that there are, with their titles.
pub fn report_text(report: &Report, engines: &[&'static dyn Engine]) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut text, report, engines);
    text
}

fn write_report(
    out: &mut String,
    report: &Report,
    engines: &[&'static dyn Engine],
) -> std::fmt::Result {
    let headings = engine_headings(report, engines);
    if let Some(judged) = &report.judged {
        out.push_str(&blocks_text(&judged_blocks(judged)));
    }
    for goal in &report.goals {
        writeln!(out, "{}", goal_heading(goal))?;
        let (differing, constant) = split(goal, columns(&headings, |heading| heading.table));
        writeln!(
            out,
            "{}",
            goal_table(report, goal, &differing, Mostly::Shown)
        )?;
        writeln!(out, "* worst of the feasible configurations, < recommended")?;
        write_constant(out, goal, &constant)?;
        write_expected(out, report, goal)?;
        if let Some(needle) = &goal.needle {
            writeln!(out, "{}", needle.summary)?;
            out.push_str(&blocks_text(&needle_blocks(needle)));
        }
        out.push_str(&blocks_text(&probability_blocks(goal)));
        let mut checks = columns(&headings, |heading| heading.engines);
        checks.retain(|column| column.metric.says_something(goal));
        if goal
            .configurations
            .iter()
            .any(|each| !each.engines.is_empty())
        {
            writeln!(out, "{}", simulated_arm(report))?;
            writeln!(out, "{}", goal_table(report, goal, &checks, Mostly::Left))?;
        }
        if let Some(comparison) = comparison_text(goal) {
            writeln!(out, "{comparison}")?;
        }
        if goal.configurations.iter().any(|each| each.room.is_some()) {
            writeln!(out, "free space and line of sight, final posture")?;
            writeln!(out, "{}", room_table(goal))?;
        }
        if let Some(events) = events_text(goal) {
            write!(out, "{events}")?;
        }
        // Of a class of arm the sources are on the page and in the chart.
        let is_own = report
            .expected
            .as_ref()
            .is_some_and(|expected| expected.arm.is_none());
        if let Some(budget) = budget_text(goal).filter(|_| is_own) {
            write!(out, "{budget}")?;
        }
        if let Some(table) = super::referee::referee_table(goal) {
            writeln!(
                out,
                "engines compared with the reference integrator: distance between the needle tips"
            )?;
            writeln!(out, "{table}")?;
        }
        out.push_str(&super::saturation::saturation_text(goal));
        write_remarks(out, report, goal)?;
    }
    if let Some(iso9283) = &report.iso9283 {
        out.push_str(&super::iso9283::report_text(iso9283));
        write_missed(out, report, SUBJECT)?;
    }
    if let Some(excitation) = &report.excitation {
        out.push_str(&super::excitation::report_text(excitation));
    }
    write_missed(out, report, excitation::SUBJECT)?;
    for failure in &report.engine_failures {
        let during = failure
            .during
            .as_ref()
            .map_or(String::new(), |during| format!(" in {during}"));
        writeln!(
            out,
            "engine {} failed{during}: {}",
            failure.engine, failure.message
        )?;
    }
    for each in &report.enclosure {
        writeln!(
            out,
            "enclosing primitives of {}: mean distance from the mesh {:.2} mm, maximum {:.2} mm; \
             mesh protrudes by up to {:.2} mm",
            each.link,
            each.mean_overhang_m * 1e3,
            each.worst_overhang_m * 1e3,
            each.worst_protrusion_m * 1e3
        )?;
    }
    for note in &report.notes {
        writeln!(out, "note: {note}")?;
    }
    writeln!(out, "{}: {}", capitals(report.verdict), counts(report))
}

fn goal_heading(goal: &GoalReport) -> String {
    let lesion = goal
        .lesion
        .as_ref()
        .map_or(String::new(), |name| format!(", lesion {name}"));
    let standoff = goal.standoff_m.map_or(String::new(), |standoff_m| {
        format!("; guide stand-off {:.1} mm", standoff_m * 1e3)
    });
    format!(
        "\ngoal {}{lesion}: needle extends {:.1} mm beyond the guide{standoff}",
        goal.name,
        goal.insertion_length_m * 1e3
    )
}

/// One column of the table: a metric, of one engine where each has its own.
struct Column {
    heading: String,
    metric: Shown,
}

/// The columns of a goal's table, in their order.
fn columns(
    engines: &[EngineHeading],
    heading: impl Fn(&Heading) -> Option<(u8, &'static str)>,
) -> Vec<Column> {
    shown_metrics(engines, heading)
        .map(|(heading, metric)| Column { heading, metric })
        .collect()
}

/// Columns that differ between configurations, and those that say the same of all or of none.
///
/// The arm's clearance from itself says the same of all where the same two links are nearest in all: that
/// is how the arm is built.
fn split(goal: &GoalReport, columns: Vec<Column>) -> (Vec<Column>, Vec<Column>) {
    let own_pair_is_one = own_pair(goal).is_some();
    columns.into_iter().partition(|column| {
        let values = goal
            .configurations
            .iter()
            .filter_map(|each| column.metric.value(each));
        let mut texts: Vec<String> = values.map(|(_, text)| text).collect();
        texts.sort();
        texts.dedup();
        let is_own = column.metric.metric().family == "self_clearance";
        texts.len() > 1 && !(is_own && own_pair_is_one)
    })
}

/// The two links of the arm that are nearest to each other in every configuration, if they are the same.
fn own_pair(goal: &GoalReport) -> Option<[&str; 2]> {
    let link = |name: &'_ str| -> usize { name.find('.').unwrap_or(name.len()) };
    let mut pairs = goal.configurations.iter().filter_map(|each| {
        let [a, b] = &each.clearance.classes.get("self")?.pair;
        let (a, b) = (&a[..link(a)], &b[..link(b)]);
        Some(if a <= b { [a, b] } else { [b, a] })
    });
    let first = pairs.next()?;
    pairs.all(|pair| pair == first).then_some(first)
}

/// Self-clearance inherent in the arm, in words; `pair` is that of [`own_pair`].
fn own_pair_in_words(goal: &GoalReport, [a, b]: [&str; 2]) -> Option<String> {
    let all = goal.configurations.iter();
    let sizes = all.filter_map(|each| Some(each.clearance.classes.get("self")?.minimum_m * 1e3));
    let (least, most) = sizes.fold(None, |range: Option<(f64, f64)>, mm| {
        let (least, most) = range.unwrap_or((mm, mm));
        Some((least.min(mm), most.max(mm)))
    })?;
    let [a, b] = [a, b].map(part_in_words);
    Some(format!(
        "self-clearance {least:.1} to {most:.1} mm ({a} to {b}), inherent in the arm"
    ))
}

/// What is the same in all configurations, in one line.
fn write_constant(out: &mut String, goal: &GoalReport, constant: &[Column]) -> std::fmt::Result {
    let mut parts = Vec::new();
    for column in constant {
        let mut values = goal
            .configurations
            .iter()
            .filter_map(|each| column.metric.value(each));
        let Some((_, text)) = values.next() else {
            continue;
        };
        let name = column.heading.replace('\n', " ");
        match own_pair(goal) {
            Some(pair) if column.metric.metric().family == "self_clearance" => {
                parts.extend(own_pair_in_words(goal, pair));
            }
            _ => parts.push(format!("{} {text}", name.trim())),
        }
    }
    if parts.is_empty() {
        return Ok(());
    }
    writeln!(out, "identical for all: {}", parts.join("; "))
}

/// Arm and patient population of the RMS tip errors, and published values to compare with.
fn write_expected(out: &mut String, report: &Report, goal: &GoalReport) -> std::fmt::Result {
    let Some(expected) = &report.expected else {
        return Ok(());
    };
    let arm = expected.arm.map_or(String::new(), |arm| format!("{arm}: "));
    let breath = match expected.breath {
        "free" => "free breathing",
        _ => "breath-hold",
    };
    writeln!(
        out,
        "tip error: RMS over the arm and patient population ({arm}{}); {breath}",
        expected.arm_in_words
    )?;
    let budgets = budgets(goal);
    let range = |value: &dyn Fn(&ErrorBudget) -> Option<f64>| {
        let values: Vec<f64> = budgets
            .iter()
            .filter(|(each, _)| each.status == Status::Ok)
            .filter_map(|(_, budget)| value(budget))
            .collect();
        let least = values.iter().copied().reduce(f64::min)?;
        let most = values.iter().copied().reduce(f64::max)?;
        Some(format!("{} to {} mm", mm(least), mm(most)))
    };
    let before = range(&|budget| Some(budget.before_insertion?.lateral_rms_m));
    let after = range(&|budget| Some(budget.total.at_target.analytic.rms_m));
    if let (Some(before), Some(after)) = (before, after) {
        let mut criteria = report.criteria.iter().filter(|each| each.goal == goal.name);
        let limit_m = criteria
            .find(|each| each.criterion == "max_tip_rms_mm")
            .and_then(|each| each.limit);
        let judged = limit_m.map_or_else(
            || "not checked; set `max_tip_rms_mm` under [criteria] to check it".to_owned(),
            |limit_m| format!("`max_tip_rms_mm` here {} mm", mm(limit_m)),
        );
        writeln!(
            out,
            "published needle robots: lateral error before insertion {} to {} mm (here {before}), \
             tip error at the target {} to {} mm (here {after}); accepted by radiologists {} mm, \
             {judged}",
            mm(CLINICAL_LATERAL_M[0]),
            mm(CLINICAL_LATERAL_M[1]),
            mm(CLINICAL_M[0]),
            mm(CLINICAL_M[1]),
            mm(ALLOWED_M)
        )?;
    }
    Ok(())
}

/// Heading of the errors in the engines: of what arm they are.
fn simulated_arm(report: &Report) -> &'static str {
    let of_class = report.expected.as_ref();
    let of_class = of_class.is_some_and(|expected| expected.arm.is_some());
    if report.truth.is_some() && of_class {
        // Without [imperfections] of its own.
        "simulated errors of the arm without imperfections, whose controller assumes another gravity"
    } else if report.truth.is_some() {
        "simulated errors of the arm and patient sampled by the seed"
    } else {
        "simulation residuals of the arm without imperfections: control and integration errors only, \
         not the accuracy of a real arm"
    }
}

/// Whether the main source of the RMS tip error has a column.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mostly {
    Shown,
    Left,
}

/// The eight rows of a goal; the worst number of each column is marked with `*` and in colour.
fn goal_table(report: &Report, goal: &GoalReport, columns: &[Column], mostly: Mostly) -> Table {
    let dominant = |each: &ConfigurationReport| each.budget.as_ref()?.dominant_in_words();
    let mostly = mostly == Mostly::Shown
        && goal
            .configurations
            .iter()
            .any(|each| dominant(each).is_some());
    let mut header = vec!["configuration", "status"];
    header.extend(columns.iter().map(|column| column.heading.as_str()));
    if mostly {
        header.push("main\nsource");
    }
    let mut table = plain_table(&header);
    let worst: Vec<Option<f64>> = columns
        .iter()
        .map(|column| worst_of(goal, column))
        .collect();
    let recommended = goal.recommended.as_ref().map(|found| found.label.as_str());
    for configuration in &goal.configurations {
        let chosen = recommended == Some(configuration.label);
        let name = if chosen {
            format!("{} <", configuration.label)
        } else {
            configuration.label.to_owned()
        };
        let status = match (configuration.status, configuration.rejections.first()) {
            (Status::Rejected, Some(first)) if first.rule == Rule::NeedleRoute.name() => {
                Cell::new(rule_in_words(first.rule)).fg(Color::Red)
            }
            (Status::Rejected, Some(first)) => {
                Cell::new(rule_in_words(first.rule)).fg(Color::Yellow)
            }
            _ => match status(report, &goal.name, configuration) {
                failed @ "failed" => Cell::new(failed).fg(Color::Red),
                incomplete @ "incomplete" => Cell::new(incomplete).fg(Color::Yellow),
                other => Cell::new(other),
            },
        };
        let mut row = vec![
            if chosen {
                Cell::new(name).fg(Color::Green)
            } else {
                Cell::new(name)
            },
            status,
        ];
        for (column, worst) in columns.iter().zip(&worst) {
            let cell = match column.metric.value(configuration) {
                None => Cell::new("-"),
                Some((value, text))
                    if Some(value) == *worst && configuration.status != Status::Rejected =>
                {
                    Cell::new(format!("{text}*")).fg(Color::Red)
                }
                Some((_, text)) => Cell::new(text),
            };
            row.push(cell.set_alignment(CellAlignment::Right));
        }
        if mostly {
            row.push(Cell::new(dominant(configuration).unwrap_or("-")));
        }
        table.add_row(row);
    }
    table
}

/// Free space, lines of sight and hand cone of each configuration; `-` without a posture.
fn room_table(goal: &GoalReport) -> Table {
    let rooms = || {
        goal.configurations
            .iter()
            .filter_map(|each| each.room.as_ref())
    };
    let regions: BTreeSet<&'static str> = rooms()
        .flat_map(|room| room.regions.keys().copied())
        .collect();
    // The same people for all: those of the first that has any.
    let people: Vec<String> = rooms().next().map_or(Vec::new(), |room| {
        let sight = room.sight.iter();
        let named = sight.map(|each| layout::in_lines(&each.person_in_words, 14));
        named.collect()
    });
    let mut header = vec!["configuration".to_owned(), "free\n(%)".to_owned()];
    header.extend(regions.iter().map(|region| format!("\n{region}")));
    header.push("line of\nsight (%)".to_owned());
    header.extend(people);
    header.extend(
        [
            "hand cone\n(deg)",
            "blocked\nby",
            "elbow",
            "elbow above\nentry (mm)",
        ]
        .map(str::to_owned),
    );
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = plain_table(&header);
    for configuration in &goal.configurations {
        let mut row = vec![configuration.label.to_owned()];
        if let Some(room) = &configuration.room {
            row.push(percent(room.free_fraction));
            for region in &regions {
                row.push(
                    room.regions
                        .get(region)
                        .map_or("-".to_owned(), |free| percent(*free)),
                );
            }
            row.push(percent(room.sight_fraction));
            row.extend(room.sight.iter().map(|seen| percent(seen.fraction)));
            row.push(format!("{:.1}", room.hand_cone_half_angle_rad.to_degrees()));
            row.push(
                room.hand_cone_blocker
                    .as_deref()
                    .map_or("-".into(), part_in_words)
                    .into_owned(),
            );
            row.push(if room.elbow_up { "up" } else { "down" }.to_owned());
            row.push(format!("{:.0}", 1e3 * room.elbow_over_entry_m));
        } else {
            row.resize(header.len(), "-".to_owned());
        }
        let cells = row.into_iter().enumerate().map(|(at, text)| {
            let is_text = at == 0 || header[at].starts_with("blocked") || header[at] == "elbow";
            let cell = Cell::new(text);
            if is_text {
                cell
            } else {
                cell.set_alignment(CellAlignment::Right)
            }
        });
        table.add_row(cells);
    }
    table
}

fn percent(fraction: f64) -> String {
    format!("{:.0}", 100.0 * fraction)
}

/// The worst value of a column, if the feasible configurations differ in it at all.
fn worst_of(goal: &GoalReport, column: &Column) -> Option<f64> {
    /// Relative spread below which no value is worse than another.
    const SPREAD: f64 = 0.01;
    let values: Vec<(f64, String)> = goal
        .configurations
        .iter()
        .filter(|each| each.status != Status::Rejected)
        .filter_map(|each| column.metric.value(each))
        .collect();
    let least = values.iter().map(|(value, _)| *value).reduce(f64::min)?;
    let most = values.iter().map(|(value, _)| *value).reduce(f64::max)?;
    let all_read_the_same = values.iter().all(|(_, text)| *text == values[0].1);
    if all_read_the_same || most - least <= SPREAD * most.abs() {
        return None;
    }
    Some(if column.metric.more_is_better() {
        least
    } else {
        most
    })
}

/// Failed criteria of a goal, or of what is in its place.
fn write_missed(out: &mut String, report: &Report, goal: &str) -> std::fmt::Result {
    for result in report
        .criteria
        .iter()
        .filter(|result| result.goal == goal && !result.pass)
    {
        let word = if missed_as_expected(report, result) {
            "failed as expected:"
        } else {
            "FAILED"
        };
        writeln!(out, "{word} {}", missed_in_words(result))?;
    }
    Ok(())
}

/// A failed criterion: of what, value and limit.
fn missed_in_words(result: &CriterionResult) -> String {
    let measured = result.value.zip(result.limit).map(|(value, limit)| {
        let (value, limit) = value_and_limit(value, limit, result.unit);
        format!("{value}, limit {limit}")
    });
    let parts = [
        result.label.clone(),
        result.engine.clone(),
        Some(format!("{}:", result.criterion)),
        Some(match (&measured, result.detail.as_str()) {
            (Some(measured), "") => measured.clone(),
            (Some(measured), detail) => format!("{measured} ({detail})"),
            (None, detail) => detail.to_owned(),
        }),
    ];
    let parts: Vec<String> = parts
        .into_iter()
        .flatten()
        .filter(|part| !part.is_empty())
        .collect();
    parts.join(" ")
}

/// Why configurations are infeasible, a sentence for each reason with all that it holds for; of each its label and the
/// first rule that it violates.
pub fn rejected_in_words<'r>(
    rejected: impl Iterator<Item = (&'r str, &'r RejectionReport)>,
) -> Vec<String> {
    let mut reasons: Vec<(&str, Vec<String>)> = Vec::new();
    for (label, first) in rejected {
        let reason = first.detail.split(';').next().unwrap_or_default();
        let text = format!("{label}{}", by_how_much(first));
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, labels)) => labels.push(text),
            None => reasons.push((reason, vec![text])),
        }
    }
    let in_words = reasons.into_iter();
    in_words
        .map(|(reason, labels)| format!("{reason}: {}", labels.join(", ")))
        .collect()
}

/// By how much a rule is violated; of some it is no number.
fn by_how_much(rejection: &RejectionReport) -> String {
    let (value, limit) = value_and_limit(rejection.value, rejection.limit, rejection.unit);
    match Rule::named(rejection.rule).map_or(Amount::Distance, Rule::amount) {
        Amount::None => String::new(),
        Amount::Missed => format!(" (by {value})"),
        Amount::Limited => format!(" ({value}, limit {limit})"),
        Amount::Required => format!(" ({value}, {limit} required)"),
        Amount::Distance if rejection.value < 0.0 => {
            let (depth, _) = value_and_limit(-rejection.value, rejection.limit, rejection.unit);
            let required = if rejection.limit > 0.0 {
                format!(", clearance {limit} required")
            } else {
                String::new()
            };
            format!(" (penetration {depth}{required})")
        }
        Amount::Distance => format!(" (clearance {value}, {limit} required)"),
    }
}

/// Clearance of the planned needle path from bone, vessels and organs, in a sentence.
///
/// `wanted_m` is the limit of a criterion; the larger of it and the margin is required.
pub fn route_in_words(route: &RouteReport, wanted_m: Option<f64>) -> String {
    let mm = 1e3 * route.distance_m;
    let RouteReport { part, tissue, .. } = route;
    let part = part_in_words(part);
    let where_it_goes = if mm < 0.0 {
        format!("{:.1} mm deep in {part} ({tissue})", -mm)
    } else {
        format!("{mm:.1} mm clearance to {part} ({tissue})")
    };
    format!(
        "needle path{}{}: {where_it_goes}, {:.1} mm required",
        if route.is_bent {
            ", bent by tissue"
        } else {
            ""
        },
        if route.kept { "" } else { " REJECTED" },
        1e3 * wanted_m.map_or(route.margin_m, |wanted_m| wanted_m.max(route.margin_m))
    )
}

/// Clearance that a criterion requires of a goal's needle path, m.
pub(crate) fn route_wanted_m(report: &Report, goal: &GoalReport) -> Option<f64> {
    let of_goal = report.criteria.iter().filter(|each| each.goal == goal.name);
    let mut of_route = of_goal.filter(|each| each.criterion == "min_clearance_mm.needle_route");
    of_route.find_map(|each| each.limit)
}

/// Fissures that the needle crosses, with the odds ratio; nothing where none is crossed.
pub fn fissures_in_words(crossed: &[String]) -> Option<String> {
    /// Odds of a pneumothorax against those of needles that cross none: meta-analysis of 23 104 patients
    /// (Br J Radiol 2020, PMC7362905).
    const ODDS: f64 = 3.75;
    (!crossed.is_empty()).then(|| {
        format!(
            "needle crosses {} (pneumothorax odds ratio {ODDS})",
            crossed
                .iter()
                .map(|name| part_in_words(name))
                .collect::<Vec<_>>()
                .join(", ")
        )
    })
}

/// What a planned motion does about clearance, where there is something to say: that it goes around, what
/// that gains and takes, and where it keeps less than its posture allows.
pub(crate) fn margin_in_words(configuration: &ConfigurationReport) -> Option<String> {
    if !configuration.rejections.is_empty() {
        return None;
    }
    let margin = configuration.margin.as_ref()?;
    let mut words = Vec::new();
    if let Some(straight) = &margin.straight {
        let end_s = configuration.motion.last().map_or(0.0, |phase| phase.end_s);
        words.push(format!(
            "alternative path: clearance {:.1} mm instead of {:.1} mm, duration {:.1} s instead of \
             {:.1} s",
            1e3 * straight.instead_m,
            1e3 * straight.clearance_m,
            end_s,
            straight.duration_s
        ));
    }
    if margin.search == "budget" {
        let short = margin
            .classes
            .iter()
            .filter(|(_, each)| each.limited_by == "transfer")
            .min_by(|(_, a), (_, b)| a.achieved_m.total_cmp(&b.achieved_m));
        if let Some((class, each)) = short {
            words.push(format!(
                "transit clearance {:.1} mm of {:.1} mm attainable ({class}); `motion_checks` \
                 exhausted, a better path may exist",
                1e3 * each.achieved_m,
                1e3 * each.attainable_m
            ));
        }
    }
    (!words.is_empty()).then(|| words.join("; "))
}

fn write_remarks(out: &mut String, report: &Report, goal: &GoalReport) -> std::fmt::Result {
    if let Some(route) = &goal.needle_route {
        writeln!(
            out,
            "{}",
            route_in_words(route, route_wanted_m(report, goal))
        )?;
    }
    if let Some(words) = fissures_in_words(&goal.fissures_crossed) {
        writeln!(out, "{words}")?;
    }
    if let Some(words) = true_target_in_words(goal) {
        writeln!(out, "{words}")?;
    }
    for configuration in &goal.configurations {
        if let Some(rejection) = configuration.rejections.first() {
            writeln!(
                out,
                "{}: {}{}: {}",
                configuration.label,
                rule_in_words(rejection.rule),
                by_how_much(rejection),
                rejection.detail
            )?;
        }
    }
    for configuration in &goal.configurations {
        if let Some(words) = margin_in_words(configuration) {
            writeln!(out, "{}: {words}", configuration.label)?;
        }
    }
    write_missed(out, report, &goal.name)?;
    match &goal.recommended {
        Some(found) => writeln!(out, "recommended: {} - {}", found.label, found.reason),
        None => writeln!(
            out,
            "recommended: none, no configuration is feasible and meets the criteria"
        ),
    }
}
