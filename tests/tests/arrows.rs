//! The workspace has the arrows of the architecture and no others.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::env;
use std::path::Path;
use std::process::Command;

use tilefold_tests::arrows::{arrows, wrong_arrows};

fn metadata() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let output = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args("metadata --format-version 1 --no-deps --offline".split(' '))
        .current_dir(root)
        .output()
        .expect("cargo starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "`cargo metadata` failed: {said}");
    String::from_utf8(output.stdout).expect("cargo speaks UTF-8")
}

#[test]
fn every_arrow_is_one_of_the_architecture() {
    let wrong = wrong_arrows(&metadata()).unwrap();
    let lines: Vec<String> = wrong.iter().map(ToString::to_string).collect();
    assert!(
        wrong.is_empty(),
        "arrows that the architecture does not have:\n  {}",
        lines.join("\n  ")
    );
}

#[test]
fn the_arrows_are_really_read() {
    let arrows = arrows(&metadata()).unwrap();
    let found = |from: &str, to: &str| arrows.iter().any(|a| a.from == from && a.to == to);
    assert!(found("tilefold-workers", "tilefold-schemas"));
    assert!(found("tilefold", "tilefold-engine"));
}
