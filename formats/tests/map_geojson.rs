//! Changes as GeoJSON: written, read back by another library and by ourselves, and refused.

use proptest::prelude::*;
use tilefold_formats::geojson::{
    Shape, TruthChange, read_changes, read_changes_file, write_changes,
};
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};

const LINE: [[f64; 3]; 3] = [
    [8.4, 49.0, 115.0],
    [8.4001, 49.0, 115.0],
    [8.4002, 49.00012345678, 0.0],
];
/// Clockwise.
const AREA: [[f64; 3]; 4] = [
    [8.4, 49.0, 0.0],
    [8.4, 49.1, 0.0],
    [8.5, 49.1, 0.0],
    [8.5, 49.0, 0.0],
];

fn record(verdict: Verdict, kind: ElementKind) -> ChangeRecord {
    ChangeRecord {
        tile: -2_100_350_681,
        change: -2,
        element: (verdict != Verdict::Added).then_some(1004),
        content: 7,
        kind: kind.code(),
        from_m: 20.0,
        to_m: 50.5,
        verdict: verdict.code(),
        p_no_change: 0.01,
        p_removed: 0.98,
        p_modified: 0.01,
        log_odds: 4.6,
        vehicles: 12,
        passes: 14,
        exposed: 2_000,
        hit: 3,
        first_ns: 1_709_208_000_123_000_000,
        last_ns: 1_709_208_001_000_000_000,
        changed_before_ns: Some(1_709_208_001_000_000_000),
        shift_m: Some(-1.25),
        geometry_old: Some(wkb::line(&LINE)),
        geometry_new: Some(wkb::polygon(&AREA)),
        best_vehicle: 1,
        best_ns: 2,
        fusion_model: "calibrated".to_owned(),
        ..ChangeRecord::default()
    }
}

fn written(records: &[ChangeRecord]) -> String {
    let mut bytes = Vec::new();
    write_changes(records, &mut bytes).expect("written");
    String::from_utf8(bytes).expect("UTF-8")
}

fn read(text: &str) -> Result<Vec<TruthChange>, String> {
    read_changes(text.as_bytes(), "t.geojson").map_err(|error| error.to_string())
}

#[test]
fn the_bytes_of_a_change() {
    let text = written(&[record(Verdict::Removed, ElementKind::LaneMarking)]);
    let expected = concat!(
        r#"{"type":"FeatureCollection","features":["#,
        "\n",
        r#"{"type":"Feature","id":"fffffffffffffffe","properties":{"element_id":1004,"#,
        r#""change_type":"removed","kind":"lane_marking","from_m":20.0,"to_m":50.5,"#,
        r#""p_no_change":0.01,"p_added":0.0,"p_removed":0.98,"p_modified":0.01,"vehicles":12,"#,
        r#""passes":14,"exposed":2000,"hit":3,"first_seen":"2024-02-29T12:00:00.123Z","#,
        r#""last_seen":"2024-02-29T12:00:01.000Z","changed_after":null,"#,
        r#""changed_before":"2024-02-29T12:00:01.000Z","shift_m":-1.25,"shift_sigma_m":null,"#,
        r#""tile":-2100350681,"change":"fffffffffffffffe","fusion_model":"calibrated"},"#,
        r#""geometry":{"type":"LineString","coordinates":[[8.400000000,49.000000000],"#,
        r#"[8.400100000,49.000000000],[8.400200000,49.000123457]]}}"#,
        "\n]}\n",
    );
    assert_eq!(text, expected);
}

#[test]
fn another_library_reads_what_we_write() {
    let text = written(&[
        record(Verdict::Removed, ElementKind::LaneMarking),
        record(Verdict::Added, ElementKind::Crosswalk),
    ]);
    let collection: geojson::FeatureCollection = text.parse().unwrap();
    assert_eq!(collection.features.len(), 2);
    let added = &collection.features[1];
    assert!(added.property("element_id").unwrap().is_null());
    let geojson::GeometryValue::Polygon { coordinates } = &added.geometry.as_ref().unwrap().value
    else {
        panic!("an area");
    };
    let ring: Vec<_> = coordinates[0].iter().map(|p| [p[0], p[1]]).collect();
    // Counter-clockwise and closed.
    assert_eq!(
        ring,
        [
            [8.4, 49.0],
            [8.5, 49.0],
            [8.5, 49.1],
            [8.4, 49.1],
            [8.4, 49.0]
        ]
    );
}

