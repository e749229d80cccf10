//! Tables of text: a time and one or three coordinates.

use std::path::Path;

use needlebench_input::{Finding, Separator, nearest_name, read_data, sha256_hex};

use crate::clock::TimeUnit;
use crate::options::{LengthUnit, ReadOptions};
use crate::samples::Samples;
use crate::source::Source;

/// Most findings of a file that are reported.
const MOST_FINDINGS: usize = 10;

const COLUMNS_HINT: &str = "columns are named time and x, y, z, or time and position, with units (x_mm); else \
                            choose them by name or number: --columns time,x,y,z";

const UNIT_HINT: &str = "--unit mm or --unit m, or name it in the header: x_mm, x [mm]";

/// Names of a column that says whom or what a row is of.
const OF_WHOM: [&str; 6] = [
    "patient",
    "patient_id",
    "subject",
    "subject_id",
    "id",
    "marker",
];

/// Reads a table.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Source, Vec<Finding>> {
    let file = path.display().to_string();
    let unread = |message: String, hint: &str| {
        vec![Finding::new(&file, format!("cannot read the recording: {message}")).hint(hint)]
    };
    let bytes = read_data(path).map_err(|error| {
        let hint = error.hint("a table with a time and one or three coordinates, or an MCAP file");
        unread(error.to_string(), hint)
    })?;
    let sha256 = sha256_hex(&bytes);
    let text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        unread(
            format!("it is not UTF-8 text: first invalid byte {at}"),
            "save the file as UTF-8 text",
        )
    })?;
    let table = Table::new(&file, &text).map_err(|finding| vec![finding])?;
    let columns = table.columns(options).map_err(|finding| vec![finding])?;
    table.source(&columns, sha256)
}

/// What a name says: the quantity, in small letters with `_` between its words, and its unit.
#[derive(Debug, PartialEq, Eq)]
struct Name {
    stem: String,
    unit: Option<Unit>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Unit {
    Time(TimeUnit),
    Length(LengthUnit),
    Angle,
}

impl Name {
    fn of(name: &str) -> Self {
        let name = name.to_lowercase();
        let parts = name.split(|letter: char| !letter.is_alphanumeric() && letter != '°');
        let mut words: Vec<&str> = parts.filter(|word| !word.is_empty()).collect();
        let unit = match words.last().copied() {
            Some("s" | "sec" | "seconds") => Some(Unit::Time(TimeUnit::Second)),
            Some("ms" | "msec" | "milliseconds") => Some(Unit::Time(TimeUnit::Millisecond)),
            Some("m" | "metres" | "meters") => Some(Unit::Length(LengthUnit::Metre)),
            Some("mm" | "millimetres" | "millimeters") => {
                Some(Unit::Length(LengthUnit::Millimetre))
            }
            Some("deg" | "°" | "degrees" | "rad" | "radians") => Some(Unit::Angle),
            _ => None,
        };
        // A unit alone is a name: `s` may be a distance.
        let unit = unit.filter(|_| words.len() > 1);
        if unit.is_some() {
            words.pop();
        }
        Self {
            stem: words.join("_"),
            unit,
        }
    }
}

struct Table<'a> {
    file: &'a str,
    separator: Separator,
    /// Of the header; empty where there is none.
    names: Vec<&'a str>,
    header_line: usize,
    width: usize,
    /// Lines with their numbers, from 1.
    lines: Vec<(usize, &'a str)>,
}

/// Where the values are.
struct Columns {
    time: usize,
    time_unit: Option<TimeUnit>,
    coordinates: Vec<usize>,
    to_m: f64,
    /// Whom or what a row is of.
    of_whom: Option<usize>,
}

impl<'a> Table<'a> {
    fn new(file: &'a str, text: &'a str) -> Result<Self, Finding> {
        let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
        let lines = lines.map(|(number, line)| (number, line.trim_end_matches('\r')));
        let is_content =
            |line: &str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
        let mut lines: Vec<(usize, &str)> = lines.filter(|(_, line)| is_content(line)).collect();
        let Some(&(header_line, header)) = lines.first() else {
            return Err(Finding::new(file, "the recording is empty").hint(COLUMNS_HINT));
        };
        let separator = Separator::of_header(header.trim());
        let mut names: Vec<&str> = separator.cells(header.trim()).collect();
        // A separator at the end of every line.
        while names.last().is_some_and(|name| name.is_empty()) {
            names.pop();
        }
        let width = names.len();
        if names.iter().all(|name| separator.number(name).is_some()) {
            names.clear();
        } else {
            lines.remove(0);
        }
        Ok(Self {
            file,
            separator,
            names,
            header_line,
            width,
            lines,
        })
    }

