//! Whether a log is what it seems: units, clock, gaps, modes, and whether an arm stands behind it.

use std::ops::Range;

use needlebench_input::Finding;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints};

use crate::derivative::slopes;
use crate::raw::RawLog;
use crate::run::{Effort, Load, LogKind, LogSource};
use crate::{EffortMeaning, Quantity, ReadOptions, RecordedRun};

/// No joint of a UR arm but the last one of an e-Series turns farther than 363 degrees, rad.
const FARTHEST_RAD: f64 = 7.0;

/// Larger angles are taken to be in degrees, rad.
const FARTHEST_ENDLESS_RAD: f64 = 400.0;

/// Rows farther apart are no recording of a motion, s: the clock has another unit.
const SLOWEST_S: f64 = 1.0;

/// A step of the clock of more than this many usual ones is a gap.
const GAP: f64 = 2.5;

/// A jump of the clock beyond this is no gap: another clock goes on, s.
const OTHER_CLOCK_S: f64 = 86_400.0;

/// Fewest rows of which anything can be said.
const FEWEST_ROWS: usize = 20;

/// Speed above which a joint moves, rad/s.
const MOVING_RAD_S: f64 = 0.01;

/// Angles change by their speeds times the time: a clock or a unit that is off by more shows, as a
/// share. At 25 Hz the trapezoid over a ramp of a UR arm is within 0.002.
const CLOCK_SLACK: f64 = 0.05;

/// Makes a run of what a file has.
pub(crate) fn checked(
    file: &str,
    sha256: String,
    format: &'static str,
    mut raw: RawLog,
    options: &ReadOptions,
) -> Result<RecordedRun, Vec<Finding>> {
    let refuse = |line: Option<u32>, message: String, hint: &str| {
        let mut finding = Finding::new(file, message).hint(hint);
        finding.line = line.and_then(|line| usize::try_from(line).ok());
        vec![finding]
    };
    if options.columns.is_some() && (options.time.is_some() || options.angle.is_some()) {
        return Err(vec![
            Finding::new("the command line", "units are specified twice")
                .key("--time-unit, --angle-unit")
                .hint("with --columns, the table of columns defines the units"),
        ]);
    }
    raw.sift();
    let usable: Vec<usize> = (0..raw.rows())
        .filter(|row| raw.cut[*row].is_none())
        .collect();
    if usable.len() < FEWEST_ROWS {
        let mut findings = refuse(
            None,
            format!(
                "too few usable rows: {} of {}",
                usable.len(),
                raw.rows_in_file
            ),
            "the log must contain a motion; rows left out are listed below",
        );
        findings.extend(
            raw.notes
                .iter()
                .map(|note| Finding::new(file, note.clone())),
        );
        return Err(findings);
    }
    let lines: Vec<u32> = usable.iter().map(|row| raw.line[*row]).collect();
    let mut notes = std::mem::take(&mut raw.notes);
    let kept = usable.len() < raw.rows();
    let mut take = |quantity: Quantity| -> Option<Vec<f64>> {
        let values = raw.values.remove(&quantity)?;
        let width = quantity.width();
        if !kept {
            return Some(values);
        }
        Some(
            usable
                .iter()
                .flat_map(|row| values[row * width..][..width].iter().copied())
                .collect(),
        )
    };
    let time_s = match options.rate_hz {
        Some(rate_hz) => usable.iter().map(|row| *row as f64 / rate_hz).collect(),
        None => take(Quantity::Time)
            .ok_or_else(|| refuse(None, "the log has no clock".to_owned(), "give --rate HZ"))?,
    };
    let (keep, time_s) = clock(&time_s, &lines, options, &mut notes)
        .map_err(|(line, message, hint)| refuse(line, message, hint))?;
    let mut joints = |quantity: Quantity| -> Option<Vec<Joints>> {
        let values = take(quantity)?;
        let (rows, _) = values.as_chunks::<JOINT_COUNT>();
        Some(keep.iter().map(|row| Joints::from(rows[*row])).collect())
    };
    let actual_q = joints(Quantity::ActualQ).expect("a log without is refused");
    let target_q = joints(Quantity::TargetQ);
    let actual_qd = joints(Quantity::ActualQd);
    for (name, values) in [
        ("actual_q", Some(&actual_q)),
        ("target_q", target_q.as_ref()),
    ] {
        if let Some(values) = values {
            angles(name, values, &keep, &lines).map_err(|(line, message)| {
                refuse(
                    Some(line),
                    message,
                    "if the angles are in degrees, give --angle-unit deg",
                )
            })?;
        }
    }
    let rows_of = |row: usize| usable[keep[row]];
    let stretches = stretches(&time_s, &lines, &rows_of, &keep, &mut notes);
    let qd = joints(Quantity::TargetQd);
    let qdd = joints(Quantity::TargetQdd);
    let speeds = match (&qd, &target_q) {
        (Some(qd), Some(q)) => Some(("target_qd", q, qd)),
        _ => actual_qd.as_ref().map(|qd| ("actual_qd", &actual_q, qd)),
    };
    if let Some((name, q, qd)) = speeds {
        pace(name, &time_s, q, qd, &stretches)
            .map_err(|(message, hint)| refuse(None, message, hint))?;
    }
    let target = target_q.map(|q| target(&time_s, q, qd, qdd, &stretches, &mut notes));
    let target_moment_nm = joints(Quantity::TargetMoment);
    let target_current_a = joints(Quantity::TargetCurrent);
    let actual_current_a = joints(Quantity::ActualCurrent);
    let effort = match options.effort {
        Some(EffortMeaning::Compensated) => Effort::Compensated,
        _ => Effort::Torque,
    };
    let effort_nm = joints(Quantity::ActualTorque).map(|values| (values, effort));
    let tcp = joints(Quantity::ActualTcp)
        .map(|poses| poses.into_iter().map(Into::into).collect::<Vec<[f64; 6]>>());
    let loads = {
        let mass = take(Quantity::Payload);
        let centre = take(Quantity::PayloadCog);
        let inertia = take(Quantity::PayloadInertia);
        loads(mass, centre, inertia.as_deref(), &keep)
    };
    let currents = [target_current_a.as_deref(), actual_current_a.as_deref()];
    let (kind, signs) = SimulatorSigns::of(&raw, &actual_q, target.as_deref(), currents).judge();
    notes.extend(signs);
    if target.is_none() {
        notes.push(
            "the log has no target_q: it can be used for calibration, but there is nothing to replay"
                .to_owned(),
        );
    }
    Ok(RecordedRun {
        source: LogSource {
            file: file.to_owned(),
            sha256,
            format,
            rows_in_file: raw.rows_in_file,
            rows: actual_q.len(),
        },
        time_s,
        target,
        actual_q,
        actual_qd,
        target_moment_nm,
        target_current_a,
        actual_current_a,
        effort_nm,
        tcp,
        loads,
        stretches,
        kind,
        temperature_c: raw.temperature_c,
        notes,
    })
}

