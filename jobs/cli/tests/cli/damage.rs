//! Damaged logs among sound ones: exit code 3, each loss by file and reason, and the rest of the
//! result as if they had never been given.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader};
use tilefold_formats::log_write::{Dialect, Entry, LogWriter};
use tilefold_schemas::log::{LogMessage, Payload};

use crate::support::{Town, on, run};

/// The layers of the latest version.
fn layers(store: &Path) -> Value {
    on("show", store, &["--format", "json"]).with_code(0).json()["tiles"].clone()
}

/// The log's messages that `keep` accepts, in a log of the vehicle `victim`.
fn rewrite(log: &Path, keep: impl Fn(&LogMessage) -> bool) -> Vec<u8> {
    let index = LogIndex::open(log).unwrap();
    let mut messages = Vec::new();
    LogReader::new()
        .read(
            &index,
            |_, _| true,
            ALL_TIME,
            |message| messages.push(message),
        )
        .unwrap();
    messages.sort_by_key(|message| message.log_time_ns);
    let sink = Cursor::new(Vec::new());
    let mut writer = LogWriter::create(sink, Dialect::Ros2, "victim", []).unwrap();
    for message in messages.iter().filter(|message| keep(message)) {
        writer
            .write(Entry {
                topic: &index.topics[message.topic].name,
                stamp_ns: message.stamp_ns,
                log_time_ns: message.log_time_ns,
                frame_id: &message.frame_id,
                payload: &message.payload,
            })
            .unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// Runs the sound logs together with one of these bytes.
fn check(town: &Town, name: &str, bytes: &[u8], kind: &str, why: &str) -> PathBuf {
    let file = format!("{name}.mcap");
    let path = town.path(&file);
    fs::write(&path, bytes).unwrap();
    let logs = [town.city.logs[1..].to_vec(), vec![path.clone()]].concat();

    let store = town.init(name);
    let said = run(&store, &logs, &[]).with_code(3);
    said.names(&["set aside: ", kind, &path.display().to_string(), why]);
    assert!(said.out.contains("committed version 2"), "{said:#?}");

    let json = town.init(&format!("{name}_json"));
    let said = run(&json, &logs, &["--format", "json"]).with_code(3);
    let report = said.json();
    let losses = report["set_aside"].as_array().unwrap();
    assert!(!losses.is_empty());
    for loss in losses {
        assert_eq!(loss["file"], path.display().to_string(), "{loss}");
        assert!(loss["count"].as_u64().unwrap() > 0, "{loss}");
    }
    let is_named = |loss: &Value| {
        loss["kind"] == kind
            && loss["reason"]
                .as_str()
                .is_some_and(|text| text.contains(why))
    };
    assert!(losses.iter().any(is_named), "{losses:#?}");

    on("verify", &store, &[]).with_code(0);
    assert_eq!(layers(&store), layers(&json));
    store
}

#[test]
fn what_is_of_no_use_changes_nothing() {
    let town = Town::new();
    let victim = &town.city.logs[0];
    let sound = layers(&town.store("sound", &town.city.logs[1..]));
    let without_fixes = rewrite(victim, |message| {
        !matches!(message.payload, Payload::Gnss(_))
    });
    let without_frames = rewrite(victim, |message| {
        !matches!(message.payload, Payload::Detections(_))
    });
    for (name, bytes, kind, why) in [
        ("words", b"no log at all\n".to_vec(), "file", "no MCAP file"),
        ("empty", Vec::new(), "file", "no MCAP file"),
        ("without_gnss", without_fixes, "drive", "GNSS"),
        ("without_detections", without_frames, "drive", "detections"),
    ] {
        let store = check(&town, name, &bytes, kind, why);
        assert_eq!(layers(&store), sound, "{name}");
    }
}

#[test]
fn what_is_damaged_is_used_in_part() {
    let town = Town::new();
    let log = fs::read(&town.city.logs[0]).unwrap();
    let sound = town.store("sound", &town.city.logs[1..]);

    let cut = &log[..log.len() * 2 / 3];
    check(&town, "cut", cut, "log_section", "the file");

    let mut flipped = log.clone();
    flipped[log.len() / 3] ^= 4;
    let store = check(&town, "flipped", &flipped, "log_section", "messages");

    // The sound log mends what the damaged copy lacked.
    run(&store, &town.city.logs, &[]).with_code(0);
    run(&sound, &town.city.logs, &[]).with_code(0);
    assert_eq!(layers(&store), layers(&sound));
}

#[test]
fn a_plan_names_what_the_summaries_tell() {
    let town = Town::new();
    let words = town.path("words.mcap");
    fs::write(&words, "no log").unwrap();
    let store = town.init("store");
    run(&store, &[town.city.logs[0].clone(), words], &["--plan"])
        .with_code(3)
        .names(&["words.mcap", "no MCAP file"]);
}

#[test]
fn names_do_not_reach_the_terminal_raw() {
    let town = Town::new();
    let nasty = town.path("red\u{1b}[31m\nname.mcap");
    fs::write(&nasty, "no log").unwrap();
    let store = town.init("store");
    let said = run(&store, &[nasty, town.city.logs[0].clone()], &[]).with_code(3);
    assert!(!said.err.contains('\u{1b}'), "{said:#?}");
    assert_eq!(said.err.lines().count(), 2, "{said:#?}");
}
