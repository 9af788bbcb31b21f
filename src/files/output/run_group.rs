//! The group `/run` of the file: what its attributes and the columns of `/run/series` are.

use super::arrays::{set_new, set_new_text};
use super::collective::Transfer;
use super::{Measures, RunInfo};
use crate::files::names::Series;
use crate::ode::Limit;
use hdf5::types::TypeDescriptor;
use hdf5::{File, Group, Result};

/// Longest scene that is written as an attribute, bytes. A longer one becomes a dataset.
const LONGEST_ATTRIBUTE: usize = 60 << 10;

/// A number of a frame: its name, and the measure that it is.
pub(super) type Named<K, N> = (K, fn(&Measures) -> N);
/// The columns of `/run/series` with real numbers.
pub(super) const REAL_COLUMNS: [Named<Series, f64>; 7] = [
    (Series::Time, |m| m.time),
    (Series::Step, |m| m.step),
    (Series::KineticEnergy, |m| m.kinetic_energy),
    (Series::PotentialEnergy, |m| m.potential_energy),
    (Series::LargestOverlap, |m| m.largest_overlap),
    (Series::BedHeight, |m| m.bed_height),
    (Series::WallSeconds, |m| m.wall_seconds),
];

/// The columns of `/run/series` that exist only if the dissipated energy is written.
pub(super) const ENERGY_COLUMNS: [Named<Series, f64>; 2] =
    [(Series::DissipatedRebound, |m| m.dissipated[0]), (Series::DissipatedFriction, |m| m.dissipated[1])];

/// The real numbers of the last frame that are attributes of `/run`.
pub(super) const REAL_ATTRIBUTES: [Named<&str, f64>; 6] = [
    (Series::WallSeconds.name(), |m| m.wall_seconds),
    ("seconds_forces", |m| m.seconds.forces),
    ("seconds_ghosts", |m| m.seconds.ghosts),
    ("seconds_lists", |m| m.seconds.lists),
    ("seconds_reduction", |m| m.seconds.reduction),
    ("seconds_output", |m| m.seconds.output),
];

/// The columns of `/run/series` with counts.
pub(super) const COUNT_COLUMNS: [Named<Series, u64>; 6] = [
    (Series::StepsAccepted, |m| m.steps_accepted),
    (Series::StepsRejected, |m| m.steps_rejected),
    (Series::StepsOutrun, |m| m.steps_outrun),
    (Series::RhsEvaluations, |m| m.rhs_evaluations),
    (Series::PairEvaluations, |m| m.pair_evaluations),
    (Series::ListsBuilt, |m| m.lists_built),
];

/// The counts of the last frame that are attributes of `/run`: all columns of counts, and one more.
///
/// [`limit_attribute`] names further ones.
pub(super) fn count_attributes() -> impl Iterator<Item = Named<&'static str, u64>> {
    let forced: Named<&str, u64> = ("forced_accepts", |m| m.forced_accepts);
    COUNT_COLUMNS.into_iter().map(|(series, measure)| (series.name(), measure)).chain([forced])
}

/// Name of the attribute of `/run` that counts the accepted steps whose size `limit` decided.
pub(super) fn limit_attribute(limit: Limit) -> String {
    format!("limited_by_{}", limit.name())
}

/// Creates `/run` with all its attributes. Collective.
pub(super) fn run_group(
    file: &File,
    transfer: &Transfer,
    info: &RunInfo,
    writes_small: bool,
) -> Result<Group> {
    let run = file.create_group("run")?;
    set_new_text(&run, "version", &info.version)?;
    set_new_text(&run, "commit", &info.commit)?;
    put_scene(&run, transfer, &info.scene, writes_small)?;
    set_new_text(&run, "method", info.method.name())?;
    set_new(&run, "tolerance", info.tolerance)?;
    if let Some(step) = info.step {
        set_new(&run, "step", step)?;
    }
    set_new_text(&run, "norm", info.norm.name())?;
    set_new(&run, "velocity_scale", info.velocity_scale)?;
    set_new(&run, "contact_reach", info.contact_cutoff)?;
    set_new(&run, "mass", info.mass)?;
    set_new(&run, "ranks", info.ranks as i64)?;
    set_new(&run, "threads", info.threads as i64)?;
    set_new_text(&run, "instruction_set", &info.instruction_set)?;
    for (name, _) in count_attributes() {
        set_new(&run, name, 0_i64)?;
    }
    for limit in Limit::ALL {
        set_new(&run, &limit_attribute(limit), 0_i64)?;
    }
    for (name, _) in REAL_ATTRIBUTES {
        set_new(&run, name, 0.0)?;
    }
    set_new(&run, "completed", 0_i64)?;
    Ok(run)
}

/// Writes the text of the scene, as an attribute or, if it is too long for one, as a dataset.
pub(super) fn put_scene(run: &Group, transfer: &Transfer, scene: &str, writes: bool) -> Result<()> {
    if scene.len() <= LONGEST_ATTRIBUTE {
        return set_new_text(run, "scene", scene);
    }
    let kind = TypeDescriptor::FixedUnicode(scene.len());
    let text = run.new_dataset_builder().obj_track_times(false).empty_as(&kind).create("scene_text")?;
    if writes { transfer.write_text(&text, scene) } else { Ok(()) }
}
