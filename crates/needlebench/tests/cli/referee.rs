//! `run --reference` and the envelope of the engines' differences.

use serde_json::Value;

use crate::support::{Bench, Json, SMALL, has_keys, holds, mujoco_is_ready, with_edit};

/// `SMALL` with another envelope.
fn with_envelope(keys: &str) -> String {
    with_edit(SMALL, "peak_tip_um = 10", keys)
}

fn simulated(report: &Value) -> Vec<&Value> {
    let configurations = report["goals"][0]["configurations"].list();
    configurations
        .iter()
        .filter(|each| each["engine_difference"].is_object())
        .collect()
}

#[test]
fn referee_measures_both_engines_and_their_order() {
    mujoco_is_ready();
    let bench = Bench::with_scenario(SMALL);
    let answer = bench.run("run s.toml --referee --wide").exits_with(0);
    answer.says(["engines compared with the reference integrator"]);
    let report = bench.read_json("out/small/report.json");
    let engines = report["provenance"]["engines"].list();
    assert!(engines.iter().any(|each| each["name"] == "referee"));
    let simulated = simulated(&report);
    assert!(!simulated.is_empty());
    for configuration in simulated {
        for engine in ["rapier", "mujoco"] {
            let found = &configuration["referee"][engine];
            has_keys(
                found,
                "until_s closed_loop held_torques convergence order documented_order",
            );
            let held = &found["held_torques"];
            has_keys(
                held,
                "window_s windows peak_tip_m peak_time_s growth convergence order",
            );
            assert_eq!(held["window_s"], 0.05);
            assert!(held["growth"].number() < 1.1, "{held}");
            // Nothing pulls the engine back, so a torque at its limit changes nothing.
            assert!((held["order"].number() - 1.0).abs() < 0.25, "{held}");
            if configuration["engines"][engine]["saturated_steps"] == 0 {
                assert!((found["order"].number() - 1.0).abs() < 0.25, "{found}");
            }
            assert_eq!(held["convergence"].list().len(), 3);
            assert_eq!(found["convergence"].list().len(), 3);
        }
    }
}

#[test]
fn difference_beyond_the_envelope_fails_and_is_explained() {
    mujoco_is_ready();
    let bench = Bench::with_scenario(&with_envelope("peak_tip_um = 0.001"));
    let answer = bench.run("run s.toml").exits_with(1);
    answer.says(["is closer to the reference integrator"]);
    let report = bench.read_json("out/small/report.json");
    let broken: Vec<&Value> = report["criteria"]
        .list()
        .iter()
        .filter(|each| each["criterion"] == "engines.envelope.peak_tip_um")
        .filter(|each| each["pass"] == false)
        .collect();
    assert!(!broken.is_empty());
    for criterion in broken {
        let detail = criterion["detail"].word();
        holds(detail, ["engines differ from", "likely cause:", " ms"]);
    }
    for configuration in simulated(&report) {
        let quantities = configuration["adjudication"]["quantities"].as_array();
        for quantity in quantities.unwrap() {
            let is_broken = quantity["pass"] == false;
            assert_eq!(quantity["ruling"].is_object(), is_broken);
            if is_broken {
                has_keys(&quantity["ruling"], "first_time_s nearer cause evidence");
                assert_eq!(quantity["ruling"]["cause"], "step_too_long");
            }
        }
    }
}
