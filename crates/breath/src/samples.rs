//! Positions as they were recorded.

use needlebench_input::Finding;

/// Positions of one marker at their times.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// Times, s.
    pub times_s: Vec<f64>,
    /// Coordinates in any frame that does not move, m; the first alone where only one was recorded.
    pub positions_m: Vec<[f64; 3]>,
    /// Only one coordinate was recorded.
    pub is_one_coordinate: bool,
    /// Line of each in the file, or number of its message, from 1; empty where there is no file.
    pub places: Vec<usize>,
    /// Places are numbers of messages.
    pub is_log: bool,
}

impl Samples {
    pub(crate) fn keep(&mut self, kept: &[usize]) {
        self.times_s = kept.iter().map(|&at| self.times_s[at]).collect();
        self.positions_m = kept.iter().map(|&at| self.positions_m[at]).collect();
        if !self.places.is_empty() {
            self.places = kept.iter().map(|&at| self.places[at]).collect();
        }
    }

    /// A finding with the place of a sample.
    pub(crate) fn at(&self, sample: usize, mut finding: Finding) -> Finding {
        match self.places.get(sample) {
            Some(place) if self.is_log => finding.key(format!("message {place}")),
            place => {
                finding.line = place.copied();
                finding
            }
        }
    }
}
