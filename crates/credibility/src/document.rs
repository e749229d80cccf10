//! Evidence for credibility as Markdown.

use std::fmt::Write;

use needlebench_show::markdown::{code, inline, paragraph};
use needlebench_show::number::{rounded, small_length_or_zero};
use serde_json::Value;

use super::{Comparison, Credibility, RunEvidence, StepHalving};

const NOT_STATED: &str = "not stated";

/// The document.
pub fn credibility_markdown(document: &Credibility) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_document(&mut out, document);
    out
}

/// A stated text, or that there is none.
fn stated(text: &str) -> String {
    if text.trim().is_empty() {
        return format!("*{NOT_STATED}*");
    }
    let parts = text.split("\n\n").map(|part| paragraph(part.trim()));
    let parts: Vec<String> = parts.filter(|part| !part.is_empty()).collect();
    parts.join("\n\n")
}

fn write_document(out: &mut String, document: &Credibility) -> std::fmt::Result {
    let judgement = &document.judgement;
    let names: Vec<String> = document.runs.iter().map(|run| inline(&run.name)).collect();
    writeln!(out, "# Evidence for credibility: {}\n", names.join(", "))?;
    writeln!(out, "> {}\n", document.claim)?;
    let of = |text: &str| match text.trim() {
        "" => NOT_STATED.to_owned(),
        text => inline(text),
    };
    writeln!(
        out,
        "Assessed by: {}. Date: {}.\n",
        of(&judgement.author),
        of(&judgement.date)
    )?;
    for (title, text) in [
        ("1 Question of interest", &judgement.question_of_interest),
        ("2 Context of use", &judgement.context_of_use),
    ] {
        writeln!(out, "## {title}\n\n{}\n", stated(text))?;
    }
    writeln!(out, "## 3 Model risk\n")?;
    for (title, text) in [
        ("Model influence", &judgement.model_influence),
        ("Decision consequence", &judgement.decision_consequence),
        ("Model risk", &judgement.model_risk),
    ] {
        writeln!(out, "**{title}:** {}\n", stated(text))?;
    }
    code_verification(out, document)?;
    calculation_verification(out, document)?;
    validation(out, document)?;
    writeln!(
        out,
        "## 7 Applicability\n\n{}\n",
        stated(&judgement.applicability)
    )?;
    for run in &document.runs {
        criteria(out, run)?;
    }
    limitations(out, document)?;
    writeln!(out, "## 10 Adequacy\n\n{}\n", stated(&judgement.adequacy))?;
    for run in &document.runs {
        provenance(out, run)?;
    }
    Ok(())
}

fn code_verification(out: &mut String, document: &Credibility) -> std::fmt::Result {
    writeln!(out, "## 4 Code verification\n")?;
    writeln!(
        out,
        "Tests that compare a quantity with a closed form or another program. They pass before \
         every change of the program; this command does not run them.\n"
    )?;
    writeln!(out, "| Quantity | Compared with | Test |\n|---|---|---|")?;
    for test in &document.verifying_tests {
        let place = format!("{}: {}", test.file, test.test);
        writeln!(
            out,
            "| {} | {} | {} |",
            test.quantity,
            test.against,
            code(&place)
        )?;
    }
    writeln!(out, "\nKnown deviations of the engines:\n")?;
    for known in &document.known_deviations {
        let text = |key: &str| known.get(key).and_then(Value::as_str).unwrap_or_default();
        writeln!(
            out,
            "- {} ({}): {} Law: {}.",
            code(text("key")),
            text("engine"),
            inline(text("description")),
            inline(text("law"))
        )?;
    }
    writeln!(
        out,
        "\nAssessment: {}\n",
        stated(&document.judgement.code_verification)
    )
}

