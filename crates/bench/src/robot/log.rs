//! What happens while a program runs.

use std::collections::BTreeSet;

use needlebench_evaluation::judged::ProgramEvent;
use needlebench_input::printable;

/// Most events that are listed; the others are counted.
const MOST_EVENTS: usize = 1000;

/// Most characters of what a program says.
const MOST_CHARACTERS: usize = 200;

/// Events in their order.
#[derive(Debug, Default)]
pub(super) struct Log {
    pub events: Vec<ProgramEvent>,
    pub more: usize,
    said: BTreeSet<(usize, String)>,
}

impl Log {
    /// Adds an event.
    pub fn add(&mut self, time_s: f64, line: Option<usize>, kind: &'static str, text: &str) {
        if self.events.len() >= MOST_EVENTS {
            self.more += 1;
            return;
        }
        // One line, whatever a program says.
        let text: String = text.chars().take(MOST_CHARACTERS).collect();
        let text = printable(&text).replace(['\n', '\r', '\t'], " ");
        self.events.push(ProgramEvent {
            time_s,
            line,
            kind,
            text,
        });
    }

    /// Adds an event that is listed once for each line and text.
    pub fn add_once(&mut self, time_s: f64, line: usize, kind: &'static str, text: &str) {
        if self.said.len() < MOST_EVENTS && self.said.insert((line, text.to_owned())) {
            self.add(time_s, Some(line), kind, text);
        }
    }
}
