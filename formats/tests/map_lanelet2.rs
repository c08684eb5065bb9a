//! Real Lanelet2 maps against the Lanelet2 library (tests/oracles/lanelet2_maps.py).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tilefold_formats::map::{self, MapFile};
use tilefold_schemas::{Color, Element, ElementKind, Marking, SignClass};

/// The folder of real data, or why there is none.
fn data() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA")
        .map_or_else(|| root.join("../shared/data"), PathBuf::from);
    if folder.join("deecamp").is_dir() {
        return Some(folder);
    }
    println!(
        "SKIPPED: no real maps at {}; set TILEFOLD_TEST_DATA to the folder of real data",
        folder.display()
    );
    None
}

fn load(folder: &Path, name: &str) -> MapFile {
    map::read(&folder.join(name)).expect("a real map is read")
}

/// Number of shapes, number of points, sums of longitude, latitude and elevation.
#[derive(Debug, Default, Clone, Copy)]
struct Sums {
    shapes: u64,
    points: u64,
    sums: [f64; 3],
}

impl Sums {
    fn add<'a>(&mut self, points: impl IntoIterator<Item = &'a [f64; 3]>) {
        for point in points {
            self.points += 1;
            for (sum, value) in self.sums.iter_mut().zip(point) {
                *sum += value;
            }
        }
    }

    fn assert_is(&self, golden: &Value, what: &str) {
        assert_eq!(
            Some(self.shapes),
            golden["shapes"].as_u64(),
            "{what}: shapes"
        );
        assert_eq!(
            Some(self.points),
            golden["points"].as_u64(),
            "{what}: points"
        );
        for (sum, name) in self.sums.iter().zip(["lon", "lat", "ele"]) {
            let golden = golden[name].as_f64().expect("a golden sum");
            // 1e-9 degrees are a tenth of a millimetre; the library goes through UTM and back.
            let each = (sum - golden).abs() / self.points.max(1) as f64;
            assert!(
                each < 2e-9,
                "{what}: {name} is {sum}, the library says {golden}"
            );
        }
    }
}

/// The map's paint by the type of its ways. A crosswalk lanelet gives its two borders back.
fn by_type(map: &MapFile) -> BTreeMap<String, Sums> {
    let mut found = BTreeMap::<String, Sums>::new();
    for element in &map.elements {
        let is_lanelet = element.tags["type"] == "lanelet";
        let is_polygon = element.tags.get("area").is_some_and(|area| area == "yes");
        let name = if is_lanelet {
            "pedestrian_marking"
        } else {
            element.tags["type"].as_str()
        };
        let sums = found.entry(name.to_owned()).or_default();
        sums.shapes += if is_lanelet { 2 } else { 1 };
        sums.add(&element.points);
        if is_polygon {
            sums.add(element.points.first());
        }
    }
    found
}

#[test]
fn every_painted_shape_is_where_the_library_puts_it() {
    let Some(folder) = data() else { return };
    let golden: Value =
        serde_json::from_str(include_str!("../../tests/oracles/lanelet2_maps.json")).unwrap();
    let mut compared = 0;
    for row in golden.as_array().unwrap() {
        let name = row["map"].as_str().unwrap();
        let map = load(&folder, name);
        assert_eq!(map.set_aside, [], "{name}");
        assert_eq!(
            Some(map.counts.lanelets),
            row["lanelets"].as_u64(),
            "{name}"
        );
        assert_eq!(Some(map.counts.areas), row["areas"].as_u64(), "{name}");
        let regulatory = row["regulatory_elements"].as_u64();
        assert_eq!(Some(map.counts.regulatory_elements), regulatory, "{name}");
        let mut found = by_type(&map);
        if name.contains("kashiwanoha") {
            // Their crosswalks lie between untyped lines.
            found.remove("pedestrian_marking");
        }
        for (kind, sums) in &found {
            let shapes = if row["lines"][kind].is_null() {
                "polygons"
            } else {
                "lines"
            };
            sums.assert_is(&row[shapes][kind], &format!("{name}, {kind}"));
            compared += sums.points;
        }
        for (kind, shapes) in row["lines"].as_object().unwrap() {
            let ours = found.get(kind).map_or(0, |sums| sums.shapes)
                + map.not_paint.get(kind).copied().unwrap_or(0);
            assert_eq!(Some(ours), shapes["shapes"].as_u64(), "{name}, {kind}");
        }
    }
    println!(
        "{compared} points of {} maps agree",
        golden.as_array().unwrap().len()
    );
}

/// The map's paint by type and subtype; the borders of crosswalk lanelets are not among it.
fn by_subtype(map: &MapFile) -> BTreeMap<String, u64> {
    let mut found = BTreeMap::new();
    for element in &map.elements {
        let said = |key| element.tags.get(key).map_or("", String::as_str);
        if said("type") != "lanelet" {
            let name = format!("{}/{}", said("type"), said("subtype"));
            *found.entry(name).or_default() += 1;
        }
    }
    found
}

