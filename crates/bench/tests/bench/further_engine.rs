//! A further engine is a module and a line: all that compares engines takes it in.

use std::path::Path;

use needlebench_bench::study::{StudyColumns, dynamic_rows};
use needlebench_bench::{RunError, RunOptions, ScenarioRun, run_scenario};
use needlebench_engine::{ENGINES, Engine, EnginePool, choose_engines};
use needlebench_scenario::study::StudyMode;
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};
use serde_json::{Value, json};

use crate::replay::Replay;

/// What the line adds.
static MORE: [&dyn Engine; 3] = [ENGINES[0], ENGINES[1], &Replay];

fn small() -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../needlebench/tests/cli/small.toml");
    load_scenario(&path, &Overrides::default()).unwrap()
}

fn run(engines: &[&str]) -> Result<ScenarioRun, RunError> {
    let options = RunOptions {
        known_engines: &MORE,
        engines: Some(engines.iter().map(|name| (*name).into()).collect()),
        jobs: 2,
        referee: true,
    };
    run_scenario(&small(), &options)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn further_engine_is_measured_and_compared_with_all_others() {
    let finished = run(&["replay", "rapier", "mujoco"]).unwrap();
    let report = serde_json::to_value(&finished.report).unwrap();
    assert_eq!(report["engine_failures"], json!([]));
    let engines = report["provenance"]["engines"].as_array().unwrap();
    let names: Vec<&Value> = engines.iter().map(|engine| &engine["name"]).collect();
    assert_eq!(names, ["rapier", "mujoco", "replay", "referee"]);
    let mut simulated = 0;
    for each in report["goals"][0]["configurations"].as_array().unwrap() {
        let Some(replayed) = each["engines"].get("replay") else {
            continue;
        };
        simulated += 1;
        // It stands where it was told to, and the others nearly.
        assert!(number(&replayed["peak_tracking_error_m"]) < 1e-12);
        let difference = &each["engine_difference"];
        let apart_m = number(&difference["peak_tip_m"]);
        let of_engine = |engine: &str| number(&each["engines"][engine]["peak_tracking_error_m"]);
        // Over all pairs: at least what rapier and MuJoCo are away from a perfect arm.
        let worst_m = of_engine("rapier").max(of_engine("mujoco"));
        assert!(apart_m >= worst_m - 1e-12, "{apart_m} {worst_m}");
        assert_eq!(difference["peak_engines"].as_array().unwrap().len(), 2);
        let quantities = each["adjudication"]["quantities"].as_array().unwrap();
        assert!(quantities.iter().all(|each| each["engines"].is_array()));
        assert_eq!(each["referee"].as_object().unwrap().len(), 3);
    }
    assert_eq!(simulated, 6);
}

#[test]
fn further_engine_is_in_the_rows_of_a_study() {
    let (case, pool) = (small(), EnginePool::new(&MORE));
    let of = |names: &[&str]| {
        let engines = choose_engines(&MORE, Some(names)).unwrap();
        dynamic_rows(&case, &engines, &pool).unwrap()
    };
    let (alone, together) = (of(&["replay"]), of(&["rapier", "replay"]));
    let mut compared = 0;
    for (alone, together) in alone.iter().zip(&together) {
        assert_eq!(alone.get("engine_difference_peak"), None);
        let Some(apart_m) = together.get("engine_difference_peak") else {
            continue;
        };
        assert!(apart_m > 0.0);
        let [of_one, of_both] = [alone, together].map(|row| row.get("tip_error").unwrap());
        assert!(of_one <= of_both);
        assert_eq!(together.get("tip_error_replay"), Some(of_one));
        // A study that runs it has a column of it.
        let columns = StudyColumns::new(&[StudyMode::Dynamic], &["rapier", "replay"]);
        let mut keys = columns.keys().iter();
        let place = keys.position(|key| key.column() == "tip_error_replay_mm");
        let in_column = columns.row(0, together).get(place.unwrap()).unwrap();
        assert!((f64::from(in_column) - 1e3 * of_one).abs() < 1e-6);
        compared += 1;
    }
    assert_eq!(compared, 6);
}

#[test]
fn engine_that_there_is_not_is_refused() {
    let error = run(&["rapier", "bullet"]).unwrap_err().to_string();
    let all = "the engines are rapier, mujoco, replay";
    assert!(error.contains("`bullet`") && error.contains(all), "{error}");
}
