//! `--log LEVEL`: what was read, decided and skipped, stage by stage, on standard error.
//!
//! Libraries tell it by `tracing`; only here is somebody who listens. Nothing of it gets into results. Lines have the
//! seconds since the start, so that they are no results either.

use std::io;

use clap::ValueEnum;
use tracing::Level;
use tracing_subscriber::fmt::time::uptime;

use crate::host;
use crate::output::complain;

/// How much is told. (Documented variants would make the help of every command a long one.)
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogLevel {
    // What makes results incomplete.
    Error,
    // What could not be done.
    Warn,
    // Stages, and what was decided.
    Info,
    // Files read and written, notes.
    Debug,
    // All of it.
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

/// Listens while the command runs: of another program's, on this thread alone.
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
        // Whoever set one before, such as a test in this process, listens on.
        let _ = tracing::subscriber::set_global_default(subscriber);
        return run();
    }
    tracing::subscriber::with_default(subscriber, run)
}

/// Whether somebody listens: lines and a bar do not share a terminal.
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
