//! Contacts, stops and retreats as tables.

use std::fmt::Write;

use needlebench_evaluation::events::{PressEngineReport, RIGID_FORCE_MEANS};
use needlebench_evaluation::report::GoalReport;
use needlebench_show::number::{millimetres, percent_with, small_length};
use needlebench_show::{Cell, CellAlignment, Table, plain_table};

/// Results of the events of a goal's configurations; none where none are prescribed.
pub(crate) fn events_text(goal: &GoalReport) -> Option<String> {
    goal.configurations
        .iter()
        .find(|each| each.events.is_some())?;
    let mut text = String::new();
    let tables = [
        (
            format!("prescribed contacts; forces: {RIGID_FORCE_MEANS}"),
            press_table(goal),
        ),
        ("emergency stop".to_owned(), stop_table(goal)),
        ("retreat along the needle".to_owned(), retract_table(goal)),
    ];
    for (heading, table) in tables {
        if table.row_count() > 0 {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{heading}\n{table}");
        }
    }
    Some(text)
}

/// The same in a sentence: the worst of each kind over configurations and engines.
pub(crate) fn events_in_words(goal: &GoalReport) -> Option<String> {
    let events = || {
        goal.configurations
            .iter()
            .filter_map(|each| each.events.as_ref())
    };
    let largest = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
    let presses = || events().flat_map(|each| &each.press);
    let stops = || events().filter_map(|each| each.stop.as_ref());
    let mut parts = Vec::new();
    let staged = presses().filter(|each| each.not_staged.is_none()).count();
    let left_out = presses().count() - staged;
    let episodes = presses()
        .flat_map(|each| each.engines.values())
        .flat_map(|each| &each.episodes);
    if let Some(force) = largest(&mut episodes.map(|each| each.peak_force_n)) {
        let left_out = match left_out {
            0 => String::new(),
            count => format!(" ({count} more could not be staged)"),
        };
        parts.push(format!(
            "{staged} prescribed contacts{left_out}, peak force {force:.1} N (rigid surface)"
        ));
    } else if left_out > 0 {
        parts.push(format!(
            "none of {left_out} prescribed contacts could be staged"
        ));
    }
    let measured = || stops().flat_map(|each| each.engines.values());
    if let Some(way_m) = largest(&mut measured().map(|each| each.tip_distance_m)) {
        let time = largest(&mut measured().filter_map(|each| each.stopping_time_s));
        let time = time.map_or(String::new(), |s| format!(" in {:.0} ms", s * 1e3));
        parts.push(format!(
            "emergency stop: tip travels at most {:.1} mm{time}",
            way_m * 1e3
        ));
    }
    let ways = || events().flat_map(|each| each.retract.values());
    if let Some(off_m) = largest(&mut ways().map(|each| each.largest_lateral_deviation_m)) {
        let touching = ways().filter(|each| !each.contacts.is_empty()).count();
        let touching = match touching {
            0 => "no contact".to_owned(),
            count => format!("contact in {count} of {}", ways().count()),
        };
        parts.push(format!(
            "retreat: at most {} off axis, {touching}",
            small_length(off_m)
        ));
    }
    (!parts.is_empty()).then(|| format!("events, worst case: {}", parts.join("; ")))
}

fn add(table: &mut Table, row: Vec<String>, texts: usize) {
    let cells = row.into_iter().enumerate().map(|(at, text)| {
        let cell = Cell::new(text);
        if at < texts {
            cell
        } else {
            cell.set_alignment(CellAlignment::Right)
        }
    });
    table.add_row(cells);
}

fn or_dash(value: Option<f64>, text: impl Fn(f64) -> String) -> String {
    value.map_or("-".to_owned(), text)
}

