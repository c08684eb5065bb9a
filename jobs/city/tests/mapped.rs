//! Worlds from maps: drawn ones and broken ones, and real ones against the Lanelet2 library's routing
//! graph (tests/oracles/lanelet2_graph.py).

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;
use tilefold_city::{CitySpec, Lane, Site, World, write};
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader};
use tilefold_formats::map;
use tilefold_schemas::log::{LogMessage, Payload};
use tilefold_tiler::geodesy::LocalFrame;

/// The folder of real data, or why there is none.
fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
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

/// A lane graph in the library's numbers: a lanelet's id, negative against its borders.
#[derive(Debug, Default)]
struct Graph {
    lanes: BTreeMap<i64, [f64; 2]>,
    following: BTreeSet<[i64; 2]>,
    left: BTreeSet<[i64; 2]>,
    /// Neighbours to which a car may not change, or of which the library does not know it.
    adjacent_left: BTreeSet<[i64; 2]>,
    junctions: BTreeSet<i64>,
}

fn ours(path: &Path, world: &World) -> Graph {
    let mut numbers = Vec::new();
    for lanelet in map::read_roads(path).unwrap().lanelets {
        numbers.push(lanelet.id);
        numbers.extend((!lanelet.is_one_way).then_some(-lanelet.id));
    }
    assert_eq!(numbers.len(), world.lanes.len());
    let mut graph = Graph::default();
    for (&number, lane) in numbers.iter().zip(&world.lanes) {
        graph
            .lanes
            .insert(number, [lane.speed_m_s * 3.6, length_m(lane)]);
        graph
            .following
            .extend(lane.next.iter().map(|&next| [number, numbers[next]]));
        graph
            .left
            .extend(lane.left.map(|left| [number, numbers[left]]));
        if lane.is_junction {
            graph.junctions.insert(number);
        }
    }
    graph
}

fn theirs(row: &Value) -> Graph {
    let pairs = |name: &str| -> BTreeSet<[i64; 2]> {
        let rows = row[name].as_array().unwrap().iter();
        rows.map(|pair| [0, 1].map(|side| pair[side].as_i64().unwrap()))
            .collect()
    };
    let lane = |lane: &Value| {
        let figures = [1, 2].map(|column| lane[column].as_f64().unwrap());
        (lane[0].as_i64().unwrap(), figures)
    };
    let conflicting = row["conflicting"].as_array().unwrap().iter();
    Graph {
        lanes: row["lanes"].as_array().unwrap().iter().map(lane).collect(),
        following: pairs("following"),
        left: pairs("left"),
        adjacent_left: pairs("adjacent_left"),
        junctions: conflicting.map(|id| id.as_i64().unwrap()).collect(),
    }
}

fn maps(folder: &Path) -> Vec<(String, PathBuf, Graph)> {
    let golden: Value =
        serde_json::from_str(include_str!("../../../tests/oracles/lanelet2_graph.json")).unwrap();
    let rows = golden.as_array().unwrap().iter();
    rows.map(|row| {
        let name = row["map"].as_str().unwrap().to_owned();
        let path = folder.join(&name);
        (name, path, theirs(row))
    })
    .collect()
}

fn length_m(lane: &Lane) -> f64 {
    let side = |pair: &[[f64; 3]]| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
    lane.centre.windows(2).map(side).sum()
}

