//! Texts for users in files of several languages.

/// A text, and the line that it begins in.
#[derive(Debug)]
pub struct Text {
    pub line: usize,
    pub text: String,
}

impl Text {
    pub fn new(line: usize, text: &str) -> Self {
        let text = text.to_owned();
        Self { line, text }
    }
}

/// Documentation (`///`, `//!`) and string literals of Rust and JavaScript. A literal of one word is a name.
pub fn in_code(code: &str, quotes: &[char]) -> Vec<Text> {
    let mut texts: Vec<Text> = Vec::new();
    let (mut rest, mut line, mut last_documented) = (code, 1, 0);
    while let Some(first) = rest.chars().next() {
        let is_rust = !quotes.contains(&'\'');
        let length = if rest.starts_with("//") {
            let length = rest.find('\n').unwrap_or(rest.len());
            if rest.starts_with("///") || rest.starts_with("//!") {
                let text = &rest[3..length];
                // A paragraph goes on from line to line.
                if let Some(before) = texts.last_mut().filter(|_| last_documented + 1 == line) {
                    before.text.push('\n');
                    before.text.push_str(text);
                } else {
                    texts.push(Text::new(line, text));
                }
                last_documented = line;
            }
            length
        } else if !is_rust && rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if is_rust && first == '\'' {
            character(rest)
        } else if is_rust && (rest.starts_with("r\"") || rest.starts_with("r#")) {
            raw(rest, line, &mut texts)
        } else if quotes.contains(&first) {
            literal(rest, first, line, &mut texts)
        } else {
            first.len_utf8()
        };
        line += rest[..length].matches('\n').count();
        rest = &rest[length..];
    }
    texts
}

/// Length of a character, or of the quote of a lifetime.
fn character(rest: &str) -> usize {
    let mut chars = rest.char_indices().skip(1);
    let (_, first) = chars.next().unwrap_or_default();
    if first == '\\' {
        let end = rest[3..].find('\'');
        return end.map_or(rest.len(), |end| end + 4);
    }
    match chars.next() {
        Some((index, '\'')) => index + 1,
        _ => 1,
    }
}

/// Length of `r#"..."#`, whose text is kept.
fn raw(rest: &str, line: usize, texts: &mut Vec<Text>) -> usize {
    let hashes = rest[1..].chars().take_while(|each| *each == '#').count();
    let start = 2 + hashes;
    if !rest[1 + hashes..].starts_with('"') {
        return 1; // A name such as `r#type`.
    }
    let end = format!("\"{}", "#".repeat(hashes));
    let length = rest[start..].find(&end).unwrap_or(rest.len() - start);
    texts.push(Text::new(line, &rest[start..start + length]));
    (start + length + end.len()).min(rest.len())
}

/// Length of a literal in quotes, whose text is kept without escapes if it is no name.
fn literal(rest: &str, quote: char, line: usize, texts: &mut Vec<Text>) -> usize {
    let mut text = String::new();
    let mut chars = rest.char_indices().skip(1);
    let mut length = rest.len();
    while let Some((index, each)) = chars.next() {
        if each == quote {
            length = index + 1;
            break;
        }
        let is_escape = each == '\\';
        let escaped = if is_escape { chars.next() } else { None };
        text.push(match escaped {
            Some((_, '\n')) => '\n',
            Some(_) => ' ',
            None => each,
        });
    }
    if text.trim().contains(char::is_whitespace) {
        texts.push(Text::new(line, &text));
    }
    length
}

/// Lines of JSON or TOML with a description, and comments.
pub fn in_data(data: &str, key: &str) -> Vec<Text> {
    let lines = data.lines().zip(1..);
    let texts = lines.filter_map(|(text, line)| {
        let comment = text.split_once('#').filter(|_| !key.starts_with('"'));
        let described = text.trim_start().strip_prefix(key);
        let text = comment.map(|(_, comment)| comment).or(described)?;
        Some(Text::new(line, text))
    });
    texts.collect()
}

/// Texts in three quotes.
pub fn in_python(code: &str) -> Vec<Text> {
    let mut line = 1;
    let mut texts = Vec::new();
    for (index, part) in code.split("\"\"\"").enumerate() {
        if index % 2 == 1 {
            texts.push(Text::new(line, part));
        }
        line += part.matches('\n').count();
    }
    texts
}

/// All of it. In fenced blocks, which show what a program prints, names in front of a colon are columns and keys.
pub fn in_markdown(text: &str) -> Text {
    let mut is_block = false;
    let lines = text.lines().map(|line| {
        if line.trim_start().starts_with("```") {
            is_block = !is_block;
            return String::new();
        }
        if !is_block {
            return line.to_owned();
        }
        let words = line.split_whitespace();
        let words = words.skip_while(|word| word.ends_with([',', ':']));
        words.collect::<Vec<_>>().join(" ")
    });
    Text::new(1, &lines.collect::<Vec<_>>().join("\n"))
}
