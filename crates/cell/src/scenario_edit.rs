//! Keys set in the text of a scenario, which stays as it was otherwise: comments, order and spaces.

use std::fmt::Write as _;
use std::path::Path;

use crate::Finding;
use crate::resolve::name_from_file;
use crate::toml_text::TomlText;

/// The text of a scenario, to be changed key by key.
#[derive(Debug, Clone)]
pub struct ScenarioEdit {
    file: String,
    text: String,
}

impl ScenarioEdit {
    /// Of a text; `file` is its name in messages.
    ///
    /// # Errors
    /// A text that is no TOML.
    pub fn new(file: &str, text: &str) -> Result<Self, Finding> {
        TomlText::parse(file, text)?;
        Ok(Self {
            file: file.to_owned(),
            text: text.to_owned(),
        })
    }

    /// The text as it is now.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Names the scenario after the file that it goes to, if its text names it.
    ///
    /// # Errors
    /// A name that is written in an unusual form.
    pub fn name_after(&mut self, file: &Path) -> Result<(), Finding> {
        let toml = TomlText::parse(&self.file, &self.text)?;
        if let Some(span) = toml.span_of("name") {
            let name = format!("\"{}\"", name_from_file(file));
            self.text.replace_range(span, &name);
        }
        self.checked("name")
    }

    /// Sets a key of a section, such as `robot` and `base_rpy_deg`, or `goals[0]` and `lesion`, to a value as TOML
    /// writes it. A section that is not there is added at the end.
    ///
    /// # Errors
    /// A section that the text has in another form than `[section]`.
    pub fn set(&mut self, section: &str, key: &str, value: &str) -> Result<(), Finding> {
        let toml = TomlText::parse(&self.file, &self.text)?;
        if let Some(span) = toml.span_of(&format!("{section}.{key}")) {
            self.text.replace_range(span, value);
            return self.checked(section);
        }
        if let Some(header) = toml.span_of(section) {
            let rest = &self.text[header.end..];
            let is_header = self.text[header.clone()].starts_with('[');
            if !is_header {
                return Err(toml
                    .finding(section, format!("`{section}` is no section of its own"))
                    .hint(format!("write it as [{section}], with a line for each key")));
            }
            let end = header.end + rest.find('\n').unwrap_or(rest.len());
            let before = if self.text[..end].ends_with('\n') {
                ""
            } else {
                "\n"
            };
            self.text
                .insert_str(end, &format!("{before}{key} = {value}"));
        } else {
            let header = match section.split_once('[') {
                Some((list, _)) => format!("[[{list}]]"),
                None => format!("[{section}]"),
            };
            let ending = if self.text.is_empty() || self.text.ends_with('\n') {
                ""
            } else {
                "\n"
            };
            let _ = writeln!(self.text, "{ending}\n{header}\n{key} = {value}");
        }
        self.checked(section)
    }

    /// Takes a key away with its line, if it is there; a section with all its keys and the sections in it.
    ///
    /// # Errors
    /// As [`ScenarioEdit::set`].
    pub fn remove(&mut self, section: &str, key: &str) -> Result<(), Finding> {
        let toml = TomlText::parse(&self.file, &self.text)?;
        let Some(span) = toml.span_of(&format!("{section}.{key}")) else {
            return Ok(());
        };
        let start = self.text[..span.start].rfind('\n').map_or(0, |at| at + 1);
        let rest = &self.text[span.end..];
        let mut end = span.end + rest.find('\n').map_or(rest.len(), |at| at + 1);
        let header = self.text[span].trim_matches(['[', ']']).to_owned();
        if self.text[start..].trim_start().starts_with('[') {
            end += self.text[end..].len() - after_section(&self.text[end..], &header).len();
        }
        self.text.replace_range(start..end, "");
        self.checked(section)
    }

