//! The accuracy table as comma-separated values: one header line, plain numbers.

use std::fmt::Write;

use needlebench_evaluation::accuracy::{AccuracyRow, AccuracyTable, QUANTITIES};

use crate::csv::quoted;

/// A row for each group and one for all, `p` in the last; empty where nothing was measured.
pub(crate) fn accuracy_csv(table: &AccuracyTable) -> String {
    let mut header = vec!["group".to_owned(), "n".to_owned()];
    for quantity in QUANTITIES {
        let (key, unit) = (quantity.key, quantity.unit().symbol);
        header.push(format!("{key}_n"));
        for figure in ["mean", "sd", "min", "max"] {
            header.push(format!("{key}_{figure}_{unit}"));
        }
        header.push(format!("{key}_p"));
    }
    header.extend(["hits", "hits_of", "hit_radius_mm"].map(str::to_owned));
    let mut text = header.join(",");
    text.push('\n');
    for row in &table.groups {
        write_row(&mut text, table, row, false);
    }
    write_row(&mut text, table, &table.all, true);
    text
}

fn write_row(out: &mut String, table: &AccuracyTable, row: &AccuracyRow, is_all: bool) {
    out.push_str(&quoted(&row.label));
    // Writing to a String cannot fail.
    let _ = write!(out, ",{}", row.n);
    for (spread, tested) in row.spreads.iter().zip(&table.tests) {
        let _ = match spread {
            Some(spread) => {
                let sd = spread.sd.map_or(String::new(), |sd| sd.to_string());
                write!(
                    out,
                    ",{},{},{sd},{},{}",
                    spread.count, spread.mean, spread.least, spread.most
                )
            }
            None => write!(out, ",0,,,,"),
        };
        let _ = match tested {
            Ok(tested) if is_all => write!(out, ",{}", tested.p),
            _ => write!(out, ","),
        };
    }
    let _ = match row.hits {
        Some(hits) => write!(out, ",{},{}", hits.within, hits.of),
        None => write!(out, ",,"),
    };
    let radius = table.hit_radius.as_ref();
    let radius = radius.map_or(String::new(), |found| found.radius_mm.to_string());
    let _ = writeln!(out, ",{radius}");
}
