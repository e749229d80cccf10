//! The atlas as a picture: a band per configuration, roll from left to right.
//!
//! The upper part of a band is the least clearance of the final posture, red where it is negative and
//! blue where it is positive; the lower part is the rule that rejects it. A tick marks the best roll
//! of each range.

use std::f64::consts::TAU;

use needlebench_cell::{Goal, Roll};
use needlebench_planning::{Member, Rule};

use super::GoalAtlas;
use crate::picture::Image;
use crate::picture::flat::{Canvas, Rgb};

/// Width of the map, px: three per degree.
const MAP_PX: usize = 1080;
const LEFT_PX: usize = 230;
const RIGHT_PX: usize = 30;
const TOP_PX: usize = 76;
/// Heights of the parts of a band and the gap below it, px.
const CLEARANCE_PX: usize = 34;
const RULE_PX: usize = 14;
const GAP_PX: usize = 16;
const LEGEND_PX: usize = 150;

/// Clearance at both ends of the colour scale, m.
const SCALE_M: f64 = 0.05;

const WORKS: Rgb = [46, 160, 87];
const NO_POSTURE: Rgb = [196, 196, 196];
const LINE: Rgb = [40, 44, 52];
const FAINT: Rgb = [214, 217, 222];

/// Rules in the order of the legend with their colours.
const RULES: [(Rule, Rgb); 7] = [
    (Rule::Collision, [205, 52, 52]),
    (Rule::NeedleCorridor, [242, 156, 31]),
    (Rule::Singular, [128, 82, 173]),
    (Rule::JointLimit, [122, 82, 48]),
    (Rule::Unreachable, NO_POSTURE),
    (Rule::Merged, [20, 20, 20]),
    (Rule::NearestOnly, [240, 110, 190]),
];

/// Draws a goal's atlas.
pub(crate) fn picture(scenario: &str, goal: &Goal, atlas: &GoalAtlas) -> Image {
    let band_px = CLEARANCE_PX + RULE_PX + GAP_PX;
    let map_bottom = TOP_PX + atlas.families.len() * band_px;
    let mut canvas = Canvas::new(
        LEFT_PX + MAP_PX + RIGHT_PX,
        map_bottom + LEGEND_PX,
        [255, 255, 255],
    );
    canvas.write_large(
        [20, 14],
        &format!(
            "{scenario}, goal {}: least clearance by configuration and roll",
            goal.name
        ),
    );
    canvas.write(
        [LEFT_PX, TOP_PX - 22],
        "roll of the guide about the needle (deg)",
    );
    for (index, family) in atlas.families.iter().enumerate() {
        let top = TOP_PX + index * band_px;
        canvas.write([20, top + 2], family.configuration.label());
        let width_deg: f64 = family
            .ranges
            .iter()
            .map(|range| range.width_rad().to_degrees())
            .sum();
        canvas.write(
            [20, top + 22],
            &if family.ranges.is_empty() {
                "works nowhere".to_owned()
            } else {
                format!("works for {width_deg:.0} deg")
            },
        );
        for x in 0..MAP_PX {
            let member = member_at(&atlas.members[index], x);
            let clearance = member.least_clearance().map_or(NO_POSTURE, |pair| {
                clearance_color(pair.separation.distance_m)
            });
            canvas.fill([LEFT_PX + x, top], [1, CLEARANCE_PX], clearance);
            canvas.fill(
                [LEFT_PX + x, top + CLEARANCE_PX],
                [1, RULE_PX],
                rule_color(member),
            );
        }
        for range in &family.ranges {
            let roll_rad = range.best_for(atlas.aim).member.roll_rad;
            mark(&mut canvas, roll_rad, top);
        }
        canvas.frame([LEFT_PX, top], [MAP_PX, CLEARANCE_PX + RULE_PX], LINE);
    }
    for degrees in (0..=360).step_by(30) {
        let x = LEFT_PX + MAP_PX * degrees / 360;
        for index in 0..atlas.families.len() {
            let top = TOP_PX + index * band_px + CLEARANCE_PX + RULE_PX;
            canvas.fill([x.min(LEFT_PX + MAP_PX - 1), top], [1, 5], LINE);
        }
        canvas.write_centred([x, map_bottom - 8], &degrees.to_string());
    }
    if let Roll::Fixed(roll_rad) = goal.roll {
        let x = LEFT_PX + pixel_of(roll_rad);
        canvas.fill([x, TOP_PX - 4], [2, map_bottom - TOP_PX], LINE);
        canvas.write_centred([x, TOP_PX - 40], "fixed by the goal");
    }
    legend(&mut canvas, map_bottom + 26, atlas);
    canvas.into_image()
}

