//! The command line: runs a scene, or does what a command asks for.

pub mod accuracy;
mod analyze;
pub mod ensemble;
mod export;
mod init;
mod numbers;
mod region;
mod render;
pub mod report;
pub mod run;
pub mod tools;

use std::sync::LazyLock;

use clap::{Parser, Subcommand};
use clap_complete::Shell;

use crate::domain::world;
pub use accuracy::AccuracyArgs;
pub use analyze::AnalyzeArgs;
pub use ensemble::EnsembleArgs;
pub use export::ExportArgs;
pub use init::InitArgs;
pub use region::RegionArgs;
pub use render::RenderArgs;
pub use run::Args;

/// Simulate spheres that fall, collide, rub, roll and settle.
///
/// Reads a scene (TOML), integrates the motion of its particles with adaptive time steps, and writes frames
/// to one VTKHDF file. ParaView, pyvista and h5py open that file.
///
/// Runs on one core, on threads, or on MPI ranks started by mpirun: the result is the same to the last bit.
#[derive(Debug, Clone, PartialEq, Parser)]
#[command(
    name = "demhybrid",
    version,
    long_version = LONG_VERSION.as_str(),
    after_help = AFTER_HELP,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    disable_help_subcommand = true
)]
pub struct CommandLine {
    #[command(flatten)]
    run: Option<Args>,
    #[command(subcommand)]
    command: Option<Command>,
}

/// The commands beside running a scene.
#[derive(Debug, Clone, PartialEq, Subcommand)]
enum Command {
    Accuracy(Box<AccuracyArgs>),
    Ensemble(Box<EnsembleArgs>),
    #[command(flatten)]
    Tool(Tool),
}

/// The commands that need neither MPI nor a simulation.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum Tool {
    /// Measure a bed and its run: volume fraction, contacts, structure; write tables, figures and a report
    Analyze(Box<AnalyzeArgs>),
    /// Write frames of a run for other programs
    ///
    /// Reads the output file of a run that is finished, stopped or killed. Writes one frame or all of them.
    Export(Box<ExportArgs>),
    /// Write a scene with comments to start from
    ///
    /// Without further options it has every key. With any of --radius, --density, --friction, --overlap,
    /// --box, --count or --ask it is a bed of such spheres that settles, whatever their size.
    Init(Box<InitArgs>),
    #[allow(missing_docs, reason = "its doc would take the place of the help in RenderArgs")]
    Render(Box<RenderArgs>),
    /// Print the JSON schema of scenes, for editors that complete and check TOML
    Schema,
    /// Print the completions of this program for a shell
    Completions {
        /// Shell
        shell: Shell,
    },
    /// Print the manual page, for man -l -
    Man,
}

/// The work that a command line asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Work {
    /// Run a scene.
    Run(Args),
    /// Compare solvers on a scene.
    Accuracy(Box<AccuracyArgs>),
    /// Run scenes from many initial states.
    Ensemble(Box<EnsembleArgs>),
    /// Do something that needs no simulation.
    Tool(Tool),
}

impl CommandLine {
    /// The work that this command line asks for.
    pub fn work(self) -> Work {
        match (self.command, self.run) {
            (Some(Command::Accuracy(args)), _) => Work::Accuracy(args),
            (Some(Command::Ensemble(args)), _) => Work::Ensemble(args),
            (Some(Command::Tool(tool)), _) => Work::Tool(tool),
            (None, run) => Work::Run(run.expect("without a command the scene is required")),
        }
    }
}

/// The text of --version. The text of -V is only the version.
static LONG_VERSION: LazyLock<String> = LazyLock::new(|| {
    let hdf5 = hdf5_sys::HDF5_VERSION;
    format!(
        "{}\ncommit {}\nbuilt {} HDF5 {}.{}.{}",
        env!("CARGO_PKG_VERSION"),
        env!("DEMHYBRID_COMMIT"),
        world::built(),
        hdf5.major,
        hdf5.minor,
        hdf5.micro
    )
});

const AFTER_HELP: &str = "\
Examples:
  demhybrid configs/settle.toml
  demhybrid configs/settle.toml --set particles.grid.count=27 --set t_end=1 -o small.vtkhdf
  mpirun -n 4 demhybrid configs/settle.toml --threads 2 --force
  mpirun -n 2 demhybrid --resume settle.vtkhdf
  demhybrid accuracy configs/quick.toml
  demhybrid ensemble configs/bed.toml --seeds 10 --vary friction.coefficient=0.2,0.345
  demhybrid init my.toml
  demhybrid analyze settle.vtkhdf
  demhybrid export settle.vtkhdf --to csv -o bed.csv
  demhybrid render settle.vtkhdf -o bed.png

