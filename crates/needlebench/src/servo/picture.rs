//! One page per joint: steps, a sine, gain and phase.

use super::experiment::{Course, JointResponse, SMALL_RAD, STEP_S, whole};
use super::{JointReport, ServoReport};
use crate::picture::Image;
use crate::picture::flat::{Canvas, Rgb};
use crate::picture::graph::{Axis, Graph};

const PAGE: Rgb = [248, 249, 250];
const REFERENCE: Rgb = [60, 64, 70];
const LINEAR: Rgb = [170, 120, 200];
const LIMIT: Rgb = [200, 40, 40];
const CUT: Rgb = [240, 170, 60];
/// Of the engines, in the order in which they ran; told apart by width too.
const ENGINES: [Rgb; 2] = [[30, 110, 190], [220, 110, 30]];
const ENGINE_WIDTHS: [f64; 2] = [3.5, 1.4];
/// Of the sine with feed-forward.
const FED: Rgb = [40, 150, 90];

const COLUMNS: usize = 4;
const COLUMN_PX: usize = 440;
const GRAPH_PX: [usize; 2] = [350, 250];
const LEFT_PX: usize = 70;
const TOP_PX: usize = 106;
const ROW_PX: usize = 320;

/// Time steps of a step's recording.
pub(crate) fn steps_shown(timestep_s: f64) -> usize {
    whole(STEP_S / timestep_s)
}

/// The page of one joint.
pub(crate) fn page(report: &ServoReport, joint: &JointReport) -> Image {
    let mut canvas = Canvas::new(COLUMNS * COLUMN_PX + 20, TOP_PX + 2 * ROW_PX, PAGE);
    let closed = &joint.closed_loop;
    canvas.write_large(
        [20, 12],
        &format!("{}: servo of {}", joint.joint, report.scenario),
    );
    canvas.write(
        [20, 42],
        &format!(
            "inertia {:.3} kg m\u{b2}, natural {:.2} Hz, damping {:.2}, torque limit {:.0} N m",
            closed.inertia_kgm2, closed.natural_frequency_hz, closed.damping_ratio, joint.limit_nm
        ),
    );
    legend(&mut canvas, joint);
    let small: Vec<f64> = joint
        .linear_step
        .iter()
        .map(|share| share * SMALL_RAD)
        .collect();
    let sine_steps = joint
        .responses
        .first()
        .map_or(1, |each| each.sine.torque_nm.len());
    // A step is over long before its recording ends.
    let shown = steps_shown(report.timestep_s) / 2;
    let columns = [
        Column {
            name: "small step".to_owned(),
            course: |response| &response.small,
            linear_rad: Some(&small),
            shown,
        },
        Column {
            name: "large step".to_owned(),
            course: |response| &response.large,
            linear_rad: None,
            shown,
        },
        Column {
            name: format!("sine at {:.1} Hz", closed.natural_frequency_hz),
            course: |response| &response.sine,
            linear_rad: None,
            shown: sine_steps,
        },
    ];
    let milliseconds = |step: usize| step as f64 * report.timestep_s * 1e3;
    for (place, column) in columns.iter().enumerate() {
        column.draw(&mut canvas, joint, place, milliseconds);
    }
    tracked(&mut canvas, joint, sine_steps, milliseconds);
    bode(&mut canvas, joint);
    canvas.into_image()
}

fn graph(column: usize, row: usize, x: Axis, y: Axis) -> Graph {
    Graph {
        corner: [LEFT_PX + column * COLUMN_PX, TOP_PX + row * ROW_PX],
        size: GRAPH_PX,
        x,
        y,
    }
}

fn legend(canvas: &mut Canvas, joint: &JointReport) {
    let mut entries = vec![("set-point", REFERENCE)];
    for (response, color) in joint.responses.iter().zip(ENGINES) {
        entries.push((response.engine.as_str(), color));
    }
    entries.push(("linear loop", LINEAR));
    entries.push(("with feed-forward", FED));
    entries.push(("torque limit", LIMIT));
    entries.push(("cut by the limit", CUT));
    let mut left = 20;
    for (name, color) in entries {
        canvas.fill([left, 68], [22, 8], color);
        canvas.write([left + 28, 63], name);
        left += 52 + canvas.width_of(name);
    }
}

/// Motion above, torque below.
struct Column<'a> {
    name: String,
    course: fn(&JointResponse) -> &Course,
    /// The linear loop's course beside it.
    linear_rad: Option<&'a [f64]>,
    /// Time steps.
    shown: usize,
}

