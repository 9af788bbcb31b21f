//! The study `ensemble`: statistics of the bed over several initial states, and the tolerance below which
//! they no longer change.

use super::findings::{Findings, by_solver, measures};
use super::impact::floors;
use super::records::{Measure, Record, Solver, Statistic, Stepper, Study};
use super::solvers::with_solver;
use crate::beds::measures::contacts::{Contacts, SHARE};
use crate::beds::measures::rattlers::mean_coordination;
use crate::beds::measures::request::RegionRequest;
use crate::beds::measures::union::Spheres;
use crate::math::digits::short;
use crate::math::interval::{Interval, interval};
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::studies::job_pool::run::{FrameData, run, work_limit};
use crate::studies::job_pool::{JobPool, Sample};

/// The statistics, in the order of the figures.
pub const STATISTICS: [Measure; 4] =
    [Measure::VolumeFraction, Measure::BedHeight, Measure::Coordination, Measure::LargestOverlap];

/// Least number of frames in a run.
const FRAMES: f64 = 50.0;

/// Why the scene has no bed, or `None` if it has one.
pub fn no_bed(scene: &Scene, start: &InitialCondition) -> Option<&'static str> {
    if start.x.len() < 2 {
        return Some("ensemble: left out, because one sphere is no bed");
    }
    floors(scene).is_empty().then_some("ensemble: left out, because no wall lies below for a bed to rest on")
}

/// One run: a solver, and an initial state of a scene.
pub struct Job<'a> {
    /// The scene. Its own solver is not used.
    pub scene: &'a Scene,
    /// The swept key with its value, in a sweep.
    pub variation: Option<&'a str>,
    /// The solver.
    pub solver: &'a Solver,
    /// Seed of the initial state.
    pub seed: Option<u64>,
    /// The initial state, at t = 0.
    pub start: &'a InitialCondition,
}

/// Runs all jobs until t = `until` (s) and measures their beds. Collective.
pub fn runs(pool: &JobPool, what: &str, jobs: &[Job], until: f64) -> Vec<Record> {
    let samples = pool.run(what, jobs, |job| bed(job, until));
    let record = |(job, sample): (&Job, &Sample)| Record {
        study: Study::Ensemble,
        variation: job.variation.map(str::to_owned),
        solver: job.solver.clone(),
        seed: job.seed,
        work: sample.work,
        measures: measures(std::array::from_fn::<_, 4, _>(|k| (STATISTICS[k], sample.number(k)))),
        failure: sample.failure.clone(),
    };
    jobs.iter().zip(&samples).map(record).collect()
}

fn bed(job: &Job, until: f64) -> Sample {
    let mut scene = with_solver(job.scene, job.solver);
    let often = until / FRAMES;
    scene.output.interval = Some(scene.output.interval.map_or(often, |interval| interval.min(often)));
    (scene.t_end, scene.output.energy) = (until, false);
    let (mut overlap, mut end) = (0.0f64, FrameData::default());
    let sample = run(&scene, job.start, work_limit(job.start.x.len()), |frame| {
        overlap = overlap.max(frame.largest_overlap);
        if frame.time >= until {
            end = frame.clone();
        }
    });
    if sample.failure.is_some() {
        return sample;
    }
    let state = end.state(0);
    let sizes = state.sizes(&scene);
    let (region, _) = RegionRequest::Bed.of(&scene, &end.x, sizes);
    let volumes = Spheres::sized(&end.x, sizes).volumes(&region);
    let fraction = volumes.union / volumes.region;
    let contacts = Contacts::of(&scene, &state, SHARE).pushing;
    let coordination = mean_coordination(end.x.len(), &contacts);
    let numbers = vec![fraction, end.bed_height, coordination, overlap];
    Sample { numbers, ..sample }
}

/// Measures the beds at t = `until` (s) for every solver and every initial state in `starts`. Collective.
pub fn study(
    pool: &JobPool,
    scene: &Scene,
    starts: &[(Option<u64>, InitialCondition)],
    solvers: &[Solver],
    until: f64,
) -> Findings {
    let job = |solver, (seed, start): &'_ (Option<u64>, InitialCondition)| (solver, *seed, start.clone());
    let all: Vec<_> =
        solvers.iter().flat_map(|solver| starts.iter().map(move |start| job(solver, start))).collect();
    let jobs: Vec<Job> = (all.iter())
        .map(|(solver, seed, start)| Job { scene, variation: None, solver, seed: *seed, start })
        .collect();
    let records = runs(pool, "ensemble", &jobs, until);
    let best = most_accurate(solvers);
    let statistics = statistics(&records, best);
    let mut notes = Vec::new();
    if starts.len() < 2 {
        notes.push("ensemble: one initial state only, so that there are no intervals".to_owned());
    }
    if let Some(best) = best {
        notes.push(format!(
            "ensemble: beds at t = {} s from {} initial states; differences are to {}",
            short(until),
            starts.len(),
            best.label()
        ));
    }
    if records.iter().all(|record| !record.measures.contains_key(&Measure::VolumeFraction)) {
        notes.push("ensemble: no sphere is inside the walls, so that there is no volume fraction".to_owned());
    }
    Findings { records, statistics, notes }
}

