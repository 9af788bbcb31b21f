//! The study `state`: compares all spheres at one time, for every solver, from several initial states.

use super::findings::{Findings, measures, median};
use super::records::{Measure, Record, Solver, Study};
use super::reference::{self, Difference, Separation, difference, end_state, reference};
use super::solvers::with_solver;
use crate::math::digits::{scientific, short};
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::studies::job_pool::run::work_limit;
use crate::studies::job_pool::{JobPool, Sample};

/// When states are compared, and how this time was found.
#[derive(Debug, Clone)]
pub struct When {
    /// Time of the comparison, s.
    pub time: f64,
    /// Time after which trajectories are no longer comparable, s; `None` if the search ended before it.
    pub decorrelation_time: Option<f64>,
    /// Distance between the reference and its shifted twin over time.
    pub separation: Separation,
    /// A note on the time for the reader of the results.
    pub note: String,
}

/// Finds the time of the comparison from the first initial state, or takes `wanted` (s). Collective.
///
/// `fall` is the longest fall in the scene, m.
pub fn when(
    pool: &JobPool,
    scene: &Scene,
    start: &InitialCondition,
    wanted: Option<f64>,
    fall: Option<f64>,
) -> When {
    let horizon = reference::horizon(scene, fall).max(wanted.unwrap_or(0.0));
    let (separation, failure) = reference::separation(pool, scene, start, horizon);
    let decorrelation_time = separation.decorrelation_time();
    let found = separation.comparison_time();
    let time = wanted.or(found).unwrap_or(horizon);
    let last = separation.points.last().map_or(0.0, |&(time, _)| time);
    let parting = match decorrelation_time {
        Some(parted) => format!("have parted 1000-fold at t = {} s", short(parted)),
        None => format!("have not parted 1000-fold up to t = {} s, where the search ended", short(last)),
    };
    let early = failure.map(|why| format!(" (the reference ended early: {why})")).unwrap_or_default();
    let caution = match (wanted, decorrelation_time) {
        (Some(_), Some(parted)) if time >= parted => {
            "; the time asked for is later, so that differences of states say little about the solver"
        }
        _ => "",
    };
    let note = format!(
        "state: the reference and a twin shifted by 1e-9 radii {parting}{early}; states are compared \
         at t = {} s{caution}",
        short(time)
    );
    When { time, decorrelation_time, separation, note }
}

/// Compares the states at t = `time` (s) for every solver and every initial state in `starts`. Collective.
pub fn study(
    pool: &JobPool,
    scene: &Scene,
    starts: &[(Option<u64>, InitialCondition)],
    solvers: &[Solver],
    time: f64,
) -> Findings {
    let plain: Vec<InitialCondition> = starts.iter().map(|(_, start)| start.clone()).collect();
    let exact = match reference(pool, scene, &plain, time) {
        Ok(exact) => exact,
        Err(why) => {
            let notes = vec![format!("state: left out, because no reference could be computed: {why}")];
            return Findings { notes, ..Findings::default() };
        }
    };
    let jobs: Vec<(&Solver, usize)> =
        solvers.iter().flat_map(|solver| (0..starts.len()).map(move |k| (solver, k))).collect();
    let limit = work_limit(plain[0].x.len());
    let samples = pool.run("state", &jobs, |&(solver, k)| {
        let sample = end_state(&with_solver(scene, solver), &plain[k], time, limit);
        let numbers = match sample.failure {
            None => {
                let Difference { x, v, omega } = difference(&sample.numbers, &exact.states[k]);
                vec![x, v, omega]
            }
            Some(_) => Vec::new(),
        };
        Sample { numbers, ..sample }
    });
    let records: Vec<Record> = jobs
        .iter()
        .zip(&samples)
        .map(|(&(solver, k), sample)| Record {
            study: Study::State,
            variation: None,
            solver: solver.clone(),
            seed: starts[k].0,
            work: sample.work,
            measures: measures([
                (Measure::PositionError, sample.number(0)),
                (Measure::VelocityError, sample.number(1)),
                (Measure::SpinError, if scene.rotates() { sample.number(2) } else { f64::NAN }),
            ]),
            failure: sample.failure.clone(),
        })
        .collect();
    let own = median(exact.errors.iter().map(|error| error.x).collect());
    let mut notes = vec![format!(
        "state: the reference is dormand-prince at tolerance {:e}; at tolerance {:e} it is off by {} m \
         (median over {} initial states); together they took {} right-hand sides",
        exact.tolerance,
        10.0 * exact.tolerance,
        scientific(own, 1),
        starts.len(),
        exact.rhs_evaluations
    )];
    let errors = || records.iter().filter_map(|record| record.measures.get(&Measure::PositionError));
    if errors().count() > 0 && errors().all(|&error| error == 0.0) {
        notes.push("state: no error at all, because nothing has touched anything before".to_owned());
    } else if errors().any(|&error| error < 10.0 * own) {
        notes.push(format!(
            "state: errors below {} m are not resolved by this reference",
            scientific(10.0 * own, 1)
        ));
    }
    Findings { records, notes, ..Findings::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;
    use crate::ode::MethodName;
    use crate::studies::accuracy::solvers::adaptive;
    use crate::studies::accuracy::testing::scene;

    #[test]
    fn a_tighter_solver_is_nearer_to_the_reference_on_every_number_of_ranks() {
        let (mut scene, start) = scene();
        scene.t_end = 0.3;
        let starts = [(Some(1), start)];
        let solvers = [adaptive(MethodName::Merson, 1e-2), adaptive(MethodName::Merson, 1e-5)];
        let lists = [1, 2].map(|ranks| {
            let found = std::sync::Mutex::new(Vec::new());
            team(ranks, |comm| {
                let pool = JobPool { comm, threads: 1, quiet: true };
                let when = when(&pool, &scene, &starts[0].1, None, None);
                assert!(when.separation.points.len() > 90, "{}", when.note);
                let findings = study(&pool, &scene, &starts, &solvers, when.time);
                let errors: Vec<f64> =
                    findings.records.iter().map(|record| record.measures[&Measure::PositionError]).collect();
                assert!(errors[0] > errors[1] && errors[1] < 1e-5, "{errors:?}");
                found.lock().unwrap().push(errors);
            });
            found.into_inner().unwrap()
        });
        assert!(lists.iter().flatten().all(|errors| *errors == lists[0][0]), "{lists:?}");
    }
}
