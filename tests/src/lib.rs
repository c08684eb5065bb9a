//! What must hold across crates, whatever happens to the input: the checkers and fixtures that the
//! tests under `tests/` call.

pub mod arrows;
pub mod documents;
pub mod faulty;
pub mod logs;
pub mod pictures;
pub mod towns;
pub mod trial;
