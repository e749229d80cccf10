//! Robustness radii by bounds of travel beside those by evaluating every layout.
//!
//! `cargo bench -p needlebench-bench --bench robustness [-- GOAL...]`: of the shipped layout study's cell, with
//! its limits, each configuration of the goals (the first one, if none is named) both ways. What they report
//! is compared; times are of the processor, of one thread.

use std::fs;
use std::path::Path;
use std::time::Duration;

use needlebench_bench::study::robustness::{Robustness, RobustnessSettings, robustness};
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::{Overrides, ScenarioFamily};

/// Time that this thread has been on a processor.
fn processor_time() -> Duration {
    // A call that gives way brings the account of the running thread up to date.
    std::thread::yield_now();
    let text = fs::read_to_string("/proc/thread-self/schedstat").expect("Linux keeps account");
    let ns = text.split(' ').next().and_then(|ns| ns.parse().ok());
    Duration::from_nanos(ns.expect("nanoseconds come first"))
}

fn timed(
    family: &ScenarioFamily,
    goal: &str,
    of: Configuration,
    by_bounds: bool,
) -> (Robustness, f64) {
    // As in `layouts.toml`.
    let settings = RobustnessSettings {
        max_shift_mm: 150.0,
        max_tilt_deg: 30.0,
        by_bounds,
        ..RobustnessSettings::default()
    };
    let started = processor_time();
    let found = robustness(family, goal, &[], of, &settings, None);
    let spent = processor_time().saturating_sub(started);
    let found = found.expect("a sound layout").expect("nobody cancelled it");
    (found, spent.as_secs_f64())
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    // `cargo test --benches` only asks whether it builds.
    if !arguments.iter().any(|argument| argument == "--bench") {
        return;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/studies/chest.toml");
    let family = ScenarioFamily::load(&path, &Overrides::default()).expect("shipped");
    let mut goals: Vec<&str> = family.goals().collect();
    goals.retain(|goal| arguments.iter().any(|argument| argument == goal));
    goals.extend(family.goals().next().filter(|_| goals.is_empty()));
    println!("goal, configuration: layouts looked at; ms by bounds, all evaluated, ratio");
    let mut sums = [0.0; 2];
    for goal in goals {
        for configuration in Configuration::ALL {
            let (by_bounds, quick_s) = timed(&family, goal, configuration, true);
            let (evaluated, slow_s) = timed(&family, goal, configuration, false);
            assert_eq!(by_bounds, evaluated, "the two ways differ");
            println!(
                "{goal:24} {:18} {:6} {:8.1} {:8.1} {:6.1}",
                configuration.label(),
                evaluated.evaluations,
                1e3 * quick_s,
                1e3 * slow_s,
                slow_s / quick_s
            );
            sums[0] += quick_s;
            sums[1] += slow_s;
        }
    }
    let [quick_s, slow_s] = sums;
    println!(
        "all: {quick_s:.2} s, {slow_s:.2} s, {:.1}",
        slow_s / quick_s
    );
}
