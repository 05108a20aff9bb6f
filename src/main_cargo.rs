//! `cargo cobake`: the same program as `cobake`, as a cargo subcommand.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    // Cargo hands its subcommands their own name as the first argument.
    let mut arguments: Vec<_> = std::env::args_os().collect();
    if arguments.get(1).is_some_and(|first| first == "cobake") {
        arguments.remove(1);
    }
    cli::main("cargo cobake", arguments)
}
