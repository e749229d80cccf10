//! The roll map as a table.

use std::fmt::Write;

use needlebench_bench::GoalAtlas;
use needlebench_cell::{Cell, rule_in_words};
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::{Aim, Edge, Member, RollRange};
use needlebench_scenario::{Goal, Roll};
use needlebench_show::plain_table;

/// A goal's ranges, with the best roll of each.
///
/// `wide` adds what ends a range, the margins of its best roll, and the infeasible configurations as rows of the table.
pub fn text(cell: &Cell, goal: &Goal, atlas: &GoalAtlas, wide: bool) -> String {
    let mut header = vec![
        "configuration",
        "feasible\n(deg)",
        "best roll\n(deg)",
        "minimum\nclearance\n(mm)",
        "between",
    ];
    if wide {
        header.extend([
            "rejected\nbefore",
            "rejected\nafter",
            "joint\nmargin",
            "|sin q5|",
            "|sin q3|",
        ]);
    }
    let mut table = plain_table(&header);
    let all = atlas.families.iter();
    for family in all.filter(|family| wide || !family.ranges.is_empty()) {
        let label = family.configuration.label().to_owned();
        if family.ranges.is_empty() {
            table.add_row([
                label.clone(),
                "none".to_owned(),
                String::new(),
                String::new(),
                nearest_miss(atlas, family.configuration),
            ]);
        }
        for range in &family.ranges {
            let mut row = row(cell, atlas, label.clone(), range);
            row.truncate(header.len());
            table.add_row(row);
        }
    }
    let fixed = match goal.roll {
        Roll::Fixed(roll_rad) => format!(
            "; the goal fixes the roll at {:.1} deg",
            roll_rad.to_degrees()
        ),
        Roll::Free => String::new(),
    };
    let mut text = format!("goal {}: {}", goal.name, answer(atlas));
    let _ = write!(
        text,
        "\n{} roll angles of the guide about the needle; best roll by {}{fixed}\n{table}",
        atlas.rolls_rad.len(),
        aim_in_words(atlas.aim),
    );
    let nowhere = atlas
        .families
        .iter()
        .filter(|family| !wide && family.ranges.is_empty());
    for family in nowhere {
        let _ = write!(
            text,
            "\ninfeasible at any roll: {} ({})",
            family.configuration.label(),
            nearest_miss(atlas, family.configuration)
        );
    }
    text
}

/// How many configurations are feasible at some roll, and which has the widest range.
fn answer(atlas: &GoalAtlas) -> String {
    let working = atlas
        .families
        .iter()
        .filter(|family| !family.ranges.is_empty());
    let count = working.clone().count();
    // The last of equals would come first.
    let freest = working
        .rev()
        .max_by(|a, b| width_rad(&a.ranges).total_cmp(&width_rad(&b.ranges)));
    let freest = freest.map_or(String::new(), |family| {
        format!(
            "; {} has the widest range, {:.0} of 360 deg",
            family.configuration.label(),
            width_rad(&family.ranges).to_degrees()
        )
    });
    format!(
        "{count} of {} configurations feasible{freest}",
        atlas.families.len()
    )
}

/// All rolls of some ranges together.
fn width_rad(ranges: &[RollRange]) -> f64 {
    ranges.iter().map(RollRange::width_rad).sum()
}

/// What a roll is best at.
fn aim_in_words(aim: Aim) -> &'static str {
    match aim {
        Aim::Clearance => "clearance",
        Aim::JointMargin => "joint-limit margin",
        Aim::Singularity => "singularity margin",
        Aim::TipAccuracy => "tip accuracy",
        Aim::Balanced => "all aims combined",
    }
}

fn row(cell: &Cell, atlas: &GoalAtlas, label: String, range: &RollRange) -> Vec<String> {
    let degrees = |rad: f64| format!("{:.2}", rad.to_degrees());
    let edge = |edge: &Option<Edge>| {
        edge.as_ref().map_or(String::new(), |edge| {
            rule_in_words(edge.rejection.rule.name()).to_owned()
        })
    };
    let best = &range.best_for(atlas.aim).member;
    let least = best.least_clearance();
    let margins = best.candidate.as_ref().map(|candidate| candidate.margins);
    let margin = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.2}"));
    let works = if range.is_whole_circle {
        "all angles".to_owned()
    } else {
        format!("{} to {}", degrees(range.from_rad), degrees(range.to_rad))
    };
    vec![
        label,
        works,
        degrees(best.roll_rad),
        least.map_or(String::new(), |pair| {
            format!("{:.1}", pair.separation.distance_m * 1e3)
        }),
        least.map_or(String::new(), |pair| {
            let [a, b] = pair.in_words(cell);
            format!("{a}, {b}")
        }),
        edge(&range.before),
        edge(&range.after),
        margin(margins.map(|margins| margins.joint_limit)),
        margin(margins.map(|margins| margins.wrist_sine)),
        margin(margins.map(|margins| margins.elbow_sine)),
    ]
}

/// Why a configuration is infeasible at any roll: the rule of the roll with the largest constraint margin.
fn nearest_miss(atlas: &GoalAtlas, configuration: Configuration) -> String {
    atlas.members[configuration.index()]
        .iter()
        .max_by(|a, b| a.surplus.total_cmp(&b.surplus))
        .map_or(String::new(), |member: &Member| {
            let rule = member
                .rejections
                .first()
                .map_or("", |rejection| rejection.rule.name());
            format!(
                "{} at {:.0} deg",
                rule_in_words(rule),
                member.roll_rad.to_degrees()
            )
        })
}