#[test]
fn lanes_join_as_in_the_library_s_routing_graph() {
    let Some(folder) = data() else { return };
    for (name, path, theirs) in maps(&folder) {
        let ours = ours(&path, &World::from_lanelet2(&path).unwrap());
        assert!(ours.lanes.keys().eq(theirs.lanes.keys()), "{name}: lanes");
        for (lane, [speed_km_h, length_m]) in &ours.lanes {
            let [their_speed_km_h, their_length_m] = theirs.lanes[lane];
            assert!(
                (speed_km_h - their_speed_km_h).abs() < 0.01,
                "{name}: {lane}"
            );
            let off_m = (length_m - their_length_m).abs();
            assert!(
                off_m < 0.3 + 0.05 * their_length_m,
                "{name}: {lane} {length_m}"
            );
        }
        // One pair of ends in one map lies 0.2 m apart, without shared nodes.
        assert!(ours.following.is_superset(&theirs.following), "{name}");
        assert!(ours.following.len() <= theirs.following.len() + 1, "{name}");
        // Where a map does not say what a line is, we let lanes be changed, and the library does not.
        assert!(ours.left.is_superset(&theirs.left), "{name}");
        let either: BTreeSet<_> = theirs.left.union(&theirs.adjacent_left).copied().collect();
        assert!(ours.left.is_subset(&either), "{name}");
        // The library counts every overlap, ours are branches and crossings.
        assert!(ours.junctions.is_subset(&theirs.junctions), "{name}");
        assert!(
            ours.junctions.len() * 5 >= theirs.junctions.len() * 4,
            "{name}"
        );
        println!(
            "{name}: {} lanes; following {} of {}; left {} of {}; junctions {} of {}",
            ours.lanes.len(),
            ours.following.len(),
            theirs.following.len(),
            ours.left.len(),
            theirs.left.len(),
            ours.junctions.len(),
            theirs.junctions.len(),
        );
    }
}

#[test]
fn left_and_right_are_each_other_s_opposite() {
    let Some(folder) = data() else { return };
    for (name, path, _) in maps(&folder) {
        let lanes = World::from_lanelet2(&path).unwrap().lanes;
        let mut pairs = 0;
        for (index, lane) in lanes.iter().enumerate() {
            if let Some(left) = lane.left {
                let back = lanes[left].right;
                // A line of two sides, or two lanes on one: then the first stands for both.
                pairs += usize::from(back == Some(index));
            }
        }
        let lefts = lanes.iter().filter(|lane| lane.left.is_some()).count();
        println!("{name}: {pairs} of {lefts} pairs");
        assert!(pairs + 3 >= lefts, "{name}: {pairs} of {lefts}");
    }
}

/// Whether a drive along lanes, without changes of lane, need never end, by the lane it begins in.
fn goes_on(lanes: &[Lane]) -> Vec<bool> {
    let mut goes_on: Vec<bool> = vec![true; lanes.len()];
    loop {
        let before = goes_on.clone();
        for (index, lane) in lanes.iter().enumerate() {
            goes_on[index] = lane.next.iter().any(|&next| before[next]);
        }
        if goes_on == before {
            return goes_on;
        }
    }
}

/// A random walk along lanes that do not end; 0 m if there are none.
fn walk_m(lanes: &[Lane], seed: u64) -> f64 {
    let goes_on = goes_on(lanes);
    let mut state = seed;
    let mut draw = |most: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % most
    };
    let starts: Vec<usize> = (0..lanes.len()).filter(|&lane| goes_on[lane]).collect();
    if starts.is_empty() {
        return 0.0;
    }
    let mut lane = starts[draw(starts.len())];
    let mut walked_m = 0.0;
    while walked_m < 2_000.0 {
        walked_m += length_m(&lanes[lane]);
        let ways: Vec<usize> = lanes[lane]
            .next
            .iter()
            .copied()
            .filter(|&next| goes_on[next])
            .collect();
        let next = ways[draw(ways.len())];
        let [end, begin] = [*lanes[lane].centre.last().unwrap(), lanes[next].centre[0]];
        let gap_m = (end[0] - begin[0]).hypot(end[1] - begin[1]);
        assert!(
            gap_m < 0.3 && (end[2] - begin[2]).abs() < 0.1,
            "{end:?} {begin:?}"
        );
        lane = next;
    }
    walked_m
}

/// The longest of the shortest ways along lanes, without changes of lane.
fn longest_route_m(lanes: &[Lane]) -> f64 {
    let lengths_m: Vec<f64> = lanes.iter().map(length_m).collect();
    let from = |start: usize| {
        let mut reached_m = vec![f64::INFINITY; lanes.len()];
        reached_m[start] = lengths_m[start];
        let mut open = vec![start];
        while let Some(lane) = open.pop() {
            for &next in &lanes[lane].next {
                let on_m = reached_m[lane] + lengths_m[next];
                if on_m < reached_m[next] {
                    reached_m[next] = on_m;
                    open.push(next);
                }
            }
        }
        let reached = reached_m
            .into_iter()
            .filter(|length_m| length_m.is_finite());
        reached.fold(0.0, f64::max)
    };
    (0..lanes.len()).map(from).fold(0.0, f64::max)
}