/// A notch above and a line through the band at the best roll.
fn mark(canvas: &mut Canvas, roll_rad: f64, top: usize) {
    let x = LEFT_PX + pixel_of(roll_rad);
    canvas.fill(
        [x.saturating_sub(1), top - 5],
        [3, CLEARANCE_PX + 5],
        [0, 0, 0],
    );
    for row in 0..5 {
        canvas.fill(
            [x.saturating_sub(6 - row), top - 10 + row],
            [13 - 2 * row, 1],
            [0, 0, 0],
        );
    }
}

fn legend(canvas: &mut Canvas, top: usize, atlas: &GoalAtlas) {
    canvas.write([20, top], "least clearance (mm)");
    let scale_px = 400;
    for x in 0..scale_px {
        let share = 2.0 * x as f64 / (scale_px - 1) as f64 - 1.0;
        canvas.fill(
            [LEFT_PX + x, top],
            [1, 18],
            clearance_color(share * SCALE_M),
        );
    }
    canvas.frame([LEFT_PX, top], [scale_px, 18], LINE);
    for (share, label) in [
        (0.0, "-50"),
        (0.25, "-25"),
        (0.5, "0"),
        (0.75, "25"),
        (1.0, "50 and more"),
    ] {
        let x = LEFT_PX + pixel(share * scale_px as f64, scale_px);
        canvas.fill([x, top + 18], [1, 5], FAINT);
        canvas.write_centred([x, top + 22], label);
    }
    canvas.fill([LEFT_PX + scale_px + 120, top], [24, 18], NO_POSTURE);
    canvas.write([LEFT_PX + scale_px + 152, top], "no posture");
    canvas.write(
        [LEFT_PX + scale_px + 300, top],
        &format!("mark: best roll for {}", atlas.aim.name().replace('_', " ")),
    );
    let mut left = LEFT_PX;
    let row = top + 62;
    canvas.write([20, row], "rejected by");
    for (name, color) in std::iter::once(("works", WORKS)).chain(
        RULES
            .iter()
            .filter(|(rule, _)| occurs(atlas, *rule))
            .map(|(rule, color)| (rule.name(), *color)),
    ) {
        canvas.fill([left, row], [24, 18], color);
        canvas.write([left + 32, row], name);
        left += 32 + canvas.width_of(name) + 28;
    }
}

fn occurs(atlas: &GoalAtlas, rule: Rule) -> bool {
    atlas.members.iter().flatten().any(|member| {
        member
            .rejections
            .first()
            .is_some_and(|first| first.rule == rule)
    })
}

fn member_at(members: &[Member], x: usize) -> &Member {
    // The member whose roll is nearest to the pixel's middle.
    let index = (x * members.len() + MAP_PX / 2) / MAP_PX;
    &members[index % members.len()]
}

fn pixel_of(roll_rad: f64) -> usize {
    pixel(roll_rad.rem_euclid(TAU) / TAU * MAP_PX as f64, MAP_PX)
}

/// A place within `0..count`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped; NaN becomes zero"
)]
fn pixel(place: f64, count: usize) -> usize {
    (place.max(0.0) as usize).min(count - 1)
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
    let share = (clearance_m.abs() / SCALE_M).min(1.0);
    let colors = if clearance_m < 0.0 { &REDS } else { &BLUES };
    let place = share * 3.0;
    let from = pixel(place, 3);
    let part = place - from as f64;
    std::array::from_fn(|channel| {
        let (a, b) = (
            f64::from(colors[from][channel]),
            f64::from(colors[from + 1][channel]),
        );
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between two bytes"
        )]
        let mixed = (a + (b - a) * part).round() as u8;
        mixed
    })
}