#[test]
fn every_shape_is_counted_by_type_and_subtype_as_the_library_counts_it() {
    let Some(folder) = data() else { return };
    let golden: Value =
        serde_json::from_str(include_str!("../../tests/oracles/lanelet2_maps.json")).unwrap();
    for row in golden.as_array().unwrap() {
        let name = row["map"].as_str().unwrap();
        let map = load(&folder, name);
        let ours = by_subtype(&map);
        let mut by_type = BTreeMap::<&str, u64>::new();
        for (subtype, count) in row["subtypes"].as_object().unwrap() {
            let (kind, _) = subtype.split_once('/').unwrap();
            *by_type.entry(kind).or_default() += count.as_u64().unwrap();
            // What is no paint is counted by type only, and the borders of painted crosswalk
            // lanelets are in those.
            if !map.not_paint.contains_key(kind) && kind != "pedestrian_marking" {
                let found = ours.get(subtype).copied();
                assert_eq!(found, count.as_u64(), "{name}, {subtype}");
            }
        }
        for (kind, count) in &map.not_paint {
            assert_eq!(by_type.get(kind.as_str()), Some(count), "{name}, {kind}");
        }
        let painted: u64 = ours.values().sum();
        let others: u64 = map.not_paint.values().sum();
        let borders = map.counts.ways - painted - others;
        let markings = by_type.get("pedestrian_marking").copied().unwrap_or(0);
        let shapes: u64 = by_type.values().sum();
        assert_eq!(map.counts.ways, shapes, "{name}");
        assert!(borders <= markings, "{name}: {borders} borders");
    }
}

fn count(map: &MapFile, wanted: impl Fn(&Element) -> bool) -> usize {
    map.elements
        .iter()
        .filter(|element| wanted(element))
        .count()
}

#[test]
fn deecamp_has_lines_signs_and_crossings() {
    let Some(folder) = data() else { return };
    let map = load(&folder, "deecamp/after.osm");
    let of = |kind| count(&map, |element| element.kind == kind);
    assert_eq!(of(ElementKind::LaneMarking), 255);
    assert_eq!(of(ElementKind::GroundSign), 79);
    // Two of them are stop lines on the road; the map tags all six as zebra markings.
    assert_eq!(of(ElementKind::Crosswalk), 6);
    assert_eq!(
        count(&map, |e| e.marking == Marking::Solid
            && e.color == Color::White),
        255
    );
    assert!(
        map.elements
            .iter()
            .filter(|e| e.kind == ElementKind::GroundSign)
            .all(|e| e.points.len() == 4)
    );
    assert_eq!(map.about["map_version"], "after");
    assert!(map.elements.is_sorted_by_key(|element| element.id));
}

#[test]
fn the_truth_s_elements_are_in_the_maps() {
    let Some(folder) = data() else { return };
    let [before, after] = ["before", "after"].map(|v| load(&folder, &format!("deecamp/{v}.osm")));
    let hashes = |map: &MapFile| -> BTreeMap<i64, i64> {
        map.elements
            .iter()
            .map(|e| (e.id.0, e.content_hash().0))
            .collect()
    };
    let [before, after] = [hashes(&before), hashes(&after)];
    let removed = before.keys().filter(|id| !after.contains_key(*id)).count();
    let added = after.keys().filter(|id| !before.contains_key(*id)).count();
    let modified = before
        .iter()
        .filter(|(id, hash)| after.get(*id).is_some_and(|a| a != *hash))
        .count();
    assert_eq!([added, removed, modified], [9, 9, 9]);
}

#[test]
fn karlsruhe_through_its_tag_schemes() {
    let Some(folder) = data() else { return };
    let map = load(&folder, "maps/karlsruhe/mapping_example.osm");
    let marked = |map: &MapFile, marking| {
        count(map, |e| {
            e.marking == marking && e.tags["type"].starts_with("line_")
        })
    };
    assert_eq!(marked(&map, Marking::Solid), 61);
    assert_eq!(marked(&map, Marking::Dashed), 118);
    assert_eq!(marked(&map, Marking::SolidDashed), 2);
    assert_eq!(marked(&map, Marking::DashedSolid), 1);
    assert_eq!(marked(&map, Marking::Unknown), 5);
    assert_eq!(count(&map, |e| e.kind == ElementKind::StopLine), 28);
    assert_eq!(count(&map, |e| e.sign == SignClass::SpeedLimit), 1);
    // Eight crosswalk lanelets, of which five run between walls and kerbs.
    assert_eq!(count(&map, |e| e.kind == ElementKind::Crosswalk), 3);
    assert_eq!(map.not_paint["virtual"], 187);
    assert_eq!(map.counts.deleted, 1);

    let older = load(&folder, "maps/karlsruhe/karlsruhe_73de41b.osm");
    assert_eq!(
        marked(&older, Marking::Solid),
        9 + 19 + 2 + 27,
        "straight is solid"
    );
    assert_eq!(marked(&older, Marking::SolidDashed), 2);
    assert_eq!(count(&older, |e| e.kind == ElementKind::Crosswalk), 2);
}

#[test]
fn kashiwanoha_begins_with_a_blank_line() {
    let Some(folder) = data() else { return };
    let mut blank = 0;
    for entry in std::fs::read_dir(folder.join("maps/kashiwanoha")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "osm") {
            continue;
        }
        blank += usize::from(std::fs::read(&path).unwrap().starts_with(b"\n"));
        let map = map::read(&path).unwrap();
        assert!(
            count(&map, |e| e.kind == ElementKind::Crosswalk) >= 4,
            "{}",
            path.display()
        );
    }
    assert_eq!(blank, 1);
}
