//! A recorded run and its replay as text.

use std::fmt::Write;

use needlebench_bench::replay::{ReplayReport, TIP_M};
use needlebench_kinematics::JOINT_LABELS;
use needlebench_recorded::{CalibrationFit, Estimate, LogKind, PoseError};
use needlebench_show::number::{rounded, small_length, value_and_limit};
use needlebench_show::plain_table;

/// The whole report, for a terminal of 80 columns.
pub fn text(report: &ReplayReport) -> String {
    let mut out = String::new();
    verdict(&mut out, report);
    head(&mut out, report);
    answer(&mut out, report);
    calibration(&mut out, report);
    identification(&mut out, report);
    comparison(&mut out, report);
    notes(&mut out, report);
    out.trim_end().to_owned()
}

/// A value with its interval: `0.6120 +-0.0001`, in parentheses where it is not identifiable from the run.
pub fn shown(estimate: &Estimate, unit: f64) -> String {
    let Some(value) = estimate.value else {
        return "not identifiable".to_owned();
    };
    let Some(half) = estimate.half_width else {
        return "not identifiable".to_owned();
    };
    let (value, half) = (value * unit, half * unit);
    let decimals = decimals(half, value);
    let shown_half = format!("{half:.decimals$}");
    let is_nothing = shown_half.bytes().all(|digit| matches!(digit, b'0' | b'.'));
    let text = if is_nothing && half > 0.0 {
        format!("{} +-{half:.0e}", rounded(value, decimals))
    } else {
        format!("{value:.decimals$} +-{shown_half}")
    };
    if estimate.identifiable {
        text
    } else {
        format!("({text})")
    }
}

/// A length that may be a millionth of another in the same table.
pub fn small(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 {
        format!("{value:.1e}")
    } else {
        rounded(value, 4)
    }
}

/// Decimals that show two digits of an interval, and no more than six of a value.
fn decimals(half: f64, value: f64) -> usize {
    let of = |x: f64, digits: f64| {
        if x == 0.0 || !x.is_finite() {
            0.0
        } else {
            digits - 1.0 - libm::log10(x.abs()).floor()
        }
    };
    let places = if half > 0.0 { of(half, 2.0) } else { 6.0 };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to a few decimals"
    )]
    let places = places.min(of(value, 6.0).max(2.0)).clamp(0.0, 9.0) as usize;
    places
}

fn head(out: &mut String, report: &ReplayReport) {
    let log = &report.log;
    // Writing to a text cannot fail, here and below.
    let _ = writeln!(
        out,
        "{}: {} of {} rows, {:.1} s at {:.4} s, {}",
        log.source.file,
        log.source.rows,
        log.source.rows_in_file,
        log.duration_s,
        log.period_s,
        match log.kind {
            LogKind::Arm => "of an arm",
            LogKind::Simulator => "of a simulator",
        }
    );
    let arm = &report.arm;
    let _ = writeln!(out, "arm: {} ({})", arm.name, arm.found);
    if let [best, next, ..] = arm.fits.as_slice() {
        let _ = writeln!(
            out,
            "nominal lengths, error at the log's poses: {} {:.3} mm RMS, next {} {:.1} mm",
            best.arm,
            best.rms_m * 1e3,
            next.arm,
            next.rms_m * 1e3
        );
    }
    if let Some([low, high]) = log.temperature_c {
        let _ = writeln!(
            out,
            "joint temperatures {low:.0} to {high:.0} degrees C (friction decreases with \
             temperature)"
        );
    }
    let _ = writeln!(out);
}

