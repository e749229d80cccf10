//! `needlebench iso9283`.

use clap::{Args, ValueEnum};
use std::fmt::Write;
use std::path::Path;
use std::path::PathBuf;

use anyhow::{Context, Result};
use needlebench_evaluation::report::Verdict;
use needlebench_input::{FileKind, Finding, or_wrong_kind, read_data_text};
use needlebench_iso9283::{
    Attained, LogUnits, MeasuredReport, RotationColumns, measured_report, read_commanded, read_log,
};
use serde::Serialize;

use super::results_folder::probe_file;
use super::{print_json, print_text};

use crate::arguments::PicturesArguments;
use crate::clock::elapsed;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use needlebench_report::files::{Folder, write_measured};
use needlebench_report::table::iso9283::measured_text;
use needlebench_report::{JudgedLimit, limits_junit, write_atomically};

pub(crate) const ISO9283_HELP: &str = "\
Both files are tables whose first line has the column names with units, separated by commas, semicolons (with \
decimal commas) or tabs; lines that start with #, // or % are comments. `needlebench run` of a scenario with \
[iso9283] writes examples of both.

  pose         P1 to P5 or 1 to 5; P3_07 is pose 3 in cycle 7
  x_mm y_mm z_mm   or x [mm], X (m) and so on: m, mm, um or in
  cycle        1, 2, 3 ...; counted if missing
  direction    x, y or z if the pose was approached along an axis (for vAP), otherwise empty
  qw qx qy qz  orientation, or rx_deg ry_deg rz_deg with --rotation
  time_s       seconds, or dates like 2026-01-31T12:00:00

Positions are in the robot's base frame; with --fit-frame, in the tracker's frame.

Example: needlebench iso9283 --csv robot.csv --commanded commanded.csv --max-rp 0.1
Example: needlebench iso9283 --csv export.txt --commanded poses.csv --length-unit mm --fit-frame";

#[derive(Debug, Args)]
pub(crate) struct Iso9283Arguments {
    /// Log of the tracker: one row per measured pose.
    #[arg(long, value_name = "CSV")]
    pub csv: PathBuf,
    /// Commanded poses: one row per pose.
    #[arg(long, value_name = "CSV")]
    pub commanded: PathBuf,
    /// Register the tracker's frame by the best fit of the mean positions to the commanded ones; AP then excludes the
    /// error of the base placement.
    #[arg(long)]
    pub fit_frame: bool,
    /// Unit of lengths without a unit in the header.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub length_unit: Option<LengthUnit>,
    /// Unit of angles without a unit in the header.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub angle_unit: Option<AngleUnit>,
    /// Meaning of columns rx, ry, rz.
    #[arg(long, value_enum, value_name = "MEANING")]
    pub rotation: Option<RotationArgument>,
    /// Limit of the pose accuracy AP of any pose, mm.
    #[arg(long, value_name = "MM")]
    pub max_ap: Option<f64>,
    /// Limit of the pose repeatability RP of any pose, mm.
    #[arg(long, value_name = "MM")]
    pub max_rp: Option<f64>,
    /// Limit of the multi-directional variation vAP of any pose, mm.
    #[arg(long, value_name = "MM")]
    pub max_vap: Option<f64>,
    /// Folder for report.json, the measurements in the base frame, and a chart.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write JUnit XML of the limits to this file.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
}

/// Units of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LengthUnit {
    /// Metres.
    M,
    /// Millimetres.
    Mm,
    /// Micrometres.
    Um,
    /// Inches.
    In,
}

impl LengthUnit {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Mm => "mm",
            Self::Um => "um",
            Self::In => "in",
        }
    }
}

/// Units of angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AngleUnit {
    /// Degrees.
    Deg,
    /// Radians.
    Rad,
    /// Milliradians.
    Mrad,
}

impl AngleUnit {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Deg => "deg",
            Self::Rad => "rad",
            Self::Mrad => "mrad",
        }
    }
}

/// Meaning of the three columns of a rotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RotationArgument {
    /// Axis times angle, as shown by UR controllers.
    RotationVector,
    /// Rotations about the fixed axes x, then y, then z, as shown by SpatialAnalyzer.
    FixedXyz,
}

/// The report, evaluated against the limits of the command line.
#[derive(Serialize)]
struct Judged<'a> {
    #[serde(flatten)]
    report: &'a MeasuredReport,
    verdict: Verdict,
    limits: Vec<Limit>,
}

#[derive(Serialize)]
struct Limit {
    criterion: &'static str,
    value_m: Option<f64>,
    limited_to_m: f64,
    pass: bool,
}

impl Limit {
    fn in_words(&self) -> JudgedLimit {
        JudgedLimit {
            criterion: self.criterion.to_owned(),
            value: self.value_m.map(|metres| format!("{:.4} mm", metres * 1e3)),
            limit: format!("{} mm", self.limited_to_m * 1e3),
            pass: self.pass,
        }
    }
}

