//! `inspect`: real files, files of our own, and what was done to them.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{Said, Town, tilefold};

fn inspect(file: &Path) -> Said {
    tilefold([
        "inspect".as_ref(),
        file.as_os_str(),
        "--format".as_ref(),
        "json".as_ref(),
    ])
}

fn words(file: &Path) -> Said {
    tilefold(["inspect".as_ref(), file.as_os_str()])
}

fn topic<'a>(log: &'a Value, read_as: &str) -> &'a Value {
    let topics = log["topics"].as_array().unwrap();
    topics
        .iter()
        .find(|topic| topic["read_as"] == read_as)
        .unwrap()
}

#[test]
fn a_log_and_what_was_cut_off_it() {
    let town = Town::new();
    let log = &town.city.logs[0];
    let whole = inspect(log).with_code(0).json();
    assert_eq!(whole["kind"], "log");
    assert_eq!(whole["has_summary"], true);
    assert_eq!(whole["set_aside"], Value::Array(Vec::new()));
    assert_eq!(whole["mend"], Value::Array(Vec::new()));
    let detections = topic(&whole, "detections");
    assert_eq!(detections["messages"], detections["decoded"]);
    assert!(topic(&whole, "gnss")["decoded"].as_u64().unwrap() > 10);

    // The name does not matter, the content does.
    let bytes = fs::read(log).unwrap();
    let cut = town.path("cut.bin");
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let half = inspect(&cut).with_code(3).json();
    assert_eq!(half["kind"], "log");
    assert_eq!(half["has_summary"], false);
    let mend = half["mend"][0].as_str().unwrap();
    assert!(
        mend.contains("mcap recover") && mend.contains("cut.bin"),
        "{mend}"
    );
    let kept = topic(&half, "detections")["decoded"].as_u64();
    assert!(kept < detections["decoded"].as_u64());

    let other = town.path("other.mcap");
    fs::write(&other, b"not a log").unwrap();
    inspect(&other)
        .with_code(1)
        .names(&["other.mcap", "no MCAP file"]);
}

#[test]
fn a_map_and_an_element_that_refers_to_nothing() {
    let town = Town::new();
    let map = &town.city.before_map;
    let whole = inspect(map).with_code(0).json();
    assert_eq!(
        (&whole["kind"], &whole["format"]),
        (&"map".into(), &"lanelet2".into())
    );
    assert!(whole["elements"]["lane_marking"].as_u64().unwrap() > 20);
    assert_eq!(whole["bounds_deg"].as_array().unwrap().len(), 4);

    let text = fs::read_to_string(map).unwrap();
    let way = "<way id='77'><nd ref='1234567'/><nd ref='1234568'/><tag k='type' v='stop_line'/></way>\n</osm>";
    let broken = town.path("broken.txt");
    fs::write(&broken, text.replace("</osm>", way)).unwrap();
    let said = words(&broken).with_code(3);
    said.names(&["way 77 (line", "column 1", "1234567 is not in the file"]);
    assert!(
        said.out.contains("to mend: mend the elements at the lines"),
        "{said:#?}"
    );

    fs::write(&broken, &text[..text.len() / 2]).unwrap();
    inspect(&broken)
        .with_code(1)
        .names(&["broken.txt", "line", "column"]);
    inspect(&town.path("nowhere.osm"))
        .with_code(1)
        .names(&["nowhere.osm"]);
}

#[test]
fn a_store_and_a_file_of_it_with_a_flipped_byte() {
    let town = Town::new();
    let store = town.store("store", &town.city.logs[..1]);
    let whole = inspect(&store).with_code(0).json();
    assert_eq!(whole["kind"], "store");
    assert_eq!(whole["version"], 2);
    assert!(whole["tables"]["elements"].as_u64().unwrap() > 20);

    let elements = fs::read_dir(store.join("elements")).unwrap();
    let mut files = elements.map(|entry| entry.unwrap().path());
    let file = files
        .find(|path| path.extension().is_some_and(|e| e == "parquet"))
        .unwrap();
    let mut bytes = fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&file, bytes).unwrap();
    let said = words(&store).with_code(3);
    said.names(&[&file.file_name().unwrap().to_string_lossy(), "damaged"]);
    assert!(
        said.out.contains("DAMAGED") && said.out.contains("to mend: restore"),
        "{said:#?}"
    );
}

/// The folder of real data, or why there is none.
fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA").map_or(beside, PathBuf::from);
    if folder.join("maps").is_dir() {
        return Some(folder);
    }
    println!(
        "SKIPPED: no real data at {}; set TILEFOLD_TEST_DATA",
        folder.display()
    );
    None
}

#[test]
fn real_files_are_what_they_are() {
    let Some(data) = data() else { return };
    for (file, kind, code) in [
        ("maps/karlsruhe/mapping_example.osm", "map", None),
        ("maps/kashiwanoha/kashiwanoha_9159228e5.osm", "map", None),
        (
            "maps/testfeld/Testfeld_Niedersachsen_ALKS_xodr_sample_offset.xodr",
            "map",
            None,
        ),
        ("logs/rosbag2/talker.mcap", "log", Some(0)),
        ("logs/rosbag2/wbag_0.mcap", "log", Some(0)),
        ("deecamp/trip_image_plane.mcap", "log", Some(0)),
        ("models/twinlitenet_360x640.onnx", "model", Some(0)),
    ] {
        let said = inspect(&data.join(file));
        assert_eq!(said.json()["kind"], kind, "{file}");
        if let Some(code) = code {
            assert_eq!(said.code, code, "{file}: {said:#?}");
        }
        assert!(words(&data.join(file)).out.starts_with(kind), "{file}");
    }
    let model = inspect(&data.join("models/twinlitenet_360x640.onnx")).json();
    let shapes = |of: &str| -> Vec<String> {
        let shapes = model[of].as_object().unwrap().values();
        shapes
            .map(|shape| shape.as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(shapes("inputs"), ["float[1,3,360,640]"]);
    assert_eq!(
        shapes("outputs"),
        ["float[1,2,360,640]", "float[1,2,360,640]"]
    );
    let weights = model["weight_bytes"].as_u64().unwrap();
    assert!(
        (400_000..500_000).contains(&(weights / 4)),
        "0.44 M parameters: {weights}"
    );

    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut");
    let bytes = fs::read(data.join("models/twinlitenet_360x640.onnx")).unwrap();
    fs::write(&cut, &bytes[..bytes.len() - 1000]).unwrap();
    inspect(&cut).with_code(1).names(&["no ONNX model"]);
}
