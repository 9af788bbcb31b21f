//! The measures of a run, at its end and over time.

use crate::beds::measures::contacts::SHARE;
use crate::beds::measures::request::RegionRequest;
use crate::beds::measures::row::{Row, centres};
use crate::error::Error;
use crate::files::names::Series;
use crate::files::run_file::{RunFile, State};
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::studies::job_pool::run::{FrameData, run};
use crate::studies::job_pool::{Sample, Work};

/// A number that is computed for each run.
#[derive(Debug)]
pub struct Measure {
    /// Name in files and options.
    pub name: &'static str,
    /// Description, with the unit.
    pub label: &'static str,
    /// Whether it is shown when the user names no measures.
    pub usual: bool,
    of: Of,
}

/// What the number is computed from.
#[derive(Debug)]
enum Of {
    /// A frame. Such a measure can be followed over time.
    Frame(fn(&AtFrame) -> f64),
    /// The work of the whole run.
    Work(fn(&Work) -> u64),
}

/// A frame, and what else is known at its time.
#[derive(Debug)]
struct AtFrame {
    row: Row,
    /// Kinetic energy, J.
    kinetic_energy: f64,
    /// Potential energy, J.
    potential_energy: f64,
    /// Largest overlap in any frame up to this one, m.
    overlap: f64,
}

const fn frame(name: &'static str, label: &'static str, usual: bool, of: fn(&AtFrame) -> f64) -> Measure {
    Measure { name, label, usual, of: Of::Frame(of) }
}

const fn work(name: &'static str, label: &'static str, of: fn(&Work) -> u64) -> Measure {
    Measure { name, label, usual: false, of: Of::Work(of) }
}

/// All measures; those that can be followed over time come first.
pub const MEASURES: [Measure; 27] = [
    frame("volume_fraction", "volume fraction of the union", true, |at| at.row.volume_fraction),
    frame("porosity", "porosity", false, |at| at.row.porosity),
    frame("overlap_fraction", "share covered more than once", false, |at| at.row.overlap_fraction),
    frame("paper_count_in_unit_cube", "volume fraction in [0, 1]^3, the paper's count", true, |at| {
        at.row.paper_count_in_unit_cube.unwrap_or(f64::NAN)
    }),
    frame("volume_fraction_in_unit_cube", "volume fraction of the union in [0, 1]^3", false, |at| {
        at.row.volume_fraction_in_unit_cube.unwrap_or(f64::NAN)
    }),
    frame("mean_coordination", "coordination number", true, |at| at.row.mean_coordination),
    frame("mean_coordination_without_rattlers", "coordination number without rattlers", false, |at| {
        at.row.mean_coordination_without_rattlers
    }),
    frame("rattlers", "rattlers", true, |at| at.row.rattlers as f64),
    frame("contacts", "contacts between spheres", false, |at| at.row.contacts as f64),
    frame("wall_contacts", "contacts with walls", false, |at| at.row.wall_contacts as f64),
    frame("mean_force", "mean contact force (N)", false, |at| at.row.mean_force),
    frame("largest_force", "largest contact force (N)", false, |at| at.row.largest_force),
    frame("contact_threshold", "push above which it is a contact (N)", false, |at| at.row.contact_threshold),
    frame("overlap_coordination", "spheres that a sphere overlaps", false, |at| at.row.overlap_coordination),
    frame("overlaps", "pairs that overlap", false, |at| at.row.overlaps as f64),
    frame("wall_overlaps", "overlaps with walls", false, |at| at.row.wall_overlaps as f64),
    frame("mean_overlap", "mean overlap (m)", false, |at| at.row.mean_overlap),
    frame("largest_overlap", "largest overlap (m)", false, |at| at.row.largest_overlap),
    frame("bed_height", "bed height (m)", true, |at| at.row.bed_height),
    frame("kinetic_energy", "kinetic energy (J)", false, |at| at.kinetic_energy),
    frame("potential_energy", "potential energy (J)", false, |at| at.potential_energy),
    frame("largest_overlap_of_run", "largest overlap in any frame (m)", true, |at| at.overlap),
    frame("end_time", "time of the end (s)", false, |at| at.row.time),
    work("steps_accepted", "steps accepted", |work| work.steps_accepted),
    work("steps_rejected", "steps rejected", |work| work.steps_rejected),
    work("rhs_evaluations", "right-hand sides", |work| work.rhs_evaluations),
    work("pair_evaluations", "pairs evaluated", |work| work.pair_evaluations),
];

