//! The method that takes the steps: the one that the scene names, or the one that `auto` finds best.

use crate::ode::{
    Anchor, Chebyshev, DORMAND_PRINCE, Ivp, MERSON, Method, Norm, RungeKutta, Trial, Verdict, Verlet,
};
use crate::scene::Scene;

/// Takes steps with one method at a time.
pub struct Integrator<'c, P: Ivp> {
    method: Box<dyn Method<P> + 'c>,
    /// Largest stable step from the anchor, s; none before it has been asked for.
    stable: Option<f64>,
}

impl<'c, P: Ivp + 'c> Integrator<'c, P> {
    /// The method of the scene.
    pub fn new(scene: &Scene) -> Self {
        let method: Box<dyn Method<P> + 'c> = match scene.solver.method.as_str() {
            "merson" => Box::new(RungeKutta::new(&MERSON)),
            "dormand-prince" => Box::new(RungeKutta::new(&DORMAND_PRINCE)),
            "velocity-verlet" => Box::new(Verlet::new()),
            _ => Box::new(Chebyshev::new()),
        };
        Integrator { method, stable: None }
    }

    pub fn prepare(&mut self, ivp: &mut P, anchor: &mut Anchor<P::State>) -> u64 {
        if self.stable.is_some() {
            return 0;
        }
        let (stable, evaluations) = self.method.stable_step(ivp, anchor);
        self.stable = Some(stable);
        evaluations
    }

    pub fn stable_step(&self) -> f64 {
        self.stable.unwrap_or(f64::INFINITY)
    }

    pub fn error_order(&self) -> f64 {
        self.method.error_order()
    }

    pub fn attempt(
        &mut self,
        ivp: &mut P,
        anchor: &mut Anchor<P::State>,
        h: f64,
        norm: &Norm,
        trial: &mut Trial<P::State>,
    ) -> Verdict {
        self.method.attempt(ivp, anchor, h, norm, trial)
    }

    pub fn inside(
        &self,
        share: f64,
        h: f64,
        anchor: &Anchor<P::State>,
        trial: &Trial<P::State>,
    ) -> Option<Vec<P::State>> {
        (0..anchor.y.len()).map(|i| self.method.inside(share, h, anchor, trial, i)).collect()
    }

    pub fn rejected(&mut self) {
        self.method.rejected();
        self.stable = None;
    }

    pub fn accepted(&mut self, _h: f64) {
        self.stable = None;
    }

    pub fn error_of(
        &self,
        i: usize,
        h: f64,
        norm: &Norm,
        anchor: &Anchor<P::State>,
        trial: &Trial<P::State>,
    ) -> f64 {
        self.method.error_of(i, h, norm, anchor, trial)
    }

    pub fn vectors(&self) -> usize {
        self.method.vectors()
    }

    pub fn report(&self) -> String {
        self.method.name().to_owned()
    }
}
