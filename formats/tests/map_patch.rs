//! Maps with changes written into them: what no change is about stays byte for byte, topology holds,
//! and the reader finds on the new map what the changes say.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::path::{Path, PathBuf};

use tilefold_formats::map;
use tilefold_formats::map_patch::{NewIds, OsmText, Patch};
use tilefold_schemas::{ChangeRecord, ElementKind, Marking, Verdict, wkb};

/// Two lanes: way 10 and 11 meet in node 3; 10 is a border of lanelet 30; 12 stands alone.
const MAP: &str = "<?xml version=\"1.0\"?>\n<osm generator=\"VMB\">\n\
  \x20 <MetaInfo format_version=\"1\" map_version=\"5\"/>\n\
  \x20 <node id=\"1\" version=\"4\" lat=\"49.0\" lon=\"8.4\">\n    <tag k=\"ele\" v=\"110.0\"/>\n  </node>\n\
  \x20 <node id=\"2\" lat=\"49.0005\" lon=\"8.4\"><tag k=\"ele\" v=\"110.5\"/></node>\n\
  \x20 <node id=\"3\" lat=\"49.001\" lon=\"8.4\"><tag k=\"ele\" v=\"111.0\"/></node>\n\
  \x20 <node id=\"4\" lat=\"49.002\" lon=\"8.4\"><tag k=\"ele\" v=\"112.0\"/></node>\n\
  \x20 <node id=\"5\" lat=\"49.0\" lon=\"8.401\"><tag k=\"ele\" v=\"110.0\"/></node>\n\
  \x20 <node id=\"6\" lat=\"49.001\" lon=\"8.401\"><tag k=\"ele\" v=\"111.0\"/></node>\n\
  \x20 <!-- a comment & nothing more -->\n\
  \x20 <way id=\"10\" version=\"7\">\n    <nd ref=\"1\"/>\n    <nd ref=\"2\"/>\n    <nd ref=\"3\"/>\n    \
<tag k=\"type\" v=\"line_thin\"/>\n    <tag k=\"subtype\" v=\"dashed\"/>\n  </way>\n\
  \x20 <way id=\"11\"><nd ref=\"3\"/><nd ref=\"4\"/><tag k=\"type\" v=\"line_thin\"/><tag k=\"subtype\" v=\"dashed\"/></way>\n\
  \x20 <way id=\"12\"><nd ref=\"5\"/><nd ref=\"6\"/><tag k=\"type\" v=\"line_thin\"/><tag k=\"note\" v=\"a &lt;b&gt; &amp; 'c'\"/></way>\n\
  \x20 <relation id=\"30\"><member type=\"way\" ref=\"10\" role=\"left\"/><member type=\"way\" ref=\"12\" role=\"right\"/>\
<tag k=\"type\" v=\"lanelet\"/></relation>\n</osm>\n";

fn record(element: Option<i64>, verdict: Verdict, to_m: f64) -> ChangeRecord {
    ChangeRecord {
        change: 0xabc,
        element,
        kind: ElementKind::LaneMarking.code(),
        to_m,
        verdict: verdict.code(),
        p_modified: 1.0,
        log_odds: 9.0,
        vehicles: 9,
        passes: 9,
        exposed: 9,
        hit: 9,
        fusion_model: "calibrated".to_owned(),
        ..ChangeRecord::default()
    }
}

fn moved(element: i64, to_m: f64, points: &[[f64; 3]]) -> ChangeRecord {
    ChangeRecord {
        shift_m: Some(1.0),
        geometry_new: Some(wkb::line(points)),
        ..record(Some(element), Verdict::Modified, to_m)
    }
}

fn patched(map: &str, records: &[ChangeRecord]) -> (String, Patch) {
    let text = OsmText::read(map.as_bytes().to_vec(), "map.osm").unwrap();
    let patch = Patch::plan(&text, records, &mut NewIds::behind([&text])).unwrap();
    let new = String::from_utf8(patch.lanelet2(&text)).unwrap();
    assert_eq!(
        map::read_from(new.as_bytes(), "new.osm").unwrap().set_aside,
        []
    );
    (new, patch)
}

