//! The stages' log, for those who look into a bake: off unless `COBAKE_LOG` names a level.

use std::io;

use tracing_subscriber::filter::LevelFilter;

use super::failure::WrongUse;

const VARIABLE: &str = "COBAKE_LOG";

/// Sends the log to stderr where it is asked for.
pub(crate) fn start() -> anyhow::Result<()> {
    let Some(word) = std::env::var_os(VARIABLE) else { return Ok(()) };
    let level: LevelFilter = word
        .to_str()
        .and_then(|word| word.parse().ok())
        .ok_or_else(|| WrongUse(format!("{VARIABLE} must be error, warn, info, debug or trace")))?;
    tracing_subscriber::fmt().with_max_level(level).with_writer(io::stderr).init();
    Ok(())
}
