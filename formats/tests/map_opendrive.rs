//! OpenDRIVE: the Testfeld Niedersachsen against its road marks as another tool tessellated them,
//! and roads small enough to know where everything on them is.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use proj4rs::Proj;
use proj4rs::transform::transform;
use serde_json::Value;
use tilefold_formats::map::{self, MapFile};
use tilefold_schemas::{Color, Element, ElementKind, Marking, SignClass};

const TESTFELD: &str = "maps/testfeld/Testfeld_Niedersachsen_ALKS_xodr_sample_offset.xodr";

/// The folder of real data, or why there is none.
fn data() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA")
        .map_or_else(|| root.join("../shared/data"), PathBuf::from);
    if folder.join("maps/testfeld").is_dir() {
        return Some(folder);
    }
    println!(
        "SKIPPED: no real maps at {}; set TILEFOLD_TEST_DATA to the folder of real data",
        folder.display()
    );
    None
}

/// Metres on the plane of `projection`.
fn flat(projection: &str, [longitude_deg, latitude_deg, up]: [f64; 3]) -> [f64; 3] {
    let plane = Proj::from_proj_string(projection).expect("a projection");
    let wgs84 = Proj::from_proj_string("+proj=longlat +datum=WGS84").expect("a projection");
    let mut point = (longitude_deg.to_radians(), latitude_deg.to_radians(), up);
    transform(&wgs84, &plane, &mut point).expect("a point on the plane");
    [point.0, point.1, point.2]
}

fn points(value: &Value) -> Vec<[f64; 3]> {
    let of = |point: &Value| [0, 1, 2].map(|axis| point[axis].as_f64().expect("a number"));
    value.as_array().expect("a list").iter().map(of).collect()
}

/// The outlines of a mark: one if it is solid, one for each dash if it is broken.
fn rings(geometry: &Value) -> Vec<Vec<[f64; 3]>> {
    let coordinates = geometry["coordinates"].as_array().expect("a list");
    match geometry["type"].as_str() {
        Some("MultiPolygon") => coordinates
            .iter()
            .map(|polygon| points(&polygon[0]))
            .collect(),
        _ => vec![points(&coordinates[0])],
    }
}

/// How far `point` is beside the nearest stretch of `line` (to its left), and above it.
fn beside(line: &[[f64; 3]], point: [f64; 3]) -> [f64; 2] {
    let mut best = [f64::INFINITY; 2];
    for pair in line.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let along = [to[0] - from[0], to[1] - from[1]];
        let off = [point[0] - from[0], point[1] - from[1]];
        let length2 = along[0].powi(2) + along[1].powi(2);
        let part = ((off[0] * along[0] + off[1] * along[1]) / length2).clamp(0.0, 1.0);
        let rest = [off[0] - part * along[0], off[1] - part * along[1]];
        let side = (along[0] * off[1] - along[1] * off[0]).signum();
        let distance = rest[0].hypot(rest[1]);
        if distance < best[0].abs() {
            best = [
                distance * side,
                point[2] - from[2] - part * (to[2] - from[2]),
            ];
        }
    }
    best
}

/// How far one of their vertices is beside and above the nearest of our lines.
fn nearest(lines: &[Vec<[f64; 3]>], vertex: [f64; 3]) -> [f64; 2] {
    let offs = lines.iter().map(|line| beside(line, vertex));
    let nearer = |one: &[f64; 2], other: &[f64; 2]| one[0].abs().total_cmp(&other[0].abs());
    offs.min_by(nearer).expect("a line of ours")
}

/// How far our line is from the middle of an outline at most: each vertex is compared with the
/// nearest one on the other side, because marks are not all drawn as wide as they say.
fn off_middle(ring: &[[f64; 3]], offs: &[[f64; 2]]) -> f64 {
    let mut worst = 0.0_f64;
    for (at, [off, _]) in ring.iter().zip(offs) {
        let others = ring
            .iter()
            .zip(offs)
            .filter(|(_, other)| other[0] * off < 0.0);
        let apart = |other: &[f64; 3]| (other[0] - at[0]).hypot(other[1] - at[1]);
        let other = others.min_by(|(one, _), (other, _)| apart(one).total_cmp(&apart(other)));
        worst = worst.max(other.map_or(f64::INFINITY, |(_, other)| (off + other[0]).abs() / 2.0));
    }
    worst
}

