//! Motions around what blocks the straight one, over a hundred seeds: success, time, effort.
//!
//! `cargo bench -p needlebench-planning --bench transfer`
//!
//! Plans every goal of `scenarios/parked_low.toml` whole (rolls, straight motions, searches) with each
//! seed. Times are of all eight configurations of a goal together; the straight motions are planned
//! once more without a search, and what that takes is the search's share.

use std::path::Path;
use std::time::Instant;

use needlebench_clearance::ClearanceModel;
use needlebench_planning::Planner;
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

const SEEDS: u64 = 100;

fn parked_low(seed: u64, checks: u32) -> ResolvedScenario {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let text = std::fs::read_to_string(folder.join("parked_low.toml"))
        .expect("the shipped scenario is there")
        .replace("seed = 1", &format!("seed = {seed}"))
        .replace(
            "[planning]\n",
            &format!("[planning]\nmotion_checks = {checks}\n"),
        );
    resolve_scenario("parked_low.toml", &text, &folder, &Overrides::default())
        .expect("the shipped scenario is sound")
}

fn main() {
    // Cargo passes `--bench`; test runners pass names to list. Neither matters here.
    println!("parked_low, {SEEDS} seeds");
    println!(
        "{:<22} {:<18} {:>8} {:>12} {:>12}",
        "goal", "configuration", "success", "median (ms)", "max (ms)"
    );
    for goal in 0..2 {
        let mut found = [0_u64; 8];
        let mut searched = [0_u64; 8];
        let mut whole_ms = Vec::new();
        let mut names = [String::new(), String::new()];
        let mut checks = Vec::new();
        for seed in 1..=SEEDS {
            let resolved = parked_low(seed, 60_000);
            let model = ClearanceModel::new(&resolved.cell);
            let planner = Planner::new(&resolved, &model).expect("the UR3 is a UR arm");
            names[0].clone_from(&resolved.goals[goal].name);
            let started = Instant::now();
            let plan = planner.plan(&resolved.goals[goal]);
            whole_ms.push(started.elapsed().as_secs_f64() * 1e3);
            for (index, each) in plan.configurations.iter().enumerate() {
                if let Some(effort) = each.search {
                    searched[index] += 1;
                    found[index] += u64::from(each.rejections.is_empty());
                    checks.push(effort.checks);
                }
            }
        }
        let straight = parked_low(1, 0);
        let model = ClearanceModel::new(&straight.cell);
        let planner = Planner::new(&straight, &model).expect("the UR3 is a UR arm");
        let started = Instant::now();
        let plan = planner.plan(&straight.goals[goal]);
        let straight_ms = started.elapsed().as_secs_f64() * 1e3;
        whole_ms.sort_by(f64::total_cmp);
        checks.sort_unstable();
        for (index, each) in plan.configurations.iter().enumerate() {
            if searched[index] > 0 {
                println!(
                    "{:<22} {:<18} {:>4}/{:<4}",
                    names[0],
                    each.configuration.label(),
                    found[index],
                    searched[index]
                );
            }
        }
        println!(
            "{:<22} {:<18} {:>8} {:>12.1} {:>12.1}   straight motions alone: {straight_ms:.1} ms; \
             postures per search: median {}, max {}",
            names[0],
            "all eight",
            "",
            whole_ms[whole_ms.len() / 2],
            whole_ms[whole_ms.len() - 1],
            checks.get(checks.len() / 2).copied().unwrap_or(0),
            checks.last().copied().unwrap_or(0),
        );
    }
}
