//! The program as it is called: exit codes, JSON, words, and what becomes of damaged input.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

mod buckets;
mod commands;
mod damage;
mod errors;
mod explain;
mod exports;
mod golden;
mod inspect;
mod messages;
mod operator;
mod readers;
mod support;
