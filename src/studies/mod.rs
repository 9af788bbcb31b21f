//! Studies of many runs: what accuracy costs, and ensembles. The job pool does the runs of both.

pub mod accuracy;
pub mod ensemble;
pub mod job_pool;
