//! What the tests share.

use std::fmt::Write;
use std::path::PathBuf;

use needlebench_cell::Robot;
use needlebench_recorded::{ReadOptions, RecordedRun, read_log};
use needlebench_scenario::{Overrides, load_robot};

/// The recorded run of a real UR3e that ships with its data.
pub fn shipped() -> PathBuf {
    PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../models/ur3e/recorded/ur3e_rad_20211005.csv"
    ))
}

pub fn shipped_text() -> String {
    std::fs::read_to_string(shipped()).unwrap()
}

pub fn robot(arm: &str) -> Robot {
    load_robot(&Overrides {
        arm: Some(arm.to_owned()),
        ..Overrides::default()
    })
    .unwrap()
    .robot
}

/// Reads a text as a log.
pub fn read_text(
    text: &str,
    options: &ReadOptions,
) -> Result<RecordedRun, Vec<needlebench_input::Finding>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, text).unwrap();
    read_log(&path, options)
}

/// A log as lines of cells, to be spoilt.
pub struct Sheet {
    pub names: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Sheet {
    pub fn of(text: &str) -> Self {
        let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = text.lines();
        Self {
            names: cells(lines.next().unwrap()),
            rows: lines.map(cells).collect(),
        }
    }

    pub fn column(&self, name: &str) -> usize {
        self.names.iter().position(|each| each == name).unwrap()
    }

    /// Changes every number of the columns that begin with one of these.
    pub fn change(&mut self, prefixes: &[&str], of: impl Fn(f64) -> f64) {
        let columns: Vec<usize> = (0..self.names.len())
            .filter(|at| {
                prefixes
                    .iter()
                    .any(|prefix| self.names[*at].starts_with(prefix))
            })
            .collect();
        for row in &mut self.rows {
            for column in &columns {
                let value: f64 = row[*column].parse().unwrap();
                row[*column] = of(value).to_string();
            }
        }
    }

    /// Without the columns that begin with one of these.
    pub fn without(&mut self, prefixes: &[&str]) {
        let keep: Vec<bool> = self
            .names
            .iter()
            .map(|name| !prefixes.iter().any(|prefix| name.starts_with(prefix)))
            .collect();
        let sift = |cells: &mut Vec<String>| {
            let mut kept = keep.iter();
            cells.retain(|_| *kept.next().unwrap());
        };
        sift(&mut self.names);
        self.rows.iter_mut().for_each(sift);
    }

    pub fn text(&self) -> String {
        let mut text = self.names.join(",") + "\n";
        for row in &self.rows {
            writeln!(text, "{}", row.join(",")).unwrap();
        }
        text
    }
}
