//! Texts of users where people read them: on terminals and in pages of continuous integration.

use std::borrow::Cow;
use std::fmt::Write;

/// A text that no terminal takes for a command: control characters, and those that turn the direction of
/// writing, are written as `\u{1b}`; line ends and tabs stay.
///
/// Names of files may have any byte but `/` and zero, and strings of TOML and JSON any character.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for character in text.chars() {
        if is_hidden(character) {
            // Writing to a String cannot fail.
            let _ = write!(shown, "\\u{{{:x}}}", u32::from(character));
        } else {
            shown.push(character);
        }
    }
    Cow::Owned(shown)
}

/// The same of a JSON document, where such characters stand in strings alone: it stays the same document.
pub fn printable_json(document: &str) -> Cow<'_, str> {
    if !document.chars().any(is_hidden) {
        return Cow::Borrowed(document);
    }
    let mut shown = String::with_capacity(document.len() + 8);
    for character in document.chars() {
        if is_hidden(character) {
            // All of them are of the basic plane: four digits.
            let _ = write!(shown, "\\u{:04x}", u32::from(character));
        } else {
            shown.push(character);
        }
    }
    Cow::Owned(shown)
}

/// The same in one line.
pub fn printable_line(text: &str) -> String {
    let text = text.replace(['\r', '\n', '\t'], " ");
    printable(&text).into_owned()
}

fn is_hidden(character: char) -> bool {
    // Marks, embeddings, overrides and isolates of the bidirectional algorithm (UAX 9), and the separators of
    // lines and paragraphs.
    let turns = matches!(
        character,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
    );
    turns || character.is_control() && !matches!(character, '\n' | '\t')
}

/// Lines of a comment, as TOML and YAML have them.
pub fn commented(text: &str) -> String {
    text.lines().fold(String::new(), |mut out, line| {
        out.extend(["# ", line, "\n"]);
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_control_character_is_left() {
        assert_eq!(printable("a\u{1b}[31mred\u{7}"), "a\\u{1b}[31mred\\u{7}");
        assert_eq!(printable("csi \u{9b}2J"), "csi \\u{9b}2J");
        assert_eq!(printable("\u{202e}lmot.exe"), "\\u{202e}lmot.exe");
        assert_eq!(
            printable("two\nlines\tof \u{3b1}"),
            "two\nlines\tof \u{3b1}"
        );
        assert_eq!(printable_line("two\r\nlines"), "two  lines");
        assert_eq!(printable_json("[\"\u{9b}\u{7f}\"]"), "[\"\\u009b\\u007f\"]");
    }
}
