//! The servo of a joint: steps, a sine, gain and phase.

use needlebench_bench::servo::experiment::{Course, JointResponse, SMALL_RAD, steps_shown};
use needlebench_bench::servo::{JointReport, ServoReport};
use needlebench_show::chart::{Anchor, Axis, Chart, Overlay, Paint, Panel, Sample, Stroke, legend};

/// The engines take the first colours of the series; these come from its end.
const LINEAR: Stroke = Stroke {
    paint: Paint::Fixed([150, 90, 190]),
    width: 1.6,
    dash: Some([5.0, 4.0]),
};
/// Of the sine with feed-forward.
const FED: Stroke = Stroke {
    paint: Paint::Fixed([20, 120, 70]),
    width: 1.6,
    dash: Some([2.0, 3.0]),
};
const REFERENCE: Stroke = Stroke {
    paint: Paint::Ink,
    width: 1.4,
    dash: None,
};
const LIMIT: Stroke = Stroke {
    paint: Paint::Limit,
    width: 1.6,
    dash: Some([8.0, 4.0]),
};
const CUT: Paint = Paint::Series(5);
const CUT_RADIUS: f64 = 2.6;

const COLUMNS: usize = 4;
const COLUMN_PX: f64 = 450.0;
const PANEL_PX: [f64; 2] = [350.0, 230.0];
const LEFT_PX: f64 = 84.0;
const TOP_PX: f64 = 122.0;
const ROW_PX: f64 = 318.0;

/// The chart of one joint.
pub(crate) fn servo_chart(report: &ServoReport, joint: &JointReport) -> Chart {
    let title = format!("{}: servo of {}", joint.joint, report.scenario);
    let size = [
        COLUMNS as f64 * COLUMN_PX + 16.0,
        TOP_PX + 2.0 * ROW_PX - 20.0,
    ];
    let mut chart = Chart::new(size, &*title);
    let closed = &joint.closed_loop;
    chart.write_large([20.0, 24.0], title);
    chart.write(
        Anchor::Start,
        [20.0, 50.0],
        format!(
            "inertia {:.3} kg m\u{b2}, natural frequency {:.2} Hz, damping ratio {:.2}, torque \
             limit {:.0} N m",
            closed.inertia_kgm2, closed.natural_frequency_hz, closed.damping_ratio, joint.limit_nm
        ),
    );
    let drawing = Drawing {
        joint,
        overlay: Overlay {
            count: joint.responses.len(),
        },
        timestep_ms: report.timestep_s * 1e3,
    };
    drawing.legend(&mut chart);
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
            fed: None,
            shown,
        },
        Column {
            name: "large step".to_owned(),
            course: |response| &response.large,
            linear_rad: None,
            fed: None,
            shown,
        },
        Column {
            name: format!("sine at {:.1} Hz", closed.natural_frequency_hz),
            course: |response| &response.sine,
            linear_rad: None,
            fed: joint.responses.first().map(|first| &first.tracked),
            shown: sine_steps,
        },
    ];
    for (place, column) in columns.iter().enumerate() {
        drawing.motion(&mut chart, column, place);
        drawing.torque(&mut chart, column, place);
    }
    drawing.bode(&mut chart);
    chart
}

/// What is shown of gain and phase (rad).
type Response = fn(f64, f64) -> f64;

/// Motion above, torque below.
struct Column<'a> {
    name: String,
    course: fn(&JointResponse) -> &Course,
    /// The linear loop's course beside it.
    linear_rad: Option<&'a [f64]>,
    /// The course with feed-forward.
    fed: Option<&'a Course>,
    /// Time steps.
    shown: usize,
}

struct Drawing<'a> {
    joint: &'a JointReport,
    overlay: Overlay,
    timestep_ms: f64,
}

