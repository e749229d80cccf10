//! Keys set in the text of a scenario, which stays as it was otherwise: comments, order and spaces.

use std::fmt::Write as _;
use std::path::Path;

use crate::resolve::name_from_file;
use needlebench_input::{Finding, TomlText};

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
        self.take_away(&format!("{section}.{key}"), section, key)
    }

    /// Takes a section away with all its keys and the sections in it, such as `goals[1]`, if it is there; those after it
    /// in a list count one less then.
    ///
    /// # Errors
    /// As [`ScenarioEdit::set`].
    pub fn remove_section(&mut self, section: &str) -> Result<(), Finding> {
        self.take_away(section, section, "")
    }

    /// Takes away what stands at `path`: a section from its header on, or the line of `key`. Refused where it shares its
    /// line with others.
    fn take_away(&mut self, path: &str, section: &str, key: &str) -> Result<(), Finding> {
        let toml = TomlText::parse(&self.file, &self.text)?;
        let Some(span) = toml.span_of(path) else {
            return Ok(());
        };
        let start = self.text[..span.start].rfind('\n').map_or(0, |at| at + 1);
        let rest = &self.text[span.end..];
        let mut end = span.end + rest.find('\n').map_or(rest.len(), |at| at + 1);
        let header = self.text[span.clone()].trim_matches(['[', ']']).to_owned();
        let before = self.text[start..span.start].trim();
        let is_header = before.is_empty() && self.text[span].starts_with('[');
        let is_own_line = before
            .strip_suffix('=')
            .is_some_and(|name| !key.is_empty() && name.trim_end() == key);
        if is_header {
            end += self.text[end..].len() - after_section(&self.text[end..], &header).len();
        } else if !is_own_line {
            return Err(self.unchangeable(section));
        }
        self.text.replace_range(start..end, "");
        self.checked(section)
    }

    /// What was changed has to be TOML still.
    fn checked(&self, section: &str) -> Result<(), Finding> {
        match TomlText::parse(&self.file, &self.text) {
            Ok(_) => Ok(()),
            Err(_) => Err(self.unchangeable(section)),
        }
    }

    fn unchangeable(&self, section: &str) -> Finding {
        Finding::new(
            &self.file,
            format!("`{section}` is written so that it cannot be changed here"),
        )
        .key(section)
        .hint(format!("write it as [{section}], with a line for each key"))
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
        // With others on its line.
        let text = "goals = [{ lesion = \"x\", route = { sigmas = 3 } }]\n";
        let mut shared = ScenarioEdit::new("s.toml", text).unwrap();
        assert!(shared.remove("goals[0]", "route").is_err());
        assert_eq!(shared.text(), text);
    }

    #[test]
    fn one_of_several_goals_goes_and_the_others_stay() {
        let text = "[[goals]]\nlesion = \"x\"\n\n# The middle one.\n[[goals]]\nlesion = \"y\"\n[goals.route]\nsigmas = 3\n\n# The last \
                    one.\n[[goals]]\nlesion = \"z\"\n\n[criteria]\n";
        let mut edit = ScenarioEdit::new("s.toml", text).unwrap();
        edit.remove_section("goals[1]").unwrap();
        let wanted = "[[goals]]\nlesion = \"x\"\n\n# The middle one.\n\n# The last one.\n[[goals]]\nlesion = \
                      \"z\"\n\n[criteria]\n";
        assert_eq!(edit.text(), wanted);
        edit.remove_section("goals[7]").unwrap();
        assert_eq!(edit.text(), wanted);
        let mut inline = ScenarioEdit::new(
            "s.toml",
            "goals = [{ lesion = \"x\" }, { lesion = \"y\" }]\n",
        )
        .unwrap();
        assert!(
            inline.remove_section("goals[1]").is_err(),
            "{}",
            inline.text()
        );
    }

    #[test]
    fn sections_in_another_form_are_refused() {
        let mut edit = ScenarioEdit::new("s.toml", "robot = { urdf = \"ur3\" }\n").unwrap();
        let finding = edit.set("robot", "base_rpy_deg", "[0, 0, 0]").unwrap_err();
        assert!(finding.to_string().contains("[robot]"), "{finding}");
    }
}
