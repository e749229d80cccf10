//! Motions as tables: a column for the time and one for each joint, as `export --as trajectory` writes them.

use needlebench_input::{Finding, Separator};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, JOINT_NAMES, Joints};

use super::Points;

/// The first line that is neither empty nor a comment, with its place.
pub(super) fn header(text: &str) -> Option<(usize, &str)> {
    lines(text).next()
}

/// Lines with content, with their places in bytes.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut place = 0;
    let all = text.split_inclusive('\n').map(move |line| {
        let begins = place;
        place += line.len();
        (begins, line.trim())
    });
    all.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Whether a table is a log of RTDE: `target_q_0` or `actual_q_0` are columns.
pub(super) fn is_log(text: &str) -> bool {
    header(text)
        .is_some_and(|(_, header)| header.contains("target_q") || header.contains("actual_q"))
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    /// Whole seconds, or seconds; with a factor to nanoseconds.
    Time(TimePart),
    /// Position, velocity or acceleration (0, 1, 2) of a joint.
    Joint(usize, usize),
    /// Something else.
    Other,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TimePart {
    Seconds,
    Nanoseconds,
    Milliseconds,
}

/// Names of quantities after a joint's name, by derivative.
const QUANTITIES: [&[&str]; 3] = [
    &["", "position", "pos", "q", "rad"],
    &["velocity", "vel", "qd", "rad_s"],
    &["acceleration", "acc", "qdd", "rad_s2"],
];

const HINT: &str = "the first line names the columns: time_s, then shoulder_pan_joint, shoulder_lift_joint and so on, \
                    with _velocity and _acceleration for these";

/// What a column is by its name; the error is a unit that is refused.
fn column(name: &str) -> Result<Column, &'static str> {
    let name = name.to_ascii_lowercase().replace(['.', '/', ' '], "_");
    match name.as_str() {
        "time"
        | "t"
        | "time_s"
        | "t_s"
        | "time_from_start"
        | "time_from_start_s"
        | "time_from_start_sec" => return Ok(Column::Time(TimePart::Seconds)),
        "time_from_start_nanosec" => return Ok(Column::Time(TimePart::Nanoseconds)),
        "time_ms" | "t_ms" => return Ok(Column::Time(TimePart::Milliseconds)),
        _ => {}
    }
    let joint = JOINT_NAMES
        .iter()
        .zip(JOINT_LABELS)
        .position(|(long, short)| name.contains(long) || name.contains(short));
    let Some(joint) = joint else {
        return Ok(Column::Other);
    };
    let words = [JOINT_NAMES[joint], JOINT_LABELS[joint]];
    let rest = words.iter().find_map(|word| name.split_once(word));
    let (_, rest) = rest.unwrap_or_default();
    let rest = rest.trim_matches('_');
    if rest == "deg" || rest.ends_with("_deg") || rest.contains("deg_s") {
        return Err("degrees");
    }
    let unitless = ["_rad", "_rad_s", "_rad_s2"]
        .iter()
        .find_map(|unit| rest.strip_suffix(unit));
    let rest = unitless.unwrap_or(rest);
    let derivative = QUANTITIES.iter().position(|names| names.contains(&rest));
    Ok(derivative.map_or(Column::Other, |derivative| Column::Joint(derivative, joint)))
}

/// The joint whose position a column holds by its name; the error is a unit that is refused.
pub(crate) fn position_of_joint(name: &str) -> Result<Option<usize>, &'static str> {
    Ok(match column(name)? {
        Column::Joint(0, joint) => Some(joint),
        _ => None,
    })
}