/// Our marks by road and lane, in the frame of the file.
fn by_lane(map: &MapFile) -> BTreeMap<(String, String), Vec<Vec<[f64; 3]>>> {
    let mut found = BTreeMap::<_, Vec<_>>::new();
    for element in &map.elements {
        let words: Vec<&str> = element.tags["source_id"].split([' ', ',']).collect();
        let line = element.points.iter().map(|point| flat(FRAME, *point));
        let key = (words[1].to_owned(), words[7].to_owned());
        found.entry(key).or_default().push(line.collect());
    }
    found
}

/// The file's own geoReference.
const FRAME: &str =
    "+proj=tmerc +lat_0=0 +lon_0=9 +k=0.9996 +x_0=-115000 +y_0=-5793000 +datum=WGS84 +units=m";
/// What the other tool took the file's coordinates for: it ignores the file's false origin.
const THEIRS: &str = "+proj=utm +zone=32 +datum=WGS84";

#[test]
fn every_mark_of_the_testfeld_is_where_another_tool_puts_it() {
    let Some(folder) = data() else { return };
    let map = map::read(&folder.join(TESTFELD)).unwrap();
    assert_eq!(map.set_aside, []);
    // 126 solid and 86 broken marks stand in the file; the rest is kerb.
    assert_eq!((map.elements.len(), map.not_paint["curb"]), (212, 48));
    let ours = by_lane(&map);
    let text = std::fs::read_to_string(folder.join("maps/testfeld/roadMarks.json")).unwrap();
    let golden: Value = serde_json::from_str(&text).unwrap();
    let (mut worst, mut worst_up, mut compared) = (0.0_f64, 0.0_f64, 0);
    for mark in golden["features"].as_array().unwrap() {
        let about = &mark["properties"];
        if about["type"] == "curb" {
            continue;
        }
        let road = about["roadId"].as_str().unwrap().to_owned();
        let lines = &ours[&(road, about["laneId"].to_string())];
        for ring in rings(&mark["geometry"]) {
            let ring: Vec<_> = ring.iter().map(|vertex| flat(THEIRS, *vertex)).collect();
            let found: Vec<_> = ring.iter().map(|vertex| nearest(lines, *vertex)).collect();
            worst = worst.max(off_middle(&ring, &found));
            worst_up = found
                .iter()
                .fold(worst_up, |worst, [_, up]| worst.max(up.abs()));
            compared += found.len();
        }
    }
    println!("{compared} vertices: at most {worst:.4} m beside, {worst_up:.4} m above or below");
    assert!(worst < 0.02, "{worst} m beside");
    assert!(worst_up < 0.02, "{worst_up} m above or below");
    assert!(compared > 10_000);
}

/// What they drew on each lane of each road: the vertices of the outlines, in the frame of the file.
fn theirs(folder: &Path) -> BTreeMap<(String, String), Vec<[f64; 3]>> {
    let path = folder.join("maps/testfeld/roadMarks.json");
    let text = std::fs::read_to_string(path).expect("their road marks");
    let golden: Value = serde_json::from_str(&text).expect("JSON");
    let mut found = BTreeMap::<_, Vec<_>>::new();
    for mark in golden["features"].as_array().expect("a list") {
        let about = &mark["properties"];
        let road = about["roadId"].as_str().unwrap_or_default().to_owned();
        let vertices = rings(&mark["geometry"]).into_iter().flatten();
        let flat = vertices.map(|vertex| flat(THEIRS, vertex));
        let lane = found.entry((road, about["laneId"].to_string()));
        lane.or_default().extend(flat);
    }
    found
}

/// How far the worst place of a line is from the nearest of their vertices; a place each metre.
fn uncovered_m(line: &[[f64; 3]], vertices: &[[f64; 3]]) -> f64 {
    let apart = |a: &[f64; 2], b: &[f64; 3]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let places = line.windows(2).flat_map(|pair| {
        let [from, to] = [pair[0], pair[1]];
        let steps = (to[0] - from[0]).hypot(to[1] - from[1]).ceil().max(1.0);
        let part = move |axis: usize, step: f64| from[axis] + (to[axis] - from[axis]) * step;
        (0..=steps as usize).map(move |step| [0, 1].map(|axis| part(axis, step as f64 / steps)))
    });
    let nearest = |place: [f64; 2]| {
        let offs = vertices.iter().map(|vertex| apart(&place, vertex));
        offs.fold(f64::INFINITY, f64::min)
    };
    places.map(nearest).fold(0.0, f64::max)
}

