//! A motion from a file: where it holds, how it keeps the joints' limits, and what needlebench plans instead.

use needlebench_cell::pair_in_words;
use needlebench_evaluation::judged::{
    HoldReport, JudgedReport, OwnPlanReport, PeakReport, ProgramReport, SAME_CONFIGURATION,
};
use needlebench_show::Block;

use super::class_words::class_in_words;

/// Classes of clearance that a sentence names.
const MOST_NAMED: usize = 2;

/// Events of a program that a table has; all of them are in `events.csv`.
const MOST_EVENTS: usize = 20;

/// What is said of a judged motion: sentences, and a table of its clearances beside the plans'.
pub fn judged_blocks(judged: &JudgedReport) -> Vec<Block> {
    let times = if judged.has_times {
        ""
    } else {
        " (the file has no times)"
    };
    let mut blocks = vec![Block::Lines(vec![format!(
        "motion {}: {}, {} points, {:.3} s{times}; interpolation: {}",
        judged.file, judged.format, judged.points, judged.duration_s, judged.between
    )])];
    if let Some(program) = &judged.program {
        blocks.extend(program_blocks(program));
    }
    for hold in &judged.holds {
        blocks.push(Block::Lines(lines(hold)));
        blocks.extend(table(hold));
    }
    blocks
}

/// How a program went: a sentence, and a table of its events.
fn program_blocks(program: &ProgramReport) -> Vec<Block> {
    let mut blocks = vec![Block::Lines(vec![format!(
        "{} (t = {:.3} s); run on a virtual controller at {:.0} Hz, with the arm in {}",
        program.detail,
        program.ended_s,
        program.period_s.recip(),
        program.engine
    )])];
    let header = ["time (s)", "line", "<event", "<what"];
    let rows = program.events.iter().take(MOST_EVENTS).map(|event| {
        vec![
            format!("{:.3}", event.time_s),
            event.line.map_or("-".to_owned(), |line| line.to_string()),
            event.kind.replace('_', " "),
            event.text.clone(),
        ]
    });
    let rows: Vec<Vec<String>> = rows.collect();
    let header = header.map(str::to_owned).to_vec();
    if !rows.is_empty() {
        blocks.push(Block::Table { header, rows });
    }
    let more = program.events.len().saturating_sub(MOST_EVENTS) + program.more_events;
    if more > 0 {
        blocks.push(Block::Lines(vec![format!("and {more} more events")]));
    }
    blocks
}

fn lines(hold: &HoldReport) -> Vec<String> {
    let [from_s, to_s] = hold.hold_s;
    let added = if hold.is_added {
        " (extended to the scenario's hold)"
    } else {
        ""
    };
    let whole = hold
        .turns
        .filter(|turns| turns.iter().any(|turn| *turn != 0));
    let whole = whole.map_or(String::new(), |turns| format!(", 2π equivalent {turns:?}"));
    let (which, joints) = match (hold.label, hold.joint_off_rad) {
        (Some(label), Some(off_rad)) => (
            format!("{label}{whole}"),
            format!("joints {}, ", degrees(off_rad, 3)),
        ),
        _ => (
            "none of the eight configurations (no solution of the goal at this roll)".to_owned(),
            String::new(),
        ),
    };
    let mut lines = vec![format!(
        "hold at goal {}, {from_s:.3} s to {to_s:.3} s{added}: {which}, roll {}; deviation from the goal: {joints}guide \
         position {} mm, guide angle {}",
        hold.goal,
        degrees(hold.roll_rad, 1),
        millimetres(hold.guide_off_m),
        degrees(hold.angle_off_rad, 3),
    )];
    lines.push(peaks(&hold.peaks));
    if !hold.afterwards_m.is_empty() {
        let all = hold.afterwards_m.iter();
        let all: Vec<String> = all
            .map(|(class, bound_m)| format!("{} {:.1} mm", class_in_words(class), bound_m * 1e3))
            .collect();
        lines.push(format!(
            "certified clearance after the hold: {}",
            all.join(", ")
        ));
    }
    lines.extend(hold.plans.iter().map(own_plan));
    lines
}

