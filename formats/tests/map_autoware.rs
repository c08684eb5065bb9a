//! Maps as Autoware writes them: local coordinates without latitude and longitude, divided maps, and
//! what its tools say of a map.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::fs;
use std::path::{Path, PathBuf};

use tilefold_formats::map::{self, LocalFrames, METADATA_FILE, MapFile, PROJECTOR_FILE};
use tilefold_formats::map_patch::{NewIds, OsmText, Patch};
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};

/// The place that the local coordinates below are of.
const PLACE: [f64; 2] = [139.9334, 35.9036];

/// The same place by all projectors of Autoware; the numbers are pyproj's.
const PROJECTORS: [(&str, [f64; 2]); 4] = [
    (
        "projector_type: MGRS\nvertical_datum: WGS84\nmgrs_grid: 54SVE\n",
        [3_751.268_957, 73_781.763_462],
    ),
    (
        "projector_type: LocalCartesianUTM\nmap_origin:\n  latitude: 35.90 # [deg]\n  longitude: 139.93\n  altitude: 0.0\n",
        [311.196_557, 395.952_797],
    ),
    (
        "projector_type: TransverseMercator\nscale_factor: 0.9996\nmap_origin:\n  latitude: 35.90\n  longitude: 139.93\n",
        [306.806_423, 399.291_413],
    ),
    (
        "projector_type: LocalCartesian\nmap_origin: \n  latitude: 35.90\n  longitude: 139.93\n",
        [306.929_194, 399.451_192],
    ),
];

/// A stop line from the place to the east.
fn local_map([x, y]: [f64; 2], tags: &str) -> String {
    let node = |id: i64, east_m: f64| {
        format!(
            "  <node id=\"{id}\" lat=\"\" lon=\"\">\n    <tag k=\"local_x\" v=\"{:.4}\"/>\n    \
             <tag k=\"local_y\" v=\"{y:.4}\"/>\n    <tag k=\"ele\" v=\"12.5\"/>{tags}\n  </node>\n",
            x + east_m
        )
    };
    format!(
        "<osm generator=\"VMB\">\n  <MetaInfo format_version=\"1\" map_version=\"2\"/>\n{}{}  \
         <way id=\"7\">\n    <nd ref=\"1\"/>\n    <nd ref=\"2\"/>\n    \
         <tag k=\"type\" v=\"stop_line\"/>\n  </way>\n</osm>\n",
        node(1, 0.0),
        node(2, 30.0)
    )
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let file = folder.join(name);
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(&file, text).unwrap();
    file
}

/// Metres between two places that are near.
fn apart_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let north_m = (a[1] - b[1]) * 111_000.0;
    let east_m = (a[0] - b[0]) * 111_000.0 * a[1].to_radians().cos();
    north_m.hypot(east_m)
}

fn only(map: &MapFile) -> &[[f64; 3]] {
    assert_eq!(map.set_aside, []);
    &map.elements.first().unwrap().points
}

#[test]
fn local_coordinates_count_from_what_the_projector_file_says() {
    for (yaml, local_m) in PROJECTORS {
        let folder = tempfile::tempdir().unwrap();
        let file = write(folder.path(), "lanelet2_map.osm", &local_map(local_m, ""));
        write(folder.path(), PROJECTOR_FILE, yaml);
        let map = map::read(&file).unwrap();
        let first = only(&map)[0];
        let away_m = apart_m(first, [PLACE[0], PLACE[1], 0.0]);
        assert!(away_m < 2e-4, "{yaml}: {away_m} m");
        assert!((first[2] - 12.5).abs() < 1e-9);
        let long_m = apart_m(first, only(&map)[1]);
        assert!((long_m - 30.0).abs() < 0.15, "{yaml}: {long_m}");
    }
}

#[test]
fn a_node_may_name_its_square_itself() {
    let tags = "<tag k=\"mgrs_code\" v=\"54SVE037737\"/>";
    let text = local_map(PROJECTORS[0].1, tags);
    let map = map::read_from(text.as_bytes(), "map.osm").unwrap();
    assert!(apart_m(only(&map)[0], [PLACE[0], PLACE[1], 0.0]) < 2e-4);
}

