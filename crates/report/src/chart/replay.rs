//! A recorded run beside its replay: errors, torques and currents over time.

use needlebench_bench::replay::{Course, Replay};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS};
use needlebench_show::chart::{Axis, Chart, Overlay, Paint, Panel, Sample, Stroke, legend};

/// Wider than the engines' curves, which are drawn over it and leave a rim of it to be seen.
const REAL: Stroke = Stroke {
    paint: Paint::Soft,
    width: 5.0,
    dash: None,
};

const LEFT_PX: f64 = 84.0;
const TOP_PX: f64 = 106.0;
const COLUMNS: usize = 3;
const COLUMN_PX: f64 = 500.0;
const ROW_PX: f64 = 244.0;
const PANEL_PX: [f64; 2] = [400.0, 180.0];

/// Upright strips of a panel, each drawn by its lowest and highest value.
const STRIPS: usize = 400;

/// Errors from the set-points, torques and currents of all joints.
pub(crate) fn replay_chart(replay: &Replay) -> Chart {
    let title = format!(
        "{}: the real arm and its replay",
        replay.report.log.source.file
    );
    let size = [
        LEFT_PX + COLUMNS as f64 * COLUMN_PX - 60.0,
        TOP_PX + JOINT_COUNT as f64 * ROW_PX,
    ];
    let mut chart = Chart::new(size, &*title);
    chart.write_large([20.0, 24.0], title);
    let overlay = Overlay {
        count: replay.courses.len(),
    };
    let mut entries = Vec::new();
    if replay.report.real.is_some() {
        entries.push((Sample::Line(REAL), "real arm"));
    }
    for (index, (engine, _)) in replay.courses.iter().enumerate() {
        entries.push((Sample::Line(overlay.stroke(index)), *engine));
    }
    legend(&mut chart, [20.0, 56.0], size[0] - 40.0, entries);
    for joint in 0..JOINT_COUNT {
        row(&mut chart, replay, overlay, joint);
    }
    chart
}

/// A number of the real arm, by row.
type OfRow<'a> = Box<dyn Fn(usize) -> f64 + 'a>;

/// A number of an engine, by row.
type OfCourse<'a> = Box<dyn Fn(&Course, usize) -> f64 + 'a>;

/// What is shown of a real arm and of an engine, by row.
struct Column<'a> {
    label: &'static str,
    what: &'static str,
    real: Option<OfRow<'a>>,
    engine: Option<OfCourse<'a>>,
}

fn columns(replay: &Replay, joint: usize) -> [Column<'_>; COLUMNS] {
    let run = &replay.run;
    let target = run.target.as_ref().filter(|_| replay.report.real.is_some());
    let moment = run.target_moment_nm.as_ref();
    let current = run.actual_current_a.as_ref();
    let constant = replay.torque_constants_nm_a[joint];
    [
        Column {
            label: "error (mrad)",
            what: "angle minus set-point",
            real: target.map(|target| -> OfRow<'_> {
                Box::new(move |row| (run.actual_q[row][joint] - target[row].position[joint]) * 1e3)
            }),
            engine: Some(Box::new(move |course, row| course.error[row][joint] * 1e3)),
        },
        Column {
            label: "torque (N m)",
            what: "at the links; real arm: target_moment",
            real: moment.map(|moment| -> OfRow<'_> { Box::new(move |row| moment[row][joint]) }),
            engine: Some(Box::new(move |course, row| course.link_nm[row][joint])),
        },
        Column {
            label: "current (A)",
            what: "of the motor, measured",
            real: current.map(|current| -> OfRow<'_> { Box::new(move |row| current[row][joint]) }),
            engine: constant.map(|constant| -> OfCourse<'_> {
                Box::new(move |course, row| course.motor_nm[row][joint] / constant)
            }),
        },
    ]
}

fn row(chart: &mut Chart, replay: &Replay, overlay: Overlay, joint: usize) {
    let run = &replay.run;
    let start_s = run.time_s[0];
    let time = |row: usize| run.time_s[row] - start_s;
    let rows = run.len();
    let last = joint + 1 == JOINT_COUNT;
    for (place, column) in columns(replay, joint).into_iter().enumerate() {
        let real = column
            .real
            .map(|real| strips(rows, &|row| [time(row), real(row)]));
        let engines: Vec<Vec<[f64; 2]>> = column.engine.map_or(Vec::new(), |engine| {
            let of = |course: &Course| strips(rows, &|row| [time(row), engine(course, row)]);
            replay
                .courses
                .iter()
                .map(|(_, course)| of(course))
                .collect()
        });
        let all = real.iter().flatten().chain(engines.iter().flatten());
        let panel = Panel {
            corner: [
                LEFT_PX + place as f64 * COLUMN_PX,
                TOP_PX + joint as f64 * ROW_PX,
            ],
            size: PANEL_PX,
            title: format!("{}: {}", JOINT_LABELS[joint], column.what),
            x: Axis::linear(if last { "time (s)" } else { "" }, 0.0, time(rows - 1)),
            y: Axis::around(column.label, all.map(|[_, value]| *value)),
        };
        panel.draw(chart);
        // The real arm's noise would hide the engines.
        panel.curve(chart, real.unwrap_or_default(), REAL);
        for (index, points) in engines.into_iter().enumerate() {
            panel.curve(chart, points, overlay.stroke(index));
        }
    }
}

/// Points of a course, of which long ones have the lowest and highest of each strip.
fn strips(rows: usize, of: &dyn Fn(usize) -> [f64; 2]) -> Vec<[f64; 2]> {
    if rows <= 4 * STRIPS {
        return (0..rows).map(of).collect();
    }
    let mut points = Vec::with_capacity(2 * STRIPS);
    for strip in 0..STRIPS {
        let strip = strip * rows / STRIPS..(strip + 1) * rows / STRIPS;
        let finite = strip.map(of).filter(|point| point[1].is_finite());
        let (mut low, mut high): (Option<[f64; 2]>, Option<[f64; 2]>) = (None, None);
        for point in finite {
            if low.is_none_or(|low| point[1] < low[1]) {
                low = Some(point);
            }
            if high.is_none_or(|high| point[1] > high[1]) {
                high = Some(point);
            }
        }
        let mut pair: Vec<[f64; 2]> = low.into_iter().chain(high).collect();
        pair.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points.extend(pair);
    }
    points
}
