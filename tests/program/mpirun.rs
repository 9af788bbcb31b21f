//! Starts the real program, alone or under mpirun, and never waits longer than a test allows.

#![allow(dead_code)] // every test file uses a part

use rustix::process::{Pid, Signal, kill_process};
use std::fs::{self, File};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::NamedTempFile;

/// The program as `cargo test` built it, with its fail points.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_demhybrid");
/// The root of the package.
pub const PACKAGE: &str = env!("CARGO_MANIFEST_DIR");

/// Seconds that a job may take unless its test says otherwise: generous, for machines that do other things as
/// well.
const DEADLINE: u64 = 90;
/// How often a running job is looked at.
const GLANCE: Duration = Duration::from_millis(5);

/// What launch/env.sh sets, and a kinder way to wait: where other work shares the cores, ranks that spin keep
/// the rank they wait for from running.
pub const OPEN_MPI: [(&str, &str); 5] = [
    ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
    ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
    ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
    ("OMPI_MCA_hwloc_base_binding_policy", "none"),
    ("OMPI_MCA_mpi_yield_when_idle", "1"),
];

/// One job at a time: two would share the cores and the patience of the tests.
static MACHINE: Mutex<()> = Mutex::new(());

/// A command line of the program that has not been started.
pub struct Job {
    shell: bool,
    program: PathBuf,
    ranks: Option<usize>,
    folder: PathBuf,
    arguments: Vec<String>,
    environment: Vec<(String, String)>,
    of_rank: Option<(usize, String, String)>,
    deadline: Duration,
}

impl Job {
    fn new(ranks: Option<usize>, folder: &Path, arguments: &[&str]) -> Self {
        Job {
            shell: false,
            program: PROGRAM.into(),
            ranks,
            folder: folder.to_path_buf(),
            arguments: arguments.iter().map(ToString::to_string).collect(),
            environment: Vec::new(),
            of_rank: None,
            deadline: Duration::from_secs(DEADLINE),
        }
    }

    /// Without mpirun, in `folder`.
    pub fn alone(folder: &Path, arguments: &[&str]) -> Self {
        Job::new(None, folder, arguments)
    }

    /// Under mpirun, in `folder`; alone where the program is built without MPI, whose answer is the same.
    pub fn on(ranks: usize, folder: &Path, arguments: &[&str]) -> Self {
        Job::new(cfg!(feature = "mpi").then_some(ranks), folder, arguments)
    }

    /// A shell that may mount file systems nobody else sees, in `folder`; `$PROGRAM` is the program.
    pub fn shell(folder: &Path, script: &str) -> Self {
        Job { shell: true, ..Job::new(None, folder, &[script]) }
    }

    /// Another program than ours.
    pub fn of(self, program: PathBuf) -> Self {
        Job { program, ..self }
    }

    /// The seconds that it may take.
    pub fn within(self, seconds: u64) -> Self {
        Job { deadline: Duration::from_secs(seconds), ..self }
    }

    /// More arguments.
    pub fn and(mut self, arguments: &[&str]) -> Self {
        self.arguments.extend(arguments.iter().map(ToString::to_string));
        self
    }

    /// A variable of every rank.
    pub fn with_variable(mut self, name: &str, value: &str) -> Self {
        self.environment.push((name.into(), value.into()));
        self
    }

    /// Fail points (`NAME=ACTIONS`) of one rank.
    pub fn with_fault(self, rank: usize, points: &str) -> Self {
        self.with_variable_of(rank, "FAILPOINTS", points)
    }

    /// A variable of one rank, or of the only one.
    pub fn with_variable_of(mut self, rank: usize, name: &str, value: &str) -> Self {
        if self.ranks.is_none() {
            return self.with_variable(name, value);
        }
        self.of_rank = Some((rank, name.into(), value.into()));
        self
    }

    fn command(&self) -> Command {
        if self.shell {
            let mut command = Command::new("unshare");
            command.args(["-m", "sh", "-c"]).args(&self.arguments).env("PROGRAM", PROGRAM);
            return command;
        }
        let Some(ranks) = self.ranks else {
            let mut command = Command::new(&self.program);
            command.args(&self.arguments);
            return command;
        };
        let mut command = Command::new("mpirun");
        let Some((rank, name, value)) = &self.of_rank else {
            command.args(["-n", &ranks.to_string()]).arg(&self.program).args(&self.arguments);
            return command;
        };
        // Several programs, one a rank, that differ in their environment only.
        for r in 0..ranks {
            if r > 0 {
                command.arg(":");
            }
            command.args(["-n", "1"]);
            if r == *rank {
                command.args(["-x", &format!("{name}={value}")]);
            }
            command.arg(&self.program).args(&self.arguments);
        }
        command
    }

