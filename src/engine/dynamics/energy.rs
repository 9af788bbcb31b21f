//! Energies and other measures of the whole system, with the same bits from any number of ranks.

use super::Dynamics;
use crate::domain::exact;
use crate::engine::forces::{BodyParameters, Measure};
use crate::engine::kernel::GapMeasure;
use crate::math::exact::{largest, total};
use crate::math::larger;
use crate::model::columns::{position, spin, velocity};
use crate::ode::Dissipation;
use crate::scene::walls::upwards;
use serde::{Deserialize, Serialize};

/// How far surfaces overlap at most.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Overlap {
    /// The largest overlap, m.
    pub length: f64,
    /// The largest share of its radius by which a sphere overlaps another one or a wall; of two spheres the
    /// smaller one counts.
    pub share: f64,
}

impl Overlap {
    /// The larger of both.
    pub fn max(self, other: Overlap) -> Overlap {
        Overlap { length: self.length.max(other.length), share: self.share.max(other.share) }
    }
}

impl Dynamics<'_> {
    /// Kinetic energy of all particles at `y`, J. Collective.
    pub fn kinetic_energy(&self, y: &[f64]) -> f64 {
        let (turned, sizes, width) = (self.turned_mass(), self.forces.sizes(), self.width());
        let energy = |i: usize| {
            let (row, mass) = (row(y, width, i), sizes.of(i).mass);
            let turned = turned(mass);
            0.5 * mass * velocity(row).norm_squared() + 0.5 * turned * spin(row).norm_squared()
        };
        exact::exact_sum(self.domain.comm, self.domain.owned, energy)
    }

    /// I/r^2 (kg) for the mass m (kg) of a particle: what the mass is for velocities, for spins. It is 2/5 m
    /// for a homogeneous sphere.
    ///
    /// An infinite inertia (1/I = 0) allows no spin but 0, and so holds no energy.
    pub(super) fn turned_mass(&self) -> impl Fn(f64) -> f64 + Sync + use<> {
        let inertia = self.forces.parameters.inertia(self.law().r);
        let (per_force, typical) = (inertia.spin_per_force, inertia.mass);
        let of_typical = if per_force > 0.0 { 1.0 / per_force } else { 0.0 };
        move |mass| if mass == typical { of_typical } else { of_typical * (mass / typical) }
    }

    /// Numbers of a particle in a state.
    fn width(&self) -> usize {
        self.layout.0[0].width
    }

    /// Potential energy (J) of all contacts and of gravity at `y`, without what contacts remember, and the
    /// largest overlap. Collective.
    ///
    /// The energy of a contact is rho(0) times the energy that it stores, so that the energy H never grows
    /// (docs/model.md).
    pub fn potential_energy(&mut self, y: &[f64]) -> (f64, Overlap) {
        self.put_bodies(y);
        let BodyParameters { gravity, .. } = self.forces.parameters;
        let (n, comm) = (self.domain.owned, self.domain.comm);
        let width = self.width();
        // Where all are alike nothing is listed: a frame allocates no memory here.
        let alike = self.mass();
        let masses: Vec<f64> = match self.columns().sized() {
            true => (0..n).map(|i| self.size(i).mass).collect(),
            false => Vec::new(),
        };
        let mass = |i: usize| masses.get(i).copied().unwrap_or(alike);
        let height = |i: usize| -mass(i) * gravity.dot(&position(row(y, width, i)));
        let l_max = self.law().l_max;
        let forces = &mut self.forces;
        let mut depths = forces.largest(Measure::Gap(GapMeasure::Depth(l_max)));
        comm.max(&mut depths);
        let [depth, overlap] = depths;
        // The closest contact stores most. All ranks compute the same number.
        let most = forces.laws.most_stored(l_max - depth);
        let highest = largest(n, height);
        let [energy] = exact::exact_sums(comm, [larger(most, highest)], |[scale]| {
            let [stored, _] = forces.total(Measure::Stored, |terms| [scale.integer(terms[0]), 0]);
            [stored + total(n, height, scale)]
        });
        (energy, Overlap { length: overlap, share: self.largest_share(overlap) })
    }

    /// The largest overlap as a share of the radius, for the bodies as they are; `overlap` (m) is the
    /// largest. Collective.
    fn largest_share(&mut self, overlap: f64) -> f64 {
        if !self.columns().sized() {
            return overlap / self.law().r;
        }
        let [share, _] = self.forces.largest(Measure::Gap(GapMeasure::Share));
        let mut share = [share];
        self.domain.comm.max(&mut share);
        share[0]
    }

    /// Energy that the memories of contacts store at `y`, J. Collective.
    pub fn remembered_energy(&self, y: &[f64]) -> f64 {
        if self.forces.memory_width() == 0 {
            return 0.0;
        }
        exact::exact_sum(self.domain.comm, self.contacts.counted.len(), self.stored_in_memories(y))
    }

    /// Unbalanced force: 0 in perfect balance, 1 in free fall; NaN if there are no forces at all. Collective.
    ///
    /// It is the sum of the net forces on all particles over the sum of all contact forces and weights.
    /// `slope` holds the accelerations. Each contact counts once, with its force at rest (rho(0) F).
    pub fn unbalanced_force(&mut self, y: &[f64], slope: &[f64]) -> f64 {
        let BodyParameters { mass, gravity, .. } = self.forces.parameters;
        let (n, comm) = (self.domain.owned, self.domain.comm);
        let width = self.width();
        let sizes = self.forces.sizes();
        let net = exact::exact_sum(comm, n, |i| sizes.of(i).mass * velocity(row(slope, width, i)).norm());
        let weight = |i: usize| -sizes.of(i).mass * gravity.dot(&position(row(y, width, i)));
        let height = exact::exact_sum(comm, n, weight);
        let total = match self.columns().sized() {
            true => exact::exact_sum(comm, n, |i| sizes.of(i).mass),
            false => mass * self.count() as f64,
        };
        // The force of a contact at rest is kappa times the energy that it stores, apart from the cut at
        // l_max.
        let stored = self.potential_energy(y).0 - height;
        let weights = total * gravity.norm();
        net / (self.law().kappa * stored.max(0.0) + weights)
    }

    /// Power that contacts dissipate by rebound and by friction in the state of the last right-hand side, W.
    /// Collective.
    pub(super) fn dissipated_power(&mut self) -> Dissipation {
        let (comm, forces) = (self.domain.comm, &mut self.forces);
        let largest = forces.largest(Measure::Dissipation);
        exact::exact_sums(comm, largest, |scales| {
            forces.total(Measure::Dissipation, |power| [0, 1].map(|k| scales[k].integer(power[k])))
        })
    }

    /// Largest speed of the centre of any particle at `y`, m/s. Collective.
    pub fn largest_speed(&self, y: &[f64]) -> f64 {
        let width = self.width();
        let speeds = (0..self.domain.owned).map(|i| velocity(row(y, width, i)).norm());
        let mut largest = [speeds.fold(0.0, f64::max)];
        self.domain.comm.max(&mut largest);
        largest[0]
    }

    /// Height of the highest point of any sphere, m. Collective.
    ///
    /// It is measured against gravity, or along z without gravity, from the lowest point inside all walls.
    /// Where the walls leave the bottom open, it is measured from the origin.
    pub fn bed_height(&self, y: &[f64]) -> f64 {
        let up = upwards(&self.forces.parameters.gravity);
        let centres = self.domain.centres(&y[..self.particle_numbers()]).enumerate();
        // The radius last: where all are alike, it is added to the highest centre.
        let tops = centres.map(|(i, x)| up.dot(&x) - self.ground + self.size(i).r);
        let mut top = [tops.fold(f64::NEG_INFINITY, f64::max)];
        self.domain.comm.max(&mut top);
        top[0]
    }
}

/// Row `i` of a vector, of `width` numbers.
fn row(numbers: &[f64], width: usize, i: usize) -> &[f64] {
    &numbers[i * width..(i + 1) * width]
}