fn own_plan(plan: &OwnPlanReport) -> String {
    let OwnPlanReport { label, why, .. } = plan;
    let how = match (&plan.rejected, plan.duration_s) {
        (Some(rejected), _) => format!("infeasible, {rejected}"),
        (None, Some(duration_s)) => format!("{duration_s:.3} s"),
        (None, None) => "no motion".to_owned(),
    };
    // What has least left first: far from everything a loss is none.
    let mut nearer: Vec<(f64, f64, &str)> = plan
        .clearances
        .iter()
        .filter_map(|(class, found)| Some((found.motion_m, found.lost_m()?, *class)))
        .filter(|(_, lost_m, _)| *lost_m > 0.0)
        .collect();
    nearer.sort_by(|a, b| a.0.total_cmp(&b.0));
    let named = nearer
        .iter()
        .take(MOST_NAMED)
        .map(|(left_m, lost_m, class)| {
            format!(
                "{:.1} mm in {} ({:.1} mm left)",
                lost_m * 1e3,
                class_in_words(class),
                left_m * 1e3
            )
        });
    let named: Vec<String> = named.collect();
    let compared = match (plan.rejected.is_some(), named.is_empty()) {
        (true, _) => String::new(),
        (false, true) => "; the motion loses no clearance".to_owned(),
        (false, false) => format!("; the motion loses {}", named.join("; ")),
    };
    format!("needlebench's plan, {why} ({label}): {how}{compared}")
}

/// Clearances of the motion beside those of the plans.
fn table(hold: &HoldReport) -> Option<Block> {
    let first = hold.plans.first()?;
    let mut header = vec![
        "minimum\nclearance".to_owned(),
        "motion\n(mm)".to_owned(),
        "at (s)".to_owned(),
        "<between".to_owned(),
    ];
    // Their labels stand in the lines above.
    header.extend(hold.plans.iter().map(|plan| {
        let which = if plan.why == SAME_CONFIGURATION {
            "same"
        } else {
            "best"
        };
        format!("{which}\nplan (mm)")
    }));
    let rows = first.clearances.iter().map(|(class, found)| {
        let mut row = vec![
            class_in_words(class).to_owned(),
            format!("{:.1}", found.motion_m * 1e3),
            format!("{:.3}", found.time_s),
            pair_in_words(&found.pair),
        ];
        row.extend(hold.plans.iter().map(|plan| {
            let found = plan.clearances.get(class);
            found.map_or("-".to_owned(), |found| format!("{:.1}", found.plan_m * 1e3))
        }));
        row
    });
    let rows: Vec<Vec<String>> = rows.collect();
    (!rows.is_empty()).then_some(Block::Table { header, rows })
}

/// Largest values of the joints beside their limits.
pub(super) fn peaks(peaks: &[PeakReport]) -> String {
    let all: Vec<String> = peaks.iter().map(peak).collect();
    format!("peaks of the joints: {}", all.join("; "))
}

fn peak(peak: &PeakReport) -> String {
    let [degrees, whole] = [peak.value.to_degrees(), peak.value];
    let (what, value, limit, unit) = match peak.criterion {
        "joint_range" => ("position", degrees, peak.limit.to_degrees(), "deg"),
        "joint_speed" => ("speed", degrees.abs(), peak.limit.to_degrees(), "deg/s"),
        "joint_acceleration" => (
            "acceleration",
            degrees.abs(),
            peak.limit.to_degrees(),
            "deg/s^2",
        ),
        _ => ("torque", whole.abs(), peak.limit, "N m"),
    };
    format!(
        "{what} {value:.1} {unit}, limit {limit:.1} ({} at {:.3} s)",
        peak.joint, peak.time_s
    )
}

fn degrees(angle_rad: f64, decimals: usize) -> String {
    // Not "-0".
    format!("{:.decimals$} deg", angle_rad.to_degrees() + 0.0)
}

fn millimetres(length_m: f64) -> String {
    format!("{:.3}", length_m * 1e3)
}
