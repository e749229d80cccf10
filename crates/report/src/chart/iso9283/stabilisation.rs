//! How arrivals settle.

use needlebench_iso9283::Arrival;
use needlebench_show::chart::{Axis, Chart, Paint, Panel, Sample, Stroke, legend_column};
use needlebench_show::number::decade_of_length;

/// Decades of distance that are shown: 1 nm to 100 mm.
const DECADES: [i32; 2] = [-9, -1];
const CORNER_PX: [f64; 2] = [110.0, 60.0];
const PANEL_PX: [f64; 2] = [980.0, 480.0];
/// Right of the panel, and below it, px.
const BESIDE_PX: f64 = 120.0;
const BELOW_PX: f64 = 54.0;
/// Earliest time before the end of the motion that is shown, s.
const BEFORE_S: f64 = 0.4;
const BAND: Stroke = Stroke {
    paint: Paint::Limit,
    width: 2.0,
    dash: Some([8.0, 4.0]),
};

/// Distance from the attained position over the time from the end of the planned motion, of the
/// first arrivals at each pose.
pub(crate) fn stabilisation_chart(heading: &str, arrivals: &[Arrival], limit_band_m: f64) -> Chart {
    let [left, top] = CORNER_PX;
    let [width, height] = PANEL_PX;
    let title = format!("{heading}: stabilisation");
    let size = [left + width + BESIDE_PX, top + height + BELOW_PX];
    let mut chart = Chart::new(size, &*title);
    chart.write_large([20.0, 24.0], title);
    let last_s = arrivals
        .iter()
        .filter_map(|each| each.time_s.last().copied())
        .fold(0.1, f64::max);
    let panel = Panel {
        corner: CORNER_PX,
        size: PANEL_PX,
        title: String::new(),
        x: Axis::linear(
            "time from the end of the planned motion (s)",
            -BEFORE_S,
            last_s,
        ),
        y: Axis::decades(
            "distance from the rest position",
            DECADES,
            1,
            decade_of_length,
        ),
    };
    panel.draw(&mut chart);
    panel.upright(&mut chart, 0.0, Stroke::full(Paint::Ink, 1.5));
    panel.level(&mut chart, limit_band_m, BAND);
    for arrival in arrivals {
        let points = arrival.time_s.iter().zip(&arrival.distance_m);
        let points = points
            .filter(|(time_s, _)| **time_s >= -BEFORE_S)
            .map(|(time_s, distance_m)| [*time_s, *distance_m]);
        panel.curve(&mut chart, points, stroke(arrival.pose));
    }
    let mut poses: Vec<u32> = arrivals.iter().map(|each| each.pose).collect();
    poses.sort_unstable();
    poses.dedup();
    let names: Vec<(u32, String)> = poses
        .iter()
        .map(|pose| (*pose, format!("P{pose}")))
        .collect();
    let entries = names
        .iter()
        .map(|(pose, name)| (Sample::Line(stroke(*pose)), name.as_str()))
        .chain([(Sample::Line(BAND), "limit band")]);
    legend_column(&mut chart, [left + width + 10.0, top + 16.0], entries);
    chart
}

/// Of a pose; they are counted from one.
fn stroke(pose: u32) -> Stroke {
    let index = usize::try_from(pose).unwrap_or(1).saturating_sub(1);
    Stroke::full(Paint::Series(index), 1.6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrivals_are_legible_whatever_the_limit_band() {
        let arrivals: Vec<Arrival> = (1..=5)
            .map(|pose| Arrival {
                pose,
                cycle: 1,
                time_s: vec![-1.0, 0.0, 0.5, 1.5],
                distance_m: vec![0.3, 1e-3, 1e-6, 0.0],
            })
            .collect();
        for limit_band_m in [1e-5, 1e-4, 3e-3] {
            assert_eq!(
                stabilisation_chart("test, rapier", &arrivals, limit_band_m,).illegible(),
                None
            );
        }
    }
}