#[test]
fn where_nothing_says_what_they_count_from_nothing_is_guessed() {
    for (yaml, says) in [
        (None, "nothing says what local_x and local_y count from"),
        (Some("projector_type: Local\n"), "no place on Earth"),
        (
            Some("projector_type: Lambert\n"),
            "\"Lambert\" is not known",
        ),
        (
            Some("projector_type: MGRS\nmgrs_grid: 54\n"),
            "\"54\" is no 100 km square",
        ),
        (
            Some("projector_type: LocalCartesian\n"),
            "needs latitude and longitude",
        ),
        (Some("projector_type: &a [\n"), "line 1"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let file = write(folder.path(), "map.osm", &local_map([1.0, 2.0], ""));
        if let Some(yaml) = yaml {
            write(folder.path(), PROJECTOR_FILE, yaml);
        }
        let map = map::read(&file).unwrap();
        assert_eq!(map.elements, []);
        let reason = &map.set_aside[0].reason;
        assert!(reason.contains(says), "{says}: {reason}");
        assert!(reason.contains("line 3"), "{reason}");
    }
}

#[test]
fn a_local_map_that_is_patched_stays_local() {
    let folder = tempfile::tempdir().unwrap();
    let (yaml, local_m) = PROJECTORS[0];
    let file = write(folder.path(), "map.osm", &local_map(local_m, ""));
    write(folder.path(), PROJECTOR_FILE, yaml);
    let before = only(&map::read(&file).unwrap()).to_vec();
    // Two metres to the north, and a vertex more.
    let two_m = 2.0 / 110_950.0;
    let mut there: Vec<_> = before.iter().map(|p| [p[0], p[1] + two_m, p[2]]).collect();
    there.insert(1, [0, 1, 2].map(|i| (there[0][i] + there[1][i]) / 2.0));
    there[1][1] += two_m;

    let text = OsmText::read(fs::read(&file).unwrap(), "map.osm")
        .unwrap()
        .located(&mut LocalFrames::beside(&file));
    let patch = Patch::plan(&text, &[moved(7, &there)], &mut NewIds::behind([&text])).unwrap();
    assert_eq!((patch.applied, patch.not_applied.len()), (1, 0));
    let patched = String::from_utf8(patch.lanelet2(&text)).unwrap();
    assert_eq!(
        patched.matches("lat=\"\"").count(),
        patched.matches("<node").count(),
        "{patched}"
    );
    assert_eq!(
        patched.matches("local_x").count(),
        patched.matches("<node").count()
    );

    let file = write(folder.path(), "patched.osm", &patched);
    let map = map::read(&file).unwrap();
    for (found, wanted) in only(&map).iter().zip(&there) {
        assert!(apart_m(*found, *wanted) < 0.002, "{found:?} {wanted:?}");
    }
    assert_eq!(only(&map).len(), there.len());
}

fn moved(element: i64, points: &[[f64; 3]]) -> ChangeRecord {
    ChangeRecord {
        change: 0xabc,
        element: Some(element),
        kind: ElementKind::StopLine.code(),
        to_m: 30.0,
        verdict: Verdict::Modified.code(),
        p_modified: 1.0,
        log_odds: 9.0,
        vehicles: 9,
        passes: 9,
        exposed: 9,
        hit: 9,
        shift_m: Some(2.0),
        geometry_new: Some(wkb::line(points)),
        fusion_model: "calibrated".to_owned(),
        ..ChangeRecord::default()
    }
}

const HEAD: &str = "<node id='-1' lat='35.9' lon='139.93'/><node id='9223372036854775807' lat='35.9' lon='139.931'/>\
    <node id='3' lat='35.9' lon='139.932'/>";
const SHARED: &str = "<way id='-9223372036854775808'><nd ref='-1'/><nd ref='9223372036854775807'/><tag k='type' v='line_thin'/></way>";
const EAST: &str =
    "<way id='8'><nd ref='9223372036854775807'/><nd ref='3'/><tag k='type' v='line_thin'/></way>";
const METADATA: &str =
    "x_resolution: 100.0\ny_resolution: 100.0\n0_0.osm: [0, 0]\n100_0.osm: [100, 0]\n";

fn divided(tiles: [&str; 2], folder: &str) -> tempfile::TempDir {
    let root = tempfile::tempdir().unwrap();
    write(root.path(), METADATA_FILE, METADATA);
    for (name, ways) in ["0_0.osm", "100_0.osm"].into_iter().zip(tiles) {
        let tile = format!("<osm>{HEAD}{ways}</osm>");
        write(root.path(), &format!("{folder}{name}"), &tile);
    }
    root
}

#[test]
fn a_divided_map_is_one_map() {
    let east = format!("{SHARED}{EAST}");
    for folder in ["lanelet2_map.osm/", ""] {
        let root = divided([SHARED, &east], folder);
        let by = |name: &str| map::read(&root.path().join(name)).unwrap();
        let whole = by(METADATA_FILE);
        let ids: Vec<i64> = whole.elements.iter().map(|element| element.id.0).collect();
        assert_eq!(ids, [i64::MIN, 8], "negative and large ids, each once");
        assert_eq!(by("").elements, whole.elements);
        if !folder.is_empty() {
            assert_eq!(by(folder).elements, whole.elements);
        }
    }
}

#[test]
fn half_a_divided_map_is_refused() {
    let refused = |root: &tempfile::TempDir| {
        map::read(&root.path().join(METADATA_FILE))
            .unwrap_err()
            .to_string()
    };
    let root = divided([SHARED, EAST], "lanelet2_map.osm/");
    fs::remove_file(root.path().join("lanelet2_map.osm/100_0.osm")).unwrap();
    let why = refused(&root);
    assert!(
        why.contains(METADATA_FILE) && why.contains("100_0.osm"),
        "{why}"
    );

    let other = EAST.replace("'8'", "'-9223372036854775808'");
    let why = refused(&divided([SHARED, &other], ""));
    assert!(
        why.contains("element -9223372036854775808") && why.contains("100_0.osm"),
        "{why}"
    );

    let root = divided([SHARED, EAST], "");
    for (metadata, says) in [
        ("x_resolution: 1\n", "names no tile"),
        ("../map.osm: [0, 0]\n", "a path for a name"),
        ("0_0.osm: 7\n", "is no tile"),
        ("0_0.osm\n", "line 1"),
    ] {
        write(root.path(), METADATA_FILE, metadata);
        assert!(refused(&root).contains(says), "{says}: {}", refused(&root));
    }
}

#[test]
fn what_a_map_says_of_itself_in_any_spelling() {
    for name in ["MetaInfo", "metainfo", "Metainfo"] {
        let text = format!("<osm><{name} format_version='1' map_version='4' /></osm>");
        let map = map::read_from(text.as_bytes(), "map.osm").unwrap();
        assert_eq!(map.about["map_version"], "4", "{name}");
    }
}

/// The real map has both kinds of coordinates: without latitude and longitude it must be the same map.
#[test]
fn a_real_map_without_latitude_and_longitude_is_the_same_map() {
    let root = std::env::var_os("TILEFOLD_TEST_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let real = root.join("maps/kashiwanoha/kashiwanoha_road_shoulder_added.osm");
    let Ok(text) = fs::read_to_string(&real) else {
        println!(
            "SKIPPED: no real map at {}; set TILEFOLD_TEST_DATA",
            real.display()
        );
        return;
    };
    let mut bare = String::new();
    for line in text.lines() {
        let is_local = line.trim_start().starts_with("<node");
        let line = if is_local {
            emptied(emptied(line.to_owned(), "lat"), "lon")
        } else {
            line.to_owned()
        };
        bare.push_str(&line);
        bare.push('\n');
    }
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "lanelet2_map.osm", &bare);
    write(folder.path(), PROJECTOR_FILE, PROJECTORS[0].0);
    let [with, without] = [&real, &file].map(|file| map::read(file).unwrap());
    assert_eq!(without.counts, with.counts);
    let mut farthest_m: f64 = 0.0;
    for (a, b) in with.elements.iter().zip(&without.elements) {
        assert_eq!((a.id, a.points.len()), (b.id, b.points.len()));
        for (a, b) in a.points.iter().zip(&b.points) {
            farthest_m = farthest_m.max(apart_m(*a, *b));
        }
    }
    println!(
        "farthest of {} elements: {farthest_m} m",
        with.elements.len()
    );
    assert!(!without.elements.is_empty());
    assert_eq!(with.elements.len(), without.elements.len());
    assert!(farthest_m < 1e-4, "{farthest_m}");
}

fn emptied(line: String, attribute: &str) -> String {
    let key = format!(" {attribute}=\"");
    let Some((before, rest)) = line.split_once(&key) else {
        return line;
    };
    let after = rest.split_once('"').map_or("", |(_, after)| after);
    format!("{before}{key}\"{after}")
}
