//! The program: starts MPI if it is built with it, runs the command, and ends with an exit code.

use clap::Parser;
use demhybrid::cli::{CommandLine, Work, accuracy, ensemble, run, tools};
use demhybrid::domain::{Comm, launch, stdout, world};
use demhybrid::error::Error;
use demhybrid::threads::huge_pages::HugePages;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

/// Exit code of an internal error.
const INTERNAL: i32 = 70;

fn main() {
    let work = CommandLine::try_parse().map(CommandLine::work).unwrap_or_else(|message| {
        // Help and mistakes on the command line need no MPI. One rank prints them.
        match launch::speaks_first() {
            // A single write: mpirun may insert its own text between two writes.
            true if message.use_stderr() => launch::say(&message.to_string()),
            true => {
                if let Err(error) = stdout::print_by(|| message.print(), "") {
                    launch::say(&format!("demhybrid: error: {error}"));
                    std::process::exit(error.exit_code())
                }
            }
            false => {}
        }
        std::process::exit(message.exit_code())
    });
    if let Work::Tool(tool) = &work {
        std::process::exit(tools::alone(tool))
    }
    let faults = fail::FailScenario::setup();
    let session = world::start().unwrap_or_else(|why| {
        launch::say(&format!("demhybrid: {why}"));
        std::process::exit(INTERNAL)
    });
    let world = &session.world;
    launch::report_panics(world.rank());
    let outcome = catch_unwind(AssertUnwindSafe(|| match &work {
        Work::Run(args) => run::run(args, world),
        Work::Accuracy(args) => accuracy::run(args, world),
        Work::Ensemble(args) => ensemble::run(args, world),
        Work::Tool(_) => unreachable!("tools work without MPI"),
    }));
    let code = match outcome {
        Ok(Ok(())) => 0,
        Ok(Err(error)) => end(world, &error),
        Err(_) => world.abort(INTERNAL),
    };
    session.end();
    drop(faults);
    std::process::exit(code)
}

/// Prints an error and returns the exit code of the program.
///
/// All ranks know every error except [`Error::Output`]. Rank 0 prints it, unless another rank has printed it
/// already ([`Error::Elsewhere`]). Then all ranks exit together.
///
/// An output error may have happened on one rank only, so no collective call may follow it. It aborts the
/// job. The other ranks wait a moment before they print, so that rank 0 prints first if it has the error too.
fn end(world: &dyn Comm, error: &Error) -> i32 {
    let message = match error {
        Error::Stopped { .. } => format!("demhybrid: {error}"),
        _ => format!("demhybrid: error: {error}"),
    };
    if let Error::Output { .. } = error {
        if world.rank() > 0 {
            std::thread::sleep(Duration::from_millis(500));
        }
        launch::say(&message);
        world.abort(error.exit_code())
    }
    if world.rank() == 0 && !matches!(error, Error::Elsewhere { .. }) {
        launch::say(&message);
    }
    error.exit_code()
}
