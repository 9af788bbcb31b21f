//! Texts: the scenes and particle files that users write, the pages that they read, and the plan of the
//! source.

mod book;
mod folders;
mod fuzz;
mod scenes;
