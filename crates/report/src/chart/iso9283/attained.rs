//! Attained positions about the command.

use needlebench_iso9283::{Attained, PoseStatistics, ProtocolStatistics};
use needlebench_show::chart::{
    Anchor, Axis, Chart, LEGEND_ROW_PX, Paint, Panel, Sample, Size, Stroke, legend,
};
use needlebench_show::number::{LengthUnit, small_length, small_length_or_zero, unit_of_length};

const PANEL_PX: f64 = 270.0;
/// From one panel to the next, px.
const STEP_PX: f64 = 292.0;
const LEFT_PX: f64 = 96.0;
const TOP_PX: f64 = 112.0;
/// Below the last panels, px.
const BELOW_PX: f64 = 84.0;

const POINT: Paint = Paint::Series(0);
const POINT_RADIUS: f64 = 2.5;
const MEAN: Stroke = Stroke {
    paint: Paint::Series(1),
    width: 1.6,
    dash: None,
};
const MEAN_RADIUS: f64 = 4.0;
const SPHERE: Stroke = Stroke {
    paint: Paint::Series(5),
    width: 2.2,
    dash: None,
};
const COMMAND: Stroke = Stroke {
    paint: Paint::Ink,
    width: 1.4,
    dash: None,
};

/// Half the side of a panel shows at least this, m: below it is rounding.
const LEAST_HALF_M: f64 = 1e-9;

/// The upward axes of the two rows; x is to the right in both.
const ROWS: [(usize, &str); 2] = [(1, "y"), (2, "z")];

/// Attained positions of every pose about its command, in two projections, all on one scale: a
/// line to the mean as long as AP, the circle of that radius about the command, and the one of
/// radius RP about the mean.
pub(crate) fn attained_chart(
    heading: &str,
    statistics: &ProtocolStatistics,
    attained: &[Attained],
) -> Chart {
    let poses = &statistics.poses;
    let half_m = 1.15
        * poses
            .iter()
            .map(|each| each.ap_m + each.rp_m)
            .fold(LEAST_HALF_M / 1.15, f64::max);
    let unit = unit_of_length(half_m);
    let half = half_m * unit.per_metre;
    let columns = poses.len().max(3) as f64;
    let foot = TOP_PX + 2.0 * STEP_PX + BELOW_PX;
    let title = format!("{heading}: attained positions relative to the command");
    let wide = Size::Large.width(&title) + 40.0;
    let size = [(LEFT_PX + columns * STEP_PX).max(wide), foot];
    let mut chart = Chart::new(size, &*title);
    chart.write_large([20.0, 24.0], title);
    key(&mut chart);
    for (row, (upwards, name)) in ROWS.into_iter().enumerate() {
        for (column, pose) in poses.iter().enumerate() {
            // Only the outer panels have names: all are on one scale.
            let label = |name: &str, shown: bool| {
                if shown {
                    format!("{name} minus command ({})", unit.name)
                } else {
                    String::new()
                }
            };
            let axis = |label: String, shown: bool| {
                let axis = Axis::linear(label, -half, half);
                if shown {
                    axis
                } else {
                    let ticks = axis.ticks(PANEL_PX / 60.0);
                    axis.with_ticks(
                        ticks
                            .into_iter()
                            .map(|(at, _)| (at, String::new()))
                            .collect(),
                    )
                }
            };
            let (first, last) = (column == 0, row + 1 == ROWS.len());
            let panel = Panel {
                corner: [
                    LEFT_PX + column as f64 * STEP_PX,
                    TOP_PX + row as f64 * STEP_PX,
                ],
                size: [PANEL_PX; 2],
                title: if row == 0 {
                    heading_of(pose)
                } else {
                    String::new()
                },
                x: axis(label("x", last), last),
                y: axis(label(name, first), first),
            };
            panel.draw(&mut chart);
            positions(&mut chart, &panel, upwards, unit, pose, attained);
        }
    }
    if statistics.nothing_random {
        let text = "RP = 0: all measurements of a pose are bit-identical";
        chart.write(Anchor::Start, [LEFT_PX, foot - 16.0], text);
    }
    chart
}

