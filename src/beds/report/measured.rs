//! All measures that a report shows.

use std::sync::Arc;

use serde::Serialize;

use super::classes;
use crate::beds::measures::by_class::ByClass;
use crate::beds::measures::classes::Classes;
use crate::beds::measures::contacts::{Contacts, WallForce};
use crate::beds::measures::profiles;
use crate::beds::measures::radial::radial_distribution;
use crate::beds::measures::rattlers::{coordination, fewest_that_hold};
use crate::beds::measures::reference_force::Reference;
use crate::beds::measures::region::{Region, Upright};
use crate::beds::measures::row::{Row, centres};
use crate::beds::measures::union::{Spheres, Volumes};
use crate::error::Error;
use crate::files::names::Series;
use crate::files::run_file::{RunFile, State};
use crate::math::digits::short;
use crate::math::vector::Vec3;
use crate::model::size::Size;

/// A quantity of the run over time.
#[derive(Debug, Clone)]
pub struct Column {
    /// The column of `/run/series`.
    pub series: Series,
    /// One value for each frame, SI units.
    pub values: Vec<f64>,
}

/// All measures of a run. Profiles and distributions are those of the frame of the last row.
#[derive(Debug, Clone, Serialize)]
pub struct Measured {
    /// Description of the region in which volumes are measured.
    pub region_words: String,
    /// Largest error of the volume fractions in it.
    pub volume_fraction_error: f64,
    /// Volume of the region, m^3.
    pub region_volume: f64,
    /// One row for each frame that was asked for.
    pub rows: Vec<Row>,
    /// Smallest number of contacts that can hold a sphere. A sphere with fewer is a rattler.
    pub contacts_that_hold: usize,
    /// A contact pushes with more than this share of the reference force.
    pub share: f64,
    /// The reference force, in words.
    pub reference: &'static str,
    /// The reference force in the frame of the last row, N.
    pub reference_force: f64,
    /// Numbers of spheres that are in contact with 0, 1, 2, ... other spheres.
    pub coordination: Vec<usize>,
    /// What every wall bears.
    pub wall_forces: Vec<WallForce>,
    /// Heights above the ground, against gravity (m), with the porosity of the level section.
    pub height_profile: Vec<[f64; 2]>,
    /// Distances to upright walls, m.
    pub wall_distances: Vec<f64>,
    /// Names of walls, with the porosities at those distances.
    pub wall_profiles: Vec<(String, Vec<f64>)>,
    /// Distances (m), with the radial distribution function.
    pub radial_distribution: Vec<[f64; 2]>,
    /// The measures by class; none where all spheres are alike.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by_class: Option<ByClass>,
    /// Contacts. They have their own table.
    #[serde(skip)]
    pub contacts: Contacts,
    /// Quantities of the run over time.
    #[serde(skip)]
    pub series: Vec<Column>,
    /// Heights of the centres above the ground over time, m, by sphere. Empty if there are many spheres.
    #[serde(skip)]
    pub trajectories: Vec<Vec<f64>>,
    /// Radius of all spheres, m; their mean radius, where they differ.
    pub radius: f64,
    /// The size of each sphere; none where all are alike.
    #[serde(skip)]
    pub sizes: Arc<[Size]>,
}

/// Largest number of spheres whose heights are drawn over time.
const FEW: u64 = 7;
/// Largest number of walls that are named one by one: those of a box.
const MOST_WALLS: usize = 6;

