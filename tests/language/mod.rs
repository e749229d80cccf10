//! Texts for users keep to the glossary of the guide.

mod texts;

use std::fs;
use std::path::{Path, PathBuf};

use texts::{Text, in_code, in_data, in_markdown, in_python};

/// Trimmed from the first and the last word of a phrase; `_`, `-` and backticks are part of words.
const PUNCTUATION: [char; 11] = ['.', ',', ';', ':', '!', '?', '(', ')', '"', '\'', '*'];

/// A phrase that texts must not have, and the term to write.
struct Rule {
    phrase: Vec<String>,
    term: String,
}

/// Rules of the first table of the glossary: terms, and phrases in backticks.
fn rules(glossary: &str) -> Vec<Rule> {
    let (_, table) = glossary.split_once("\n## Terms\n").unwrap();
    let (table, _) = table.split_once("\n## ").unwrap();
    let mut rules = Vec::new();
    for line in table.lines().filter(|line| line.starts_with('|')) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 5, "a cell too many or too few: {line}");
        for phrase in cells[3].split('`').skip(1).step_by(2) {
            rules.push(Rule {
                phrase: phrase.split_whitespace().map(str::to_owned).collect(),
                term: cells[1].to_owned(),
            });
        }
    }
    rules
}

/// Words with their lines; what stands in backticks is one word.
fn words(text: &Text) -> Vec<(usize, String)> {
    let mut words = Vec::new();
    let mut line = text.line;
    for (index, part) in text.text.split('`').enumerate() {
        if index % 2 == 1 {
            words.push((line, "`".to_owned()));
        } else {
            for (row, each) in part.split('\n').enumerate() {
                let found = each.split_whitespace();
                words.extend(found.map(|word| (line + row, word.to_lowercase())));
            }
        }
        line += part.matches('\n').count();
    }
    words
}

fn is_at(phrase: &[String], words: &[(usize, String)]) -> bool {
    let last = phrase.len() - 1;
    phrase.iter().enumerate().all(|(index, expected)| {
        let mut word = words[index].1.as_str();
        if index == 0 {
            word = word.trim_start_matches(PUNCTUATION);
        }
        if index == last {
            word = word.trim_end_matches(PUNCTUATION);
        }
        word == expected
    })
}

/// `file:line: phrase; write term` for each phrase in the texts of a file.
fn findings(file: &str, texts: &[Text], rules: &[Rule]) -> Vec<String> {
    let mut found = Vec::new();
    for words in texts.iter().map(words) {
        for Rule { phrase, term } in rules {
            for window in words.windows(phrase.len()) {
                if is_at(phrase, window) {
                    let (line, phrase) = (window[0].0, phrase.join(" "));
                    found.push(format!("{file}:{line}: `{phrase}`; write: {term}"));
                }
            }
        }
    }
    found
}

/// Texts that users read in a file of the workspace; none of a file that has none.
fn texts_of(file: &str, content: &str) -> Vec<Text> {
    let name = file.rsplit('/').next().unwrap_or_default();
    let Some((stem, extension)) = name.rsplit_once('.') else {
        return Vec::new();
    };
    let is_source = file.contains("/src/") && file.starts_with("crates/");
    let is_test = stem.ends_with("tests") || file.contains("/tests/");
    match extension {
        // The changes name what was renamed.
        "md" if !["glossary", "CHANGELOG"].contains(&stem) => {
            vec![in_markdown(content)]
        }
        "yml" | "yaml" => in_data(content, "description:"),
        "rs" if is_source && !is_test => in_code(content, &['"']),
        "js" if is_source && !stem.ends_with(".bundle") => in_code(content, &['"', '\'', '`']),
        "json" if stem.ends_with(".schema") => in_data(content, "\"description\":"),
        "toml" if file.starts_with("scenarios/") => in_data(content, "description ="),
        "py" if file.starts_with("python/needlebench/") => in_python(content),
        _ => Vec::new(),
    }
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).unwrap();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        if path.is_symlink() {
            continue;
        }
        if path.is_dir() {
            files(&path, found);
        } else {
            found.push(path);
        }
    }
}

#[test]
fn texts_have_no_phrase_that_the_glossary_replaces() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let rules = rules(&fs::read_to_string(top.join("guide/src/glossary.md")).unwrap());
    assert!(rules.len() > 100, "{} phrases", rules.len());
    let tops = ["README", "ARCHITECTURE", "CONTRIBUTING", "SECURITY"];
    let mut paths: Vec<PathBuf> = tops.map(|name| top.join(name).with_extension("md")).into();
    for folder in [
        ".github",
        "crates",
        "guide",
        "models",
        "python/needlebench",
        "scenarios",
    ] {
        files(&top.join(folder), &mut paths);
    }
    let mut found = Vec::new();
    let mut seen = 0;
    for path in paths {
        let file = path.strip_prefix(&top).unwrap().to_str().unwrap();
        // Pictures and meshes are no text.
        let content = fs::read_to_string(&path).unwrap_or_default();
        let texts = texts_of(file, &content);
        seen += usize::from(!texts.is_empty());
        found.extend(findings(file, &texts, &rules));
    }
    assert!(seen > 300, "{seen} files with texts");
    assert!(
        found.is_empty(),
        "{} phrases that guide/src/glossary.md replaces:\n{}",
        found.len(),
        found.join("\n")
    );
}

#[test]
fn a_planted_phrase_is_found_where_users_read_it() {
    let glossary = "\n## Terms\n\n| T | M | I |\n|---|---|---|\n| feasible | m | `can work`, `referee` |\n\n## Next\n";
    let rules = rules(glossary);
    let lines = |file: &str, content: &str| -> Vec<String> {
        findings(file, &texts_of(file, content), &rules)
    };
    let found = ["crates/a/src/b.rs:2: `can work`; write: feasible"];
    // In a literal that is broken, in documentation, behind a quote that is a character.
    for content in [
        "\nlet a = \"8 can \\\n  work:\";",
        "\n/// That can\n/// work.\nfn a() {}",
        "fn a() { b('\"') }\nlet a = r#\"\"can work\"\"#;",
    ] {
        assert_eq!(lines("crates/a/src/b.rs", content), found, "{content}");
    }
    assert_eq!(lines("crates/a/src/b.js", "f(`Can work ${b}`);").len(), 1);
    assert_eq!(lines("guide/src/a.md", "The *referee*.\n").len(), 1);
    assert_eq!(
        lines("crates/a/README.md", "```text\na: can work\n```\n").len(),
        1
    );
    assert_eq!(
        lines("guide/src/a.md", "```text\nreferee, b: c\n```\n").len(),
        0
    );
    assert_eq!(
        lines(
            ".github/actions/a/action.yml",
            "a:\n  description: can work\n"
        )
        .len(),
        1
    );
    assert_eq!(lines("scenarios/a.toml", "b = 1 # can work\n").len(), 1);
    assert_eq!(
        lines("python/needlebench/a.py", "\"\"\"Can work.\"\"\"\n").len(),
        1
    );
    // Names, code and comments on the code are nobody's text.
    for content in [
        "// can work\nfn can_work() {}",
        "/// `can work`, can_work, can-work, --referee, workable.\nfn a() {}",
        "let a = b[\"referee\"];",
        "/// ```\n/// can work\n/// ```\nfn a() {}",
    ] {
        assert_eq!(lines("crates/a/src/b.rs", content), [""; 0], "{content}");
    }
}