type Refusal = (Option<u32>, String, &'static str);

/// Rows whose time is after the row before, and their times.
fn clock(
    time_s: &[f64],
    lines: &[u32],
    options: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<(Vec<usize>, Vec<f64>), Refusal> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if let Some(at) = steps.iter().position(|step| *step < 0.0) {
        return Err((
            Some(lines[at + 1]),
            format!("the clock goes back by {:.6} s", -steps[at]),
            "two clocks, or two recordings in one file: split it, name one clock with \
             --time-column, or give --rate HZ if rows are evenly spaced",
        ));
    }
    let standing = steps.iter().filter(|step| **step == 0.0).count();
    if 4 * standing > steps.len() {
        return Err((
            None,
            format!(
                "the clock does not advance between {standing} of {} rows: too few digits",
                time_s.len()
            ),
            "record it with more digits, or give --rate HZ if rows are evenly spaced",
        ));
    }
    let keep: Vec<usize> = (0..time_s.len())
        .filter(|row| *row == 0 || time_s[*row] > time_s[row - 1])
        .collect();
    if standing > 0 {
        notes.push(format!(
            "{standing} rows left out: same time as the row before"
        ));
    }
    steps.retain(|step| *step > 0.0);
    if let Some(at) = time_s
        .windows(2)
        .position(|pair| pair[1] - pair[0] > OTHER_CLOCK_S)
    {
        return Err((
            Some(lines[at + 1]),
            format!("the clock jumps by {:.0} s", time_s[at + 1] - time_s[at]),
            "two clocks, or two recordings in one file: split it, or give --rate HZ if rows are \
             evenly spaced",
        ));
    }
    let middle = steps.len() / 2;
    let median_s = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    if median_s > SLOWEST_S && options.time.is_none() && options.columns.is_none() {
        return Err((
            None,
            format!("the row interval is {median_s} s if the clock is in seconds"),
            "if it is in milliseconds, give --time-unit ms (or us, ns; s if seconds are right)",
        ));
    }
    let times = keep.iter().map(|row| time_s[*row]).collect();
    Ok((keep, times))
}

/// Rejects angles that no arm has.
fn angles(
    name: &str,
    values: &[Joints],
    keep: &[usize],
    lines: &[u32],
) -> Result<(), (u32, String)> {
    for (row, q) in values.iter().enumerate() {
        for (joint, value) in q.iter().enumerate() {
            let last = joint + 1 == JOINT_COUNT;
            let farthest = if last {
                FARTHEST_ENDLESS_RAD
            } else {
                FARTHEST_RAD
            };
            if value.abs() > farthest {
                let message = format!(
                    "{name} of {} is {value}, {:.0} turns if it is in radians",
                    JOINT_LABELS[joint],
                    value.abs() / std::f64::consts::TAU
                );
                return Err((lines[keep[row]], message));
            }
        }
    }
    Ok(())
}

/// Rows between gaps, and between rows that were left out.
fn stretches(
    time_s: &[f64],
    lines: &[u32],
    row_in_file: &dyn Fn(usize) -> usize,
    keep: &[usize],
    notes: &mut Vec<String>,
) -> Vec<Range<usize>> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    let median_s = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let mut stretches = Vec::new();
    let mut from = 0;
    let mut gaps: Vec<(f64, u32)> = Vec::new();
    for row in 1..time_s.len() {
        let step_s = time_s[row] - time_s[row - 1];
        let gap = step_s > GAP * median_s;
        let left_out = row_in_file(row) > row_in_file(row - 1) + 1 && step_s > 1.5 * median_s;
        if gap || left_out {
            stretches.push(from..row);
            from = row;
        }
        if gap && row_in_file(row) == row_in_file(row - 1) + 1 {
            gaps.push((step_s, lines[keep[row]]));
        }
    }
    stretches.push(from..time_s.len());
    if let Some((longest_s, line)) = gaps.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)) {
        notes.push(format!(
            "{} gap{} in the clock, the longest {longest_s:.3} s before line {line} (row interval \
             {median_s:.4} s): not filled, motions end there",
            gaps.len(),
            if gaps.len() == 1 { "" } else { "s" }
        ));
    }
    stretches
}

