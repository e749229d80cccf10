//! Families over roll against brute force.

use std::f64::consts::TAU;
use std::path::Path;

use needlebench_cell::Rule;
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::{Aim, EDGE_RAD, Family, Planner, RollRange, Shortfall};
use needlebench_scenario::{Goal, Overrides, ResolvedScenario, load_scenario, resolve_scenario};

/// Spacing of the brute force: 0.2 degrees.
const FINE: u32 = 1800;
/// Spacing of the sweep, so that the edges lie far from its rolls.
const COARSE: u32 = 72;
/// What the golden section leaves of its interval at most, 10 degrees, times slopes of a few units
/// per radian, where a value has a kink.
const VALUE: f64 = 0.01;
/// The same interval times a lever of 0.2 m, m.
const SHORTFALL_M: f64 = 5e-4;

fn shipped(name: &str) -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    load_scenario(&path.join(name), &Overrides::default()).expect("the shipped scenario is sound")
}

fn changed(name: &str, from: &str, to: &str) -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let text = std::fs::read_to_string(path.join(name)).unwrap();
    assert!(text.contains(from));
    let text = text.replace(from, to);
    resolve_scenario("test.toml", &text, &path, &Overrides::default())
        .unwrap_or_else(|findings| panic!("{findings:?}"))
}

fn families(planner: &Planner<'_>, goal: &Goal, rolls: u32) -> Vec<Family> {
    let mut grids = vec![Vec::new(); 8];
    for roll_rad in planner.rolls(goal, rolls) {
        for (grid, member) in grids.iter_mut().zip(planner.members_at(goal, roll_rad)) {
            grid.push(member);
        }
    }
    Configuration::ALL
        .into_iter()
        .map(|configuration| planner.family(goal, configuration, &grids[configuration.index()]))
        .collect()
}

fn holds(ranges: &[RollRange], roll_rad: f64, margin_rad: f64) -> bool {
    ranges.iter().any(|range| {
        range.is_whole_circle
            || [roll_rad, roll_rad + TAU].iter().any(|&roll_rad| {
                roll_rad >= range.from_rad - margin_rad && roll_rad <= range.to_rad + margin_rad
            })
    })
}

#[test]
fn ranges_are_those_of_brute_force() {
    let resolved = shipped("supine_suite.toml");
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    for goal in [&resolved.goals[1], &resolved.goals[3]] {
        let families = families(&planner, goal, COARSE);
        let (mut inside, mut outside) = (0, 0);
        for roll_rad in planner.rolls(goal, FINE) {
            let members = planner.members_at(goal, roll_rad);
            for (family, member) in families.iter().zip(members) {
                let name = family.configuration;
                if member.works() {
                    inside += 1;
                    assert!(
                        holds(&family.ranges, roll_rad, EDGE_RAD),
                        "{name} works at {roll_rad}"
                    );
                } else {
                    outside += 1;
                    assert!(
                        !holds(&family.ranges, roll_rad, -EDGE_RAD),
                        "{name} fails at {roll_rad}"
                    );
                }
            }
        }
        assert!(inside > 100 && outside > 100, "{inside} {outside}");
    }
}

#[test]
fn edges_name_the_rule_that_ends_the_range() {
    let resolved = shipped("supine_suite.toml");
    let goal = &resolved.goals[0];
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let mut count = 0;
    for family in families(&planner, goal, COARSE) {
        for range in &family.ranges {
            let ends = [
                (&range.before, range.from_rad),
                (&range.after, range.to_rad),
            ];
            for (edge, last_rad) in ends {
                let edge = edge
                    .as_ref()
                    .expect("no family of this goal works all round");
                let at = |roll_rad| {
                    planner.member_at(goal, family.configuration, f64::rem_euclid(roll_rad, TAU))
                };
                assert!(at(last_rad).works());
                let beyond = at(edge.roll_rad);
                assert_eq!(beyond.rejections[0].rule, edge.rejection.rule);
                let apart_rad = (edge.roll_rad - last_rad).rem_euclid(TAU);
                assert!(apart_rad.min(TAU - apart_rad) <= EDGE_RAD);
                count += 1;
            }
        }
    }
    assert!(count > 0);
}

