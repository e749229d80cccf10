//! The roll map as a chart: a band per configuration, roll from left to right.
//!
//! The upper part of a band is the least clearance of the final posture, red where it is negative and blue where it is
//! positive; the lower part is the rule that rejects it, or blue where it is feasible. A tick marks the best roll of
//! each range.

use std::f64::consts::TAU;

use needlebench_bench::GoalAtlas;
use needlebench_cell::Rule;
use needlebench_planning::Member;
use needlebench_scenario::{Goal, Roll};
use needlebench_show::chart::{
    Anchor, Chart, LEGEND_ROW_PX, Mark, Paint, Rgb, Sample, Size, Stroke, legend, mixed,
};

/// Width of the map, px: three per degree.
const MAP_PX: f64 = 1080.0;
const LEFT_PX: f64 = 230.0;
const RIGHT_PX: f64 = 40.0;
const TOP_PX: f64 = 100.0;
/// Heights of the parts of a band and the gap below it, px.
const CLEARANCE_PX: f64 = 34.0;
const RULE_PX: f64 = 14.0;
const GAP_PX: f64 = 18.0;
const BAND_PX: f64 = CLEARANCE_PX + RULE_PX + GAP_PX;
/// From the last band to the names of the rolls and to the axis, and from there to the legend, px.
const BELOW_PX: [f64; 2] = [4.0, 26.0];
const LEGEND_PX: f64 = 60.0;

/// Clearance at both ends of the colour scale, m.
const SCALE_M: f64 = 0.05;

/// What works, and where there is no posture.
const WORKS: Rgb = [0, 114, 178];
const NO_POSTURE: Rgb = [200, 203, 207];

/// Rules in the order of the legend with their colours, which people with any colour vision tell apart.
const RULES: [(Rule, Rgb); 9] = [
    (Rule::NeedleRoute, [150, 50, 110]),
    (Rule::Collision, [213, 94, 0]),
    (Rule::TooClose, [255, 160, 122]),
    (Rule::NeedleCorridor, [255, 200, 60]),
    (Rule::Singular, [204, 121, 167]),
    (Rule::JointLimit, [120, 66, 20]),
    (Rule::Unreachable, NO_POSTURE),
    (Rule::Merged, [20, 20, 20]),
    (Rule::NearestOnly, [140, 205, 245]),
];

/// Colour of what rejects a posture, by the rule's name, and under `works` of what does not.
pub(crate) fn rule_colors() -> impl Iterator<Item = (&'static str, Rgb)> {
    let rules = RULES.iter().map(|(rule, color)| (rule.name(), *color));
    std::iter::once(("works", WORKS)).chain(rules)
}

/// The chart of a goal's atlas.
pub(crate) fn atlas_chart(scenario: &str, goal: &Goal, atlas: &GoalAtlas) -> Chart {
    let foot = TOP_PX + atlas.families.len() as f64 * BAND_PX;
    let title = format!(
        "{scenario}, goal {}: minimum clearance by configuration and roll",
        goal.name
    );
    let size = [LEFT_PX + MAP_PX + RIGHT_PX, foot + LEGEND_PX + 130.0];
    let mut chart = Chart::new(size, &*title);
    chart.write_large([20.0, 24.0], title);
    for (index, family) in atlas.families.iter().enumerate() {
        let top = TOP_PX + index as f64 * BAND_PX;
        let label = family.configuration.label();
        chart.write(Anchor::Start, [20.0, top + 12.0], label);
        let width_deg: f64 = family
            .ranges
            .iter()
            .map(|range| range.width_rad().to_degrees())
            .sum();
        let works = if family.ranges.is_empty() {
            "infeasible".to_owned()
        } else {
            format!("feasible for {width_deg:.0} deg")
        };
        chart.write(Anchor::Start, [20.0, top + 32.0], works);
        let members = &atlas.members[index];
        strip(&mut chart, members, [top, CLEARANCE_PX], clearance_of);
        strip(
            &mut chart,
            members,
            [top + CLEARANCE_PX, RULE_PX],
            rule_color,
        );
        for range in &family.ranges {
            mark(&mut chart, range.best_for(atlas.aim).member.roll_rad, top);
        }
        let size = [MAP_PX, CLEARANCE_PX + RULE_PX];
        chart.frame([LEFT_PX, top], size, Paint::Ink);
    }
    axis(&mut chart, foot);
    if let Roll::Fixed(roll_rad) = goal.roll {
        let x = LEFT_PX + place_of(roll_rad);
        let line = Stroke::full(Paint::Ink, 2.0);
        chart.line([x, TOP_PX - 14.0], [x, foot - GAP_PX], line);
        let text = "fixed by the goal";
        let half = 0.5 * Size::Small.width(text);
        let x = x.clamp(LEFT_PX + half, LEFT_PX + MAP_PX - half);
        chart.write(Anchor::Middle, [x, TOP_PX - 26.0], text);
    }
    key(&mut chart, foot + LEGEND_PX, atlas);
    chart
}