fn calculation_verification(out: &mut String, document: &Credibility) -> std::fmt::Result {
    writeln!(out, "## 5 Calculation verification\n")?;
    if document.runs.is_empty() {
        writeln!(out, "No run.\n")?;
    }
    for run in &document.runs {
        let name = inline(&run.name);
        match &run.engines_differ {
            Some(found) => writeln!(
                out,
                "- {name}: over {} motions, the engines' needle tips differ by at most {} in \
                 motion and {} when settled.",
                found.motions,
                small_length_or_zero(found.peak_tip_m),
                small_length_or_zero(found.settled_tip_m)
            )?,
            None => writeln!(
                out,
                "- {name}: engines not compared: fewer than two measured the same motion."
            )?,
        }
        if run.step_halving.is_empty() {
            writeln!(
                out,
                "- {name}: time step not halved; {} halves it.",
                code("needlebench run SCENARIO --referee")
            )?;
        }
        for halving in &run.step_halving {
            step_halving(out, &name, halving)?;
        }
    }
    let text = stated(&document.judgement.calculation_verification);
    writeln!(out, "\nAssessment: {text}\n")
}

fn step_halving(out: &mut String, name: &str, halving: &StepHalving) -> std::fmt::Result {
    let steps = |lengths: &[f64]| -> String {
        let all = lengths.iter().zip(&halving.timesteps_s);
        let all = all.map(|(length, step)| {
            format!("{} at {} ms", small_length_or_zero(*length), 1e3 * step)
        });
        all.collect::<Vec<String>>().join(", ")
    };
    write!(
        out,
        "- {name}: {} compared with the reference integrator, worst of {} motions: tip difference \
         {}",
        inline(&halving.engine),
        halving.motions,
        steps(&halving.closed_loop_tip_m)
    )?;
    if !halving.held_torques_tip_m.is_empty() {
        write!(
            out,
            "; under held torques {}",
            steps(&halving.held_torques_tip_m)
        )?;
    }
    match halving.order {
        Some([low, high]) => writeln!(
            out,
            "; order of convergence {low:.2} to {high:.2}, documented {}.",
            halving.documented_order
        ),
        None => writeln!(
            out,
            "; order of convergence not measurable, differences are rounding errors."
        ),
    }
}

fn validation(out: &mut String, document: &Credibility) -> std::fmt::Result {
    writeln!(out, "## 6 Validation\n")?;
    if !document.has_comparator() {
        writeln!(
            out,
            "No comparator: no result was compared with a real arm or any other measurement. {} \
             compares the model with a recorded run.\n",
            code("needlebench replay LOG")
        )?;
    }
    for comparison in &document.comparisons {
        comparison_lines(out, comparison)?;
    }
    let judgement = &document.judgement;
    writeln!(
        out,
        "Comparator, as stated: {}\n",
        stated(&judgement.comparator)
    )?;
    writeln!(
        out,
        "Agreement, as stated: {}\n",
        stated(&judgement.agreement)
    )
}

fn comparison_lines(out: &mut String, comparison: &Comparison) -> std::fmt::Result {
    let log = comparison.log.as_deref().unwrap_or("unnamed log");
    writeln!(
        out,
        "Recorded run {} ({}):\n",
        code(log),
        code(&comparison.file)
    )?;
    if let Some(sha256) = &comparison.log_sha256 {
        writeln!(out, "- SHA-256 of the log: {}", code(sha256))?;
    }
    if comparison.simulated_log == Some(true) {
        writeln!(out, "- log of a simulator, not a comparator")?;
    }
    match comparison.held_out_m {
        Some(held_out_m) => writeln!(
            out,
            "- RMS calibration error at held-out poses: {} mm",
            millimetres(held_out_m)
        )?,
        None => writeln!(
            out,
            "- RMS calibration error at held-out poses: not measured"
        )?,
    }
    match &comparison.held_out_moment_rms_nm {
        Some(Value::Array(joints)) => {
            let joints = joints.iter().filter_map(Value::as_f64);
            let joints: Vec<String> = joints.map(|nm| rounded(nm, 5)).collect();
            writeln!(
                out,
                "- RMS residual of the identified model's joint torques, in held-out rows: {} N m",
                joints.join(", ")
            )?;
        }
        _ => writeln!(
            out,
            "- residual of the identified model's joint torques: not measured"
        )?,
    }
    for (engine, [rms_m, largest_m]) in &comparison.tips_m {
        writeln!(
            out,
            "- tip in {} compared with the real tip, both from joint angles: {} mm RMS, {} mm \
             maximum",
            inline(engine),
            millimetres(*rms_m),
            millimetres(*largest_m)
        )?;
    }
    if let Some(verdict) = &comparison.verdict {
        writeln!(out, "- verdict of the replay: {}", inline(verdict))?;
    }
    writeln!(out)
}

