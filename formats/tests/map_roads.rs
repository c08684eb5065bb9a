//! Lanelets of Lanelet2 maps: drawn ones, broken ones, and real ones against the Lanelet2 library
//! (tests/oracles/lanelet2_graph.py).

mod linear;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use linear::{Shape, assert_linear};
use serde_json::Value;
use tilefold_formats::map::{BorderKind, Lanelet, Roads, read_roads, read_roads_from};

/// Nodes 11 to 19 along a line at 49.0000 and 21 to 29 at 49.0001, from west to east.
fn map_with(rest: &str) -> String {
    let mut nodes = String::new();
    for column in 1..10 {
        let lon = 8.4 + 0.0001 * f64::from(column);
        for (row, lat) in [(1, 49.0), (2, 49.0001)] {
            let _ = write!(nodes, "<node id='{row}{column}' lat='{lat}' lon='{lon}'/>");
        }
    }
    format!("<osm>{nodes}\n{rest}</osm>")
}

fn way(id: i64, nodes: &[i64]) -> String {
    let nodes: String = nodes.iter().map(|id| format!("<nd ref='{id}'/>")).collect();
    format!("<way id='{id}'>{nodes}</way>")
}

fn lanelet(left: &[i64], right: &[i64]) -> String {
    let members = |role: &str, ids: &[i64]| -> String {
        let member = |id| format!("<member type='way' ref='{id}' role='{role}'/>");
        ids.iter().map(member).collect()
    };
    format!(
        "<relation id='7'>{}{}<tag k='type' v='lanelet'/><tag k='subtype' v='road'/></relation>",
        members("left", left),
        members("right", right)
    )
}

fn roads(rest: &str) -> Roads {
    read_roads_from(map_with(rest).as_bytes(), "map.osm").expect("a map is read")
}

fn one(rest: &str) -> Lanelet {
    let mut roads = roads(rest);
    assert_eq!(roads.set_aside, [], "{rest}");
    roads.lanelets.pop().expect("a lanelet")
}

/// The nodes' columns (1 to 9) along a border.
fn columns(points: &[[f64; 3]]) -> Vec<u8> {
    let column = |[lon, ..]: &[f64; 3]| ((lon - 8.4) / 0.0001).round() as u8;
    points.iter().map(column).collect()
}

#[test]
fn borders_run_with_the_left_one_on_the_left() {
    for (upper, lower) in [
        ([21, 22, 23], [11, 12, 13]),
        ([23, 22, 21], [11, 12, 13]),
        ([21, 22, 23], [13, 12, 11]),
        ([23, 22, 21], [13, 12, 11]),
    ] {
        let ways = way(1, &upper) + &way(2, &lower);
        let east = one(&(ways.clone() + &lanelet(&[1], &[2])));
        assert_eq!(columns(&east.left.points), [1, 2, 3], "{upper:?} {lower:?}");
        assert_eq!(columns(&east.right.points), [1, 2, 3]);
        assert_eq!(east.left.ways[0].is_reversed, upper[0] == 23);
        assert_eq!(east.right.ways[0].is_reversed, lower[0] == 13);
        let west = one(&(ways + &lanelet(&[2], &[1])));
        assert_eq!(columns(&west.left.points), [3, 2, 1], "{upper:?} {lower:?}");
    }
}

#[test]
fn ways_of_a_border_are_stitched_in_any_order_and_direction() {
    let pieces = way(1, &[21, 22]) + &way(2, &[24, 23, 22]) + &way(3, &[24, 25]);
    let right = way(4, &[11, 15]);
    for order in [[1, 2, 3], [3, 2, 1], [2, 1, 3], [2, 3, 1]] {
        let lanelet = one(&format!("{pieces}{right}{}", lanelet(&order, &[4])));
        assert_eq!(columns(&lanelet.left.points), [1, 2, 3, 4, 5], "{order:?}");
        let ways = lanelet
            .left
            .ways
            .iter()
            .map(|way| (way.id, way.is_reversed));
        assert_eq!(
            ways.collect::<Vec<_>>(),
            [(1, false), (2, true), (3, false)]
        );
    }
}

#[test]
fn lanelets_that_cannot_be_used_are_set_aside() {
    let good = way(1, &[21, 22, 23]) + &way(2, &[11, 12, 13]);
    for (rest, says) in [
        (
            lanelet(&[1], &[]),
            "lanelet 7 (line 2, column 121): it has no right border",
        ),
        (
            lanelet(&[1], &[9]),
            "its right border, way 9, is not in the file",
        ),
        (
            way(3, &[24, 25]) + &lanelet(&[1, 3], &[2]),
            "1 of a border's 2 ways do not join",
        ),
        (
            way(3, &[23, 24]) + &way(4, &[23, 25]) + &lanelet(&[1, 3, 4], &[2]),
            "over two ways of a border meet in node 23",
        ),
        (
            way(3, &[11]) + &lanelet(&[1], &[3]),
            "way 3 has fewer than two points",
        ),
        (lanelet(&[1], &[1]), "its borders enclose nothing"),
        (
            way(3, &[11, 11]) + &lanelet(&[1], &[3]),
            "a border has no length",
        ),
        (
            way(3, &[11, 99]) + &lanelet(&[1], &[3]),
            "its node 99 is not in the file",
        ),
        (
            lanelet(&[1], &[2]).replace("id='7'", "id='x'"),
            "is not a 64-bit integer",
        ),
    ] {
        let roads = roads(&format!("{good}{rest}"));
        assert_eq!(
            (roads.lanelets.len(), roads.set_aside.len()),
            (0, 1),
            "{rest}"
        );
        let reason = &roads.set_aside[0].reason;
        assert!(reason.contains(says), "{rest}\n{reason}");
    }
    let twice = roads(&format!("{good}{}", lanelet(&[1], &[2]).repeat(2)));
    assert_eq!((twice.lanelets.len(), twice.set_aside.len()), (1, 1));
    let walkway = lanelet(&[1], &[2]).replace("road", "walkway");
    let walkway = roads(&format!("{good}{walkway}"));
    assert_eq!(
        (walkway.lanelets.len(), walkway.not_roads["walkway"]),
        (0, 1)
    );
}

