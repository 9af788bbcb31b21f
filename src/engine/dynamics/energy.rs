//! Energies and other measures of the whole system, with the same bits from any number of ranks.

use super::Dynamics;
use crate::domain::exact;
use crate::engine::forces::{BodyParameters, Depth, Dissipated, Stored};
use crate::math::elementary::Separate;
use crate::math::exact::{largest, total};
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::contact::{Rebound, Tangential};
use crate::model::particle::{Motion, Spin};
use crate::ode::Dissipation;

impl<R: Rebound, T: Tangential, W: Spin> Dynamics<'_, R, T, W> {
    /// Kinetic energy of all particles at `y`, J. Collective.
    pub fn kinetic_energy(&self, y: &[Motion<W>]) -> f64 {
        let BodyParameters { mass, inverse_inertia, .. } = self.forces.parameters;
        // An infinite inertia (1/I = 0) allows no spin but 0, and so holds no energy.
        let inertia = if inverse_inertia > 0.0 { 1.0 / inverse_inertia } else { 0.0 };
        let energy = |body: &Motion<W>| {
            0.5 * mass * body.v.norm_squared() + 0.5 * inertia * body.omega.vector().norm_squared()
        };
        exact::exact_sum(self.comm, y.len(), |i| energy(&y[i]))
    }

    /// Potential energy (J) of all contacts and of gravity at `y`, and the largest overlap (m). Collective.
    ///
    /// The energy of a contact is rho(0) times the energy that it stores, so that H of docs/design.md never
    /// grows.
    pub fn potential_energy(&mut self, y: &[Motion<W>]) -> (f64, f64) {
        self.put_bodies(y);
        let BodyParameters { mass, gravity, .. } = self.forces.parameters;
        let height = |i: usize| -mass * gravity.dot(&y[i].x);
        let (law, forces) = (self.forces.law, &mut self.forces);
        let mut depths = forces.largest(&Depth(law.l_max));
        self.comm.max(&mut depths);
        let [depth, overlap] = depths;
        // The closest contact stores most. All ranks compute the same number.
        let most = law.energies().stored::<Separate>(law.l_max - depth);
        let highest = largest(y.len(), height);
        let [energy] = exact::exact_sums(self.comm, [larger(most, highest)], |[scale]| {
            let [stored, _] = forces.total(&Stored(law.energies()), |terms| [scale.integer(terms[0]), 0]);
            [stored + total(y.len(), height, scale)]
        });
        (energy, overlap)
    }

    /// Unbalanced force: 0 in perfect balance, 1 in free fall; NaN if there are no forces at all. Collective.
    ///
    /// It is the sum of the net forces on all particles over the sum of all contact forces and weights.
    /// `slope` holds the accelerations. Each contact counts once, with its force at rest (rho(0) F).
    pub fn unbalanced_force(&mut self, y: &[Motion<W>], slope: &[Motion<W>]) -> f64 {
        let BodyParameters { mass, gravity, .. } = self.forces.parameters;
        let net = exact::exact_sum(self.comm, slope.len(), |i| mass * slope[i].v.norm());
        let height = exact::exact_sum(self.comm, y.len(), |i| -mass * gravity.dot(&y[i].x));
        // The force of a contact at rest is kappa times the energy that it stores, apart from the cut at
        // l_max.
        let stored = self.potential_energy(y).0 - height;
        let weights = mass * gravity.norm() * self.count() as f64;
        net / (self.forces.law.kappa * stored.max(0.0) + weights)
    }

    /// Power that contacts dissipate by rebound and by friction in the state of the last right-hand side, W.
    /// Collective.
    pub(super) fn dissipated_power(&mut self) -> Dissipation {
        let (law, forces) = (self.forces.law, &mut self.forces);
        let dissipated = Dissipated(law.energies());
        exact::exact_sums(self.comm, forces.largest(&dissipated), |scales| {
            forces.total(&dissipated, |power| [0, 1].map(|k| scales[k].integer(power[k])))
        })
    }

    /// Height of the highest point of any sphere above the origin, m. Collective.
    ///
    /// It is measured against gravity, or along z without gravity.
    pub fn bed_height(&self, y: &[Motion<W>]) -> f64 {
        let up = (-self.forces.parameters.gravity).try_normalize(0.0).unwrap_or(Vec3::z());
        let mut top = [y.iter().map(|body| up.dot(&body.x)).fold(f64::NEG_INFINITY, f64::max)];
        self.comm.max(&mut top);
        top[0] + self.forces.law.r
    }
}
