//! Logs as tables of text: UR's RTDE recorder, `ur_rtde`, and any other with a table of columns.
//!
//! Rows are read one by one: a log of 400 MB needs the memory of the numbers that are used.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use needlebench_input::{Finding, Separator, nearest_name, open_input};
use needlebench_scenario::LogColumns;
use sha2::{Digest, Sha256};

use crate::raw::RawLog;
use crate::{Quantity, ReadOptions};

/// Most findings of a file that are reported.
const MOST_FINDINGS: usize = 10;

/// No line of a log is longer, bytes.
const LONGEST_LINE: u64 = 1 << 20;

/// Lines by which the number of rows is estimated.
const FIRST_LINES: usize = 50;

const HEADER_HINT: &str = "the first line names the columns as UR's RTDE recorder does (timestamp, \
     target_q_0 to _5, actual_q_0 ...); map other names with --columns MAP.toml";

/// Where a number of a row goes.
#[derive(Debug, Clone, Copy)]
struct Slot {
    column: usize,
    quantity: Quantity,
    index: usize,
    to_si: f64,
}

/// What each line is.
struct Table<'a> {
    separator: Separator,
    names: Vec<&'a str>,
    /// Sorted by quantity and index.
    slots: Vec<Slot>,
    /// By column, the place of its number among the slots.
    wanted: Vec<Option<usize>>,
}

impl<'a> Table<'a> {
    fn new(separator: Separator, names: Vec<&'a str>, mut slots: Vec<Slot>) -> Self {
        slots.sort_by_key(|slot| (slot.quantity, slot.index));
        let mut wanted = vec![None; names.len()];
        for (at, slot) in slots.iter().enumerate() {
            wanted[slot.column] = Some(at);
        }
        Self {
            separator,
            names,
            slots,
            wanted,
        }
    }
}

/// Reads a table; with it the SHA-256 of its bytes.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<(RawLog, String), Vec<Finding>> {
    let file = path.display().to_string();
    let cannot = |error: String, hint: &str| {
        vec![Finding::new(&file, format!("cannot read the log: {error}")).hint(hint)]
    };
    let input = open_input(path).map_err(|error| {
        let hint = error.hint("the path is relative to the working directory");
        cannot(error.to_string(), hint)
    })?;
    let bytes = input.metadata().map_or(0, |metadata| metadata.len());
    let mut lines = Lines {
        input: BufReader::with_capacity(1 << 20, input),
        digest: Sha256::new(),
        buffer: Vec::new(),
        number: 0,
    };
    let mut reader = Reader {
        file: &file,
        raw: RawLog::default(),
        findings: Vec::new(),
    };
    let read = reader.table(&mut lines, options, bytes);
    read.map_err(|error| cannot(error.to_string(), "is it a text log?"))?;
    if reader.findings.is_empty() {
        let hash = lines.digest.finalize();
        let hash = hash
            .iter()
            .fold(String::new(), |text, byte| text + &format!("{byte:02x}"));
        Ok((reader.raw, hash))
    } else {
        Err(reader.findings)
    }
}

/// Lines with their numbers; whatever is read is hashed.
struct Lines<R> {
    input: BufReader<R>,
    digest: Sha256,
    buffer: Vec<u8>,
    number: usize,
}

impl<R: Read> Lines<R> {
    /// The next line in `buffer`, and whether it has an end; `None` after the last one.
    fn next(&mut self) -> std::io::Result<Option<bool>> {
        self.buffer.clear();
        let mut limited = Read::by_ref(&mut self.input).take(LONGEST_LINE);
        // Ends of lines are LF, CR LF, or CR alone.
        loop {
            let there = limited.fill_buf()?;
            let Some(end) = there.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
                let count = there.len();
                if count == 0 {
                    break;
                }
                self.buffer.extend_from_slice(there);
                limited.consume(count);
                continue;
            };
            self.buffer.extend_from_slice(&there[..=end]);
            let mut last = there[end];
            limited.consume(end + 1);
            while last == b'\r'
                && let Some(&next @ (b'\r' | b'\n')) = limited.fill_buf()?.first()
            {
                self.buffer.push(next);
                limited.consume(1);
                last = next;
            }
            break;
        }
        if self.buffer.is_empty() {
            return Ok(None);
        }
        self.digest.update(&self.buffer);
        self.number += 1;
        Ok(Some(matches!(self.buffer.last(), Some(b'\n' | b'\r'))))
    }

    /// The line as text, without its end.
    fn text(&self) -> std::io::Result<&str> {
        let text = std::str::from_utf8(&self.buffer).map_err(|_| {
            let message = format!("line {} is not text", self.number);
            std::io::Error::new(std::io::ErrorKind::InvalidData, message)
        })?;
        Ok(text
            .trim_end_matches(['\n', '\r'])
            .trim_start_matches('\u{feff}'))
    }
}

