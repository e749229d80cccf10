//! The roll map as JSON.

use std::collections::BTreeMap;

use needlebench_cell::Cell;
use needlebench_evaluation::report::Provenance;
use needlebench_planning::{Best, Edge, Member, RollRange};
use needlebench_scenario::{Goal, ResolvedScenario, Roll};
use serde::Serialize;

use super::GoalAtlas;
use crate::provenance::provenance;

/// Roll maps of a scenario's goals.
#[derive(Debug, Serialize)]
pub struct AtlasReport {
    /// Version of this layout.
    pub schema_version: u32,
    /// Name of the scenario.
    pub scenario: String,
    /// Where the numbers come from.
    pub provenance: Provenance,
    /// One entry per goal.
    pub goals: Vec<GoalAtlasReport>,
}

impl AtlasReport {
    /// Of the goals of a scenario.
    pub fn new(resolved: &ResolvedScenario, goals: Vec<GoalAtlasReport>) -> Self {
        Self {
            schema_version: 1,
            scenario: resolved.scenario.name.clone(),
            provenance: provenance(resolved, Vec::new()),
            goals,
        }
    }
}

/// Roll map of one goal.
#[derive(Debug, Serialize)]
pub struct GoalAtlasReport {
    /// Name of the goal.
    pub name: String,
    /// The roll that the goal fixes, if it does; the roll map covers all rolls in either case.
    pub fixed_roll_rad: Option<f64>,
    /// What rolls are chosen for.
    pub aim: &'static str,
    /// Rolls of the grid, ascending.
    pub rolls_rad: Vec<f64>,
    /// One entry per configuration.
    pub branches: Vec<BranchReport>,
}

/// One configuration over the roll.
#[derive(Debug, Serialize)]
pub struct BranchReport {
    /// Label of the configuration.
    pub label: &'static str,
    /// Ranges of the roll in which it is feasible.
    pub ranges: Vec<RangeReport>,
    /// Least clearance of the final posture at each roll, intended stand-off left out; null where
    /// there is no posture.
    pub least_clearance_m: Vec<Option<f64>>,
    /// Its class.
    pub class: Vec<Option<&'static str>>,
    /// First rule that rejects the posture at each roll; null where it is feasible.
    pub rule: Vec<Option<&'static str>>,
    /// Constraint margin: least distance from violating a rule, negative where one is violated.
    pub surplus_m: Vec<f64>,
    /// Margin to the joint limits by roll, 0 to 1.
    pub joint_margin: Vec<Option<f64>>,
    /// Margin to singularities by roll, 0 to 1.
    pub singularity_margin: Vec<Option<f64>>,
    /// Final posture by roll.
    pub joints_rad: Vec<Option<[f64; 6]>>,
}

#[derive(Debug, Serialize)]
pub struct RangeReport {
    pub from_rad: f64,
    pub to_rad: f64,
    pub width_rad: f64,
    pub is_whole_circle: bool,
    pub before: Option<EdgeReport>,
    pub after: Option<EdgeReport>,
    pub joint_span_rad: [f64; 6],
    pub fits_joint_limits: bool,
    /// By aim.
    pub best: BTreeMap<&'static str, BestReport>,
}

#[derive(Debug, Serialize)]
pub struct EdgeReport {
    pub roll_rad: f64,
    pub rule: &'static str,
    pub value: f64,
    pub limit: f64,
    pub unit: &'static str,
    pub detail: String,
}

#[derive(Debug, Serialize)]
pub struct BestReport {
    pub roll_rad: f64,
    /// In the aim's own unit.
    pub value: f64,
    pub joints_rad: Option<[f64; 6]>,
    pub least_clearance_m: Option<f64>,
    pub pair: Option<[String; 2]>,
    pub joint_margin: Option<f64>,
    pub wrist_sine: Option<f64>,
    pub elbow_sine: Option<f64>,
    pub shoulder_m: Option<f64>,
}

impl GoalAtlasReport {
    /// The roll map of a goal, as computed.
    pub fn new(cell: &Cell, goal: &Goal, atlas: &GoalAtlas) -> Self {
        let branches = atlas
            .families
            .iter()
            .zip(&atlas.members)
            .map(|(family, members)| BranchReport {
                label: family.configuration.label(),
                ranges: family
                    .ranges
                    .iter()
                    .map(|range| range_report(cell, range))
                    .collect(),
                least_clearance_m: each(members, |member| {
                    Some(member.least_clearance()?.separation.distance_m)
                }),
                class: each(members, |member| {
                    Some(member.least_clearance()?.class.name())
                }),
                rule: each(members, |member| {
                    Some(member.rejections.first()?.rule.name())
                }),
                surplus_m: members.iter().map(|member| member.surplus).collect(),
                joint_margin: each(members, |member| {
                    Some(member.candidate.as_ref()?.margins.joint_limit)
                }),
                singularity_margin: each(members, |member| {
                    let margins = &member.candidate.as_ref()?.margins;
                    Some(margins.wrist_sine.min(margins.elbow_sine))
                }),
                joints_rad: each(members, |member| {
                    Some(member.candidate.as_ref()?.joints.into())
                }),
            })
            .collect();
        Self {
            name: goal.name.clone(),
            fixed_roll_rad: match goal.roll {
                Roll::Fixed(roll_rad) => Some(roll_rad),
                Roll::Free => None,
            },
            aim: atlas.aim.name(),
            rolls_rad: atlas.rolls_rad.clone(),
            branches,
        }
    }
}

fn each<T>(members: &[Member], read: impl Fn(&Member) -> Option<T>) -> Vec<Option<T>> {
    members.iter().map(read).collect()
}

fn range_report(cell: &Cell, range: &RollRange) -> RangeReport {
    RangeReport {
        from_rad: range.from_rad,
        to_rad: range.to_rad,
        width_rad: range.width_rad(),
        is_whole_circle: range.is_whole_circle,
        before: range.before.as_ref().map(edge_report),
        after: range.after.as_ref().map(edge_report),
        joint_span_rad: range.joint_span_rad.into(),
        fits_joint_limits: range.fits_joint_limits,
        best: range
            .best
            .iter()
            .map(|best| (best.aim.name(), best_report(cell, best)))
            .collect(),
    }
}

fn edge_report(edge: &Edge) -> EdgeReport {
    let rejection = &edge.rejection;
    EdgeReport {
        roll_rad: edge.roll_rad,
        rule: rejection.rule.name(),
        value: rejection.value,
        limit: rejection.limit,
        unit: rejection.unit,
        detail: rejection.detail.clone(),
    }
}

fn best_report(cell: &Cell, best: &Best) -> BestReport {
    let least = best.member.least_clearance();
    let margins = best
        .member
        .candidate
        .as_ref()
        .map(|candidate| candidate.margins);
    BestReport {
        roll_rad: best.member.roll_rad,
        value: best.value,
        joints_rad: best
            .member
            .candidate
            .as_ref()
            .map(|candidate| candidate.joints.into()),
        least_clearance_m: least.map(|pair| pair.separation.distance_m),
        pair: least.map(|pair| {
            let (a, b) = pair.solid_names(cell);
            [a.to_owned(), b.to_owned()]
        }),
        joint_margin: margins.map(|margins| margins.joint_limit),
        wrist_sine: margins.map(|margins| margins.wrist_sine),
        elbow_sine: margins.map(|margins| margins.elbow_sine),
        shoulder_m: margins.map(|margins| margins.shoulder_m),
    }
}