#[test]
fn no_mark_of_the_testfeld_is_where_the_other_tool_has_none() {
    let Some(folder) = data() else { return };
    let theirs = theirs(&folder);
    let map = map::read(&folder.join(TESTFELD)).unwrap();
    let mut alone = Vec::new();
    for element in &map.elements {
        let id = element.tags["source_id"].as_str();
        let words: Vec<&str> = id.split([' ', ',']).collect();
        let line: Vec<_> = element
            .points
            .iter()
            .map(|point| flat(FRAME, *point))
            .collect();
        let vertices = &theirs[&(words[1].to_owned(), words[7].to_owned())];
        // Between the dashes of a motorway are 12 m.
        let gap_m = if element.marking == Marking::Solid {
            1.0
        } else {
            16.0
        };
        if uncovered_m(&line, vertices) > gap_m {
            alone.push(id);
        }
    }
    alone.sort_unstable();
    // The other tool leaves out the second mark of a lane in its section; the file has them.
    assert_eq!(
        alone,
        [
            "road 1000100, section 22, lane -2, mark 1",
            "road 1003400, section 3, lane -3, mark 1",
            "road 3000170, section 0, lane 0, mark 1",
            "road 3000180, section 0, lane -2, mark 1",
        ]
    );
}

/// A frame whose origin is at the false origin of UTM zone 32.
const UTM32: &str = "+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs";

/// A file with one road of 100 m, its line as `shape` says, and `rest` in it.
fn road(shape: &str, rest: &str) -> String {
    file(&format!(
        "<road id='7' length='100'><planView><geometry s='0' x='500000' y='5400000' hdg='0' length='100'>\
         {shape}</geometry></planView>{rest}</road>"
    ))
}

fn file(roads: &str) -> String {
    format!(
        "<OpenDRIVE><header revMajor='1' revMinor='8'><geoReference><![CDATA[{UTM32}]]></geoReference>\
         </header>{roads}</OpenDRIVE>"
    )
}

fn read(text: &str) -> MapFile {
    map::read_from(text.as_bytes(), "map.xodr").expect("a map")
}

/// The vertices of an element in metres from the road's first point.
fn local(element: &Element) -> Vec<[f64; 3]> {
    let from_start = |point: &[f64; 3]| {
        let [x, y, z] = flat(UTM32, *point);
        [x - 500_000.0, y - 5_400_000.0, z]
    };
    element.points.iter().map(from_start).collect()
}

fn assert_near(point: [f64; 3], wanted: [f64; 3]) {
    for (value, wanted) in point.iter().zip(wanted) {
        assert!((value - wanted).abs() < 1e-4, "{point:?} is not {wanted:?}");
    }
}

const CENTER_MARK: &str = "<lanes><laneSection s='0'><center><lane id='0'>\
    <roadMark sOffset='0' type='solid' color='yellow'/></lane></center></laneSection></lanes>";

#[test]
fn every_shape_ends_where_its_integral_does() {
    // Ends from scipy (quad, brentq).
    for (shape, end) in [
        ("<line/>", [100.0, 0.0]),
        (
            "<arc curvature='0.02'/>",
            [45.464871341284, 70.807341827357],
        ),
        (
            "<spiral curvStart='-0.01' curvEnd='0.02'/>",
            [98.348132182926, -0.117925318835],
        ),
        (
            "<poly3 a='0' b='0' c='0.001' d='0.00001'/>",
            [97.334667120654, 18.695560212527],
        ),
        (
            "<paramPoly3 aU='0' bU='90' cU='0' dU='0' aV='0' bV='0' cV='5' dV='2'/>",
            [90.0, 7.0],
        ),
        (
            "<paramPoly3 aU='0' bU='1' cU='0' dU='0' aV='0' bV='0' cV='0.001' dV='0' pRange='arcLength'/>",
            [100.0, 10.0],
        ),
    ] {
        let map = read(&road(shape, CENTER_MARK));
        assert_eq!((map.elements.len(), map.set_aside.len()), (1, 0), "{shape}");
        assert_eq!(map.elements[0].color, Color::Yellow);
        let line = local(&map.elements[0]);
        assert_near(line[0], [0.0; 3]);
        assert_near(line[line.len() - 1], [end[0], end[1], 0.0]);
    }
}

