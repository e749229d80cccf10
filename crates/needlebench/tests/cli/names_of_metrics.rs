//! One name is one number, in runs and in studies.

use needlebench_evaluation::metric::MetricKey;

use crate::support::{Bench, Json, SMALL};

const IMPERFECT: &str = "
[engines]
run = [\"rapier\"]
[imperfections]
budget_samples = 2
[imperfections.calibration]
[imperfections.encoder]
[imperfections.payload]
[imperfections.friction]
[imperfections.registration]
[imperfections.breathing]
";

/// `measured` has what `metrics` has, each name with its unit in SI.
fn names_with_units_have_the_numbers_of_those_without(configuration: &serde_json::Value) {
    let [metrics, measured] =
        ["metrics", "measured"].map(|key| configuration[key].as_object().unwrap());
    assert_eq!(metrics.len(), measured.len());
    for (name, value) in metrics {
        let key = MetricKey::named(name, &["rapier"]).unwrap();
        let unit = match key.metric().unit.symbol {
            "mm" | "um" => "_m",
            "deg" => "_rad",
            "s" => "_s",
            "N" => "_n",
            "m^3" => "_m3",
            "mm/mrad" => "_m_per_rad",
            "1" if name.starts_with("peak_") => "_ratio",
            "1" => "",
            other => panic!("{name} in {other}"),
        };
        assert_eq!(&measured[&format!("{name}{unit}")], value, "{name}");
    }
}

/// Two places of the phantom.
fn study(mode: &str) -> String {
    format!(
        "name = \"{mode}\"\nscenario = \"s.toml\"\nseed = 1\nmode = \"{mode}\"\n[[factors]]\nname = \"up\"\n\
         key = \"phantom.position_mm[2]\"\nvalues = [-2, 0]\nrelative = true\n"
    )
}

#[test]
fn a_case_and_its_run_have_the_same_number_under_the_same_name() {
    let bench = Bench::with_scenario(&format!("{SMALL}{IMPERFECT}"));
    for (mode, fewest_shared) in [("static", 1), ("planned", 28), ("dynamic", 55)] {
        bench.write("study.toml", study(mode));
        let case = "study study.toml --case 1 --quiet";
        let rows = bench.run(format!("{case} --json"));
        let rows = rows.exits_with(0).json();
        let status = bench.run(format!("{case} --run --no-page")).status;
        // The nominal pose is missed by more than a millimetre.
        assert!(matches!(status, Some(0 | 1)), "{status:?}");
        let report = bench.read_json(&format!("out/{mode}/cases/1/report.json"));
        let configurations = report["goals"][0]["configurations"].list();
        configurations
            .iter()
            .for_each(names_with_units_have_the_numbers_of_those_without);
        for (row, configuration) in rows["rows"].list().iter().zip(configurations) {
            assert_eq!(row["configuration"], configuration["label"]);
            let mut shared = 0;
            for (column, value) in row["metrics"].as_object().unwrap() {
                let key = MetricKey::named(column, &["rapier"]).unwrap();
                let of_run = &configuration["metrics"][&*key.key()];
                let Some(of_run) = of_run.as_f64() else {
                    // What a run does not have says so by its name.
                    let name = key.key();
                    let is_of_study = name.ends_with("_static") || name.contains("_planned");
                    assert!(is_of_study, "{mode} {column}");
                    continue;
                };
                #[expect(clippy::cast_possible_truncation, reason = "as columns are")]
                let bits = |value: f64| (value as f32).to_bits();
                assert_eq!(
                    bits(value.number()),
                    bits(of_run / key.metric().unit.si),
                    "{mode} {} {column}",
                    row["configuration"]
                );
                shared += 1;
            }
            assert!(
                configuration["status"] == "rejected" || shared >= fewest_shared,
                "{mode} {shared}"
            );
        }
    }
}

#[test]
fn a_name_that_static_studies_lack_is_answered_by_their_own_and_said() {
    let bench = Bench::with_scenario(SMALL);
    bench.write("study.toml", study("static"));
    let arguments = "study study.toml --quiet --no-page";
    bench.run(arguments).exits_with(0);
    let compare = |limit: &str| {
        let study = "out/static";
        bench.run(format!("compare {study} {study} --max-loss {limit}"))
    };
    let answer = compare("clearance@5=1mm").exits_with(0).stdout;
    let note = "note: threshold clearance@5: `clearance` was not measured; compared by \
                `clearance_static` instead (";
    assert!(answer.contains(note), "{answer}");
    let answer = compare("clearance_static@5=1mm").exits_with(0).stdout;
    assert!(!answer.contains("note:"), "{answer}");
    // Whoever says more says exactly what is meant.
    let answer = compare("clearance_attained@5=1mm").exits_with(1).stdout;
    assert!(answer.contains("neither study has values"), "{answer}");
}

#[test]
fn a_case_of_a_study_is_compared_with_its_run() {
    let bench = Bench::with_scenario(&format!("{SMALL}{IMPERFECT}"));
    bench.write("study.toml", study("dynamic"));
    bench
        .run("study study.toml --quiet --no-page")
        .exits_with(0);
    let run = "study study.toml --case 1 --run --quiet";
    bench.run(format!("{run} --no-page"));
    let compare = "compare out/dynamic/cases/1 out/dynamic";
    let with = |more: &str| bench.run(format!("{compare} {more}"));
    let same = with("--case 1 --max-loss tip_error=1nm --json");
    let same = same.exits_with(0).json();
    assert_eq!(same["provenance_differences"].to_string(), "[]");
    let mut compared = 0;
    for each in same["goals"][0]["configurations"].list() {
        assert_eq!(each["status"], "same", "{each}");
        for metric in each["metrics"].list() {
            assert_eq!(metric["outcome"], "same", "{metric}");
            compared += 1;
        }
    }
    assert!(compared > 6 * 40, "{compared}");
    // Another place of the patient is another number.
    let other = with("--case 0 --max-loss tip_error=1nm --json");
    other.says(["\"worse\""]);
    with("")
        .exits_with(2)
        .complains(["out/dynamic", "--case", "--case N"]);
    with("--case 2")
        .exits_with(2)
        .complains(["no case 2", "cases 0 to 1"]);
}