/// `n` lanelets between the same two borders of `n` points.
fn one_border_for_all(n: usize) -> String {
    let zigzag = |ends: [i64; 2]| -> Vec<i64> { ends.into_iter().cycle().take(n).collect() };
    let ways = way(1, &zigzag([21, 22])) + &way(2, &zigzag([11, 12]));
    let mut map = ways;
    for id in 0..n {
        map += &lanelet(&[1], &[2]).replace("id='7'", &format!("id='{id}'"));
    }
    map_with(&map)
}

/// A border of `n` ways.
fn a_border_of_many_ways(n: usize) -> String {
    let mut nodes = String::new();
    let mut ways = String::new();
    for id in 0..n {
        let lon = 8.0 + id as f64 * 1e-6;
        let _ = write!(nodes, "<node id='{}' lat='49' lon='{lon}'/>", 1_000 + id);
        let node = 1_000 + id as i64;
        ways += &way(100 + id as i64, &[node, node + 1]);
    }
    let members: Vec<i64> = (0..n as i64 - 1).map(|id| 100 + id).collect();
    map_with(&format!("{nodes}{ways}{}", lanelet(&members, &members)))
}

#[test]
fn time_grows_with_the_bytes() {
    let read = |text: &str| drop(read_roads_from(text.as_bytes(), "map.osm"));
    let shapes: [Shape; 2] = [
        ("one border", one_border_for_all),
        ("ways of a border", a_border_of_many_ways),
    ];
    for (what, shape) in shapes {
        assert_linear(what, 2_000, &shape, &read);
    }
    let text = one_border_for_all(100);
    let roads = read_roads_from(text.as_bytes(), "map.osm").expect("a map");
    assert_eq!((roads.lanelets.len(), roads.set_aside.len()), (64, 36));
    assert!(roads.set_aside[0].reason.contains("MAX_LANELETS_PER_WAY"));
}

/// The folder of real data, or why there is none.
fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA").map_or(beside, PathBuf::from);
    if folder.join("maps").is_dir() {
        return Some(folder);
    }
    println!(
        "SKIPPED: no real maps at {}; set TILEFOLD_TEST_DATA to the folder of real data",
        folder.display()
    );
    None
}

fn golden() -> Value {
    serde_json::from_str(include_str!("../../tests/oracles/lanelet2_graph.json")).expect("a golden")
}

#[test]
fn the_library_lets_cars_pass_the_same_lanelets() {
    let Some(folder) = data() else { return };
    for row in golden().as_array().expect("rows") {
        let name = row["map"].as_str().expect("a name");
        let roads = read_roads(&folder.join(name)).expect("a real map is read");
        assert_eq!(roads.set_aside, [], "{name}");
        let mut ours = Vec::new();
        for lanelet in &roads.lanelets {
            ours.push(lanelet.id);
            ours.extend((!lanelet.is_one_way).then_some(-lanelet.id));
        }
        ours.sort_unstable();
        let lanes = row["lanes"].as_array().expect("lanes");
        let theirs: Vec<i64> = lanes.iter().filter_map(|lane| lane[0].as_i64()).collect();
        assert_eq!(ours, theirs, "{name}");
        assert_eq!(
            Some(roads.lanelets.len() as u64),
            row["lanelets"].as_u64(),
            "{name}"
        );
        println!(
            "{name}: {} lanelets, {} lanes",
            roads.lanelets.len(),
            ours.len()
        );
    }
}

#[test]
fn what_borders_real_lanelets() {
    let Some(folder) = data() else { return };
    let kinds = |name: &str, wanted: BorderKind| {
        let roads = read_roads(&folder.join(name)).expect("a real map is read");
        let borders = roads
            .lanelets
            .iter()
            .flat_map(|lane| [&lane.left, &lane.right]);
        let ways = borders.flat_map(|border| &border.ways);
        ways.filter(|way| way.kind == wanted).count()
    };
    let karlsruhe = "maps/karlsruhe/mapping_example.osm";
    assert!(kinds(karlsruhe, BorderKind::Edge) > 200);
    assert_eq!(kinds(karlsruhe, BorderKind::Unstated), 0);
    let kashiwanoha = "maps/kashiwanoha/kashiwanoha_road_shoulder_added.osm";
    assert_eq!(kinds(kashiwanoha, BorderKind::Edge), 0);
    assert!(kinds(kashiwanoha, BorderKind::Unstated) > 100);
}
