//! Finished beds: measures, pictures, exports, and the plots and tables of everything that is computed.

pub mod export;
pub mod folder;
pub mod measures;
pub mod pictures;
pub mod plot;
pub mod report;
pub mod text;