/// Nanometres are not rounded to nothing.
fn millimetres(length_m: f64) -> String {
    let mm = length_m * 1e3;
    if mm != 0.0 && mm.abs() < 1e-3 {
        format!("{mm:.1e}")
    } else {
        rounded(mm, 4)
    }
}

fn criteria(out: &mut String, run: &RunEvidence) -> std::fmt::Result {
    writeln!(
        out,
        "## 8 Criteria and requirements: {}\n",
        inline(&run.name)
    )?;
    writeln!(
        out,
        "Verdict: {}. {} of {} evaluated criteria met; {} not evaluated.\n",
        inline(&run.verdict),
        run.met,
        run.judged,
        run.not_judged.len()
    )?;
    let text = |value: &Value, key: &str| -> String {
        value
            .get(key)
            .and_then(Value::as_str)
            .map_or_else(String::new, inline)
    };
    for missed in &run.missed {
        writeln!(
            out,
            "- failed: {} {} {} {}",
            text(missed, "goal"),
            text(missed, "label"),
            text(missed, "criterion"),
            text(missed, "detail")
        )?;
    }
    for open in &run.not_judged {
        writeln!(
            out,
            "- not evaluated: {} {} {}: {}",
            text(open, "goal"),
            text(open, "label"),
            text(open, "criterion"),
            text(open, "reason")
        )?;
    }
    if run.trace.is_empty() {
        return writeln!(
            out,
            "\nThe scenario states no requirements ({}).\n",
            code("[requirements]")
        );
    }
    writeln!(
        out,
        "\n| Requirement | Criterion | Outcome | Met | Failed | Not evaluated \
         |\n|---|---|---|--:|--:|--:|"
    )?;
    for row in &run.trace {
        let count = |key: &str| row.get(key).and_then(Value::as_u64).unwrap_or_default();
        writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} |",
            text(row, "requirement"),
            text(row, "criterion"),
            outcome_label(&text(row, "outcome")),
            count("met"),
            count("missed"),
            count("not_judged")
        )?;
    }
    writeln!(out)
}

/// What a report calls an outcome, in words.
fn outcome_label(outcome: &str) -> String {
    match outcome {
        "missed" => "failed".to_owned(),
        "not_judged" => "not evaluated".to_owned(),
        other => other.replace('_', " "),
    }
}

fn limitations(out: &mut String, document: &Credibility) -> std::fmt::Result {
    writeln!(out, "## 9 Limitations and assumptions\n")?;
    writeln!(out, "{}\n", stated(&document.judgement.limitations))?;
    for run in &document.runs {
        let name = inline(&run.name);
        if let Some(truth) = &run.truth {
            writeln!(out, "- {name}: simulated: {}", inline(truth))?;
        }
        for failure in &run.engine_failures {
            let text = |key: &str| failure.get(key).and_then(Value::as_str).unwrap_or_default();
            writeln!(
                out,
                "- {name}: {} failed: {}",
                inline(text("engine")),
                inline(text("message"))
            )?;
        }
        match run.assumed.as_object() {
            Some(assumed) if assumed.is_empty() => {
                writeln!(out, "- {name}: no value of the arm is marked as assumed")?;
            }
            Some(assumed) => {
                for (key, why) in assumed {
                    let why = why.as_str().unwrap_or_default();
                    writeln!(out, "- {name}: {}: {}", code(key), inline(why))?;
                }
            }
            None => writeln!(
                out,
                "- {name}: the report does not list which values of the arm are assumed"
            )?,
        }
        for note in &run.notes {
            writeln!(out, "- {name}: {}", inline(note))?;
        }
    }
    writeln!(out)
}