#[test]
fn an_arc_is_drawn_within_a_centimetre_and_not_finer_than_needed() {
    let map = read(&road("<arc curvature='0.02'/>", CENTER_MARK));
    let line = local(&map.elements[0]);
    for pair in line.windows(2) {
        let middle = [0, 1].map(|axis| (pair[0][axis] + pair[1][axis]) / 2.0);
        let radius = middle[0].hypot(middle[1] - 50.0);
        assert!((50.0 - radius).abs() < 0.01, "{radius}");
    }
    // Chords that are 5 mm from an arc of 50 m are 1.4 m long.
    assert!((70..=160).contains(&line.len()), "{} vertices", line.len());
}

const LANES: &str = "\
    <lateralProfile><superelevation s='0' a='0.1' b='0' c='0' d='0'/></lateralProfile>\
    <elevationProfile><elevation s='0' a='100' b='0.01' c='0' d='0'/></elevationProfile>\
    <lanes><laneOffset s='0' a='0.5' b='0' c='0' d='0'/><laneOffset s='60' a='4' b='0' c='0' d='0'/>\
    <laneSection s='0'>\
    <left><lane id='1'><width sOffset='0' a='3' b='0' c='0' d='0'/><roadMark sOffset='0' type='solid broken'/></lane>\
    <lane id='2'><border sOffset='0' a='5' b='0' c='0' d='0'/><roadMark sOffset='0' type='none'/></lane></left>\
    <center><lane id='0'><roadMark sOffset='0' type='solid broken' color='white'/></lane></center>\
    <right><lane id='-1'><width sOffset='0' a='3' b='0' c='0' d='0'/>\
    <roadMark sOffset='10' type='broken' color='blue'><type name='x' width='0.1'><line tOffset='0.2'/></type></roadMark>\
    <roadMark sOffset='30' type='broken broken'/></lane>\
    <lane id='-2' level='true'><width sOffset='0' a='2' b='0' c='0' d='0'/><roadMark sOffset='0' type='botts dots'/></lane>\
    </right></laneSection>\
    <laneSection s='60'><center><lane id='0'><roadMark sOffset='0' type='curb'/></lane></center></laneSection></lanes>";

#[test]
fn marks_lie_on_the_borders_of_their_lanes() {
    let map = read(&road("<line/>", LANES));
    assert_eq!(map.set_aside, []);
    assert_eq!(
        map.not_paint,
        BTreeMap::from([("curb".into(), 1), ("none".into(), 1)])
    );
    let of = |id: &str| {
        let id = format!("road 7, section 0, lane {id}");
        map.elements
            .iter()
            .find(|element| element.tags["source_id"] == id)
            .unwrap()
    };
    let (sin, cos) = 0.1_f64.sin_cos();
    let ends = |id: &str, marking, [from, to]: [f64; 2], banked: f64, level: f64| {
        let element = of(id);
        assert_eq!(element.marking, marking, "{id}");
        let line = local(element);
        let y = banked * cos + level;
        for (point, x) in [(line[0], from), (line[line.len() - 1], to)] {
            assert_near(point, [x, y, 100.0 + 0.01 * x + banked * sin]);
        }
    };
    ends("0, mark 0", Marking::SolidDashed, [0.0, 60.0], 0.5, 0.0);
    // From the inside out, which on the left is from right to left.
    ends("1, mark 0", Marking::DashedSolid, [0.0, 60.0], 3.5, 0.0);
    ends("-1, mark 0", Marking::Dashed, [10.0, 30.0], -2.3, 0.0);
    ends("-1, mark 1", Marking::DashedDashed, [30.0, 60.0], -2.5, 0.0);
    ends("-2, mark 0", Marking::Other, [0.0, 60.0], -2.5, -2.0);
    assert_eq!(of("-1, mark 0").color, Color::Other);
    assert_eq!(of("0, mark 0").color, Color::White);
    assert_eq!(
        [map.counts.relations, map.counts.lanelets, map.counts.ways],
        [1, 4, 7]
    );
}

