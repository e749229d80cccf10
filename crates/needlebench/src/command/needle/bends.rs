//! Recorded bends: a table with the columns `depth_mm` and `bend_mm`.

use std::ops::Range;

use needlebench_input::Finding;
use needlebench_insertion::Bend;

/// Rows at least.
const LEAST: usize = 5;

/// Most findings of a file that are reported.
const MOST_FINDINGS: usize = 20;

/// Depth and bend at most, mm.
const DEEPEST_MM: f64 = 1000.0;
const MOST_MM: f64 = 200.0;

const COLUMNS: [&str; 2] = ["depth_mm", "bend_mm"];

const HEADER_HINT: &str = "the first line that is not a comment is: depth_mm,bend_mm";

const DECIMAL_HINT: &str = "write decimal points, and commas between the columns: 12.5,0.31";

/// Reads a table.
pub(super) fn read_bends(file: &str, text: &str) -> Result<Vec<Bend>, Vec<Finding>> {
    let mut lines = lines(text);
    let Some(header) = lines.next() else {
        return Err(vec![
            Finding::new(file, "the table has no header").hint(HEADER_HINT),
        ]);
    };
    let names: Vec<&str> = text[header.clone()].split(',').map(str::trim).collect();
    if names != COLUMNS {
        let message = format!("the header is `{}`", &text[header.clone()]);
        return Err(vec![
            Finding::new(file, message)
                .at(text, header)
                .hint(HEADER_HINT),
        ]);
    }
    let (mut bends, mut findings) = (Vec::<Bend>::new(), Vec::new());
    for line in lines {
        match row(file, text, line, bends.last().map(|bend| bend.depth_m)) {
            Ok(bend) => bends.push(bend),
            Err(finding) => findings.push(finding),
        }
        if findings.len() >= MOST_FINDINGS {
            break;
        }
    }
    if findings.is_empty() && bends.len() < LEAST {
        let message = format!("{} rows: an interval needs at least {LEAST}", bends.len());
        findings.push(Finding::new(file, message).hint("record the bend at more depths"));
    }
    if findings.is_empty() {
        Ok(bends)
    } else {
        Err(findings)
    }
}

fn row(file: &str, text: &str, line: Range<usize>, before_m: Option<f64>) -> Result<Bend, Finding> {
    let cells: Vec<&str> = text[line.clone()].split(',').map(str::trim).collect();
    let [depth, bend] = cells[..] else {
        let message = format!("the line has {} values, the header 2 columns", cells.len());
        return Err(Finding::new(file, message)
            .at(text, line)
            .hint(DECIMAL_HINT));
    };
    let finding = |column: usize, cell: &str, message: String| {
        let start = cell.as_ptr() as usize - text.as_ptr() as usize;
        Finding::new(file, message)
            .key(COLUMNS[column])
            .at(text, start..start + cell.len())
    };
    let number = |column: usize, cell: &str, most_mm: f64| match cell.parse::<f64>() {
        Ok(value) if value.abs() <= most_mm => Ok(value),
        Ok(value) => {
            let message = format!("{value} mm is beyond {most_mm} mm");
            Err(finding(column, cell, message).hint("depths and bends are in mm"))
        }
        Err(_) => {
            let message = format!("`{cell}` is not a number");
            Err(finding(column, cell, message).hint(DECIMAL_HINT))
        }
    };
    let depth_mm = number(0, depth, DEEPEST_MM)?;
    let bend_mm = number(1, bend, MOST_MM)?;
    let (depth_m, bend_m) = (1e-3 * depth_mm, 1e-3 * bend_mm);
    if depth_m <= before_m.unwrap_or(0.0) {
        let after = match before_m {
            Some(before_m) => format!("after {} mm", super::setup::in_mm(before_m)),
            None => "at the first row".to_owned(),
        };
        let hint = "depths are of the tip behind the skin, above 0, and rise from row to row";
        let message = format!("a depth of {depth_mm} mm {after}");
        return Err(finding(0, depth, message).hint(hint));
    }
    Ok(Bend { depth_m, bend_m })
}

/// Lines that are neither empty nor comments, without line ends.
fn lines(text: &str) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    text.split_inclusive('\n').filter_map(move |line| {
        // Spreadsheets mark UTF-8 files.
        let content = line.trim_end().trim_start_matches(['\u{feff}', ' ', '\t']);
        let from = start + (line.trim_end().len() - content.len());
        start += line.len();
        let is_comment = content.is_empty() || content.starts_with('#');
        (!is_comment).then(|| from..from + content.len())
    })
}
