//! Each command on a small city: exit code, JSON and words.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader};
use tilefold_schemas::log::{LogMessage, Payload};

use crate::support::{Town, keys, on, run, tilefold};

#[test]
fn the_whole_road() {
    let town = Town::new();
    let store = town.init("store");

    let ran = run(&store, &town.city.logs, &["--format", "json"]).with_code(0);
    let report = ran.json();
    assert_eq!(report["version"], 2);
    assert_eq!(report["is_new_version"], true);
    assert_eq!(report["logs"], 6);
    assert_eq!(report["vehicles"], 6);
    assert_eq!(report["set_aside"], Value::Array(Vec::new()));
    assert!(report["chunks_mapped"].as_u64().unwrap() >= 6);
    let stages: Vec<&str> = report["stages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|stage| {
            assert_eq!(
                keys(stage),
                [
                    "stage",
                    "unit",
                    "items",
                    "bytes",
                    "busy_s",
                    "items_per_busy_s",
                    "mb_per_busy_s"
                ]
            );
            stage["stage"].as_str().unwrap()
        })
        .collect();
    assert_eq!(
        stages,
        ["index", "read", "map", "exchange", "reduce", "commit"]
    );
    // Nothing but the result, and no bars: standard error is no terminal.
    assert_eq!(ran.err, "");

    let again = run(&store, &town.city.logs, &[]).with_code(0);
    assert!(again.out.contains("nothing new; still at version 2"));
    assert_eq!(again.err, "");

    let log = on("log", &store, &["--format", "json"]).with_code(0).json();
    let operations: Vec<_> = log
        .as_array()
        .unwrap()
        .iter()
        .map(|line| (line["version"].as_i64(), line["operation"].as_str()))
        .collect();
    assert!(operations.contains(&(Some(1), Some("init"))), "{log}");
    assert!(operations.contains(&(Some(2), Some("run"))), "{log}");
    assert!(on("log", &store, &[]).with_code(0).out.contains("run"));

    let show = on("show", &store, &["--format", "json"])
        .with_code(0)
        .json();
    assert_eq!(
        keys(&show),
        ["version", "operation", "fusion_model", "tiles"]
    );
    assert_eq!(show["version"], 2);
    assert_eq!(show["fusion_model"], "calibrated");
    let tile = &show["tiles"][0];
    let names = [
        "tile",
        "no_change",
        "added",
        "removed",
        "modified",
        "unknown",
        "stale",
        "digest",
    ];
    assert_eq!(keys(tile), names);
    let words = on("show", &store, &["--version", "1"]).with_code(0).out;
    assert!(words.contains("version 1 (init)"), "{words}");

    let verify = on("verify", &store, &["--format", "json"]).with_code(0);
    let verify = verify.json();
    assert_eq!(keys(&verify), ["version", "digest", "ok"]);
    assert_eq!(verify["version"], 2);
    assert_eq!(verify["ok"], true);
    assert_eq!(verify["digest"].as_str().unwrap().len(), 64);
}

#[test]
fn a_folder_stands_for_its_logs() {
    let town = Town::new();
    let one_by_one = town.store("one_by_one", &town.city.logs);
    let folder = town.store("folder", &[town.path("logs")]);
    let tiles = |store| on("show", store, &["--format", "json"]).json()["tiles"].clone();
    assert_eq!(tiles(&one_by_one), tiles(&folder));
}

#[test]
fn threads_and_progress_do_not_change_the_result() {
    let town = Town::new();
    let stores = ["1", "2"].map(|threads| {
        let store = town.init(threads);
        let options = ["--threads", threads, "--progress", "off"];
        run(&store, &town.city.logs, &options).with_code(0);
        on("verify", &store, &["--format", "json"]).json()["digest"].clone()
    });
    assert_eq!(stores[0], stores[1]);
}

