//! Evidence for the credibility of runs, in the frame of ASME V&V 40: what the program knows of its results,
//! beside what people judge. It claims nothing.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod document;
mod judgement;
mod verification;

use std::collections::BTreeMap;
use std::path::Path;

use needlebench_engine::KNOWN_DEVIATIONS;
use needlebench_evaluation::StoredReport;
use needlebench_input::{Finding, read_text};
use serde::Serialize;
use serde_json::{Value, json};

pub use document::credibility_markdown;
pub use judgement::Judgement;
use verification::VERIFYING_TESTS;
pub use verification::VerifyingTest;

/// Version of the keys of [`Credibility`].
const CREDIBILITY_VERSION: u32 = 1;

/// What no such document does.
const CLAIM: &str = "This document claims no conformity with any standard or guidance. It is structured as ASME \
     V&V 40 (question of interest, context of use, model risk, verification, validation, \
     applicability) and collects evidence. The program fills in its own results; assessments are \
     made by people, and marked \"not stated\" where missing.";

/// A figure that was read from a results folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EngineAgreement {
    /// Motions that several engines made.
    pub motions: u64,
    /// Largest distance of their tips while moving, m.
    pub peak_tip_m: f64,
    /// Largest distance when settled, m.
    pub settled_tip_m: f64,
}

/// An engine compared with the reference integrator at the scenario's step, its half and its quarter: the worst motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepHalving {
    /// The engine.
    pub engine: String,
    /// Motions that were compared with the reference integrator.
    pub motions: u64,
    /// Time steps, s.
    pub timesteps_s: Vec<f64>,
    /// Largest distance of the tips in a closed loop at each, m.
    pub closed_loop_tip_m: Vec<f64>,
    /// The same under held torques; empty if there was none.
    pub held_torques_tip_m: Vec<f64>,
    /// Least and largest measured order of convergence; none where differences are rounding.
    pub order: Option<[f64; 2]>,
    /// The documented one.
    pub documented_order: f64,
}

/// A comparison of the model with a recorded run of a real arm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// File that it was read from.
    pub file: String,
    /// The log.
    pub log: Option<String>,
    /// SHA-256 of the log.
    pub log_sha256: Option<String>,
    /// Whether the log says that a simulator wrote it; such a log is no real arm's.
    pub simulated_log: Option<bool>,
    /// Root mean square error of the calibration at poses that were not fitted, m.
    pub held_out_m: Option<f64>,
    /// Root mean square of the torque that the identified model leaves in rows that it was not fitted to, per
    /// joint, N m.
    pub held_out_moment_rms_nm: Option<Value>,
    /// Root mean square and largest distance of each engine's tip from the real one's, by the joint angles, m.
    pub tips_m: BTreeMap<String, [f64; 2]>,
    /// `pass`, `fail` or `incomplete`.
    pub verdict: Option<String>,
}

impl Comparison {
    /// Whether it holds the model against anything that was measured.
    pub(crate) fn is_comparator(&self) -> bool {
        self.simulated_log != Some(true)
            && (self.held_out_m.is_some()
                || self.held_out_moment_rms_nm.is_some()
                || !self.tips_m.is_empty())
    }

    fn read(path: &Path) -> Result<Self, Finding> {
        let file = path.display().to_string();
        let text = read_text(path)
            .map_err(|error| Finding::new(&file, format!("the replay cannot be read: {error}")))?;
        let value: Value = serde_json::from_str(&text).map_err(|error| {
            Finding::new(&file, format!("the replay is not JSON: {error}"))
                .hint("recreate it with `needlebench replay`")
        })?;
        let text_at = |pointers: &[&str]| {
            let found = pointers.iter().find_map(|at| value.pointer(at)?.as_str());
            found.map(str::to_owned)
        };
        let number = |pointer: &str| value.pointer(pointer)?.as_f64();
        let engines = value.pointer("/engines").and_then(Value::as_object);
        let tips_m = engines.into_iter().flatten().filter_map(|(name, found)| {
            let of = |key: &str| found.pointer(&format!("/against_real/{key}"))?.as_f64();
            Some((name.clone(), [of("tip_rms_m")?, of("tip_largest_m")?]))
        });
        let tips_m = tips_m.collect();
        Ok(Self {
            file,
            log: text_at(&["/log/file"]),
            log_sha256: text_at(&["/log/sha256"]),
            simulated_log: text_at(&["/log/kind"]).map(|kind| kind == "simulator"),
            held_out_m: number("/calibration/held_out/rms_m"),
            held_out_moment_rms_nm: value
                .pointer("/identification/controller/held_out_rms_nm")
                .filter(|found| found.is_array())
                .cloned(),
            tips_m,
            // Where nothing was to be judged a verdict says nothing.
            verdict: text_at(&["/verdict"]).filter(|_| {
                let lists = ["/criteria", "/not_judged"].into_iter();
                let mut lists = lists.filter_map(|at| value.pointer(at)?.as_array());
                lists.any(|list| !list.is_empty())
            }),
        })
    }
}

