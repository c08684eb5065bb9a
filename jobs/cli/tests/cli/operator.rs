//! What whoever runs jobs asks for: logs, metrics, completions, man pages, and a quiet end of a pipe.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::support::{Town, on, run, tilefold, tilefold_in};

#[test]
fn logs_are_json_lines_that_tell_the_steps_and_the_losses() {
    let town = Town::new();
    let store = town.init("store");
    let log = fs::read(&town.city.logs[0]).unwrap();
    let cut = town.path("cut.mcap");
    fs::write(&cut, &log[..log.len() / 2]).unwrap();
    let logs = [cut, town.city.logs[1].clone()];
    let options = [
        "--log-level",
        "info",
        "--log-form",
        "json",
        "--format",
        "json",
    ];
    let said = run(&store, &logs, &options).with_code(3);
    let report = said.json();
    let lines: Vec<Value> = said
        .err
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect();
    let of = |message: &str| {
        let is_it = |line: &&Value| line["message"] == message;
        lines
            .iter()
            .find(is_it)
            .unwrap_or_else(|| panic!("{message}: {}", said.err))
    };
    assert_eq!(of("logs indexed")["logs"], 2);
    assert_eq!(of("logs mapped")["chunks"], report["chunks_mapped"]);
    assert_eq!(of("committed")["version"], report["version"]);
    let job = &of("committed")["in"][0];
    assert_eq!(job["name"], "run");
    assert_eq!(job["store"], store.to_str().unwrap());
    let lost = of("set aside");
    assert!(
        lost["file"].as_str().unwrap().contains("cut.mcap"),
        "{lost}"
    );
    assert!(lost["time"].as_str().unwrap().ends_with('Z'), "{lost}");
    for line in &lines {
        let target = line["target"].as_str().unwrap();
        assert!(target.starts_with("tilefold"), "{line}");
    }
}

#[test]
fn what_is_logged_changes_no_result() {
    let town = Town::new();
    let digest = |store: &str, level: &str| {
        let path = town.init(store);
        run(&path, &town.city.logs, &["--log-level", level]).with_code(0);
        on("verify", &path, &["--format", "json"]).json()["digest"].clone()
    };
    assert_eq!(digest("quiet", "off"), digest("loud", "trace"));
}

#[test]
fn nothing_is_logged_unless_it_is_asked_for() {
    let town = Town::new();
    let store = town.init("store");
    let said = run(&store, &town.city.logs, &[]).with_code(0);
    assert!(!said.err.contains("INFO"), "{said:?}");
    let loud = [("TILEFOLD_LOG_LEVEL", "info")];
    let again = tilefold_in(
        loud,
        [
            "run".as_ref(),
            store.as_os_str(),
            town.city.logs[0].as_ref(),
        ],
    );
    again.with_code(0).names(&["INFO", "nothing new"]);
}

/// Samples of a metrics page by name and labels; the page must be in Prometheus's text form.
fn samples(page: &str) -> BTreeMap<String, f64> {
    let mut typed = String::new();
    let mut samples = BTreeMap::new();
    for line in page.lines() {
        if let Some(rest) = line.strip_prefix("# TYPE ") {
            typed = rest.strip_suffix(" gauge").unwrap().to_owned();
        } else if !line.starts_with("# HELP ") {
            let (name, value) = line.rsplit_once(' ').unwrap();
            let bare = name.split('{').next().unwrap();
            assert_eq!(bare, typed, "{line}");
            assert!(
                samples
                    .insert(name.to_owned(), value.parse().unwrap())
                    .is_none()
            );
        }
    }
    samples
}

#[test]
fn metrics_say_how_a_run_ended() {
    let town = Town::new();
    let store = town.init("store");
    let file = town.path("tilefold.prom");
    let options = ["--metrics", file.to_str().unwrap(), "--format", "json"];
    let report = run(&store, &town.city.logs, &options).with_code(0).json();
    let page = samples(&fs::read_to_string(&file).unwrap());
    let is = |name: &str, value: f64| assert_eq!(page[name], value, "{name} in {page:?}");
    is("tilefold_run_running", 0.0);
    is("tilefold_run_ok", 1.0);
    is(
        "tilefold_run_store_version",
        report["version"].as_f64().unwrap(),
    );
    is(
        "tilefold_run_chunks_mapped",
        report["chunks_mapped"].as_f64().unwrap(),
    );
    is("tilefold_run_logs", town.city.logs.len() as f64);
    let frames = report["stages"].as_array().unwrap().iter();
    let frames = frames
        .clone()
        .find(|stage| stage["stage"] == "map")
        .unwrap();
    let name = "tilefold_run_stage_items{stage=\"map\",unit=\"frames\"}";
    is(name, frames["items"].as_f64().unwrap());

    let other = ["--registration", "off", "--metrics", file.to_str().unwrap()];
    run(&store, &town.city.logs, &other).with_code(1);
    let page = samples(&fs::read_to_string(&file).unwrap());
    assert_eq!(page["tilefold_run_ok"], 0.0);
    let left: Vec<_> = fs::read_dir(town.folder.path())
        .unwrap()
        .flatten()
        .collect();
    assert!(
        left.iter()
            .all(|entry| !entry.file_name().to_string_lossy().ends_with(".tmp"))
    );
}

#[test]
fn every_command_has_a_man_page_and_is_completed() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let said = tilefold(["man", "--out", out, "--format", "json"]).with_code(0);
    let reference = tilefold(["reference"]).with_code(0).out;
    let commands: Vec<&str> = reference
        .lines()
        .filter_map(|line| line.strip_prefix("## tilefold "))
        .collect();
    assert!(commands.len() > 20, "{commands:?}");
    let bash = tilefold(["completions", "bash"]).with_code(0).out;
    for command in &commands {
        let page = folder.path().join(format!("tilefold-{command}.1"));
        let page = fs::read_to_string(&page).unwrap_or_else(|error| panic!("{command}: {error}"));
        assert!(page.contains(".SH SYNOPSIS"), "{command}");
        assert!(bash.contains(&format!("tilefold,{command})")), "{command}");
    }
    assert_eq!(said.json()["pages"], commands.len() + 1);
    for shell in ["zsh", "fish", "elvish", "powershell"] {
        assert!(!tilefold(["completions", shell]).with_code(0).out.is_empty());
    }
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    for words in [&["reference"][..], &["completions", "zsh"]] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tilefold"))
            .args(words)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Closed before anything is read: what is written breaks, whatever the pipe's size.
        drop(child.stdout.take());
        let mut said = String::new();
        child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut said)
            .unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{words:?}: {said}");
        assert_eq!(said, "", "{words:?}");
    }
}

#[test]
fn a_demo_is_one_json_value() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let out = out.to_str().unwrap();
    let told = tilefold(["demo", "--out", out, "--format", "json"])
        .with_code(0)
        .json();
    assert!(told["run"]["version"].as_i64().unwrap() > 1);
    assert!(told["evaluate"]["change"].is_object(), "{told}");
    assert!(told["init"]["elements"].as_u64().unwrap() > 0);
}
