//! Logs, tried from outside: real ones against what Python reads, made ones in every dialect and
//! layout, and damaged ones.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, in its helpers too"
)]

mod cdr;
mod damage;
mod dialects;
mod golden;
mod layouts;
mod maker;