#[test]
fn vehicles_find_two_kilometres_to_drive() {
    let Some(folder) = data() else { return };
    for (name, path, _) in maps(&folder) {
        let lanes = World::from_lanelet2(&path).unwrap().lanes;
        let total_m: f64 = lanes.iter().map(length_m).sum();
        let longest_m = longest_route_m(&lanes);
        let walked_m = (1..20)
            .map(|seed| walk_m(&lanes, seed))
            .fold(f64::INFINITY, f64::min);
        println!(
            "{name}: {total_m:.0} m of lanes, longest route {longest_m:.0} m, least walk {walked_m:.0} m"
        );
        // In two revisions all ways end at the map's border: no drive is longer than the longest.
        let all_end = ["5778c4de8.osm", "9159228e5.osm"]
            .iter()
            .any(|end| name.ends_with(end));
        assert_eq!(walked_m >= 2_000.0, !all_end, "{name}");
    }
}

#[test]
fn paint_lies_where_the_map_has_it() {
    let Some(folder) = data() else { return };
    for (name, path, _) in maps(&folder) {
        let world = World::from_lanelet2(&path).unwrap();
        let elements = map::read(&path).unwrap().elements;
        assert_eq!(world.paint.len(), elements.len(), "{name}");
        let mut worst_m = [0.0_f64; 2];
        for (paint, element) in world.paint.iter().zip(&elements) {
            let back = world.element(paint);
            assert_eq!(
                (back.id, back.kind, back.marking),
                (element.id, element.kind, element.marking)
            );
            assert_eq!(back.points.len(), element.points.len());
            for point in &back.points {
                // Outlines begin elsewhere than in the map.
                let frame = LocalFrame::new(*point);
                let off_m = element.points.iter().map(|&at| {
                    let [e, n, u] = frame.to_enu(at);
                    [e.hypot(n), u.abs()]
                });
                let nearest = off_m.min_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
                worst_m = [worst_m[0].max(nearest[0]), worst_m[1].max(nearest[1])];
            }
        }
        println!(
            "{name}: {} paints, off by {worst_m:?} m at most",
            world.paint.len()
        );
        assert!(worst_m[0] < 0.001, "{name}: {worst_m:?}");
        assert!(!world.kerbs.is_empty(), "{name}");
        let edges_m: f64 = world.kerbs.iter().map(|kerb| along_m(kerb)).sum();
        println!("{name}: {} kerbs, {edges_m:.0} m", world.kerbs.len());
    }
}

#[test]
fn the_ground_follows_the_map() {
    let Some(folder) = data() else { return };
    for (name, path, _) in maps(&folder) {
        let world = World::from_lanelet2(&path).unwrap();
        let roads = map::read_roads(&path).unwrap();
        let anchor = world.frame.anchor();
        let mut off_m = Vec::new();
        for lanelet in &roads.lanelets {
            for [lon, lat, ele] in lanelet.left.points.iter().chain(&lanelet.right.points) {
                let [east_m, north_m, _] = world.frame.to_enu([*lon, *lat, anchor[2]]);
                let up_m = world.relief.height_m([east_m, north_m]);
                off_m.push((anchor[2] + up_m - ele).abs());
            }
        }
        off_m.sort_by(f64::total_cmp);
        let [median, p95, worst] =
            [50, 95, 100].map(|share| off_m[(off_m.len() - 1) * share / 100]);
        println!("{name}: heights off by {median:.3} m (median), {p95:.3} m (95 %), {worst:.3} m");
        if name.contains("kashiwanoha") {
            assert!(
                median < 0.01 && p95 < 0.06 && worst < 0.15,
                "{name}: {median} {p95} {worst}"
            );
        } else {
            assert_eq!(world.relief.height_m([10.0, 20.0]), 0.0);
        }
    }
}

