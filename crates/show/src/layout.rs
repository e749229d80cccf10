//! Width of text output, and how lines are broken.
//!
//! The width belongs to the place that a text is for, a terminal or a log, of which a process has one: the
//! command line sets it before anything is written.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Default width: a log, a file, a pipe.
pub const DEFAULT_WIDTH: usize = 100;
/// No table or sentence is made narrower than this.
const LEAST_WIDTH: usize = 40;
/// Width of what is never broken.
const UNLIMITED: usize = usize::MAX;

static WIDTH: AtomicUsize = AtomicUsize::new(DEFAULT_WIDTH);

thread_local! {
    /// Whether this thread makes a text for a file, which is the same whatever the terminal.
    static FOR_FILE: Cell<bool> = const { Cell::new(false) };
}

/// Sets the width in characters; `None` breaks nothing.
pub fn set_width(width: Option<usize>) {
    let width = width.map_or(UNLIMITED, |width| width.max(LEAST_WIDTH));
    WIDTH.store(width, Ordering::Relaxed);
}

/// Width in characters that tables and sentences keep to.
pub fn width() -> usize {
    if FOR_FILE.get() {
        DEFAULT_WIDTH
    } else {
        WIDTH.load(Ordering::Relaxed)
    }
}

/// A text for a file: of [`DEFAULT_WIDTH`], whatever the terminal.
pub fn for_file<T>(make: impl FnOnce() -> T) -> T {
    let before = FOR_FILE.replace(true);
    let made = make();
    FOR_FILE.set(before);
    made
}

/// Characters of a line that are seen: sequences that set colours are not.
pub fn visible(line: &str) -> usize {
    let mut count = 0;
    let mut characters = line.chars();
    while let Some(character) = characters.next() {
        if character == '\u{1b}' {
            // Up to the letter that ends the sequence.
            characters.by_ref().skip(1).find(char::is_ascii_alphabetic);
        } else {
            count += 1;
        }
    }
    count
}

/// A text whose lines are broken at spaces where they are longer than the width; what goes on in a further
/// line is indented by two more than the line began. TOML stays fit to be pasted: a comment goes on as a
/// comment, and a value stays in its line.
pub fn wrapped(text: &str) -> String {
    wrapped_to(text, width())
}

/// The same for a given width.
pub fn wrapped_to(text: &str, width: usize) -> String {
    let lines = text.split('\n').map(|line| {
        if visible(line) <= width || is_assignment(line) {
            line.to_owned()
        } else {
            broken(line, width)
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Whether a line sets a key in TOML.
fn is_assignment(line: &str) -> bool {
    line.split_once(" = ").is_some_and(|(key, _)| {
        let is_of_key = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
        !key.is_empty() && key.chars().all(is_of_key)
    })
}

/// A long line in lines that fit, as far as its words do.
fn broken(line: &str, width: usize) -> String {
    let before = line.len() - line.trim_start().len();
    let start = if line.starts_with("# ") {
        "#   ".to_owned()
    } else {
        " ".repeat(before + 2)
    };
    let indent = start.len();
    let mut text = String::new();
    let mut taken = 0;
    for word in line.split_inclusive(' ') {
        let length = visible(word.trim_end());
        if taken > indent && taken + length > width {
            text.truncate(text.trim_end().len());
            text.push('\n');
            text.push_str(&start);
            taken = indent;
        }
        text.push_str(word);
        taken += visible(word);
    }
    text
}

/// A heading in lines of at most `width` characters as far as its words allow: broken at spaces, and behind
/// underscores and hyphens.
pub fn in_lines(text: &str, width: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_inclusive([' ', '_', '-']) {
        let last = lines.last_mut().expect("starts with one line");
        if !last.is_empty() && visible(last) + visible(word.trim_end()) > width {
            lines.push(word.to_owned());
        } else {
            last.push_str(word);
        }
    }
    let lines: Vec<&str> = lines.iter().map(|line| line.trim_end()).collect();
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_broken_at_spaces_and_keep_their_words() {
        let line = format!("  {}", "word ".repeat(50).trim_end());
        let text = wrapped_to(&line, 60);
        assert!(text.lines().count() > 4);
        assert!(text.lines().all(|line| line.len() <= 60), "{text}");
        assert!(text.lines().skip(1).all(|line| line.starts_with("    w")));
        assert_eq!(text.split_whitespace().count(), 50);
    }

    #[test]
    fn short_lines_long_words_and_the_ends_of_lines_stay() {
        assert_eq!(wrapped_to("  short\n\nlast\n", 40), "  short\n\nlast\n");
        let path = "x".repeat(90);
        assert_eq!(
            wrapped_to(&format!("results: {path}"), 60),
            format!("results:\n  {path}")
        );
    }

    #[test]
    fn toml_can_be_pasted_whatever_the_width() {
        let value = format!("names = [{}]", "\"word\", ".repeat(20));
        assert_eq!(wrapped_to(&value, 40), value);
        let comment = format!("# {}", "word ".repeat(20).trim_end());
        let text = wrapped_to(&comment, 40);
        assert!(text.lines().count() > 2);
        assert!(
            text.lines()
                .all(|line| line.starts_with("# ") && line.len() <= 40),
            "{text}"
        );
        assert!(!is_assignment("allowed clearance = 0.1mm"));
    }

    #[test]
    fn headings_are_broken_between_words() {
        assert_eq!(
            in_lines("right_upper_anterior", 12),
            "right_upper_\nanterior"
        );
        assert_eq!(
            in_lines("doctor across the table, 1.75 m", 14),
            "doctor across\nthe table,\n1.75 m"
        );
    }

    #[test]
    fn colours_take_no_width() {
        let line = "\u{1b}[38;5;9mred\u{1b}[39m and black";
        assert_eq!(visible(line), 13);
        assert_eq!(wrapped_to(line, 13), line);
    }
}
