//! Pictures of a test: attained positions about the command, and how arrivals settle.

use needlebench_evaluation::iso9283::{Arrival, Attained, PoseStatistics, ProtocolStatistics};

use crate::output::small_length;
use crate::picture::Image;
use crate::picture::flat::{Canvas, Rgb, pixel};

const PAGE: Rgb = [255, 255, 255];
const INK: Rgb = [40, 44, 52];
const FAINT: Rgb = [214, 217, 222];
const PANEL_PX: usize = 270;
const GAP_PX: usize = 22;
const LEFT_PX: usize = 70;
const TOP_PX: usize = 92;
const LEGEND_PX: usize = 92;

const POINT: Rgb = [38, 104, 176];
const MEAN: Rgb = [205, 52, 52];
const COMMAND: Rgb = [20, 20, 20];
const SPHERE: Rgb = [242, 156, 31];

/// Colours of the poses in the plot of arrivals: told apart by people who see few colours.
const POSES: [Rgb; 5] = [
    [20, 20, 20],
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
];

/// Half the side of a panel shows at least this, m: below it is rounding.
const LEAST_HALF_M: f64 = 1e-9;

/// The planes of the two rows: axes to the right and upwards.
const PLANES: [([usize; 2], &str); 2] = [([0, 1], "y over x"), ([0, 2], "z over x")];

/// Attained positions of every pose about its command, in two projections, all on one scale: a
/// line to the mean as long as AP, the sphere of that radius about the command, and the sphere of
/// radius RP about the mean.
pub(crate) fn attained_picture(
    heading: &str,
    statistics: &ProtocolStatistics,
    attained: &[Attained],
) -> Image {
    let poses = &statistics.poses;
    let half_m = 1.15
        * poses
            .iter()
            .map(|each| each.ap_m + each.rp_m)
            .fold(LEAST_HALF_M / 1.15, f64::max);
    let step = PANEL_PX + GAP_PX;
    let width_px = LEFT_PX + poses.len().max(4) * step;
    let mut canvas = Canvas::new(width_px, TOP_PX + 2 * step + LEGEND_PX, PAGE);
    canvas.write_large(
        [20, 14],
        &format!("{heading}: attained positions about the command"),
    );
    for (row, (axes, name)) in PLANES.into_iter().enumerate() {
        let top = TOP_PX + row * step;
        canvas.write(
            [8, top + PANEL_PX / 2 - 10],
            name.split(' ').next().unwrap_or(""),
        );
        for (column, each) in poses.iter().enumerate() {
            let left = LEFT_PX + column * step;
            panel(&mut canvas, [left, top], axes, half_m, each, attained);
            if row == 0 {
                let label = format!(
                    "P{}: AP {}, RP {}",
                    each.pose,
                    small_length(each.ap_m),
                    if each.rp_m == 0.0 {
                        "0".to_owned()
                    } else {
                        small_length(each.rp_m)
                    }
                );
                canvas.write([left, top - 22], &label);
            }
        }
    }
    legend(
        &mut canvas,
        TOP_PX + 2 * step,
        half_m,
        statistics.nothing_random,
    );
    canvas.into_image()
}

fn panel(
    canvas: &mut Canvas,
    [left, top]: [usize; 2],
    axes: [usize; 2],
    half_m: f64,
    statistics: &PoseStatistics,
    attained: &[Attained],
) {
    let half_px = 0.5 * PANEL_PX as f64;
    let centre = [left as f64 + half_px, top as f64 + half_px];
    let scale = half_px / half_m;
    let place = |offset: [f64; 3]| {
        [
            centre[0] + scale * offset[axes[0]],
            centre[1] - scale * offset[axes[1]],
        ]
    };
    canvas.stroke(
        [left as f64, centre[1]],
        [left as f64 + 2.0 * half_px, centre[1]],
        1.0,
        FAINT,
    );
    canvas.stroke(
        [centre[0], top as f64],
        [centre[0], top as f64 + 2.0 * half_px],
        1.0,
        FAINT,
    );
    let mean = place(statistics.ap_xyz_m);
    canvas.circle(centre, scale * statistics.ap_m, 1.5, MEAN);
    if statistics.rp_m > 0.0 {
        canvas.circle(mean, scale * statistics.rp_m, 2.0, SPHERE);
    }
    for each in attained {
        if each.pose == statistics.pose && each.axis.is_none() {
            let mut offset = [0.0; 3];
            for (axis, value) in offset.iter_mut().enumerate() {
                *value = each.position_m[axis] - statistics.commanded_m[axis];
            }
            canvas.disc(place(offset), 2.5, POINT);
        }
    }
    canvas.stroke(centre, mean, 1.5, MEAN);
    canvas.disc(mean, 4.0, MEAN);
    cross(canvas, centre);
    canvas.frame([left, top], [PANEL_PX, PANEL_PX], INK);
}

fn cross(canvas: &mut Canvas, [x, y]: [f64; 2]) {
    canvas.stroke([x - 7.0, y], [x + 7.0, y], 2.0, COMMAND);
    canvas.stroke([x, y - 7.0], [x, y + 7.0], 2.0, COMMAND);
}