    /// Starts the job and does not wait.
    pub fn start(self) -> Running {
        let machine = MACHINE.lock().unwrap_or_else(PoisonError::into_inner);
        self.start_with(Some(machine))
    }

    /// Starts the job beside one that is at work, which has the machine.
    pub fn start_beside(self, _other: &Running) -> Running {
        self.start_with(None)
    }

    fn start_with(self, machine: Option<MutexGuard<'static, ()>>) -> Running {
        // Files, not pipes: whoever survives of a broken job keeps nobody waiting.
        let [out, err] = [(); 2].map(|()| NamedTempFile::new().unwrap());
        let append = |file: &NamedTempFile| File::options().append(true).open(file.path()).unwrap();
        let mut command = self.command();
        command
            .current_dir(&self.folder)
            .env_remove("FAILPOINTS")
            .env_remove("RAYON_NUM_THREADS")
            .envs(OPEN_MPI)
            .envs(self.environment.iter().map(|(name, value)| (name, value)))
            .stdin(Stdio::null())
            .stdout(append(&out))
            .stderr(append(&err))
            .process_group(0);
        let child = command.spawn().unwrap_or_else(|why| panic!("{command:?} does not start: {why}"));
        let started = Instant::now();
        Running { child, out, err, started, patience: Patience::of(self.deadline), _machine: machine }
    }

    /// Runs the job to its end.
    pub fn run(self) -> Ended {
        self.start().end()
    }
}

/// A job at work. Dropped early, it is killed.
pub struct Running {
    child: Child,
    out: NamedTempFile,
    err: NamedTempFile,
    started: Instant,
    patience: Patience,
    _machine: Option<MutexGuard<'static, ()>>,
}

impl Running {
    /// What it has said on stderr so far.
    pub fn stderr(&self) -> String {
        text(&self.err)
    }

    /// Waits until stderr satisfies `enough`. The job must live to say it.
    pub fn wait_for(&mut self, what: &str, enough: impl Fn(&str) -> bool) {
        loop {
            if enough(&self.stderr()) {
                return;
            }
            let ended = self.child.try_wait().unwrap();
            // What it said last may have come after the look.
            if ended.is_some() && !enough(&self.stderr()) {
                panic!("the job ended without {what}:\n{}", self.stderr());
            }
            self.give_up_late(what);
            sleep(GLANCE);
        }
    }

    /// Waits until the progress tells of that many frames. A line comes after its frame is in the file.
    pub fn wait_for_frames(&mut self, frames: usize) {
        self.wait_for(&format!("{frames} frames"), |text| progress_lines(text) >= frames);
    }

    /// From now on the job has so much time to end.
    pub fn must_end_within(&mut self, seconds: u64) {
        self.patience = Patience::of(Duration::from_secs(seconds));
    }

    /// The process of a job without mpirun.
    pub fn process(&self) -> u32 {
        self.child.id()
    }

    /// The process of `rank`: the child of mpirun whose environment says so, or the only one in a build
    /// without MPI.
    pub fn process_of(&self, rank: usize) -> u32 {
        if !cfg!(feature = "mpi") {
            return self.process();
        }
        let mark = format!("OMPI_COMM_WORLD_RANK={rank}");
        let is_rank = |pid: &u32| {
            let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            environment.split(|&byte| byte == 0).any(|entry| entry == mark.as_bytes())
        };
        let found: Vec<u32> = children(self.child.id()).into_iter().filter(is_rank).collect();
        assert_eq!(found.len(), 1, "processes with {mark} under mpirun: {found:?}");
        found[0]
    }

    /// Waits for the end of the job; kills it and fails at the deadline.
    pub fn end(mut self) -> Ended {
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                let code = code(status);
                return Ended {
                    code,
                    stdout: text(&self.out),
                    stderr: text(&self.err),
                    took: self.started.elapsed(),
                };
            }
            self.give_up_late("an end");
            sleep(GLANCE);
        }
    }

    fn give_up_late(&mut self, what: &str) {
        if !self.patience.is_over() {
            return;
        }
        let (out, err) = (text(&self.out), text(&self.err));
        self.kill_all();
        panic!("the job waited too long for {what}\nstdout:\n{out}\nstderr:\n{err}");
    }

    /// Ranks are in process groups of their own, so mpirun's group is not enough: all its descendants.
    fn kill_all(&mut self) {
        let mut family = vec![self.child.id()];
        let mut next = 0;
        while next < family.len() {
            family.extend(children(family[next]));
            next += 1;
        }
        family.into_iter().for_each(kill);
        let _ = self.child.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if !matches!(self.child.try_wait(), Ok(Some(_))) {
            self.kill_all();
        }
    }
}