#[test]
fn nobody_drives_over_a_kerb() {
    let Some(folder) = data() else { return };
    for (name, path, _) in maps(&folder) {
        let world = World::from_lanelet2(&path).unwrap();
        // One revision of Karlsruhe has a tram's rails as lanelets of no subtype.
        let is_wide = |lane: &&Lane| lane.width_m > 1.8;
        let lanes = world.lanes.iter().filter(is_wide);
        let middles: Vec<_> = lanes.flat_map(|lane| &lane.centre).collect();
        let is_driven = |kerb: &&[f64; 3]| {
            let apart_m = |middle: &[f64; 3]| (middle[0] - kerb[0]).hypot(middle[1] - kerb[1]);
            middles.iter().any(|middle| apart_m(middle) < 0.8)
        };
        let points = world.kerbs.iter().flatten().count();
        let driven = world.kerbs.iter().flatten().filter(is_driven).count();
        println!("{name}: {driven} of {points} points of kerbs lie on a lane's middle");
        // Karlsruhe's low kerbs run across driveways, and some lanes begin narrow.
        assert!(driven * 50 <= points, "{name}: {driven} of {points}");
    }
}

fn along_m(line: &[[f64; 3]]) -> f64 {
    line.windows(2)
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]))
        .sum()
}

/// Two lanelets behind each other with a common right border's end, and one beside the first.
const DRAWN: &str = "\
    <node id='11' lat='49.0' lon='8.4'/><node id='12' lat='49.0' lon='8.401'/>\
    <node id='21' lat='49.00003' lon='8.4'/><node id='22' lat='49.00003' lon='8.401'/>\
    <node id='31' lat='49.00006' lon='8.4'/><node id='32' lat='49.00006' lon='8.401'/>\
    <node id='13' lat='49.0' lon='8.402'/><node id='23' lat='49.00003' lon='8.402'/>\
    <way id='1'><nd ref='11'/><nd ref='12'/><tag k='type' v='curbstone'/></way>\
    <way id='2'><nd ref='21'/><nd ref='22'/><tag k='type' v='line_thin'/><tag k='subtype' v='dashed'/></way>\
    <way id='3'><nd ref='31'/><nd ref='32'/><tag k='type' v='road_border'/></way>\
    <way id='4'><nd ref='12'/><nd ref='13'/></way>\
    <way id='5'><nd ref='22'/><nd ref='23'/></way>";

fn relation(id: i64, left: i64, right: i64, tags: &str) -> String {
    format!(
        "<relation id='{id}'><member type='way' ref='{left}' role='left'/>\
         <member type='way' ref='{right}' role='right'/><tag k='type' v='lanelet'/>{tags}</relation>"
    )
}

fn world(body: &str) -> Result<World, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.osm");
    std::fs::write(&path, format!("<osm>{body}</osm>")).unwrap();
    World::from_lanelet2(&path).map_err(|error| error.to_string())
}

#[test]
fn a_drawn_map() {
    let relations = [
        relation(7, 2, 1, "<tag k='speed_limit' v='36'/>"),
        relation(8, 3, 2, ""),
        relation(9, 5, 4, "<tag k='one_way' v='no'/>"),
    ];
    let world = world(&(DRAWN.to_owned() + &relations.concat())).unwrap();
    let [right, left, on, back] = &world.lanes[..] else {
        panic!("{} lanes", world.lanes.len())
    };
    assert_eq!(
        (right.next.as_slice(), right.left, right.right),
        (&[2][..], Some(1), None)
    );
    assert_eq!(
        (left.next.as_slice(), left.left, left.right),
        (&[][..], None, Some(0))
    );
    assert_eq!((on.next.len(), back.next.len()), (0, 0));
    let [begin, end] = [on.centre[0], back.centre[back.centre.len() - 1]];
    assert!((begin[0] - end[0]).hypot(begin[1] - end[1]) < 1e-9);
    assert!((right.speed_m_s - 10.0).abs() < 1e-9 && (left.speed_m_s - 50.0 / 3.6).abs() < 1e-9);
    // A parallel is 1,852 m a minute of latitude.
    assert!((right.width_m - 3.336).abs() < 0.01, "{}", right.width_m);
    assert!(world.lanes.iter().all(|lane| !lane.is_junction));
    assert_eq!(world.paint.len(), 1);
    assert!(world.paint[0].is_there(0) && world.paint[0].id == 2);
    assert_eq!(
        world.kerbs.len(),
        4,
        "kerb, border, and both sides of the open end"
    );
}