impl Measured {
    /// Measures `state`, the last of the frames that were asked for. `rows` has the rows of the earlier ones.
    ///
    /// Contacts push with more than `share` of the reference force. Where spheres differ they are measured by
    /// `classes`, too.
    pub fn of(
        run_file: &RunFile,
        state: &State,
        (region, words): (&Region, &str),
        share: f64,
        classes: Option<&Classes>,
        mut rows: Vec<Row>,
    ) -> Result<Self, Error> {
        let scene = &run_file.scene;
        let r = scene.particles.radius;
        let contacts = Contacts::of(scene, state, share);
        let x = centres(state);
        let sizes = state.sizes(scene);
        let spheres = Spheres::sized(&x, sizes);
        let parts = spheres.parts(region);
        rows.push(Row::with(scene, state, Volumes::of(&parts, region), &contacts, &spheres));
        let by_class = |classes| ByClass::of(scene, state, region, classes, &contacts, &parts);
        let by_class = classes.map(by_class);
        let largest = state.sizes.iter().map(|size| size.r).fold(r, f64::max);
        let numbers = coordination(x.len(), &contacts.pushing);
        let mut histogram = vec![0; numbers.iter().max().map_or(0, |most| most + 1)];
        numbers.iter().for_each(|&number| histogram[number] += 1);
        let Upright { up, across: [u, v], .. } = region.upright;
        let axes = [u, v, up];
        let (wall_distances, wall_profiles) = profiles::over_wall_distance(scene, &spheres, region);
        Ok(Measured {
            region_words: format!("{words}: {}", described(region)),
            volume_fraction_error: 1e-9,
            region_volume: region.volume(),
            rows,
            contacts_that_hold: fewest_that_hold(scene),
            share,
            reference: contacts.reference.words(),
            reference_force: contacts.reference.newtons(),
            coordination: histogram,
            wall_forces: contacts.walls.clone(),
            height_profile: profiles::over_height(&spheres, region, r),
            wall_distances,
            wall_profiles,
            radial_distribution: radial_distribution(&x, r, &region.room_of_centres(largest), &axes),
            by_class,
            contacts,
            series: series(run_file)?,
            trajectories: trajectories(run_file)?,
            radius: r,
            sizes: state.sizes.clone(),
        })
    }

    /// The row of the last frame that was asked for.
    pub fn last(&self) -> &Row {
        &self.rows[self.rows.len() - 1]
    }

    /// The values of a quantity over time.
    pub fn column(&self, series: Series) -> Option<&[f64]> {
        self.series.iter().find(|column| column.series == series).map(|column| &column.values[..])
    }

    /// The highest point of the radial distribution function: its distance (m) and its value.
    pub fn first_peak(&self) -> Option<[f64; 2]> {
        let peak = self.radial_distribution.iter().copied().max_by(|a, b| a[1].total_cmp(&b[1]));
        peak.filter(|[_, g]| *g > 0.0)
    }

    /// Names and values of the measures of the last frame, as text.
    pub fn findings(&self) -> Vec<(&'static str, String)> {
        let row = self.last();
        let mut found = vec![
            ("volume fraction of the union", format!("{:.6} (exact to 1e-9)", row.volume_fraction)),
            ("porosity", format!("{:.6}", row.porosity)),
            ("covered more than once", format!("{:.6} of the region", row.overlap_fraction)),
        ];
        if let (Some(count), Some(union)) = (row.paper_count_in_unit_cube, row.volume_fraction_in_unit_cube) {
            found.push(("the paper's count in [0, 1]^3", format!("{count:.6}; the union there {union:.6}")));
        }
        found.extend([
            (
                "coordination number",
                format!(
                    "{:.4}; without rattlers {:.4}",
                    row.mean_coordination, row.mean_coordination_without_rattlers
                ),
            ),
            ("rattlers", format!("{} (fewer than {} contacts)", row.rattlers, self.contacts_that_hold)),
            ("contacts", format!("{} between spheres, {} with walls", row.contacts, row.wall_contacts)),
            ("a contact pushes with more than", self.threshold()),
            (
                "contact force",
                format!("mean {} N, largest {} N", short(row.mean_force), short(row.largest_force)),
            ),
        ]);
        if !self.wall_forces.is_empty() {
            found.push(("normal force on walls", self.on_walls()));
        }
        found.extend([
            (
                "overlapping, whatever the force",
                format!(
                    "{} pairs, {} at walls; {:.4} spheres by a sphere",
                    row.overlaps, row.wall_overlaps, row.overlap_coordination
                ),
            ),
            (
                "overlap",
                format!(
                    "mean {} m, largest {} m ({} {}radii)",
                    short(row.mean_overlap),
                    short(row.largest_overlap),
                    short(row.largest_overlap / self.radius),
                    self.mean_word()
                ),
            ),
        ]);
        if let Some([at, g]) = self.first_peak() {
            let width = self.radial_distribution[0][0];
            found.push((
                "highest peak of g",
                format!(
                    "{} at {} m +- {} m ({:.3} {}diameters)",
                    short(g),
                    short(at),
                    short(width),
                    at / (2.0 * self.radius),
                    self.mean_word()
                ),
            ));
        }
        found.push(("bed height", format!("{} m", short(row.bed_height))));
        found.extend(self.by_class.iter().flat_map(classes::findings));
        found
    }

