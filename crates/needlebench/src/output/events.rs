//! Contacts, stops and ways back: tables, recordings and pictures.

use std::fmt::Write;

use comfy_table::{Cell, CellAlignment, Table};
use needlebench_cell::Goal;
use needlebench_engine::Recording;
use needlebench_evaluation::events::PressEngineReport;
use needlebench_evaluation::report::GoalReport;
use needlebench_kinematics::JOINT_LABELS;
use needlebench_planning::PressPlan;

use super::format::{millimetres, small_length};
use super::table::plain_table;
use crate::events::EventRun;
use crate::picture::Image;
use crate::picture::flat::{Canvas, Rgb};

/// What the events of a goal's configurations measured; none where none were asked for.
pub(crate) fn events_text(goal: &GoalReport) -> Option<String> {
    goal.configurations
        .iter()
        .find(|each| each.events.is_some())?;
    let mut text = String::new();
    let tables = [
        ("contacts that were asked for", press_table(goal)),
        ("emergency stop", stop_table(goal)),
        ("way back along the needle", retract_table(goal)),
    ];
    for (heading, table) in tables {
        if table.row_count() > 0 {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{heading}\n{table}");
        }
    }
    Some(text)
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

fn percent(share: f64) -> String {
    format!("{:.3} %", 100.0 * share)
}

fn press_table(goal: &GoalReport) -> Table {
    let mut table = plain_table(&[
        "configuration",
        "touching",
        "friction",
        "engine",
        "onset\n(s)",
        "at\n(mm/s)",
        "peak\n(N)",
        "settled\n(N)",
        "impulse\n(N s)",
        "off\nbalance",
        "deepest",
        "recovery\n(s)",
        "forces\ndiffer",
        "tips\ndiffer",
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
                row.push(or_dash(press.force_difference, percent));
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
        or_dash(measured.balance_difference, percent),
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
        "stands\nafter (s)",
        "tip went\n(mm)",
        "flange\n(mm)",
        "off the\npath (mm)",
        "least\n(mm)",
        "certified\n(mm)",
        "predicted worst\ntip (mm)",
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
        "needle in\n(mm)",
        "straight\n(mm)",
        "guide off\nthe axis",
        "turned by\n(urad)",
        "touches",
        "least\n(mm)",
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

/// Signed distance of the bodies that are to touch, m.
fn clearance_m(press: &PressPlan, recording: &Recording, index: usize) -> Option<f64> {
    let minima = press
        .model
        .minimum_per_class(&recording.state[index].position);
    minima
        .get(press.class)
        .map(|found| found.separation.distance_m)
}

/// Steps between two rows of a contact's recording and two points of its picture.
const STRIDE: usize = 5;

/// One row every fifth step: time, phase, contact, clearance of what is to touch, joints and torques.
///
/// Clearance is our own, of the recorded posture; force and depth are the engine's.
pub(crate) fn press_csv(goal: &Goal, press: &PressPlan, recording: &Recording) -> String {
    let mut out = String::from("time_s,phase,contact_force_n,penetration_m,clearance_m");
    out.push_str(",tip_x_m,tip_y_m,tip_z_m");
    for quantity in ["position_rad", "torque_nm"] {
        for joint in JOINT_LABELS {
            // Writing to a String cannot fail.
            let _ = write!(out, ",{joint}_{quantity}");
        }
    }
    out.push('\n');
    for index in (0..recording.state.len()).step_by(STRIDE) {
        let (state, time_s) = (&recording.state[index], recording.time_s[index]);
        let contact = &state.contact;
        let _ = write!(
            out,
            "{time_s:.6},{},{:.6},{:.9},{:.9}",
            press.trajectory.phase_at(time_s).name(),
            contact.normal_force_n,
            contact.deepest_penetration_m,
            clearance_m(press, recording, index).unwrap_or(f64::NAN)
        );
        let exit = state.world_from_flange * press.cell.tool.flange_from_guide_exit;
        let tip = exit * nalgebra::Point3::new(0.0, 0.0, goal.insertion_length_m);
        let torque = recording.torque_nm.get(index.saturating_sub(1));
        for value in tip.iter().chain(state.position.iter()) {
            let _ = write!(out, ",{value:.12}");
        }
        for joint in 0..JOINT_LABELS.len() {
            let _ = write!(out, ",{:.9}", torque.map_or(0.0, |torque| torque[joint]));
        }
        out.push('\n');
    }
    out
}

const WIDTH_PX: usize = 1000;
const PANEL_PX: usize = 260;
const LEFT_PX: usize = 110;
const RIGHT_PX: usize = 30;
const TOP_PX: usize = 84;
const GAP_PX: usize = 70;
const BOTTOM_PX: usize = 60;
const INK: Rgb = [40, 44, 52];
const GRID: Rgb = [224, 227, 232];
const PHASE: Rgb = [244, 246, 249];
/// By engine, in the order of their names' enumeration.
const CURVES: [Rgb; 2] = [[31, 119, 180], [214, 95, 14]];

/// Force and clearance of a contact over time, both engines in one picture.
pub(crate) fn press_picture(title: &str, press: &PressPlan, run: &EventRun, index: usize) -> Image {
    let height_px = TOP_PX + 2 * PANEL_PX + GAP_PX + BOTTOM_PX;
    let mut canvas = Canvas::new(WIDTH_PX, height_px, [255, 255, 255]);
    let touching = press.solids.join(" against ");
    canvas.write_large([20, 12], &format!("{title}: {touching}"));
    let recordings: Vec<(&'static str, &Recording)> = run
        .engines
        .iter()
        .filter_map(|(engine, events)| Some((engine.name(), events.press.get(index)?.as_ref()?)))
        .collect();
    for (k, (name, _)) in recordings.iter().enumerate() {
        let left = LEFT_PX + 140 * k;
        canvas.fill([left, 54], [24, 4], CURVES[k % CURVES.len()]);
        canvas.write([left + 32, 48], name);
    }
    let duration_s = press.trajectory.duration_s();
    let force: Vec<Vec<(f64, f64)>> = recordings
        .iter()
        .map(|(_, recording)| {
            let states = recording.time_s.iter().zip(&recording.state);
            states
                .map(|(time_s, state)| (*time_s, state.contact.normal_force_n))
                .collect()
        })
        .collect();
    let gap: Vec<Vec<(f64, f64)>> = recordings
        .iter()
        .map(|(_, recording)| {
            (0..recording.state.len())
                .step_by(STRIDE)
                .filter_map(|k| {
                    Some((recording.time_s[k], 1e3 * clearance_m(press, recording, k)?))
                })
                .collect()
        })
        .collect();
    let panels = [
        ("normal force (N)", force, TOP_PX),
        ("clearance (mm)", gap, TOP_PX + PANEL_PX + GAP_PX),
    ];
    for (label, series, top) in panels {
        panel(&mut canvas, label, &series, top, duration_s, press);
    }
    let middle = LEFT_PX + (WIDTH_PX - LEFT_PX - RIGHT_PX) / 2;
    canvas.write_centred([middle, height_px - 28], "time (s)");
    canvas.into_image()
}

/// Axes, phases and curves.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "pixels of values within the axes"
)]
fn panel(
    canvas: &mut Canvas,
    label: &str,
    series: &[Vec<(f64, f64)>],
    top: usize,
    duration_s: f64,
    press: &PressPlan,
) {
    let width = WIDTH_PX - LEFT_PX - RIGHT_PX;
    let values = || series.iter().flatten().map(|(_, value)| *value);
    let most = values().fold(0.0_f64, f64::max);
    let least = values().fold(0.0_f64, f64::min);
    let step = tick_step(most - least);
    let (low, high) = ((least / step).floor() * step, (most / step).ceil() * step);
    let high = if high > low { high } else { low + step };
    let x_of = |time_s: f64| {
        let share = (time_s / duration_s).clamp(0.0, 1.0);
        LEFT_PX + (share * (width - 1) as f64).round() as usize
    };
    let y_of = |value: f64| {
        let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
        top + ((1.0 - share) * (PANEL_PX - 1) as f64).round() as usize
    };
    for (k, (phase, start_s, end_s)) in press.trajectory.phases().into_iter().enumerate() {
        let (from, to) = (x_of(start_s), x_of(end_s));
        if k % 2 == 1 {
            canvas.fill([from, top], [to - from, PANEL_PX], PHASE);
        }
        canvas.write([from + 6, top + 4], phase.name());
    }
    let ticks = ((high - low) / step).round() as usize;
    for k in 0..=ticks {
        let value = low + step * k as f64;
        let y = y_of(value);
        canvas.fill([LEFT_PX, y], [width, 1], GRID);
        let digits = if step < 0.5 { 1 } else { 0 };
        let text = format!("{value:.digits$}");
        let text_left = LEFT_PX - 10 - canvas.width_of(&text);
        canvas.write([text_left, y.saturating_sub(8)], &text);
    }
    let seconds = tick_step(duration_s);
    let mut time_s = 0.0;
    while time_s <= duration_s {
        let x = x_of(time_s);
        canvas.fill([x, top + PANEL_PX], [1, 5], INK);
        canvas.write_centred([x, top + PANEL_PX + 8], &format!("{time_s:.1}"));
        time_s += seconds;
    }
    canvas.write([LEFT_PX, top - 22], label);
    canvas.frame([LEFT_PX, top], [width, PANEL_PX], INK);
    for (k, points) in series.iter().enumerate() {
        for pair in points.windows(2) {
            let ends = [pair[0], pair[1]].map(|(time_s, value)| (x_of(time_s), y_of(value)));
            let (upper, lower) = (ends[0].1.min(ends[1].1), ends[0].1.max(ends[1].1));
            let from = ends[0].0;
            let across = (ends[1].0 - from).max(1);
            canvas.fill([from, ends[0].1], [across, 2], CURVES[k % CURVES.len()]);
            canvas.fill(
                [ends[1].0, upper],
                [2, lower - upper + 2],
                CURVES[k % CURVES.len()],
            );
        }
    }
}

/// 1, 2 or 5 times a power of ten, for four to ten ticks over a range.
fn tick_step(range: f64) -> f64 {
    if range <= 0.0 {
        return 1.0;
    }
    let power = 10_f64.powf((range / 5.0).log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|each| each * power)
        .find(|step| range / step <= 10.0)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        for (range, step) in [
            (0.9, 0.1),
            (1.7, 0.2),
            (4.0, 0.5),
            (90.0, 10.0),
            (230.0, 50.0),
        ] {
            let found = tick_step(range);
            assert!((found / step - 1.0).abs() < 1e-9, "{range}: {found}");
        }
    }
}
