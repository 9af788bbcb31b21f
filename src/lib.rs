//! demhybrid: a discrete element solver for spheres that fall, collide, rub, roll and settle.
//!
//! The model is P. Strachota's. It has an exponential repulsion, a rebound function, regularised Coulomb
//! friction, and rotation. Its forces are smooth, so ordinary adaptive Runge-Kutta methods can integrate it.
//!
//! # Folders
//!
//! Each folder uses only those below it in this table; a test checks that.
//!
//! | folder | what it holds |
//! |---|---|
//! | [`cli`] | the command line: a file for each command; reports, warnings and stop requests |
//! | [`studies`] | studies of many runs: accuracy and ensembles, and the job pool that does their runs |
//! | [`beds`] | finished beds: measures, pictures, exports, plots and tables |
//! | [`files`] | files of a run: the output file, read and written, and checkpoints |
//! | [`engine`] | the solver: neighbour lists, kernel, forces, right-hand side, and the driver of a run |
//! | [`domain`] | ranks: communicator, slabs, ghosts, migration, agreement on errors |
//! | [`scene`] | the scene: from TOML text to checked values; keys, schema, walls and initial condition |
//! | [`model`] | what is simulated, as pure functions: contact law, walls, effects, columns of a particle |
//! | [`ode`] | methods for y' = f(t, y): tables, step control, spectral radius, method switch |
//! | [`math`] | mathematics: vectors, elementary functions, exact sums, vector instructions, statistics |
//! | [`threads`] | loops shared out over threads, and memory in large pages |
//! | [`error`] | every error that can end a run early, and stop requests |
//!
//! # From equation to function
//!
//! | equation | what | where |
//! |---|---|---|
//! | (2.1) | repulsion | [`model::contact::Law::repulsion`] |
//! | (2.2) | speed of separation | [`model::contact::Law::action`] |
//! | (2.3), (2.5) | repulsive force, pairs and walls | [`model::contact::Law::action`] |
//! | (2.4) | rebound function | [`model::contact::Rebound::share`] |
//! | (2.6), (2.9) | friction, pairs and walls | [`model::contact::Tangential::friction`] |
//! | none | friction that remembers | [`model::history::History::action`] |
//! | none | coefficients of two materials | [`model::materials::Coefficients::mixed`] |
//! | (2.7), (2.10) | slip | [`model::contact::Law::action`] |
//! | (2.8) | limiter | [`model::contact::Coulomb::limiter_over_slip`] |
//! | (2.11), (2.12) | torque | [`model::contact::Law::action`] |
//! | (2.13)-(2.15) | equations of motion | [`engine::forces::Forces::finish_stage`] |
//!
//! # One step
//!
//! 1. [`engine::simulation::Simulation`] asks [`ode::integrator::Integrator`] for a trial step. The
//!    integrator takes it with one [`ode::Method`].
//! 2. Each stage of the method evaluates the right-hand side, [`engine::dynamics::Dynamics`]. That refreshes
//!    the ghosts ([`domain::halo`]) and sums the forces of walls and pairs on each particle in the summation
//!    order ([`engine::forces`]).
//! 3. Neighbour lists give the pairs ([`engine::neighbors`]). The kernel applies the contact law
//!    ([`model::contact`]) to a batch of contacts at a time ([`engine::kernel`]).
//! 4. One reduction gives all ranks the same error, so [`ode::StepControl`] decides alike on all of them.
//! 5. Between steps particles migrate ([`domain::migration`]) and lists are rebuilt.
//! 6. A frame that is due goes to the observer ([`engine::simulation::Observer`]). The observer of
//!    `demhybrid` writes it to the output file ([`files::output::Output`]).

pub mod beds;
pub mod cli;
pub mod domain;
pub mod engine;
pub mod error;
pub mod files;
pub mod math;
pub mod model;
pub mod ode;
pub mod scene;
pub mod studies;
pub mod threads;