fn legend(canvas: &mut Canvas, top: usize, half_m: f64, nothing_random: bool) {
    let bar_m = round_length(half_m);
    let bar_px = bar_m / half_m * 0.5 * PANEL_PX as f64;
    let middle = top as f64 + 10.0;
    let left = LEFT_PX as f64;
    canvas.stroke([left, middle], [left + bar_px, middle], 3.0, INK);
    canvas.write([LEFT_PX + PANEL_PX / 2 + 12, top + 2], &small_length(bar_m));
    let mut at = LEFT_PX + PANEL_PX + GAP_PX;
    cross(canvas, [at as f64, middle]);
    canvas.write([at + 14, top + 2], "command");
    at += 120;
    canvas.disc([at as f64, middle], 2.5, POINT);
    canvas.write([at + 14, top + 2], "attained");
    at += 130;
    canvas.disc([at as f64, middle], 4.0, MEAN);
    canvas.write([at + 14, top + 2], "mean; AP from command");
    at += 220;
    canvas.circle([at as f64, middle], 8.0, 2.0, SPHERE);
    canvas.write([at + 14, top + 2], "sphere of radius RP");
    let text = "first row: y (up) over x (right); second row: z over x; base frame, one scale";
    canvas.write([LEFT_PX, top + 32], text);
    if nothing_random {
        let text = "RP = 0: all measurements of a pose are equal, nothing random is switched on";
        canvas.write([LEFT_PX, top + 56], text);
    }
}

/// 1, 2 or 5 times a power of ten, the largest that is not above a length.
fn round_length(length_m: f64) -> f64 {
    let decade = 10.0_f64.powf(length_m.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|factor| factor * decade)
        .find(|candidate| *candidate <= length_m)
        .unwrap_or(decade)
}

/// Decades of distance that the plot of arrivals shows: 1 nm to 100 mm.
const DECADES: [i32; 2] = [-9, -1];
const PLOT_PX: [usize; 2] = [980, 480];
/// Earliest time before the end of the motion that is shown, in tenths of a second, and in s.
const TENTHS_BEFORE: i32 = 4;
const BEFORE_S: f64 = 0.4;

/// Distance from the attained position over the time from the end of the planned motion, of the
/// first arrivals at each pose.
pub(crate) fn stabilisation_picture(
    heading: &str,
    arrivals: &[Arrival],
    limit_band_m: f64,
) -> Image {
    let [width, height] = PLOT_PX;
    let (left, top) = (90, 60);
    let mut canvas = Canvas::new(left + width + 120, top + height + 66, PAGE);
    canvas.write_large([20, 14], &format!("{heading}: coming to rest"));
    let last_s = arrivals
        .iter()
        .filter_map(|each| each.time_s.last().copied())
        .fold(0.1, f64::max);
    let (low, high) = (f64::from(DECADES[0]), f64::from(DECADES[1]));
    let x = |time_s: f64| left as f64 + (time_s + BEFORE_S) / (last_s + BEFORE_S) * width as f64;
    let y = |distance_m: f64| {
        let decade = distance_m.max(f64::MIN_POSITIVE).log10().clamp(low, high);
        top as f64 + (high - decade) / (high - low) * height as f64
    };
    let (right, bottom) = (left as f64 + width as f64, top as f64 + height as f64);
    for decade in DECADES[0]..=DECADES[1] {
        let distance_m = 10.0_f64.powi(decade);
        let at = y(distance_m);
        canvas.stroke([left as f64, at], [right, at], 1.0, FAINT);
        let names = [
            "1 nm", "10 nm", "100 nm", "1 um", "10 um", "100 um", "1 mm", "10 mm", "100 mm",
        ];
        let text = usize::try_from(decade - DECADES[0])
            .ok()
            .and_then(|index| names.get(index));
        canvas.write([14, pixel(at) - 8], text.copied().unwrap_or(""));
    }
    for tick in -TENTHS_BEFORE.. {
        let tick_s = 0.1 * f64::from(tick);
        if tick_s > last_s + 1e-9 {
            break;
        }
        let at = x(tick_s);
        canvas.stroke([at, top as f64], [at, bottom], 1.0, FAINT);
        canvas.write_centred([pixel(at), pixel(bottom) + 6], &format!("{tick_s:.1}"));
    }
    canvas.stroke([x(0.0), top as f64], [x(0.0), bottom], 1.5, INK);
    canvas.write_centred(
        [left + width / 2, pixel(bottom) + 28],
        "time from the end of the planned motion (s)",
    );
    canvas.stroke(
        [left as f64, y(limit_band_m)],
        [right, y(limit_band_m)],
        2.0,
        MEAN,
    );
    canvas.write([pixel(right) + 8, pixel(y(limit_band_m)) - 8], "limit band");
    for arrival in arrivals {
        let color = POSES[(arrival.pose as usize - 1) % POSES.len()];
        let points = arrival.time_s.iter().zip(&arrival.distance_m);
        let points: Vec<[f64; 2]> = points
            .filter(|(time_s, _)| **time_s >= -BEFORE_S)
            .map(|(time_s, distance_m)| [x(*time_s), y(*distance_m)])
            .collect();
        for pair in points.windows(2) {
            canvas.stroke(pair[0], pair[1], 1.5, color);
        }
    }
    let mut shown: Vec<u32> = arrivals.iter().map(|each| each.pose).collect();
    shown.sort_unstable();
    shown.dedup();
    for (row, pose) in shown.into_iter().enumerate() {
        let at = top + 16 + 24 * row;
        let color = POSES[(pose as usize - 1) % POSES.len()];
        let from = [right + 10.0, at as f64];
        canvas.stroke(from, [from[0] + 30.0, from[1]], 3.0, color);
        canvas.write([pixel(from[0]) + 38, at - 8], &format!("P{pose}"));
    }
    canvas.frame([left, top], [width, height], INK);
    canvas.into_image()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_bars_are_round() {
        for (length, bar) in [(0.0037, 0.002), (0.001, 0.001), (9.9e-6, 5e-6)] {
            assert!((round_length(length) / bar - 1.0).abs() < 1e-12);
        }
    }
}
