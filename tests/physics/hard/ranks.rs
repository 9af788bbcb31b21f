//! Every hard case with the default method on three ranks: the same outcome, and the same bits, as on one.
//! All cases share one launch: this test starts itself under mpirun.

use super::judge::{faults, run};
use super::scene::{Case, cases};
use crate::mpirun::Job;
use demhybrid::domain::{Comm, Solo, world};

/// Set where this test is one of the ranks.
const RANK: &str = "DEMHYBRID_HARD_CASE_RANK";
/// The name of the test below, as the harness knows it.
const TEST: &str = "hard::ranks::three_ranks_end_as_one_does_to_the_last_bit";
/// Seconds for all cases: many times what they take on two busy cores.
const PATIENCE: u64 = 1200;

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "a build without MPI has one rank")]
fn three_ranks_end_as_one_does_to_the_last_bit() {
    if std::env::var_os(RANK).is_some() {
        return be_a_rank();
    }
    let folder = tempfile::tempdir().unwrap();
    let job = Job::on(3, folder.path(), &["--exact", TEST, "--nocapture", "--test-threads=1"])
        .of(std::env::current_exe().unwrap())
        .with_variable(RANK, "1")
        .with_variable("RAYON_NUM_THREADS", "1")
        .within(PATIENCE)
        .run()
        .with_code(0);
    let told: Vec<&str> = job.stdout.lines().filter_map(|line| line.strip_prefix("case ")).collect();
    let alone: Vec<String> = cases().iter().map(|case| digest(case, &Solo)).collect();
    assert_eq!(told, alone);
}

/// Name and outcome of a case, and a number made of all bits of all frames. Fails where the outcome is wrong.
/// Collective.
fn digest(case: &Case, comm: &dyn Comm) -> String {
    let tale = run(case, "auto", comm);
    let wrong = faults(case, "auto", &tale);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let end = match &tale.result {
        Ok(counts) => format!("{} steps", counts.accepted),
        Err(why) => why.to_string(),
    };
    format!("{} {end} {:016x}", case.name, tale.digest)
}

/// One of the three.
fn be_a_rank() {
    let session = world::start().expect("MPI starts");
    let world = &session.world;
    assert_eq!(world.size(), 3);
    demhybrid::domain::launch::report_panics(world.rank());
    let all = || cases().iter().map(|case| digest(case, world)).collect::<Vec<_>>();
    // A rank that fails alone must not keep the others waiting.
    let Ok(digests) = std::panic::catch_unwind(std::panic::AssertUnwindSafe(all)) else { world.abort(1) };
    if world.rank() == 0 {
        // Set apart from what the harness prints on the same line.
        print!("\n{}", digests.iter().map(|digest| format!("case {digest}\n")).collect::<String>());
    }
}
