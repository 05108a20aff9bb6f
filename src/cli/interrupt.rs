//! Ctrl-C: the first asks the bake to stop and clean up, the second stops at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;

use super::failure::CANCELLED;

/// Watches for Ctrl-C, SIGTERM and SIGHUP; the flag turns true at the first.
pub(crate) fn watch() -> anyhow::Result<Arc<AtomicBool>> {
    let asked = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&asked);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(CANCELLED));
        }
    })
    .context("cannot watch for Ctrl-C")?;
    Ok(asked)
}
