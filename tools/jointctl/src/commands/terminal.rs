//! Progress of a command on a terminal.

use identification::progress::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::time::{Duration, Instant};

/// A line on standard error that says what is being done and for how long; without a terminal, a line for each stage.
pub struct Terminal {
    bar: ProgressBar,
    start: Instant,
}

impl Terminal {
    /// Starts to show progress.
    pub fn new() -> Self {
        let bar = ProgressBar::new_spinner();
        let style = ProgressStyle::with_template("{spinner} {prefix:.bold} {wide_msg} {elapsed}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar, start: Instant::now() }
    }

    /// Ends the display.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Default for Terminal {
    fn default() -> Self {
        Self::new()
    }
}

impl Progress for Terminal {
    fn stage(&self, name: &str) {
        self.bar.set_prefix(name.to_owned());
        self.bar.set_message(String::new());
        if self.bar.is_hidden() {
            eprintln!("{:6.1} s  {name}", self.start.elapsed().as_secs_f64());
        }
    }

    fn detail(&self, text: &str) {
        self.bar.set_message(text.to_owned());
    }
}