#[test]
fn the_best_roll_of_a_range_is_as_good_as_every_roll_of_a_fine_grid() {
    let resolved = shipped("supine_suite.toml");
    let goal = &resolved.goals[1];
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let mut count = 0;
    for family in families(&planner, goal, COARSE) {
        for range in &family.ranges {
            for k in 0..=100 {
                let roll_rad = range.from_rad + range.width_rad() * f64::from(k) / 100.0;
                let member =
                    planner.member_at(goal, family.configuration, roll_rad.rem_euclid(TAU));
                let Some(candidate) = member.candidate.as_ref().filter(|_| member.works()) else {
                    continue;
                };
                for aim in Aim::ALL {
                    let best = range.best_for(aim);
                    assert!(best.member.works());
                    let chosen = best.member.candidate.as_ref().unwrap();
                    let chosen = planner.merit(goal, aim, chosen);
                    let other = planner.merit(goal, aim, candidate);
                    // First what will be judged and its reserve, then the aim.
                    let says = || format!("{} {aim:?}: {chosen:?} {other:?}", family.configuration);
                    let judged_m = chosen.shortfall.judged_m - other.shortfall.judged_m;
                    let reserve_m = chosen.shortfall.reserve_m - other.shortfall.reserve_m;
                    assert!(judged_m >= -SHORTFALL_M, "{} at {roll_rad}", says());
                    assert!(
                        judged_m > 0.0 || reserve_m >= -SHORTFALL_M,
                        "{} at {roll_rad}",
                        says()
                    );
                    if other.shortfall == Shortfall::NONE {
                        let is_as_good = chosen.value >= other.value - VALUE;
                        assert!(is_as_good, "{} at {roll_rad}", says());
                    }
                    assert_eq!(best.value.to_bits(), chosen.value.to_bits());
                    count += 1;
                }
            }
        }
    }
    assert!(count > 1000);
}

#[test]
fn a_fixed_roll_is_a_family_of_one() {
    let resolved = shipped("table3.toml");
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let goal = &resolved.goals[0];
    assert_eq!(planner.rolls(goal, 360), [0.0]);
    let members = planner.members_at(goal, 0.0);
    for (family, member) in families(&planner, goal, 360).iter().zip(&members) {
        assert_eq!(family.ranges.len(), usize::from(member.works()));
        for range in &family.ranges {
            assert_eq!((range.from_rad, range.to_rad), (0.0, 0.0));
            assert!(range.before.is_none() && range.after.is_none() && !range.is_whole_circle);
            assert_eq!(range.best.len(), Aim::ALL.len());
        }
    }
}

#[test]
fn out_of_reach_is_unreachable_at_every_roll() {
    let resolved = changed(
        "supine_suite.toml",
        "base_position_mm = [-280, 350, 1050]",
        "base_position_mm = [-280, 1550, 1050]",
    );
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let goal = &resolved.goals[0];
    for family in families(&planner, goal, 12) {
        assert!(family.ranges.is_empty());
    }
    for member in planner.members_at(goal, 1.0) {
        assert!(member.candidate.is_none() && member.surplus < -0.5);
        assert_eq!(member.rejections[0].rule, Rule::Unreachable);
    }
}

/// Without rules of clearance, a guide in line with wrist 3 turns wrist 3 alone: the whole circle is
/// one range and wrist 3 makes one turn.
#[test]
fn a_guide_in_line_with_wrist_3_turns_wrist_3_alone() {
    let mut resolved = changed(
        "supine_suite.toml",
        "urdf = \"perpendicular\"",
        "urdf = \"inline\"",
    );
    let planning = &mut resolved.scenario.planning;
    planning.require_needle_corridor = false;
    planning.min_clearance_mm = -1e6;
    planning.min_self_clearance_mm = -1e6;
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let mut whole = 0;
    for family in families(&planner, &resolved.goals[0], 36) {
        for range in &family.ranges {
            for joint in 0..5 {
                assert!(range.joint_span_rad[joint] < 1e-9, "{range:?}");
            }
            if range.is_whole_circle {
                whole += 1;
                assert!((range.width_rad() - TAU).abs() < 1e-12);
                assert!(range.fits_joint_limits);
            }
        }
    }
    assert!(whole > 0);
}