    /// What radii and diameters in the text are, where spheres differ.
    fn mean_word(&self) -> &'static str {
        if self.sizes.is_empty() { "" } else { "mean " }
    }

    /// The force above which a push is a contact.
    fn threshold(&self) -> String {
        let threshold = short(self.last().contact_threshold);
        match self.contacts.reference {
            Reference::Weights { lightest, .. } => format!(
                "{} of {}: {} N for the lightest, {threshold} N in the mean",
                self.share,
                self.reference,
                short(self.share * lightest)
            ),
            _ => format!("{threshold} N, {} of {}", self.share, self.reference),
        }
    }

    /// The normal force on every wall, or the sum over many walls.
    fn on_walls(&self) -> String {
        if self.wall_forces.len() <= MOST_WALLS {
            let walls = self.wall_forces.iter();
            let each = walls.map(|wall| format!("{} N on {}", short(wall.normal_force), wall.wall));
            return each.collect::<Vec<_>>().join("; ");
        }
        let sum = self.wall_forces.iter().map(|wall| wall.normal_force).sum();
        format!("{} N on {} walls, of which wall-forces.csv has each", short(sum), self.wall_forces.len())
    }
}

/// A description of the region with its numbers.
fn described(region: &Region) -> String {
    let point = |x: Vec3| format!("({}, {}, {})", short(x.x), short(x.y), short(x.z));
    let (low, high) = region.bounds();
    match (region.pillar(), region.as_box()) {
        (_, Some((low, high))) => format!("the box from {} to {} m", point(low), point(high)),
        (Some((axis, radius)), None) => format!(
            "the cylinder of radius {} m around ({}, {}) m from z = {} to {} m, inside the walls",
            short(radius),
            short(axis[0]),
            short(axis[1]),
            short(low.z),
            short(high.z)
        ),
        (None, None) => format!(
            "{} m^3 between {} planes, from {} to {} m",
            short(region.volume()),
            region.sides().len(),
            point(low),
            point(high)
        ),
    }
}

/// The quantities of the run over time.
fn series(run_file: &RunFile) -> Result<Vec<Column>, Error> {
    use Series::*;
    let mut shown = vec![Time, KineticEnergy, PotentialEnergy, BedHeight, LargestOverlap, Step];
    if run_file.scene.output.energy {
        shown.extend([DissipatedRebound, DissipatedFriction]);
    }
    shown.extend([StepsAccepted, StepsRejected, StepsOutrun, RhsEvaluations, PairEvaluations]);
    shown.into_iter().map(|series| Ok(Column { series, values: run_file.series(series)? })).collect()
}

/// Heights of the centres above the ground in every frame, m, by sphere. Empty if there are many spheres.
fn trajectories(run_file: &RunFile) -> Result<Vec<Vec<f64>>, Error> {
    if run_file.count > FEW {
        return Ok(Vec::new());
    }
    let upright = Upright::of(&run_file.scene);
    let mut heights = vec![Vec::new(); run_file.count as usize];
    for k in 0..run_file.frames {
        for (heights, x) in heights.iter_mut().zip(run_file.state(k)?.x) {
            heights.push(upright.height(&x.into()));
        }
    }
    Ok(heights)
}