/// A strip with a colour for each roll; neighbours of one colour are one rectangle.
fn strip(
    chart: &mut Chart,
    members: &[Member],
    [top, height]: [f64; 2],
    color: impl Fn(&Member) -> Rgb,
) {
    // A member stands for the rolls that are nearest to its own: half a step to either side.
    let edge = |index: usize| {
        let share = (index as f64 - 0.5) / members.len() as f64;
        (share.clamp(0.0, 1.0) * MAP_PX).round()
    };
    // The first one's other half is at the end.
    let mut colors: Vec<Rgb> = members.iter().map(color).collect();
    colors.extend(colors.first().copied());
    let mut start = 0;
    for index in 1..=colors.len() {
        if index == colors.len() || colors[index] != colors[start] {
            let (from, to) = (
                edge(start),
                if index == colors.len() {
                    MAP_PX
                } else {
                    edge(index)
                },
            );
            let fill = Paint::Fixed(colors[start]);
            chart.fill([LEFT_PX + from, top], [to - from, height], fill);
            start = index;
        }
    }
}

/// Rolls below the map.
fn axis(chart: &mut Chart, foot: f64) {
    let bands = foot - GAP_PX;
    for degrees in (0..=360).step_by(30) {
        let x = LEFT_PX + MAP_PX * f64::from(degrees) / 360.0;
        let tick = Stroke::full(Paint::Ink, 1.0);
        chart.line([x, bands], [x, bands + 6.0], tick);
        let at = [x, foot + BELOW_PX[0]];
        chart.write(Anchor::Middle, at, degrees.to_string());
    }
    let at = [LEFT_PX + 0.5 * MAP_PX, foot + BELOW_PX[1]];
    chart.write(
        Anchor::Middle,
        at,
        "roll of the guide about the needle (deg)",
    );
}

/// An arrow head above and a line through the band at the best roll.
fn mark(chart: &mut Chart, roll_rad: f64, top: f64) {
    let x = LEFT_PX + place_of(roll_rad);
    let line = Stroke::full(Paint::Ink, 2.5);
    chart.line([x, top - 4.0], [x, top + CLEARANCE_PX], line);
    chart.add(Mark::Polygon {
        points: vec![[x - 6.0, top - 11.0], [x + 6.0, top - 11.0], [x, top - 2.0]],
        fill: Paint::Ink,
    });
}

fn key(chart: &mut Chart, top: f64, atlas: &GoalAtlas) {
    /// Width of the colour scale and of one of its steps, px.
    const SCALE_PX: f64 = 400.0;
    const STEPS: u32 = 200;
    chart.write(Anchor::Start, [20.0, top + 9.0], "upper strip:");
    chart.write(Anchor::Start, [20.0, top + 29.0], "minimum clearance (mm)");
    for step in 0..STEPS {
        let share = (2.0 * f64::from(step) + 1.0) / f64::from(STEPS) - 1.0;
        let width = SCALE_PX / f64::from(STEPS);
        let fill = Paint::Fixed(clearance_color(share * SCALE_M));
        let left = LEFT_PX + width * f64::from(step);
        chart.fill([left, top], [width, 18.0], fill);
    }
    chart.frame([LEFT_PX, top], [SCALE_PX, 18.0], Paint::Ink);
    for (share, label) in [
        (0.0, "-50"),
        (0.25, "-25"),
        (0.5, "0"),
        (0.75, "25"),
        (1.0, "50 or more"),
    ] {
        let x = LEFT_PX + share * SCALE_PX;
        chart.line(
            [x, top + 18.0],
            [x, top + 22.0],
            Stroke::full(Paint::Soft, 1.0),
        );
        chart.write(Anchor::Middle, [x, top + 31.0], label);
    }
    let right = LEFT_PX + SCALE_PX;
    let none = [(Sample::Area(Paint::Fixed(NO_POSTURE)), "no posture")];
    legend(chart, [right + 110.0, top + 9.0], MAP_PX, none);
    let best = format!("mark: best roll for {}", atlas.aim.name().replace('_', " "));
    chart.write(Anchor::Start, [right + 290.0, top + 9.0], best);
    let row = top + 70.0;
    chart.write(Anchor::Start, [20.0, row], "lower strip");
    let works = [(Sample::Area(Paint::Fixed(WORKS)), "feasible")];
    legend(chart, [LEFT_PX, row], MAP_PX, works);
    chart.write(Anchor::Start, [20.0, row + LEGEND_ROW_PX], "rejected by");
    let rules = RULES.iter().filter(|(rule, _)| occurs(atlas, *rule));
    let names: Vec<(String, Rgb)> = rules
        .map(|(rule, color)| (rule.name().replace('_', " "), *color))
        .collect();
    let entries = names
        .iter()
        .map(|(name, color)| (Sample::Area(Paint::Fixed(*color)), name.as_str()));
    legend(
        chart,
        [LEFT_PX, row + LEGEND_ROW_PX],
        MAP_PX + RIGHT_PX,
        entries,
    );
}