#[test]
fn the_header_s_offset_turns_and_moves_the_map() {
    let offset = "</geoReference><offset x='100' y='0' z='5' hdg='1.5707963267948966'/>";
    let text = road("<line/>", CENTER_MARK).replace("</geoReference>", offset);
    let text = text.replace("x='500000' y='5400000'", "x='5400004' y='-500003'");
    let line = local(&read(&text).elements[0]);
    assert_near(line[0], [103.0, 4.0, 5.0]);
    assert_near(line[line.len() - 1], [103.0, 104.0, 5.0]);
}

#[test]
fn a_code_or_wkt_is_as_good_as_a_proj_string() {
    let plain = read(&road("<line/>", CENTER_MARK));
    let wkt = "PROJCS[\"WGS 84 / UTM zone 32N\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",AUTHORITY[\"EPSG\",\"6326\"]],\
               AUTHORITY[\"EPSG\",\"4326\"]],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"32632\"]]";
    let wkt2 = "PROJCRS[\"ETRS89 / UTM zone 32N\",BASEGEOGCRS[\"ETRS89\",ID[\"EPSG\",4258]],ID[\"EPSG\",25832]]";
    for code in [
        "EPSG:32632",
        "urn:ogc:def:crs:EPSG::32632",
        "EPSG:25832",
        wkt,
        wkt2,
    ] {
        let map = read(&road("<line/>", CENTER_MARK).replace(UTM32, code));
        let points = |map: &MapFile| local(&map.elements[0]);
        for (point, expected) in points(&map).into_iter().zip(points(&plain)) {
            // The ellipsoids of WGS 84 and ETRS89 differ by a tenth of a millimetre.
            let apart_m = (point[0] - expected[0]).hypot(point[1] - expected[1]);
            assert!(apart_m < 5e-4, "{code}: {apart_m}");
        }
    }
}

const OBJECTS: &str = "<objects>\
    <object id='1' type='crosswalk' s='50' t='0'><outlines><outline>\
    <cornerRoad s='48' t='-3' dz='0.1'/><cornerRoad s='52' t='-3'/><cornerRoad s='52' t='3'/><cornerRoad s='48' t='3'/>\
    </outline></outlines></object>\
    <object id='2' type='roadMark' name='Stop Line' s='45' t='-2' length='0.5' width='4' hdg='0'/>\
    <object id='3' type='roadMark' subtype='arrowLeft' s='40' t='-2' hdg='1.5707963267948966'><outline>\
    <cornerLocal u='-1' v='-0.5' z='0'/><cornerLocal u='1' v='-0.5' z='0'/><cornerLocal u='0' v='1' z='0'/></outline></object>\
    <object id='4' type='pole' s='1' t='1'/><object id='5' type='crosswalk' s='50' t='0'/></objects>\
    <signals><signal id='1' s='20' t='-4' type='294' country='DE'><validity fromLane='-2' toLane='-1'/></signal>\
    <signal id='2' s='20' t='-4' type='274' country='DE'/></signals>";

#[test]
fn objects_and_signals_that_are_paint() {
    let map = read(&road(
        "<line/>",
        &format!("{OBJECTS}{}", LANES.replace("a='0.1'", "a='0'")),
    ));
    let of = |id: &str| {
        let id = format!("road 7, {id}");
        map.elements
            .iter()
            .find(|element| element.tags["source_id"] == id)
            .unwrap()
    };
    assert_eq!(of("object 1").kind, ElementKind::Crosswalk);
    assert_near(local(of("object 1"))[0], [48.0, -3.0, 100.58]);
    let stop_line = of("object 2");
    assert_eq!(stop_line.kind, ElementKind::StopLine);
    assert_near(local(stop_line)[0], [45.0, -4.0, 100.45]);
    assert_near(local(stop_line)[1], [45.0, 0.0, 100.45]);
    assert_eq!(of("object 3").sign, SignClass::LeftArrow);
    assert_near(local(of("object 3"))[0], [40.5, -3.0, 100.4]);
    // Lanes -2 and -1, from the middle of the road outwards.
    assert_near(local(of("signal 1"))[0], [20.0, 0.5, 100.2]);
    assert_near(local(of("signal 1"))[1], [20.0, -4.5, 100.2]);
    assert_eq!(
        [map.not_paint["object pole"], map.not_paint["signal 274"]],
        [1, 1]
    );
    let reason = &map.set_aside[0].reason;
    assert!(
        reason.contains("road 7, object 5 (line 1, column"),
        "{reason}"
    );
    assert!(reason.contains("the length of its <object>"), "{reason}");
}
