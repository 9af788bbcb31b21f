//! The figures of a comparison of solvers.

use super::energy::{Energies, measure};
use super::ensemble::STATISTICS;
use super::findings::medians;
use super::records::{Measure, Record, Statistic, Study};
use super::reference::Separation;
use crate::beds::plot::{Across, Bar, Curve, Group, Line, Panel, Point, ensemble, series, work_precision};
use crate::error::Error;
use crate::math::digits::{scientific, short};
use crate::math::interval::Interval;
use crate::scene::Scene;
use std::path::{Path, PathBuf};

/// The data that the figures show.
pub struct Shown<'a> {
    /// Name of the scene, for titles.
    pub name: &'a str,
    /// The scene.
    pub scene: &'a Scene,
    /// Runs of the studies.
    pub records: &'a [Record],
    /// Means of the ensemble.
    pub statistics: &'a [Statistic],
    /// Distance between the reference and its twin over time, and the time of the comparison (s).
    pub separation: Option<(&'a Separation, f64)>,
    /// Energies of an accurate run.
    pub energies: Option<&'a Energies>,
    /// Runs of the sweep.
    pub sweep: &'a [Record],
    /// Means of the sweep.
    pub sweep_statistics: &'a [Statistic],
}

impl Shown<'_> {
    /// Draws all figures that have data into `folder`; returns their names.
    pub fn draw(&self, folder: &Path) -> Result<Vec<String>, Error> {
        let mut drawn = Vec::new();
        let mut file = |name: &str| -> PathBuf {
            drawn.push(name.to_owned());
            folder.join(name)
        };
        let name = self.name;
        let curves = [
            (
                "impact.svg",
                Study::Impact,
                Measure::ReboundError,
                "rebound time of one impact",
                "relative error of the rebound time",
            ),
            (
                "restitution.svg",
                Study::Impact,
                Measure::RestitutionError,
                "restitution of one impact",
                "relative error of the restitution",
            ),
            (
                "state.svg",
                Study::State,
                Measure::PositionError,
                "state",
                "largest position error (m), median over seeds",
            ),
            ("energy.svg", Study::Energy, measure(self.scene), "energy", ENERGY_LABEL),
        ];
        for (svg, study, measure, what, label) in curves {
            let of_study = self.records.iter().filter(|record| record.study == study);
            let runs = medians(of_study);
            if runs.iter().any(|run| run.measures.contains_key(&measure)) {
                let at = match (study, self.separation) {
                    (Study::State, Some((_, time))) => format!(" at t = {} s", short(time)),
                    _ => String::new(),
                };
                let title = format!("{name}: {what}{at}, work for accuracy");
                work_precision(&file(svg), &title, label, &curves_of(&runs, measure))?;
            }
        }
        if let Some((separation, _)) = self.separation.filter(|(separation, _)| separation.points.len() > 1) {
            let lines = separation_lines(separation);
            let title = format!("{name}: how a shift of 1e-9 radii grows");
            series(&file("separation.svg"), &title, "time (s)", "largest distance (m)", true, &lines)?;
        }
        if let Some(energies) = self.energies.filter(|energies| !energies.lines.is_empty()) {
            let title = format!("{name}: where the energy is");
            series(&file("energies.svg"), &title, "time (s)", "energy (J)", false, &energies.lines)?;
        }
        let panels = ensemble_panels(self.statistics);
        if !panels.is_empty() {
            ensemble(&file("ensemble.svg"), &format!("{name}: statistics over initial states"), &panels)?;
        }
        let panels = sweep_panels(self.sweep, self.sweep_statistics);
        if !panels.is_empty() {
            let title = format!("{name}: what the model's parameter changes (not the solver)");
            ensemble(&file("sweep.svg"), &title, &panels)?;
        }
        Ok(drawn)
    }
}

/// The measures of impacts that a sweep shows.
const OF_IMPACTS: [Measure; 4] =
    [Measure::ReboundTime, Measure::LaterThanHard, Measure::Restitution, Measure::RestitutionBeyondE];