/// What one run adds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunEvidence {
    /// The scenario.
    pub name: String,
    /// Where the report was read from.
    pub file: String,
    /// `pass`, `fail` or `incomplete`.
    pub verdict: String,
    /// Criteria that were evaluated.
    pub judged: u64,
    /// Those of them that were met.
    pub met: u64,
    /// Those that were missed, as the report has them.
    pub missed: Vec<Value>,
    /// Those that could not be evaluated, as the report has them.
    pub not_judged: Vec<Value>,
    /// Requirements, with what came of their criteria.
    pub trace: Vec<Value>,
    /// How far engines differ; none unless several ran.
    pub engines_differ: Option<EngineAgreement>,
    /// Engines compared with the reference integrator; empty unless it was called.
    pub step_halving: Vec<StepHalving>,
    /// Engines that failed.
    pub engine_failures: Vec<Value>,
    /// Whether the arm is just what its controller assumes, or one draw.
    pub truth: Option<String>,
    /// Values that are assumed, with the reason, by their key.
    pub assumed: Value,
    /// Notes.
    pub notes: Vec<String>,
    /// Version, revision, engines, inputs with their hashes.
    pub provenance: Value,
}

/// The document.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Credibility {
    /// Version of the keys.
    pub schema_version: u32,
    /// What it does not claim.
    pub claim: &'static str,
    /// What people state.
    pub judgement: Judgement,
    /// Tests of the program.
    pub verifying_tests: Vec<VerifyingTest>,
    /// What engines are known to get wrong.
    pub known_deviations: Vec<Value>,
    /// Runs.
    pub runs: Vec<RunEvidence>,
    /// Comparisons with recorded runs.
    pub comparisons: Vec<Comparison>,
}

impl Credibility {
    /// Collects what folders of results have: a report, a replay, or both.
    ///
    /// # Errors
    /// A folder without either, or a file that cannot be read.
    pub fn collect(
        folders: &[std::path::PathBuf],
        judgement: Judgement,
    ) -> Result<Self, Vec<Finding>> {
        let mut findings = Vec::new();
        let (mut runs, mut comparisons) = (Vec::new(), Vec::new());
        for folder in folders {
            let (report, replay) = (folder.join("report.json"), folder.join("replay.json"));
            let has = [report.is_file(), replay.is_file()];
            if has == [false, false] {
                findings.push(
                    Finding::new(
                        folder.display().to_string(),
                        "the folder has neither a report.json nor a replay.json",
                    )
                    .hint("give the folder of a run's results, such as out/table3"),
                );
            }
            if has[0] {
                match run_evidence(&report) {
                    Ok(run) => runs.push(run),
                    Err(finding) => findings.push(finding),
                }
            }
            if has[1] {
                match Comparison::read(&replay) {
                    Ok(found) => comparisons.push(found),
                    Err(finding) => findings.push(finding),
                }
            }
        }
        if !findings.is_empty() {
            return Err(findings);
        }
        let known = KNOWN_DEVIATIONS.iter();
        let known_deviations = known.map(|each| {
            json!({
                "key": each.key,
                "engine": each.engine,
                "description": each.description,
                "law": each.law,
                "tolerance": each.tolerance,
            })
        });
        Ok(Self {
            schema_version: CREDIBILITY_VERSION,
            claim: CLAIM,
            judgement,
            verifying_tests: VERIFYING_TESTS.to_vec(),
            known_deviations: known_deviations.collect(),
            runs,
            comparisons,
        })
    }

    /// Whether anything of it holds the model against something that was measured.
    pub fn has_comparator(&self) -> bool {
        self.comparisons.iter().any(Comparison::is_comparator)
    }
}

fn list(report: &StoredReport, pointer: &str) -> Vec<Value> {
    let found = report.value(pointer).and_then(Value::as_array);
    found.cloned().unwrap_or_default()
}

