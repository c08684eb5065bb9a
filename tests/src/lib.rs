//! Conformance and chaos tests across crates.