fn press_table(goal: &GoalReport) -> Table {
    let mut table = plain_table(&[
        "configuration",
        "contact",
        "friction",
        "engine",
        "onset\n(s)",
        "impact\n(mm/s)",
        "peak\nforce (N)",
        "settled\nforce (N)",
        "impulse\n(N s)",
        "from\nequilibrium",
        "penetration",
        "recovery\n(s)",
        "force\ndifference",
        "tip\ndifference",
    ]);
    for configuration in &goal.configurations {
        let Some(events) = &configuration.events else {
            continue;
        };
        for press in &events.press {
            if let Some(reason) = &press.not_staged {
                let row = vec![configuration.label.to_owned(), reason.clone()];
                add(&mut table, row, 2);
            }
            for (engine, measured) in &press.engines {
                let mut row = vec![
                    configuration.label.to_owned(),
                    press.solids.join(", "),
                    format!("{}", press.friction),
                    engine.clone(),
                ];
                row.extend(contact_texts(measured));
                row.push(or_dash(press.force_difference, |share| {
                    percent_with(share, 3)
                }));
                row.push(or_dash(press.tip_difference_settled_m, small_length));
                add(&mut table, row, 2);
            }
        }
    }
    table
}

fn contact_texts(measured: &PressEngineReport) -> Vec<String> {
    let first = measured.episodes.first();
    let over = |value: fn(&needlebench_evaluation::ContactEpisode) -> f64| {
        measured.episodes.iter().map(value)
    };
    vec![
        or_dash(first.map(|each| each.start_s), |s| format!("{s:.3}")),
        or_dash(first.and_then(|each| each.approach_speed_m_s), |speed| {
            format!("{:.1}", 1e3 * speed)
        }),
        format!("{:.1}", over(|each| each.peak_force_n).fold(0.0, f64::max)),
        or_dash(measured.settled_force_n, |force| format!("{force:.3}")),
        format!("{:.2}", over(|each| each.impulse_ns).sum::<f64>()),
        or_dash(measured.balance_difference, |share| percent_with(share, 3)),
        small_length(over(|each| each.deepest_penetration_m).fold(0.0, f64::max)),
        or_dash(measured.recovery_s, |s| format!("{s:.3}")),
    ]
}

fn stop_table(goal: &GoalReport) -> Table {
    let mut table = plain_table(&[
        "configuration",
        "phase",
        "category",
        "engine",
        "at (s)",
        "stopping\ntime (s)",
        "tip travel\n(mm)",
        "flange travel\n(mm)",
        "path\ndeviation (mm)",
        "minimum\nclearance (mm)",
        "certified\n(mm)",
        "worst-case tip\ntravel (mm)",
    ]);
    for configuration in &goal.configurations {
        let stop = configuration
            .events
            .as_ref()
            .and_then(|each| each.stop.as_ref());
        let Some(stop) = stop else { continue };
        for (engine, measured) in &stop.engines {
            let fine = |metres: f64| format!("{:.3}", 1e3 * metres);
            let row = vec![
                configuration.label.to_owned(),
                stop.phase.to_owned(),
                stop.category.to_string(),
                engine.clone(),
                format!("{:.3}", stop.at_s),
                or_dash(measured.stopping_time_s, |s| format!("{s:.3}")),
                fine(measured.tip_distance_m),
                fine(measured.flange_distance_m),
                fine(measured.off_path_m),
                or_dash(measured.clearance.minimum_m, millimetres),
                or_dash(measured.clearance.minimum_certified_m, millimetres),
                fine(stop.envelope.worst_tip_distance_m),
            ];
            add(&mut table, row, 2);
        }
    }
    table
}

fn retract_table(goal: &GoalReport) -> Table {
    let mut table = plain_table(&[
        "configuration",
        "engine",
        "inserted\n(mm)",
        "linear\n(mm)",
        "guide\noff axis",
        "rotation\n(urad)",
        "contacts",
        "minimum\nclearance (mm)",
        "certified\n(mm)",
    ]);
    for configuration in &goal.configurations {
        let Some(events) = &configuration.events else {
            continue;
        };
        for (engine, measured) in &events.retract {
            let row = vec![
                configuration.label.to_owned(),
                engine.clone(),
                millimetres(measured.inserted_length_m),
                millimetres(measured.straight_length_m),
                small_length(measured.largest_lateral_deviation_m),
                format!("{:.3}", 1e6 * measured.largest_angle_rad),
                measured.contacts.len().to_string(),
                or_dash(measured.clearance.minimum_m, millimetres),
                or_dash(measured.clearance.minimum_certified_m, millimetres),
            ];
            add(&mut table, row, 2);
        }
    }
    table
}
