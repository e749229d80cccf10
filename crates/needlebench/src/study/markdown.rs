//! A study's statistics as Markdown, for pull requests.

use std::fmt::Write;

use needlebench_study::statistics::CriterionResult;

use super::tables::Part;

/// Text that breaks no table.
fn escaped(text: &str) -> String {
    text.trim_start_matches('<')
        .trim()
        .replace('\n', " ")
        .replace('|', "\\|")
}

/// The summary as Markdown.
pub(crate) fn summary_markdown(
    title: &str,
    criteria: &[CriterionResult],
    parts: &[Part],
) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_markdown(&mut text, title, criteria, parts);
    text
}

fn write_markdown(
    out: &mut String,
    title: &str,
    criteria: &[CriterionResult],
    parts: &[Part],
) -> std::fmt::Result {
    let failed = criteria.iter().filter(|each| !each.pass).count();
    let verdict = match (criteria.len(), failed) {
        (0, _) => String::new(),
        (_, 0) => ": pass".to_owned(),
        _ => ": **fail**".to_owned(),
    };
    writeln!(out, "# {title}{verdict}\n")?;
    for part in parts {
        match part {
            Part::Heading(heading) => writeln!(out, "## {heading}\n")?,
            Part::Lines(lines) => {
                for line in lines {
                    writeln!(out, "- {}", line.trim())?;
                }
                writeln!(out)?;
            }
            Part::Table { header, rows } => {
                let names: Vec<String> = header.iter().map(|name| escaped(name)).collect();
                writeln!(out, "| {} |", names.join(" | "))?;
                out.push('|');
                for (at, name) in header.iter().enumerate() {
                    let text = at == 0 || name.starts_with('<');
                    out.push_str(if text { "---|" } else { "--:|" });
                }
                writeln!(out)?;
                for row in rows {
                    let cells: Vec<String> = row.iter().map(|cell| escaped(cell)).collect();
                    writeln!(out, "| {} |", cells.join(" | "))?;
                }
                writeln!(out)?;
            }
        }
    }
    Ok(())
}
