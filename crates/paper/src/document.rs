//! The results as one document: the page shows all of it, a terminal a part.
//!
//! `document.md` has its order and texts. `#` starts a heading; brackets contain the name of a chart or table of this
//! crate, followed by the caption of the chart; bars enclose a list of `paper.json` with its column headings, and the
//! next line the cells for each element of the list. `{format place}` is a value of `paper.json`. Lines that start with
//! `>` are for the page only.

use needlebench_report::page::parts::Part;
use needlebench_show::Block;
use needlebench_show::number::{duration, percent, short};
use serde_json::Value;

use super::charts::{chart, table};
use super::report::PaperReport;

/// The whole document; `pictures` are the images of the configurations, as PNG.
pub fn parts(report: &PaperReport, pictures: &[Vec<u8>]) -> Vec<Part> {
    let value = serde_json::to_value(report).expect("has texts for keys");
    let mut parts = Vec::new();
    let mut lines = include_str!("document.md").lines();
    while let Some(line) = lines.next() {
        let (kind, line): (fn(Block) -> Part, _) = match line.strip_prefix("> ") {
            Some(aside) => (Part::Aside, aside),
            None => (Part::Block, line),
        };
        if let Some(heading) = line.strip_prefix("# ") {
            parts.push(kind(Block::Heading(heading.to_owned())));
        } else if line.starts_with('|') {
            let each = lines.next().expect("what stands in the columns");
            parts.push(kind(list(line, each, &value)));
        } else if line == "[pictures]" {
            let configurations = report.free_space.configurations.iter();
            parts.extend(configurations.zip(pictures).map(|(each, png)| {
                let (label, letter, room) = (each.label, each.figure_6, each.room());
                let elbow_m = each.elbow_m;
                let caption =
                    format!("{label} (6{letter}): elbow {elbow_m:+.2} m, free space at {room}");
                Part::Picture(png.clone(), caption)
            }));
        } else if let Some((name, caption)) =
            line.strip_prefix('[').and_then(|line| line.split_once(']'))
        {
            parts.push(match table(name, report) {
                Some(table) => kind(table),
                None => Part::Chart(chart(name, report), filled(caption.trim_start(), &value)),
            });
        } else if !line.is_empty() {
            parts.push(kind(Block::Lines(vec![filled(line, &value)])));
        }
    }
    parts
}

/// The table of a list in the report.
fn list(header: &str, each: &str, report: &Value) -> Block {
    let cells = |line: &str| -> Vec<String> {
        let line = line.trim_matches(['>', ' ', '|']).replace("\\n", "\n");
        line.split(" | ").map(str::to_owned).collect()
    };
    let (header, each) = (cells(header), cells(each));
    let list = figure(&header[0], report).as_array().expect("a list");
    let row = |row| each[1..].iter().map(|cell| filled(cell, row)).collect();
    Block::Table {
        header: header[1..].to_vec(),
        rows: list.iter().map(row).collect(),
    }
}

fn figure<'v>(place: &str, report: &'v Value) -> &'v Value {
    let found = report.pointer(&format!("/{place}"));
    found.unwrap_or_else(|| panic!("{place} is not in the report"))
}

/// A text with its values.
fn filled(text: &str, report: &Value) -> String {
    let mut pieces = text.split(['{', '}']);
    let mut out = pieces.next().unwrap_or_default().to_owned();
    while let (Some(wanted), Some(further)) = (pieces.next(), pieces.next()) {
        let (format, place) = wanted.split_once(' ').expect("a format and a place");
        out.push_str(&shown(format, figure(place, report)));
        out.push_str(further);
    }
    out
}

fn shown(format: &str, value: &Value) -> String {
    let number = value.as_f64().unwrap_or(f64::NAN);
    match (format, value) {
        (_, Value::Null) => "-".to_owned(),
        ("short", _) => short(number),
        ("percent", _) => percent(number),
        ("share", _) => format!("{:.1} %", number * 100.0),
        ("duration", _) => duration(number),
        ("mm", _) => format!("{:.0} mm", number * 1e3),
        ("litres", _) => format!("{:.1}", number * 1e3),
        (".2", _) => format!("{number:.2}"),
        (".6", _) => format!("{number:.6}"),
        ("+.3", _) => format!("{number:+.3}"),
        ("+.1e", _) => format!("{number:+.1e}"),
        ("largest", Value::Array(values)) => {
            let sizes = values.iter().filter_map(Value::as_f64).map(f64::abs);
            short(sizes.fold(0.0, f64::max))
        }
        (_, Value::Bool(true)) => "yes".to_owned(),
        (_, Value::Bool(false)) => "NO".to_owned(),
        ("upper", Value::String(text)) => text.to_uppercase(),
        ("words", Value::String(text)) => text.replace('_', " "),
        (_, Value::String(text)) => text.clone(),
        (_, Value::Array(values)) => {
            let texts = values.iter().map(|each| shown(format, each));
            texts.collect::<Vec<_>>().join(", ")
        }
        (_, other) => other.to_string(),
    }
}
