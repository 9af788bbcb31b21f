//! How close the program comes to what is known exactly.

pub mod exact;