fn run_evidence(path: &Path) -> Result<RunEvidence, Finding> {
    let file = path.display().to_string();
    let text = read_text(path)
        .map_err(|error| Finding::new(&file, format!("the report cannot be read: {error}")))?;
    let report = StoredReport::parse(&file, &text)?;
    let is_met = |result: &&Value| result.get("pass").and_then(Value::as_bool) == Some(true);
    let criteria = list(&report, "/criteria");
    let met = criteria.iter().filter(is_met).count() as u64;
    let missed = criteria.iter().filter(|each| !is_met(each)).cloned();
    let notes = list(&report, "/notes");
    let configurations = configurations(&report);
    Ok(RunEvidence {
        name: report.text("/scenario/name").unwrap_or_default().to_owned(),
        verdict: report
            .text("/verdict")
            .unwrap_or("not evaluated")
            .to_owned(),
        judged: criteria.len() as u64,
        met,
        missed: missed.collect(),
        not_judged: list(&report, "/not_judged"),
        trace: list(&report, "/trace"),
        engines_differ: engines_differ(&configurations, &report),
        step_halving: step_halving(&configurations),
        engine_failures: list(&report, "/engine_failures"),
        truth: report.text("/provenance/truth").map(str::to_owned),
        assumed: report.value("/assumed").cloned().unwrap_or(Value::Null),
        notes: notes
            .iter()
            .filter_map(Value::as_str)
            .map(str::to_owned)
            .collect(),
        provenance: report.value("/provenance").cloned().unwrap_or(Value::Null),
        file,
    })
}

/// All configurations of all goals, as the report has them.
fn configurations(report: &StoredReport) -> Vec<Value> {
    let goals = list(report, "/goals");
    let of_goals = goals
        .iter()
        .filter_map(|goal| goal.get("configurations")?.as_array());
    of_goals.flatten().cloned().collect()
}

fn engines_differ(configurations: &[Value], report: &StoredReport) -> Option<EngineAgreement> {
    let of_goals = configurations
        .iter()
        .filter_map(|each| each.get("engine_difference"));
    let of_test = report.value("/iso9283/engine_difference");
    let both: Vec<[f64; 2]> = of_goals
        .chain(of_test)
        .filter_map(|each| {
            let number = |key: &str| each.get(key)?.as_f64();
            Some([number("peak_tip_m")?, number("settled_tip_m")?])
        })
        .collect();
    let largest = |at: usize| both.iter().map(|pair| pair[at]).fold(0.0, f64::max);
    (!both.is_empty()).then(|| EngineAgreement {
        motions: both.len() as u64,
        peak_tip_m: largest(0),
        settled_tip_m: largest(1),
    })
}

/// Of each engine the largest differences from the reference integrator at each step.
fn step_halving(configurations: &[Value]) -> Vec<StepHalving> {
    let mut found: Vec<StepHalving> = Vec::new();
    for referee in configurations
        .iter()
        .filter_map(|each| each.get("referee")?.as_object())
    {
        for (engine, comparison) in referee {
            let steps = |pointer: &str| -> Vec<[f64; 2]> {
                let all = comparison.pointer(pointer).and_then(Value::as_array);
                let all = all.into_iter().flatten().filter_map(|each| {
                    let number = |key: &str| each.get(key)?.as_f64();
                    Some([number("timestep_s")?, number("peak_tip_m")?])
                });
                all.collect()
            };
            let closed_loop = steps("/convergence");
            if closed_loop.is_empty() {
                continue;
            }
            let held = steps("/held_torques/convergence");
            let at = found.iter().position(|each| each.engine == *engine);
            let at = at.unwrap_or_else(|| {
                found.push(StepHalving {
                    engine: engine.clone(),
                    motions: 0,
                    timesteps_s: closed_loop.iter().map(|step| step[0]).collect(),
                    closed_loop_tip_m: vec![0.0; closed_loop.len()],
                    held_torques_tip_m: Vec::new(),
                    order: None,
                    documented_order: number_at(comparison, "/documented_order")
                        .unwrap_or(f64::NAN),
                });
                found.len() - 1
            });
            let worst = &mut found[at];
            worst.motions += 1;
            larger(&mut worst.closed_loop_tip_m, &closed_loop);
            larger(&mut worst.held_torques_tip_m, &held);
            let orders = ["/order", "/held_torques/order"];
            for order in orders
                .iter()
                .filter_map(|pointer| number_at(comparison, pointer))
            {
                let [low, high] = worst.order.unwrap_or([order, order]);
                worst.order = Some([low.min(order), high.max(order)]);
            }
        }
    }
    found
}

fn number_at(value: &Value, pointer: &str) -> Option<f64> {
    value.pointer(pointer)?.as_f64()
}