    /// What was changed has to be TOML still.
    fn checked(&self, section: &str) -> Result<(), Finding> {
        match TomlText::parse(&self.file, &self.text) {
            Ok(_) => Ok(()),
            Err(_) => Err(Finding::new(
                &self.file,
                format!("`{section}` is written so that it cannot be changed here"),
            )
            .key(section)
            .hint(format!("write it as [{section}], with a line for each key"))),
        }
    }
}

/// What follows a section and those in it: from the next header on, with the comments above that.
fn after_section<'t>(text: &'t str, header: &str) -> &'t str {
    let mut kept = text.len();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let start = line.trim_start();
        let own = start.trim_start_matches('[').strip_prefix(header);
        let is_within = own.is_some_and(|rest| rest.starts_with('.'));
        if start.starts_with('[') && !is_within {
            return &text[kept.min(at)..];
        }
        if start.is_empty() || start.starts_with('#') {
            kept = kept.min(at);
        } else {
            kept = text.len();
        }
        at += line.len();
    }
    ""
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"a\" # mine\n[robot] # the arm\nbase_rpy_deg = [0, 0, 90] # yaw\n\n[[goals]]\nlesion = \
                        \"x\"\nentry_mm = [1,\n  2, 3]\nstandoff_mm = 5\n";

    #[test]
    fn keys_are_set_where_they_stand_and_all_else_stays() {
        let mut edit = ScenarioEdit::new("s.toml", TEXT).unwrap();
        edit.set("robot", "base_rpy_deg", "[0, 0, 270]").unwrap();
        edit.set("robot", "base_position_mm", "[1, 2, 3]").unwrap();
        edit.remove("goals[0]", "entry_mm").unwrap();
        edit.set("goals[0]", "entry_direction_deg", "[4, 5]")
            .unwrap();
        edit.set("mount", "kind", "\"column\"").unwrap();
        edit.set("goals[1]", "lesion", "\"y\"").unwrap();
        let wanted = "name = \"a\" # mine\n[robot] # the arm\nbase_position_mm = [1, 2, 3]\nbase_rpy_deg = [0, 0, 270] \
                      # yaw\n\n[[goals]]\nentry_direction_deg = [4, 5]\nlesion = \"x\"\nstandoff_mm = 5\n\n[mount]\nkind = \
                      \"column\"\n\n[[goals]]\nlesion = \"y\"\n";
        assert_eq!(edit.text(), wanted);
    }

    #[test]
    fn a_section_goes_with_its_keys_and_the_sections_in_it() {
        let text = "[[goals]]\nlesion = \"x\"\n\n[goals.route] # planned\nsigmas = 3\n# why\nthrow_mm = 1\n\n\
                    [goals.route.odds]\ndeep = 2\n\n# The other.\n[[goals]]\nlesion = \"y\"\n";
        let mut edit = ScenarioEdit::new("s.toml", text).unwrap();
        edit.remove("goals[0]", "route").unwrap();
        let wanted = "[[goals]]\nlesion = \"x\"\n\n\n# The other.\n[[goals]]\nlesion = \"y\"\n";
        assert_eq!(edit.text(), wanted);
        let mut last =
            ScenarioEdit::new("s.toml", "[[goals]]\nlesion = \"x\"\n[goals.route]\n").unwrap();
        last.remove("goals[0]", "route").unwrap();
        assert_eq!(last.text(), "[[goals]]\nlesion = \"x\"\n");
        // As a value on its line.
        let mut inline = ScenarioEdit::new(
            "s.toml",
            "[[goals]]\nroute = { sigmas = 3 }\nlesion = \"x\"\n",
        )
        .unwrap();
        inline.remove("goals[0]", "route").unwrap();
        assert_eq!(inline.text(), "[[goals]]\nlesion = \"x\"\n");
    }

    #[test]
    fn sections_in_another_form_are_refused() {
        let mut edit = ScenarioEdit::new("s.toml", "robot = { urdf = \"ur3\" }\n").unwrap();
        let finding = edit.set("robot", "base_rpy_deg", "[0, 0, 0]").unwrap_err();
        assert!(finding.to_string().contains("[robot]"), "{finding}");
    }
}