/// Number of measures that can be followed over time. They are the first of `MEASURES`.
pub const OVER_TIME: usize = 23;

/// One of [`MEASURES`]: its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeasureId(pub usize);

impl MeasureId {
    /// The measure with this name.
    pub fn of_name(name: &str) -> Option<Self> {
        MEASURES.iter().position(|measure| measure.name == name).map(MeasureId)
    }
}

/// Which frames of a run are measured, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// About how many times an evolution has; 0: only the end is measured.
    pub times: u64,
    /// Region in which volumes are measured, chosen from the frame at the end of the run.
    pub region: RegionRequest,
}

impl Plan {
    /// Number of frames from one measured frame of `scene` to the next; `None`: only the last is measured.
    fn stride(&self, scene: &Scene) -> Option<u64> {
        let frames = (scene.t_end / scene.output.interval.unwrap_or(scene.t_end)).ceil().max(1.0);
        // Casts from f64 to u64 saturate.
        (self.times > 0).then(|| (frames / self.times as f64).ceil().max(1.0) as u64)
    }
}

/// The measures of a run over time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Followed {
    /// Times, s; the last one is the end of the run.
    pub times: Vec<f64>,
    /// For every time, the measures that can be followed over time.
    pub frames: Vec<Vec<f64>>,
    /// All measures at the end.
    pub end: Vec<f64>,
}

impl Followed {
    /// Unpacks the sample of a run that did not fail.
    pub fn of(sample: &Sample) -> Self {
        let rows = sample.numbers.chunks_exact(1 + OVER_TIME);
        let (times, frames): (Vec<f64>, Vec<Vec<f64>>) = rows.map(|row| (row[0], row[1..].to_vec())).unzip();
        let mut end = frames.last().cloned().unwrap_or_else(|| vec![f64::NAN; OVER_TIME]);
        end.extend(MEASURES[OVER_TIME..].iter().map(|measure| match measure.of {
            Of::Work(of) => of(&sample.work) as f64,
            Of::Frame(_) => f64::NAN,
        }));
        Followed { times, frames, end }
    }
}

/// A frame that is kept until the run ends, because the region depends on the end.
struct Held {
    state: State,
    kinetic_energy: f64,
    potential_energy: f64,
    overlap: f64,
}

/// The measures of all `held` frames, the last of which is the end of the run.
///
/// Each frame gives its time and then the first `OVER_TIME` measures.
fn numbers(scene: &Scene, plan: &Plan, held: &[Held]) -> Vec<f64> {
    let Some(last) = held.last() else { return Vec::new() };
    let (region, _) = plan.region.of(scene, &centres(&last.state), last.state.sizes(scene));
    let mut numbers = Vec::with_capacity(held.len() * (1 + OVER_TIME));
    for held in held {
        let at = AtFrame {
            row: Row::of(scene, &held.state, &region, SHARE),
            kinetic_energy: held.kinetic_energy,
            potential_energy: held.potential_energy,
            overlap: held.overlap,
        };
        numbers.push(held.state.time);
        numbers.extend(MEASURES[..OVER_TIME].iter().map(|measure| match measure.of {
            Of::Frame(of) => of(&at),
            Of::Work(_) => f64::NAN,
        }));
    }
    numbers
}

/// Runs `scene` from `start` on this thread and measures it.
pub fn simulated(scene: &Scene, start: &InitialCondition, plan: &Plan) -> Sample {
    let stride = plan.stride(scene);
    let (mut k, mut overlap, mut held, mut last) = (0, 0.0f64, Vec::new(), None);
    let sample = run(scene, start, u64::MAX, |frame: &FrameData| {
        overlap = overlap.max(frame.largest_overlap);
        let this = Held {
            state: frame.state(k),
            kinetic_energy: frame.kinetic_energy,
            potential_energy: frame.potential_energy,
            overlap,
        };
        match stride {
            Some(stride) if k % stride == 0 => {
                held.push(this);
                last = None;
            }
            _ => last = Some(this),
        }
        k += 1;
    });
    if sample.failure.is_some() {
        return sample;
    }
    held.extend(last);
    Sample { numbers: numbers(scene, plan, &held), ..sample }
}