#[test]
fn there_and_back() {
    let text = written(&[
        record(Verdict::Modified, ElementKind::GroundSign),
        record(Verdict::Removed, ElementKind::StopLine),
        ChangeRecord {
            geometry_old: None,
            geometry_new: None,
            ..record(Verdict::Added, ElementKind::Crosswalk)
        },
    ]);
    let changes = read(&text).unwrap();
    let [modified, removed, added] = &changes[..] else {
        panic!("three changes")
    };
    assert_eq!((modified.shape, modified.points.len()), (Shape::Area, 4));
    assert_eq!(
        (removed.element_id, removed.change_type),
        (Some(1004), Verdict::Removed)
    );
    assert_eq!((removed.from_m, removed.to_m), (Some(20.0), Some(50.5)));
    assert_eq!(removed.points[1], [8.4001, 49.0, 0.0]);
    assert_eq!(
        (added.element_id, added.kind, added.shape),
        (None, ElementKind::Crosswalk, Shape::None)
    );
    assert!(read(&written(&[])).unwrap().is_empty());
}

#[test]
fn records_that_are_none_are_refused() {
    let mut out = Vec::new();
    let torn = ChangeRecord {
        geometry_old: Some(vec![1, 2, 0]),
        ..record(Verdict::Removed, ElementKind::LaneMarking)
    };
    let said = write_changes(&[torn], &mut out).unwrap_err().to_string();
    assert!(
        said.contains("change fffffffffffffffe: its geometry is not a WKB"),
        "{said}"
    );
    let newer = ChangeRecord {
        verdict: 99,
        ..record(Verdict::Removed, ElementKind::LaneMarking)
    };
    let said = write_changes(&[newer], &mut out).unwrap_err().to_string();
    assert!(said.contains("verdict has the unknown code 99"), "{said}");
}

