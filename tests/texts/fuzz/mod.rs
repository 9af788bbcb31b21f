//! Fuzzing of what users write: scenes, `--set` options and particle files, by mutation of good and bad ones,
//! by words of the language in any order, by known keys with any values, and by noise.
//!
//! Whatever comes, the answer is a run or one message of a bounded length: no panic, no hang, no memory
//! beyond a bound, and a scene that is accepted is read back the same from its resolved text. Scenes of few
//! particles take their first steps as well.
//!
//! A plain `cargo test` takes a fixed number of cases from a fixed seed. FUZZ_SECONDS makes each of the
//! campaigns last so many seconds, FUZZ_SEED starts elsewhere; launch/test-long.sh does both.

mod cases;
mod outcome;

use cases::{Corpus, edited, particle_files, scenes, settings, words};
use outcome::{Judge, Tally};
use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestRng, TestRunner};
use std::cell::{Cell, RefCell};
use std::io::Write;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Seconds after which a case hangs. Cases take milliseconds; machines may be busy.
const HANG: Duration = Duration::from_secs(120);
/// Cases between looks at the clock; each batch has a seed of its own.
const BATCH: u32 = 50;

/// A whole number from the environment.
fn variable(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name} = {text} is not a whole number")))
}

/// Ends the process where a case does not end: nothing else can stop it.
fn watchdog(name: &str, case: &Mutex<String>, beats: &Receiver<()>) {
    loop {
        match beats.recv_timeout(HANG) {
            Ok(()) => {}
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {
                let case = case.lock().map(|case| case.clone()).unwrap_or_default();
                let _ = writeln!(std::io::stderr(), "{name}: a case hangs: {case}");
                std::process::exit(1);
            }
        }
    }
}

/// Judges at least `cases` cases, or as many as FUZZ_SECONDS allow, and tells how many there were.
fn campaign<S: Strategy>(
    name: &str,
    cases: u64,
    strategy: &S,
    judge: impl Fn(&S::Value) -> Result<Tally, String>,
) -> Tally {
    let (seconds, first) = (variable("FUZZ_SECONDS"), variable("FUZZ_SEED").unwrap_or(1));
    let started = Instant::now();
    let (tally, slowest) = (Cell::new(Tally::default()), RefCell::new((Duration::ZERO, String::new())));
    let (beat, beats) = channel();
    let case = Arc::new(Mutex::new(String::new()));
    let watchdog = {
        let (name, case) = (name.to_owned(), case.clone());
        std::thread::spawn(move || watchdog(&name, &case, &beats))
    };
    let enough = |seed: u64| match seconds {
        Some(seconds) => started.elapsed() >= Duration::from_secs(seconds),
        None => (seed - first) * u64::from(BATCH) >= cases,
    };
    let mut seed = first;
    while !enough(seed) {
        let config =
            Config { cases: BATCH, failure_persistence: None, max_shrink_iters: 2000, ..Config::default() };
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &bytes));
        let outcome = runner.run(strategy, |value| {
            let described = format!("FUZZ_SEED={seed} {value:?}");
            case.lock().expect("the watchdog does not panic").clone_from(&described);
            let clock = Instant::now();
            let found = judge(&value);
            let took = clock.elapsed();
            if took > slowest.borrow().0 {
                slowest.replace((took, described));
            }
            beat.send(()).expect("the watchdog lives as long as there are cases");
            tally.set(tally.get() + found.map_err(TestCaseError::fail)?);
            Ok(())
        });
        if let Err(why) = outcome {
            panic!("{name}: FUZZ_SEED={seed} shows it again: {why}");
        }
        seed += 1;
    }
    drop(beat);
    watchdog.join().expect("the watchdog ends with the campaign");
    let (took, slow) = slowest.into_inner();
    let Tally { cases, accepted, refused, advanced, remembered, failed } = tally.get();
    // Not println: the test runner would hide it.
    let _ = writeln!(
        std::io::stderr(),
        "fuzz: {name}: {cases} executions from seed {first} in {:.1} s: {accepted} accepted, {refused} refused, {advanced} \
         took steps ({remembered} with memory), {failed} of them ended by a numerical message; 0 panics, 0 hangs, slowest {:.0} ms: {}",
        started.elapsed().as_secs_f64(),
        took.as_secs_f64() * 1e3,
        slow.chars().take(300).collect::<String>()
    );
    // A campaign that only ever sees one side finds little.
    assert!(refused > 0, "{name} had nothing refused");
    tally.get()
}

