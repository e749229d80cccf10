//! YAML files, JSON among them, as trees in which every key and value knows its place.
//!
//! Read from the parser's events rather than into structs, so that every complaint names a line.

use std::borrow::Cow;
use std::ops::Range;

use granit_parser::{Event, Parser, Span, Tag};

use crate::Finding;

/// Nothing that is read here is deeper than eight levels.
const DEEPEST: usize = 16;

/// A value with its place in the text.
#[derive(Debug, Clone, PartialEq)]
pub struct YamlNode {
    /// Its place, bytes.
    pub span: Range<usize>,
    /// What it is.
    pub value: YamlValue,
}

/// What a value is.
#[derive(Debug, Clone, PartialEq)]
pub enum YamlValue {
    /// Text as written, without quotes.
    Scalar(String),
    /// Keys in the order of the file, each once.
    Map(Vec<YamlEntry>),
    /// Values in their order.
    Sequence(Vec<YamlNode>),
}

/// A key with its value.
#[derive(Debug, Clone, PartialEq)]
pub struct YamlEntry {
    /// The key.
    pub key: String,
    /// Its place, bytes.
    pub key_span: Range<usize>,
    /// The value.
    pub node: YamlNode,
}

impl YamlNode {
    /// Value of a key, if this is a map that has it.
    pub fn get(&self, key: &str) -> Option<&Self> {
        let YamlValue::Map(entries) = &self.value else {
            return None;
        };
        let found = entries.iter().find(|entry| entry.key == key)?;
        Some(&found.node)
    }
}

/// Parses a file that holds one document.
///
/// # Errors
/// What is not YAML, or not supported: aliases, tags, keys that are no words, keys twice, a second document.
pub fn parse_yaml(file: &str, text: &str) -> Result<YamlNode, Finding> {
    let mut all = parse_yaml_documents(file, text)?.into_iter();
    let empty = || Finding::new(file, "the file is empty");
    let first = all.next().ok_or_else(empty)?;
    match all.next() {
        None => Ok(first),
        Some(second) => {
            Err(Finding::new(file, "a second YAML document begins here").at(text, second.span))
        }
    }
}

/// Parses a file of any number of documents; those without content are left out.
///
/// # Errors
/// As [`parse_yaml`].
pub fn parse_yaml_documents(file: &str, text: &str) -> Result<Vec<YamlNode>, Finding> {
    let mut reader = Reader {
        file,
        text,
        events: Parser::new_from_str(text),
    };
    let mut documents = Vec::new();
    loop {
        match reader.next()? {
            None | Some((Event::StreamEnd, _)) => return Ok(documents),
            Some((Event::StreamStart | Event::DocumentStart(..) | Event::DocumentEnd, _)) => {}
            Some((event, span)) => {
                let root = reader.node(event, &span, 0)?;
                if !matches!(&root.value, YamlValue::Scalar(text) if root.span.is_empty() && text.is_empty() || text == "~")
                {
                    documents.push(root);
                }
            }
        }
    }
}

struct Reader<'a> {
    file: &'a str,
    text: &'a str,
    events: Parser<'a, granit_parser::StrInput<'a>>,
}

impl<'a> Reader<'a> {
    fn next(&mut self) -> Result<Option<(Event<'a>, Span)>, Finding> {
        self.events.next().transpose().map_err(|error| {
            let at = error.marker().byte_offset().unwrap_or(0);
            let at = at.min(self.text.len());
            let message = format!("not YAML: {}", error.info());
            let finding = Finding::new(self.file, message).at(self.text, at..at);
            if self.text.contains('\t') {
                finding.hint("YAML is indented with spaces, never with tabs")
            } else {
                finding
            }
        })
    }

    fn finding(&self, span: &Span, message: impl Into<String>) -> Finding {
        let range = span.byte_range().unwrap_or(0..0);
        Finding::new(self.file, message).at(self.text, range)
    }

