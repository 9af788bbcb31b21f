//! Finished beds: measures, pictures and exports. Also the plots and text helpers for all tables and figures.

pub mod export;
pub mod folder;
pub mod measures;
pub mod pictures;
pub mod plot;
pub mod report;
pub mod text;
