//! Two results side by side, on made-up reports.

use needlebench_evaluation::compare::{
    Change, CompareError, CompareOptions, Comparison, MetricComparison, compare,
};
use needlebench_evaluation::{Compared, StoredReport, Threshold};
use serde_json::{Value, json};

/// A report: one goal, two configurations, few metrics.
fn report() -> Value {
    let configuration = |label: &str, status: &str, clearance_m: f64| {
        json!({
            "label": label,
            "status": status,
            "rejections": [],
            "engines": {"rapier": {}},
            "metrics": {
                "tip_error": 1e-4,
                "tip_error_rapier": 1e-4,
                "clearance_attained": clearance_m,
                "arm_to_skin_attained": clearance_m,
            },
        })
    };
    json!({
        "schema_version": 1,
        "scenario": {"name": "made-up"},
        "verdict": "pass",
        "goals": [{
            "name": "pose",
            "configurations": [
                configuration("Right-Up-Fold", "ok", 0.02),
                configuration("Left-Up-Fold", "ok", 0.03),
            ],
            "recommended": {"label": "Left-Up-Fold", "reason": ""},
        }],
        "provenance": {
            "version": "0.1.0",
            "engines": [{"name": "rapier", "version": "1", "settings": [["friction", "0"]]}],
            "inputs": [{"role": "scenario", "file": "s.toml", "sha256": "00"}],
        },
    })
}

fn stored(name: &str, report: &Value) -> StoredReport {
    StoredReport::parse(name, &report.to_string()).unwrap()
}

fn compared(a: &Value, b: &Value, options: &CompareOptions) -> Comparison {
    compare(&stored("a", a), &stored("b", b), options).unwrap()
}

fn limits(limits: &[(&str, &str)]) -> CompareOptions {
    CompareOptions {
        thresholds: limits
            .iter()
            .map(|(key, limit)| Threshold::parse(key, limit, Compared::Runs, &["rapier"]).unwrap())
            .collect(),
        ..CompareOptions::default()
    }
}

/// A metric of the first configuration.
fn first<'a>(found: &'a Comparison, key: &str) -> &'a MetricComparison {
    let mut metrics = found.goals[0].configurations[0].metrics.iter();
    metrics.find(|metric| metric.metric == key).unwrap()
}

/// The report with other metrics in each configuration.
fn with_metrics(metrics: &Value) -> Value {
    let mut made = report();
    let list = made.pointer_mut("/goals/0/configurations").unwrap();
    for each in list.as_array_mut().unwrap() {
        each["metrics"] = metrics.clone();
    }
    made
}

/// The report with the value at a JSON pointer replaced.
fn with(report: &Value, pointer: &str, value: Value) -> Value {
    let mut changed = report.clone();
    *changed.pointer_mut(pointer).unwrap() = value;
    changed
}

const CLEARANCE: &str = "/goals/0/configurations/0/metrics/clearance_attained";
const STATUS: &str = "/goals/0/configurations/0/status";

#[test]
fn result_is_the_same_as_itself() {
    let same = compared(&report(), &report(), &limits(&[("clearance", "0mm")]));
    assert!(same.pass && same.failures.is_empty());
    assert_eq!(same.provenance_differences, []);
    for each in &same.goals[0].configurations {
        assert_eq!(each.status, Change::Same);
        // The rest was not measured, and is not 0.
        let names: Vec<&str> = each.metrics.iter().map(|found| &*found.metric).collect();
        assert_eq!(
            names,
            [
                "tip_error",
                "tip_error_rapier",
                "clearance_attained",
                "arm_to_skin_attained"
            ]
        );
        assert!(
            each.metrics
                .iter()
                .all(|found| found.outcome == Change::Same)
        );
    }
}

#[test]
fn loss_fails_beyond_its_threshold_and_no_sooner() {
    let worse = with(&report(), CLEARANCE, json!(0.018));
    for (limit, pass) in [
        ("2.1mm", true),
        ("1.9mm", false),
        ("11%", true),
        ("9%", false),
    ] {
        let found = compared(&report(), &worse, &limits(&[("clearance", limit)]));
        assert_eq!(found.pass, pass, "{limit}");
    }
    let found = compared(&report(), &worse, &limits(&[("clearance", "1mm")]));
    let failure = &found.failures[0];
    assert_eq!(failure.label.as_deref(), Some("Right-Up-Fold"));
    // No bound was proven.
    assert_eq!(failure.metric.as_deref(), Some("clearance_attained"));
    assert_eq!(
        failure.detail,
        "clearance, attained: 20.0 mm to 18.0 mm, worse by 2 mm, threshold 1mm"
    );
    assert_eq!(found.notes.len(), 1, "{:?}", found.notes);
    let note = "threshold clearance: `clearance` was not measured; compared by `clearance_attained` instead";
    assert!(found.notes[0].starts_with(note), "{:?}", found.notes);
    // A gain is no loss.
    assert!(compared(&worse, &report(), &limits(&[("clearance", "0mm")])).pass);
}