/// The lines of `new` that are not in `old`, and the other way round.
fn changed_lines<'a>(old: &'a str, new: &'a str) -> [Vec<&'a str>; 2] {
    let only = |of: &'a str, than: &str| {
        let than: Vec<&str> = than.lines().collect();
        of.lines().filter(|line| !than.contains(line)).collect()
    };
    [only(old, new), only(new, old)]
}

#[test]
fn nothing_changes_nothing() {
    assert_eq!(patched(MAP, &[]).0, MAP);
    let windows = format!("\u{feff}{}", MAP.replace('\n', "\r\n"));
    assert_eq!(patched(&windows, &[]).0, windows);
}

#[test]
fn real_maps_come_out_as_they_went_in() {
    let Some(folder) = data() else { return };
    let mut count = 0;
    for place in ["maps/karlsruhe", "maps/kashiwanoha", "deecamp"] {
        for entry in std::fs::read_dir(folder.join(place)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "osm") {
                let bytes = std::fs::read(&path).unwrap();
                let text = OsmText::read(bytes.clone(), "map.osm").unwrap();
                let patch = Patch::plan(&text, &[], &mut NewIds::behind([&text])).unwrap();
                assert!(patch.lanelet2(&text) == bytes, "{}", path.display());
                count += 1;
            }
        }
    }
    assert_eq!(count, 12);
}

fn data() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA")
        .map_or_else(|| root.join("../shared/data"), PathBuf::from);
    if folder.join("deecamp").is_dir() {
        return Some(folder);
    }
    println!("SKIPPED: no real maps at {}", folder.display());
    None
}

#[test]
fn a_border_whose_paint_is_gone_stays_a_border() {
    let (new, patch) = patched(MAP, &[record(Some(10), Verdict::Removed, 1e9)]);
    assert_eq!((patch.applied, patch.not_applied.len()), (1, 0));
    let [gone, came] = changed_lines(MAP, &new);
    assert_eq!(
        gone,
        [
            "  <way id=\"10\" version=\"7\">",
            "    <tag k=\"type\" v=\"line_thin\"/>",
            "    <tag k=\"subtype\" v=\"dashed\"/>"
        ]
    );
    assert_eq!(
        came,
        [
            "  <way id=\"10\" version=\"8\">",
            "    <tag k=\"type\" v=\"virtual\"/>",
            "    <tag k=\"tilefold_change\" v=\"0000000000000abc\"/>"
        ]
    );
}

#[test]
fn a_line_of_nobody_s_is_deleted_and_shared_nodes_stay() {
    let (new, _) = patched(MAP, &[record(Some(11), Verdict::Removed, 1e9)]);
    let [gone, came] = changed_lines(MAP, &new);
    assert_eq!(came, [""; 0]);
    assert_eq!(gone.len(), 2);
    assert!(gone[0].contains("node id=\"4\"") && gone[1].contains("way id=\"11\""));
}

#[test]
fn a_moved_line_keeps_its_nodes_and_a_shared_end_stays() {
    let aside = [
        [8.4001, 49.0, 110.0],
        [8.4001, 49.0005, 110.5],
        [8.4001, 49.001, 111.0],
    ];
    let (new, patch) = patched(MAP, &[moved(10, 1e9, &aside)]);
    assert!(!new.contains("id=\"31\""), "no new thing is needed");
    assert!(
        new.contains("<node id=\"1\" version=\"5\" lat=\"49.0000000000\" lon=\"8.4001000000\">")
    );
    assert!(
        new.contains("<node id=\"3\" lat=\"49.001\" lon=\"8.4\">"),
        "{new}"
    );
    assert_eq!(patch.applied, 1);
    // Where both lines move, the node that they share goes along.
    let on = [[8.4003, 49.001, 111.0], [8.4003, 49.002, 112.0]];
    let (new, _) = patched(MAP, &[moved(10, 1e9, &aside), moved(11, 1e9, &on)]);
    assert!(
        new.contains("<node id=\"3\" lat=\"49.0010000000\" lon=\"8.4002000000\">"),
        "{new}"
    );
}

