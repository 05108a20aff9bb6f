//! The command line: the only code that knows clap and terminals.
//!
//! What was typed ([`args`]) becomes what it means (the library's options); a command runs; what went
//! wrong becomes one chain of causes and an exit code ([`failure`]).

mod args;
mod bake;
mod bytes;
mod compare;
mod compare_args;
mod engine;
mod failure;
mod files;
mod inspect;
mod interrupt;
mod log;
mod sidecars;
mod summary;
mod table;
mod terminal;
mod view;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches};

use args::{Cli, Command};

/// Runs the program `name` with `arguments`, the program's path first.
pub(crate) fn main(name: &'static str, arguments: Vec<OsString>) -> ExitCode {
    let parsed = Cli::command()
        .bin_name(name)
        .try_get_matches_from(arguments)
        .and_then(|matches| Cli::from_arg_matches(&matches));
    let cli = match parsed {
        Ok(cli) => cli,
        // Help and version come this way too: on stdout, with exit code 0.
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { failure::WRONG_USE } else { 0 });
        }
    };

    match log::start().and_then(|()| run(cli)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::say(&failure::chain(&error));
            ExitCode::from(failure::exit_code(&error))
        }
    }
}

fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Command::Bake(arguments) => bake::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::View(arguments) => view::run(&arguments),
    }
}