#[test]
fn differences_within_the_resolution_are_the_same() {
    let nearly = with(&report(), CLEARANCE, json!(0.0204));
    let found = compared(&report(), &nearly, &CompareOptions::default());
    let metric = first(&found, "clearance_attained");
    assert_eq!(metric.outcome, Change::Same);
    assert!((metric.change.unwrap() - 0.4e-3).abs() < 1e-15);
    assert!((metric.relative.unwrap() - 0.02).abs() < 1e-12);
    let better = with(&report(), CLEARANCE, json!(0.0206));
    let found = compared(&report(), &better, &CompareOptions::default());
    assert_eq!(first(&found, "clearance_attained").outcome, Change::Better);
    // Less of an error is better.
    let pointer = "/goals/0/configurations/0/metrics/tip_error";
    let found = compared(
        &report(),
        &with(&report(), pointer, json!(1e-3)),
        &CompareOptions::default(),
    );
    assert_eq!(first(&found, "tip_error").outcome, Change::Worse);
}

#[test]
fn configuration_that_no_longer_works_fails_unless_that_is_allowed() {
    let allowed = CompareOptions {
        allow_status_change: true,
        ..CompareOptions::default()
    };
    for status in ["rejected", "failed", "something new"] {
        let worse = with(&report(), STATUS, json!(status));
        let found = compared(&report(), &worse, &CompareOptions::default());
        assert_eq!(found.failures.len(), 1, "{status}");
        assert_eq!(found.failures[0].detail, format!("was ok, now {status}"));
        assert!(compared(&report(), &worse, &allowed).pass);
        // The other way round it is a gain.
        let found = compared(&worse, &report(), &CompareOptions::default());
        assert!(found.pass);
        assert_eq!(found.goals[0].configurations[0].status, Change::Better);
    }
}

#[test]
fn what_is_missing_in_one_result_is_said() {
    let mut fewer = report();
    let list = fewer.pointer_mut("/goals/0/configurations").unwrap();
    list.as_array_mut().unwrap().remove(1);
    let found = compared(&report(), &fewer, &CompareOptions::default());
    assert_eq!(found.goals[0].configurations[1].status, Change::Lost);
    assert_eq!(found.failures[0].detail, "was ok, now missing");
    let found = compared(&fewer, &report(), &CompareOptions::default());
    assert_eq!(found.goals[0].configurations[1].status, Change::New);
    assert!(found.pass);

    let mut more = report();
    let mut goal = more["goals"][0].clone();
    goal["name"] = json!("second");
    more["goals"].as_array_mut().unwrap().push(goal);
    let found = compared(&more, &report(), &CompareOptions::default());
    assert_eq!(
        (found.goals[1].a.as_deref(), found.goals[1].b.as_deref()),
        (Some("second"), None)
    );
    assert_eq!(found.failures[0].goal.as_deref(), Some("second"));
    let found = compared(&report(), &more, &CompareOptions::default());
    assert_eq!(found.goals[1].b.as_deref(), Some("second"));
    assert!(found.pass);
}

#[test]
fn metric_that_is_no_longer_measured_fails_its_threshold() {
    let mut blind = report();
    let metrics = blind.pointer_mut("/goals/0/configurations/0/metrics");
    let metrics = metrics.unwrap().as_object_mut().unwrap();
    metrics.retain(|key, _| !key.starts_with("tip_error"));
    let found = compared(&report(), &blind, &limits(&[("tip_error", "1mm")]));
    let details: Vec<&str> = found
        .failures
        .iter()
        .map(|each| each.detail.as_str())
        .collect();
    assert!(
        details.contains(&"tip error: was 0.1 mm, no longer measured"),
        "{details:?}"
    );
    assert_eq!(first(&found, "tip_error").outcome, Change::Lost);
    // Whatever is lost is, without a threshold too.
    let found = compared(&report(), &blind, &CompareOptions::default());
    assert!(
        found.failures[0]
            .detail
            .starts_with("no longer measured: tip_error")
    );
    assert!(!found.pass);
}

#[test]
fn metrics_are_read_by_their_keys_alone() {
    let a =
        with_metrics(&json!({"clearance": 0.02, "clearance_attained": 0.03, "unheard_of": 1.0}));
    let b = with_metrics(&json!({"clearance": 0.01, "clearance_attained": 0.03}));
    let found = compared(&a, &b, &limits(&[("clearance", "5mm")]));
    assert_eq!(found.notes, Vec::<String>::new());
    assert_eq!(found.failures.len(), 2);
    assert_eq!(found.failures[0].metric.as_deref(), Some("clearance"));
    let each = &found.goals[0].configurations[0];
    let names = |metrics: Vec<&MetricComparison>| -> Vec<String> {
        metrics.iter().map(|found| found.metric.clone()).collect()
    };
    assert_eq!(
        names(each.metrics.iter().collect()),
        ["clearance_attained", "clearance"]
    );
    // The proven bound says more than the nearest approach.
    assert_eq!(names(each.telling_metrics().collect()), ["clearance"]);
    // Of one configuration alone.
    let found = compared(&a, &b, &limits(&[("clearance:Left-Up-Fold", "5mm")]));
    assert_eq!(found.failures.len(), 1);
    assert_eq!(found.failures[0].label.as_deref(), Some("Left-Up-Fold"));
}

