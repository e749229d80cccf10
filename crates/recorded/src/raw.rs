//! A log as its file has it: numbers in SI, nothing checked between rows yet.

use std::collections::BTreeMap;

use crate::Quantity;

/// Why a row is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cut {
    /// A number that is needed is not finite.
    NotFinite,
    /// The robot was not running.
    RobotMode,
    /// A stop, or recovery from one.
    SafetyMode,
    /// A joint was not running.
    JointMode,
    /// The teach button was pressed.
    Freedrive,
}

impl Cut {
    /// In words, of rows.
    pub fn words(self) -> &'static str {
        match self {
            Self::NotFinite => "with an empty or non-finite number",
            Self::RobotMode => "in which the robot was not running (robot_mode is not 7)",
            Self::SafetyMode => {
                "in a protective stop or a safety mode other than normal and reduced"
            }
            Self::JointMode => "in which a joint was not running (joint_mode is not 253)",
            Self::Freedrive => "in which the teach button was pressed",
        }
    }
}

/// Mode of a robot that runs, by UR's RTDE guide.
const ROBOT_RUNNING: f64 = 7.0;
/// Safety modes in which it moves as commanded: normal and reduced.
const SAFE: [f64; 2] = [1.0, 2.0];
/// Mode of a joint that runs.
const JOINT_RUNNING: f64 = 253.0;
/// Bit of the teach button in `robot_status_bits`.
const TEACH_BUTTON: u64 = 1 << 2;

/// What a file has, by quantity; rows of `width` numbers each.
#[derive(Debug, Default)]
pub(crate) struct RawLog {
    /// Numbers by quantity; those that only tell of the row are not kept.
    pub values: BTreeMap<Quantity, Vec<f64>>,
    /// Why a row is not used.
    pub cut: Vec<Option<Cut>>,
    /// Line of each row, or its number.
    pub line: Vec<u32>,
    /// Lowest and highest temperature of any joint, degrees C.
    pub temperature_c: Option<[f64; 2]>,
    /// Lowest and highest current of the whole robot, A; none where the log does not say.
    pub robot_current_a: Option<[f64; 2]>,
    /// Lowest and highest voltage of the mains, V.
    pub main_voltage_v: Option<[f64; 2]>,
    /// What was found.
    pub notes: Vec<String>,
    /// Rows in the file.
    pub rows_in_file: usize,
}

/// Widens a range to hold numbers that are finite.
fn widen(range: &mut Option<[f64; 2]>, numbers: &[f64]) {
    for number in numbers.iter().filter(|number| number.is_finite()) {
        let range = range.get_or_insert([*number; 2]);
        *range = [range[0].min(*number), range[1].max(*number)];
    }
}

impl RawLog {
    /// Makes room for what is measured.
    pub fn expect(&mut self, quantities: impl IntoIterator<Item = Quantity>, rows: usize) {
        for quantity in quantities.into_iter().filter(|each| each.is_measured()) {
            let mut values = Vec::new();
            values.reserve_exact(rows * quantity.width());
            self.values.insert(quantity, values);
        }
        self.cut.reserve_exact(rows);
        self.line.reserve_exact(rows);
    }

    /// Adds the numbers of one quantity of the row that is being read.
    pub fn add(&mut self, quantity: Quantity, numbers: &[f64], cut: &mut Option<Cut>) {
        let first = numbers[0];
        let mut because = |reason: Cut| {
            cut.get_or_insert(reason);
        };
        match quantity {
            Quantity::RobotMode if first.is_finite() && first != ROBOT_RUNNING => {
                because(Cut::RobotMode);
            }
            Quantity::SafetyMode if first.is_finite() && !SAFE.contains(&first) => {
                because(Cut::SafetyMode);
            }
            Quantity::JointMode => {
                if numbers
                    .iter()
                    .any(|mode| mode.is_finite() && *mode != JOINT_RUNNING)
                {
                    because(Cut::JointMode);
                }
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "bits, of which the low ones count"
            )]
            Quantity::RobotStatusBits if first as u64 & TEACH_BUTTON != 0 => {
                because(Cut::Freedrive);
            }
            Quantity::Temperature => {
                widen(&mut self.temperature_c, numbers);
            }
            Quantity::RobotCurrent => widen(&mut self.robot_current_a, numbers),
            Quantity::MainVoltage => widen(&mut self.main_voltage_v, numbers),
            _ => {
                if let Some(values) = self.values.get_mut(&quantity) {
                    values.extend_from_slice(numbers);
                }
            }
        }
    }

    /// Ends a row.
    pub(crate) fn end_row(&mut self, line: usize, cut: Option<Cut>) {
        self.cut.push(cut);
        self.line.push(u32::try_from(line).unwrap_or(u32::MAX));
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.cut.len()
    }

    /// Leaves out quantities that are hardly ever finite, and rows in which another one is not.
    pub fn sift(&mut self) {
        let rows = self.rows();
        let cut = &mut self.cut;
        let notes = &mut self.notes;
        self.values.retain(|quantity, values| {
            let width = quantity.width();
            let bad = |row: &usize| !values[row * width..][..width].iter().all(|v| v.is_finite());
            let missing = (0..rows).filter(bad).count();
            let kept = 2 * missing <= rows || matches!(quantity, Quantity::Time);
            if !kept {
                notes.push(format!(
                    "{} is not used: empty or not finite in {missing} of {rows} rows",
                    quantity.name()
                ));
                return false;
            }
            if missing > 0 {
                for row in (0..rows).filter(bad) {
                    cut[row].get_or_insert(Cut::NotFinite);
                }
            }
            true
        });
        let mut reasons: BTreeMap<Cut, (usize, u32)> = BTreeMap::new();
        for (reason, line) in self.cut.iter().zip(&self.line) {
            if let Some(reason) = reason {
                reasons.entry(*reason).or_insert((0, *line)).0 += 1;
            }
        }
        for (reason, (count, line)) in reasons {
            self.notes.push(format!(
                "{count} of {rows} rows left out {}, the first in line {line}",
                reason.words()
            ));
        }
    }
}
