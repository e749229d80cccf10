//! A study's statistics as Markdown, for pull requests.

use std::fmt::Write;

use needlebench_evaluation::report::Verdict;
use needlebench_show::markdown::inline;
use needlebench_show::{Block, has_words, heading};

use crate::table::study::document::Document;

/// Text that breaks no table.
fn cell_text(text: &str) -> String {
    inline(text)
}

/// Headings in one line each: one that only has a second line shares the first of those before it.
fn headings(header: &[String]) -> Vec<String> {
    let mut first = "";
    let mut names = Vec::new();
    for name in header {
        let name = heading(name);
        if let Some(second) = name.strip_prefix('\n') {
            names.push(cell_text(&format!("{first} {second}")));
        } else {
            first = name.split('\n').next().unwrap_or_default();
            names.push(cell_text(name));
        }
    }
    names
}

/// The summary as Markdown: what answers the study, then all else folded in; without a verdict where there is
/// nothing to judge.
pub(crate) fn summary_markdown(
    title: &str,
    verdict: Option<Verdict>,
    document: &Document,
) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_markdown(&mut text, title, verdict, document);
    text
}

fn write_markdown(
    out: &mut String,
    title: &str,
    verdict: Option<Verdict>,
    document: &Document,
) -> std::fmt::Result {
    let verdict = verdict.map_or(String::new(), |verdict| match verdict {
        Verdict::Pass => ": pass".to_owned(),
        other => format!(": **{}**", other.name()),
    });
    writeln!(out, "# {}{verdict}\n", inline(title))?;
    write_blocks(out, &document.first)?;
    if !document.more.is_empty() {
        writeln!(out, "<details><summary>All tables</summary>\n")?;
        write_blocks(out, &document.more)?;
        writeln!(out, "</details>")?;
    }
    Ok(())
}

pub(super) fn write_blocks(out: &mut String, blocks: &[Block]) -> std::fmt::Result {
    for part in blocks {
        match part {
            Block::Answer(sentence) => writeln!(out, "**{}**\n", inline(sentence))?,
            Block::Heading(heading) => writeln!(out, "## {}\n", inline(heading))?,
            Block::Lines(lines) => {
                for line in lines {
                    writeln!(out, "- {}", inline(line))?;
                }
                writeln!(out)?;
            }
            Block::Table { header, rows } => {
                writeln!(out, "| {} |", headings(header).join(" | "))?;
                out.push('|');
                for (at, name) in header.iter().enumerate() {
                    let text = has_words(at, name);
                    out.push_str(if text { "---|" } else { "--:|" });
                }
                writeln!(out)?;
                for row in rows {
                    let cells: Vec<String> = row.iter().map(|cell| cell_text(cell)).collect();
                    writeln!(out, "| {} |", cells.join(" | "))?;
                }
                writeln!(out)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_are_whole_and_cells_keep_their_signs() {
        let header = ["tip\n(mm) 50 %", "\n95 %", "<why"].map(str::to_owned);
        assert_eq!(headings(&header), ["tip (mm) 50 %", "tip 95 %", "why"]);
        assert_eq!(cell_text("< 0.3 | x"), "< 0.3 \\| x");
    }
}
