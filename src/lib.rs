//! demhybrid: a discrete element solver for spheres that fall, collide, rub, roll and settle.
//!
//! The model is P. Strachota's: a smooth exponential repulsion, a rebound function, regularised Coulomb friction and
//! rotation, smooth enough for ordinary adaptive Runge-Kutta methods.
//!
//! # From equation to function
//!
//! | equation | what | where |
//! |---|---|---|
//! | (2.1) | repulsion | [`contact::Law::repulsion`] |
//! | (2.2) | speed of separation | [`contact::Law::action`] |
//! | (2.3), (2.5) | repulsive force, pairs and walls | [`contact::Law::action`] |
//! | (2.4) | rebound function | [`contact::Rebound::share`] |
//! | (2.6), (2.9) | friction, pairs and walls | [`contact::Tangential::friction`] |
//! | (2.7), (2.10) | slip | [`contact::Law::action`], [`particle::Spin::less_surface_velocity`] |
//! | (2.8) | limiter | [`contact::Coulomb::limiter_over_slip`] |
//! | (2.11), (2.12) | torque | [`particle::Spin::torque`] |
//! | (2.13)-(2.15) | equations of motion | [`forces::Forces::finish_stage`] |
//!
//! # One step
//!
//! [`simulation::Simulation`] asks an [`ode::Method`] for a trial step; every stage calls [`dynamics::Dynamics`], which
//! refreshes the ghosts ([`domain::halo`]) and adds walls and pairs ([`neighbors`], [`contact`], [`kernel`]) to their particles in
//! one order of sums ([`forces`]). One reduction gives all ranks the same error, and [`ode::StepControl`] the same
//! decision. Between steps particles migrate ([`domain::migration`]) and lists are rebuilt. Frames go to the
//! observer, which in the program is [`output::Output`].

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