fn provenance(out: &mut String, run: &RunEvidence) -> std::fmt::Result {
    writeln!(out, "## 11 Program and inputs: {}\n", inline(&run.name))?;
    let text = |key: &str| {
        run.provenance
            .get(key)
            .and_then(Value::as_str)
            .unwrap_or("unknown")
    };
    writeln!(
        out,
        "needlebench {} ({}), lock file {}.\n",
        inline(text("version")),
        inline(text("git_revision")),
        code(text("cargo_lock_sha256"))
    )?;
    let list = |key: &str| -> Vec<Value> {
        let found = run.provenance.get(key).and_then(Value::as_array);
        found.cloned().unwrap_or_default()
    };
    for engine in list("engines") {
        let of = |key: &str| engine.get(key).and_then(Value::as_str).unwrap_or_default();
        writeln!(out, "- {} {}", inline(of("name")), inline(of("version")))?;
    }
    writeln!(out, "\n| Input | File | SHA-256 |\n|---|---|---|")?;
    for input in list("inputs") {
        let of = |key: &str| input.get(key).and_then(Value::as_str).unwrap_or_default();
        writeln!(
            out,
            "| {} | {} | {} |",
            inline(of("role")),
            code(of("file")),
            code(of("sha256"))
        )?;
    }
    writeln!(out)
}

#[cfg(test)]
mod tests {
    use crate::Judgement;

    use super::*;

    fn document(files: &[(&str, &str)], judgement: Judgement) -> String {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let found = Credibility::collect(&[folder.path().to_owned()], judgement);
        credibility_markdown(&found.unwrap())
    }

    const REPORT: &str = r#"{"schema_version": 1, "scenario": {"name": "small_cell"}, "verdict": "incomplete",
        "criteria": [{"criterion": "max_tip", "goal": "g", "pass": false, "detail": "x | y"}],
        "not_judged": [{"criterion": "c", "goal": "g", "reason": "r"}],
        "trace": [{"requirement": "SRS-1 | tip", "criterion": "c", "outcome": "not_judged", "met": 0,
                   "missed": 0, "not_judged": 1}],
        "assumed": {"rotors.source": "assumed: nothing is known"}, "notes": ["<b>a note</b>"],
        "provenance": {"version": "1.2", "inputs": [{"role": "scenario", "file": "s.toml", "sha256": "abc"}]},
        "goals": []}"#;

    #[test]
    fn what_nobody_stated_is_not_stated_and_nothing_is_claimed() {
        let text = document(&[("report.json", REPORT)], Judgement::default());
        assert!(text.contains("claims no conformity"));
        assert_eq!(text.matches("*not stated*").count(), 12, "{text}");
        for part in [
            "Assessed by: not stated",
            "No comparator",
            "time step not halved",
            "rotors.source",
            "assumed: nothing is known",
            "| SRS-1 \\| tip | c | not evaluated | 0 | 0 | 1 |",
            "| scenario | `s.toml` | `abc` |",
            "\\<b>a note\\</b>",
            "Verdict: incomplete. 0 of 1 evaluated criteria met; 1 not evaluated.",
        ] {
            assert!(text.contains(part), "no `{part}` in {text}");
        }
        // There is no comparator.
        assert!(!text.to_lowercase().contains("validated"), "{text}");
    }

    #[test]
    fn what_was_stated_and_compared_stands_there() {
        let judgement = Judgement {
            author: "A. Judge".to_owned(),
            question_of_interest: "# Does it reach?\n\nAnd how?".to_owned(),
            ..Judgement::default()
        };
        let replay = r#"{"log": {"file": "run.csv", "sha256": "ab"}, "calibration": {"held_out": {"rms_m": 8.2e-5}},
            "identification": {"controller": {"held_out_rms_nm": [0.1, 0.25]}}}"#;
        let text = document(&[("replay.json", replay)], judgement);
        for part in [
            "Assessed by: A. Judge.",
            "\\# Does it reach?\n\nAnd how?",
            "at held-out poses: 0.082 mm",
            "0.1, 0.25 N m",
            "`run.csv`",
        ] {
            assert!(text.contains(part), "no `{part}` in {text}");
        }
        assert!(!text.contains("No comparator"));
    }
}