/// The solver that the others are compared with.
///
/// It is the published solver if the list has it, otherwise the first one with the smallest tolerance,
/// otherwise the one with the smallest step.
fn most_accurate(solvers: &[Solver]) -> Option<&Solver> {
    let tightness = |solver: &Solver| match (solver.method, solver.tolerance, solver.step) {
        (Stepper::Published, ..) => (0, 0.0),
        (_, Some(tolerance), _) => (1, tolerance),
        (.., step) => (2, step.unwrap_or(f64::INFINITY)),
    };
    let order = |a: &&Solver, b: &&Solver| {
        let ((a, x), (b, y)) = (tightness(a), tightness(b));
        a.cmp(&b).then(x.total_cmp(&y))
    };
    solvers.iter().min_by(order)
}

/// The mean of every statistic for every solver, and the mean difference to `best` for equal seeds.
///
/// The value of a failed run is not finite, which makes the interval infinite.
pub fn statistics(records: &[Record], best: Option<&Solver>) -> Vec<Statistic> {
    let groups = by_solver(records);
    let mut list = Vec::new();
    for measure in STATISTICS {
        let value = |record: &Record| record.measures.get(&measure).copied().unwrap_or(f64::NAN);
        for group in &groups {
            let values: Vec<f64> = group.iter().map(|record| value(record)).collect();
            let Some(mean) = interval(&values) else { continue };
            let (solver, variation) = (&group[0].solver, &group[0].variation);
            let partner = |other: &&Vec<&Record>| {
                Some(&other[0].solver) == best
                    && other[0].variation == *variation
                    && *solver != other[0].solver
            };
            let paired = groups.iter().find(partner).and_then(|other| {
                let same = |record: &Record| other.iter().find(|partner| partner.seed == record.seed);
                let difference =
                    |record: &&Record| value(record) - same(record).map_or(f64::NAN, |r| value(r));
                interval(&group.iter().map(difference).collect::<Vec<_>>())
            });
            let (solver, variation) = (solver.clone(), variation.clone());
            list.push(Statistic { variation, solver, measure, interval: mean, paired });
        }
    }
    list
}

/// The loosest tolerance of `method` below which no statistic changes, for spheres of radius `r` (m).
///
/// It and all tighter tolerances must pass a test: the difference to the most accurate solver is small, or
/// its interval contains 0 and is narrow.
pub fn still_from(statistics: &[Statistic], method: Stepper, r: f64) -> Option<f64> {
    let mut tolerances: Vec<f64> = (statistics.iter())
        .filter(|statistic| statistic.solver.method == method)
        .filter_map(|statistic| statistic.solver.tolerance)
        .collect();
    tolerances.sort_by(f64::total_cmp);
    tolerances.dedup();
    let still = |tolerance: &f64| {
        let of = |s: &&Statistic| s.solver.method == method && s.solver.tolerance == Some(*tolerance);
        statistics.iter().filter(of).all(|s| match s.paired {
            Some(paired) => same(&paired, s.measure, r),
            // The most accurate solver itself. Its interval is infinite if one of its runs failed.
            None => s.interval.half_width.is_finite(),
        })
    };
    tolerances.into_iter().take_while(still).last()
}

