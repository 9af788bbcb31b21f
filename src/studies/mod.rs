//! Many runs: what accuracy costs, ensembles of starts, and the job pool that does both.

pub mod accuracy;
pub mod ensemble;
pub mod job_pool;