fn heading_of(pose: &PoseStatistics) -> String {
    format!(
        "P{}: AP {}, RP {}",
        pose.pose,
        small_length(pose.ap_m),
        small_length_or_zero(pose.rp_m)
    )
}

fn positions(
    chart: &mut Chart,
    panel: &Panel,
    upwards: usize,
    unit: LengthUnit,
    statistics: &PoseStatistics,
    attained: &[Attained],
) {
    let place = |offset_m: [f64; 3]| panel.at([0, upwards].map(|k| unit.per_metre * offset_m[k]));
    let scale = 0.5 * PANEL_PX / panel.x.high * unit.per_metre;
    let (command, mean) = (place([0.0; 3]), place(statistics.ap_xyz_m));
    chart.circle(command, scale * statistics.ap_m, MEAN);
    if statistics.rp_m > 0.0 {
        chart.circle(mean, scale * statistics.rp_m, SPHERE);
    }
    for each in attained {
        if each.pose == statistics.pose && each.axis.is_none() {
            let offset_m = std::array::from_fn(|k| each.position_m[k] - statistics.commanded_m[k]);
            chart.disc(place(offset_m), POINT_RADIUS, POINT);
        }
    }
    chart.line(command, mean, MEAN);
    chart.disc(mean, MEAN_RADIUS, MEAN.paint);
    let [x, y] = command;
    chart.line([x - 7.0, y], [x + 7.0, y], COMMAND);
    chart.line([x, y - 7.0], [x, y + 7.0], COMMAND);
}

fn key(chart: &mut Chart) {
    let entries = [
        (Sample::Line(COMMAND), "cross: command"),
        (Sample::Disc(POINT_RADIUS, POINT), "attained"),
        (Sample::Disc(MEAN_RADIUS, MEAN.paint), "mean"),
        (Sample::Circle(7.0, MEAN), "AP around the command"),
        (Sample::Circle(7.0, SPHERE), "RP around the mean"),
    ];
    let width = chart.size[0] - LEFT_PX;
    legend(
        chart,
        [LEFT_PX, 40.0 + 0.5 * LEGEND_ROW_PX + 8.0],
        width,
        entries,
    );
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use needlebench_iso9283::{Commanded, evaluate};

    use super::*;

    fn measured(poses: u32, spread_m: f64) -> (ProtocolStatistics, Vec<Attained>) {
        let commanded: Vec<Commanded> = (1..=poses)
            .map(|pose| Commanded {
                pose,
                position_m: Point3::new(0.1, 0.2, 0.3),
                orientation: None,
            })
            .collect();
        let offsets = [-1.0, 0.5, 2.0];
        let attained: Vec<Attained> = (1..=poses)
            .flat_map(|pose| {
                offsets.map(|offset| Attained {
                    pose,
                    cycle: 1,
                    axis: None,
                    time_s: None,
                    position_m: Point3::new(0.1 + offset * spread_m, 0.2 + spread_m, 0.3),
                    orientation: None,
                })
            })
            .collect();
        (evaluate(&commanded, &attained).unwrap(), attained)
    }

    #[test]
    fn positions_are_legible_at_every_scale() {
        for (poses, spread_m) in [(5, 2e-5), (1, 0.0), (3, 7e-4), (5, 3e-9), (5, 0.02)] {
            let (statistics, attained) = measured(poses, spread_m);
            let chart = attained_chart("a_scenario, rapier", &statistics, &attained);
            assert_eq!(chart.illegible(), None);
            let unit = match spread_m {
                2e-5 => "um",
                7e-4 | 0.02 => "mm",
                _ => "nm",
            };
            let label = format!("x minus command ({unit})");
            let labels = chart.texts().filter(|text| text.text == label).count();
            assert_eq!(labels, poses as usize, "{spread_m}");
        }
    }
}
