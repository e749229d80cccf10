//! An excitation run as text.

use needlebench_cell::pair_in_words;
use std::fmt::Write;

use needlebench_bench::record_plan::{JointTelling, PlanReport};
use needlebench_evaluation::excitation::{ExcitationReport, MotionReport, proven_m};
use needlebench_evaluation::report::ClearanceReport;
use needlebench_show::number::{rounded, small_length, three_digits};
use needlebench_show::{CellAlignment, Table, plain_table};

/// What a run prints.
pub fn report_text(report: &ExcitationReport) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut text, report);
    text
}

fn write_report(out: &mut String, report: &ExcitationReport) -> std::fmt::Result {
    writeln!(
        out,
        "\nexcitation: {} postures, {} payloads, {:.0} s with each",
        report.postures_rad.len(),
        report.loads.len(),
        report.duration_s
    )?;
    let mut table = plain_table(&[
        "engine",
        "added\n(kg)",
        "certified (mm)\nothers / self",
        "tracking (mrad)\nRMS / peak",
        "peak torque\nratio",
        "saturated\n(steps)",
        "contact",
    ]);
    table.add_row([
        "planned".to_owned(),
        "all".to_owned(),
        both(&report.planned),
        "-".to_owned(),
        "-".to_owned(),
        "-".to_owned(),
        "-".to_owned(),
    ]);
    for (engine, measured) in &report.engines {
        for each in measured {
            let largest = |values: &[f64; 6]| values.iter().copied().fold(0.0, f64::max) * 1e3;
            let load = &report.loads[each.load - 1];
            table.add_row([
                engine.clone(),
                load.added_kg.to_string(),
                both(&each.clearance),
                format!(
                    "{:.3} / {:.3}",
                    largest(&each.tracking_rms_rad),
                    largest(&each.tracking_peak_rad)
                ),
                format!("{:.0} %", each.effort.peak_torque_ratio * 100.0),
                each.effort.saturated_steps.to_string(),
                if each.effort.contact.occurred {
                    "yes"
                } else {
                    "no"
                }
                .to_owned(),
            ]);
        }
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    writeln!(out, "{table}")?;
    if let Some(difference) = report.engine_difference {
        writeln!(
            out,
            "engine difference at the tip: at most {} in motion, {} at the end",
            small_length(difference.peak_tip_m),
            small_length(difference.settled_tip_m)
        )?;
    }
    for file in &report.files {
        writeln!(out, "log: {file}")?;
    }
    Ok(())
}

fn both(clearance: &ClearanceReport) -> String {
    let [others, itself] = proven_m(clearance)
        .map(|value| value.map_or("-".to_owned(), |metres| format!("{:.1}", metres * 1e3)));
    format!("{others} / {itself}")
}

/// A deviation with two significant digits.
fn two_digits(value: f64) -> String {
    match value {
        value if value >= 9.5 => format!("{value:.0}"),
        value if value >= 0.95 => format!("{value:.1}"),
        value => format!("{value:.2}"),
    }
}

/// Certified clearances: by class, and motion by motion.
pub(crate) fn clearances_text(report: &PlanReport) -> String {
    let mut text = format!(
        "Certified minimum clearances of {}: arm, tool and payload along every motion of the run, \
         for the nominal arm.\nRequired: {:.1} mm from everything else, {:.1} mm \
         self-clearance.\n\n",
        report.scenario,
        report.clearance_limit_m * 1e3,
        report.self_clearance_limit_m * 1e3
    );
    let _ = writeln!(text, "{}", class_table(report));
    let mut table = plain_table(&["motion", "others\n(mm)", "self\n(mm)", "nearest"]);
    for each in &report.motions {
        let [others, itself] = proven_m(&each.clearance)
            .map(|value| value.map_or("-".to_owned(), |metres| format!("{:.1}", metres * 1e3)));
        table.add_row([each.motion.clone(), others, itself, nearest(each)]);
    }
    for column in table.column_iter_mut().skip(1).take(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let _ = writeln!(text, "{table}");
    text
}

/// The nearest pair of a motion that is not of the arm with itself, else of the arm.
fn nearest(motion: &MotionReport) -> String {
    let classes = motion.clearance.classes.iter();
    let others = classes
        .clone()
        .filter(|(name, _)| **name != "self" && **name != "needle_corridor")
        .min_by(|a, b| a.1.minimum_m.total_cmp(&b.1.minimum_m));
    let found = others.or_else(|| classes.clone().find(|(name, _)| **name == "self"));
    found.map_or(String::new(), |(_, found)| pair_in_words(&found.pair))
}

fn class_table(report: &PlanReport) -> Table {
    let mut table = plain_table(&["class", "certified (mm)", "attained (mm)", "pair"]);
    for (class, found) in &report.planned.classes {
        if *class == "needle_corridor" {
            continue;
        }
        table.add_row([
            (*class).to_owned(),
            found
                .certified_lower_bound_m
                .map_or("-".to_owned(), |metres| format!("{:.1}", metres * 1e3)),
            format!("{:.1}", found.minimum_m * 1e3),
            pair_in_words(&found.pair),
        ]);
    }
    for column in table.column_iter_mut().skip(1).take(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// What `record-plan` prints.
pub fn plan_text(report: &PlanReport) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_plan(&mut text, report);
    text
}

fn write_plan(out: &mut String, report: &PlanReport) -> std::fmt::Result {
    let payloads: Vec<String> = report.payloads_kg.iter().map(f64::to_string).collect();
    writeln!(
        out,
        "{}: {} postures selected from {} feasible ones ({} sampled), sweeps of six joints, {:.0} \
         s with each payload of {} kg",
        report.scenario,
        report.postures,
        report.candidates[0],
        report.candidates[1],
        report.duration_s,
        payloads.join(", ")
    )?;
    if report.over_start > 0 {
        writeln!(
            out,
            "{} motion{} via the start posture, which counts as a posture there",
            report.over_start,
            if report.over_start == 1 {
                " leads"
            } else {
                "s lead"
            }
        )?;
    }
    writeln!(out, "tool: {:.3} kg, always mounted", report.tool_kg)?;
    writeln!(out, "{}", class_table(report))?;
    let [here, random] = [&report.tells, &report.random];
    let condition = |value: Option<f64>| value.map_or("-".to_owned(), three_digits);
    let known = |value: Option<f64>, factor: f64| {
        value.map_or("-".to_owned(), |value| three_digits(value * factor))
    };
    writeln!(
        out,
        "predicted standard deviations: this run / as many random postures without sweeps"
    )?;
    let mut table = plain_table(&["", "this run", "random"]);
    for (name, a, b) in [
        (
            "flange position of the calibrated arm elsewhere, RMS (mm)",
            three_digits(here.flange_rms_m * 1e3),
            three_digits(random.flange_rms_m * 1e3),
        ),
        (
            "flange position of the calibrated arm elsewhere, worst (mm)",
            three_digits(here.flange_worst_m * 1e3),
            three_digits(random.flange_worst_m * 1e3),
        ),
        (
            "condition number of the calibration",
            condition(here.calibration_condition),
            condition(random.calibration_condition),
        ),
        (
            "payload mass (g)",
            known(here.payload_kg, 1e3),
            known(random.payload_kg, 1e3),
        ),
        (
            "payload centre of mass (mm)",
            known(here.payload_centre_m, 1e3),
            known(random.payload_centre_m, 1e3),
        ),
    ] {
        table.add_row([name.to_owned(), a, b]);
    }
    writeln!(out, "{table}")?;
    let mut table = plain_table(&[
        "joint",
        "rotor inertia\n(g m^2)",
        "torque\nconstant (%)",
        "Coulomb\n(N m)",
        "viscous\n(Nms/rad)",
        "holding\n(N m)",
    ]);
    for (a, b) in here.joints.iter().zip(&random.joints) {
        let pair = |value: fn(&JointTelling) -> Option<f64>, factor: f64| {
            let two = |each: &JointTelling| {
                value(each).map_or("-".to_owned(), |value| two_digits(value * factor))
            };
            format!("{}/{}", two(a), two(b))
        };
        table.add_row([
            a.joint.to_owned(),
            pair(|each| each.rotor_kgm2, 1e3),
            pair(|each| each.torque_constant_share, 100.0),
            pair(|each| each.coulomb_nm, 1.0),
            pair(|each| each.viscous_nms_rad, 1.0),
            a.standing_nm.map(|torque| rounded(torque, 1)).join(", "),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    writeln!(out, "{table}")?;
    for each in &here.joints {
        if each.torque_constant_identified == Some(false) {
            writeln!(
                out,
                "not identified to 10 %: torque constant of {} (too little load from gravity and \
                 acceleration)",
                each.joint
            )?;
        }
    }
    if here
        .joints
        .iter()
        .all(|each| each.torque_constant_identified.is_none())
    {
        writeln!(
            out,
            "torque constants of the arm unknown; uncertainty from currents not predicted"
        )?;
    }
    let noise = &report.noise;
    writeln!(
        out,
        "assumed noise: flange {} and {:.1} mrad, torque {} N m, current {} A, independent every \
         {} s",
        small_length(noise.position_m),
        noise.rotation_rad * 1e3,
        noise.moment_nm,
        noise.current_a,
        noise.independent_s
    )
}
