//! Proposals as maps: the skin as the target sees it, and the room from above.

use needlebench_bench::suggest::{EntryRule, EntrySearch, PlaceSearch};
use needlebench_scenario::ResolvedScenario;
use needlebench_show::chart::{
    Anchor, Axis, Chart, Paint, Panel, Rgb, Sample, Stroke, legend, mixed,
};

use super::skin_map::{HIGHEST_DEG, MARK_PX, numbered, skin_panel};

/// Colours of rules, told apart by lightness too.
const RULES: [(EntryRule, Rgb); 9] = [
    (EntryRule::NeedleTooShort, [226, 226, 226]),
    (EntryRule::Blocked, [120, 120, 120]),
    (EntryRule::End, [176, 190, 220]),
    (EntryRule::Oblique, [206, 214, 235]),
    (EntryRule::Bone, [150, 110, 60]),
    (EntryRule::Vessel, [196, 44, 52]),
    (EntryRule::Bent, [70, 110, 190]),
    (EntryRule::Organ, [238, 170, 150]),
    (EntryRule::Robot, [240, 196, 70]),
];
const ALLOWED: Rgb = [0, 158, 115];

/// Half a step of the grid of directions, deg.
const HALF_DEG: f64 = 1.5;

/// The skin seen from the target: admissible directions, and why the others are rejected.
pub(crate) fn entries_chart(scenario: &str, found: &EntrySearch) -> Chart {
    const SIZE: [f64; 2] = [1000.0, 580.0];
    let title = format!("{scenario}, {}: admissible needle entries", found.goal);
    let mut chart = Chart::new(SIZE, &*title);
    chart.write_large([20.0, 24.0], title);
    let panel = skin_panel();
    panel.draw_paper(&mut chart);
    for sample in &found.samples {
        let [azimuth, elevation] = sample.direction_deg;
        if elevation.abs() > HIGHEST_DEG {
            continue;
        }
        let half = HALF_DEG / libm::cos(elevation.to_radians()) + 0.6;
        let [left, top] = panel.at([azimuth - half, elevation + HALF_DEG]);
        let [right, foot] = panel.at([azimuth + half, elevation - HALF_DEG]);
        let fill = Paint::Fixed(colour(sample.refused));
        chart.fill([left, top], [right - left, foot - top], fill);
    }
    panel.draw_axes(&mut chart);
    for (index, entry) in found.entries.iter().enumerate() {
        numbered(&mut chart, panel.at(entry.direction_deg), index + 1);
    }
    let occurs = |rule: EntryRule| found.samples.iter().any(|each| each.refused == Some(rule));
    let rules = RULES.iter().filter(|(rule, _)| occurs(*rule));
    let rules = rules.map(|(rule, rgb)| (Sample::Area(Paint::Fixed(*rgb)), rule.in_words()));
    let entries = std::iter::once((Sample::Area(Paint::Fixed(ALLOWED)), "admissible"));
    chart.write(
        Anchor::Start,
        [80.0, 486.0],
        format!(
            "numbers: proposals, best first; {} of {} directions admissible ({})",
            found.allowed, found.tried, found.basis
        ),
    );
    legend(&mut chart, [80.0, 514.0], 880.0, entries.chain(rules));
    chart
}

fn colour(refused: Option<EntryRule>) -> Rgb {
    let Some(refused) = refused else {
        return ALLOWED;
    };
    let found = RULES.iter().find(|(rule, _)| *rule == refused);
    found.map_or(ALLOWED, |(_, rgb)| *rgb)
}

/// The room from above: number of feasible configurations of the worst goal, at the best height of each placement.
pub(crate) fn places_chart(resolved: &ResolvedScenario, found: &PlaceSearch) -> Chart {
    const SIZE: [f64; 2] = [1000.0, 760.0];
    /// Edge of a place's square, px.
    const EDGE_PX: f64 = 18.0;
    let title = format!(
        "{}: feasible configurations by base placement",
        resolved.scenario.name
    );
    let mut chart = Chart::new(SIZE, &*title);
    chart.write_large([20.0, 24.0], title);
    let [x, y] = axes(found);
    let panel = Panel {
        corner: [90.0, 50.0],
        size: [870.0, 560.0],
        title: String::new(),
        x,
        y,
    };
    panel.draw(&mut chart);
    outline(&mut chart, &panel, resolved);
    for [x, y] in spots(found) {
        let here = found
            .samples
            .iter()
            .filter(|each| each.position_mm[..2] == [x, y]);
        let most = here.filter_map(|each| each.working).max();
        let [cx, cy] = panel.at([x, y]);
        let corner = [cx - 0.5 * EDGE_PX, cy - 0.5 * EDGE_PX];
        match most {
            Some(working) => chart.fill(corner, [EDGE_PX; 2], Paint::Fixed(count_colour(working))),
            None => chart.line(
                [corner[0] + 4.0, corner[1] + 4.0],
                [corner[0] + EDGE_PX - 4.0, corner[1] + EDGE_PX - 4.0],
                Stroke::full(Paint::Soft, 1.5),
            ),
        }
        chart.frame(corner, [EDGE_PX; 2], Paint::Soft);
    }
    for (index, place) in found.places.iter().enumerate().rev() {
        let [x, y, _] = place.position_mm;
        let [cx, cy] = panel.at([x, y]);
        // Proposals above each other would hide each other.
        let above = found.places[..index]
            .iter()
            .filter(|each| each.position_mm[..2] == [x, y]);
        let aside = 2.0 * MARK_PX * above.count() as f64;
        numbered(&mut chart, [cx + aside, cy], index + 1);
    }
    chart.write(
        Anchor::Start,
        [90.0, 672.0],
        format!(
            "numbers: proposals, best first; square: worst goal at the best height ({})",
            found.basis
        ),
    );
    let names: Vec<String> = (0..=8).map(|count: usize| count.to_string()).collect();
    let counts = names.iter().enumerate();
    let counts = counts.map(|(count, name)| {
        (
            Sample::Area(Paint::Fixed(count_colour(count))),
            name.as_str(),
        )
    });
    chart.write(Anchor::Start, [90.0, 704.0], "feasible of 8:");
    legend(&mut chart, [220.0, 704.0], 740.0, counts);
    chart.write(
        Anchor::Start,
        [90.0, 734.0],
        "stroke: invalid base placement",
    );
    chart
}

