//! What transfers keep of the clearance that start and approach leave, over five seeds, on all shipped
//! scenarios: how searches end, by how much their seeds differ, and what the slowest takes.
//!
//! `cargo bench -p needlebench-planning --bench margins`

use std::path::Path;
use std::time::Instant;

use needlebench_clearance::ClearanceModel;
use needlebench_planning::{ClassLimits, ConfigurationPlan, Planner, SearchEnd};
use needlebench_scenario::{Overrides, load_scenario};

const SEEDS: u64 = 5;

/// By how much a motion misses what start and approach keep, at most over the classes, beyond what is ample
/// nothing, m.
fn missing_m(plan: &ConfigurationPlan, limits: &ClassLimits) -> Option<f64> {
    let classes = &plan.margin.as_ref()?.classes;
    let missing = classes.iter().map(|class| {
        let ample_m = limits.get(class.class).ample_m;
        class.attainable_m.min(ample_m) - class.achieved_m
    });
    missing.reduce(f64::max)
}

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let mut names: Vec<_> = std::fs::read_dir(&folder)
        .expect("the shipped scenarios are there")
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let is_scenario = path.extension().is_some_and(|ending| ending == "toml");
            path.file_name()
                .filter(|_| is_scenario)?
                .to_str()
                .map(str::to_owned)
        })
        .collect();
    names.sort();
    println!(
        "{:<18} {:<22} {:<18} {:>7} {:>28} {:>9} {:>10}",
        "scenario",
        "goal",
        "configuration",
        "ends",
        "missing, mm, by seed",
        "postures",
        "ms, worst"
    );
    for name in names {
        let mut resolved = load_scenario(&folder.join(&name), &Overrides::default())
            .expect("the shipped scenarios are sound");
        let model = ClearanceModel::new(&resolved.cell);
        for goal in 0..resolved.goals.len() {
            let mut by_seed = Vec::new();
            let mut whole_ms: Vec<f64> = Vec::new();
            for seed in 1..=SEEDS {
                resolved.scenario.seed = seed;
                let planner = Planner::new(&resolved, &model).expect("a UR arm");
                let started = Instant::now();
                let plan = planner.plan(&resolved.goals[goal]);
                whole_ms.push(started.elapsed().as_secs_f64() * 1e3);
                by_seed.push(plan.configurations);
            }
            let limits = ClassLimits::of(&resolved.scenario);
            let goal_name = &resolved.goals[goal].name;
            for index in 0..by_seed[0].len() {
                let plans: Vec<&ConfigurationPlan> =
                    by_seed.iter().map(|plans| &plans[index]).collect();
                if plans.iter().all(|plan| plan.search.is_none()) {
                    continue;
                }
                let ends: String = plans
                    .iter()
                    .map(|plan| match plan.margin.as_ref().map(|margin| margin.end) {
                        Some(SearchEnd::Bound) => 'b',
                        Some(SearchEnd::Proof) => 'p',
                        Some(SearchEnd::Budget) => '?',
                        None => '-',
                    })
                    .collect();
                let missing: Vec<String> = plans
                    .iter()
                    .map(|plan| {
                        missing_m(plan, &limits)
                            .map_or("-".to_owned(), |m| format!("{:.2}", m * 1e3))
                    })
                    .collect();
                let checks = plans.iter().filter_map(|plan| plan.search);
                let checks = checks.map(|search| search.checks).max().unwrap_or(0);
                println!(
                    "{name:<18} {goal_name:<22} {:<18} {ends:>7} {:>28} {checks:>9}",
                    plans[0].configuration.label(),
                    missing.join(" "),
                );
            }
            let worst_ms = whole_ms.iter().copied().fold(0.0, f64::max);
            println!(
                "{name:<18} {goal_name:<22} {:<18} {:>48} {worst_ms:>10.1}",
                "all eight", ""
            );
        }
    }
}