#[test]
fn errors_name_the_feature_and_the_field() {
    let feature = |properties: &str, geometry: &str| {
        let good = r#"{"type":"Feature","properties":{"change_type":"added","kind":"stop_line"},"geometry":null}"#;
        format!(
            r#"{{"type":"FeatureCollection","features":[{good},{{"type":"Feature","properties":{properties},"geometry":{geometry}}}]}}"#
        )
    };
    let of = |extra: &str| format!(r#"{{"change_type":"added","kind":"stop_line"{extra}}}"#);
    for (text, says) in [
        (
            feature("{}", "null"),
            "t.geojson, feature 1 (counted from 0), change_type: nothing is not added, removed or modified",
        ),
        (
            feature(r#"{"change_type":"moved"}"#, "null"),
            "change_type: \"moved\" is not",
        ),
        (
            feature(r#"{"change_type":"added","kind":"kerb"}"#, "null"),
            "kind: \"kerb\" is not lane_marking",
        ),
        (
            feature(&of(r#","element_id":1.5"#), "null"),
            "element_id: 1.5 is not a 64-bit integer",
        ),
        (
            feature(&of(r#","from_m":-1"#), "null"),
            "from_m: -1 is not a station",
        ),
        (
            feature(&of(r#","from_m":9,"to_m":3"#), "null"),
            "to_m: the stretch ends at 3 m",
        ),
        (feature("null", "null"), "properties: an object is missing"),
        (
            feature(&of(""), r#"{"type":"MultiPoint"}"#),
            "geometry.type: \"MultiPoint\" is not",
        ),
        (
            feature(&of(""), r#"{"type":"LineString","coordinates":[[1,2]]}"#),
            "1 positions are too few",
        ),
        (
            feature(
                &of(""),
                r#"{"type":"LineString","coordinates":[[1,2],[49,114]]}"#,
            ),
            "[49,114] is not a position",
        ),
        (
            feature(
                &of(""),
                r#"{"type":"Polygon","coordinates":[[[1,2],[3,4],[5,6],[7,8]]]}"#,
            ),
            "does not end where it begins",
        ),
        (
            feature(&of(""), r#"{"type":"Polygon","coordinates":[[],[]]}"#),
            "one ring here",
        ),
        (
            "[1".to_owned(),
            "are no JSON: EOF while parsing a list at line 1 column 2",
        ),
        ("[]".to_owned(), "its type is not FeatureCollection"),
        (
            r#"{"type":"FeatureCollection"}"#.to_owned(),
            "no list of features",
        ),
        ("[".repeat(100_000), "recursion limit"),
    ] {
        let said = read(&text).unwrap_err();
        assert!(said.contains(says), "{said}");
    }
    let large_id = feature(&of(r#","element_id":"-9000000000000000001""#), "null");
    assert_eq!(
        read(&large_id).unwrap()[1].element_id,
        Some(-9_000_000_000_000_000_001)
    );
}

#[test]
fn the_real_truth_is_read() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA")
        .map_or_else(|| root.join("../shared/data"), std::path::PathBuf::from);
    let path = folder.join("deecamp/truth.geojson");
    if !path.is_file() {
        println!("SKIPPED: no {}; set TILEFOLD_TEST_DATA", path.display());
        return;
    }
    let changes = read_changes_file(&path).unwrap();
    for verdict in [Verdict::Added, Verdict::Removed, Verdict::Modified] {
        assert_eq!(
            changes.iter().filter(|c| c.change_type == verdict).count(),
            9
        );
    }
    assert!(
        changes
            .iter()
            .all(|c| c.kind == ElementKind::LaneMarking && c.shape == Shape::Line)
    );
    assert_eq!(changes[0].element_id, Some(1004));
    assert_eq!(changes[0].points[0], [114.365453847, 22.681069585, 0.0]);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_text_panics(text in "[\\[\\]{}\",:0-9a-z.e-]{0,200}") {
        let _ = read(&text);
    }

    #[test]
    fn positions_come_back(points in prop::collection::vec((-180.0..=180.0_f64, -90.0..=90.0_f64), 2..20)) {
        let line: Vec<_> = points.iter().map(|(lon, lat)| [*lon, *lat, 0.0]).collect();
        let record = ChangeRecord {
            geometry_old: Some(wkb::line(&line)),
            ..record(Verdict::Removed, ElementKind::LaneMarking)
        };
        let back = read(&written(&[record])).unwrap();
        for (point, [lon, lat, _]) in back[0].points.iter().zip(&line) {
            prop_assert!((point[0] - lon).abs() <= 5.1e-10 && (point[1] - lat).abs() <= 5.1e-10);
        }
    }
}

fn truth_with(properties: &str) -> Result<TruthChange, String> {
    let text = format!(
        r#"{{"type":"FeatureCollection","features":[{{"type":"Feature","geometry":null,
        "properties":{{"change_type":"removed","kind":"lane_marking",{properties}}}}}]}}"#
    );
    read(&text).map(|changes| changes[0].clone())
}

#[test]
fn details_and_times_are_optional() {
    let plain = truth_with(r#""element_id":1,"colour_of_the_sky":"blue""#).unwrap();
    assert_eq!((plain.detail, plain.since_ns), (None, None));
    let null = truth_with(r#""detail":null,"since":null"#).unwrap();
    assert_eq!((null.detail, null.since_ns), (None, None));
    let detailed = truth_with(r#""detail":"partly_removed","since":1709208000123999999"#).unwrap();
    assert_eq!(detailed.detail.as_deref(), Some("partly_removed"));
    assert_eq!(detailed.since_ns, Some(1_709_208_000_123_999_999));
    // `date -u --date=2024-02-29T13:00:00.5+01:00 +%s%N`
    let text = truth_with(r#""since":"2024-02-29T13:00:00.5+01:00""#).unwrap();
    assert_eq!(text.since_ns, Some(1_709_208_000_500_000_000));
    for (properties, says) in [
        (r#""detail":7"#, "detail"),
        (r#""since":"yesterday""#, "\"yesterday\" is neither"),
        (r#""since":1.5"#, "1.5 is neither"),
        (r#""since":"3000-01-01T00:00:00Z""#, "neither"),
    ] {
        let error = truth_with(properties).unwrap_err();
        assert!(
            error.contains(says) && error.contains("feature 0"),
            "{error}"
        );
    }
}
