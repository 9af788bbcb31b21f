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
//! | (2.13)-(2.15) | equations of motion | [`forces::Forces::close`] |
//!
//! # One step
//!
//! [`simulation::Simulation`] asks an [`ode::Method`] for a trial step; every stage calls [`dynamics::Dynamics`], which
//! refreshes the ghosts ([`domain::halo`]) and adds walls and pairs ([`neighbors`], [`contact`], [`kernel`]) to their particles in
//! one order of sums ([`forces`]). One reduction gives all ranks the same error, and [`ode::StepControl`] the same
//! decision. Between steps particles migrate ([`domain::migration`]) and lists are rebuilt. Frames go to the
//! observer, which in the program is [`output::Output`].

pub mod accuracy;
pub mod agreement;
pub mod analysis;
pub mod checkpoint;
pub mod cli;
pub mod contact;
pub mod container;
pub mod domain;
pub mod dynamics;
pub mod effects;
pub mod elementary;
pub mod ensemble;
pub mod error;
pub mod farm;
pub mod forces;
pub mod instructions;
pub mod kernel;
pub mod launch;
pub mod neighbors;
pub mod ode;
pub mod output;
pub mod outside;
pub mod parallel;
pub mod particle;
pub mod program;
pub mod record;
pub mod render;
pub mod report;
pub mod scene;
pub mod simulation;
pub mod start;
pub mod tools;
pub mod wish;