impl Drawing<'_> {
    fn legend(&self, chart: &mut Chart) {
        let mut entries = vec![(Sample::Line(REFERENCE), "set-point")];
        for (index, response) in self.joint.responses.iter().enumerate() {
            entries.push((Sample::Line(self.overlay.stroke(index)), response.engine));
        }
        entries.extend([
            (Sample::Line(LINEAR), "linear loop"),
            (Sample::Line(FED), "with feed-forward"),
            (Sample::Line(LIMIT), "torque limit"),
            (Sample::Disc(CUT_RADIUS, CUT), "torque saturated"),
        ]);
        let width = chart.size[0] - 40.0;
        legend(chart, [20.0, 76.0], width, entries);
    }

    fn milliseconds(&self, step: usize) -> f64 {
        step as f64 * self.timestep_ms
    }

    /// Time and milliradians.
    fn points(&self, values: &[f64], shown: usize) -> Vec<[f64; 2]> {
        let values = values.iter().take(shown + 1).enumerate();
        values
            .map(|(step, value)| [self.milliseconds(step), value * 1e3])
            .collect()
    }

    fn motion(&self, chart: &mut Chart, column: &Column<'_>, place: usize) {
        let Some(first) = self.joint.responses.first() else {
            return;
        };
        let shown = column.shown;
        let values = self.joint.responses.iter().flat_map(|response| {
            let course = (column.course)(response);
            let both = [&course.motion_rad, &course.reference_rad];
            both.into_iter()
                .flat_map(|values| values.iter().take(shown))
        });
        let panel = panel(
            place,
            0,
            &column.name,
            self.time(shown),
            Axis::around(
                "motion (mrad)",
                values.map(|value| value * 1e3).chain([0.0]),
            ),
        );
        panel.draw(chart);
        // A step of the set-point at time zero is drawn as one.
        let reference = &(column.course)(first).reference_rad;
        let mut wanted = self.points(reference, shown);
        if reference.first().is_some_and(|start| *start != 0.0) {
            wanted.insert(0, [0.0, 0.0]);
        }
        panel.curve(chart, wanted, REFERENCE);
        for (index, response) in self.joint.responses.iter().enumerate() {
            let points = self.points(&(column.course)(response).motion_rad, shown);
            panel.curve(chart, points, self.overlay.stroke(index));
        }
        if let Some(linear_rad) = column.linear_rad {
            panel.curve(chart, self.points(linear_rad, shown), LINEAR);
        }
        if let Some(fed) = column.fed {
            panel.curve(chart, self.points(&fed.motion_rad, shown), FED);
        }
    }

    fn torque(&self, chart: &mut Chart, column: &Column<'_>, place: usize) {
        let shown = column.shown;
        let limit_nm = self.joint.limit_nm;
        let courses = || self.joint.responses.iter().map(column.course);
        if courses().next().is_none() {
            return;
        }
        let torques = || courses().flat_map(|course| course.torque_nm.iter().take(shown).copied());
        let highest = torques().fold(0.0, |high: f64, each| high.max(each.abs()));
        // The limit is shown where the torque comes near to it.
        let limits = if highest > 0.6 * limit_nm {
            vec![limit_nm, -limit_nm]
        } else {
            Vec::new()
        };
        let values = torques().chain(limits.iter().copied());
        let range = Axis::around("torque (N m)", values);
        let panel = panel(place, 1, "", self.time(shown), range);
        panel.draw(chart);
        for (index, course) in courses().enumerate() {
            let held = course.torque_nm.iter().take(shown).enumerate();
            let points = held.flat_map(|(step, torque)| {
                // Held over its step.
                [step, step + 1].map(|step| [self.milliseconds(step), *torque])
            });
            panel.curve(chart, points, self.overlay.stroke(index));
        }
        for course in courses() {
            let steps = course.saturated.iter().zip(&course.torque_nm).enumerate();
            let cut = steps
                .take(shown)
                .filter(|(_, (cut, _))| **cut)
                .map(|(step, (_, torque))| [self.milliseconds(step), *torque]);
            panel.points(chart, cut, CUT_RADIUS, CUT);
        }
        for limit in limits {
            panel.level(chart, limit, LIMIT);
        }
    }

    fn time(&self, shown: usize) -> Axis {
        Axis::linear("time (ms)", 0.0, self.milliseconds(shown))
    }

    fn bode(&self, chart: &mut Chart) {
        let curve = &self.joint.linear_curve;
        let measured = || {
            self.joint
                .responses
                .iter()
                .flat_map(|each| &each.frequencies)
        };
        let frequencies = curve.iter().map(|[hertz, ..]| *hertz);
        let frequencies = frequencies.chain(measured().map(|point| point.frequency_hz));
        let [low, high] = frequencies.fold([1.0_f64, 100.0_f64], |[low, high], hertz| {
            [low.min(hertz), high.max(hertz)]
        });
        let rows: [(&str, Response); 2] = [
            ("gain (dB)", |gain, _| 20.0 * libm::log10(gain)),
            ("phase (deg)", |_, phase_rad| unwound(phase_rad)),
        ];
        for (row, (label, value)) in rows.into_iter().enumerate() {
            let of_curve = || {
                curve
                    .iter()
                    .map(|[hertz, gain, phase]| [*hertz, value(*gain, *phase)])
            };
            let of_engines = measured().map(|point| value(point.gain, point.phase_rad));
            let all = of_curve().map(|[_, value]| value).chain(of_engines);
            let panel = panel(
                COLUMNS - 1,
                row,
                if row == 0 { "frequency response" } else { "" },
                Axis::logarithmic("frequency (Hz)", low, high),
                Axis::around(label, all),
            );
            panel.draw(chart);
            panel.curve(chart, of_curve(), LINEAR);
            for (index, response) in self.joint.responses.iter().enumerate() {
                let points = response
                    .frequencies
                    .iter()
                    .map(|point| [point.frequency_hz, value(point.gain, point.phase_rad)]);
                let paint = self.overlay.stroke(index).paint;
                panel.points(chart, points, self.overlay.radius(index), paint);
            }
        }
    }
}

