//! Standard output and standard error.
//!
//! A failed write never panics: a closed pipe is the reader's choice, and a failure of standard error cannot be
//! reported.

use std::io::{IsTerminal, Write};
use std::path::Path;

use anyhow::{Context, Result};
use needlebench_input::{printable, printable_json, printable_line};
use needlebench_show::layout;
use serde::Serialize;

use crate::host;

/// Sets the width of tables and sentences: `COLUMNS`, else the width of the terminal, else that of a log.
pub(crate) fn keep_to_width() {
    // The terminal belongs to the host.
    if host::is_hosted() {
        return;
    }
    let terminal = || terminal_size::terminal_size_of(std::io::stdout());
    let of_terminal = || terminal().map(|(terminal_size::Width(width), _)| usize::from(width));
    let width = columns().or_else(of_terminal);
    layout::set_width(Some(width.unwrap_or(layout::DEFAULT_WIDTH)));
}

/// The width in `COLUMNS`.
fn columns() -> Option<usize> {
    let asked = std::env::var("COLUMNS").ok()?;
    asked.trim().parse().ok().filter(|width| *width > 0)
}

/// Disables line breaks: tables have their full width.
pub(crate) fn print_wide() {
    if !host::is_hosted() {
        layout::set_width(None);
    }
}

/// Writes text for people and a line end to standard output; on a terminal, or with `COLUMNS`, lines are broken at
/// spaces.
pub(crate) fn print_text(text: &str) -> Result<()> {
    if !host::is_hosted() && (std::io::stdout().is_terminal() || columns().is_some()) {
        print_as_it_is(&layout::wrapped(text))
    } else {
        print_as_it_is(text)
    }
}

/// Writes text for programs and a line end to standard output.
///
/// A closed pipe is not an error: the answer of the command determines its exit status.
pub(crate) fn print_as_it_is(text: &str) -> Result<()> {
    let text = without_commands(text);
    if host::take_output(&text) {
        return Ok(());
    }
    let mut out = anstream::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

/// A JSON document as it is printed on standard output.
pub(crate) fn json_text(value: &impl Serialize) -> Result<String> {
    let document = serde_json::to_string_pretty(value).map_err(std::io::Error::from)?;
    Ok(printable_json(&document).into_owned())
}

/// Writes a plain text and a line end to standard error.
pub(crate) fn complain(text: &str) {
    complain_styled(&printable(text));
}

/// The same for a text with colours of this program.
pub(crate) fn complain_styled(text: &str) {
    if host::take_message(text) {
        return;
    }
    let mut error = anstream::stderr().lock();
    // A failure cannot be reported.
    let _ = writeln!(error, "{text}").and_then(|()| error.flush());
}

/// A path in a line of output.
pub(crate) fn shown(path: &Path) -> String {
    printable_line(&path.display().to_string())
}

/// A text with the colours of tables, and no other control characters.
fn without_commands(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find('\u{1b}') {
        let (before, from) = rest.split_at(at);
        shown.push_str(&printable(before));
        let length = colour(from).unwrap_or(1);
        let (sequence, after) = from.split_at(length);
        if length > 1 {
            shown.push_str(sequence);
        } else {
            shown.push_str(&printable(sequence));
        }
        rest = after;
    }
    shown.push_str(&printable(rest));
    shown
}

/// Length of the sequence that sets colour or weight (SGR of ECMA-48) with which a text begins.
fn colour(text: &str) -> Option<usize> {
    let parameters = text.strip_prefix("\u{1b}[")?;
    let end = parameters.find(|letter: char| !letter.is_ascii_digit() && letter != ';')?;
    parameters[end..].starts_with('m').then_some(end + 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_stay_and_commands_do_not() {
        let text = "\u{1b}[38;5;9mred\u{1b}[0m \u{1b}]0;title\u{7} \u{1b}[2J \u{1b}";
        assert_eq!(
            without_commands(text),
            "\u{1b}[38;5;9mred\u{1b}[0m \\u{1b}]0;title\\u{7} \\u{1b}[2J \\u{1b}"
        );
        assert_eq!(without_commands("\u{1b}[31"), "\\u{1b}[31");
    }
}