A scene whose file has the name of a command, like accuracy, is run by demhybrid ./accuracy.

Exit codes:
  0      done
  2      a mistake found before the first step: scene, particles, command line, output file, \
         or a file that another run is writing
  3      the computation failed: a force that is not finite, a step that cannot be made
  4      the output could not be written, or the summary not be printed
  5      stopped on request, by SIGTERM, SIGINT, SIGUSR1, SIGHUP, limits.wall or the file OUTPUT.stop, \
         with a checkpoint
  70     an internal error
  128+N  killed by signal N

The summary goes to stdout; progress and warnings go to stderr.";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::MethodName;
    use clap::CommandFactory;
    use std::path::PathBuf;

    fn parse(line: &str) -> Result<Args, clap::Error> {
        match CommandLine::try_parse_from(line.split_whitespace())?.work() {
            Work::Run(args) => Ok(args),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_definition_is_consistent() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn every_option_is_read() {
        let args =
            parse("demhybrid a.toml -o b.vtkhdf --threads 2 --set a.b=1 --set c=-2 --dry-run --force -v")
                .unwrap();
        assert_eq!(
            (args.scene, args.output, args.threads),
            (Some("a.toml".into()), Some("b.vtkhdf".into()), Some(2))
        );
        assert_eq!(args.set, ["a.b=1", "c=-2"]);
        assert_eq!((args.dry_run, args.force, args.quiet, args.verbose), (true, true, false, true));
    }

    #[test]
    fn a_run_is_taken_up_without_a_scene() {
        let args = parse("demhybrid --resume a.vtkhdf --threads 2 --set t_end=9 -q").unwrap();
        assert_eq!((args.scene, args.resume), (None, Some("a.vtkhdf".into())));
    }

    #[test]
    fn accuracy_is_a_command_and_a_path_to_a_file_of_that_name_a_scene() {
        let line = "demhybrid accuracy a.toml --methods merson,auto --tolerances 1e-1,1e-2 --seeds 3 -q";
        let line = CommandLine::try_parse_from(line.split_whitespace()).unwrap();
        let Work::Accuracy(args) = line.work() else { panic!("not a run") };
        assert_eq!(args.scene, PathBuf::from("a.toml"));
        assert_eq!((args.methods, args.seeds), (vec![MethodName::Merson, MethodName::Auto], 3));
        assert_eq!((args.tolerances, args.quiet), (vec![1e-1, 1e-2], true));
        assert_eq!(parse("demhybrid ./accuracy").unwrap().scene, Some(PathBuf::from("./accuracy")));
        for (line, parts) in [
            ("demhybrid accuracy", vec!["<SCENE>"]),
            ("demhybrid accuracy a.toml --methods euler", vec!["'euler'", "--methods", "merson"]),
            ("demhybrid accuracy a.toml --tolerances 1e-1,0", vec!["'0'", "--tolerances", "greater than 0"]),
            ("demhybrid accuracy a.toml --steps inf", vec!["'inf'", "--steps", "finite"]),
            ("demhybrid accuracy a.toml --time x", vec!["'x'", "--time", "number"]),
            ("demhybrid accuracy a.toml --seeds 0", vec!["0", "--seeds"]),
            ("demhybrid accuracy a.toml --studies speed", vec!["'speed'", "--studies", "ensemble"]),
            ("demhybrid accuracy a.toml --sweep contact", vec!["'contact'", "--sweep", "KEY=V1,V2"]),
            ("demhybrid accuracy a.toml --sweep solver.norm=paper", vec!["--sweep", "no part of the model"]),
        ] {
            let mistake = CommandLine::try_parse_from(line.split_whitespace()).unwrap_err();
            assert_eq!(mistake.exit_code(), 2, "{line}");
            let text = mistake.to_string();
            assert!(parts.iter().all(|part| text.contains(part)), "{line}: {text}");
        }
    }

    #[test]
    fn mistakes_on_the_command_line_end_with_code_2() {
        for line in [
            "demhybrid",
            "demhybrid a.toml b.toml",
            "demhybrid a.toml --threads 0",
            "demhybrid a.toml --threads x",
            "demhybrid a.toml -q -v",
            "demhybrid a.toml --set",
            "demhybrid a.toml --unknown",
            "demhybrid --resume",
            "demhybrid a.toml --resume a.vtkhdf",
            "demhybrid --resume a.vtkhdf -o b.vtkhdf",
            "demhybrid --resume a.vtkhdf --force",
        ] {
            assert_eq!(parse(line).unwrap_err().exit_code(), 2, "{line}");
        }
        assert_eq!(parse("demhybrid --help").unwrap_err().exit_code(), 0);
        assert_eq!(parse("demhybrid --version").unwrap_err().exit_code(), 0);
    }
}