#[test]
fn junctions_are_branches_crossings_and_what_the_map_says() {
    // From the south into the end of lanelet 7; and one that crosses lanelet 8 further west.
    let more = "\
        <node id='41' lat='48.9995' lon='8.4009'/><node id='51' lat='48.9995' lon='8.40085'/>\
        <node id='61' lat='49.0002' lon='8.4004'/><node id='71' lat='49.0002' lon='8.40035'/>\
        <node id='62' lat='49.0' lon='8.4004'/><node id='72' lat='49.0' lon='8.40035'/>\
        <way id='41'><nd ref='41'/><nd ref='12'/></way><way id='51'><nd ref='51'/><nd ref='22'/></way>\
        <way id='61'><nd ref='61'/><nd ref='62'/></way><way id='71'><nd ref='71'/><nd ref='72'/></way>";
    let marks = |relations: &[String]| -> Vec<bool> {
        let world = world(&(DRAWN.to_owned() + more + &relations.concat())).unwrap();
        world.lanes.iter().map(|lane| lane.is_junction).collect()
    };
    let ahead = relation(7, 2, 1, "");
    let on = relation(9, 5, 4, "");
    assert_eq!(marks(&[ahead.clone(), on.clone()]), [false, false]);
    let merging = relation(10, 51, 41, "");
    assert_eq!(
        marks(&[ahead.clone(), on.clone(), merging]),
        [true, false, true]
    );
    let crossing = relation(11, 61, 71, "");
    let beside = relation(8, 3, 2, "");
    assert_eq!(marks(&[beside, on, crossing]), [true, false, true]);
    let turning = relation(7, 2, 1, "<tag k='turn_direction' v='left'/>");
    assert_eq!(marks(&[turning]), [true]);
}

#[test]
fn maps_in_which_nobody_can_drive_are_refused() {
    let refused = |body: &str| world(body).err().unwrap();
    assert!(refused(DRAWN).contains("has no lanes: of its 0 lanelets"));
    let walkway = relation(7, 2, 1, "<tag k='subtype' v='walkway'/>");
    assert!(refused(&(DRAWN.to_owned() + &walkway)).contains("of its 1 lanelets"));
    let local = DRAWN.replace("lat='49.0' lon='8.4'/>", "><tag k='local_x' v='1'/></node>");
    let says = refused(&(local + &relation(7, 2, 1, "")));
    assert!(says.contains("local_y is \"\", not a number"), "{says}");
    let far = DRAWN.replace("lon='8.402'", "lon='9.2'");
    let says = refused(&(far + &relation(7, 2, 1, "") + &relation(9, 5, 4, "")));
    assert!(says.contains("the most is 25000: cut the map"), "{says}");
    let twice = |id: i64| {
        let way = "<nd ref='11'/><nd ref='12'/></way>";
        let lifted = "<nd ref='21'/><nd ref='22'/></way>";
        format!(
            "<way id='{id}'>{lifted}<way id='-{id}'>{way}{}",
            relation(id, id, -id, "")
        )
    };
    let doubles: String = (100..700).map(twice).collect();
    let says = refused(&(DRAWN.to_owned() + &doubles));
    assert!(
        says.contains("number of lane points within four metres is 1001"),
        "{says}"
    );
    assert!(refused("<way>").contains("damaged"));
}

#[test]
fn the_same_map_gives_the_same_world() {
    let relations = [
        relation(7, 2, 1, ""),
        relation(8, 3, 2, ""),
        relation(9, 5, 4, ""),
    ];
    let body = DRAWN.to_owned() + &relations.concat();
    let told = || format!("{:?}", world(&body).unwrap());
    assert_eq!(told(), told());
    let Some(folder) = data() else { return };
    for (name, path, _) in maps(&folder) {
        let told = || format!("{:?}", World::from_lanelet2(&path).unwrap());
        assert!(told() == told(), "{name}");
    }
}