/// Compares angles with speeds times time.
fn pace(
    name: &str,
    time_s: &[f64],
    q: &[Joints],
    qd: &[Joints],
    stretches: &[Range<usize>],
) -> Result<(), (String, &'static str)> {
    let (mut both, mut square) = (0.0, 0.0);
    for rows in stretches {
        for row in rows.start + 1..rows.end {
            let h = time_s[row] - time_s[row - 1];
            for joint in 0..JOINT_COUNT {
                let way = 0.5 * h * (qd[row][joint] + qd[row - 1][joint]);
                if (way / h).abs() > MOVING_RAD_S {
                    both += way * (q[row][joint] - q[row - 1][joint]);
                    square += way * way;
                }
            }
        }
    }
    if square == 0.0 {
        return Ok(());
    }
    let ratio = both / square;
    if (ratio - 1.0).abs() <= CLOCK_SLACK {
        return Ok(());
    }
    let message = format!("angles change {ratio:.4} times as fast as {name}");
    let near = |wanted: f64| (ratio / wanted - 1.0).abs() < CLOCK_SLACK;
    let hint = if near(180.0 / std::f64::consts::PI) {
        "angles are in degrees and speeds in radians: give the unit of each column with --columns MAP.toml"
    } else if near(std::f64::consts::PI / 180.0) {
        "speeds are in degrees and angles in radians: give the unit of each column with --columns MAP.toml"
    } else if near(1e-3) {
        "the clock is in milliseconds: give --time-unit ms"
    } else if near(1e3) {
        "the clock is not in milliseconds: omit --time-unit, or give s"
    } else {
        "the clock does not match the motion: two clocks, a wrong unit, or a replay at another speed; \
         name another clock with --time-column, or give --rate HZ if rows are evenly spaced"
    };
    Err((message, hint))
}

