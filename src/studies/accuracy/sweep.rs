//! The error of the model: one scene key takes several values, and one accurate solver computes them all.

use super::ensemble::{self, Job, no_bed};
use super::exact::hard_rebound_time;
use super::findings::{Findings, measures};
use super::impact::Setup;
use super::records::{Measure, Record};
use super::request::Request;
use super::solvers::adaptive;
use super::starts::{Starts, load};
use crate::domain::Comm;
use crate::error::Error;
use crate::ode::MethodName;
use crate::scene::{Scene, split_values};
use crate::studies::job_pool::JobPool;
use std::str::FromStr;

/// Tolerance of dormand-prince for the impacts of a sweep.
const IMPACT_TOLERANCE: f64 = 1e-10;
/// Tolerance of auto for the beds of a sweep.
const BED_TOLERANCE: f64 = 1e-3;

/// A scene key and its values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sweep {
    /// Dotted path of the key.
    pub key: String,
    /// Values in TOML.
    pub values: Vec<String>,
}

impl FromStr for Sweep {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "it must be KEY=V1,V2,.. such as contact.stiffness_exponent=30,150,500";
        let (key, list) = text.split_once('=').ok_or(form)?;
        let (key, values) = (key.trim().to_owned(), split_values(list));
        if key.is_empty() || values.iter().any(String::is_empty) {
            return Err(form.into());
        }
        let no_model = [
            "solver",
            "output",
            "t_end",
            "particles.grid.seed",
            "particles.random.seed",
            "particles.lattice.seed",
        ];
        if no_model.iter().any(|path| key == *path || key.starts_with(&format!("{path}."))) {
            return Err(format!(
                "{key} is no part of the model: there are --methods, --tolerances, --seeds and --until for it"
            ));
        }
        Ok(Sweep { key, values })
    }
}

/// The scene with one value of the key.
pub struct Variation {
    /// KEY=VALUE.
    pub name: String,
    /// The scene.
    scene: Scene,
    /// Its initial states.
    starts: Starts,
}

/// Loads the scene with every value of the key. A value that the scene rejects is an input error. Collective.
pub fn variations(request: &Request, comm: &dyn Comm) -> Result<Vec<Variation>, Error> {
    let Some(sweep) = &request.sweep else { return Ok(Vec::new()) };
    let one = |value: &String| {
        let name = format!("{}={value}", sweep.key);
        let sets: Vec<String> = request.set.iter().cloned().chain([name.clone()]).collect();
        let (scene, starts) = load(request, &sets, comm).map_err(|why| match why {
            Error::Input(text) => {
                Error::Input(text.replacen("--set", "--sweep", usize::from(text.contains(&name))))
            }
            other => other,
        })?;
        Ok(Variation { name, scene, starts })
    };
    sweep.values.iter().map(one).collect()
}

/// Number of runs in a sweep.
pub fn count(variations: &[Variation], impact: bool, ensemble: bool) -> usize {
    let beds = |v: &Variation| if no_bed(&v.scene, &v.starts[0].1).is_none() { v.starts.len() } else { 0 };
    variations.iter().map(|v| usize::from(impact) + if ensemble { beds(v) } else { 0 }).sum()
}

/// Computes the impact and the bed for every value. Collective.
///
/// If `beds` is `None`, there are no beds. Its inner value is the time of the beds (s); `None` means `t_end`.
pub fn study(pool: &JobPool, variations: &[Variation], impact: bool, beds: Option<Option<f64>>) -> Findings {
    let mut found = Findings::default();
    if impact {
        found.records.extend(impacts(pool, variations));
        found.notes.push(format!(
            "sweep: impacts by dormand-prince at tolerance {IMPACT_TOLERANCE:e}; \
             differences between values are the model's"
        ));
    }
    if let Some(until) = beds {
        let solver = adaptive(MethodName::Auto, BED_TOLERANCE);
        let with_bed = || variations.iter().filter(|v| no_bed(&v.scene, &v.starts[0].1).is_none());
        let mut records = Vec::new();
        // All runs end at the same time, because t_end cannot be swept.
        if let Some(first) = with_bed().next() {
            let jobs: Vec<Job> = with_bed()
                .flat_map(|v| {
                    let solver = &solver;
                    v.starts.iter().map(move |(seed, start)| Job {
                        scene: &v.scene,
                        variation: Some(&v.name),
                        solver,
                        seed: *seed,
                        start,
                    })
                })
                .collect();
            records = ensemble::runs(pool, "sweep of beds", &jobs, until.unwrap_or(first.scene.t_end));
            found.notes.push(format!("sweep: beds by {}", solver.label()));
        }
        found.statistics = ensemble::statistics(&records, None);
        found.records.extend(records);
    }
    found
}

/// Simulates the impact with every value.
fn impacts(pool: &JobPool, variations: &[Variation]) -> Vec<Record> {
    let solver = adaptive(MethodName::DormandPrince, IMPACT_TOLERANCE);
    let setups: Vec<Setup> = variations.iter().map(|v| Setup::of(&v.scene, &v.starts[0].1)).collect();
    let samples = pool.run("sweep of impacts", &setups, |setup| setup.simulate(&solver));
    let record = |((v, setup), sample): ((&Variation, &Setup), &_)| {
        let record = setup.record(&solver, sample);
        // Further digits would belong to the solver, not to the model.
        let value = |measure: Measure| {
            record.measures.get(&measure).map_or(f64::NAN, |value| (value * 1e8).round() / 1e8)
        };
        let (rebound, restitution) = (value(Measure::ReboundTime), value(Measure::Restitution));
        let e = v.scene.contact.restitution;
        let hard = hard_rebound_time(setup.height, setup.g, e);
        let measures = measures([
            (Measure::ReboundTime, rebound),
            (Measure::LaterThanHard, setup.rebound_time.map_or(f64::NAN, |_| rebound - hard)),
            (Measure::Restitution, restitution),
            (Measure::RestitutionBeyondE, restitution - e),
        ]);
        Record { variation: Some(v.name.clone()), measures, ..record }
    };
    variations.iter().zip(&setups).zip(&samples).map(record).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_may_be_lists_and_texts() {
        let sweep: Sweep = "contact.stiffness_exponent=30, 150,500".parse().unwrap();
        assert_eq!(sweep.key, "contact.stiffness_exponent");
        assert_eq!(sweep.values, ["30", "150", "500"]);
        let gravity: Sweep = "gravity=[0,0,-9.81],[0, 0, -1.62]".parse().unwrap();
        assert_eq!(gravity.values, ["[0,0,-9.81]", "[0, 0, -1.62]"]);
        let files: Sweep = "particles.file='a,b.csv',\"c].csv\"".parse().unwrap();
        assert_eq!(files.values, ["'a,b.csv'", "\"c].csv\""]);
    }

    #[test]
    fn what_is_no_sweep_of_the_model_is_refused() {
        for (text, part) in [
            ("contact", "KEY=V1"),
            ("=1,2", "KEY=V1"),
            ("contact.restitution=1,,2", "KEY=V1"),
            ("solver.tolerance=1,2", "no part of the model"),
            ("t_end=1,2", "no part of the model"),
        ] {
            let why = text.parse::<Sweep>().unwrap_err();
            assert!(why.contains(part), "{text}: {why}");
        }
    }
}
