//! What happened while a program ran on the virtual controller.

use std::fmt::Write;

use needlebench_evaluation::judged::ProgramReport;

use super::quoted;

/// One row for each event: time, line of the program, kind, and what it says.
pub(crate) fn events_csv(program: &ProgramReport) -> String {
    let mut out = String::from("time_s,line,event,text\n");
    for event in &program.events {
        let text = quoted(&event.text);
        let line = event.line.map_or(String::new(), |line| line.to_string());
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{:.6},{},{},{text}", event.time_s, line, event.kind);
    }
    out
}