const ENERGY_LABEL: &str = "error of the energy over the largest kinetic energy";

/// One curve for each method, with its runs from loose to tight.
fn curves_of(runs: &[Record], measure: Measure) -> Vec<Curve> {
    let mut curves: Vec<Curve> = Vec::new();
    for run in runs {
        let name = run.solver.method.name();
        let point = Point {
            label: match (run.solver.tolerance, run.solver.step) {
                (Some(tolerance), _) => scientific(tolerance, 1),
                (None, step) => format!("{} s", scientific(step.unwrap_or(f64::NAN), 1)),
            },
            error: run.measures.get(&measure).copied().unwrap_or(f64::NAN),
            rhs: run.work.rhs_evaluations as f64,
            core_seconds: run.work.core_seconds,
            failed: run.failure.is_some(),
        };
        match curves.iter_mut().find(|curve| curve.name == name) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { name: name.to_owned(), points: vec![point] }),
        }
    }
    curves
}

fn separation_lines(separation: &Separation) -> Vec<Line> {
    let points = separation.points.clone();
    let limit = 1000.0 * points[0].1;
    let ends = [points[0].0, points[points.len() - 1].0];
    vec![
        Line { name: "reference and twin".to_owned(), points },
        Line { name: "1000 times the shift".to_owned(), points: ends.map(|t| (t, limit)).to_vec() },
    ]
}

/// Two panels for each statistic, with the tolerance on the horizontal axis.
///
/// One shows the mean. The other shows the difference to the most accurate solver, which does not contain the
/// differences between seeds. Solvers with fixed steps have no tolerance, so they are left out.
fn ensemble_panels(statistics: &[Statistic]) -> Vec<Panel> {
    let panel = |measure: Measure, title: String, of: fn(&Statistic) -> Option<Interval>| {
        let mut groups: Vec<Group> = Vec::new();
        for s in statistics.iter().filter(|s| s.measure == measure) {
            let (Some(x), Some(interval)) = (s.solver.tolerance, of(s)) else { continue };
            add(&mut groups, s.solver.method.name(), Bar { x, interval });
        }
        let x_label = "tolerance".to_owned();
        Panel { name: title, x_label, across: Across::Logarithmic, log_y: false, groups }
    };
    let best = statistics.iter().find(|s| s.paired.is_none()).map_or(String::new(), |s| s.solver.label());
    let both = |&measure: &Measure| {
        let difference = format!("{measure}: difference to {best}");
        [panel(measure, measure.to_string(), |s| Some(s.interval)), panel(measure, difference, |s| s.paired)]
    };
    STATISTICS.iter().flat_map(both).filter(|panel| !panel.groups.is_empty()).collect()
}

fn add(groups: &mut Vec<Group>, name: &str, bar: Bar) {
    match groups.iter_mut().find(|group| group.name == name) {
        Some(group) => group.bars.push(bar),
        None => groups.push(Group { name: name.to_owned(), bars: vec![bar] }),
    }
}