#[test]
fn a_stretch_without_paint_splits_the_paint_and_not_the_border() {
    let gone = ChangeRecord {
        from_m: 30.0,
        ..record(Some(10), Verdict::Removed, 80.0)
    };
    let (new, _) = patched(MAP, std::slice::from_ref(&gone));
    let map = map::read_from(new.as_bytes(), "new.osm").unwrap();
    let lines: Vec<_> = map.elements.iter().filter(|e| e.id.0 > 30).collect();
    assert_eq!(lines.len(), 2, "{new}");
    // 111.2 m in all, 30 m before the gap and 31.2 m behind it.
    let length_m = |points: &[[f64; 3]]| (points[points.len() - 1][1] - points[0][1]) * 111_200.0;
    assert!((length_m(&lines[0].points) - 30.0).abs() < 0.1, "{lines:?}");
    assert!((length_m(&lines[1].points) - 31.2).abs() < 0.1, "{lines:?}");
    assert!(
        map.elements.iter().all(|element| element.id.0 != 10),
        "10 is virtual"
    );

    // A line that no lanelet needs is cut in two.
    let free = ChangeRecord {
        element: Some(11),
        ..gone
    };
    let (new, _) = patched(MAP, &[free]);
    let map = map::read_from(new.as_bytes(), "new.osm").unwrap();
    let dashed = map.elements.iter().filter(|e| e.marking == Marking::Dashed);
    assert_eq!(dashed.count(), 3, "{new}");
    assert!(map.elements.iter().any(|element| element.id.0 == 11));
}

#[test]
fn repainting_changes_a_tag_and_no_place() {
    let repainted = ChangeRecord {
        class_observed: Some(Marking::Solid.code()),
        shift_m: Some(0.02),
        geometry_new: Some(wkb::line(&[[8.5, 49.0, 0.0], [8.5, 49.001, 0.0]])),
        ..record(Some(11), Verdict::Modified, 1e9)
    };
    let (new, _) = patched(MAP, &[repainted]);
    let [gone, came] = changed_lines(MAP, &new);
    assert_eq!((gone.len(), came.len()), (1, 2));
    assert!(came[0].contains("v=\"solid\""), "{came:?}");
}

#[test]
fn what_is_new_lies_on_the_road_and_is_written_like_the_rest() {
    let added = ChangeRecord {
        class_observed: Some(Marking::Solid.code()),
        geometry_new: Some(wkb::line(&[[8.4005, 49.0, 0.0], [8.4005, 49.0009, 0.0]])),
        ..record(None, Verdict::Added, 100.0)
    };
    let (new, _) = patched(MAP, std::slice::from_ref(&added));
    assert!(new.contains("  <node id=\"31\" version=\"1\" lat=\"49.0000000000\" lon=\"8.4005000000\">\n    <tag k=\"ele\" v=\"110.000\"/>\n  </node>\n"), "{new}");
    assert!(
        new.contains("<way id=\"33\" version=\"1\">\n    <nd ref=\"31\"/>\n    <nd ref=\"32\"/>\n"),
        "{new}"
    );
    let text = OsmText::read(MAP.into(), "map.osm").unwrap();
    let patch = Patch::plan(&text, &[added], &mut NewIds::before([&text])).unwrap();
    let mut osc = Vec::new();
    patch.osc(&text, &mut osc).unwrap();
    let osc = String::from_utf8(osc).unwrap();
    assert!(
        osc.contains("<create>") && osc.contains("<way id='-3' version='1'>"),
        "{osc}"
    );
    assert!(
        !osc.contains("<modify>") && !osc.contains("<delete>"),
        "{osc}"
    );
}

#[test]
fn text_of_the_map_stays_text_in_an_osm_change() {
    let text = OsmText::read(MAP.into(), "map.osm").unwrap();
    let records = [record(Some(12), Verdict::Removed, 1e9)];
    let patch = Patch::plan(&text, &records, &mut NewIds::before([&text])).unwrap();
    let mut osc = Vec::new();
    patch.osc(&text, &mut osc).unwrap();
    let osc = String::from_utf8(osc).unwrap();
    assert!(osc.contains("v='a &lt;b&gt; &amp; &apos;c&apos;'"), "{osc}");
    assert!(osc.contains("<way id='12' version='2'>"), "{osc}");
}

#[test]
fn what_cannot_be_written_is_told() {
    let unknown = record(Some(99), Verdict::Removed, 1e9);
    let (new, patch) = patched(MAP, &[unknown]);
    assert_eq!(new, MAP);
    assert_eq!(patch.not_applied[0].reason, "element 99 is not in the map");
}
