//! What the observer of a run receives: frames and checkpoints; and the outcome of the run.

use super::{Counts, Frame, Observer, Outcome, Simulation, Snapshot};
use crate::domain::rows::{self, ById};
use crate::error::{Error, StopRequest};
use crate::model::columns::Changes;
use crate::ode::Dissipation;
use std::time::Instant;

impl Simulation<'_> {
    /// Writes a checkpoint if one is due or requested. Returns whether the run must stop there. Collective.
    pub(super) fn save_if_asked(&mut self, observer: &mut dyn Observer) -> Result<bool, Error> {
        let request = match self.dynamics.request() {
            // Every process takes at least one step. If not, a run in several parts might never finish.
            StopRequest::WallLimit | StopRequest::StopFile if !self.moved_on => StopRequest::Nothing,
            request => request,
        };
        if request != StopRequest::Nothing || self.schedule.checkpoint_is_due(self.step_start.t) {
            self.save(observer)?;
        }
        Ok(request.stops())
    }

    /// Passes a checkpoint to `observer`: the run as it was before the last trial. Collective.
    pub(super) fn save(&mut self, observer: &mut dyn Observer) -> Result<(), Error> {
        let Some(mut memory) = self.memory else { return Ok(()) };
        let clock = Instant::now();
        let (step_start, dynamics) = (&self.step_start, &self.dynamics);
        let pairs = &mut memory.progress.counts.pairs;
        *pairs = dynamics.total_pairs(*pairs);
        observer.checkpoint(&Snapshot {
            memory,
            count: dynamics.count(),
            ids: dynamics.ids(),
            columns: dynamics.columns(),
            constants: dynamics.constants(),
            state: &step_start.y,
            origin: dynamics.origin(),
            slope: if memory.slope_known { &step_start.slope } else { &[] },
            direction: if memory.direction_known { &step_start.direction } else { &[] },
        })?;
        self.schedule.saved = step_start.t;
        self.clock.output_seconds += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// Passes the result of the trial, at time `t` (s), to the observer as a frame. Collective.
    pub(super) fn show_result(&mut self, t: f64, observer: &mut dyn Observer) -> Result<(), Error> {
        let state = std::mem::take(&mut self.trial.next);
        let dissipated = [0, 1].map(|k| self.progress.dissipated[k] + self.trial.dissipated[k]);
        self.show(t, &state, dissipated, observer)?;
        self.trial.next = state;
        Ok(())
    }

    /// Passes the state at time `t` (s) to the observer as a frame. Collective.
    pub(super) fn show(
        &mut self,
        t: f64,
        state: &[f64],
        dissipated: Dissipation,
        observer: &mut dyn Observer,
    ) -> Result<(), Error> {
        let clock = Instant::now();
        let dynamics = &mut self.dynamics;
        self.progress.counts.pairs = dynamics.pair_evaluations();
        self.progress.counts.rebuilds = dynamics.rebuilds();
        let (potential_energy, largest_overlap) = dynamics.potential_energy(state);
        let (count, ids, columns) = (dynamics.count(), dynamics.ids(), dynamics.columns());
        let width = columns.width(Changes::EveryStage);
        let rows = ById::new(self.comm, count, ids, state, width);
        let constant = columns.width(Changes::WithLists);
        // Without such columns there is nothing to collect.
        let constants = match constant {
            0 => ById::none(),
            width => ById::new(self.comm, count, ids, dynamics.constants(), width),
        };
        let shown = observer.frame(&Frame {
            time: t,
            step: self.progress.last,
            counts: self.progress.counts,
            kinetic_energy: dynamics.kinetic_energy(state),
            potential_energy,
            largest_overlap,
            bed_height: dynamics.bed_height(state),
            dissipated,
            clocks: dynamics.clocks,
            output_seconds: self.clock.output_seconds,
            first: rows::block(dynamics.count(), self.comm.rank(), self.comm.size()).start,
            rows: &rows,
            constants: &constants,
            columns,
        });
        if matches!(shown, Err(Error::Replaced { .. })) {
            self.save(observer)?;
        }
        shown?;
        self.progress.largest_overlap = self.progress.largest_overlap.max(largest_overlap);
        self.clock.output_seconds += clock.elapsed().as_secs_f64();
        Ok(())
    }

    pub(super) fn outcome(&self) -> Outcome {
        let request = self.dynamics.request();
        Outcome {
            time: self.step_start.t,
            stopped: request.stops().then_some(request),
            at_rest_by: None,
            counts: Counts {
                pairs: self.dynamics.pair_evaluations(),
                rebuilds: self.dynamics.rebuilds(),
                ..self.progress.counts
            },
            own_pairs: self.dynamics.own_pairs(),
            clocks: self.dynamics.clocks,
            output_seconds: self.clock.output_seconds,
            seconds: self.clock.started.elapsed().as_secs_f64(),
            largest_overlap: self.progress.largest_overlap,
            choice: self.integrator.report(),
            cutoff: self.cutoff,
            bytes: self.dynamics.bytes() + self.step_start.bytes() + self.trial.bytes(),
            ghosts: self.dynamics.ghosts(),
        }
    }
}
