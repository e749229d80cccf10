//! Logs of laser trackers: one row per measured pose.
//!
//! Columns are found by their names, in any order; what is not known is left out and said so. The
//! text that [`write_log`](super::write_log) makes reads back to the same numbers, bit for bit.

use std::collections::BTreeMap;

use needlebench_input::Finding;

use super::columns::Columns;
use super::log_units::LogUnits;
use super::table::Table;
use super::{Attained, Commanded};

/// Most findings of a file that are reported.
const MOST_FINDINGS: usize = 20;

/// What a log says.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackerLog {
    /// Measurements, in the order of the file.
    pub attained: Vec<Attained>,
    /// What was left out or assumed.
    pub notes: Vec<String>,
}

/// Reads measurements.
///
/// Each row is a measurement of a pose that is in `commanded`. Without a column for cycles, those of
/// names like `P3_07` are taken, or else the measurements of a pose are counted.
///
/// # Errors
/// What is wrong with the file, with line and column.
pub fn read_log(
    file: &str,
    text: &str,
    commanded: &[Commanded],
    units: LogUnits,
) -> Result<TrackerLog, Vec<Finding>> {
    let table = Table::parse(file, text)?;
    let columns = Columns::find(&table, units, true)?;
    let mut notes = columns.notes.clone();
    let mut findings = Vec::new();
    let mut attained = Vec::with_capacity(table.rows.len());
    let mut counted: BTreeMap<(u32, Option<usize>), u32> = BTreeMap::new();
    let mut seen: BTreeMap<(u32, Option<usize>, u32), usize> = BTreeMap::new();
    let times = columns.times(&table, &mut notes);
    for (row, time_s) in times.into_iter().enumerate() {
        let parsed = columns.row(&table, row, commanded).and_then(|parsed| {
            let key = (parsed.commanded.pose, parsed.axis);
            let count = counted.entry(key).or_default();
            *count += 1;
            let cycle = parsed.cycle.unwrap_or(*count);
            match seen.insert((key.0, key.1, cycle), row) {
                None => Ok((parsed, cycle)),
                Some(earlier) => Err(twice(&table, row, earlier, &columns, cycle)),
            }
        });
        match parsed {
            Ok((parsed, cycle)) => attained.push(Attained {
                pose: parsed.commanded.pose,
                cycle,
                axis: parsed.axis,
                time_s,
                position_m: parsed.commanded.position_m,
                orientation: parsed.commanded.orientation,
            }),
            Err(finding) => findings.push(finding),
        }
        if findings.len() >= MOST_FINDINGS {
            break;
        }
    }
    if findings.is_empty() {
        Ok(TrackerLog { attained, notes })
    } else {
        Err(findings)
    }
}

/// Reads commanded poses: one row per pose.
///
/// # Errors
/// What is wrong with the file, with line and column.
pub fn read_commanded(
    file: &str,
    text: &str,
    units: LogUnits,
) -> Result<Vec<Commanded>, Vec<Finding>> {
    let table = Table::parse(file, text)?;
    let columns = Columns::find(&table, units, false)?;
    let (mut commanded, mut findings): (Vec<Commanded>, Vec<Finding>) = (Vec::new(), Vec::new());
    for row in 0..table.rows.len() {
        match columns.row(&table, row, &[]) {
            Ok(parsed)
                if commanded
                    .iter()
                    .any(|each| each.pose == parsed.commanded.pose) =>
            {
                let column = columns.pose_column();
                let message = format!("P{} is commanded twice", parsed.commanded.pose);
                findings.push(
                    table
                        .finding(row, column, message)
                        .hint("give one row per pose; measurements belong in --csv"),
                );
            }
            Ok(parsed) => commanded.push(parsed.commanded),
            Err(finding) => findings.push(finding),
        }
    }
    findings.truncate(MOST_FINDINGS);
    if commanded.is_empty() && findings.is_empty() {
        findings.push(Finding::new(file, "the file has no pose").hint("give one row per pose"));
    }
    if findings.is_empty() {
        Ok(commanded)
    } else {
        Err(findings)
    }
}

fn twice(table: &Table<'_>, row: usize, earlier: usize, columns: &Columns, cycle: u32) -> Finding {
    let column = columns.pose_column();
    let message = format!(
        "{} of cycle {cycle} was already measured in line {}",
        table.cell(row, column),
        table.line(earlier)
    );
    table
        .finding(row, column, message)
        .hint("give one row per pose and cycle; average the readings of one visit beforehand")
}
