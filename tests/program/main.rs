//! The real program as a user starts it: alone or under mpirun, with every command, stopped, killed and taken
//! up again.

mod accuracy;
mod analyze;
mod analyze_sizes;
mod beds;
#[cfg(feature = "long-tests")]
mod browser;
#[cfg(feature = "long-tests")]
mod builds;
mod cli;
mod comparison;
#[cfg(feature = "mpi")]
mod documents;
mod ensemble;
mod examples;
mod exports;
#[cfg(feature = "mpi")]
mod materials;
#[cfg(feature = "mpi")]
mod mpi;
mod mpirun;
mod python;
mod readers;
mod regions;
mod render;
mod restart;
mod results;
#[cfg(feature = "mpi")]
mod sizes;
#[cfg(feature = "mpi")]
mod species;
mod starts;
mod streams;
mod writers;