fn occurs(atlas: &GoalAtlas, rule: Rule) -> bool {
    atlas.members.iter().flatten().any(|member| {
        member
            .rejections
            .first()
            .is_some_and(|first| first.rule == rule)
    })
}

/// From the left end of the map, px.
fn place_of(roll_rad: f64) -> f64 {
    roll_rad.rem_euclid(TAU) / TAU * MAP_PX
}

fn clearance_of(member: &Member) -> Rgb {
    member.least_clearance().map_or(NO_POSTURE, |pair| {
        clearance_color(pair.separation.distance_m)
    })
}

fn rule_color(member: &Member) -> Rgb {
    let Some(first) = member.rejections.first() else {
        return WORKS;
    };
    RULES
        .iter()
        .find(|(rule, _)| *rule == first.rule)
        .map_or([0, 0, 0], |(_, color)| *color)
}

/// Red below zero, blue above, pale next to it; a step at zero, so that the sign is never in doubt.
fn clearance_color(clearance_m: f64) -> Rgb {
    const REDS: [Rgb; 4] = [[252, 205, 180], [240, 130, 96], [203, 40, 40], [103, 0, 20]];
    const BLUES: [Rgb; 4] = [
        [214, 232, 244],
        [128, 186, 220],
        [46, 122, 184],
        [8, 48, 107],
    ];
    let colors = if clearance_m < 0.0 { &REDS } else { &BLUES };
    let place = 3.0 * (clearance_m.abs() / SCALE_M).min(1.0);
    let from = if place < 1.0 {
        0
    } else if place < 2.0 {
        1
    } else {
        2
    };
    mixed([colors[from], colors[from + 1]], place - from as f64)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use needlebench_bench::goal_atlas;
    use needlebench_clearance::ClearanceModel;
    use needlebench_planning::Aim;
    use needlebench_scenario::{Overrides, load_scenario};

    use super::*;
    use needlebench_show::chart::confused;

    #[test]
    fn rules_are_told_apart_with_any_colour_vision() {
        let colors: Vec<Rgb> = rule_colors().map(|(_, color)| color).collect();
        assert_eq!(confused(&colors), None);
    }

    #[test]
    fn atlases_are_legible_and_their_strips_have_no_gaps() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../needlebench/tests/cli/small.toml");
        let resolved = load_scenario(&path, &Overrides::default()).unwrap();
        let model = ClearanceModel::new(&resolved.cell);
        let mut goal = resolved.goals[0].clone();
        let atlas = goal_atlas(&resolved, &model, &goal, 24, Aim::Balanced, 1).unwrap();
        for roll in [Roll::Free, Roll::Fixed(0.0), Roll::Fixed(6.2)] {
            goal.roll = roll;
            let chart = atlas_chart("small", &goal, &atlas);
            assert_eq!(chart.illegible(), None);
        }
        let chart = atlas_chart("small", &goal, &atlas);
        let mut covered = 0.0;
        for (mark, _) in &chart.marks {
            if let Mark::Rectangle { size, .. } = mark
                && size[1] == CLEARANCE_PX
            {
                covered += size[0];
            }
        }
        assert_eq!(covered, MAP_PX * atlas.families.len() as f64);
    }
}
