//! Commands that need neither MPI nor a simulation: they read the file of a run, or describe the program.

use super::{CommandLine, Tool, analyze, export, init, render};
use crate::domain::{launch, stdout};
use crate::error::Error;
use crate::scene;
use clap::CommandFactory;

/// Does what `tool` asks for, without MPI; returns the exit code.
///
/// If a launcher has started several processes, only the first of them does anything.
pub fn alone(tool: &Tool) -> i32 {
    if !launch::speaks_first() {
        return 0;
    }
    match run(tool) {
        Ok(()) => 0,
        Err(error) => {
            launch::say(&format!("demhybrid: error: {error}"));
            error.exit_code()
        }
    }
}

fn run(tool: &Tool) -> Result<(), Error> {
    match tool {
        Tool::Analyze(args) => analyze::run(args),
        Tool::Export(args) => export::run(args),
        Tool::Init(args) => init::run(args),
        Tool::Render(args) => render::run(args),
        Tool::Schema => stdout::print(&scene::schema(), ""),
        Tool::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(*shell, &mut CommandLine::command(), "demhybrid", &mut text);
            stdout::print(&String::from_utf8_lossy(&text), "")
        }
        Tool::Man => {
            let mut text = Vec::new();
            let page = clap_mangen::Man::new(CommandLine::command()).render(&mut text);
            page.map_err(|why| Error::Input(format!("the manual page cannot be made: {why}")))?;
            stdout::print(&String::from_utf8_lossy(&text), "")
        }
    }
}
