//! Delimited text with a header: cells with their places, for messages that point at them.

use std::ops::Range;

use needlebench_input::{Finding, Separator};

use super::log_units::is_unit;

/// Starts of lines that are comments: needlebench's own, SpatialAnalyzer's, MATLAB's.
const COMMENTS: [&str; 3] = ["#", "//", "%"];

/// A header cell: its name in lower case without the unit, and the unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Heading {
    pub name: String,
    pub unit: Option<String>,
    pub span: Range<usize>,
}

/// A text as a table.
#[derive(Debug)]
pub(super) struct Table<'a> {
    pub file: &'a str,
    pub text: &'a str,
    pub headings: Vec<Heading>,
    /// Cells of each line, as many as there are headings.
    pub rows: Vec<Vec<Range<usize>>>,
    /// Numbers have a comma for a point.
    decimal_comma: bool,
}

impl<'a> Table<'a> {
    /// Splits a text into cells.
    ///
    /// The separator is a semicolon, a tab or a comma, whichever of these in this order is in the
    /// header. With the first two, numbers may have a decimal comma.
    pub(super) fn parse(file: &'a str, text: &'a str) -> Result<Self, Vec<Finding>> {
        let mut lines = lines(text);
        let Some(header) = lines.next() else {
            return Err(vec![
                Finding::new(file, "the file has no header").hint(HEADER_HINT),
            ]);
        };
        let separator = match Separator::of_header(&text[header.clone()]) {
            Separator::Blanks => Separator::Comma,
            other => other,
        };
        let headings: Vec<Heading> = cells(text, header.clone(), separator)
            .into_iter()
            .map(|span| heading(text, span))
            .collect();
        if headings
            .iter()
            .all(|each| text[each.span.clone()].parse::<f64>().is_ok() || each.span.is_empty())
        {
            return Err(vec![
                Finding::new(file, "the first line has numbers instead of column names")
                    .at(text, header)
                    .hint(HEADER_HINT),
            ]);
        }
        let (mut rows, mut findings) = (Vec::new(), Vec::new());
        let mut lines = lines.peekable();
        while let Some(line) = lines.next() {
            let mut found = cells(text, line.clone(), separator);
            // A separator at the end of every line.
            while found.len() > headings.len() && found.last().is_some_and(Range::is_empty) {
                found.pop();
            }
            if found.len() == headings.len() {
                rows.push(found);
                continue;
            }
            let message = format!(
                "the line has {} values, the header {} columns",
                found.len(),
                headings.len()
            );
            let cut_off = lines.peek().is_none() && found.len() < headings.len();
            findings.push(Finding::new(file, message).at(text, line).hint(if cut_off {
                "this is the last line, the file may be truncated; copy it again or remove the line"
            } else {
                "every line requires a value for every column; numbers with a decimal comma \
                 require a semicolon as separator"
            }));
        }
        if findings.is_empty() {
            Ok(Self {
                file,
                text,
                headings,
                rows,
                decimal_comma: separator.allows_decimal_comma(),
            })
        } else {
            Err(findings)
        }
    }

    /// Text of a cell.
    pub(super) fn cell(&self, row: usize, column: usize) -> &'a str {
        &self.text[self.rows[row][column].clone()]
    }

    /// Text of a cell that should be a number, with a decimal point.
    pub(super) fn number(&self, row: usize, column: usize) -> String {
        let text = self.cell(row, column);
        if self.decimal_comma {
            text.replace(',', ".")
        } else {
            text.to_owned()
        }
    }

    /// A finding about a cell.
    pub(super) fn finding(&self, row: usize, column: usize, message: String) -> Finding {
        Finding::new(self.file, message)
            .key(&self.text[self.headings[column].span.clone()])
            .at(self.text, self.rows[row][column].clone())
    }

    /// A finding about a column.
    pub(super) fn column_finding(&self, column: usize, message: String) -> Finding {
        Finding::new(self.file, message).at(self.text, self.headings[column].span.clone())
    }

    /// Line of a row, from 1.
    pub(super) fn line(&self, row: usize) -> usize {
        let start = self.rows[row].first().map_or(0, |cell| cell.start);
        1 + self.text[..start].matches('\n').count()
    }
}

pub(super) const HEADER_HINT: &str = "the first line that is not a comment names the columns and their units, e.g.: \
     time_s,cycle,pose,direction,x_mm,y_mm,z_mm,qw,qx,qy,qz";

/// Lines that are neither empty nor comments, without line ends.
fn lines(text: &str) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    text.split_inclusive('\n').filter_map(move |line| {
        let begin = start;
        start += line.len();
        let mut content = line.trim_end();
        let mut from = begin;
        if let Some(rest) = content.strip_prefix('\u{feff}') {
            // Spreadsheets mark UTF-8 files so.
            from += content.len() - rest.len();
            content = rest;
        }
        let trimmed = content.trim_start();
        let comment = COMMENTS.iter().any(|mark| trimmed.starts_with(mark));
        (!trimmed.is_empty() && !comment).then(|| from..from + content.len())
    })
}

/// Where the cells of a line are.
fn cells(text: &str, line: Range<usize>, separator: Separator) -> Vec<Range<usize>> {
    let place = |cell: &str| {
        let start = cell.as_ptr() as usize - text.as_ptr() as usize;
        start..start + cell.len()
    };
    separator.cells(&text[line]).map(place).collect()
}

/// `x_mm`, `x [mm]`, `x (mm)`, `x/mm` and `x mm` are all x in mm.
fn heading(text: &str, span: Range<usize>) -> Heading {
    let whole = text[span.clone()].to_lowercase();
    let tidy = |name: &str| {
        let words: Vec<&str> = name
            .split(|c: char| c.is_whitespace() || c == '_' || c == '-' || c == '.')
            .filter(|word| !word.is_empty())
            .collect();
        words.join(" ")
    };
    let bracketed = whole
        .strip_suffix([']', ')'])
        .and_then(|rest| rest.split_once(['[', '(']));
    let (name, unit) = match bracketed {
        Some((name, unit)) => (name, Some(unit.trim())),
        None => match whole.rsplit_once(['_', ' ', '/']) {
            Some((name, unit)) if is_unit(unit.trim()) => (name, Some(unit.trim())),
            _ => (whole.as_str(), None),
        },
    };
    Heading {
        name: tidy(name),
        unit: unit.filter(|unit| !unit.is_empty()).map(str::to_owned),
        span,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_however_they_are_written() {
        for text in ["X_mm", "x [mm]", "x (mm)", "X/mm", "x mm", "\"X [mm]\""] {
            let span = cells(text, 0..text.len(), Separator::Comma).remove(0);
            let found = heading(text, span);
            assert_eq!(
                (found.name.as_str(), found.unit.as_deref()),
                ("x", Some("mm"))
            );
        }
        let name = heading("Point_Name", 0..10);
        assert_eq!((name.name.as_str(), name.unit), ("point name", None));
    }

    #[test]
    fn separators_comments_and_quotes_are_found() {
        let text = "\u{feff}// a comment\r\n# another\n\npose;x [mm];\"note; free\"\r\nP1; 1,5 ;\"a;b\"\r\n";
        let table = Table::parse("log.csv", text).unwrap();
        assert_eq!(table.headings.len(), 3);
        assert_eq!(table.number(0, 1), "1.5");
        assert_eq!(table.cell(0, 2), "a;b");
        assert_eq!(table.line(0), 5);
    }
}
