//! `needlebench breath`: recordings of breath, and what they say.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use needlebench_breath::{
    Axis, Estimate, Gap, LengthUnit, Lost, OverRecordings, ReadOptions, Recording,
    SIN4_NEAR_EXPIRATION, Statistics, over_recordings, read_recording, statistics,
};
use needlebench_input::printable_line;
use needlebench_show::{Cell, CellAlignment, plain_table};
use serde::Serialize;

use crate::command::{print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;

pub(crate) const BREATH_HELP: &str = "\
A table has a time and one or three coordinates of one marker, by the names time (or t, timestamp) and x, y, z (or \
position). Commas, semicolons or tabs part its cells; with the latter two, numbers may have a decimal comma. Times are \
in s, or in ms if their median step is above 1. Positions are in m or mm: the column's name (x_mm, x [mm]) or --unit \
says which. An MCAP file has PointStamped or PoseStamped messages, in m.

The movement is reduced to its main axis at 10 Hz. Expiration is the end at which the marker dwells.

With five FILEs or more, one of each patient: quantiles over recordings, and how much of each the others' bound covers.

Example: needlebench breath left.csv --columns 2,3,4,5 --unit mm
Example: needlebench breath recordings/*.csv --unit mm --json";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum UnitArgument {
    M,
    Mm,
}

#[derive(Debug, Args)]
pub(crate) struct BreathArguments {
    /// Recordings: tables (CSV) or MCAP files, one marker each.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Columns of the time and of one or three coordinates, by name or by number from 1.
    #[arg(long, value_name = "TIME,X[,Y,Z]", value_delimiter = ',')]
    columns: Option<Vec<String>>,
    /// Unit of the positions in a table whose column names have none.
    #[arg(long, value_enum, value_name = "UNIT")]
    unit: Option<UnitArgument>,
    /// Topic of the positions in an MCAP file that has several.
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// The answer.
#[derive(Debug, Serialize)]
struct BreathAnswer {
    schema_version: u32,
    recordings: Vec<RecordingAnswer>,
    over_recordings: OverRecordings,
}

#[derive(Debug, Serialize)]
struct RecordingAnswer {
    file: String,
    sha256: Option<String>,
    format: &'static str,
    rows: usize,
    time_unit: &'static str,
    step_s: f64,
    lost: Lost,
    gaps: Vec<Gap>,
    axis: Option<Axis>,
    dwell: [f64; 2],
    #[serde(flatten)]
    statistics: Statistics,
}

impl RecordingAnswer {
    fn new(recording: Recording, mut statistics: Statistics) -> Self {
        // What reading found comes first.
        statistics.findings.splice(0..0, recording.findings);
        Self {
            file: recording.file,
            sha256: recording.sha256,
            format: recording.format,
            rows: recording.rows,
            time_unit: recording.time_unit,
            step_s: recording.step_s,
            lost: recording.lost,
            gaps: recording.gaps,
            axis: recording.axis,
            dwell: recording.dwell,
            statistics,
        }
    }
}

/// Reads recordings and prints their statistics.
pub(crate) fn breath(arguments: &BreathArguments) -> Result<ExitStatus, Failure> {
    let options = ReadOptions {
        columns: arguments.columns.clone(),
        unit: arguments.unit.map(|unit| match unit {
            UnitArgument::M => LengthUnit::Metre,
            UnitArgument::Mm => LengthUnit::Millimetre,
        }),
        topic: arguments.topic.clone(),
    };
    let (mut read, mut findings) = (Vec::new(), Vec::new());
    for path in &arguments.files {
        let found = read_recording(path, &options).and_then(|recording| {
            let found = statistics(&recording).map_err(|finding| vec![finding])?;
            Ok(RecordingAnswer::new(recording, found))
        });
        match found {
            Ok(answer) => read.push(answer),
            Err(found) => findings.extend(found),
        }
    }
    if !findings.is_empty() {
        return Err(findings.into());
    }
    let names: Vec<&str> = read.iter().map(|each| each.file.as_str()).collect();
    let all: Vec<Statistics> = read.iter().map(|each| each.statistics.clone()).collect();
    let answer = BreathAnswer {
        schema_version: 1,
        over_recordings: over_recordings(&names, &all),
        recordings: read,
    };
    if arguments.json {
        print_json(&answer)?;
    } else {
        print_text(text(&answer).trim_end())?;
    }
    Ok(ExitStatus::Success)
}

fn text(answer: &BreathAnswer) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = match answer.recordings.as_slice() {
        [only] => one(&mut out, only),
        several => table(&mut out, several),
    };
    let _ = over(&mut out, &answer.over_recordings);
    for finding in answer
        .recordings
        .iter()
        .flat_map(|each| &each.statistics.findings)
    {
        let _ = writeln!(out, "finding: {finding}");
    }
    out
}

fn number(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

/// A value with its unit's factor and so many decimals, and its interval.
fn row(name: &str, estimate: &Estimate, factor: f64, decimals: usize) -> [Cell; 3] {
    let written = |value: f64| format!("{:.decimals$}", factor * value);
    let interval = match estimate.interval_95 {
        Some([low, high]) => format!("{} to {}", written(low), written(high)),
        None => "not enough to tell".to_owned(),
    };
    [
        Cell::new(name),
        number(if estimate.value.is_finite() {
            written(estimate.value)
        } else {
            "-".to_owned()
        }),
        Cell::new(interval),
    ]
}

/// All of one recording.
fn one(out: &mut String, answer: &RecordingAnswer) -> std::fmt::Result {
    let found = &answer.statistics;
    let Lost {
        zero,
        not_finite,
        out_of_order,
    } = answer.lost;
    writeln!(
        out,
        "{}: {:.1} s, {} breaths",
        printable_line(&answer.file),
        found.duration_s,
        found.breaths
    )?;
    writeln!(
        out,
        "{} rows at {:.1} Hz; lost: {zero} zero, {not_finite} not finite, {out_of_order} out of order; {} gaps",
        answer.rows,
        1.0 / answer.step_s,
        answer.gaps.len()
    )?;
    if let Some(axis) = &answer.axis {
        let [x, y, z] = axis.direction;
        let percent = 1e2 * axis.share;
        writeln!(
            out,
            "axis towards inspiration ({x:.2}, {y:.2}, {z:.2}), {percent:.1} % of the variance"
        )?;
    }
    writeln!(out)?;
    let mut table = plain_table(&["statistic", "value", "95 % CI"]);
    table.add_row(row("amplitude (mm)", &found.amplitude_m, 1e3, 2));
    table.add_row(row(
        "amplitude, cv from breath to breath",
        &found.amplitude_cv,
        1.0,
        2,
    ));
    table.add_row(row("period (s)", &found.period_s, 1.0, 2));
    table.add_row(row("period, cv", &found.period_cv, 1.0, 2));
    table.add_row(row("drift (mm/min)", &found.drift_m_per_s, 6e4, 2));
    for level in &found.level {
        let name = format!("level after {} s, RMS (mm)", level.after_s);
        table.add_row(row(&name, &level.rms_m, 1e3, 2));
    }
    for window in &found.windows {
        let share = window.of_amplitude;
        table.add_row(row(
            &format!("share of time within {share} A (%)"),
            &window.share,
            1e2,
            0,
        ));
        table.add_row(row("  length of stay (s)", &window.stay_s, 1.0, 1));
        table.add_row(row("  inside, SD (mm)", &window.inside_sd_m, 1e3, 2));
    }
    let near = format!(
        "within 0.2 A of its own breath (%); sin^4: {:.0}",
        1e2 * SIN4_NEAR_EXPIRATION
    );
    table.add_row(row(&near, &found.near_expiration, 1e2, 0));
    writeln!(out, "{table}\n")?;
    writeln!(
        out,
        "A: amplitude; windows are about the last three ends of expiration"
    )?;
    let worst = found
        .level
        .iter()
        .map(|level| level.worst_m)
        .fold(0.0, f64::max);
    writeln!(out, "level: largest difference {:.2} mm", 1e3 * worst)?;
    if let Some(law) = &found.level_law_m {
        writeln!(
            out,
            "level law: SD after t seconds sqrt(a^2 + (b t)^2), a = {:.3} mm, b = {:.4} mm/s",
            1e3 * law.at_once,
            1e3 * law.per_s
        )?;
    }
    Ok(())
}

/// A line for each of several.
fn table(out: &mut String, all: &[RecordingAnswer]) -> std::fmt::Result {
    let mut table = plain_table(&[
        "recording",
        "A (mm)",
        "cv",
        "period (s)",
        "drift\n(mm/min)",
        "level (mm)\n30 s",
        "\n60 s",
        "in 0.1 A\n(%)",
        "findings",
    ]);
    for answer in all {
        let found = &answer.statistics;
        let level = |after_s: f64| {
            let level = found.level.iter().find(|level| level.after_s == after_s);
            level.map_or_else(
                || "-".to_owned(),
                |level| format!("{:.2}", 1e3 * level.rms_m.value),
            )
        };
        let share = found
            .windows
            .first()
            .map_or(f64::NAN, |window| window.share.value);
        table.add_row([
            Cell::new(printable_line(&answer.file)),
            number(format!("{:.1}", 1e3 * found.amplitude_m.value)),
            number(format!("{:.2}", found.amplitude_cv.value)),
            number(format!("{:.1}", found.period_s.value)),
            number(format!("{:.2}", 6e4 * found.drift_m_per_s.value)),
            number(level(30.0)),
            number(level(60.0)),
            number(format!("{:.0}", 1e2 * share)),
            number(found.findings.len().to_string()),
        ]);
    }
    writeln!(out, "{table}\n")
}

/// What holds over recordings.
fn over(out: &mut String, over: &OverRecordings) -> std::fmt::Result {
    if let Some(reason) = &over.not_enough {
        return writeln!(
            out,
            "over recordings: not enough to tell ({reason}); defaults stay"
        );
    }
    writeln!(out, "over {} recordings:\n", over.recordings)?;
    let mut table = plain_table(&["statistic", "median", "P90"]);
    for each in &over.quantiles {
        let (name, factor, decimals) = match each.statistic {
            "amplitude_m" => ("amplitude (mm)", 1e3, 1),
            "amplitude_cv" => ("amplitude, cv", 1.0, 2),
            "period_s" => ("period (s)", 1.0, 1),
            "period_cv" => ("period, cv", 1.0, 2),
            "absolute_drift_m_per_s" => ("drift, either way (mm/min)", 6e4, 2),
            "share_within_0.1" => ("share of time within 0.1 A (%)", 1e2, 0),
            "share_within_0.2" => ("share of time within 0.2 A (%)", 1e2, 0),
            other => (other, 1.0, 3),
        };
        let written = |value: f64| number(format!("{:.decimals$}", factor * value));
        table.add_row([Cell::new(name), written(each.median), written(each.p90)]);
    }
    writeln!(out, "{table}\n")?;
    let mut table = plain_table(&[
        "level after",
        "recordings",
        "RMS, P90\n(A)",
        "bound\n(A)",
        "covers (%)\nmean",
        "\nleast",
    ]);
    for level in &over.level {
        let least = level.coverage.iter().copied().fold(f64::INFINITY, f64::min);
        let mean = level.coverage.iter().sum::<f64>() / level.coverage.len() as f64;
        table.add_row([
            Cell::new(format!("{} s", level.after_s)),
            number(level.recordings.to_string()),
            number(format!("{:.3}", level.rms_p90)),
            number(format!("{:.3}", level.bound)),
            number(format!("{:.0}", 1e2 * mean)),
            number(format!("{:.0}", 1e2 * least)),
        ]);
    }
    writeln!(out, "{table}\n")?;
    writeln!(
        out,
        "bound: 90th percentile over recordings of the 90 % quantile within each; covers: share of each recording \
         within the bound of the others, which should be 90 %"
    )?;
    if let Some(law) = &over.level_law_of_amplitude {
        writeln!(
            out,
            "level law: SD after t seconds A sqrt(a^2 + (b t)^2), a = {:.4}, b = {:.5} per s",
            law.at_once, law.per_s
        )?;
    }
    Ok(())
}
