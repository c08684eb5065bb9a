//! Argoverse 2 maps: a small one made by hand, against the `av2` package
//! (tests/oracles/argoverse2_map.py), and maps that are wrong.

mod linear;

use linear::{Shape, assert_linear};
use proptest::prelude::*;
use serde_json::Value;
use tilefold_formats::map::{self, MapError, MapFile, MapFormat};
use tilefold_schemas::{Color, Element, ElementKind, Marking};

const MADE: &str = include_str!("maps/log_map_archive_made____PIT_city_1.json");

fn read_as(text: impl AsRef<[u8]>, name: &str) -> Result<MapFile, MapError> {
    map::read_from(text.as_ref(), name)
}

fn read(text: impl AsRef<[u8]>) -> Result<MapFile, MapError> {
    read_as(text, "folder/log_map_archive_x____PIT_city_1.json")
}

fn called<'a>(map: &'a MapFile, source_id: &str) -> Option<&'a Element> {
    map.elements
        .iter()
        .find(|element| element.tags["source_id"] == source_id)
}

/// The element that a segment's boundary is.
fn beside<'a>(map: &'a MapFile, lane: &str) -> Option<&'a Element> {
    let is_it = |element: &&Element| {
        let lanes = element.tags.get("lanes");
        lanes.is_some_and(|lanes| lanes.split(", ").any(|one| one == lane))
    };
    map.elements.iter().find(is_it)
}

fn assert_near(ours: &[[f64; 3]], golden: &Value, what: &str) {
    let golden = golden.as_array().expect("a list");
    assert_eq!(ours.len(), golden.len(), "{what}");
    for (ours, golden) in ours.iter().zip(golden) {
        for axis in 0..3 {
            let golden = golden[axis].as_f64().expect("a number");
            // 1e-9 degrees are a tenth of a millimetre.
            assert!(
                (ours[axis] - golden).abs() < 1e-9,
                "{what}: {ours:?} is not {golden}"
            );
        }
    }
}

#[test]
fn every_boundary_and_crossing_is_where_the_package_puts_it() {
    let golden: Value =
        serde_json::from_str(include_str!("../../tests/oracles/argoverse2_map.json")).unwrap();
    let mut painted = 0;
    for city in golden.as_array().unwrap() {
        let name = city["city"].as_str().unwrap();
        let map = read_as(MADE, &format!("log_map_archive_made____{name}_city_1.json")).unwrap();
        assert_eq!(map.set_aside, [], "{name}");
        assert_eq!(
            (map.format, map.about["city"].as_str()),
            (MapFormat::Argoverse2, name)
        );
        for boundary in city["boundaries"].as_array().unwrap() {
            let lane = boundary["lane"].as_str().unwrap();
            let Some(element) = beside(&map, lane) else {
                let mark_type = boundary["mark_type"].as_str().unwrap();
                assert!(
                    ["NONE", "UNKNOWN"].contains(&mark_type),
                    "{lane}: {mark_type}"
                );
                continue;
            };
            let mut points = element.points.clone();
            // The two that run against the segment whose boundary is the element.
            if ["42811004 left", "42811006 left"].contains(&lane) {
                points.reverse();
            }
            assert_near(&points, &boundary["points"], lane);
            painted += 1;
        }
        for crossing in city["crossings"].as_array().unwrap() {
            let id = format!("crossing {}", crossing["id"]);
            let ring = &called(&map, &id).unwrap().points;
            let closed: Vec<_> = ring.iter().chain(ring.first()).copied().collect();
            assert_near(&closed, &crossing["points"], &id);
        }
    }
    assert_eq!(painted, 6 * 16);
}

