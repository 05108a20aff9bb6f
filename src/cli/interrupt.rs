//! Ctrl-C: the first asks the bake to stop and ends the program if it does not soon, the second stops at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use cobake::error::Error;

use super::failure::CANCELLED;
use super::terminal::say;

/// How long the bake may take to notice. Until results are written, there is nothing to clean up.
const GRACE: Duration = Duration::from_secs(1);

/// What the program and its watch for Ctrl-C tell each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interrupt {
    asked: Arc<AtomicBool>,
    writing: Arc<AtomicBool>,
}

impl Interrupt {
    /// Watches for Ctrl-C, SIGTERM and SIGHUP.
    pub(crate) fn watch() -> anyhow::Result<Self> {
        let interrupt = Self::default();
        let watched = interrupt.clone();
        ctrlc::set_handler(move || watched.happened()).context("cannot watch for Ctrl-C")?;
        Ok(interrupt)
    }

    /// Whether someone wants the program to stop.
    pub(crate) fn is_asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// Results are about to be written, which only a second Ctrl-C cuts short. False if someone asked
    /// to stop before.
    pub(crate) fn begin_writing(&self) -> bool {
        self.writing.store(true, Ordering::SeqCst);
        !self.is_asked()
    }

    fn happened(&self) {
        let is_first = !self.asked.swap(true, Ordering::SeqCst);
        if is_first {
            std::thread::sleep(GRACE);
            if self.writing.load(Ordering::SeqCst) {
                return;
            }
            say(&Error::Cancelled.to_string());
        }
        std::process::exit(i32::from(CANCELLED));
    }
}
