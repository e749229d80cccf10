//! The pages of `run` and `atlas`.

use crate::support::{Bench, SMALL, small_run, with_edit};

/// Largest page of a run.
const MOST_BYTES: usize = 3_000_000;

fn page(bench: &Bench, name: &str) -> String {
    bench.text(name)
}

#[test]
fn a_run_leaves_one_small_file_that_needs_no_other() {
    let html = page(&small_run().0, "out/small/report.html");
    assert!(html.len() < MOST_BYTES, "{} bytes", html.len());
    assert!(html.contains("<title>run: small - needlebench</title>"));
    assert!(html.contains("default-src 'none'"));
    for reference in ["<link", "src=\"", "href=\"", "@import", "url("] {
        let own = html.split("id=\"payload\"").next().unwrap();
        assert!(!own.contains(reference), "{reference}");
    }
}

#[test]
fn texts_of_a_scenario_stay_texts() {
    let attack = r#"description = "</script><img src=x onerror='window.attacked = true'>""#;
    let text = with_edit(
        SMALL,
        "name = \"small\"",
        &format!("name = \"small\"\n{attack}"),
    );
    let bench = Bench::with_scenario(&text);
    bench.run("run s.toml --engine rapier").exits_with(0);
    bench.run("roll-map s.toml --rolls 12 --no-pictures");
    for name in ["out/small/report.html", "out/small/atlas.html"] {
        let html = page(&bench, name);
        assert!(html.contains("&lt;/script&gt;&lt;img src=x"), "{name}");
        assert!(!html.contains("<img"), "{name}");
    }
}

#[test]
fn without_a_page_an_earlier_one_does_not_stay() {
    let bench = Bench::with_scenario(SMALL);
    let arguments = "run s.toml --engine rapier";
    bench.run(arguments).exits_with(0);
    assert!(bench.path("out/small/report.html").exists());
    let without = format!("{arguments} --no-page");
    bench.run(&without).exits_with(0);
    assert!(!bench.path("out/small/report.html").exists());
    let atlas = "roll-map s.toml --rolls 12 --no-pictures";
    bench.run(atlas);
    assert!(bench.path("out/small/atlas.html").exists());
    bench.run(format!("{atlas} --no-page"));
    assert!(!bench.path("out/small/atlas.html").exists());
}