#[test]
fn a_plan_changes_nothing() {
    let town = Town::new();
    let store = town.init("store");
    let said = run(&store, &town.city.logs, &["--plan", "--format", "json"]).with_code(0);
    let plan = said.json();
    let names = [
        "logs",
        "bytes",
        "vehicles",
        "units",
        "messages",
        "set_aside",
    ];
    for name in names {
        assert!(keys(&plan).contains(&name), "{plan}");
    }
    assert_eq!(plan["logs"], 6);
    let show = on("show", &store, &["--format", "json"]).json();
    assert_eq!(show["version"], 1);
    assert!(
        run(&store, &town.city.logs, &["--plan"])
            .with_code(0)
            .out
            .contains("would read 6 logs of 6 vehicles")
    );
}

#[test]
fn evaluations_have_the_promised_form() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let truth = town.city.truth.to_str().unwrap();
    let drawn: Value = serde_json::from_slice(&fs::read(truth).unwrap()).unwrap();
    let drawn = drawn["features"].as_array().unwrap();
    let of_type = |name: &str| {
        let is = |feature: &&Value| feature["properties"]["change_type"] == name;
        drawn.iter().filter(is).count()
    };
    for model in ["paper", "calibrated"] {
        let options = ["--truth", truth, "--model", model, "--format", "json"];
        let evaluation = on("evaluate", &store, &options).with_code(0).json();
        assert_eq!(evaluation["fusion_model"], model);
        assert_eq!(evaluation["threshold"], 0.85);
        let change = &evaluation["change"];
        for name in ["precision", "recall", "f1", "by_type"] {
            assert!(keys(change).contains(&name), "{change}");
        }
        // All true changes are asked for, none twice.
        assert_eq!(change["truth"], drawn.len());
        for name in ["added", "removed", "modified"] {
            assert_eq!(change["by_type"][name]["truth"], of_type(name), "{change}");
        }
        assert!(keys(&evaluation).contains(&"matching"));
        assert_eq!(keys(&evaluation["calibration"]), ["ece", "brier", "bins"]);
        assert_eq!(
            evaluation["calibration"]["bins"].as_array().unwrap().len(),
            15
        );
        let thresholds: Vec<&Value> = change["sweep"]
            .as_array()
            .unwrap()
            .iter()
            .map(|point| &point["threshold"])
            .collect();
        assert_eq!(thresholds, [0.70, 0.75, 0.80, 0.85, 0.90, 0.95]);
        // The other model is beside it, and single vehicles of both.
        let other = &evaluation["other_model"];
        assert_ne!(other["fusion_model"], model);
        assert_eq!(other["change"]["truth"], drawn.len());
        for findings in [&evaluation, other] {
            assert_eq!(findings["single_vehicle"]["vehicles"], 6);
            assert!(findings["single_vehicle"]["change"]["truth"].as_u64() > Some(0));
        }
        assert!(evaluation["geometry"].is_object());
        assert_eq!(keys(&evaluation["control"]), ["judged", "claimed"]);
        assert!(evaluation["control"]["judged"].as_u64().unwrap() > 0);
    }
    // What is folded anew is what the version says, and nothing was written.
    let evaluation = |model| {
        let options = ["--truth", truth, "--model", model, "--format", "json"];
        on("evaluate", &store, &options).with_code(0).json()
    };
    let (paper, calibrated) = (evaluation("paper"), evaluation("calibrated"));
    assert_eq!(paper["change"], calibrated["other_model"]["change"]);
    assert_eq!(
        paper["other_model"]["calibration"],
        calibrated["calibration"]
    );
    assert_eq!(
        on("show", &store, &["--format", "json"]).json()["version"],
        2
    );
    // Without truth, everything claimed is a false alarm; before any drive, nothing is.
    let options = ["--version", "1", "--format", "json"];
    let control = on("evaluate", &store, &options).with_code(0).json();
    assert_eq!(control["change"]["claimed"], 0);
    assert_eq!(control["change"]["precision"], Value::Null);
    assert_eq!(control["calibration"]["ece"], Value::Null);
    let words = on("evaluate", &store, &["--truth", truth]).with_code(0).out;
    assert!(words.contains("fold calibrated at T >= 0.85, V >= 5"));
    assert!(words.contains("all, paper"), "{words}");
    assert!(words.contains("6 vehicles alone, paper"), "{words}");
    let options = ["--truth", truth, "--single-vehicles", "0"];
    let words = on("evaluate", &store, &options).with_code(0).out;
    assert!(!words.contains("alone"), "{words}");
}

