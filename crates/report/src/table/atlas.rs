//! The atlas as a table.

use needlebench_bench::GoalAtlas;
use needlebench_cell::{Cell, Goal, Roll, rule_in_words};
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::{Aim, Edge, Member, RollRange};

use super::plain_table;

/// A goal's ranges, with the best roll of each.
pub fn text(cell: &Cell, goal: &Goal, atlas: &GoalAtlas) -> String {
    let mut table = plain_table(&[
        "configuration",
        "works\nfrom (deg)",
        "\nto (deg)",
        "before it",
        "after it",
        "best\nroll (deg)",
        "nearest\n(mm)",
        "between",
        "joint\nmargin",
        "|sin q5|",
        "|sin q3|",
    ]);
    for family in &atlas.families {
        let label = family.configuration.label().to_owned();
        if family.ranges.is_empty() {
            table.add_row([
                label.clone(),
                "nowhere".to_owned(),
                String::new(),
                nearest_miss(atlas, family.configuration),
            ]);
        }
        for range in &family.ranges {
            table.add_row(row(cell, atlas, label.clone(), range));
        }
    }
    let fixed = match goal.roll {
        Roll::Fixed(roll_rad) => format!("; the goal fixes {:.1} deg", roll_rad.to_degrees()),
        Roll::Free => String::new(),
    };
    format!(
        "goal {}: {} rolls of the guide about the needle; the best roll is best for {}{fixed}\n{table}",
        goal.name,
        atlas.rolls_rad.len(),
        aim_in_words(atlas.aim),
    )
}

/// What a roll is best at.
fn aim_in_words(aim: Aim) -> &'static str {
    match aim {
        Aim::Clearance => "clearance",
        Aim::JointMargin => "distance from the joint limits",
        Aim::Singularity => "distance from singularities",
        Aim::TipAccuracy => "accuracy of the tip",
        Aim::Balanced => "all aims together",
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
    let (from, to) = if range.is_whole_circle {
        ("all round".to_owned(), String::new())
    } else {
        (degrees(range.from_rad), degrees(range.to_rad))
    };
    vec![
        label,
        from,
        to,
        edge(&range.before),
        edge(&range.after),
        degrees(best.roll_rad),
        least.map_or(String::new(), |pair| {
            format!("{:.1}", pair.separation.distance_m * 1e3)
        }),
        least.map_or(String::new(), |pair| {
            let [a, b] = pair.in_words(cell);
            format!("{a}, {b}")
        }),
        margin(margins.map(|margins| margins.joint_limit)),
        margin(margins.map(|margins| margins.wrist_sine)),
        margin(margins.map(|margins| margins.elbow_sine)),
    ]
}

/// Why a configuration works nowhere: the rule of the roll that comes nearest to working.
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