struct Reader<'a> {
    file: &'a str,
    raw: RawLog,
    findings: Vec<Finding>,
}

impl Reader<'_> {
    fn refuse(&mut self, line: usize, key: Option<&str>, message: String, hint: &str) {
        let mut finding = Finding::new(self.file, message).hint(hint);
        finding.line = Some(line);
        finding.key = key.map(str::to_owned);
        self.findings.push(finding);
    }

    fn table<R: Read>(
        &mut self,
        lines: &mut Lines<R>,
        options: &ReadOptions,
        bytes: u64,
    ) -> std::io::Result<()> {
        let mut header = None;
        while header.is_none() {
            if lines.next()?.is_none() {
                self.findings
                    .push(Finding::new(self.file, "the log is empty").hint(HEADER_HINT));
                return Ok(());
            }
            let text = lines.text()?.trim();
            if !text.is_empty() && !text.starts_with('#') {
                header = Some(text.trim_start_matches('%').to_owned());
            }
        }
        let header = header.expect("just found");
        let header_line = lines.number;
        let separator = Separator::of_header(&header);
        let mut names: Vec<&str> = separator.cells(&header).collect();
        // A separator at the end of every line.
        while names.last().is_some_and(|name| name.is_empty()) {
            names.pop();
        }
        if separator.allows_decimal_comma() {
            self.raw.notes.push(format!(
                "values are separated by {}; a comma in a number is a decimal comma",
                separator.words()
            ));
        }
        let slots = match &options.columns {
            Some(columns) => self.mapped(&names, columns),
            None => self.named(&names, header_line, options),
        };
        if !self.findings.is_empty() {
            return Ok(());
        }
        let table = Table::new(separator, names, slots);
        let (slots, names) = (&table.slots, &table.names);
        let mut quantities: Vec<Quantity> = slots.iter().map(|slot| slot.quantity).collect();
        quantities.dedup();
        self.raw.expect(quantities.iter().copied(), 0);
        let mut numbers = vec![f64::NAN; slots.len()];
        let mut pending: Option<(usize, usize)> = None;
        let mut first_bytes = 0;
        while let Some(ended) = lines.next()? {
            let line = lines.number;
            let text = lines.text()?;
            if text.trim().is_empty() {
                continue;
            }
            if let Some((short, count)) = pending.take() {
                let message = format!("the line has {count} values, the header {}", names.len());
                let hint = "every line requires a value for every column; numbers with a decimal \
                            comma must be separated by semicolons";
                self.refuse(short, None, message, hint);
            }
            self.raw.rows_in_file += 1;
            let count = self.cells(text, &mut numbers, &table, line);
            if self.findings.len() >= MOST_FINDINGS {
                return Ok(());
            }
            if count != names.len() {
                pending = Some((line, count));
                continue;
            }
            if !ended {
                self.raw.notes.push(format!(
                    "line {line}, the last one, has no line end and may be cut off: left out"
                ));
                continue;
            }
            first_bytes += lines.buffer.len();
            if self.raw.rows_in_file == FIRST_LINES {
                self.reserve(&quantities, bytes, first_bytes / FIRST_LINES);
            }
            let mut cut = None;
            let mut from = 0;
            while from < slots.len() {
                let quantity = slots[from].quantity;
                let width = quantity.width();
                self.raw
                    .add(quantity, &numbers[from..from + width], &mut cut);
                from += width;
            }
            self.raw.end_row(line, cut);
        }
        if let Some((line, count)) = pending {
            self.raw.notes.push(format!(
                "line {line}, the last one, is cut off after {count} of {} values: left out",
                names.len()
            ));
        }
        Ok(())
    }

    /// Makes room for the rest of the file, by the length of its lines.
    fn reserve(&mut self, quantities: &[Quantity], bytes: u64, line_bytes: usize) {
        let rows = usize::try_from(bytes).unwrap_or(0) / line_bytes.max(1);
        let rows = rows + rows / 50 + 8;
        for quantity in quantities.iter().filter(|each| each.is_measured()) {
            let values = self.raw.values.entry(*quantity).or_default();
            values.reserve_exact((rows * quantity.width()).saturating_sub(values.len()));
        }
        self.raw.cut.reserve_exact(rows);
        self.raw.line.reserve_exact(rows);
    }

    /// Reads the required cells; returns how many the line has.
    fn cells(&mut self, text: &str, numbers: &mut [f64], table: &Table<'_>, line: usize) -> usize {
        let mut count = 0;
        let mut last_is_empty = false;
        for cell in table.separator.cells(text) {
            let at = table.wanted.get(count).copied().flatten();
            count += 1;
            last_is_empty = cell.is_empty();
            let Some(at) = at else { continue };
            let slot = &table.slots[at];
            let value = table.separator.number(cell);
            if value.is_none() && self.findings.len() < MOST_FINDINGS {
                let mut finding = Finding::new(self.file, format!("`{cell}` is not a number"))
                    .key(table.names[slot.column])
                    .hint("leave a cell empty, or write nan, where nothing was measured");
                finding.line = Some(line);
                self.findings.push(finding);
            }
            numbers[at] = value.map_or(f64::NAN, |value| value * slot.to_si);
        }
        // A separator at the end of every line.
        if last_is_empty && count == table.names.len() + 1 {
            count -= 1;
        }
        count
    }

    /// Columns by the names of UR's real-time data exchange.
    fn named(&mut self, names: &[&str], line: usize, options: &ReadOptions) -> Vec<Slot> {
        let time = options.time.map_or(1.0, crate::TimeUnit::to_s);
        let angle = options.angle.map_or(1.0, crate::AngleUnit::to_rad);
        let mut found: BTreeMap<(Quantity, usize), usize> = BTreeMap::new();
        let mut clocks = Vec::new();
        for (column, name) in names.iter().enumerate() {
            let Some((quantity, index)) = Quantity::of_column(name) else {
                continue;
            };
            if quantity == Quantity::Time {
                clocks.push((column, *name));
            } else if found.insert((quantity, index), column).is_some() {
                let hint = "remove one of them, or name the right one with --columns MAP.toml";
                self.refuse(line, Some(name), format!("duplicate column `{name}`"), hint);
            }
        }
        self.count_from_zero(&mut found);
        if let Some(column) = self.clock(&clocks, names, line, options) {
            found.insert((Quantity::Time, 0), column);
        }
        let mut slots = Vec::new();
        for quantity in Quantity::all() {
            let columns: Vec<Option<&usize>> = (0..quantity.width())
                .map(|index| found.get(&(quantity, index)))
                .collect();
            let there = columns.iter().flatten().count();
            if there == 0 {
                continue;
            }
            if there < quantity.width() {
                self.raw.notes.push(format!(
                    "{} is not used: {there} of {} columns present",
                    quantity.name(),
                    quantity.width()
                ));
                continue;
            }
            let to_si = match quantity {
                Quantity::Time => time,
                _ if quantity.is_angular() => angle,
                _ => 1.0,
            };
            slots.extend(
                columns
                    .into_iter()
                    .flatten()
                    .enumerate()
                    .map(|(index, column)| Slot {
                        column: *column,
                        quantity,
                        index,
                        to_si,
                    }),
            );
        }
        if !slots.iter().any(|slot| slot.quantity == Quantity::ActualQ) {
            let near = nearest_name("actual_q_0", names.iter().copied());
            let near = near.map_or(String::new(), |near| format!("is it `{near}`? "));
            let message = "the columns actual_q_0 to actual_q_5 are missing".to_owned();
            self.refuse(line, None, message, &format!("{near}{HEADER_HINT}"));
        }
        slots
    }

    /// Joints that are counted from 1 to 6.
    fn count_from_zero(&mut self, found: &mut BTreeMap<(Quantity, usize), usize>) {
        let mut shifted = Vec::new();
        for quantity in Quantity::all().filter(|each| each.width() > 1) {
            let has = |index| found.contains_key(&(quantity, index));
            if has(quantity.width()) && !has(0) {
                shifted.push(quantity);
            }
        }
        for quantity in &shifted {
            for index in 0..quantity.width() {
                if let Some(column) = found.remove(&(*quantity, index + 1)) {
                    found.insert((*quantity, index), column);
                }
            }
        }
        if let Some(first) = shifted.first() {
            self.raw.notes.push(format!(
                "column numbers start at 1: {0}_1 is {0} of the first joint",
                first.name()
            ));
        }
    }

    fn clock(
        &mut self,
        clocks: &[(usize, &str)],
        names: &[&str],
        line: usize,
        options: &ReadOptions,
    ) -> Option<usize> {
        if let Some(wanted) = &options.time_column {
            let column = names.iter().position(|name| name == wanted);
            if column.is_none() {
                let hint = nearest_name(wanted, names.iter().copied())
                    .map_or(HEADER_HINT.to_owned(), |near| {
                        format!("did you mean `{near}`?")
                    });
                self.refuse(line, None, format!("there is no column `{wanted}`"), &hint);
            }
            return column;
        }
        match clocks {
            [(column, _)] => Some(*column),
            [] if options.rate_hz.is_some() => None,
            [] => {
                let hint = "name its column with --time-column, give --rate HZ for evenly spaced \
                            rows, or map the columns with --columns MAP.toml";
                self.refuse(line, None, "the log has no clock".to_owned(), hint);
                None
            }
            several => {
                let found: Vec<String> = several
                    .iter()
                    .map(|(_, name)| format!("`{name}`"))
                    .collect();
                let message = format!("the log has {} clocks: {}", several.len(), found.join(", "));
                self.refuse(line, None, message, "choose one with --time-column NAME");
                None
            }
        }
    }

    /// Columns by a user's table.
    fn mapped(&mut self, names: &[&str], map: &LogColumns) -> Vec<Slot> {
        let mut slots = Vec::new();
        for (key, groups) in map.columns() {
            let quantity = Quantity::of_key(key).expect("keys of the table are quantities");
            let mut index = 0;
            for group in groups {
                for name in &group.columns {
                    let mut matching = (0..names.len()).filter(|at| names[*at] == name);
                    match (matching.next(), matching.next()) {
                        (Some(column), None) => slots.push(Slot {
                            column,
                            quantity,
                            index,
                            to_si: group.to_si,
                        }),
                        (Some(_), Some(_)) => {
                            let message = format!("{} has two columns `{name}`", self.file);
                            self.findings.push(map.finding(key, message));
                        }
                        (None, _) => {
                            let message = format!("{} has no column `{name}`", self.file);
                            let near = nearest_name(name, names.iter().copied());
                            let finding = map.finding(key, message);
                            self.findings.push(match near {
                                Some(near) => finding.hint(format!("did you mean `{near}`?")),
                                None => {
                                    finding.hint("column names are in the first line of the log")
                                }
                            });
                        }
                    }
                    index += 1;
                }
            }
        }
        let mut taken: Vec<usize> = slots.iter().map(|slot| slot.column).collect();
        taken.sort_unstable();
        if let Some(pair) = taken.windows(2).find(|pair| pair[0] == pair[1]) {
            let message = format!("the column `{}` is used twice", names[pair[0]]);
            self.findings.push(Finding::new(&map.file, message));
        }
        slots
    }
}
