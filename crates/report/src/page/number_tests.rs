//! Pages write numbers as tables do: `number.js` mirrors [`crate::number`], and both are held against one file.

use std::path::Path;

use needlebench_evaluation::metric::Show;
use needlebench_show::number::{measured, percent, small_length, three_digits, value_and_limit};
use serde_json::{Value, json};

use crate::table::shown::metric_text;

const FILE: &str = "../../tests/page/numbers.json";
/// Set, the file is written anew.
const WRITE: &str = "WRITE_NUMBERS";

/// Sizes from rounding errors to a cell, with halves that round to even and what has to be told apart.
const VALUES: [f64; 22] = [
    0.0,
    2.243e-16,
    9e-13,
    1e-12,
    2.5e-12,
    3.21e-9,
    1.638e-8,
    9.999e-7,
    1e-6,
    4.5e-5,
    0.000_125,
    9.999e-4,
    1e-3,
    0.002_704_3,
    0.0027,
    0.010_638,
    0.5,
    0.125,
    1.5,
    2.5,
    12.3456,
    1234.5,
];

fn cases() -> Value {
    let signed = || VALUES.into_iter().flat_map(|value| [value, -value]);
    let lengths: Vec<Value> = signed()
        .map(|value| json!([value, small_length(value)]))
        .collect();
    let numbers: Vec<Value> = signed()
        .map(|value| json!([value, three_digits(value)]))
        .collect();
    let values: Vec<Value> = ["mm", "mm/mrad", "1"]
        .into_iter()
        .flat_map(|unit| signed().map(move |value| json!([value, unit, measured(value, unit)])))
        .collect();
    let shares = [0.0, 1e-5, 4.9e-4, 0.0125, 0.123, 0.999, 0.9996, 1.0];
    let shares: Vec<Value> = shares.map(|share| json!([share, percent(share)])).into();
    let shows = [
        ("millimetres", Show::Millimetres),
        ("length", Show::SmallLength),
        ("number", Show::Number),
        ("degrees", Show::Degrees),
    ];
    let shows: Vec<Value> = shows
        .into_iter()
        .flat_map(|(name, show)| {
            signed().map(move |value| json!([name, value, metric_text(show, value)]))
        })
        .collect();
    let limits: Vec<Value> = ["m", "rad", "1", "N", "N m", "s"]
        .into_iter()
        .flat_map(|unit| {
            signed().flat_map(move |value| {
                [0.0, 1e-9, 0.0027, 1.0, 2.0].map(|limit| {
                    let (text, bound) = value_and_limit(value, limit, unit);
                    json!([value, limit, unit, text, bound])
                })
            })
        })
        .collect();
    json!({
        "small_length": lengths, "percent": shares, "shown": shows, "value_and_limit": limits,
        "three_digits": numbers, "measured": values,
    })
}

#[test]
fn numbers_of_pages_are_those_of_tables() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    let text = format!("{}\n", cases()).replace("],[", "],\n[");
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        known == text,
        "number.rs changed: mend assets/number.js, then write {FILE} with {WRITE}=1 and run tests/page"
    );
}