/// Places from above, each once.
fn spots(found: &PlaceSearch) -> Vec<[f64; 2]> {
    let mut spots: Vec<[f64; 2]> = Vec::new();
    for sample in &found.samples {
        let [x, y, _] = sample.position_mm;
        if !spots.contains(&[x, y]) {
            spots.push([x, y]);
        }
    }
    spots
}

/// Axes of the same scale around all places.
fn axes(found: &PlaceSearch) -> [Axis; 2] {
    /// Space about the places, mm.
    const RIM_MM: f64 = 120.0;
    const ASPECT: f64 = 870.0 / 560.0;
    let range = |axis: usize| {
        let places = found.samples.iter().map(|each| each.position_mm[axis]);
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = places.fold(start, |(low, high), mm| (low.min(mm), high.max(mm)));
        [low - RIM_MM, high + RIM_MM]
    };
    let [x, y] = [range(0), range(1)];
    let [width, height] = [x[1] - x[0], y[1] - y[0]];
    let height_wanted = height.max(width / ASPECT);
    let width_wanted = height_wanted * ASPECT;
    let around = |[low, high]: [f64; 2], wanted: f64| {
        let middle = 0.5 * (low + high);
        [middle - 0.5 * wanted, middle + 0.5 * wanted]
    };
    let [x, y] = [around(x, width_wanted), around(y, height_wanted)];
    [
        Axis::linear("world x (mm)", x[0], x[1]),
        Axis::linear("world y (mm)", y[0], y[1]),
    ]
}

/// Table and patient from above.
fn outline(chart: &mut Chart, panel: &Panel, resolved: &ResolvedScenario) {
    if let Some(table) = &resolved.scenario.table {
        let (sine, cosine) = libm::sincos(table.yaw_deg.to_radians());
        let [x, y] = table.center_mm;
        let [half_x, half_y] = [0.5 * table.length_mm, 0.5 * table.width_mm];
        let corners = [
            [half_x, half_y],
            [half_x, -half_y],
            [-half_x, -half_y],
            [-half_x, half_y],
            [half_x, half_y],
        ];
        let at = |[along, across]: [f64; 2]| {
            [
                x + along * cosine - across * sine,
                y + along * sine + across * cosine,
            ]
        };
        let corners = corners.map(at);
        for pair in corners.windows(2) {
            // What lies beyond the panel ends at its rim.
            let ends = [panel.at(pair[0]), panel.at(pair[1])];
            chart.line(ends[0], ends[1], Stroke::full(Paint::Soft, 2.0));
        }
        chart.write(Anchor::Middle, panel.at([x, y - 0.8 * half_y]), "table");
    }
    if let Some(placed) = &resolved.phantom {
        let chest = placed.world_from_phantom.translation.vector * 1e3;
        let at = panel.at([chest.x, chest.y]);
        chart.circle(at, 7.0, Stroke::full(Paint::Ink, 2.0));
        chart.write(Anchor::Start, [at[0] + 12.0, at[1]], "mid-chest");
    }
}

/// From pale to dark.
fn count_colour(working: usize) -> Rgb {
    const NONE: Rgb = [236, 236, 236];
    const ENDS: [Rgb; 2] = [[206, 228, 244], [8, 48, 107]];
    if working == 0 {
        return NONE;
    }
    let share = (working.min(8) - 1) as f64 / 7.0;
    mixed(ENDS, share)
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::atomic::AtomicBool;

    use needlebench_bench::suggest::{suggest_entries, suggest_places};
    use needlebench_parallel::Control;
    use needlebench_parallel::Silent;
    use needlebench_scenario::{Overrides, ScenarioFamily};

    use super::*;

    #[test]
    fn maps_are_legible_and_all_proposals_are_on_them() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/supine_suite.toml");
        let family = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
        let control = Control {
            threads: 2,
            cancel: &AtomicBool::new(false),
            progress: &Silent,
        };
        let base = family.base();
        let found = suggest_entries(base, &base.scenario.goals[0], 3, &control).unwrap();
        assert_eq!(found.entries.len(), 3);
        let chart = entries_chart("supine_suite", &found);
        assert_eq!(chart.illegible(), None);
        let goals = [base.goals[0].name.clone()];
        let found = suggest_places(&family, &goals, 3, &control).unwrap();
        let chart = places_chart(base, &found);
        assert_eq!(chart.illegible(), None);
        for number in 1..=found.places.len() {
            assert!(chart.texts().any(|text| text.text == number.to_string()));
        }
    }
}
