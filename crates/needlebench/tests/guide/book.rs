//! The chapters, and the blocks of code in them.

use std::fs;
use std::path::{Path, PathBuf};

use pulldown_cmark::{CodeBlockKind, Event, Parser, Tag, TagEnd};

/// Top folder of the workspace.
pub fn workspace() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    here.canonicalize().unwrap()
}

/// Every chapter, those of the reference too.
pub fn chapters() -> Vec<PathBuf> {
    let source = workspace().join("guide/src");
    let mut chapters = markdown_files(&source);
    chapters.extend(markdown_files(&source.join("reference")));
    chapters.retain(|path| !path.ends_with("SUMMARY.md"));
    assert!(chapters.len() > 20, "{} chapters", chapters.len());
    chapters
}

pub fn markdown_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|found| found == "md"));
    files.sort();
    files
}

/// A block of code, with the language that it says it is in.
#[derive(Debug)]
pub struct Block {
    pub language: String,
    pub text: String,
}

pub fn blocks(path: &Path) -> Vec<Block> {
    let text = fs::read_to_string(path).unwrap();
    let mut blocks: Vec<Block> = Vec::new();
    let mut inside = false;
    for event in Parser::new(&text) {
        match event {
            Event::Start(Tag::CodeBlock(kind)) => {
                inside = true;
                let language = match kind {
                    CodeBlockKind::Fenced(language) => language.to_string(),
                    CodeBlockKind::Indented => String::new(),
                };
                let text = String::new();
                blocks.push(Block { language, text });
            }
            Event::End(TagEnd::CodeBlock) => inside = false,
            Event::Text(more) if inside => blocks.last_mut().unwrap().text.push_str(&more),
            _ => {}
        }
    }
    blocks
}