/// Measures the run in `run_file`.
pub fn recorded(run_file: &RunFile, plan: &Plan) -> Result<Sample, Error> {
    let (kinetic, potential) =
        (run_file.series(Series::KineticEnergy)?, run_file.series(Series::PotentialEnergy)?);
    let overlaps = run_file.series(Series::LargestOverlap)?;
    let stride = plan.stride(&run_file.scene);
    let mut held = Vec::new();
    let mut overlap = 0.0f64;
    for (k, largest) in (0..run_file.frames).zip(overlaps) {
        overlap = overlap.max(largest);
        if k + 1 == run_file.frames || stride.is_some_and(|stride| k % stride == 0) {
            let [kinetic_energy, potential_energy] = [&kinetic, &potential].map(|list| list[k as usize]);
            held.push(Held { state: run_file.state(k)?, kinetic_energy, potential_energy, overlap });
        }
    }
    let facts = run_file.facts()?;
    let count = |series: Series| {
        let fact = facts.iter().find(|(name, _)| name == series.name());
        let fact = fact.and_then(|(_, value)| value.parse().ok());
        fact.ok_or_else(|| run_file.unreadable(&format!("/run records no {series}")))
    };
    let pairs = run_file.counts(Series::PairEvaluations)?.last().copied().unwrap_or(0);
    let work = Work {
        rhs_evaluations: count(Series::RhsEvaluations)?,
        pair_evaluations: pairs.max(0) as u64,
        steps_accepted: count(Series::StepsAccepted)?,
        steps_rejected: count(Series::StepsRejected)?,
        core_seconds: 0.0,
    };
    Ok(Sample { work, failure: None, numbers: numbers(&run_file.scene, plan, &held) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::initial_condition::column;
    use crate::studies::ensemble::testing::scene;

    fn plan(times: u64) -> Plan {
        Plan { times, region: RegionRequest::default() }
    }

    #[test]
    fn measures_with_an_evolution_come_first_and_names_differ() {
        let over_time = |measure: &Measure| matches!(measure.of, Of::Frame(_));
        assert!(MEASURES[..OVER_TIME].iter().all(over_time));
        assert!(!MEASURES[OVER_TIME..].iter().any(over_time));
        for (k, measure) in MEASURES.iter().enumerate() {
            assert!(MEASURES[..k].iter().all(|other| other.name != measure.name), "{}", measure.name);
        }
    }

    #[test]
    fn a_run_is_followed_at_about_as_many_times_as_asked_for_and_at_its_end() {
        let (scene, start) = scene(&["t_end=0.5", "output.interval=0.03"]);
        let followed = |times| Followed::of(&simulated(&scene, &start, &plan(times)));
        let all = followed(100);
        assert_eq!(all.times.len(), 18);
        assert_eq!((all.times[0], all.times[1], all.times[17]), (0.0, 0.03, 0.5));
        let some = followed(5);
        assert_eq!(some.times, [0.0, 4.0 * 0.03, 8.0 * 0.03, 12.0 * 0.03, 16.0 * 0.03, 0.5]);
        let end = followed(0);
        assert_eq!(end.times, [0.5]);
        // The largest overlap also counts frames that are not measured.
        assert_eq!((&some.end, &end.end), (&all.end, &all.end));
        assert_eq!(all.end.len(), MEASURES.len());
    }

    #[test]
    fn unequal_spheres_are_measured_with_their_own_radii() {
        let (scene, mut start) = scene(&["t_end=1e-6"]);
        start.x = vec![[0.15, 0.15, 0.1], [0.4, 0.4, 0.05]];
        (start.v, start.omega) = (vec![[0.0; 3]; 2], vec![[0.0; 3]; 2]);
        start.columns =
            vec![(column("radius", "m"), vec![0.1, 0.05]), (column("mass", "kg"), vec![1.0, 0.125])];
        let end = Followed::of(&simulated(&scene, &start, &plan(0))).end;
        let of = |name: &str| end[MeasureId::of_name(name).unwrap().0];
        // The bed ends at the highest centre: half of the large sphere and all of the small one are in it.
        let ball = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        let exact = (0.5 * ball(0.1) + ball(0.05)) / (0.5 * 0.5 * 0.1);
        assert!((of("volume_fraction") - exact).abs() < 1e-8, "{} is not {exact}", of("volume_fraction"));
        assert!((of("bed_height") - 0.2).abs() < 1e-9);
    }

    #[test]
    fn a_failed_run_gives_no_numbers() {
        let (scene, mut start) = scene(&["t_end=0.1"]);
        start.x[1] = start.x[0];
        let sample = simulated(&scene, &start, &plan(1));
        assert!(sample.failure.unwrap().contains("coincide") && sample.numbers.is_empty());
    }
}