/// Degrees, from -270 to 90.
fn unwound(phase_rad: f64) -> f64 {
    let degrees = phase_rad.to_degrees();
    if degrees > 90.0 {
        degrees - 360.0
    } else {
        degrees
    }
}

fn panel(column: usize, row: usize, title: &str, x: Axis, y: Axis) -> Panel {
    Panel {
        corner: [
            LEFT_PX + column as f64 * COLUMN_PX,
            TOP_PX + row as f64 * ROW_PX,
        ],
        size: PANEL_PX,
        title: title.to_owned(),
        x,
        y,
    }
}

#[cfg(test)]
mod tests {
    use needlebench_bench::servo::experiment::{FrequencyPoint, StepFigures};
    use needlebench_bench::servo::linear::{JointLoop, Margins};

    use super::*;

    const TIMESTEP_S: f64 = 1e-3;

    fn course(height_rad: f64, torque_nm: f64) -> Course {
        const STATES: usize = 601;
        Course {
            reference_rad: vec![height_rad; STATES],
            motion_rad: (0..STATES)
                .map(|step| height_rad * (1.0 - libm::exp(-0.02 * step as f64)))
                .collect(),
            torque_nm: vec![torque_nm; STATES - 1],
            saturated: (0..STATES - 1).map(|step| step < 5).collect(),
        }
    }

    fn response(engine: &'static str) -> JointResponse {
        let step = StepFigures {
            height_rad: 1e-3,
            rise_time_s: None,
            overshoot: 0.0,
            settling_time_s: None,
            saturated_steps: 5,
            peak_torque_ratio: 1.0,
        };
        let point = |frequency_hz: f64| FrequencyPoint {
            frequency_hz,
            gain: 1.0 / frequency_hz,
            phase_rad: -0.01 * frequency_hz,
            linear_gain: 1.0,
            linear_phase_rad: 0.0,
        };
        JointResponse {
            engine,
            small_step: step,
            large_step: step,
            step_deviation: 0.0,
            frequencies: [1.0, 8.0, 250.0].map(point).into(),
            small: course(1e-3, 12_345.6),
            large: course(35e-3, 27.0),
            sine: course(1e-3, -1.0),
            tracked: course(1e-3, 1.0),
        }
    }

    #[test]
    fn charts_of_many_engines_are_legible_and_show_all_of_them() {
        let report = ServoReport {
            schema_version: 1,
            scenario: "a_scenario".to_owned(),
            posture: String::new(),
            posture_rad: [0.0; 6],
            timestep_s: TIMESTEP_S,
            settings: Vec::new(),
            margins: Margins {
                spectral_radius: 0.9,
                gain_factor: None,
                timestep_s: None,
            },
            joints: Vec::new(),
        };
        let mut joint = JointReport {
            joint: "shoulder_lift",
            limit_nm: 28.0,
            closed_loop: JointLoop {
                inertia_kgm2: 0.3,
                natural_frequency_hz: 13.0,
                damping_ratio: 1.2,
                bandwidth_hz: None,
                gain_margin: 4.0,
            },
            responses: ["rapier", "mujoco", "replay", "a_fourth"]
                .map(response)
                .into(),
            index: 1,
            linear_step: vec![1.0; 601],
            linear_curve: vec![[1.0, 1.0, 0.0], [100.0, 0.1, -2.0]],
        };
        let chart = servo_chart(&report, &joint);
        assert_eq!(chart.illegible(), None);
        let svg = chart.to_svg();
        for (index, response) in joint.responses.iter().enumerate() {
            assert!(svg.contains(&format!(">{}</text>", response.engine)));
            let [red, green, blue] = Paint::Series(index).rgb();
            let color = format!("\"#{red:02x}{green:02x}{blue:02x}\"");
            // Its sample, three motions, three torques, three frequencies twice.
            assert_eq!(
                svg.matches(&color).count(),
                1 + 6 + 6,
                "{}",
                response.engine
            );
        }
        joint.responses.clear();
        assert_eq!(servo_chart(&report, &joint).illegible(), None);
    }
}