#[test]
fn what_the_first_result_has_is_never_replaced_by_something_else() {
    let both = json!({"clearance": 0.02, "clearance_attained": 0.03});
    let (a, b) = (
        with_metrics(&both),
        with_metrics(&json!({"clearance_attained": 0.03})),
    );
    let found = compared(&a, &b, &limits(&[("clearance", "5mm")]));
    let mut details = found.failures.iter().map(|each| &each.detail);
    let says = details.any(|detail| detail.contains("no longer measured"));
    assert!(says, "{:?}", found.failures);
    assert_eq!(found.notes, Vec::<String>::new());
}

#[test]
fn threshold_that_checks_nothing_fails() {
    let found = compared(&report(), &report(), &limits(&[("sight_fraction", "5%")]));
    assert_eq!(found.failures.len(), 1);
    assert!(found.failures[0].detail.contains("checks nothing"));
}

#[test]
fn not_a_number_is_neither_better_nor_worse() {
    // JSON has no NaN: writers leave null.
    let nothing = with(&report(), CLEARANCE, Value::Null);
    let found = compared(&nothing, &report(), &CompareOptions::default());
    assert_eq!(first(&found, "clearance_attained").outcome, Change::New);
}

#[test]
fn renamed_goals_are_matched_and_wrong_names_refused() {
    let renamed = with(&report(), "/goals/0/name", json!("entry"));
    let (a, b) = (stored("a", &report()), stored("b", &renamed));
    let error = compare(&a, &b, &CompareOptions::default()).unwrap_err();
    assert!(matches!(error, CompareError::NothingInCommon { .. }));
    let options = |pairs: &[(&str, &str)]| CompareOptions {
        renamed_goals: pairs
            .iter()
            .map(|(a, b)| ((*a).to_owned(), (*b).to_owned()))
            .collect(),
        ..CompareOptions::default()
    };
    let found = compare(&a, &b, &options(&[("pose", "entry")])).unwrap();
    assert_eq!(found.goals.len(), 1);
    assert!(found.pass);
    let error = compare(&a, &b, &options(&[("pose", "entri")])).unwrap_err();
    assert_eq!(error.to_string(), "b has no goal `entri`; it has entry");
    let twice = options(&[("pose", "entry"), ("pose", "entry")]);
    assert!(matches!(
        compare(&a, &b, &twice).unwrap_err(),
        CompareError::RenamedTwice { .. }
    ));
}

#[test]
fn differences_of_versions_inputs_and_settings_are_listed() {
    let other = with(&report(), "/provenance/inputs/0/sha256", json!("11"));
    let other = with(&other, "/provenance/engines/0/settings/0/1", json!("0.5"));
    let other = with(&other, "/provenance/version", json!("0.2.0"));
    let found = compared(&report(), &other, &CompareOptions::default());
    let what: Vec<&str> = found
        .provenance_differences
        .iter()
        .map(|difference| difference.what.as_str())
        .collect();
    assert_eq!(what, ["rapier friction", "scenario", "version"]);
    // The same file under another name is the same.
    let moved = with(&report(), "/provenance/inputs/0/file", json!("other.toml"));
    let found = compared(&report(), &moved, &CompareOptions::default());
    assert_eq!(found.provenance_differences, []);
}

#[test]
fn text_that_is_no_report_is_refused_with_its_place() {
    let cut = "{\n  \"schema_version\": 1,\n  \"goals\": [";
    let found = StoredReport::parse("r.json", cut).unwrap_err();
    assert_eq!((found.file.as_str(), found.line), ("r.json", Some(3)));
    assert!(found.message.contains("is truncated"), "{found}");
    assert!(found.message.contains("line 3 column 12"), "{found}");

    let found = StoredReport::parse("r.json", "{\n  oops }").unwrap_err();
    assert_eq!(found.line, Some(2));
    for (text, part) in [
        ("", "is truncated"),
        ("[]", "schema_version"),
        ("{\"schema_version\": 1}", "the list `goals` is missing"),
        ("{\"schema_version\": 2, \"goals\": []}", "supports up to 1"),
        ("{\"schema_version\": 1, \"goals\": [{}]}", "goals[0].name"),
        (
            "{\"schema_version\": 1, \"goals\": [{\"name\": \"g\", \"configurations\": \
             [{\"label\": \"Right-Up-Fold\", \"status\": \"ok\"}]}]}",
            "`goals[0].configurations[0].metrics` is missing",
        ),
        (
            "{\"schema_version\": 1, \"results\": [{\"scenario\": {\"name\": \"a\"}}, \
             {\"scenario\": {\"name\": \"b\"}}]}",
            "2 scenarios: a, b",
        ),
    ] {
        let found = StoredReport::parse("r.json", text).unwrap_err();
        assert!(found.to_string().contains(part), "{found}");
        assert!(found.hint.is_some());
    }
    // One scenario in the form of several is as good as by itself.
    let one = json!({"schema_version": 1, "results": [report()]}).to_string();
    assert!(StoredReport::parse("r.json", &one).is_ok());
}
