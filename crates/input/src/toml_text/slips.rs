//! Slips of people who write TOML by hand: what a line that is no TOML was likely meant to be, and numbers that
//! look like those of another unit.

use std::f64::consts::FRAC_PI_4;
use std::fmt::Write;
use std::ops::Range;

use toml::{Table, Value};

use crate::schema::unit_of;

/// How to fix the line in which a text ceases to be TOML, where that can be told.
pub(super) fn hint_about(text: &str, span: Range<usize>) -> Option<String> {
    let at = span.start.min(text.len());
    let start = text.get(..at)?.rfind('\n').map_or(0, |end| end + 1);
    let line = text.get(start..)?.lines().next()?;
    let line = line.split('#').next()?.trim();
    let Some((key, value)) = line.split_once('=') else {
        let (key, value) = line.split_once(':')?;
        return Some(format!("write `{} = {}`", key.trim(), value.trim()));
    };
    let (key, value) = (key.trim(), value.trim());
    // By itself it is TOML: what is wrong is that it was there before.
    if line.parse::<Table>().is_ok() {
        return Some(format!(
            "duplicate `{key}` in its section: keep one of the lines"
        ));
    }
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    if value.is_empty() {
        return Some(format!("write a value after `{key} =`"));
    }
    if value.contains(['\u{201c}', '\u{201d}', '\u{2018}', '\u{2019}']) {
        return Some("put plain quotes (\") about it, not typographic ones".to_owned());
    }
    if let Some((whole, decimals)) = value.split_once(',')
        && is_number(whole)
        && is_number(decimals)
    {
        return Some(format!("use a decimal point: `{key} = {whole}.{decimals}`"));
    }
    if let Some(inside) = value
        .strip_prefix('(')
        .and_then(|rest| rest.strip_suffix(')'))
    {
        return Some(format!(
            "write lists in square brackets: `{key} = [{inside}]`"
        ));
    }
    if let Some(inside) = value
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'))
    {
        let words: Vec<&str> = inside
            .split([' ', ',', ';'])
            .filter(|word| !word.is_empty())
            .collect();
        let are_numbers = words.iter().all(|word| is_number(word));
        return are_numbers.then(|| {
            format!(
                "put commas between the numbers: `{key} = [{}]`",
                words.join(", ")
            )
        });
    }
    let quotes = |quote: char| value.matches(quote).count();
    if quotes('"') % 2 == 1 || quotes('\'') % 2 == 1 {
        return Some("the text has to end with the quote that it begins with".to_owned());
    }
    let digits =
        value.trim_end_matches(|c: char| c.is_alphabetic() || c.is_whitespace() || c == '%');
    if is_number(digits) && digits.len() < value.len() {
        return Some(format!(
            "write the number alone, `{key} = {digits}`: the key's name says the unit"
        ));
    }
    let is_word = |c: char| c.is_alphanumeric() || "_-./ ".contains(c);
    if value.chars().all(is_word) {
        return Some(format!("write texts in quotes: `{key} = \"{value}\"`"));
    }
    None
}

/// Values whose numbers look like those of another unit than their key says: radians for degrees, metres for
/// millimetres. They are possible, so they are doubts and no errors.
pub(super) fn doubtful_units(values: &Table) -> Vec<String> {
    let mut found = Vec::new();
    each_value(values, "", &mut |path, key, value| {
        found.extend(match unit_of(key) {
            "deg" => doubt_degrees(path, value),
            "mm" if is_place(key) => doubt_millimetres(path, value),
            _ => None,
        });
    });
    found
}

fn each_value(table: &Table, path: &str, visit: &mut impl FnMut(&str, &str, &Value)) {
    for (key, value) in table {
        let here = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        match value {
            Value::Table(inner) => each_value(inner, &here, visit),
            Value::Array(items) if items.iter().any(Value::is_table) => {
                for (index, item) in items.iter().enumerate() {
                    if let Value::Table(inner) = item {
                        each_value(inner, &format!("{here}[{index}]"), visit);
                    }
                }
            }
            value => visit(&here, key, value),
        }
    }
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    let number = |value: &Value| match value {
        Value::Integer(number) => Some(*number as f64),
        Value::Float(number) => Some(*number),
        _ => None,
    };
    match value {
        Value::Array(items) => items.iter().map(number).collect(),
        value => Some(vec![number(value)?]),
    }
}

/// Keys of points and sizes of things that fill more than a few millimetres.
fn is_place(key: &str) -> bool {
    [
        "position_mm",
        "entry_mm",
        "target_mm",
        "center_mm",
        "isocentre_mm",
        "size_mm",
    ]
    .iter()
    .any(|end| key.ends_with(end))
}

