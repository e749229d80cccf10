//! The entry map: the skin as the target sees it, with what forbids a route and how the free ones compare.

use std::collections::BTreeMap;

use needlebench_patient::routes::RoutePlan;
use needlebench_show::chart::{Anchor, Chart, Paint, Rgb, Sample, legend, mixed};
use serde::Serialize;

use super::skin_map::{HIGHEST_DEG, numbered, skin_panel};

/// Colours of rules, told apart by lightness too.
const RULES: [(&str, &str, Rgb); 13] = [
    ("needle_too_short", "needle too short", [226, 226, 226]),
    ("outside", "arm, couch or marker", [120, 120, 120]),
    ("end_of_body", "skin unknown", [176, 190, 220]),
    ("oblique", "too oblique", [206, 214, 235]),
    ("bone", "bone", [150, 110, 60]),
    ("vessel", "vessel", [196, 44, 52]),
    ("organ", "organ", [238, 170, 150]),
    ("pleura", "enters lungs twice", [150, 90, 160]),
    ("fissure", "fissure", [200, 150, 210]),
    ("bulla", "bulla", [225, 190, 235]),
    ("throw", "throw blocked", [240, 196, 70]),
    ("bent", "bent needle too close", [70, 110, 190]),
    ("no_skin", "no skin", [245, 245, 245]),
];

/// Colours of admissible directions: the lowest odds, and twice the lowest or more.
const FREE: [Rgb; 2] = [[0, 96, 70], [170, 226, 205]];

/// Colours of an entry map, for pages that draw their own.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RouteColours {
    /// By the name of a rule: in words, red, green, blue.
    pub rules: BTreeMap<&'static str, (&'static str, Rgb)>,
    /// Admissible directions: of the lowest odds, and of twice the lowest or more.
    pub free: [Rgb; 2],
}

/// The colours of `routes_chart`.
pub fn route_colours() -> RouteColours {
    let rules = RULES.into_iter();
    RouteColours {
        rules: rules
            .map(|(rule, words, rgb)| (rule, (words, rgb)))
            .collect(),
        free: FREE,
    }
}

/// Needle paths that are numbered.
const NUMBERED: usize = 8;

/// The map of a plan; none if it has none.
pub(crate) fn routes_chart(scenario: &str, plan: &RoutePlan) -> Option<Chart> {
    const SIZE: [f64; 2] = [1000.0, 600.0];
    let map = plan.map.as_ref()?;
    let title = format!("{scenario}, {}: needle paths to the target", plan.goal);
    let mut chart = Chart::new(SIZE, &*title);
    chart.write_large([20.0, 24.0], title);
    let panel = skin_panel();
    panel.draw_paper(&mut chart);
    let least = map
        .odds_ratio
        .iter()
        .flatten()
        .copied()
        .fold(f64::INFINITY, f64::min);
    // Half the distance of directions on an even grid, and a little more so that no paper shows.
    let half = 0.62 * (41_253.0 / map.azimuth_deg.len().max(1) as f64).sqrt();
    let mut seen = [false; RULES.len()];
    for index in 0..map.azimuth_deg.len() {
        let [azimuth, elevation] = [map.azimuth_deg[index], map.elevation_deg[index]];
        if elevation.abs() > HIGHEST_DEG - half {
            continue;
        }
        let rgb = match map.rule[index] {
            None => shade(map.odds_ratio[index].unwrap_or(least), least),
            Some(rule) => {
                let name = map.rules[rule];
                let Some(known) = RULES.iter().position(|(each, ..)| *each == name) else {
                    continue;
                };
                seen[known] = true;
                RULES[known].2
            }
        };
        let across = half / libm::cos(elevation.to_radians());
        let [left, top] = panel.at([(azimuth - across).max(-180.0), elevation + half]);
        let [right, foot] = panel.at([(azimuth + across).min(180.0), elevation - half]);
        chart.fill([left, top], [right - left, foot - top], Paint::Fixed(rgb));
    }
    panel.draw_axes(&mut chart);
    let chosen = plan.chosen.as_ref().map(|chosen| chosen.route);
    for (index, route) in plan.routes.iter().enumerate().rev() {
        if index < NUMBERED || chosen == Some(index) {
            numbered(&mut chart, panel.at(route.direction_deg), index + 1);
        }
    }
    let chosen = chosen.map_or_else(
        || "none is feasible as required".to_owned(),
        |route| format!("{} is selected", route + 1),
    );
    chart.write(
        Anchor::Start,
        [80.0, 486.0],
        format!(
            "numbers: needle paths, best first; {chosen}; {} of {} directions admissible before \
             the robot check",
            plan.free, plan.tried
        ),
    );
    let free = [
        (FREE[0], "admissible, lowest odds"),
        (FREE[1], "admissible, twice the odds or more"),
    ];
    let free = free.map(|(rgb, name)| (Sample::Area(Paint::Fixed(rgb)), name));
    let rules = RULES.iter().zip(seen).filter(|(_, seen)| *seen);
    let rules = rules.map(|((_, name, rgb), _)| (Sample::Area(Paint::Fixed(*rgb)), *name));
    legend(
        &mut chart,
        [80.0, 514.0],
        880.0,
        free.into_iter().chain(rules),
    );
    Some(chart)
}

/// Darker is better.
fn shade(odds: f64, least: f64) -> Rgb {
    let share = libm::log2(odds / least).clamp(0.0, 1.0);
    mixed(FREE, share)
}
