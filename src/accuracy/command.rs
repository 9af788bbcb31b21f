//! `demhybrid accuracy SCENE` from the command line to the files and the recommendation.

use super::advice::{Question, recommendation};
use super::energy::{self, Energies};
use super::ensemble::{self, no_bed};
use super::figures::Shown;
use super::files::{Report, table, write_csv, write_json};
use super::findings::{Findings, medians};
use super::impact;
use super::records::{Record, Study};
use super::solvers::solvers;
use super::starts::{Starts, load};
use super::state::{self, When};
use super::sweep::{self, Variation};
use crate::agreement::share;
use crate::cli::AccuracyArgs;
use crate::domain::Comm;
use crate::error::Error;
use crate::farm::Farm;
use crate::launch;
use crate::scene::Scene;
use std::path::{Path, PathBuf};

/// Runs the comparison that the command line asks for. Collective.
pub fn run(args: &AccuracyArgs, comm: &dyn Comm) -> Result<(), Error> {
    let farm = Farm::start(comm, args.threads, args.quiet)?;
    let (scene, starts) = load(args, &args.set, comm)?;
    let variations = sweep::variations(args, comm)?;
    let folder = folder(args);
    share(comm, || prepare(&folder, args.force).map(|()| String::new()))?;
    let comparison = Comparison { args, farm, scene, starts, variations };
    comparison.announce();
    let found = comparison.found();
    let mut written = Ok(());
    let outcome = share(comm, || {
        written = comparison.write(&folder, &found);
        Ok(if written.is_err() { "failed".to_owned() } else { String::new() })
    })?;
    match (outcome.is_empty(), written) {
        (true, _) => Ok(()),
        (false, Err(why)) => Err(why),
        // Rank 0 says why.
        (false, Ok(())) => Err(Error::Elsewhere { code: 4 }),
    }
}

/// The folder of the files.
fn folder(args: &AccuracyArgs) -> PathBuf {
    args.output.clone().unwrap_or_else(|| format!("{}-accuracy", scene_name(&args.scene)).into())
}

/// Name of the scene without folder and extension.
fn scene_name(scene: &Path) -> String {
    scene.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned())
}

/// Makes the folder, or says why it cannot be used.
pub(crate) fn prepare(folder: &Path, force: bool) -> Result<(), Error> {
    let refuse = |why: String| Error::Input(format!("--output {}: {why}", folder.display()));
    if folder.exists() && !folder.is_dir() {
        return Err(refuse("this is a file; it must be the name of a folder".into()));
    }
    std::fs::create_dir_all(folder)
        .map_err(|why| refuse(format!("the folder cannot be made: {why}; choose another one")))?;
    let mut entries =
        std::fs::read_dir(folder).map_err(|why| refuse(format!("the folder cannot be read: {why}")))?;
    if entries.next().is_some() && !force {
        return Err(refuse("the folder is not empty; choose another one, or allow it with --force".into()));
    }
    // A folder that cannot be written to is told before hours of work.
    let probe = folder.join(".demhybrid");
    std::fs::write(&probe, "")
        .and_then(|()| std::fs::remove_file(&probe))
        .map_err(|why| refuse(format!("nothing can be written there: {why}; choose another one")))
}

/// What is compared.
struct Comparison<'a> {
    args: &'a AccuracyArgs,
    farm: Farm<'a>,
    scene: Scene,
    starts: Starts,
    variations: Vec<Variation>,
}

/// All that was found.
#[derive(Default)]
struct Found {
    studies: Findings,
    when: Option<When>,
    energies: Option<Energies>,
    sweep: Findings,
}

impl Comparison<'_> {
    fn asks(&self, study: Study) -> bool {
        self.args.studies.is_empty() || self.args.studies.contains(&study)
    }

    /// Tells how many runs are to come.
    fn announce(&self) {
        let count =
            |study| match (self.asks(study), solvers(self.args, study, &self.scene, &self.starts[0].1).len())
            {
                (false, _) => 0,
                (true, count) => match study {
                    Study::Impact => count,
                    // And the twin; the reference and its own reference.
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
        self.farm.tell(&format!(
            "{all} runs to come ({}), {} at a time",
            parts.join(", "),
            self.farm.threads * self.farm.comm.size()
        ));
    }

    /// Does all studies. Collective.
    fn found(&self) -> Found {
        let (farm, scene, starts, args) = (&self.farm, &self.scene, &self.starts, self.args);
        let first = &starts[0];
        let solvers = |study| solvers(args, study, scene, &first.1);
        let mut found = Found::default();
        if self.asks(Study::Impact) {
            found.add(impact::study(farm, scene, &first.1, &solvers(Study::Impact)));
        }
        if self.asks(Study::State) || self.asks(Study::Energy) {
            let when = state::when(farm, scene, &first.1, args.time, impact::fall_height(scene, &first.1));
            found.studies.notes.push(when.note.clone());
            if self.asks(Study::State) {
                found.add(state::study(farm, scene, starts, &solvers(Study::State), when.time));
            }
            if self.asks(Study::Energy) {
                let list = solvers(Study::Energy);
                let (findings, energies) = energy::study(farm, scene, (first.0, &first.1), &list, when.time);
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
                    let until = args.until.unwrap_or(scene.t_end);
                    found.add(ensemble::study(farm, scene, starts, &solvers(Study::Ensemble), until));
                }
            }
        }
        if !self.variations.is_empty() {
            let beds = self.asks(Study::Ensemble).then_some(args.until);
            found.sweep = sweep::study(farm, &self.variations, self.asks(Study::Impact), beds);
        }
        found
    }

    /// Writes all files and prints what was found. On rank 0.
    fn write(&self, folder: &Path, found: &Found) -> Result<(), Error> {
        let (studies, sweep) = (&found.studies, &found.sweep);
        let all: Vec<Record> = studies.records.iter().chain(&sweep.records).cloned().collect();
        write_csv(&folder.join("runs.csv"), &all)?;
        let name = scene_name(&self.args.scene);
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
        launch::print(&text);
        Ok(())
    }
}

impl Found {
    fn add(&mut self, findings: Findings) {
        self.studies.records.extend(findings.records);
        self.studies.statistics.extend(findings.statistics);
        self.studies.notes.extend(findings.notes);
    }
}

/// The records with one line a solver where there is one run a seed; the table itself brings ensembles together.
fn for_terminal(records: &[Record]) -> Vec<Record> {
    let (ensemble, other): (Vec<_>, Vec<_>) =
        records.iter().partition(|record| record.study == Study::Ensemble);
    medians(other).into_iter().chain(ensemble.into_iter().cloned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::testing::args;

    #[test]
    fn the_folder_is_named_after_the_scene() {
        assert_eq!(folder(&args("")), PathBuf::from("eight-accuracy"));
        assert_eq!(folder(&args("-o other")), PathBuf::from("other"));
    }

    #[test]
    fn a_folder_with_something_in_it_is_refused_unless_forced() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new").join("deep");
        prepare(&folder, false).unwrap();
        prepare(&folder, false).unwrap();
        std::fs::write(folder.join("something"), "").unwrap();
        let why = prepare(&folder, false).unwrap_err();
        assert!(why.exit_code() == 2 && why.to_string().contains("--force"), "{why}");
        prepare(&folder, true).unwrap();
        assert!(prepare(&folder.join("something"), true).unwrap_err().to_string().contains("a file"));
    }
}
