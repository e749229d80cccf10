//! Force and clearance of a prescribed contact, over time.

use needlebench_bench::EventRun;
use needlebench_cell::pair_in_words;
use needlebench_engine::Recording;
use needlebench_planning::PressPlan;
use needlebench_show::chart::{
    Anchor, Axis, Chart, Overlay, Paint, Panel, Sample, Size, legend, round_step,
};

use crate::csv::press::{STRIDE, clearance_m};

const SIZE_PX: [f64; 2] = [1000.0, 760.0];
const PANEL_PX: [f64; 2] = [870.0, 270.0];
const LEFT_PX: f64 = 100.0;
const TOPS_PX: [f64; 2] = [92.0, 416.0];
/// What every second phase is drawn on.
const PHASE: Paint = Paint::Fixed([240, 243, 247]);

/// One engine's curves, points of time and value.
struct Curves {
    engine: &'static str,
    force_n: Vec<[f64; 2]>,
    clearance_mm: Vec<[f64; 2]>,
}

/// Points of one of the curves.
type Values = fn(&Curves) -> &Vec<[f64; 2]>;

/// The part of a motion.
struct Phase {
    name: &'static str,
    start_s: f64,
    end_s: f64,
}

/// Force and clearance over time, all engines in one chart.
pub(crate) fn press_chart(title: &str, press: &PressPlan, run: &EventRun, index: usize) -> Chart {
    let curves: Vec<Curves> = run
        .engines
        .iter()
        .filter_map(|(engine, events)| {
            let recording = events.press.get(index)?.as_ref()?;
            Some(curves(engine, press, recording))
        })
        .collect();
    let phases: Vec<Phase> = press
        .trajectory
        .phases()
        .into_iter()
        .map(|(phase, start_s, end_s)| Phase {
            name: phase.name(),
            start_s,
            end_s,
        })
        .collect();
    let title = format!("{title}: {}", pair_in_words(&press.solids));
    chart(&title, press.trajectory.duration_s(), &phases, &curves)
}

fn curves(engine: &'static str, press: &PressPlan, recording: &Recording) -> Curves {
    let states = recording.time_s.iter().zip(&recording.state);
    Curves {
        engine,
        force_n: states
            .map(|(time_s, state)| [*time_s, state.contact.normal_force_n])
            .collect(),
        clearance_mm: (0..recording.state.len())
            .step_by(STRIDE)
            .filter_map(|k| Some([recording.time_s[k], 1e3 * clearance_m(press, recording, k)?]))
            .collect(),
    }
}

fn chart(title: &str, duration_s: f64, phases: &[Phase], curves: &[Curves]) -> Chart {
    let mut chart = Chart::new(SIZE_PX, title);
    chart.write_large([20.0, 24.0], title);
    let overlay = Overlay {
        count: curves.len(),
    };
    let entries = curves
        .iter()
        .enumerate()
        .map(|(index, each)| (Sample::Line(overlay.stroke(index)), each.engine));
    legend(&mut chart, [LEFT_PX, 58.0], PANEL_PX[0], entries);
    let panels: [(&str, Values); 2] = [
        ("force on rigid surface (N)", |curves| &curves.force_n),
        ("clearance (mm)", |curves| &curves.clearance_mm),
    ];
    for ((label, points), top) in panels.into_iter().zip(TOPS_PX) {
        let last = top > TOPS_PX[0];
        let panel = Panel {
            corner: [LEFT_PX, top],
            size: PANEL_PX,
            title: String::new(),
            x: Axis::linear(if last { "time (s)" } else { "" }, 0.0, duration_s),
            y: with_zero(label, curves.iter().flat_map(points).map(|point| point[1])),
        };
        panel.draw_paper(&mut chart);
        for phase in phases.iter().skip(1).step_by(2) {
            panel.band(&mut chart, [phase.start_s, phase.end_s], PHASE);
        }
        panel.draw_axes(&mut chart);
        for phase in phases {
            let [left, _] = panel.at([phase.start_s, panel.y.low]);
            let [right, _] = panel.at([phase.end_s, panel.y.low]);
            if Size::Small.width(phase.name) + 10.0 <= right - left {
                chart.write(Anchor::Start, [left + 6.0, top + 13.0], phase.name);
            }
        }
        for (index, each) in curves.iter().enumerate() {
            panel.curve(
                &mut chart,
                points(each).iter().copied(),
                overlay.stroke(index),
            );
        }
    }
    chart
}

/// From a round value to a round value, zero among them, with space for the names of the phases.
fn with_zero(label: &str, values: impl Iterator<Item = f64>) -> Axis {
    const HEADROOM: f64 = 0.1;
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((0.0_f64, 0.0_f64), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    let step = round_step(high - low, 6.0);
    if step == 0.0 {
        return Axis::linear(label, 0.0, 1.0);
    }
    let high = high + HEADROOM * (high - low);
    Axis::linear(
        label,
        (low / step).floor() * step,
        (high / step).ceil() * step,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_of_many_engines_are_legible_and_show_all_of_them() {
        let phases = [
            ("approach", 0.0, 2.0),
            ("press", 2.0, 3.0),
            ("hold", 3.0, 3.01),
        ];
        let phases = phases.map(|(name, start_s, end_s)| Phase {
            name,
            start_s,
            end_s,
        });
        let engines = ["rapier", "mujoco", "replay"];
        let curves = engines.map(|engine| Curves {
            engine,
            force_n: vec![[0.0, 0.0], [2.5, 134.0], [3.01, 90.0]],
            clearance_mm: vec![[0.0, 40.0], [3.01, -0.2]],
        });
        let chart = chart(
            "pose, Right-Up-Fold: guide against skin",
            3.01,
            &phases,
            &curves,
        );
        assert_eq!(chart.illegible(), None);
        let svg = chart.to_svg();
        for (index, engine) in engines.iter().enumerate() {
            assert!(svg.contains(&format!(">{engine}</text>")), "{engine}");
            let [red, green, blue] = Paint::Series(index).rgb();
            let color = format!("stroke=\"#{red:02x}{green:02x}{blue:02x}\"");
            // The legend's sample and two curves.
            assert_eq!(svg.matches(&color).count(), 3, "{engine}");
        }
    }

    #[test]
    fn a_contact_that_nobody_recorded_has_axes_only() {
        assert_eq!(chart("title", 1.0, &[], &[]).illegible(), None);
    }
}
