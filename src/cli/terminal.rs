//! What a person sees on stderr while a bake runs, and what a command answers on stdout.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use cobake::progress::{Progress, Stage};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::interrupt::Interrupt;

/// Steps of a stage's bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

const TEMPLATE: &str = "{prefix:>13} [{bar:32}] {percent:>3} %  {eta} left";

/// Writes `line` to stderr. A closed stderr is no reason to fail.
pub(crate) fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Writes `text`, a command's answer, to stdout. A reader that went away is no reason to fail.
pub(crate) fn answer(text: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// Whether a person is watching.
pub(crate) fn is_watched() -> bool {
    io::stderr().is_terminal()
}

/// How much is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Voice {
    /// Progress where a person is watching, and warnings.
    Normal,
    /// Nothing.
    Quiet,
}

/// A bar for the current stage where stderr is a terminal, warnings as lines, and the wish to stop.
pub(crate) struct TerminalProgress {
    bar: ProgressBar,
    voice: Voice,
    interrupt: Interrupt,
}

impl TerminalProgress {
    /// Draws nothing until the first stage begins. `interrupt` cancels the bake.
    pub(crate) fn new(voice: Voice, interrupt: Interrupt) -> Self {
        let target = match voice {
            Voice::Normal if is_watched() => ProgressDrawTarget::stderr(),
            _ => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style.progress_chars("=> "));
        }
        Self { bar, voice, interrupt }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for TerminalProgress {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Progress for TerminalProgress {
    fn begin(&mut self, stage: Stage) {
        self.bar.set_prefix(stage.name());
        self.bar.reset();
        if !self.bar.is_hidden() {
            self.bar.enable_steady_tick(Duration::from_millis(200));
        }
    }

    fn advance(&mut self, fraction: f64) {
        // A cast from floating point saturates, and takes NaN to 0.
        self.bar.set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }

    fn warn(&mut self, message: &str) {
        if self.voice == Voice::Normal {
            self.bar.suspend(|| say(&format!("warning: {message}")));
        }
    }

    fn is_cancelled(&self) -> bool {
        self.interrupt.is_asked()
    }
}