fn larger(known: &mut Vec<f64>, steps: &[[f64; 2]]) {
    known.resize(known.len().max(steps.len()), 0.0);
    for (worst, step) in known.iter_mut().zip(steps) {
        *worst = worst.max(step[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_folder(files: &[(&str, &str)]) -> (tempfile::TempDir, Result<Credibility, Vec<Finding>>) {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let found = Credibility::collect(&[folder.path().to_owned()], Judgement::default());
        (folder, found)
    }

    const REPORT: &str = r#"{"schema_version": 1, "scenario": {"name": "s"}, "verdict": "fail",
        "criteria": [{"criterion": "a", "pass": true}, {"criterion": "b", "pass": false}],
        "not_judged": [{"criterion": "c"}], "notes": ["n"], "assumed": {"rotors.source": "assumed: x"},
        "provenance": {"version": "1", "truth": "nominal"},
        "goals": [{"name": "g", "configurations": [
          {"label": "Right-Up-Fold", "status": "ok", "metrics": {}, "engine_difference": {"peak_tip_m": 2e-8, "settled_tip_m": 1e-15},
           "referee": {"rapier": {"documented_order": 1.0, "order": 1.02,
             "convergence": [{"timestep_s": 1e-3, "peak_tip_m": 4e-7}, {"timestep_s": 5e-4, "peak_tip_m": 2e-7}],
             "held_torques": {"order": 0.98, "convergence": [{"timestep_s": 1e-3, "peak_tip_m": 7e-7}]}}}},
          {"label": "Left-Up-Fold", "status": "ok", "metrics": {}, "engine_difference": {"peak_tip_m": 3e-8, "settled_tip_m": 0.0},
           "referee": {"rapier": {"documented_order": 1.0, "order": null,
             "convergence": [{"timestep_s": 1e-3, "peak_tip_m": 5e-7}, {"timestep_s": 5e-4, "peak_tip_m": 1e-7}],
             "held_torques": null}}}]}]}"#;

    #[test]
    fn what_a_run_knows_is_taken_from_its_worst_motions() {
        let (_folder, found) = in_folder(&[("report.json", REPORT)]);
        let found = found.unwrap();
        let run = &found.runs[0];
        assert_eq!(
            (run.judged, run.met, run.missed.len(), run.not_judged.len()),
            (2, 1, 1, 1)
        );
        let differ = run.engines_differ.as_ref().unwrap();
        assert_eq!(
            (differ.motions, differ.peak_tip_m, differ.settled_tip_m),
            (2, 3e-8, 1e-15)
        );
        let halving = &run.step_halving[0];
        assert_eq!((halving.engine.as_str(), halving.motions), ("rapier", 2));
        assert_eq!(halving.timesteps_s, [1e-3, 5e-4]);
        assert_eq!(halving.closed_loop_tip_m, [5e-7, 2e-7]);
        assert_eq!(halving.held_torques_tip_m, [7e-7]);
        assert_eq!(halving.order, Some([0.98, 1.02]));
        assert!(!found.has_comparator());
    }

    #[test]
    fn a_recorded_run_is_a_comparator_and_a_simulators_is_none() {
        let real = r#"{"log": {"file": "run.csv", "sha256": "ab"}, "calibration": {"held_out": {"rms_m": 8e-5}},
            "identification": {"controller": {"held_out_rms_nm": [0.1, 0.2]}},
            "engines": {"rapier": {"against_real": {"tip_rms_m": 1e-4, "tip_largest_m": 3e-4}}}}"#;
        let (_folder, found) = in_folder(&[("replay.json", real)]);
        let found = found.unwrap();
        assert!(found.has_comparator());
        assert_eq!(found.comparisons[0].held_out_m, Some(8e-5));
        assert_eq!(found.comparisons[0].tips_m["rapier"], [1e-4, 3e-4]);
        for nothing in [
            r#"{"log": {"file": "run.csv"}}"#,
            r#"{"log": {"kind": "simulator"}, "calibration": {"held_out": {"rms_m": 0.0}}}"#,
            "[]",
        ] {
            let (_folder, found) = in_folder(&[("replay.json", nothing)]);
            assert!(!found.unwrap().has_comparator(), "{nothing}");
        }
    }

    #[test]
    fn folders_without_results_and_broken_files_are_refused() {
        let (_folder, found) = in_folder(&[]);
        assert!(found.unwrap_err()[0].message.contains("neither"));
        for (name, text) in [
            ("report.json", "{"),
            ("replay.json", "{"),
            ("report.json", "{}"),
        ] {
            let (_folder, found) = in_folder(&[(name, text)]);
            assert_eq!(found.unwrap_err().len(), 1, "{name}");
        }
    }
}