pub(super) fn read(file: &str, text: &str) -> Result<Points, Vec<Finding>> {
    let one = |finding: Finding| vec![finding];
    let Some((place, line)) = header(text) else {
        return Err(one(Finding::new(file, "the file is empty").hint(HINT)));
    };
    let at = |place: usize, message: String| Finding::new(file, message).at(text, place..place);
    let separator = Separator::of_header(line);
    let names: Vec<&str> = separator.cells(line).collect();
    let mut columns = Vec::with_capacity(names.len());
    for name in &names {
        columns.push(column(name).map_err(|unit| {
            let finding = at(place, format!("the column `{name}` is in {unit}"));
            one(finding
                .key(*name)
                .hint("motions are in radians, rad/s and rad/s^2"))
        })?);
    }
    let mut seen: Vec<Column> = Vec::new();
    for (column, name) in columns.iter().zip(&names) {
        if *column != Column::Other && seen.contains(column) {
            let finding = at(place, format!("a second column of what `{name}` is"));
            return Err(one(finding.key(*name)));
        }
        seen.push(*column);
    }
    let has = |derivative: usize| {
        (0..JOINT_COUNT)
            .filter(|joint| columns.contains(&Column::Joint(derivative, *joint)))
            .count()
    };
    for derivative in 0..3 {
        let count = has(derivative);
        if count == JOINT_COUNT || derivative > 0 && count == 0 {
            continue;
        }
        let joints =
            (0..JOINT_COUNT).filter(|joint| !columns.contains(&Column::Joint(derivative, *joint)));
        let missing: Vec<&str> = joints.map(|joint| JOINT_NAMES[joint]).collect();
        let what = ["position", "velocity", "acceleration"][derivative];
        let message = if count == 0 {
            "no column names a joint of the arm".to_owned()
        } else {
            format!("no {what} of {}", missing.join(", "))
        };
        return Err(one(at(place, message).hint(HINT)));
    }
    let is_timed = columns
        .iter()
        .any(|column| matches!(column, Column::Time(_)));
    let others: Vec<&str> = columns
        .iter()
        .zip(&names)
        .filter(|(column, _)| **column == Column::Other)
        .map(|(_, name)| *name)
        .collect();
    let mut points = Points {
        format: "table",
        times_s: Vec::new(),
        values: [Vec::new(), Vec::new(), Vec::new()],
        places: Vec::new(),
        notes: Vec::new(),
    };
    if !others.is_empty() {
        points
            .notes
            .push(format!("columns that are not read: {}", others.join(", ")));
    }
    if !is_timed {
        points.notes.push(
            "no column is the time: the rows are way points, and get times from the arm's limits"
                .to_owned(),
        );
    }
    let has = [true, has(1) > 0, has(2) > 0];
    for (place, line) in lines(text).skip(1) {
        let cells: Vec<&str> = separator.cells(line).collect();
        if cells.len() != names.len() {
            let message = format!("{} values for {} columns", cells.len(), names.len());
            return Err(one(at(place, message).hint("is the line cut off?")));
        }
        let mut time_ns = 0.0;
        let mut row = [Joints::zeros(); 3];
        for ((cell, column), name) in cells.iter().zip(&columns).zip(&names) {
            if *column == Column::Other {
                continue;
            }
            let cell = if separator.allows_decimal_comma() {
                cell.replace(',', ".")
            } else {
                (*cell).to_owned()
            };
            let Ok(value) = cell.parse::<f64>() else {
                let finding = at(place, format!("`{cell}` is no number"));
                return Err(one(finding.key(*name)));
            };
            match *column {
                Column::Time(TimePart::Seconds) => time_ns += value * 1e9,
                Column::Time(TimePart::Milliseconds) => time_ns += value * 1e6,
                Column::Time(TimePart::Nanoseconds) => time_ns += value,
                Column::Joint(derivative, joint) => row[derivative][joint] = value,
                Column::Other => {}
            }
        }
        if is_timed {
            points.times_s.push(time_ns / 1e9);
        }
        for (derivative, joints) in row.into_iter().enumerate().filter(|(k, _)| has[*k]) {
            points.values[derivative].push(joints);
        }
        points.places.push(place);
    }
    Ok(points)
}
