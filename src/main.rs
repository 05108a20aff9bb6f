//! `cobake`: bakes lightmaps into glTF scenes. A thin shell around [`cli`].

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main("cobake", std::env::args_os().collect())
}
