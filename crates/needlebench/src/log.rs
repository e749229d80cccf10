//! `--log LEVEL`: logs what is read, decided and skipped, stage by stage, to standard error.
//!
//! Libraries emit `tracing` events; only this module subscribes. Log lines are not part of results; they start with the
//! seconds since the start.

use std::io;

use clap::ValueEnum;
use tracing::Level;
use tracing_subscriber::fmt::time::uptime;

use crate::host;
use crate::output::complain;

/// Log levels. (Documented variants would lengthen the help of every command.)
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogLevel {
    // Events that make results incomplete.
    Error,
    // Failed steps.
    Warn,
    // Stages and decisions.
    Info,
    // Files read and written, notes.
    Debug,
    // Everything.
    Trace,
}

impl From<LogLevel> for Level {
    fn from(level: LogLevel) -> Self {
        match level {
            LogLevel::Error => Self::ERROR,
            LogLevel::Warn => Self::WARN,
            LogLevel::Info => Self::INFO,
            LogLevel::Debug => Self::DEBUG,
            LogLevel::Trace => Self::TRACE,
        }
    }
}

/// Subscribes while the command runs; inside another program, on this thread only.
pub(crate) fn told<T>(level: Option<LogLevel>, run: impl FnOnce() -> T) -> T {
    let Some(level) = level else {
        return run();
    };
    let subscriber = tracing_subscriber::fmt()
        .with_max_level(Level::from(level))
        .with_timer(uptime())
        .with_target(false)
        .with_ansi(false)
        .with_writer(|| Lines)
        .finish();
    if !host::is_hosted() {
        // A subscriber set before, such as by a test in this process, remains.
        let _ = tracing::subscriber::set_global_default(subscriber);
        return run();
    }
    tracing::subscriber::with_default(subscriber, run)
}

/// Whether a subscriber is active: log lines and a progress bar do not share a terminal.
pub(crate) fn is_told() -> bool {
    tracing::enabled!(Level::ERROR)
}

/// Each write is a whole line.
struct Lines;

impl io::Write for Lines {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        complain(String::from_utf8_lossy(line).trim_end());
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