#[test]
fn evaluations_know_details_and_draw() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let text = fs::read_to_string(&town.city.truth).unwrap();
    let mut truth: Value = serde_json::from_str(&text).unwrap();
    for feature in truth["features"].as_array_mut().unwrap() {
        feature["properties"]["detail"] = "construction".into();
        feature["properties"]["since"] = "2026-03-02T06:00:00+01:00".into();
        feature["properties"]["who_told"] = "a neighbour".into();
    }
    let file = town.path("detailed.geojson");
    fs::write(&file, truth.to_string()).unwrap();
    let plots = town.path("plots");
    let [truth, folder] = [&file, &plots].map(|path| path.to_str().unwrap());
    let options = ["--truth", truth, "--plots", folder];
    let said = on("evaluate", &store, &options).with_code(0);
    assert!(said.out.contains("construction"), "{said:#?}");
    for (name, begins) in [
        ("reliability.svg", &b"<svg"[..]),
        ("sweep.svg", b"<svg"),
        ("reliability.png", b"\x89PNG"),
        ("sweep.png", b"\x89PNG"),
    ] {
        said.names(&[name]);
        let bytes = fs::read(plots.join(name)).unwrap();
        assert!(bytes.starts_with(begins), "{name}");
    }
    let again = town.path("again");
    let options = ["--truth", truth, "--plots", again.to_str().unwrap()];
    on("evaluate", &store, &options).with_code(0);
    for name in ["sweep.svg", "sweep.png"] {
        let bytes = |folder: &std::path::Path| fs::read(folder.join(name)).unwrap();
        assert_eq!(bytes(&plots), bytes(&again), "{name}");
    }
}

#[test]
fn matching_is_held_against_a_truth() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let log = &town.city.logs[0];
    let mut rows = String::from("vehicle,topic,stamp_ns,detection,element_id\n");
    let mut detections = 0;
    let index = LogIndex::open(log).unwrap();
    let mut row = |message: LogMessage| {
        if let Payload::Detections(frame) = &message.payload {
            for number in 0..frame.detections.len() {
                detections += 1;
                rows += &format!(
                    "{},{},{},{number},\n",
                    index.vehicle.as_deref().unwrap(),
                    index.topics[message.topic].name,
                    message.stamp_ns
                );
            }
        }
    };
    LogReader::new()
        .read(&index, |_, _| true, ALL_TIME, &mut row)
        .unwrap();
    let file = town.path("matching.csv");
    fs::write(&file, &rows).unwrap();
    let [csv, log] = [&file, log].map(|path| path.to_str().unwrap());
    let options = ["--matching", csv, "--logs", log, "--format", "json"];
    let matching = on("evaluate", &store, &options).with_code(0).json()["matching"].clone();
    assert_eq!(matching["detections"], detections);
    // The truth says that all of it is clutter: every match is wrong, and most were matched.
    assert_eq!(matching["r_match"], 0.0);
    assert_eq!(matching["r_recall"], Value::Null);
    let assignment = matching["assignment"].as_f64().unwrap();
    assert!((0.01..0.4).contains(&assignment), "{matching}");

    on("evaluate", &store, &["--matching", csv])
        .with_code(2)
        .names(&["--logs"]);
    fs::write(&file, "a,b\n").unwrap();
    on("evaluate", &store, &["--matching", csv, "--logs", log])
        .with_code(1)
        .names(&["matching.csv", "its header is", "stamp_ns"]);
}