#[test]
fn a_shared_boundary_is_one_element() {
    let map = read(MADE).unwrap();
    let shared = |id: &str| called(&map, id).unwrap().tags["lanes"].clone();
    assert_eq!(
        shared("lane 42811002 right"),
        "42811002 right, 42811003 left"
    );
    // The way of the smallest id: the one that drives against it says DASH_SOLID.
    let opposed = called(&map, "lane 42811002 left").unwrap();
    assert_eq!(opposed.tags["lanes"], "42811002 left, 42811004 left");
    assert_eq!(
        (opposed.marking, opposed.color),
        (Marking::SolidDashed, Color::Yellow)
    );
    // The first beside it says that there is nothing, the second knows better.
    let adopted = called(&map, "lane 42811004 right").unwrap();
    assert_eq!(adopted.tags["lanes"], "42811004 right, 42811006 left");
    assert_eq!(
        (adopted.marking, adopted.color),
        (Marking::Solid, Color::Other)
    );
    assert_eq!(
        [map.counts.lanelets, map.counts.ways, map.counts.relations],
        [9, 15, 2]
    );
    assert_eq!((map.not_paint["NONE"], map.not_paint["UNKNOWN"]), (1, 1));
    let crosswalks = map
        .elements
        .iter()
        .filter(|e| e.kind == ElementKind::Crosswalk);
    assert_eq!((map.elements.len(), crosswalks.count()), (15, 2));
}

#[test]
fn a_mark_of_two_lines_turns_with_its_boundary() {
    let text = MADE.replace("SOLID_DASH_YELLOW", "NONE");
    let map = read(text).unwrap();
    // DASH_SOLID along segment 42811004 is SOLID_DASH along 42811002, whose boundary it is.
    assert_eq!(
        called(&map, "lane 42811002 left").unwrap().marking,
        Marking::SolidDashed
    );
}

#[test]
fn a_name_without_a_city_is_refused() {
    for name in [
        "log_map_archive_x.json",
        "PIT_city/log_map_archive_x____NYC_city_1.json",
    ] {
        let error = read_as(MADE, name).unwrap_err().to_string();
        assert!(
            error.contains("one of ATX, DTW, MIA, PAO, PIT, WDC"),
            "{error}"
        );
    }
}

/// One good lane segment and `segments` behind it, from line 4 on.
fn with(segments: &str) -> String {
    let line = r#"[{"x":0,"y":0,"z":0},{"x":9,"y":0,"z":0}]"#;
    let good = format!(
        r#""1":{{"id":1,"left_lane_boundary":{line},"left_lane_mark_type":"SOLID_WHITE","right_lane_boundary":[],"right_lane_mark_type":"NONE"}}"#
    );
    format!("{{\"pedestrian_crossings\":{{}},\n\"lane_segments\":{{\n{good}{segments}\n}}}}")
}

/// The second lane segment, with a left boundary.
fn second(id: &str, boundary: &str) -> String {
    with(&format!(
        ",\n  \"2\": {{\"id\":{id},\"left_lane_boundary\":{boundary},\"left_lane_mark_type\":\"SOLID_WHITE\",\
         \"right_lane_boundary\":[],\"right_lane_mark_type\":\"NONE\"}}"
    ))
}