    /// The value that starts with `event`.
    fn node(&mut self, event: Event<'a>, span: &Span, depth: usize) -> Result<YamlNode, Finding> {
        if depth > DEEPEST {
            return Err(self.finding(span, format!("nested deeper than {DEEPEST} levels")));
        }
        let mut range = span.byte_range().unwrap_or(0..0);
        let value = match event {
            Event::Scalar(text, _, _, tag) => {
                self.refuse_tag(tag.as_ref(), span)?;
                YamlValue::Scalar(text.into_owned())
            }
            Event::MappingStart(_, _, tag) => {
                self.refuse_tag(tag.as_ref(), span)?;
                let entries = self.entries(depth)?;
                if let Some(last) = entries.last() {
                    range.end = last.node.span.end.max(range.end);
                }
                YamlValue::Map(entries)
            }
            Event::SequenceStart(_, _, tag) => {
                self.refuse_tag(tag.as_ref(), span)?;
                let mut items = Vec::new();
                while let Some((event, span)) = self.next()? {
                    if event == Event::SequenceEnd {
                        break;
                    }
                    items.push(self.node(event, &span, depth + 1)?);
                }
                YamlValue::Sequence(items)
            }
            _ => {
                return Err(self
                    .finding(span, "an alias is not supported here")
                    .hint("write the value itself instead of `*name`"));
            }
        };
        Ok(YamlNode { span: range, value })
    }

    /// Keys and values up to the end of a mapping.
    fn entries(&mut self, depth: usize) -> Result<Vec<YamlEntry>, Finding> {
        let mut entries: Vec<YamlEntry> = Vec::new();
        while let Some((event, key_span)) = self.next()? {
            let key = match event {
                Event::MappingEnd => break,
                Event::Scalar(text, ..) => text.into_owned(),
                _ => return Err(self.finding(&key_span, "a key must be a plain word")),
            };
            if entries.iter().any(|entry| entry.key == key) {
                let message = format!("duplicate key `{key}`");
                return Err(self.finding(&key_span, message).key(key));
            }
            let Some((event, span)) = self.next()? else {
                break;
            };
            let node = self.node(event, &span, depth + 1)?;
            entries.push(YamlEntry {
                key,
                key_span: key_span.byte_range().unwrap_or(0..0),
                node,
            });
        }
        Ok(entries)
    }

    /// A tag such as xacro's `!degrees` changes what a value means.
    fn refuse_tag(&self, tag: Option<&Cow<'a, Tag>>, span: &Span) -> Result<(), Finding> {
        match tag {
            Some(tag) if tag.core_suffix().is_none() => Err(self
                .finding(span, format!("the tag `{tag}` is not supported"))
                .hint("write plain numbers: metres and radians")),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalar(node: &YamlNode) -> &str {
        match &node.value {
            YamlValue::Scalar(text) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn keys_and_values_know_their_place() {
        let text = "# é\na:\n  b: 'x y'\n  c: -1e-05\n";
        let root = parse_yaml("f.yaml", text).unwrap();
        let YamlValue::Map(top) = &root.value else {
            panic!("{root:?}")
        };
        let YamlValue::Map(inner) = &top[0].node.value else {
            panic!("{top:?}")
        };
        assert_eq!(&text[top[0].key_span.clone()], "a");
        assert_eq!(scalar(&inner[0].node), "x y");
        assert_eq!(&text[inner[0].node.span.clone()], "'x y'");
        assert_eq!(&text[inner[1].node.span.clone()], "-1e-05");
    }

    #[test]
    fn what_is_not_one_plain_document_is_refused_with_its_line() {
        for (text, line, message) in [
            ("a: 1\nb: 2\na: 3\n", Some(3), "duplicate key `a`"),
            (
                "a: &x 1\nb: *x\n",
                Some(2),
                "an alias is not supported here",
            ),
            ("a: 1\nb: !degrees 90\n", Some(2), "the tag `!degrees`"),
            ("a: 1\n---\nb: 2\n", Some(3), "a second YAML document"),
            ("b: 1\na: [1, 2\n", Some(2), "unclosed"),
            ("a:\n\tb: 1\n", Some(2), "not YAML"),
            ("# only a comment\n", None, "the file is empty"),
            ("", None, "the file is empty"),
        ] {
            let finding = parse_yaml("f.yaml", text).unwrap_err();
            assert_eq!(finding.line, line, "{text:?}: {finding}");
            assert!(finding.message.contains(message), "{text:?}: {finding}");
        }
    }

    #[test]
    fn deep_nesting_is_refused_instead_of_exhausting_the_stack() {
        let text = "[".repeat(100_000);
        assert!(parse_yaml("f.yaml", &text).is_err());
        let text = (0..1000).fold(String::new(), |text, depth| {
            text + &" ".repeat(depth) + "a:\n"
        });
        assert!(parse_yaml("f.yaml", &text).is_err());
    }
}