/// Set-points with speeds and accelerations, which are taken from the angles where they are missing.
fn target(
    time_s: &[f64],
    q: Vec<Joints>,
    qd: Option<Vec<Joints>>,
    qdd: Option<Vec<Joints>>,
    stretches: &[Range<usize>],
    notes: &mut Vec<String>,
) -> Vec<JointState> {
    let qd = qd.unwrap_or_else(|| {
        notes.push("no target_qd in the log: speeds are derivatives of target_q".to_owned());
        slopes(time_s, &q, stretches)
    });
    let qdd = qdd.unwrap_or_else(|| {
        notes.push(
            "no target_qdd in the log: accelerations are derivatives of the set-point speeds"
                .to_owned(),
        );
        slopes(time_s, &qd, stretches)
    });
    q.into_iter()
        .zip(qd)
        .zip(qdd)
        .map(|((position, velocity), acceleration)| JointState {
            position,
            velocity,
            acceleration,
        })
        .collect()
}

/// Loads, each from a row on.
fn loads(
    mass: Option<Vec<f64>>,
    centre: Option<Vec<f64>>,
    inertia: Option<&[f64]>,
    keep: &[usize],
) -> Vec<(usize, Load)> {
    let Some(mass) = mass else {
        return Vec::new();
    };
    let centre = centre.unwrap_or_else(|| vec![0.0; 3 * mass.len()]);
    let mut loads: Vec<(usize, Load)> = Vec::new();
    for (row, at) in keep.iter().enumerate() {
        let load = Load {
            mass_kg: mass[*at],
            centre_m: [centre[3 * at], centre[3 * at + 1], centre[3 * at + 2]],
            inertia_kgm2: std::array::from_fn(|k| {
                inertia.map_or(0.0, |inertia| inertia[6 * at + k])
            }),
        };
        if loads.last().is_none_or(|(_, last)| *last != load) {
            loads.push((row, load));
        }
    }
    loads
}

/// What of a log no real arm does while it moves; the first of them, by itself, makes it a simulator's.
struct SimulatorSigns {
    /// Encoders have noise, and a servo an error.
    angles_are_set_points: bool,
    /// The others, in words.
    others: Vec<String>,
}

impl SimulatorSigns {
    fn of(
        raw: &RawLog,
        actual: &[Joints],
        target: Option<&[JointState]>,
        currents: [Option<&[Joints]>; 2],
    ) -> Self {
        let moves = match target {
            Some(target) => target
                .iter()
                .any(|state| state.velocity.amax() > MOVING_RAD_S),
            None => actual.windows(2).any(|pair| pair[0] != pair[1]),
        };
        let mut signs = Self {
            angles_are_set_points: false,
            others: Vec::new(),
        };
        if !moves {
            return signs;
        }
        signs.angles_are_set_points = target.is_some_and(|target| {
            actual
                .iter()
                .zip(target)
                .all(|(q, state)| *q == state.position)
        });
        if let [Some(asked), Some(measured)] = currents
            && asked == measured
        {
            signs
                .others
                .push("measured currents equal the target currents bit for bit".to_owned());
        }
        let constant = |range: Option<[f64; 2]>| {
            range
                .filter(|[low, high]| low == high)
                .map(|[value, _]| value)
        };
        if let Some(current_a) = constant(raw.robot_current_a) {
            signs
                .others
                .push(format!("the robot current is {current_a} A in every row"));
        }
        if let Some([_, 0.0]) = raw.main_voltage_v {
            signs.others.push("the main voltage is 0 V".to_owned());
        }
        if let Some(degrees) = constant(raw.temperature_c) {
            signs.others.push(format!(
                "all joints are at {degrees} degrees C in every row"
            ));
        }
        signs
    }

    /// Whether it is a simulator's, and what says so.
    fn judge(self) -> (LogKind, Option<String>) {
        /// One alone may be a log's own: a column that was filled in.
        const ENOUGH: usize = 2;
        let Self {
            angles_are_set_points,
            mut others,
        } = self;
        if angles_are_set_points {
            others.insert(
                0,
                "measured angles equal the set-points bit for bit".to_owned(),
            );
        } else if others.len() < ENOUGH {
            return (LogKind::Arm, None);
        }
        let note = format!(
            "simulator log: {}; it describes the controller's model, not an arm",
            others.join(", ")
        );
        (LogKind::Simulator, Some(note))
    }
}