/// One panel for each measure of the impact and each statistic of the bed, with the values of the key on the
/// horizontal axis.
fn sweep_panels(records: &[Record], statistics: &[Statistic]) -> Vec<Panel> {
    let mut names: Vec<&str> = Vec::new();
    for variation in records.iter().filter_map(|record| record.variation.as_deref()) {
        if !names.contains(&variation) {
            names.push(variation);
        }
    }
    let key = names.first().and_then(|name| name.split_once('=')).map_or("", |(key, _)| key);
    let values: Vec<String> =
        names.iter().map(|name| name.split_once('=').map_or(*name, |(_, value)| value).to_owned()).collect();
    let numbers: Option<Vec<f64>> = values.iter().map(|value| value.parse().ok()).collect();
    let across = match &numbers {
        None => Across::Named(values),
        Some(numbers) => {
            let (low, high) = (
                numbers.iter().copied().fold(f64::INFINITY, f64::min),
                numbers.iter().copied().fold(0.0, f64::max),
            );
            if low > 0.0 && high > 8.0 * low { Across::Logarithmic } else { Across::Linear }
        }
    };
    let position = |variation: &Option<String>| {
        let at = names.iter().position(|name| Some(*name) == variation.as_deref())?;
        Some(numbers.as_ref().map_or(at as f64, |numbers| numbers[at]))
    };
    let panel = |measure: Measure, groups: Vec<Group>| Panel {
        name: measure.to_string(),
        x_label: key.to_owned(),
        across: across.clone(),
        log_y: false,
        groups,
    };
    let mut panels = Vec::new();
    for measure in OF_IMPACTS {
        let mut groups = Vec::new();
        for record in records.iter().filter(|record| record.study == Study::Impact) {
            let (Some(x), Some(&mean)) = (position(&record.variation), record.measures.get(&measure)) else {
                continue;
            };
            // There is a single run without randomness, so the interval has no width.
            add(&mut groups, "impact", Bar { x, interval: Interval { mean, half_width: 0.0, count: 1 } });
        }
        panels.push(panel(measure, groups));
    }
    for measure in STATISTICS {
        let mut groups = Vec::new();
        for s in statistics.iter().filter(|s| s.measure == measure) {
            let Some(x) = position(&s.variation) else { continue };
            add(&mut groups, "bed", Bar { x, interval: s.interval });
        }
        panels.push(panel(measure, groups));
    }
    panels.into_iter().filter(|panel| !panel.groups.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::MethodName;
    use crate::studies::accuracy::records::{Solver, Work};
    use crate::studies::accuracy::solvers::adaptive;

    fn record(solver: Solver, variation: Option<&str>, measure: Measure, value: Option<f64>) -> Record {
        Record {
            study: Study::Impact,
            variation: variation.map(str::to_owned),
            solver,
            seed: None,
            work: Work::default(),
            measures: value.map(|value| (measure, value)).into_iter().collect(),
            failure: value.is_none().then(|| "failed".to_owned()),
        }
    }

    #[test]
    fn a_curve_has_the_runs_of_a_method_and_keeps_the_failed_ones() {
        let runs = [
            record(adaptive(MethodName::Merson, 1e-1), None, Measure::ReboundError, None),
            record(adaptive(MethodName::Auto, 1e-1), None, Measure::ReboundError, Some(0.1)),
            record(adaptive(MethodName::Merson, 1e-2), None, Measure::ReboundError, Some(0.2)),
        ];
        let curves = curves_of(&runs, Measure::ReboundError);
        assert_eq!((curves[0].name.as_str(), curves[0].points.len()), ("merson", 2));
        assert!(curves[0].points[0].failed && curves[0].points[0].error.is_nan());
        assert_eq!((curves[0].points[1].label.as_str(), curves[0].points[1].error), ("1e-2", 0.2));
    }

    #[test]
    fn a_sweep_of_numbers_has_a_scale_and_one_of_words_has_names() {
        let panels = |variations: [&str; 2]| {
            let runs = variations.map(|v| {
                record(adaptive(MethodName::Merson, 1e-9), Some(v), Measure::ReboundTime, Some(3.6))
            });
            sweep_panels(&runs, &[])
        };
        let numbers = panels(["contact.stiffness_exponent=30", "contact.stiffness_exponent=500"]);
        assert_eq!(numbers.len(), 1);
        assert!(matches!(numbers[0].across, Across::Logarithmic));
        assert_eq!(numbers[0].groups[0].bars[1].x, 500.0);
        let words = panels(["friction.rotation=true", "friction.rotation=false"]);
        assert!(matches!(&words[0].across, Across::Named(names) if names[1] == "false"));
        assert_eq!(words[0].groups[0].bars[1].x, 1.0);
    }
}
