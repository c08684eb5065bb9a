//! A city's files: the same bytes for the same seed, and a truth that is the difference of the maps.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;
use tilefold_city::{CityFiles, CitySpec, write};
use tilefold_schemas::element::{Color, Element, ElementKind, Marking};
use tilefold_schemas::id::first_i64;
use tilefold_tiler::geodesy::LocalFrame;

/// Vertices `[longitude_deg, latitude_deg]` of every way, by id.
type Ways = BTreeMap<i64, Vec<[f64; 2]>>;

fn small() -> CitySpec {
    CitySpec {
        seed: 11,
        roads: 2,
        road_length_m: 400.0,
        changes_per_kind: 2,
        vehicles: 3,
        drives: 4,
        ..CitySpec::default()
    }
}

fn digests(files: &CityFiles) -> Vec<i64> {
    let maps = [&files.before_map, &files.after_map, &files.truth];
    let paths = maps.into_iter().chain(&files.logs);
    paths
        .map(|path| first_i64(&blake3::hash(&fs::read(path).unwrap())))
        .collect()
}

fn attribute(line: &str, name: &str) -> String {
    let from = line.find(&format!(" {name}='")).unwrap() + name.len() + 3;
    line[from..].split('\'').next().unwrap().to_owned()
}

/// Reads what the map writer wrote: one node or way per line.
fn ways(path: &Path) -> Ways {
    let map = fs::read_to_string(path).unwrap();
    let mut nodes = BTreeMap::new();
    let mut ways = Ways::new();
    for line in map.lines() {
        if line.starts_with("  <node ") {
            let at = ["lon", "lat"].map(|name| attribute(line, name).parse::<f64>().unwrap());
            nodes.insert(attribute(line, "id"), at);
        } else if line.starts_with("  <way ") {
            let references = line.split("<nd").skip(1);
            let points = references.map(|nd| nodes[&attribute(nd, "ref")]);
            ways.insert(attribute(line, "id").parse().unwrap(), points.collect());
        }
    }
    ways
}

fn drawn(feature: &Value) -> Vec<[f64; 2]> {
    let points = feature["geometry"]["coordinates"].as_array().unwrap();
    points
        .iter()
        .map(|at| [at[0].as_f64().unwrap(), at[1].as_f64().unwrap()])
        .collect()
}

/// The largest distance between vertices of the same number, in metres.
fn apart_m(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let frame = LocalFrame::new([a[0][0], a[0][1], 0.0]);
    let enu = |[lon, lat]: [f64; 2]| frame.to_enu([lon, lat, 0.0]);
    let distances = a.iter().zip(b).map(|(&a, &b)| {
        let (a, b) = (enu(a), enu(b));
        (a[0] - b[0]).hypot(a[1] - b[1])
    });
    distances.fold(0.0, f64::max)
}

#[test]
fn a_seed_gives_the_same_bytes_and_another_seed_others() {
    let folders = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let first = digests(&write(&small(), folders[0].path()).unwrap());
    let second = digests(&write(&small(), folders[1].path()).unwrap());
    assert_eq!(first, second);
    let other = CitySpec {
        seed: 12,
        ..small()
    };
    let third = digests(&write(&other, folders[2].path()).unwrap());
    assert!(first.iter().zip(&third).all(|(a, b)| a != b));
}

#[test]
fn more_drives_do_not_change_the_first_ones_maps() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let few = digests(&write(&small(), folders[0].path()).unwrap());
    let more = CitySpec {
        drives: 5,
        ..small()
    };
    let many = digests(&write(&more, folders[1].path()).unwrap());
    assert_eq!(few[..3], many[..3]);
}

#[test]
fn the_truth_is_the_difference_of_the_maps() {
    let folder = tempfile::tempdir().unwrap();
    let files = write(
        &CitySpec {
            drives: 0,
            ..CitySpec::default()
        },
        folder.path(),
    )
    .unwrap();
    let (mut before, mut after) = (ways(&files.before_map), ways(&files.after_map));
    assert!(after.len() > 100, "{} ways", after.len());
    let truth: Value = serde_json::from_slice(&fs::read(&files.truth).unwrap()).unwrap();
    let mut counts = BTreeMap::new();
    for feature in truth["features"].as_array().unwrap() {
        let id = feature["properties"]["element_id"].as_i64().unwrap();
        let change = feature["properties"]["change_type"].as_str().unwrap();
        *counts.entry(change).or_insert(0) += 1;
        let (was, is, drawn) = (before.remove(&id), after.remove(&id), drawn(feature));
        match (change, was, is) {
            ("added", None, Some(is)) => assert!(apart_m(&drawn, &is) < 1e-4),
            ("removed", Some(was), None) => assert!(apart_m(&drawn, &was) < 1e-4),
            ("modified", Some(was), Some(is)) => {
                assert!(apart_m(&drawn, &is) < 1e-4);
                let shift_m = feature["properties"]["shift_m"].as_f64().unwrap();
                assert!((0.9..=1.4).contains(&shift_m.abs()), "{shift_m}");
                assert!((apart_m(&was, &is) - shift_m.abs()).abs() < 2e-3, "{id}");
            }
            (change, was, is) => panic!("{id}: {change}, but before {was:?}, after {is:?}"),
        }
    }
    assert_eq!(
        counts,
        [("added", 6), ("modified", 6), ("removed", 6)].into()
    );
    assert_eq!(before, after, "what is not in the truth has not changed");
}

#[test]
fn what_cannot_be_built_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let said = |spec: CitySpec| write(&spec, folder.path()).unwrap_err().to_string();
    assert_eq!(
        said(CitySpec {
            roads: 0,
            ..small()
        }),
        "roads = 0 cannot be built: give 1 to 100"
    );
    let crowded = said(CitySpec {
        changes_per_kind: 1_000,
        ..small()
    });
    assert!(
        crowded.starts_with("3000 changes do not fit on "),
        "{crowded}"
    );
    assert!(
        said(CitySpec {
            road_length_m: f64::NAN,
            ..small()
        })
        .starts_with("road_length_m")
    );
}

#[test]
fn maps_and_truth_are_what_our_own_readers_want() {
    let folder = tempfile::tempdir().unwrap();
    let spec = CitySpec {
        drives: 0,
        ..CitySpec::default()
    };
    let files = write(&spec, folder.path()).unwrap();
    for path in [&files.before_map, &files.after_map] {
        let map = tilefold_formats::map::read(path).unwrap();
        assert!(map.set_aside.is_empty(), "{:?}", map.set_aside);
        assert_eq!(map.elements.len(), ways(path).len());
        let is_plain = |element: &Element| {
            let known = matches!(element.marking, Marking::Solid | Marking::Dashed);
            element.kind == ElementKind::LaneMarking && known && element.color != Color::Unknown
        };
        assert!(map.elements.iter().all(is_plain));
    }
    let truth = tilefold_formats::geojson::read_changes_file(&files.truth).unwrap();
    assert_eq!(truth.len(), 18);
    assert!(
        truth
            .iter()
            .all(|change| change.change_type.is_change() && change.points.len() > 10)
    );
}
