//! The measures of one frame of a run.

use serde::Serialize;

use super::contacts::{Contact, Contacts, Partner, between_spheres};
use super::rattlers::{fewest_that_hold, mean_coordination, rattlers};
use super::region::{Region, Upright};
use super::union::{Spheres, Volumes};
use crate::files::run_file::State;
use crate::math::vector::Vec3;
use crate::model::size::Sizes;
use crate::scene::Scene;

/// The measures of one frame.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::contacts::SHARE;
/// use demhybrid::beds::measures::region::Region;
/// use demhybrid::beds::measures::row::Row;
/// use demhybrid::files::run_file::State;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let state = State {
///     frame: 0,
///     time: 0.0,
///     x: vec![[0.3, 0.3, 0.099], [0.3, 0.3, 0.297]],
///     v: vec![[0.0; 3]; 2],
///     omega: None,
///     sizes: Default::default(), // all have that of the scene
///     materials: Default::default(), // none has one
/// };
/// let region = Region::cuboid(Vec3::zeros(), Vec3::new(0.75, 0.75, 0.5));
/// let row = Row::of(&scene, &state, &region, SHARE);
/// assert_eq!((row.contacts, row.wall_contacts), (1, 1));
/// assert!((row.bed_height - 0.397).abs() < 1e-12); // m
/// assert!((row.porosity - 0.97).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Number of the frame.
    pub frame: u64,
    /// Time, s.
    pub time: f64,
    /// Share of the region that spheres cover.
    pub volume_fraction: f64,
    /// 1 minus the volume fraction.
    pub porosity: f64,
    /// Volume that spheres cover in addition to the first one at each point, as a share of the region.
    pub overlap_fraction: f64,
    /// Volume fraction in the unit cube, counted like the paper does; `None` if no sphere is in it.
    pub paper_count_in_unit_cube: Option<f64>,
    /// Share of the unit cube that spheres cover; `None` if no sphere is in it.
    pub volume_fraction_in_unit_cube: Option<f64>,
    /// A contact pushes with more than this, N: a share of a
    /// [`Reference`](super::reference_force::Reference). Where every pair has its own, it is that of the
    /// mean.
    pub contact_threshold: f64,
    /// Mean number of spheres that a sphere is in contact with.
    pub mean_coordination: f64,
    /// Mean number of contacts of the spheres that are not rattlers, among themselves.
    pub mean_coordination_without_rattlers: f64,
    /// Number of spheres that their contacts cannot hold.
    pub rattlers: usize,
    /// Number of contacts between spheres.
    pub contacts: usize,
    /// Number of contacts with walls.
    pub wall_contacts: usize,
    /// Mean normal force of contacts between spheres, N.
    pub mean_force: f64,
    /// Largest normal force of any contact, N.
    pub largest_force: f64,
    /// Mean number of spheres that a sphere overlaps or just touches, whatever the force.
    pub overlap_coordination: f64,
    /// Number of pairs of spheres that overlap or just touch.
    pub overlaps: usize,
    /// Number of overlaps with walls.
    pub wall_overlaps: usize,
    /// Mean overlap of the pairs that overlap, m.
    pub mean_overlap: f64,
    /// Largest overlap with a sphere or a wall, m.
    pub largest_overlap: f64,
    /// Height of the highest point of any sphere above the lowest point inside all walls, against gravity, m.
    ///
    /// Where the walls leave the bottom open, it is measured from the origin.
    pub bed_height: f64,
}

impl Row {
    /// Measures a frame in `region`. Contacts push with more than `share` of the reference force.
    pub fn of(scene: &Scene, state: &State, region: &Region, share: f64) -> Row {
        let contacts = Contacts::of(scene, state, share);
        let x = centres(state);
        let spheres = Spheres::sized(&x, state.sizes(scene));
        let volumes = spheres.volumes(region);
        Row::with(scene, state, volumes, &contacts, &spheres)
    }

    /// Measures a frame with known `volumes` in the region, `contacts` and `spheres`.
    pub fn with(
        scene: &Scene,
        state: &State,
        volumes: Volumes,
        contacts: &Contacts,
        spheres: &Spheres,
    ) -> Row {
        let sizes = state.sizes(scene);
        let x = centres(state);
        let count = x.len();
        let cube = in_unit_cube(&x, sizes, spheres);
        let (pushing, overlapping) = (&contacts.pushing, &contacts.overlapping);
        let loose = rattlers(count, pushing, fewest_that_hold(scene));
        let held = loose.iter().filter(|&&loose| !loose).count();
        let firm = |contact: &&Contact| {
            matches!(
                contact.partner,
                Partner::Sphere(j) if !loose[contact.i] && !loose[j]
            )
        };
        let [pairs, overlaps] = [pushing, overlapping].map(|list| between_spheres(list).count());
        let share = |sum: f64, count: usize| if count == 0 { 0.0 } else { sum / count as f64 };
        Row {
            frame: state.frame,
            time: state.time,
            volume_fraction: volumes.union / volumes.region,
            porosity: 1.0 - volumes.union / volumes.region,
            overlap_fraction: (volumes.spheres - volumes.union).max(0.0) / volumes.region,
            paper_count_in_unit_cube: cube.map(|[count, _]| count),
            volume_fraction_in_unit_cube: cube.map(|[_, union]| union),
            contact_threshold: contacts.threshold,
            mean_coordination: mean_coordination(count, pushing),
            mean_coordination_without_rattlers: share(2.0 * pushing.iter().filter(firm).count() as f64, held),
            rattlers: count - held,
            contacts: pairs,
            wall_contacts: pushing.len() - pairs,
            mean_force: share(between_spheres(pushing).map(|contact| contact.force).sum(), pairs),
            largest_force: largest(pushing, |contact| contact.force),
            overlap_coordination: mean_coordination(count, overlapping),
            overlaps,
            wall_overlaps: overlapping.len() - overlaps,
            mean_overlap: share(between_spheres(overlapping).map(|contact| contact.overlap).sum(), overlaps),
            largest_overlap: largest(overlapping, |contact| contact.overlap),
            bed_height: top(&Upright::of(scene), &x, sizes),
        }
    }
}

fn largest(contacts: &[Contact], of: impl Fn(&Contact) -> f64) -> f64 {
    contacts.iter().map(of).fold(0.0, f64::max)
}

/// The centres of the spheres of a state, m.
pub fn centres(state: &State) -> Vec<Vec3> {
    state.x.iter().map(|&x| x.into()).collect()
}

/// Height of the highest point of any sphere above the ground, m.
fn top(upright: &Upright, x: &[Vec3], sizes: Sizes) -> f64 {
    let tops = x.iter().enumerate().map(|(i, x)| upright.height(x) + sizes.of(i).r);
    tops.fold(f64::NEG_INFINITY, f64::max)
}

/// The unit cube, in which the paper counts.
fn unit_cube() -> Region {
    Region::cuboid(Vec3::zeros(), Vec3::repeat(1.0))
}

/// Volume fractions in the unit cube: the count of the paper, and the exact share of the union.
///
/// `None` if no sphere is in it.
fn in_unit_cube(x: &[Vec3], sizes: Sizes, spheres: &Spheres) -> Option<[f64; 2]> {
    let union = spheres.volumes(&unit_cube()).union;
    (union > 0.0).then(|| [super::paper_count(x, |i| sizes.of(i).r), union])
}