/// Evaluates a tracker's log.
pub(crate) fn iso9283(arguments: &Iso9283Arguments) -> Result<ExitStatus, Failure> {
    if let Some(path) = &arguments.junit {
        probe_file(path, "--junit")?;
    }
    let (report, attained) = measured(arguments)?;
    let limits = limits(arguments, &report);
    let missed = limits
        .iter()
        .any(|limit| limit.value_m.is_some() && !limit.pass);
    let open = limits.iter().any(|limit| limit.value_m.is_none());
    let verdict = Verdict::of(missed, open);
    let judged = Judged {
        report: &report,
        verdict,
        limits,
    };
    if let Some(folder) = &arguments.out {
        write_results(folder, arguments, &judged, &attained)
            .with_context(|| format!("cannot write the results to {}", folder.display()))?;
    }
    if let Some(path) = &arguments.junit {
        let limits: Vec<JudgedLimit> = judged.limits.iter().map(Limit::in_words).collect();
        let document = limits_junit(&arguments.csv.display().to_string(), &limits, elapsed())
            .map_err(anyhow::Error::from)?;
        write_atomically(path, document.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if arguments.json {
        print_json(&judged)?;
    } else {
        let mut text = measured_text(&report);
        for limit in judged.limits.iter().filter(|limit| !limit.pass) {
            let (word, value) = match limit.value_m {
                Some(value_m) => ("FAILED", format!("{:.4} mm", value_m * 1e3)),
                None => ("not evaluated", "not measured".to_owned()),
            };
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{word} {}: {value}, limit {} mm",
                limit.criterion,
                limit.limited_to_m * 1e3
            );
        }
        if !judged.limits.is_empty() {
            let met = judged.limits.iter().filter(|limit| limit.pass).count();
            let _ = writeln!(
                text,
                "{}: {met} of {} limits met",
                verdict.name().to_uppercase(),
                judged.limits.len()
            );
        }
        print_text(text.trim_end())?;
    }
    Ok(ExitStatus::of(verdict))
}

fn measured(arguments: &Iso9283Arguments) -> Result<(MeasuredReport, Vec<Attained>), Vec<Finding>> {
    let units = LogUnits {
        length: arguments.length_unit.map(LengthUnit::name),
        angle: arguments.angle_unit.map(AngleUnit::name),
        rotation: arguments.rotation.map(|rotation| match rotation {
            RotationArgument::RotationVector => RotationColumns::RotationVector,
            RotationArgument::FixedXyz => RotationColumns::FixedXyz,
        }),
    };
    let log_file = arguments.csv.display().to_string();
    let commanded_file = arguments.commanded.display().to_string();
    let log_text = read(&arguments.csv)?;
    let commanded_text = read(&arguments.commanded)?;
    let or_other = |path: &Path, findings| or_wrong_kind(path, FileKind::Table, findings);
    let commanded = read_commanded(&commanded_file, &commanded_text, units)
        .map_err(|findings| or_other(&arguments.commanded, findings))?;
    let log = read_log(&log_file, &log_text, &commanded, units)
        .map_err(|findings| or_other(&arguments.csv, findings))?;
    measured_report(
        &log_file,
        &commanded_file,
        &commanded,
        log,
        arguments.fit_frame,
    )
    .map_err(|error| {
        vec![
            Finding::new(log_file, error.to_string())
                .hint("a test repeats each pose; the standard requires 30 cycles"),
        ]
    })
}

fn read(path: &Path) -> Result<String, Vec<Finding>> {
    read_data_text(path).map_err(|error| {
        let hint = error
            .hint("`needlebench run` of a scenario with [iso9283] writes an example of both files");
        let finding = Finding::new(
            path.display().to_string(),
            format!("cannot read the file: {error}"),
        );
        vec![finding.hint(hint)]
    })
}

fn limits(arguments: &Iso9283Arguments, report: &MeasuredReport) -> Vec<Limit> {
    let statistics = &report.statistics;
    [
        ("max_ap", arguments.max_ap, Some(statistics.ap_m)),
        ("max_rp", arguments.max_rp, Some(statistics.rp_m)),
        ("max_vap", arguments.max_vap, statistics.vap_m),
    ]
    .into_iter()
    .filter_map(|(criterion, limit_mm, value_m)| {
        let limited_to_m = limit_mm? * 1e-3;
        Some(Limit {
            criterion,
            value_m,
            limited_to_m,
            pass: value_m.is_some_and(|value| value <= limited_to_m),
        })
    })
    .collect()
}

fn write_results(
    folder: &Path,
    arguments: &Iso9283Arguments,
    judged: &Judged<'_>,
    attained: &[Attained],
) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let files = Folder(folder);
    files.write_json("report.json", judged)?;
    let report = judged.report;
    let pictures = arguments.pictures.are_wanted(false);
    write_measured(&report.log, &report.statistics, attained, files, pictures)?;
    Ok(())
}