/// Whether the difference is too small to matter to a user, for spheres of radius `r` (m).
fn same(paired: &Interval, measure: Measure, r: f64) -> bool {
    // The smallest difference that matters, and the half-width above which an interval could hide one.
    let (matters, undecided) = match measure {
        Measure::VolumeFraction => (0.004, 0.006),
        Measure::BedHeight => (0.02 * r, 0.04 * r),
        Measure::Coordination => (0.1, 0.15),
        _ => (0.05 * r, 0.1 * r),
    };
    let (mean, half) = (paired.mean.abs(), paired.half_width);
    mean + half <= matters || (mean <= half && half <= undecided)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::MethodName;
    use crate::scene::initial_condition::column;

    const AUTO: Stepper = Stepper::Method(MethodName::Auto);
    use crate::domain::Solo;
    use crate::studies::accuracy::records::Work;
    use crate::studies::accuracy::solvers::adaptive;
    use crate::studies::accuracy::testing::scene;

    fn record(tolerance: f64, seed: u64, fraction: Option<f64>) -> Record {
        Record {
            study: Study::Ensemble,
            variation: None,
            solver: adaptive(MethodName::Auto, tolerance),
            seed: Some(seed),
            work: Work::default(),
            measures: fraction.map(|f| (Measure::VolumeFraction, f)).into_iter().collect(),
            failure: fraction.is_none().then(|| "failed".to_owned()),
        }
    }

    /// Statistics of volume fractions, given by tolerance for the seeds 1 to 3.
    fn statistics_of(lists: &[(f64, [Option<f64>; 3])]) -> Vec<Statistic> {
        let records: Vec<Record> = (lists.iter())
            .flat_map(|&(tolerance, list)| (1..).zip(list).map(move |(seed, f)| record(tolerance, seed, f)))
            .collect();
        let solvers: Vec<Solver> =
            lists.iter().map(|&(tolerance, _)| adaptive(MethodName::Auto, tolerance)).collect();
        statistics(&records, most_accurate(&solvers))
    }

    #[test]
    fn differences_are_between_runs_of_one_seed() {
        let found = statistics_of(&[
            (1e-1, [Some(0.61), Some(0.71), Some(0.66)]),
            (1e-3, [Some(0.60), Some(0.70), Some(0.65)]),
        ]);
        let paired = found[0].paired.unwrap();
        // Values differ by 0.1 between seeds, but the differences are equal up to a rounding of about 1e-17.
        assert!((paired.mean - 0.01).abs() < 1e-15 && paired.half_width < 1e-15, "{paired:?}");
        assert!(found[0].interval.half_width > 0.05);
        assert_eq!(found[1].paired, None);
    }

    #[test]
    fn a_statistic_is_still_from_the_loosest_tolerance_of_an_unbroken_row() {
        let base = [0.60, 0.70, 0.65];
        let moved = |by: [f64; 3]| [0, 1, 2].map(|k| Some(base[k] + by[k]));
        let (still, noisy, biased) = ([0.001; 3], [0.002, -0.002, 0.0], [0.01; 3]);
        let rows = |a, b, c| {
            statistics_of(&[(1e-1, moved(a)), (1e-2, moved(b)), (1e-3, moved(c)), (1e-4, moved([0.0; 3]))])
        };
        assert_eq!(still_from(&rows(biased, still, noisy), AUTO, 0.1), Some(1e-2));
        assert_eq!(still_from(&rows(still, noisy, still), AUTO, 0.1), Some(1e-1));
        // A wide interval could hide a difference, so it shows nothing.
        assert_eq!(still_from(&rows(still, [0.1, -0.1, 0.0], still), AUTO, 0.1), Some(1e-3));
        // At 1e-1 the interval contains 0 by chance. This does not count: at 1e-2 it does not contain 0.
        assert_eq!(still_from(&rows(noisy, biased, still), AUTO, 0.1), Some(1e-3));
        assert_eq!(still_from(&rows(still, still, still), Stepper::Method(MethodName::Merson), 0.1), None);
        let failed = statistics_of(&[(1e-1, [Some(0.6), Some(0.7), None]), (1e-4, moved([0.0; 3]))]);
        assert_eq!(still_from(&failed, AUTO, 0.1), Some(1e-4));
    }

    #[test]
    fn a_bed_needs_several_spheres_and_a_floor() {
        let (mut scene, start) = scene();
        assert_eq!(no_bed(&scene, &start), None);
        let one = InitialCondition {
            x: vec![[0.2; 3]],
            v: vec![[0.0; 3]],
            omega: vec![[0.0; 3]],
            ..InitialCondition::default()
        };
        assert!(no_bed(&scene, &one).unwrap().contains("one sphere"));
        scene.gravity = [0.0; 3];
        assert!(no_bed(&scene, &start).unwrap().contains("no wall"));
    }

    #[test]
    fn beds_of_unequal_spheres_are_measured_with_their_own_radii() {
        let (scene, mut start) = scene();
        start.x = vec![[0.15, 0.15, 0.1], [0.4, 0.4, 0.05]];
        (start.v, start.omega) = (vec![[0.0; 3]; 2], vec![[0.0; 3]; 2]);
        start.columns =
            vec![(column("radius", "m"), vec![0.1, 0.05]), (column("mass", "kg"), vec![1.0, 0.125])];
        let solver = adaptive(MethodName::Auto, 1e-2);
        let job = Job { scene: &scene, variation: None, solver: &solver, seed: None, start: &start };
        let sample = bed(&job, 1e-6);
        assert_eq!(sample.failure, None);
        // The bed ends at the highest centre: half of the large sphere and all of the small one are in it.
        let ball = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        let exact = (0.5 * ball(0.1) + ball(0.05)) / (0.5 * 0.5 * 0.1);
        assert!((sample.number(0) - exact).abs() < 1e-8, "{} is not {exact}", sample.number(0));
        assert!((sample.number(1) - 0.2).abs() < 1e-9, "{}", sample.number(1));
    }

    #[test]
    fn a_run_gives_all_statistics() {
        let (scene, start) = scene();
        let pool = JobPool { comm: &Solo, threads: 1, quiet: true };
        let found = study(&pool, &scene, &[(Some(1), start)], &[adaptive(MethodName::Auto, 1e-2)], 0.5);
        assert_eq!(found.records[0].measures.len(), 4, "{:?}", found.records);
        assert!(found.statistics.iter().all(|statistic| statistic.interval.half_width.is_infinite()));
    }
}