    fn finding(&self, message: impl Into<String>) -> Finding {
        let mut finding = Finding::new(self.file, message);
        finding.line = Some(self.header_line);
        finding
    }

    fn columns(&self, options: &ReadOptions) -> Result<Columns, Finding> {
        let names: Vec<Name> = self.names.iter().map(|name| Name::of(name)).collect();
        let (time, coordinates) = match &options.columns {
            Some(columns) => self.given(columns)?,
            None => self.by_name(&names)?,
        };
        let unit = |column: usize| names.get(column).and_then(|name| name.unit);
        let time_unit = match unit(time) {
            Some(Unit::Time(unit)) => Some(unit),
            Some(_) => {
                let finding = self
                    .finding("the time is not in s or ms")
                    .key(self.label(time));
                return Err(finding.hint(COLUMNS_HINT));
            }
            None => None,
        };
        let mut found = options.unit;
        for &column in &coordinates {
            let named = match unit(column) {
                Some(Unit::Length(unit)) => unit,
                None => continue,
                Some(_) => {
                    let message = "the column is no length: breath is read as a displacement";
                    let hint = "record the position of a marker in mm or m; angles and times are not converted";
                    return Err(self.finding(message).key(self.label(column)).hint(hint));
                }
            };
            if found.is_some_and(|found| found != named) {
                let message = "the unit in the column's name is not that of the others, or not that of --unit";
                let hint = "all coordinates are in one unit";
                return Err(self.finding(message).key(self.label(column)).hint(hint));
            }
            found = Some(named);
        }
        let Some(found) = found else {
            let finding = self.finding("nothing says whether positions are in m or mm");
            return Err(finding.key(self.label(coordinates[0])).hint(UNIT_HINT));
        };
        Ok(Columns {
            time,
            time_unit,
            coordinates,
            to_m: found.to_m(),
            of_whom: names
                .iter()
                .position(|name| OF_WHOM.contains(&name.stem.as_str())),
        })
    }

    /// A column's name, or its number.
    fn label(&self, column: usize) -> String {
        match self.names.get(column) {
            Some(name) => (*name).to_owned(),
            None => format!("column {}", column + 1),
        }
    }

    /// Columns by name or number.
    fn given(&self, columns: &[String]) -> Result<(usize, Vec<usize>), Finding> {
        if !matches!(columns.len(), 2 | 4) {
            let message = format!("--columns names {} columns", columns.len());
            return Err(Finding::new(self.file, message)
                .hint("a time and one or three coordinates: time,x,y,z"));
        }
        let mut found = Vec::new();
        for wanted in columns {
            let by_name = self.names.iter().position(|name| name == wanted);
            let by_number = || {
                wanted
                    .parse::<usize>()
                    .ok()
                    .and_then(|number| number.checked_sub(1))
            };
            let at = by_name.or_else(by_number).filter(|at| *at < self.width);
            let Some(at) = at else {
                let finding = self
                    .finding(format!("there is no column `{wanted}`"))
                    .key("--columns");
                let hint = match nearest_name(wanted, self.names.iter().copied()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!(
                        "the table has {} columns: give their names, or numbers from 1",
                        self.width
                    ),
                };
                return Err(finding.hint(hint));
            };
            if found.contains(&at) {
                let message = format!("the column `{wanted}` is named twice");
                return Err(self.finding(message).key("--columns").hint(COLUMNS_HINT));
            }
            found.push(at);
        }
        Ok((found[0], found.split_off(1)))
    }