#[test]
fn no_changed_byte_panics() {
    let relations = [
        relation(7, 2, 1, ""),
        relation(9, 5, 4, "<tag k='one_way' v='no'/>"),
    ];
    let body = (DRAWN.to_owned() + &relations.concat()).into_bytes();
    let mut refused = 0;
    for at in 0..body.len() {
        let mut body = body.clone();
        body[at] = b"1937.-x "[at % 8];
        refused += usize::from(world(&String::from_utf8(body).unwrap()).is_err());
    }
    assert!(refused > 100, "most break the XML: {refused}");
}

#[test]
fn real_maps_are_changed_and_driven_through() {
    let Some(folder) = data() else { return };
    for map in [
        "karlsruhe/mapping_example.osm",
        "kashiwanoha/kashiwanoha_road_shoulder_added.osm",
    ] {
        let out = tempfile::tempdir().unwrap();
        for seed in 0..6 {
            let spec = CitySpec {
                seed,
                site: Site::Mapped {
                    map: folder.join("maps").join(map),
                },
                change_share: 0.2,
                vehicles: 3,
                drives: 6,
                drive_km: 0.5,
                ..CitySpec::default()
            };
            let files = write(&spec, out.path()).unwrap();
            let truth = std::fs::read_to_string(&files.truth).unwrap();
            assert!(truth.contains("\"change_type\""), "{map}, seed {seed}");
            let detections: usize = files.logs.iter().map(|log| detections(log)).sum();
            assert!(detections > 500, "{map}, seed {seed}: {detections}");
        }
    }
}

/// Metres driven according to the fixes of a log, and pauses of a minute and more.
fn driven(log: &Path) -> (f64, usize) {
    let index = LogIndex::open(log).unwrap();
    let (mut driven_m, mut pauses, mut last) = (0.0, 0, None);
    let add = |message: LogMessage| {
        let Payload::Gnss(fix) = message.payload else {
            return;
        };
        let at = [fix.longitude_deg, fix.latitude_deg, 0.0];
        match last.replace((message.stamp_ns, at)) {
            Some((before_ns, _)) if message.stamp_ns - before_ns > 60_000_000_000 => pauses += 1,
            Some((_, before)) => {
                let [east_m, north_m, _] = LocalFrame::new(before).to_enu(at);
                driven_m += east_m.hypot(north_m);
            }
            None => {}
        }
    };
    LogReader::new()
        .read(&index, |_, _| true, ALL_TIME, add)
        .unwrap();
    (driven_m, pauses)
}

/// The drawn map's longest route has 146 m: a drive of a kilometre has seven legs at least.
#[test]
fn a_drive_goes_on_where_the_map_ends() {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("map.osm");
    let relations = [
        relation(7, 2, 1, ""),
        relation(8, 3, 2, ""),
        relation(9, 5, 4, ""),
    ];
    std::fs::write(&map, format!("<osm>{DRAWN}{}</osm>", relations.concat())).unwrap();
    let spec = CitySpec {
        site: Site::Mapped { map },
        noise: "good_gnss".to_owned(),
        vehicles: 2,
        drives: 4,
        drive_km: 1.0,
        ..CitySpec::default()
    };
    for log in write(&spec, folder.path()).unwrap().logs {
        let (driven_m, pauses) = driven(&log);
        assert!((900.0..1_200.0).contains(&driven_m), "{driven_m} m");
        assert!(pauses >= 6, "{pauses} pauses");
    }
}

fn detections(log: &Path) -> usize {
    let index = LogIndex::open(log).unwrap();
    let mut count = 0;
    let add = |message: LogMessage| {
        if let Payload::Detections(frame) = message.payload {
            count += frame.detections.len();
        }
    };
    LogReader::new()
        .read(&index, |_, _| true, ALL_TIME, add)
        .unwrap();
    count
}