/// Errors of nominal lengths and of the calibration at the log's poses.
pub(crate) fn pose_errors(fit: &CalibrationFit) -> [(&'static str, &PoseError); 5] {
    [
        ("nominal lengths, all rows", &fit.nominal),
        ("calibrated, all rows", &fit.fitted),
        ("nominal, 5-fold cross-validation", &fit.nominal_held_out),
        ("calibrated, 5-fold cross-validation", &fit.held_out),
        (
            "calibrated on the first half, evaluated on the second",
            &fit.second_half,
        ),
    ]
}

fn calibration(out: &mut String, report: &ReplayReport) {
    let Some(fit) = &report.calibration else {
        let _ = writeln!(out, "calibration: none, the log has no TCP poses\n");
        return;
    };
    let mut table = plain_table(&["TCP poses", "RMS (mm)", "maximum (mm)"]);
    for (name, error) in pose_errors(fit) {
        table.add_row([
            name.to_owned(),
            small(error.rms_m * 1e3),
            small(error.largest_m * 1e3),
        ]);
    }
    let kept = if fit.is_worth {
        "used"
    } else {
        "not used: it does not predict held-out poses"
    };
    let _ = writeln!(out, "calibration, {kept}\n{table}\n");
}

fn identification(out: &mut String, report: &ReplayReport) {
    let found = &report.identification;
    if let Some(fit) = &found.controller {
        let mut table = plain_table(&[
            "controller model",
            "rotor (kg m^2)",
            "residual\n(N m)",
            "held-out\n(N m)",
            "from data\n(N m)",
        ]);
        for (joint, label) in JOINT_LABELS.iter().enumerate() {
            let by_data = fit.rms_by_data_nm.map(|rms| rms[joint]);
            table.add_row([
                (*label).to_owned(),
                shown(&fit.rotor_inertia_kgm2[joint], 1.0),
                rounded(fit.rms_nm[joint], 5),
                rounded(fit.held_out_rms_nm[joint], 5),
                by_data.map_or("-".to_owned(), |rms| rounded(rms, 4)),
            ]);
        }
        let _ = writeln!(out, "{table}");
        let _ = writeln!(
            out,
            "gravity {} m/s^2; links {}",
            shown(&fit.gravity_m_s2, 1.0),
            if fit.has_tensors {
                "with inertia tensors"
            } else {
                "as point masses at their centres of mass"
            }
        );
        for load in &fit.loads {
            let logged = load.logged.map_or(String::new(), |load| {
                let [x, y, z] = load.centre_m.map(|each| rounded(each * 1e3, 2));
                format!("; logged {} kg at ({x}, {y}, {z}) mm", load.mass_kg)
            });
            let _ = writeln!(out, "load {} kg{logged}", shown(&load.mass_kg, 1.0));
        }
        let _ = writeln!(out);
    }
    if let Some(law) = &found.current {
        let mut table = plain_table(&[
            law.of,
            "k (N m/A)",
            "Coulomb (N m)",
            "viscous\n(N m s/rad)",
            "held-out\n(A)",
        ]);
        for (label, drive) in JOINT_LABELS.iter().zip(&law.joints) {
            table.add_row([
                (*label).to_owned(),
                shown(&drive.torque_constant_nm_a, 1.0),
                shown(&drive.coulomb_nm, 1.0),
                shown(&drive.viscous_nms_rad, 1.0),
                rounded(drive.held_out_rms_a, 4),
            ]);
        }
        let _ = writeln!(out, "{table}\n");
    }
    if let Some(fit) = &found.measured {
        let mut table = plain_table(&[
            "measured",
            "rotor\n(kg m^2)",
            "Coulomb\n(N m)",
            "viscous\n(N m s/rad)",
            "held-out\n(N m)",
        ]);
        for (joint, label) in JOINT_LABELS.iter().enumerate() {
            table.add_row([
                (*label).to_owned(),
                shown(&fit.rotor_inertia_kgm2[joint], 1.0),
                shown(&fit.coulomb_nm[joint], 1.0),
                shown(&fit.viscous_nms_rad[joint], 1.0),
                rounded(fit.held_out_rms_nm[joint], 3),
            ]);
        }
        let _ = writeln!(out, "{table}");
        for load in &fit.loads {
            let _ = writeln!(out, "load {} kg", shown(&load.mass_kg, 1.0));
        }
        let _ = writeln!(out, "from {}\n", fit.source);
    }
    if found.controller.is_some() || found.current.is_some() || found.measured.is_some() {
        let _ = writeln!(
            out,
            "+-: half-width of the 95 % CI; in parentheses: not identifiable from this run\n"
        );
    }
}

fn comparison(out: &mut String, report: &ReplayReport) {
    let mut columns: Vec<(&str, &needlebench_recorded::Tracking)> = Vec::new();
    columns.extend(report.real.as_ref().map(|real| ("real", real)));
    columns.extend(
        report
            .engines
            .iter()
            .map(|(name, replay)| (*name, &replay.tracking)),
    );
    if columns.is_empty() {
        return;
    }
    let mut header = vec!["set-point tracking"];
    header.extend(columns.iter().map(|(name, _)| *name));
    let mut table = plain_table(&header);
    let mut row = |name: String, of: &dyn Fn(&needlebench_recorded::Tracking) -> String| {
        let mut cells = vec![name];
        cells.extend(columns.iter().map(|(_, tracking)| of(tracking)));
        table.add_row(cells);
    };
    let lag = |value: Option<f64>| value.map_or("-".to_owned(), |s| rounded(s * 1e3, 4));
    row("lag (ms)".to_owned(), &|each| lag(each.lag_of_all_s.value));
    row("lag, +- 95 % CI (ms)".to_owned(), &|each| {
        lag(each.lag_of_all_s.half_width)
    });
    for (joint, label) in JOINT_LABELS.iter().enumerate() {
        row(format!("{label}, RMS (mrad)"), &|each| {
            rounded(each.rms_rad[joint] * 1e3, 4)
        });
    }
    let optional = |value: Option<f64>| value.map_or("-".to_owned(), |m| rounded(m * 1e3, 4));
    row(format!("tip at {:.0} mm, RMS (mm)", TIP_M * 1e3), &|each| {
        rounded(each.tip_rms_m * 1e3, 4)
    });
    row("tip, maximum (mm)".to_owned(), &|each| {
        rounded(each.tip_largest_m * 1e3, 4)
    });
    row("tip at rest, RMS (mm)".to_owned(), &|each| {
        optional(each.standing_tip_rms_m)
    });
    row("tip at rest, maximum (mm)".to_owned(), &|each| {
        optional(each.standing_tip_largest_m)
    });
    let _ = writeln!(out, "{table}\n");
    if report.engines.is_empty() {
        return;
    }
    let mut header = vec!["engine compared with"];
    header.extend(report.engines.keys().copied());
    let mut table = plain_table(&header);
    let mut row =
        |name: String, of: &dyn Fn(&needlebench_bench::replay::EngineReplay) -> Option<String>| {
            let mut cells = vec![name];
            cells.extend(
                report
                    .engines
                    .values()
                    .map(|each| of(each).unwrap_or_else(|| "-".to_owned())),
            );
            table.add_row(cells);
        };
    row("real tip, RMS (mm)".to_owned(), &|each| {
        each.against_real
            .as_ref()
            .map(|real| rounded(real.tip_rms_m * 1e3, 4))
    });
    row("real tip, maximum (mm)".to_owned(), &|each| {
        each.against_real
            .as_ref()
            .map(|real| rounded(real.tip_largest_m * 1e3, 4))
    });
    for (joint, label) in JOINT_LABELS.iter().enumerate() {
        row(format!("target_moment, {label}, RMS (N m)"), &|each| {
            each.torque_rms_nm.map(|rms| rounded(rms[joint], 4))
        });
    }
    for (joint, label) in JOINT_LABELS.iter().enumerate() {
        row(format!("actual_current, {label}, RMS (A)"), &|each| {
            each.current_rms_a[joint].map(|rms| rounded(rms, 3))
        });
    }
    let _ = writeln!(out, "{table}");
    for words in &report.replayed {
        let _ = writeln!(out, "- {words}");
    }
    let _ = writeln!(out);
}

/// The results of the log and its replay, before any table.
fn answer(out: &mut String, report: &ReplayReport) {
    let length = |m: f64| {
        if m < 1e-6 {
            small_length(m)
        } else {
            format!("{} mm", rounded(m * 1e3, 4))
        }
    };
    if let Some(fit) = report.calibration.as_ref().filter(|fit| fit.is_worth) {
        let _ = writeln!(
            out,
            "calibration: RMS error at held-out poses {}, with nominal lengths {}",
            length(fit.held_out.rms_m),
            length(fit.nominal_held_out.rms_m)
        );
    }
    if let Some(real) = &report.real {
        let lag = real.lag_of_all_s.value;
        let lag = lag.map_or(String::new(), |s| {
            format!("; lag {} ms", rounded(s * 1e3, 2))
        });
        let _ = writeln!(
            out,
            "tracking error of the real arm at the tip: {} RMS, maximum {}{lag}",
            length(real.tip_rms_m),
            length(real.tip_largest_m)
        );
    }
    for (name, engine) in &report.engines {
        if let Some(real) = &engine.against_real {
            let _ = writeln!(
                out,
                "{name} compared with the real tip: {} RMS, maximum {}",
                length(real.tip_rms_m),
                length(real.tip_largest_m)
            );
        }
    }
    let _ = writeln!(out);
}

fn verdict(out: &mut String, report: &ReplayReport) {
    let judged = report.criteria.len() + report.not_judged.len();
    if judged > 0 {
        let met = report.criteria.iter().filter(|result| result.pass).count();
        let _ = writeln!(
            out,
            "{}: {met} of {judged} criteria met",
            report.verdict.name().to_uppercase()
        );
    }
    for failure in &report.engine_failures {
        let _ = writeln!(out, "{} failed: {}", failure.engine, failure.message);
    }
    for result in report.criteria.iter().filter(|result| !result.pass) {
        let engine = result
            .engine
            .as_ref()
            .map_or(String::new(), |name| format!(" in {name}"));
        let (value, limit) = value_and_limit(
            result.value.unwrap_or(f64::NAN),
            result.limit.unwrap_or(f64::NAN),
            result.unit,
        );
        let _ = writeln!(
            out,
            "FAILED {}{engine}: {value}, limit {limit}",
            result.criterion
        );
    }
    for open in &report.not_judged {
        let engine = open
            .engine
            .as_ref()
            .map_or(String::new(), |name| format!(" in {name}"));
        let _ = writeln!(
            out,
            "NOT EVALUATED {}{engine}: {}",
            open.criterion, open.reason
        );
    }
}

fn notes(out: &mut String, report: &ReplayReport) {
    if !report.notes.is_empty() {
        let _ = writeln!(out, "notes:");
        for note in &report.notes {
            let _ = writeln!(out, "- {note}");
        }
    }
}