    /// Columns by what their names say; without a header, a time and what else there is.
    fn by_name(&self, names: &[Name]) -> Result<(usize, Vec<usize>), Finding> {
        let refused = |message: String| Err(self.finding(message).hint(COLUMNS_HINT));
        if names.is_empty() {
            return match self.width {
                2 | 4 => Ok((0, (1..self.width).collect())),
                width => refused(format!("{width} columns without names")),
            };
        }
        let all_of = |wanted: &[&str]| -> Vec<usize> {
            let found = names.iter().enumerate();
            let found = found.filter(|(_, name)| wanted.contains(&name.stem.as_str()));
            found.map(|(at, _)| at).collect()
        };
        let times = all_of(&["time", "t", "timestamp"]);
        let &[time] = times.as_slice() else {
            let all = self.names.join(", ");
            return refused(match times.len() {
                0 => format!("no column is a time: {all}"),
                count => format!("{count} columns are times: {all}"),
            });
        };
        let coordinates = all_of(&["x", "y", "z"]);
        if coordinates.len() == 3 {
            return Ok((time, coordinates));
        }
        let single = all_of(&["position", "displacement"]);
        match (single.as_slice(), self.width) {
            (&[only], _) => Ok((time, vec![only])),
            (_, 2) => Ok((time, vec![1 - time])),
            _ => refused(format!(
                "no three columns are x, y, z, and none is a position: {}",
                self.names.join(", ")
            )),
        }
    }

    fn source(&self, columns: &Columns, sha256: String) -> Result<Source, Vec<Finding>> {
        let is_one_coordinate = columns.coordinates.len() == 1;
        let mut samples = Samples {
            is_one_coordinate,
            ..Samples::default()
        };
        let (mut findings, mut notes) = (Vec::new(), Vec::new());
        let mut whose: Option<&str> = None;
        for (at, &(line, text)) in self.lines.iter().enumerate() {
            let mut cells: Vec<&str> = self.separator.cells(text.trim()).collect();
            if cells.len() == self.width + 1 && cells.last().is_some_and(|cell| cell.is_empty()) {
                cells.pop();
            }
            let at_line = |message: String| {
                let mut finding = Finding::new(self.file, message);
                finding.line = Some(line);
                finding
            };
            if cells.len() == self.width {
                if let Some(column) = columns.of_whom {
                    let here = cells[column];
                    if *whose.get_or_insert(here) != here {
                        let message = format!(
                            "`{here}` after `{}`: several are in one file",
                            whose.unwrap_or(here)
                        );
                        let hint = "one patient and one marker in a file: split it by that column";
                        return Err(vec![at_line(message).key(self.label(column)).hint(hint)]);
                    }
                }
                let mut number = |column: usize| {
                    let read = self.separator.number(cells[column]);
                    if read.is_none() {
                        let finding = at_line(format!("`{}` is not a number", cells[column]));
                        let hint = "leave a cell empty, or write nan, where nothing was measured";
                        findings.push(finding.key(self.label(column)).hint(hint));
                    }
                    read.unwrap_or(f64::NAN)
                };
                let time = number(columns.time);
                let mut position = [0.0; 3];
                for (coordinate, &column) in position.iter_mut().zip(&columns.coordinates) {
                    *coordinate = columns.to_m * number(column);
                }
                samples.times_s.push(time);
                samples.positions_m.push(position);
                samples.places.push(line);
            } else {
                let message = format!(
                    "the line has {} values, the first line {}",
                    cells.len(),
                    self.width
                );
                let finding = at_line(message);
                if at + 1 == self.lines.len() {
                    notes.push(finding.hint("the last line is cut off: left out"));
                    break;
                }
                let hint = "every line has a value for every column; numbers with a decimal comma are parted by \
                            semicolons or tabs";
                findings.push(finding.hint(hint));
            }
            if findings.len() >= MOST_FINDINGS {
                break;
            }
        }
        if !findings.is_empty() {
            return Err(findings);
        }
        Ok(Source {
            file: self.file.to_owned(),
            sha256,
            format: "csv",
            rows: self.lines.len(),
            time_unit: columns.time_unit,
            samples,
            notes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_quantity_and_unit() {
        for (name, stem, unit) in [
            ("Timestamp", "timestamp", None),
            ("t_ms", "t", Some(Unit::Time(TimeUnit::Millisecond))),
            ("Time (s)", "time", Some(Unit::Time(TimeUnit::Second))),
            ("x [mm]", "x", Some(Unit::Length(LengthUnit::Millimetre))),
            (
                "Position/m",
                "position",
                Some(Unit::Length(LengthUnit::Metre)),
            ),
            ("roll [°]", "roll", Some(Unit::Angle)),
            ("m", "m", None),
            ("subject ID", "subject_id", None),
        ] {
            let expected = Name {
                stem: stem.to_owned(),
                unit,
            };
            assert_eq!(Name::of(name), expected, "{name}");
        }
    }
}