impl Column<'_> {
    fn draw(
        &self,
        canvas: &mut Canvas,
        joint: &JointReport,
        column: usize,
        milliseconds: impl Fn(usize) -> f64,
    ) {
        let Self {
            name,
            course,
            linear_rad,
            shown,
        } = self;
        let shown = *shown;
        let Some(first) = joint.responses.first() else {
            return;
        };
        let time = Axis::linear(0.0, milliseconds(shown));
        let milli = |value: &f64| value * 1e3;
        let all = joint.responses.iter().map(course);
        let values = all.clone().flat_map(|course| {
            course
                .motion_rad
                .iter()
                .chain(&course.reference_rad)
                .take(2 * shown)
                .map(milli)
        });
        let motion = graph(column, 0, time, Axis::around(values.chain([0.0])));
        motion.draw(canvas, &format!("{name}: motion (mrad) over time (ms)"));
        let points = |values: &[f64]| -> Vec<[f64; 2]> {
            let values = values.iter().take(shown + 1).enumerate();
            values
                .map(|(step, value)| [milliseconds(step), value * 1e3])
                .collect()
        };
        // A step of the set-point at time zero is drawn as one.
        let reference = &course(first).reference_rad;
        let mut wanted = points(reference);
        if reference[0] != 0.0 {
            wanted.insert(0, [0.0, 0.0]);
        }
        motion.curve(canvas, wanted, [1.5, 0.0], REFERENCE);
        for (index, response) in joint.responses.iter().enumerate().take(ENGINES.len()) {
            let style = [ENGINE_WIDTHS[index], 0.0];
            motion.curve(
                canvas,
                points(&course(response).motion_rad),
                style,
                ENGINES[index],
            );
        }
        if let Some(linear_rad) = linear_rad {
            motion.curve(canvas, points(linear_rad), [1.5, 5.0], LINEAR);
        }

        let torques = all.flat_map(|course| course.torque_nm.iter().take(shown).copied());
        let torques: Vec<f64> = torques.collect();
        let highest = torques
            .iter()
            .fold(0.0, |high: f64, each| high.max(each.abs()));
        // The limit is shown where the torque comes near to it.
        let near = highest > 0.6 * joint.limit_nm;
        let ends = if near {
            vec![joint.limit_nm, -joint.limit_nm]
        } else {
            Vec::new()
        };
        let torque = graph(
            column,
            1,
            time,
            Axis::around(torques.into_iter().chain(ends)),
        );
        torque.draw(canvas, "torque (N m) over time (ms)");
        for (index, response) in joint.responses.iter().enumerate().take(ENGINES.len()) {
            let course = course(response);
            let points: Vec<[f64; 2]> = course
                .torque_nm
                .iter()
                .take(shown)
                .enumerate()
                .flat_map(|(step, torque)| {
                    // Held over its step.
                    [
                        [milliseconds(step), *torque],
                        [milliseconds(step + 1), *torque],
                    ]
                })
                .collect();
            torque.curve(canvas, points, [ENGINE_WIDTHS[index], 0.0], ENGINES[index]);
            let cut = course
                .saturated
                .iter()
                .take(shown)
                .enumerate()
                .filter(|(_, cut)| **cut);
            let cut = cut.map(|(step, _)| [milliseconds(step), course.torque_nm[step]]);
            torque.marks(canvas, cut.collect::<Vec<_>>(), 2.5, CUT);
        }
        if near {
            for limit in [joint.limit_nm, -joint.limit_nm] {
                let ends = [[0.0, limit], [milliseconds(shown), limit]];
                torque.curve(canvas, ends, [1.5, 0.0], LIMIT);
            }
        }
    }
}

/// The sine with feed-forward, over the graph of the sine without.
fn tracked(
    canvas: &mut Canvas,
    joint: &JointReport,
    shown: usize,
    milliseconds: impl Fn(usize) -> f64,
) {
    let Some(first) = joint.responses.first() else {
        return;
    };
    let sines = joint.responses.iter().map(|each| &each.sine);
    let values = sines.flat_map(|course| {
        let both = course.motion_rad.iter().chain(&course.reference_rad);
        both.take(2 * shown).map(|value| value * 1e3)
    });
    let time = Axis::linear(0.0, milliseconds(shown));
    let motion = graph(2, 0, time, Axis::around(values.chain([0.0])));
    let course = first.tracked.motion_rad.iter().take(shown + 1).enumerate();
    let points: Vec<[f64; 2]> = course
        .map(|(step, value)| [milliseconds(step), value * 1e3])
        .collect();
    motion.curve(canvas, points, [1.5, 6.0], FED);
}

fn bode(canvas: &mut Canvas, joint: &JointReport) {
    let decibel = |gain: f64| 20.0 * gain.log10();
    let unwound = |phase: f64| {
        let degrees = phase.to_degrees();
        if degrees > 90.0 {
            degrees - 360.0
        } else {
            degrees
        }
    };
    let hertz = Axis {
        low: 1.0,
        high: 100.0,
        logarithmic: true,
    };
    let curve = &joint.linear_curve;
    let points = || joint.responses.iter().flat_map(|each| &each.frequencies);
    let gains = curve.iter().map(|[_, gain, _]| decibel(*gain));
    let gain = Axis::around(gains.chain(points().map(|point| decibel(point.gain))));
    let phases = curve.iter().map(|[_, _, phase]| unwound(*phase));
    let phase = Axis::around(phases.chain(points().map(|point| unwound(point.phase_rad))));
    let gain = graph(3, 0, hertz, gain);
    gain.draw(canvas, "gain (dB) over frequency (Hz)");
    let phase = graph(3, 1, hertz, phase);
    phase.draw(canvas, "phase (deg) over frequency (Hz)");
    let line = |value: fn(&[f64; 3]) -> f64| -> Vec<[f64; 2]> {
        curve.iter().map(|point| [point[0], value(point)]).collect()
    };
    gain.curve(
        canvas,
        line(|point| 20.0 * point[1].log10()),
        [1.5, 0.0],
        LINEAR,
    );
    let turned: Vec<[f64; 2]> = curve
        .iter()
        .map(|point| [point[0], unwound(point[2])])
        .collect();
    phase.curve(canvas, turned, [1.5, 0.0], LINEAR);
    for (index, response) in joint.responses.iter().enumerate().take(ENGINES.len()) {
        let radius = 5.0 - 2.5 * index as f64;
        let measured = response.frequencies.iter();
        let at = measured
            .clone()
            .map(|point| [point.frequency_hz, decibel(point.gain)]);
        gain.marks(canvas, at, radius, ENGINES[index]);
        let at = measured.map(|point| [point.frequency_hz, unwound(point.phase_rad)]);
        phase.marks(canvas, at, radius, ENGINES[index]);
    }
}
