//! `needlebench iso9283`.

use std::path::Path;

use anyhow::{Context, Result};
use needlebench_cell::Finding;
use needlebench_evaluation::iso9283::{
    Attained, LogUnits, MeasuredReport, RotationColumns, measured_report, read_commanded, read_log,
    write_log,
};
use needlebench_evaluation::report::Verdict;
use serde::Serialize;

use super::{print_json, print_text};
use crate::atomic::write_atomically;
use crate::cli::{AngleUnit, Iso9283Arguments, LengthUnit, RotationArgument};
use crate::exit::ExitStatus;
use crate::iso9283::{attained_picture, measured_text};
use crate::output::findings::print_findings;

/// The report with its verdict on the command line's limits.
#[derive(Serialize)]
struct Judged<'a> {
    #[serde(flatten)]
    report: &'a MeasuredReport,
    verdict: Verdict,
    limits: Vec<JudgedLimit>,
}

#[derive(Serialize)]
struct JudgedLimit {
    criterion: &'static str,
    value_m: Option<f64>,
    limit_m: f64,
    pass: bool,
}

/// Evaluates a tracker's log.
pub(crate) fn iso9283(arguments: &Iso9283Arguments) -> Result<ExitStatus> {
    let (report, attained) = match measured(arguments) {
        Ok(measured) => measured,
        Err(findings) => {
            print_findings(&findings);
            return Ok(ExitStatus::BadInput);
        }
    };
    let limits = limits(arguments, &report);
    let met = limits.iter().all(|limit| limit.pass);
    let judged = Judged {
        report: &report,
        verdict: if met { Verdict::Pass } else { Verdict::Fail },
        limits,
    };
    if let Some(folder) = &arguments.out {
        write_results(folder, arguments, &judged, &attained)
            .with_context(|| format!("cannot write the results to {}", folder.display()))?;
    }
    if arguments.json {
        print_json(&judged)?;
    } else {
        let mut text = measured_text(&report);
        for limit in judged.limits.iter().filter(|limit| !limit.pass) {
            let value = limit.value_m.map_or("not measured".to_owned(), |value| {
                format!("{:.4} mm", value * 1e3)
            });
            text.push_str(&format!(
                "FAILED {}: {value}, limit {} mm\n",
                limit.criterion,
                limit.limit_m * 1e3
            ));
        }
        print_text(text.trim_end())?;
    }
    Ok(if met {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
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
    let commanded = read_commanded(&commanded_file, &commanded_text, units)?;
    let log = read_log(&log_file, &log_text, &commanded, units)?;
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
                .hint("a test has each pose several times; the standard asks for 30"),
        ]
    })
}

fn read(path: &Path) -> Result<String, Vec<Finding>> {
    std::fs::read_to_string(path).map_err(|error| {
        let finding = Finding::new(
            path.display().to_string(),
            format!("cannot read the file: {error}"),
        );
        vec![
            finding.hint(if error.kind() == std::io::ErrorKind::InvalidData {
                "save the file as UTF-8 text"
            } else {
                "`needlebench run` of a scenario with [iso9283] writes an example of both files"
            }),
        ]
    })
}

fn limits(arguments: &Iso9283Arguments, report: &MeasuredReport) -> Vec<JudgedLimit> {
    let statistics = &report.statistics;
    [
        ("max_ap", arguments.max_ap, Some(statistics.ap_m)),
        ("max_rp", arguments.max_rp, Some(statistics.rp_m)),
        ("max_vap", arguments.max_vap, statistics.vap_m),
    ]
    .into_iter()
    .filter_map(|(criterion, limit_mm, value_m)| {
        let limit_m = limit_mm? * 1e-3;
        Some(JudgedLimit {
            criterion,
            value_m,
            limit_m,
            pass: value_m.is_some_and(|value| value <= limit_m),
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
    let mut json = serde_json::to_vec_pretty(judged)?;
    json.push(b'\n');
    write_atomically(&folder.join("report.json"), &json)?;
    let title = format!(
        "needlebench: attained poses of {}\nPositions (mm) in the robot's base frame",
        judged.report.log
    );
    write_atomically(
        &folder.join("attained.csv"),
        write_log(&title, attained).as_bytes(),
    )?;
    if !arguments.no_pictures {
        let heading = arguments
            .csv
            .file_name()
            .unwrap_or_default()
            .to_string_lossy();
        attained_picture(&heading, &judged.report.statistics, attained)
            .write_png(&folder.join("attained.png"))?;
    }
    Ok(())
}
