//! The accuracy table as LaTeX, with the package `booktabs`.

use needlebench_evaluation::accuracy::{AccuracyRow, AccuracyTable, QUANTITIES};
use needlebench_scenario::published::Anchor;

use super::{
    APART, BEFORE, before_in_words, caption, figure, footnotes, hits, is_tested, mean_and_sd,
    measured, own_figures, p_value, published, range,
};

/// Stands for the sign until all else is escaped.
const PLUS_MINUS: &str = "\u{b1}";

/// Three tables for `\input`: ours, and what has been published.
pub(crate) fn accuracy_latex(table: &AccuracyTable) -> String {
    let mut lines = vec![
        "% \\usepackage{booktabs}".to_owned(),
        "\\begin{table}".to_owned(),
        "\\scriptsize\\centering\\setlength{\\tabcolsep}{3pt}".to_owned(),
    ];
    lines.push(format!(
        "\\caption{{{}}}",
        escaped(&caption(table).join(" "))
    ));
    let columns: Vec<usize> = measured(table).collect();
    lines.push(format!(
        "\\begin{{tabular}}{{l{}}}",
        "r".repeat(columns.len() + 2)
    ));
    lines.push("\\toprule".to_owned());
    let mut header = vec![table.by.join(", "), "n".to_owned()];
    header.extend(columns.iter().map(|at| QUANTITIES[*at].heading.to_owned()));
    header.push("hits".to_owned());
    lines.push(row_of(&header));
    let mut units = vec![String::new(), String::new()];
    units.extend(
        columns
            .iter()
            .map(|at| format!("({})", QUANTITIES[*at].unit().symbol)),
    );
    units.push(String::new());
    lines.push(row_of(&units));
    lines.push("\\midrule".to_owned());
    let row_of_group = |row: &AccuracyRow| line_of(&cells(row, &columns));
    lines.extend(table.groups.iter().map(row_of_group));
    lines.push("\\midrule".to_owned());
    lines.push(row_of_group(&table.all));
    if is_tested(table) {
        let mut row = vec!["p".to_owned(), String::new()];
        row.extend(columns.iter().map(|at| p_value(&table.tests[*at])));
        row.push(String::new());
        lines.push(row_of(&row));
    }
    lines.extend(["\\bottomrule", "\\end{tabular}", "", "\\smallskip"].map(str::to_owned));
    lines.push(format!(
        "\\begin{{minipage}}{{\\linewidth}}\\scriptsize {}\\end{{minipage}}",
        escaped(&footnotes(table).join(" "))
    ));
    lines.extend(["\\end{table}".to_owned(), String::new()]);
    let (before, apart) = published();
    let own = own_figures(table, PLUS_MINUS);
    let own = own.into_iter().map(|(heading, text)| {
        let n = table.all.n.to_string();
        vec![table.name.clone(), text, heading, n, String::new()]
    });
    let rows: Vec<Vec<String>> = own
        .chain(before.iter().map(|each| of_anchor(each, None)))
        .collect();
    let note = before_in_words(table);
    published_table(&mut lines, &format!("{BEFORE}. {note}"), &rows);
    let rows: Vec<Vec<String>> = apart
        .iter()
        .map(|each| of_anchor(each, Some(each.stage.words())))
        .collect();
    published_table(&mut lines, &format!("{APART}."), &rows);
    lines.join("\n")
}

fn of_anchor(anchor: &Anchor, stage: Option<&str>) -> Vec<String> {
    let measured = match stage {
        Some(stage) => format!("{stage}: {}", anchor.measured),
        None => anchor.measured.clone(),
    };
    vec![
        anchor.label(),
        figure(anchor, PLUS_MINUS),
        format!("{measured} ({}; {})", anchor.system, anchor.subject),
        anchor.count(),
        anchor.doi.clone(),
    ]
}

fn published_table(lines: &mut Vec<String>, caption: &str, rows: &[Vec<String>]) {
    lines.extend(["\\begin{table}", "\\footnotesize\\centering"].map(str::to_owned));
    lines.push(format!("\\caption{{{}}}", escaped(caption)));
    lines.push(
        "\\begin{tabular}{p{0.16\\linewidth}p{0.16\\linewidth}p{0.3\\linewidth}p{0.12\\linewidth}p{0.16\\linewidth}}"
            .to_owned(),
    );
    lines.push("\\toprule".to_owned());
    let header = ["Source", "Error", "Measured", "n", "DOI"].map(str::to_owned);
    lines.push(row_of(&header));
    lines.push("\\midrule".to_owned());
    lines.extend(rows.iter().map(|row| row_of(row)));
    lines.extend(["\\bottomrule", "\\end{tabular}", "\\end{table}", ""].map(str::to_owned));
}

/// Cells of a row, escaped: the range stands under mean and deviation.
fn cells(row: &AccuracyRow, columns: &[usize]) -> Vec<String> {
    let mut cells = vec![escaped(&row.label), row.n.to_string()];
    cells.extend(columns.iter().map(|at| {
        let Some(spread) = &row.spreads[*at] else {
            return "-".to_owned();
        };
        let mut lines = vec![mean_and_sd(spread, PLUS_MINUS)];
        lines.extend(range(spread).map(|range| format!("({range})")));
        if spread.count < row.n {
            lines.push(format!("n = {}", spread.count));
        }
        let lines: Vec<String> = lines.iter().map(|line| escaped(line)).collect();
        match lines.as_slice() {
            [line] => line.clone(),
            lines => format!("\\shortstack[r]{{{}}}", lines.join("\\\\")),
        }
    }));
    cells.push(hits(row));
    cells
}

fn row_of(cells: &[String]) -> String {
    let cells: Vec<String> = cells.iter().map(|text| escaped(text)).collect();
    line_of(&cells)
}

/// A line of cells that are escaped.
fn line_of(cells: &[String]) -> String {
    // A row that begins with a bracket would be taken for an argument of the line before.
    format!("{{}}{} \\\\", cells.join(" & "))
}

/// A text in which nothing is a command, in characters that any LaTeX knows.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '\\' => out.push_str("\\textbackslash{}"),
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(character);
            }
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '<' => out.push_str("$<$"),
            '>' => out.push_str("$>$"),
            '|' => out.push_str("$|$"),
            '"' => out.push_str("{''}"),
            '`' => out.push('\''),
            '\u{b1}' => out.push_str("$\\pm$"),
            '\n' | '\r' | '\t' => out.push(' '),
            each if each.is_ascii() && !each.is_ascii_control() => out.push(each),
            // What needs fonts or packages is left out rather than break the document.
            each if each.is_alphanumeric() => out.push(each),
            _ => out.push('?'),
        }
    }
    out
}