#[test]
fn exports_are_geojson_that_is_read_as_truth() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs);
    let printed = on("export", &store, &["--all", "--format", "geojson"]).with_code(0);
    let collection = printed.json();
    assert_eq!(collection["type"], "FeatureCollection");
    let features = collection["features"].as_array().unwrap();
    assert!(!features.is_empty());
    for feature in features {
        for name in ["element_id", "change_type", "kind"] {
            assert!(keys(&feature["properties"]).contains(&name), "{feature}");
        }
    }

    let file = town.path("changes.geojson");
    let out = file.to_str().unwrap();
    let options = ["--threshold", "0", "--format", "geojson", "--out", out];
    let written = on("export", &store, &options).with_code(0);
    assert_eq!(written.out, "");
    written.names(&["wrote", out]);
    assert!(fs::read_to_string(&file).unwrap().contains("Feature"));
    on("evaluate", &store, &["--truth", out]).with_code(0);

    let nowhere = town.path("no/such/folder/changes.geojson");
    on("export", &store, &["--out", nowhere.to_str().unwrap()])
        .with_code(1)
        .names(&["cannot write", "changes.geojson"]);
}

#[test]
fn progress_is_json_lines_or_nothing() {
    let town = Town::new();
    let store = town.init("store");
    let said = run(&store, &town.city.logs, &["--progress", "json"]).with_code(0);
    let mut stages = Vec::new();
    for line in said.err.lines() {
        let event: Value = serde_json::from_str(line).unwrap_or_else(|_| panic!("{line}"));
        assert_eq!(
            keys(&event),
            ["event", "stage", "unit", "done", "total", "set_aside"]
        );
        let name = event["event"].as_str().unwrap();
        let stage = event["stage"].as_str().unwrap().to_owned();
        match name {
            "begin" => stages.push(stage),
            "end" => assert_eq!(stages.last(), Some(&stage)),
            _ => {
                assert_eq!(name, "advance");
                assert!(event["done"].as_u64() <= event["total"].as_u64(), "{line}");
            }
        }
    }
    assert_eq!(stages, ["index", "map", "exchange", "reduce", "commit"]);

    // Elsewhere than on a terminal, nobody sees bars.
    for options in [&[][..], &["--progress", "auto"], &["--progress", "off"]] {
        let said = run(&town.init(&options.join("_")), &town.city.logs, options).with_code(0);
        assert_eq!(said.err, "");
    }
}

#[test]
fn a_store_that_was_changed_by_hand_is_told() {
    for table in ["changes", "evidence", "elements"] {
        let town = Town::new();
        let store = town.store("store", &town.city.logs);
        let file = data_file(&store.join(table));
        let mut bytes = fs::read(&file).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&file, bytes).unwrap();
        let said = on("verify", &store, &["--format", "json"]).with_code(4);
        assert_eq!(said.json()["ok"], false);
        let name = file.file_name().unwrap().to_str().unwrap();
        said.names(&[name, "damaged", "restore"]);
    }
}

/// The latest data file of a table.
fn data_file(table: &std::path::Path) -> std::path::PathBuf {
    let mut files = Vec::new();
    let mut folders = vec![table.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension() {
                _ if path.is_dir() => folders.push(path),
                Some(extension) if extension == "parquet" => files.push(path),
                _ => {}
            }
        }
    }
    let changed = |path: &std::path::PathBuf| fs::metadata(path).unwrap().modified().unwrap();
    files.into_iter().max_by_key(changed).unwrap()
}

#[test]
fn help_names_the_exit_codes() {
    let help = tilefold(["--help"]).with_code(0);
    for code in ["0 done", "1 failed", "2 usage", "3 done", "4 "] {
        let text = help.out.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(code), "{code:?} is not in {text}");
    }
    tilefold(["--version"]).with_code(0);
}

#[test]
fn the_reference_is_fresh() {
    let printed = tilefold(["reference"]).with_code(0).out;
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/cli.md");
    let kept = fs::read_to_string(&book).unwrap();
    assert!(
        printed == kept,
        "docs/reference/cli.md is stale: run `cargo run -p tilefold -- reference > docs/reference/cli.md`"
    );
}
