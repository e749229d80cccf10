//! What people see: one screen that fits, words, lines of progress, and what to use instead of a wrong file.

use crate::support::{Bench, SMALL, holds, with_edit};

/// Lines of what a command prints at this width, but for what is a path.
fn lines(bench: &Bench, columns: &str, arguments: &str) -> Vec<String> {
    let answer = bench.run_with(&[("COLUMNS", Some(columns))], arguments);
    let lines = answer.exits_with(0).stdout;
    lines.lines().map(str::to_owned).collect()
}

/// Lines of tables: those between a line under headings and the next empty line or sentence.
fn table_lines(lines: &[String]) -> Vec<&String> {
    let ruled = |at: usize| lines[at].starts_with('─');
    let rows = (0..lines.len()).filter(|&at| {
        ruled(at)
            || (1..=8).any(|before| at >= before && ruled(at - before) && lines[at].contains("  "))
    });
    rows.map(|at| &lines[at]).collect()
}

#[test]
fn run_prints_one_screen_with_the_verdict_first() {
    let bench = Bench::with_scenario(SMALL);
    let run = "run s.toml --engine rapier --no-page";
    for columns in ["80", "100", "200"] {
        let lines = lines(&bench, columns, run);
        assert!(lines[0].starts_with("PASS small: "), "{lines:#?}");
        assert!(lines[1].starts_with("recommended: Right-"), "{lines:#?}");
        assert!((15..=40).contains(&lines.len()), "{lines:#?}");
        let width: usize = columns.parse().unwrap();
        let table = table_lines(&lines);
        assert!(table.len() > 6, "{lines:#?}");
        for line in table {
            assert!(line.chars().count() <= width, "{columns}: {line}");
        }
        let text = lines.join("\n");
        assert!(text.contains("2 of 8 infeasible:"), "{text}");
        assert!(text.contains("blocks the access zone: Left-"), "{text}");
        assert!(!text.contains("wrist_2"), "{text}");
        assert!(!text.contains('\u{1b}'), "{text}");
    }
}

#[test]
fn wide_prints_all_tables_however_wide() {
    let bench = Bench::with_scenario(SMALL);
    let run = "run s.toml --engine rapier --no-page --wide";
    let lines = lines(&bench, "80", run);
    let text = lines.join("\n");
    holds(
        &text,
        [
            "free space and line of sight",
            "physician",
            "torque",
            "score of 100",
            "note: ",
        ],
    );
    assert!(
        lines
            .iter()
            .any(|line| line.starts_with('─') && line.chars().count() > 100)
    );
}

#[test]
fn several_goals_are_summed_up_and_not_listed() {
    let second = SMALL.split_once("[[goals]]").expect("it has a goal").1;
    let second = second.split("\n[motion]").next().unwrap_or_default();
    let second = second.replacen("name = \"pose\"", "name = \"second_pose\"", 1);
    let text = SMALL.replacen("[[goals]]", &format!("[[goals]]{second}\n\n[[goals]]"), 1);
    let bench = Bench::with_scenario(&text);
    let run = "run s.toml --engine rapier --no-page";
    let lines = lines(&bench, "80", run);
    let text = lines.join("\n");
    assert!(lines.len() <= 40, "{text}");
    assert!(text.contains("access zone"), "{text}");
    assert!(text.contains("second_pose: Right-"), "{text}");
}

#[test]
fn a_log_has_no_bar_and_quiet_says_nothing() {
    let bench = Bench::with_scenario(SMALL);
    let run = "run s.toml --engine rapier --no-page";
    for ci in [None, Some("true")] {
        let answer = bench.run_with(&[("CI", ci)], format!("{run} --quiet"));
        assert_eq!(answer.exits_with(0).stderr, "");
    }
    let answer = bench.run(run).exits_with(0);
    for line in answer.stderr.lines() {
        assert!(line.starts_with('[') && line.contains(" s] "), "{line}");
    }
}

#[test]
fn pictures_are_left_out_where_ci_is_set_unless_they_are_asked_for() {
    let text = with_edit(SMALL, "pictures = false", "pictures = true");
    let bench = Bench::with_scenario(&text);
    let run = "run s.toml --engine rapier --no-page";
    let has_pictures = |bench: &Bench| {
        let tree = bench.tree("out/small");
        tree.iter().any(|path| path.ends_with("pose.png"))
    };
    for (ci, more, expected) in [
        ("true", "", false),
        ("1", "--pictures", true),
        ("false", "", true),
        ("false", "--no-pictures", false),
    ] {
        let answer = bench
            .run_with(&[("CI", Some(ci))], format!("{run} {more}"))
            .exits_with(0);
        assert_eq!(has_pictures(&bench), expected, "{ci} {more}");
        let says = answer.stderr.matches("because CI is set").count();
        assert_eq!(says, usize::from(ci == "true"), "{answer:#?}");
    }
}
