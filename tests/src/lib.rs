//! What must hold across crates, whatever happens to the input: the checkers that the tests under
//! `tests/` call.

pub mod arrows;
