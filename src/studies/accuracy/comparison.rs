//! Runs all studies of a comparison and writes their files and the table.

use super::advice::{Question, recommendation};
use super::energy::{self, Energies};
use super::ensemble::{self, no_bed};
use super::figures::Shown;
use super::files::{Report, table, write_csv, write_json};
use super::findings::{Findings, medians};
use super::impact;
use super::records::{Record, Study};
use super::request::Request;
use super::solvers::solvers;
use super::starts::{Starts, load};
use super::state::{self, When};
use super::sweep::{self, Variation};
use crate::beds::folder::stem;
use crate::error::Error;
use crate::scene::Scene;
use crate::studies::job_pool::JobPool;
use std::path::Path;

/// A comparison of solvers on one scene, ready to run.
pub struct Comparison<'a> {
    request: &'a Request,
    pool: &'a JobPool<'a>,
    scene: Scene,
    starts: Starts,
    variations: Vec<Variation>,
}

/// The results of all studies.
#[derive(Default)]
pub struct Found {
    studies: Findings,
    when: Option<When>,
    energies: Option<Energies>,
    sweep: Findings,
}

impl<'a> Comparison<'a> {
    /// Reads the scene of `request`, its initial states and its variations. Collective.
    pub fn load(request: &'a Request, pool: &'a JobPool<'a>) -> Result<Self, Error> {
        let (scene, starts) = load(request, &request.set, pool.comm)?;
        let variations = sweep::variations(request, pool.comm)?;
        Ok(Comparison { request, pool, scene, starts, variations })
    }

    fn asks(&self, study: Study) -> bool {
        self.request.asks(study)
    }

    /// Prints how many runs there will be.
    pub fn announce(&self) {
        let count = |study| match (
            self.asks(study),
            solvers(self.request, study, &self.scene, &self.starts[0].1).len(),
        ) {
            (false, _) => 0,
            (true, count) => match study {
                Study::Impact => count,
                // Two runs find the time of the comparison. Each initial state adds two references.
                Study::State => 2 + (count + 2) * self.starts.len(),
                Study::Energy => count + 1,
                Study::Ensemble if no_bed(&self.scene, &self.starts[0].1).is_some() => 0,
                Study::Ensemble => count * self.starts.len(),
            },
        };
        let counts = Study::ALL.map(count);
        let (impact, ensemble) = (self.asks(Study::Impact), self.asks(Study::Ensemble));
        let sweep = sweep::count(&self.variations, impact, ensemble);
        let parts: Vec<String> = Study::ALL
            .iter()
            .map(|study| study.name())
            .zip(counts)
            .chain([("sweep", sweep)])
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{name} {count}"))
            .collect();
        let all = counts.iter().sum::<usize>() + sweep;
        self.pool.tell(&format!(
            "{all} runs to come ({}), {} at a time",
            parts.join(", "),
            self.pool.threads * self.pool.comm.size()
        ));
    }

    /// Runs all studies that the request includes. Collective.
    pub fn found(&self) -> Found {
        let (pool, scene, starts, request) = (self.pool, &self.scene, &self.starts, self.request);
        let first = &starts[0];
        let solvers = |study| solvers(request, study, scene, &first.1);
        let mut found = Found::default();
        if self.asks(Study::Impact) {
            found.add(impact::study(pool, scene, &first.1, &solvers(Study::Impact)));
        }
        if self.asks(Study::State) || self.asks(Study::Energy) {
            let when = state::when(pool, scene, &first.1, request.time, impact::fall_height(scene, &first.1));
            found.studies.notes.push(when.note.clone());
            if self.asks(Study::State) {
                found.add(state::study(pool, scene, starts, &solvers(Study::State), when.time));
            }
            if self.asks(Study::Energy) {
                let list = solvers(Study::Energy);
                let (findings, energies) = energy::study(pool, scene, (first.0, &first.1), &list, when.time);
                found.add(findings);
                found.energies = Some(energies);
            }
            found.when = Some(when);
        }
        let bedless = no_bed(scene, &first.1);
        if self.asks(Study::Ensemble) {
            match bedless {
                Some(why) => found.studies.notes.push(why.to_owned()),
                None => {
                    let until = request.until.unwrap_or(scene.t_end);
                    found.add(ensemble::study(pool, scene, starts, &solvers(Study::Ensemble), until));
                }
            }
        }
        if !self.variations.is_empty() {
            let beds = self.asks(Study::Ensemble).then_some(request.until);
            found.sweep = sweep::study(pool, &self.variations, self.asks(Study::Impact), beds);
        }
        found
    }

    /// Writes all files into `folder` and returns the text for the terminal. Rank 0 only.
    pub fn write(&self, folder: &Path, found: &Found) -> Result<String, Error> {
        let (studies, sweep) = (&found.studies, &found.sweep);
        let all: Vec<Record> = studies.records.iter().chain(&sweep.records).cloned().collect();
        write_csv(&folder.join("runs.csv"), &all)?;
        let name = stem(&self.request.scene);
        let shown = Shown {
            name: &name,
            scene: &self.scene,
            records: &studies.records,
            statistics: &studies.statistics,
            separation: found.when.as_ref().map(|when| (&when.separation, when.time)),
            energies: found.energies.as_ref(),
            sweep: &sweep.records,
            sweep_statistics: &sweep.statistics,
        };
        let figures = shown.draw(folder)?;
        let advice = recommendation(&Question {
            records: &studies.records,
            statistics: &studies.statistics,
            time: found.when.as_ref().map(|when| when.time),
            radius: self.scene.particles.radius,
        });
        let notes: Vec<String> = studies.notes.iter().chain(&sweep.notes).cloned().collect();
        let mut text = table(&for_terminal(&studies.records), &studies.statistics);
        if !sweep.records.is_empty() {
            text += &format!(
                "\nsweep: error of the model, not of the solver\n\n{}",
                table(&sweep.records, &sweep.statistics)
            );
        }
        text += &format!("\nnotes\n{}", notes.iter().map(|note| format!("  {note}\n")).collect::<String>());
        text += &format!("\nrecommendation\n  {advice}\n");
        text += &format!(
            "\nfiles in {}: runs.csv, accuracy.json{}\n",
            folder.display(),
            figures.iter().map(|figure| format!(", {figure}")).collect::<String>()
        );
        let report = Report {
            scene: self.scene.resolved(),
            version: format!("{} {}", env!("CARGO_PKG_VERSION"), env!("DEMHYBRID_COMMIT")),
            records: all,
            statistics: studies.statistics.iter().chain(&sweep.statistics).cloned().collect(),
            decorrelation_time: found.when.as_ref().and_then(|when| when.decorrelation_time),
            recommendation: advice,
            notes,
        };
        write_json(&folder.join("accuracy.json"), &report)?;
        Ok(text)
    }
}

impl Found {
    fn add(&mut self, findings: Findings) {
        self.studies.records.extend(findings.records);
        self.studies.statistics.extend(findings.statistics);
        self.studies.notes.extend(findings.notes);
    }
}

/// Replaces the runs of each solver by their medians over the seeds.
///
/// The runs of an ensemble stay as they are, because the table groups them itself.
fn for_terminal(records: &[Record]) -> Vec<Record> {
    let (ensemble, other): (Vec<_>, Vec<_>) =
        records.iter().partition(|record| record.study == Study::Ensemble);
    medians(other).into_iter().chain(ensemble.into_iter().cloned()).collect()
}
