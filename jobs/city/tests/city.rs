//! A city's files: the same bytes for the same seed, and a truth that is the difference of the maps.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::Value;
use tilefold_city::{CityFiles, CitySpec, Site, write};
use tilefold_schemas::id::first_i64;
use tilefold_tiler::geodesy::LocalFrame;

/// Vertices `[longitude_deg, latitude_deg]` of every way, by id.
type Ways = BTreeMap<i64, Vec<[f64; 2]>>;

fn small() -> CitySpec {
    CitySpec {
        seed: 11,
        site: Site::Drawn { km: 2.0 },
        change_share: 0.1,
        vehicles: 3,
        drives: 4,
        drive_km: 0.8,
        ..CitySpec::default()
    }
}

fn digests(files: &CityFiles) -> Vec<i64> {
    let maps = [
        &files.before_map,
        &files.after_map,
        &files.truth,
        &files.history,
    ];
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
    let geometry = &feature["geometry"];
    let points = match geometry["type"].as_str().unwrap() {
        "Polygon" => &geometry["coordinates"][0],
        _ => &geometry["coordinates"],
    };
    let points = points.as_array().unwrap();
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

fn length_m(way: &[[f64; 2]]) -> f64 {
    way.windows(2)
        .map(|pair| apart_m(&pair[..1], &pair[1..]))
        .sum()
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
fn more_drives_do_not_change_the_maps() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let few = digests(&write(&small(), folders[0].path()).unwrap());
    let more = CitySpec {
        drives: 5,
        ..small()
    };
    let many = digests(&write(&more, folders[1].path()).unwrap());
    assert_eq!(few[..4], many[..4]);
}

#[test]
fn threads_do_not_change_a_byte() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = one.install(|| digests(&write(&small(), folders[0].path()).unwrap()));
    let four = rayon::ThreadPoolBuilder::new()
        .num_threads(4)
        .build()
        .unwrap();
    let together = four.install(|| digests(&write(&small(), folders[1].path()).unwrap()));
    assert_eq!(alone, together);
}

#[test]
fn the_truth_is_the_difference_of_the_maps() {
    let folder = tempfile::tempdir().unwrap();
    let spec = CitySpec {
        site: Site::Drawn { km: 8.0 },
        drives: 0,
        ..CitySpec::default()
    };
    let files = write(&spec, folder.path()).unwrap();
    let (before, mut after) = (ways(&files.before_map), ways(&files.after_map));
    assert!(after.len() > 500, "{} ways", after.len());
    let truth: Value = serde_json::from_slice(&fs::read(&files.truth).unwrap()).unwrap();
    let mut told = BTreeSet::new();
    for feature in truth["features"].as_array().unwrap() {
        let said = &feature["properties"];
        let id = said["element_id"].as_i64().unwrap();
        told.insert(id);
        let (was, is, drawn) = (before.get(&id), after.remove(&id), drawn(feature));
        match (said["change_type"].as_str().unwrap(), was, is) {
            ("added", None, Some(is)) => assert!(apart_m(&drawn, &is) < 1e-3),
            ("removed", Some(was), None) => assert!(apart_m(&drawn, was) < 1e-3),
            ("removed", Some(was), Some(_)) => {
                let [from_m, to_m] = ["from_m", "to_m"].map(|key| said[key].as_f64().unwrap());
                assert!(from_m < to_m && to_m - from_m < length_m(was));
            }
            ("modified", Some(was), Some(is)) => {
                assert!(apart_m(&drawn, &is) < 1e-3);
                let shift_m = said["shift_m"].as_f64().unwrap_or(0.0);
                if said["detail"] == "shifted" {
                    assert!((0.2..=2.0).contains(&shift_m.abs()), "{shift_m}");
                    assert!((apart_m(was, &is) - shift_m.abs()).abs() < 2e-3, "{id}");
                }
            }
            (change, was, is) => panic!("{id}: {change}, but before {was:?}, after {is:?}"),
        }
    }
    let details: BTreeSet<&str> = truth["features"]
        .as_array()
        .unwrap()
        .iter()
        .map(|feature| feature["properties"]["detail"].as_str().unwrap())
        .collect();
    for detail in ["added", "removed", "partly_removed", "shifted", "retyped"] {
        assert!(details.contains(detail), "{detail}");
    }
    for (id, way) in &after {
        if !told.contains(id) && *id < 1_000_000 {
            assert_eq!(before.get(id), Some(way), "{id} is not in the truth");
        }
    }
}

#[test]
fn what_cannot_be_built_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let said = |spec: CitySpec| write(&spec, folder.path()).unwrap_err().to_string();
    assert_eq!(
        said(CitySpec {
            vehicles: 0,
            ..small()
        }),
        "vehicles = 0 cannot be built: give 1 to 100000"
    );
    let lost = said(CitySpec {
        noise: "no/such.toml".to_owned(),
        ..small()
    });
    assert!(
        lost.contains("no/such.toml") && lost.contains("paper_like"),
        "{lost}"
    );
    let lost = said(CitySpec {
        site: Site::Mapped {
            map: "no/such.osm".into(),
        },
        ..small()
    });
    assert!(lost.contains("no/such.osm"), "{lost}");
    let endless = said(CitySpec {
        drive_km: f64::NAN,
        ..small()
    });
    assert!(endless.starts_with("drive km = NaN"), "{endless}");
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
    }
    let truth = tilefold_formats::geojson::read_changes_file(&files.truth).unwrap();
    assert!(truth.len() > 5);
    assert!(truth.iter().all(|change| change.change_type.is_change()));
}
