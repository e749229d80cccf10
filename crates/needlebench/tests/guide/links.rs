//! Links between the documents of the project.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use crate::book::{chapters, markdown_files, workspace};

/// Relative links and pictures of a document.
fn targets(text: &str) -> Vec<String> {
    Parser::new_ext(text, Options::all())
        .filter_map(|event| match event {
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                Some(dest_url.to_string())
            }
            _ => None,
        })
        .filter(|target| !target.contains("://") && !target.starts_with("mailto:"))
        .collect()
}

/// Anchors of headings, as mdBook and GitHub make them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    let mut heading: Option<String> = None;
    for event in Parser::new_ext(text, Options::all()) {
        match event {
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::End(TagEnd::Heading(_)) => {
                let words = heading.take().unwrap_or_default().to_lowercase();
                let kept = words.chars().filter_map(|c| match c {
                    ' ' => Some('-'),
                    c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
                    _ => None,
                });
                anchors.insert(kept.collect());
            }
            Event::Text(text) | Event::Code(text) => {
                if let Some(words) = &mut heading {
                    words.push_str(&text);
                }
            }
            _ => {}
        }
    }
    anchors
}

fn check(file: &Path, wrong: &mut Vec<String>) {
    let text = fs::read_to_string(file).unwrap();
    for target in targets(&text) {
        let (path, anchor) = target.split_once('#').unwrap_or((&target, ""));
        let found = if path.is_empty() {
            file.to_owned()
        } else {
            file.parent().unwrap().join(path)
        };
        let leads = found.exists()
            && (anchor.is_empty()
                || anchors(&fs::read_to_string(&found).unwrap()).contains(anchor));
        if !leads {
            wrong.push(format!("{}: {target}", file.display()));
        }
    }
}

#[test]
fn links_lead_somewhere() {
    let top = workspace();
    let mut files: Vec<PathBuf> = markdown_files(&top);
    files.extend(chapters());
    files.push(top.join("guide/src/SUMMARY.md"));
    for folder in ["models", "tests", "guide"] {
        files.extend(below(&top.join(folder)));
    }
    let mut wrong = Vec::new();
    for file in &files {
        check(file, &mut wrong);
    }
    wrong.sort();
    wrong.dedup();
    assert!(
        wrong.is_empty(),
        "links that lead nowhere:\n{}",
        wrong.join("\n")
    );
}

/// Markdown files in a folder and the folders in it.
fn below(folder: &Path) -> Vec<PathBuf> {
    let mut files = markdown_files(folder);
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("node_modules") {
            files.extend(below(&path));
        }
    }
    files
}

#[test]
fn every_chapter_is_in_the_summary() {
    let summary = workspace().join("guide/src/SUMMARY.md");
    let text = fs::read_to_string(&summary).unwrap();
    let listed: BTreeSet<PathBuf> = targets(&text)
        .iter()
        .map(|target| summary.parent().unwrap().join(target))
        .collect();
    let there: BTreeSet<PathBuf> = chapters().into_iter().collect();
    assert_eq!(listed, there);
}

#[test]
fn every_picture_is_shown() {
    let top = workspace();
    let mut shown = BTreeSet::new();
    for file in chapters().into_iter().chain([top.join("README.md")]) {
        let text = fs::read_to_string(&file).unwrap();
        let names = targets(&text);
        shown.extend(
            names
                .iter()
                .filter_map(|name| Some(Path::new(name).file_name()?.to_owned())),
        );
    }
    for entry in fs::read_dir(top.join("guide/src/images")).unwrap() {
        let name = entry.unwrap().file_name();
        assert!(shown.contains(&name), "nobody shows {}", name.display());
    }
}