#[test]
fn noise_and_words_of_the_language_are_scenes_or_messages() {
    let judge = Judge::new();
    campaign("noise as scenes", 20_000, &words(), |text| judge.scene(text.as_bytes(), &[]));
}

#[test]
fn mutated_scenes_are_scenes_or_messages() {
    let (judge, corpus) = (Judge::new(), Corpus::scenes());
    let tally =
        campaign("mutated scenes", 4000, &scenes(&corpus), |case| judge.scene(&edited(&corpus, case), &[]));
    assert!(tally.remembered > 0, "no contact remembered anything");
}

#[test]
fn known_keys_with_any_values_are_scenes_or_messages() {
    let judge = Judge::new();
    let tally =
        campaign("any values", 10_000, &settings(), |case| judge.scene(case.text().as_bytes(), &case.sets()));
    assert!(tally.remembered > 0, "no contact remembered anything");
}

#[test]
fn particle_files_are_particles_or_messages() {
    let (judge, corpus) = (Judge::new(), Corpus::particle_files());
    let strategy = particle_files(&corpus);
    campaign("particle files", 5000, &strategy, |case| judge.particle_file(&edited(&corpus, case)));
}

#[test]
fn depth_and_length_are_no_way_to_break_the_readers() {
    let judge = Judge::new();
    let good = include_str!("../../scenes/good/required-keys-only.toml");
    let long = |part: &str, n: usize| part.repeat(n);
    for n in [100, 10_000, 200_000] {
        for text in [
            format!("{good}\nx = {}", long("[", n)),
            format!("{good}\nx = {}{}", long("[", n), long("]", n)),
            format!("{good}\nx = {}1{}", long("{a=", n), long("}", n)),
            // Stray brackets make toml_parser 1.1.5 lose count of its depth.
            long("x = { a = [0], b.0, -9.81]\n", n),
            format!("{good}\nx = [{}", long("{ a = [0], b.0, -9.81], ", n)),
            format!("{good}\nx = {}", long("{ a = 1 ], b = ", n)),
            format!("{good}\nx = {}", long("[ 1 } ", n)),
            format!("{good}\n{}b = 1", long("a.", n)),
            format!("{good}\n[{}b]\nc = 1", long("a.", n)),
            format!("{good}\n[[{}b]]\nc = 1", long("a.", n)),
            format!("{good}\n{} = 1", long("k", n)),
            format!("{good}\n\"{}\" = 1", long("\\u0001\\n", n)),
            format!("{good}\nx = \"{}\"", long("y", n)),
            format!("t_end = {}\n{good}", long("9", n)),
            format!("t_end = 0.{}1\n{good}", long("0", n)),
            format!("t_end = [{}]\n{good}", long("1,", n)),
            format!("{}\n{good}", long("#", n)),
            format!("{good}\n[output]\nfile = \"{}\"", long("f", n)),
            good.replacen("start.csv", &long("../", n), 1),
        ] {
            if let Err(why) = judge.scene(text.as_bytes(), &[]) {
                panic!("{n} times, {}...: {why}", text.chars().take(200).collect::<String>());
            }
        }
        for set in [
            format!("{}b=1", long("a.", n)),
            format!("{}=1", long("k", n)),
            format!("t_end={}", long("[", n)),
            format!("t_end={}", long("9", n)),
            format!("t_end={}1{}", long("{a=", n), long("}", n)),
            format!("t_end={}", long("{ a = 1 ], b = ", n)),
            format!("t_end=[{}", long("{ a = [0], b.0, -9.81], ", n)),
            format!("contact.x={}", long("y", n)),
            long("\u{1}", n),
        ] {
            if let Err(why) = judge.scene(good.as_bytes(), &[set]) {
                panic!("{n} times: {why}");
            }
        }
        for text in [
            format!("x,y,z\n{}", long("0.5,0.5,0.5\n", n)),
            format!("x,y,z{}\n", long(",c", n)),
            format!("x,y,z{}\n1,2,3\n", long(",c", n)),
            format!("x,y,z,{}\n1,2\n", long("c", n)),
            format!("{},y,z\n", long("x", n)),
            format!("x,y,x,{}\n", long("x,", n)),
            format!("x,y,z\n{}", long("\"", n)),
            format!("x,y,z\n\"{}", long("\n", n)),
            format!("x,y,z\n1,2,{}", long("9", n)),
            format!("x,y,z\n1,2,{}", long("q", n)),
            long(",", n),
            long("\r", n),
        ] {
            if let Err(why) = judge.particle_file(text.as_bytes()) {
                panic!("{n} times, {}...: {why}", text.chars().take(200).collect::<String>());
            }
        }
    }
}