#[test]
fn bad_segments_are_set_aside_with_line_and_column() {
    let far = r#"[{"x":0,"y":0,"z":0},{"x":1e9,"y":0,"z":0}]"#;
    let once = r#"[{"x":0,"y":1,"z":0},{"x":0,"y":1,"z":0}]"#;
    let wide = format!(
        "[{}{{\"x\":1,\"y\":1,\"z\":1}}]",
        r#"{"x":0,"y":1,"z":0},"#.repeat(100_000)
    );
    for (text, says) in [
        (
            second("1", "[]"),
            "lane segment (line 4, column 8): another one has the same id, 1",
        ),
        (
            second("2", "[]"),
            "lane 2 left (line 4, column 8): lane_marking needs 2 different points, it has 0",
        ),
        (second("2", once), "it has 1"),
        (second("2", far), "is over 200000 m from the city's origin"),
        (second("2", &wide), "MAX_POINTS_PER_ELEMENT"),
        (
            second("\"x\"", "[]"),
            "lane segment (line 4, column 16): invalid type: string \"x\", expected i64",
        ),
        (
            second("2", r#"[{"x":1e999,"y":0,"z":0}]"#),
            "number out of range",
        ),
        (second("2", r#"[{"x":0,"y":0}]"#), "missing field `z`"),
        (second("2,\"id\":2", "[]"), "duplicate field `id`"),
        (
            with(",\n  \"2\": {}"),
            "lane segment (line 4, column 9): missing field `id`",
        ),
        (
            with(",\n  \"2\": 7"),
            "invalid type: integer `7`, expected struct Segment",
        ),
    ] {
        let map = read(&text).unwrap();
        assert_eq!(
            (map.elements.len(), map.set_aside.len()),
            (1, 1),
            "{text:.300}"
        );
        let lost = &map.set_aside[0];
        assert!(lost.reason.contains(says), "{}\n{says}", lost.reason);
        assert_eq!(lost.offset, Some(4));
    }
}

#[test]
fn damaged_json_is_refused_with_line_and_column() {
    for (text, says) in [
        (
            "{\"lane_segments\":\n {",
            "line 2, column 2: EOF while parsing",
        ),
        (
            "{\"lane_segments\": {}}\n x",
            "not of an Argoverse 2 map: missing field",
        ),
        (
            "{\"lane_segments\": {},\n \"lane_segments\": {}}",
            "duplicate field `lane_segments` at line 2",
        ),
        (
            "{\"lane_segments\": [1]}",
            "expected an object of things by their ids",
        ),
        (
            "{\"lane_segments\": {\"1\": NaN}}",
            "line 1, column 25: expected value",
        ),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(says), "{text}\n{error}");
    }
    let error = read(b"{\n\"a\xff\": 1}").unwrap_err().to_string();
    assert!(
        error.contains("line 2, column 3: it is not UTF-8"),
        "{error}"
    );
    assert!(read(format!("\u{feff}{MADE}")).is_ok());
}

#[test]
fn neither_depth_nor_width_costs_more_than_its_bytes() {
    let deep = "[".repeat(1_000_000);
    assert!(read(with(&format!(",\"2\": {deep}"))).is_err());
    let closed = format!("{deep}{}", "]".repeat(1_000_000));
    assert_eq!(read(second("2", &closed)).unwrap().set_aside.len(), 1);
}

/// `n` of something in a file of its own, by its name.
const SHAPES: [Shape; 5] = [
    ("bad ids", |n| {
        let one = |id| format!(",\"{id}\": {{\"id\": {}}}", "9".repeat(20));
        with(&(0..n).map(one).collect::<String>())
    }),
    ("members of one segment", |n| {
        let members: String = (0..n).map(|at| format!("\"a{at}\":1,")).collect();
        with(&format!(",\"2\": {{{members}\"id\":2}}"))
    }),
    ("vertices of one boundary", |n| {
        second(
            "2",
            &format!("[{}]", vec![r#"{"x":0,"y":1,"z":0}"#; n].join(",")),
        )
    }),
    ("segments beside one boundary", beside_one),
    ("equal ids", |n| {
        with(&",\"2\": {\"id\":1,\"left_lane_boundary\":[]}".repeat(n))
    }),
];

/// `n` segments with the same boundary.
fn beside_one(n: usize) -> String {
    let line = r#"[{"x":0,"y":0,"z":0},{"x":9,"y":0,"z":0}]"#;
    let one = |id: usize| {
        format!(
            r#","{id}":{{"id":{id},"left_lane_boundary":{line},"left_lane_mark_type":"NONE","right_lane_boundary":[],"right_lane_mark_type":"NONE"}}"#
        )
    };
    with(&(2..n + 2).map(one).collect::<String>())
}

#[test]
fn time_grows_with_the_bytes() {
    for (what, shape) in SHAPES {
        assert_linear(what, 6_000, &shape, &|text| drop(read(text)));
    }
    let map = read(beside_one(3)).unwrap();
    let shared = called(&map, "lane 1 left").unwrap();
    assert_eq!(shared.tags["lanes"], "1 left, 2 left, 3 left, 4 left");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 1_000, ..ProptestConfig::default() })]

    #[test]
    fn no_mutation_panics(at in any::<prop::sample::Index>(), byte in any::<u8>(), is_cut in any::<bool>()) {
        let mut bytes = MADE.as_bytes().to_vec();
        let at = at.index(bytes.len());
        bytes[at] = byte;
        if is_cut {
            bytes.truncate(at);
        }
        if let Ok(map) = read(&bytes) {
            for element in &map.elements {
                prop_assert!(element.points.len() >= 2);
                prop_assert!(element.points.iter().flatten().all(|value| value.is_finite()));
            }
        }
    }
}
