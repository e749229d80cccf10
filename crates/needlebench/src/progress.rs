//! Progress: a bar on a terminal, lines of a log elsewhere.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use needlebench_parallel::Progress;

use crate::host;
use crate::log;
use crate::output::complain;

/// Environment variable that disables progress, for whole jobs.
const SWITCH: &str = "NEEDLEBENCH_PROGRESS";

/// Progress on standard error.
pub(crate) enum TerminalProgress {
    /// A bar, on a terminal.
    Bar(ProgressBar),
    /// Lines, in a log.
    Log(Mutex<Log>),
    /// Forwarded to the host program.
    Told(Arc<dyn Progress + Send + Sync>),
    /// No progress.
    Hidden,
}

impl fmt::Debug for TerminalProgress {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Bar(_) => "Bar",
            Self::Log(_) => "Log",
            Self::Told(_) => "Told",
            Self::Hidden => "Hidden",
        })
    }
}

impl TerminalProgress {
    /// `quiet` disables it, as does `NEEDLEBENCH_PROGRESS=off`.
    pub(crate) fn new(quiet: bool) -> Self {
        if let Some(progress) = host::progress() {
            return Self::Told(progress);
        }
        let off = std::env::var_os(SWITCH).is_some_and(|value| value == "off");
        if quiet || off {
            return Self::Hidden;
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        if bar.is_hidden() || log::is_told() {
            return Self::Log(Mutex::new(Log::new(Instant::now())));
        }
        bar.set_length(0);
        if let Ok(style) =
            ProgressStyle::with_template("{spinner} {msg} [{bar:30}] {pos}/{len} {elapsed}")
        {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(120));
        Self::Bar(bar)
    }

    pub(crate) fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }

    /// Changes the state of the log, and writes a line if one is due.
    fn log(&self, change: impl FnOnce(&mut Log)) {
        if let Self::Log(log) = self {
            let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
            change(&mut log);
            if let Some(line) = log.line(Instant::now()) {
                complain(&line);
            }
        }
    }
}

impl Progress for TerminalProgress {
    fn message(&self, text: &str) {
        if let Self::Told(told) = self {
            told.message(text);
        }
        if let Self::Bar(bar) = self {
            bar.set_message(text.to_owned());
        }
        self.log(|log| text.clone_into(&mut log.message));
    }

    fn notice(&self, text: &str) {
        match self {
            Self::Bar(bar) => bar.suspend(|| complain(text)),
            Self::Log(_) => complain(text),
            Self::Told(told) => told.notice(text),
            Self::Hidden => {}
        }
    }

    fn expect(&self, steps: u64) {
        if let Self::Told(told) = self {
            told.expect(steps);
        }
        if let Self::Bar(bar) = self {
            bar.inc_length(steps);
        }
        self.log(|log| log.total += steps);
    }

    fn at(&self, done: u64, total: u64) {
        if let Self::Told(told) = self {
            told.at(done, total);
        }
        if let Self::Bar(bar) = self {
            bar.set_length(total);
            bar.set_position(done);
        }
        self.log(|log| (log.done, log.total) = (done, total));
    }

    fn step(&self) {
        if let Self::Told(told) = self {
            told.step();
        }
        if let Self::Bar(bar) = self {
            bar.inc(1);
        }
        self.log(|log| log.done += 1);
    }
}

/// State of the log, and the time of its last line.
#[derive(Debug)]
pub(crate) struct Log {
    started: Instant,
    last: Instant,
    message: String,
    done: u64,
    total: u64,
}

/// Least time between two lines; shorter work has none.
const LEAST: Duration = Duration::from_secs(1);
/// Least time between two lines of long work, as a share of its elapsed time.
const SHARE: f64 = 0.05;

impl Log {
    fn new(now: Instant) -> Self {
        Self {
            started: now,
            last: now,
            message: String::new(),
            done: 0,
            total: 0,
        }
    }

    /// The next line, if it is time for one.
    fn line(&mut self, now: Instant) -> Option<String> {
        let elapsed = now - self.started;
        if now - self.last < LEAST.max(elapsed.mul_f64(SHARE)) {
            return None;
        }
        self.last = now;
        let count = match self.total {
            0 => String::new(),
            total if self.done >= total => String::new(),
            total => format!(" {} of {total}", self.done),
        };
        Some(format!("[{} s] {}{count}", elapsed.as_secs(), self.message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_has_a_line_a_second_at_most_and_none_for_short_work() {
        let start = Instant::now();
        let mut log = Log::new(start);
        "simulating".clone_into(&mut log.message);
        (log.done, log.total) = (3, 8);
        let mut lines = Vec::new();
        for tenth in 0..50 {
            lines.extend(log.line(start + Duration::from_millis(100 * tenth)));
        }
        assert_eq!(lines.len(), 4, "{lines:?}");
        assert_eq!(lines[0], "[1 s] simulating 3 of 8");
        assert_eq!(
            Log::new(start).line(start + Duration::from_millis(999)),
            None
        );
    }

    #[test]
    fn an_hour_has_a_hundred_lines_and_not_thousands() {
        let start = Instant::now();
        let mut log = Log::new(start);
        let lines = (0..3600).filter_map(|second| log.line(start + Duration::from_secs(second)));
        assert!((50..150).contains(&lines.count()));
    }
}
