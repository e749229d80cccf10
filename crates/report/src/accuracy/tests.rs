use needlebench_evaluation::accuracy::{Drawn, HitRadius, Sample, summarise};

use super::*;

/// Two groups of twelve needles and one of a single one, with names that mean something to every format.
fn table() -> AccuracyTable {
    let names = ["lung, right_upper", "50 % & <b>|x|", "#1"].map(str::to_owned);
    let mut samples: Vec<Sample> = (0..24_u32)
        .map(|index| {
            let mut values = [None; QUANTITIES.len()];
            values[0] = Some(80.0 + f64::from(index));
            values[TARGET_ED] = Some(0.5 + 0.1 * f64::from(index));
            values[8] = Some(-1e-9);
            Sample {
                group: (index % 2) as usize,
                block: Some(u64::from(index / 2)),
                values,
            }
        })
        .collect();
    let mut lone = [None; QUANTITIES.len()];
    lone[TARGET_ED] = Some(1.234_567);
    samples.push(Sample {
        group: 2,
        block: None,
        values: lone,
    });
    let (groups, all, tests) = summarise(&names, &samples, Some(2.0), &Drawn::Blocks);
    AccuracyTable {
        name: "a_study".to_owned(),
        by: vec!["goal".to_owned()],
        groups,
        all,
        tests,
        hit_radius: Some(HitRadius {
            radius_mm: 2.0,
            source: "--hit-radius".to_owned(),
        }),
        columns: std::array::from_fn(|_| {
            std::iter::once("tip_error_static_mm".to_owned()).collect()
        }),
        insertion_effects: Vec::new(),
        notes: vec!["Needles: all.".to_owned()],
    }
}

#[test]
fn csv_has_one_header_and_plain_numbers() {
    let text = accuracy_csv(&table());
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 5, "{text}");
    let header: Vec<&str> = lines[0].split(',').collect();
    assert_eq!(header.len(), 2 + 6 * QUANTITIES.len() + 3);
    assert_eq!(
        header[2..7],
        [
            "entry_target_length_n",
            "entry_target_length_mean_mm",
            "entry_target_length_sd_mm",
            "entry_target_length_min_mm",
            "entry_target_length_max_mm"
        ]
    );
    assert!(
        lines[1].starts_with("\"lung, right_upper\",12,12,91,"),
        "{text}"
    );
    // Nothing measured is empty, one number has no deviation.
    let cells: Vec<&str> = lines[3].split(',').collect();
    assert_eq!(cells.len(), header.len());
    let at = header
        .iter()
        .position(|name| *name == "target_ed_n")
        .unwrap();
    assert_eq!(
        cells[at..at + 5],
        ["1", "1.234567", "", "1.234567", "1.234567"]
    );
    assert_eq!(cells[2..7], ["0", "", "", "", ""]);
    assert!(lines[4].starts_with("all,25,24,"));
}

#[test]
fn the_caption_says_before_insertion_and_what_is_left_out() {
    let table = table();
    for text in [accuracy_markdown(&table), accuracy_text(&table)] {
        let words: Vec<&str> = text.split_whitespace().collect();
        let text = words.join(" ");
        for part in [
            "before insertion (robot and registration)",
            "columns with _static",
            "Slice thickness: not applicable",
            "Corrections: not applicable",
            "within 2 mm of the target (--hit-radius)",
            "Not measured here: entry ND",
        ] {
            let plain = text.replace('\\', "");
            assert!(plain.contains(part), "no `{part}` in {text}");
        }
    }
    let markup = accuracy_markdown(&table).replace("\\<b>", "");
    assert!(!markup.contains("<b>"), "{markup}");
}

#[test]
fn totals_never_stand_among_figures_before_insertion() {
    let mut table = table();
    let text = accuracy_markdown(&table);
    let (before, apart) = text.split_once(APART).unwrap();
    assert!(
        before.contains("Seifabadi et al. 2013 | 1.3 \u{b1} 0.7 mm"),
        "{before}"
    );
    for anchor in anchors() {
        if anchor.stage != Stage::BeforeInsertion {
            assert!(!before.contains(&anchor.measured), "{}", anchor.key);
            assert!(apart.contains(anchor.stage.words()), "{}", anchor.key);
        }
        assert!(text.contains(&anchor.doi), "{}", anchor.key);
    }
    // With bending of the needle in it ours is no peer of any.
    table.insertion_effects = vec!["needle".to_owned()];
    let text = accuracy_markdown(&table);
    assert!(text.contains("Not comparable with this table"), "{text}");
    assert!(text.contains("sampled insertion effects: needle"));
    assert!(!text.contains("All errors are before insertion"));
}

#[test]
fn every_anchor_names_a_column_or_none() {
    for anchor in anchors() {
        let known = QUANTITIES.iter().find(|each| each.key == anchor.quantity);
        match known {
            Some(quantity) => assert_eq!(quantity.unit().symbol, anchor.unit, "{}", anchor.key),
            None => assert_eq!(anchor.quantity, "other", "{}", anchor.key),
        }
    }
}

#[test]
fn a_terminal_of_80_columns_shows_it() {
    let mut table = table();
    for count in [1, 3, 9] {
        table.groups = (0..count)
            .map(|index| AccuracyRow {
                label: format!("right_upper_anterior_{index}, male-p95-supine"),
                ..table.all.clone()
            })
            .collect();
        let text = accuracy_text(&table);
        for line in text.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
        assert!(text.contains("supine"));
    }
}

#[test]
fn numbers_that_two_decimals_hide_are_not_none() {
    assert_eq!(number(0.0), "0.00");
    assert_eq!(number(0.004), "<0.01");
    assert_eq!(number(-1e-9), ">-0.01");
    assert_eq!(number(0.005), "0.01");
    assert_eq!(number(-1.256), "-1.26");
}

#[test]
fn latex_has_no_command_but_ours() {
    let text = accuracy_latex(&table());
    assert!(text.contains("50 \\% \\& $<$b$>$$|$x$|$"), "{text}");
    assert!(
        text.contains("lung, right\\_upper & 12 & \\shortstack[r]{91.00 $\\pm$"),
        "{text}"
    );
    assert!(text.contains("\\toprule") && text.contains("\\bottomrule"));
    let opened = text.matches('{').count() - text.matches("\\{").count();
    let closed = text.matches('}').count() - text.matches("\\}").count();
    assert_eq!(opened, closed);
    assert_eq!(
        latex::escaped("\\input{x}~^"),
        "\\textbackslash{}input\\{x\\}\\textasciitilde{}\\textasciicircum{}"
    );
    // Every row of a table has as many cells.
    let rows = text.lines().filter(|line| line.ends_with("\\\\"));
    let ands = rows.map(|line| line.matches(" & ").count());
    let mut counts: Vec<usize> = ands.collect();
    counts.sort_unstable();
    counts.dedup();
    assert_eq!(counts.len(), 2, "ours and the published ones: {counts:?}");
}
