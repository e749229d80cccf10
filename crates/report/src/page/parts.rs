//! Pages that need no script: documents that a terminal shows too, with figures and explanations between.

use std::fmt::Write;

use quick_xml::escape::escape;

use needlebench_show::chart::Chart;
use needlebench_show::{Block, has_words, heading};

use super::document::{Document, png_address};
use super::shared;

const STYLE: &str = "main > * { max-width: 1300px; }
main p { max-width: 80ch; }
h2 { margin: 26px 0 6px; padding-top: 8px; border-top: 1px solid var(--line); }
nav a { margin-right: 14px; color: var(--focus); }
figure { display: inline-block; vertical-align: top; margin: 10px 4px 6px 0; }
figure svg, figure img { display: block; width: 100%; height: auto; font: 12px system-ui, sans-serif; }
figcaption { color: var(--soft); }
main .scroll { margin: 8px 0; }
th, td { white-space: pre-line; }
.number, thead th { white-space: pre; }
td.formula { font-family: \"STIX Two Math\", \"Cambria Math\", Cambria, Georgia, serif; max-width: 26em; }
.formula sub, .formula sup { font-size: 0.75em; line-height: 0; }
@media print { figure, tr { break-inside: avoid; } h2 { break-after: avoid; } }
";

/// One part of a page.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// What a terminal shows too.
    Block(Block),
    /// What pages alone have room for.
    Aside(Block),
    /// A chart and its caption.
    Chart(Chart, String),
    /// A picture as PNG, and its caption.
    Picture(Vec<u8>, String),
}

impl Part {
    /// What a terminal shows of it.
    pub fn block(&self) -> Option<&Block> {
        match self {
            Self::Block(block) => Some(block),
            Self::Aside(_) | Self::Chart(..) | Self::Picture(..) => None,
        }
    }
}

/// The page: its headings are what one can go to.
pub fn parts_page(title: &str, parts: &[Part]) -> String {
    let mut body = String::new();
    // Writing to a text cannot fail.
    let _ = write_body(&mut body, title, parts);
    Document {
        title,
        style: &format!("{}{STYLE}", shared::STYLE),
        body: &body,
        scripts: &[],
    }
    .html()
}

fn write_body(out: &mut String, title: &str, parts: &[Part]) -> std::fmt::Result {
    writeln!(out, "<main><h1>{}</h1><nav>", escape(title))?;
    for part in parts {
        if let Part::Block(Block::Heading(name)) | Part::Aside(Block::Heading(name)) = part {
            writeln!(out, "<a href=\"#{}\">{}</a>", anchor(name), escape(name))?;
        }
    }
    out.push_str("</nav>\n");
    for part in parts {
        match part {
            Part::Block(block) | Part::Aside(block) => write_block(out, block)?,
            Part::Chart(chart, caption) => {
                figure(out, chart.size[0], &chart.to_inline_svg(), caption)?;
            }
            Part::Picture(png, caption) => {
                let address = png_address(png);
                let picture = format!("<img alt=\"{}\" src=\"{address}\">", escape(caption));
                figure(out, 300.0, &picture, caption)?;
            }
        }
    }
    out.push_str("</main>");
    Ok(())
}

/// What an address calls a heading.
fn anchor(heading: &str) -> String {
    let letters = heading.chars().filter(|letter| letter.is_alphanumeric());
    letters.flat_map(char::to_lowercase).collect()
}

fn figure(out: &mut String, width_px: f64, markup: &str, caption: &str) -> std::fmt::Result {
    writeln!(
        out,
        "<figure style=\"width:min(100%,{width_px}px)\">{markup}<figcaption>{}</figcaption></figure>",
        escape(caption)
    )
}

fn write_block(out: &mut String, block: &Block) -> std::fmt::Result {
    match block {
        Block::Answer(sentence) => writeln!(out, "<p><b>{}</b></p>", escape(sentence)),
        Block::Heading(name) => {
            writeln!(out, "<h2 id=\"{}\">{}</h2>", anchor(name), escape(name))
        }
        Block::Lines(lines) => lines
            .iter()
            .try_for_each(|line| writeln!(out, "<p>{}</p>", escape(line))),
        Block::Table { header, rows } => write_table(out, header, rows),
    }
}

fn write_table(out: &mut String, header: &[String], rows: &[Vec<String>]) -> std::fmt::Result {
    out.push_str("<div class=\"scroll\" tabindex=\"0\"><table><thead><tr>");
    let class = |at: usize| match header.get(at) {
        Some(name) if name.starts_with('$') => "formula",
        Some(name) if !has_words(at, name) => "number",
        _ => "words",
    };
    for (at, name) in header.iter().enumerate() {
        let name = escape(heading(name));
        write!(out, "<th scope=\"col\" class=\"{}\">{name}</th>", class(at))?;
    }
    out.push_str("</tr></thead><tbody>\n");
    for row in rows {
        out.push_str("<tr>");
        for (at, cell) in row.iter().enumerate() {
            match (at, class(at)) {
                (0, _) => write!(out, "<th scope=\"row\">{}</th>", escape(cell))?,
                (_, "formula") => write!(out, "<td class=\"formula\">{}</td>", formula(cell))?,
                (_, class) => write!(out, "<td class=\"{class}\">{}</td>", escape(cell))?,
            }
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
    Ok(())
}

/// Markup of a text with formulas.
fn formula(text: &str) -> String {
    let mut html = String::new();
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        let tag = match character {
            '_' => "sub",
            '^' => "sup",
            other => {
                html.push_str(&escape(other.to_string()));
                continue;
            }
        };
        let mut inside = String::new();
        if characters.next_if_eq(&'{').is_some() {
            inside.extend(characters.by_ref().take_while(|each| *each != '}'));
        } else {
            inside.extend(characters.next());
        }
        html.extend(["<", tag, ">", &escape(&inside), "</", tag, ">"]);
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_have_sub_and_superscripts_and_no_markup_of_their_own() {
        assert_eq!(
            formula("q_{234} < C_3^2"),
            "q<sub>234</sub> &lt; C<sub>3</sub><sup>2</sup>"
        );
    }

    #[test]
    fn texts_cannot_become_markup() {
        let attack = "<img src=x>_\"{";
        let text = || attack.to_owned();
        let parts = [
            Part::Block(Block::Heading(text())),
            Part::Aside(Block::Lines(vec![text()])),
            Part::Block(Block::table(["<<b>", "$<b>"], vec![vec![text(), text()]])),
            Part::Chart(Chart::new([20.0, 10.0], attack), text()),
            Part::Picture(vec![], text()),
        ];
        let page = parts_page(attack, &parts);
        assert_eq!(page.matches("<img").count(), 1);
        assert!(!page.contains("<b>"));
    }
}
