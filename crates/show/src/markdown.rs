//! Texts of users in Markdown: as they are written, and neither markup nor HTML.

use needlebench_input::printable_line;

/// A text within a line: no line ends, no control characters, no emphasis, links, HTML, or cells of tables.
///
/// What means nothing where it stands stays as it is, so that summaries read well unrendered too: `_` within a
/// word, `<` before a number.
pub fn inline(text: &str) -> String {
    let line = printable_line(text);
    let characters: Vec<char> = line.trim().chars().collect();
    let mut escaped = String::with_capacity(line.len());
    for (at, &character) in characters.iter().enumerate() {
        let before = at.checked_sub(1).map(|at| characters[at]);
        let after = characters.get(at + 1).copied();
        let in_word = |other: Option<char>| other.is_some_and(char::is_alphanumeric);
        let is_markup = match character {
            '\\' | '`' | '*' | '|' => true,
            '_' => !(in_word(before) && in_word(after)),
            '~' => before == Some('~') || after == Some('~'),
            '<' => after.is_some_and(|next| next.is_ascii_alphabetic() || "/!?".contains(next)),
            '&' => after.is_some_and(|next| next.is_ascii_alphanumeric() || next == '#'),
            ']' => after.is_some_and(|next| "([:".contains(next)),
            _ => false,
        };
        if is_markup {
            escaped.push('\\');
        }
        escaped.push(character);
    }
    escaped
}

/// The same at the beginning of a line, where it must not begin a heading, a list, a quotation or a rule.
pub fn paragraph(text: &str) -> String {
    let escaped = inline(text);
    let digits = escaped.chars().take_while(char::is_ascii_digit).count();
    let point = escaped[digits..].strip_prefix(['.', ')']);
    let numbered = digits > 0 && point.is_some_and(|rest| rest.is_empty() || rest.starts_with(' '));
    if numbered {
        format!("{}\\{}", &escaped[..digits], &escaped[digits..])
    } else if escaped.starts_with(['#', '>', '-', '+', '=', '~', ':']) {
        format!("\\{escaped}")
    } else {
        escaped
    }
}

/// A text as code.
pub fn code(text: &str) -> String {
    format!("`{}`", printable_line(text).replace('`', "'"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_text_is_markup() {
        assert_eq!(
            inline("<script>alert(1)</script>"),
            "\\<script>alert(1)\\</script>"
        );
        assert_eq!(inline("a\n# b\n\n- c"), "a # b  - c");
        assert_eq!(
            inline("**bold** and `code`"),
            "\\*\\*bold\\*\\* and \\`code\\`"
        );
        assert_eq!(inline("[text](http://x)"), "[text\\](http://x)");
        assert_eq!(inline("a | b \\| c"), "a \\| b \\\\\\| c");
        assert_eq!(inline("&lt; &#60;"), "\\&lt; \\&#60;");
        assert_eq!(inline("\u{1b}[31mred"), "\\\\u{1b}[31mred");
        assert_eq!(paragraph("# title"), "\\# title");
        assert_eq!(paragraph("12. twelfth"), "12\\. twelfth");
        assert_eq!(paragraph("---"), "\\---");
        assert_eq!(code("a `b`\n"), "`a 'b' `");
    }

    #[test]
    fn what_means_nothing_stays() {
        for text in [
            "needle_corridor",
            "< 0.3 mm",
            "3 & 4",
            "goals[0].standoff_mm",
            "1.5 mm",
        ] {
            assert_eq!(inline(text), text);
            assert_eq!(paragraph(text), text);
        }
    }
}