/// A multiple of 45 degrees, written in radians to two digits or more.
fn doubt_degrees(path: &str, value: &Value) -> Option<String> {
    /// What rounding to two decimals leaves.
    const ROUNDING: f64 = 5e-3;
    let numbers = numbers(value)?;
    let is_radians = |number: f64| {
        let eighths = (number / FRAC_PI_4).round();
        let is_multiple = (1.0..=8.0).contains(&eighths.abs());
        number.fract() != 0.0 && is_multiple && (number - eighths * FRAC_PI_4).abs() < ROUNDING
    };
    let is_slip = numbers.iter().any(|number| is_radians(*number))
        && numbers
            .iter()
            .all(|number| *number == 0.0 || is_radians(*number));
    is_slip.then(|| {
        let degrees = numbers
            .iter()
            .map(|number| (number.to_degrees() / 45.0).round() * 45.0);
        format!(
            "`{path}` is in degrees: did you give radians? They are {} deg",
            listed(degrees)
        )
    })
}

/// A point or a size of no more than a few millimetres, with decimals.
fn doubt_millimetres(path: &str, value: &Value) -> Option<String> {
    /// No shipped arm reaches farther, m.
    const REACH: f64 = 3.0;
    let numbers = numbers(value)?;
    let is_slip = numbers.len() > 1
        && numbers.iter().all(|number| number.abs() < REACH)
        && numbers.iter().any(|number| number.fract() != 0.0);
    is_slip.then(|| {
        let millimetres = numbers.iter().map(|number| (number * 1e4).round() / 10.0);
        format!(
            "`{path}` is in millimetres: did you give metres? They are {} mm",
            listed(millimetres)
        )
    })
}

fn listed(numbers: impl ExactSizeIterator<Item = f64>) -> String {
    let is_list = numbers.len() > 1;
    let mut text = String::new();
    for number in numbers {
        let comma = if text.is_empty() { "" } else { ", " };
        // Writing to a String cannot fail.
        let _ = write!(text, "{comma}{number}");
    }
    if is_list { format!("[{text}]") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn hint(line: &str) -> String {
        let text = format!("a = 1\n{line}\nb = 2\n");
        let error = toml::de::DeTable::parse(&text).expect_err(line);
        hint_about(&text, error.span().unwrap()).unwrap_or_default()
    }

    #[test]
    fn lines_that_are_no_toml_are_mended() {
        for (line, wanted) in [
            ("urdf = ur3", "`urdf = \"ur3\"`"),
            ("length_mm = 200,5", "`length_mm = 200.5`"),
            ("length_mm = 200 mm", "`length_mm = 200`"),
            ("length_mm: 200", "`length_mm = 200`"),
            ("entry_mm = [1.5 2 -3]", "`entry_mm = [1.5, 2, -3]`"),
            ("entry_mm = (1.5, 2, -3)", "`entry_mm = [1.5, 2, -3]`"),
            ("lesion = \u{201c}a\u{201d}", "plain quotes"),
            ("lesion = \"a", "end with the quote"),
            ("length_mm =", "a value after `length_mm =`"),
            ("a = 2", "duplicate `a`"),
        ] {
            let found = hint(line);
            assert!(found.contains(wanted), "{line}: {found}");
        }
    }

    fn doubts(text: &str) -> Vec<String> {
        doubtful_units(&text.parse().unwrap())
    }

    #[test]
    fn radians_and_metres_are_doubted_and_degrees_and_millimetres_are_not() {
        let found =
            doubts("[robot]\nbase_rpy_deg = [0, 0, 4.712]\nbase_position_mm = [-0.28, 0.35, 1.05]");
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(
            found
                .iter()
                .any(|each| each.contains("[-280, 350, 1050] mm")),
            "{found:?}"
        );
        assert!(
            found.iter().any(|each| each.contains("[0, 0, 270] deg")),
            "{found:?}"
        );
        assert!(doubts("[[goals]]\nroll_deg = 1.57")[0].starts_with("`goals[0].roll_deg`"));
        let sound = "[robot]\nbase_rpy_deg = [0, 0, 270]\nbase_position_mm = [0, 0, 800.5]\n[[goals]]\n\
                     entry_direction_deg = [3.2, -1.57]\ntarget_offset_mm = [0.5, 0, 0]\nroll_deg = 2";
        assert_eq!(doubts(sound), [""; 0]);
    }
}
