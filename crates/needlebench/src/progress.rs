//! Progress on a terminal; silence elsewhere.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use needlebench_bench::progress::Progress;

use crate::output::complain;

/// A progress bar on standard error, if that is a terminal.
#[derive(Debug, Clone)]
pub(crate) struct TerminalProgress(ProgressBar);

impl TerminalProgress {
    /// `quiet` hides it everywhere.
    pub(crate) fn new(quiet: bool) -> Self {
        let bar = ProgressBar::new(0);
        bar.set_draw_target(if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr() // draws nothing unless it is a terminal
        });
        if let Ok(style) =
            ProgressStyle::with_template("{spinner} {msg} [{bar:30}] {pos}/{len} {elapsed}")
        {
            bar.set_style(style.progress_chars("=> "));
        }
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(120));
        }
        Self(bar)
    }

    pub(crate) fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Progress for TerminalProgress {
    fn message(&self, text: &str) {
        self.0.set_message(text.to_owned());
    }

    fn notice(&self, text: &str) {
        self.0.suspend(|| complain(text));
    }

    fn expect(&self, steps: u64) {
        self.0.inc_length(steps);
    }

    fn at(&self, done: u64, total: u64) {
        self.0.set_length(total);
        self.0.set_position(done);
    }

    fn step(&self) {
        self.0.inc(1);
    }
}