/// How long a test still waits. Time in which the whole test stood still, because the machine slept or its
/// control group was frozen, does not count: the job stood still as well.
struct Patience {
    left: Duration,
    looked: Instant,
}

impl Patience {
    /// Longer than any wait of a test that runs.
    const STOOD_STILL: Duration = Duration::from_secs(2);

    fn of(left: Duration) -> Self {
        Patience { left, looked: Instant::now() }
    }

    /// To be asked again and again, every `GLANCE`.
    fn is_over(&mut self) -> bool {
        let now = Instant::now();
        let passed = now - std::mem::replace(&mut self.looked, now);
        if passed < Self::STOOD_STILL {
            self.left = self.left.saturating_sub(passed);
        }
        self.left.is_zero()
    }
}

/// A job that is over.
#[derive(Debug)]
pub struct Ended {
    /// Exit code; 128 + n after signal n.
    pub code: i32,
    /// All it printed.
    pub stdout: String,
    /// All it complained of.
    pub stderr: String,
    /// From start to end.
    pub took: Duration,
}

impl Ended {
    /// Insists on an exit code.
    #[track_caller]
    pub fn with_code(self, code: i32) -> Self {
        assert_eq!(self.code, code, "exit code; stdout:\n{}\nstderr:\n{}", self.stdout, self.stderr);
        self
    }

    /// The program's error messages; mpirun's own lines are none of them.
    pub fn errors(&self) -> Vec<&str> {
        let ours = |line: &&str| {
            line.starts_with("demhybrid: error")
                || line.starts_with("demhybrid: internal error")
                || line.starts_with("error:")
        };
        self.stderr.lines().filter(ours).collect()
    }

    /// The only error message, which must contain all of `parts`.
    #[track_caller]
    pub fn only_error(&self, parts: &[&str]) -> &str {
        let errors = self.errors();
        assert_eq!(errors.len(), 1, "one message is enough:\n{}", self.stderr);
        for part in parts {
            assert!(self.stderr.contains(part), "nothing of {part:?} in\n{}", self.stderr);
        }
        errors[0]
    }

    /// A line of stdout by its first word or words, such as `output` of the summary.
    #[track_caller]
    pub fn line(&self, head: &str) -> &str {
        let line = self.stdout.lines().find(|line| line.trim_start().starts_with(head));
        line.unwrap_or_else(|| panic!("no line {head:?} in\n{}", self.stdout)).trim()
    }
}

/// Lines of progress, one a frame.
pub fn progress_lines(stderr: &str) -> usize {
    stderr.lines().filter(|line| line.starts_with("t = ")).count()
}

/// Ends a process at once; it may have ended by itself.
pub fn kill(pid: u32) {
    signal(pid, Signal::KILL);
}

/// Sends a signal to a process; it may have ended by itself.
pub fn signal(pid: u32, number: Signal) {
    if let Some(pid) = Pid::from_raw(pid as i32) {
        let _ = kill_process(pid, number);
    }
}

/// Sends a signal to what was started: the program, or mpirun.
pub fn signal_job(job: &Running, number: Signal) {
    signal(job.child.id(), number);
}

fn children(parent: u32) -> Vec<u32> {
    let is_child = |pid: &u32| {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        // After the name in parentheses, which may hold anything: state, then parent.
        let parent_of =
            stat.rsplit_once(')').and_then(|(_, rest)| rest.split_whitespace().nth(1)?.parse().ok());
        parent_of == Some(parent)
    };
    let processes =
        fs::read_dir("/proc").unwrap().filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    processes.filter(is_child).collect()
}

fn code(status: ExitStatus) -> i32 {
    status.code().or_else(|| Some(128 + status.signal()?)).expect("it ended by itself or by a signal")
}

/// What has been written to a file that others may still write to.
fn text(file: &NamedTempFile) -> String {
    String::from_utf8_lossy(&fs::read(file.path()).unwrap()).into_owned()
}
