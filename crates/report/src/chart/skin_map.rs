//! Maps of the skin as a target sees it.

use needlebench_show::chart::{Anchor, Axis, Chart, Paint, Panel, Stroke};

/// Elevations beyond this are along the body: no needle goes there, deg.
pub(super) const HIGHEST_DEG: f64 = 75.0;
/// Radius of a numbered mark, px.
pub(super) const MARK_PX: f64 = 11.0;

/// Azimuth and elevation from the target, deg.
pub(super) fn skin_panel() -> Panel {
    let azimuths = [
        (-180.0, "back"),
        (-135.0, ""),
        (-90.0, "patient's right"),
        (-45.0, ""),
        (0.0, "front"),
        (45.0, ""),
        (90.0, "patient's left"),
        (135.0, ""),
        (180.0, "back"),
    ];
    let named = |(deg, name): (f64, &str)| {
        let text = if name.is_empty() {
            format!("{deg:.0}")
        } else {
            format!("{deg:.0} {name}")
        };
        (deg, text)
    };
    Panel {
        corner: [80.0, 50.0],
        size: [880.0, 366.0],
        title: String::new(),
        x: Axis::linear("azimuth from the target (deg)", -180.0, 180.0)
            .with_ticks(azimuths.map(named).to_vec()),
        y: Axis::linear("elevation (deg), head upwards", -HIGHEST_DEG, HIGHEST_DEG),
    }
}

/// A number in a circle.
pub(super) fn numbered(chart: &mut Chart, at: [f64; 2], number: usize) {
    chart.disc(at, MARK_PX, Paint::Page);
    chart.circle(at, MARK_PX, Stroke::full(Paint::Ink, 2.0));
    chart.write(Anchor::Middle, at, number.to_string());
}
