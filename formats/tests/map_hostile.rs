//! Maps that are wrong: what breaks the file refuses it, what breaks an element sets it aside, and
//! nothing panics or takes more than linear time.

mod linear;

use std::fmt::Write as _;

use linear::{Shape, assert_linear};
use proptest::prelude::*;
use tilefold_formats::map::{MapError, MapFile, Roads, read_from, read_roads_from};
use tilefold_formats::map_patch::OsmText;
use tilefold_schemas::{ElementKind, Marking};

fn read(text: impl AsRef<[u8]>) -> Result<MapFile, MapError> {
    read_from(text.as_ref(), "map.osm")
}

fn roads(text: impl AsRef<[u8]>) -> Result<Roads, MapError> {
    read_roads_from(text.as_ref(), "map.osm")
}

/// A map with three good nodes and `rest`.
fn map_with(rest: &str) -> String {
    format!(
        "<?xml version='1.0'?>\n<osm generator='test'>\n\
         <node id='-1' lat='49.0' lon='8.4'/>\n\
         <node id='2' lat='49.001' lon='8.4'><tag k='ele' v='115.5'/></node>\n\
         <node id='9000000000000000003' lat='49.001' lon='8.401'/>\n{rest}\n</osm>\n"
    )
}

const LINE: &str = "<way id='7'><nd ref='-1'/><nd ref='2'/><tag k='type' v='line_thin'/></way>";

fn refused(text: impl AsRef<[u8]>) -> String {
    read(text).expect_err("refused").to_string()
}

/// The reason of the one loss of a map whose good line survives.
fn set_aside(rest: &str) -> String {
    let map = read(map_with(&format!("{LINE}\n{rest}"))).expect("the rest of the map is read");
    assert_eq!(map.elements.len(), 1, "{rest}");
    assert_eq!(map.set_aside.len(), 1, "{rest}: {:?}", map.set_aside);
    assert_eq!(map.set_aside[0].offset, Some(7), "the line in the file");
    map.set_aside[0].reason.clone()
}

#[test]
fn a_good_map_with_negative_and_large_ids() {
    let rest = "<way id='-5'><nd ref='2'/><nd ref='9000000000000000003'/><nd ref='-1'/><nd ref='2'/>\
                <tag k='type' v='crosswalk'/></way>";
    let map = read(format!("\n \n{}", map_with(&format!("{LINE}{rest}")))).unwrap();
    assert_eq!(map.set_aside, []);
    assert_eq!(map.elements[0].kind, ElementKind::Crosswalk);
    assert_eq!(map.elements[0].points.len(), 3);
    assert_eq!(map.elements[1].points[1], [8.4, 49.001, 115.5]);
    assert_eq!(map.elements[1].marking, Marking::Unknown);
    assert_eq!(map.about["generator"], "test");
}

#[test]
fn bad_elements_are_set_aside_with_line_and_column() {
    let way = |body: &str| format!("<way id='8'>{body}<tag k='type' v='stop_line'/></way>");
    for (rest, says) in [
        (
            way("<nd ref='-1'/><nd ref='4'/>"),
            "way 8 (line 7, column 1): its node 4 is not in the file",
        ),
        (
            way("<nd ref='-1'/><nd ref='x'/>"),
            "it refers to \"x\", which is not a 64-bit integer",
        ),
        (
            way("<nd ref='-1'/>"),
            "stop_line needs 2 different points, it has 1",
        ),
        (way("<nd ref='-1'/><nd ref='-1'/>"), "it has 1"),
        (way(""), "way 8 (line 7, column 1): stop_line needs 2"),
        (
            way("<nd ref='-1'/><nd ref='2'/><tag k='type' v='arrow'/>"),
            "two values",
        ),
        (LINE.to_owned(), "another element has the same id"),
        (
            LINE.replace("'7'", "'99999999999999999999'"),
            "is not a 64-bit integer",
        ),
        (
            LINE.replace("line_thin", "arrow").replace('7', "8"),
            "ground_sign needs 3",
        ),
    ] {
        let reason = set_aside(&rest);
        assert!(reason.contains(says), "{rest}\n{reason}");
    }
}

#[test]
fn bad_numbers_are_named_where_they_stand() {
    for (node, says) in [
        (
            "lat='NaN' lon='8'",
            "node 4 (line 7, column 1): lat is NaN, outside of -90..=90",
        ),
        ("lat='1e400' lon='8'", "lat is inf, outside of"),
        ("lat='49' lon='181'", "lon is 181, outside of -180..=180"),
        ("lat='49,1' lon='8'", "lat is \"49,1\", not a number"),
        ("lon='8'", "lat is \"\", not a number"),
        ("lat='49' lon='8' action='delete'", "its node 4 is deleted"),
        ("lat='49' lon='8' visible='false'", "its node 4 is deleted"),
    ] {
        let way = "<way id='8'><nd ref='-1'/><nd ref='4'/><tag k='type' v='stop_line'/></way>";
        let reason = set_aside(&format!("<node id='4' {node}/>{way}"));
        assert!(reason.contains(says), "{node}\n{reason}");
    }
    let way = "<way id='8'><nd ref='2'/><nd ref='-1'/><tag k='type' v='stop_line'/></way>";
    let local =
        "<node id='2' lat='' lon=''><tag k='local_x' v='1'/><tag k='local_y' v='1'/></node>";
    let map = read(format!(
        "<osm><node id='-1' lat='1' lon='1'/>{local}{way}</osm>"
    ))
    .unwrap();
    assert!(
        map.set_aside[0]
            .reason
            .contains("nothing says what local_x and local_y count from")
    );
    let twice = map_with(&format!("<node id='-1' lat='49.0001' lon='8.4'/>{LINE}"));
    let reason = &read(twice).unwrap().set_aside[0].reason;
    assert!(
        reason.contains("node -1 appears twice with different positions"),
        "{reason}"
    );
}

#[test]
fn what_is_deleted_is_skipped_and_what_is_no_paint_is_counted() {
    let deleted = LINE.replace("id='7'", "id='8' action='delete'");
    let kerb = LINE.replace('7', "9").replace("line_thin", "curbstone");
    let map = read(map_with(&format!("{LINE}{deleted}{kerb}"))).unwrap();
    assert_eq!((map.elements.len(), map.set_aside.len()), (1, 0));
    assert_eq!((map.counts.ways, map.counts.deleted), (2, 1));
    assert_eq!(map.not_paint["curbstone"], 1);
}

#[test]
fn crosswalk_lanelets() {
    let lanelet = |left: &str, right: &str, members: &str| {
        let way = |id, a, b, kind: &str| {
            format!("<way id='{id}'><nd ref='{a}'/><nd ref='{b}'/><tag k='type' v='{kind}'/></way>")
        };
        map_with(&format!(
            "<node id='4' lat='49.0' lon='8.401'/>{}{}<relation id='30'>{members}\
             <tag k='type' v='lanelet'/><tag k='subtype' v='crosswalk'/></relation>",
            way(20, "-1", "2", left),
            way(21, "4", "9000000000000000003", right),
        ))
    };
    let both =
        "<member type='way' ref='20' role='left'/><member type='way' ref='21' role='right'/>";
    let map = read(lanelet("pedestrian_marking", "", both)).unwrap();
    assert_eq!(
        map.elements.len(),
        1,
        "the painted border is part of the crosswalk"
    );
    assert_eq!(map.elements[0].id.0, 30);
    assert_eq!(map.elements[0].points[3], [8.401, 49.0, 0.0]);
    assert_eq!(map.elements[0].points[2], [8.401, 49.001, 0.0]);

    let unpainted = read(lanelet("curbstone", "virtual", both)).unwrap();
    assert_eq!(
        (unpainted.elements.len(), unpainted.set_aside.len()),
        (0, 0)
    );

    let one = "<member type='way' ref='20' role='left'/><member type='way' ref='99' role='right'/>";
    let map = read(lanelet("pedestrian_marking", "", one)).unwrap();
    assert!(
        map.set_aside[0]
            .reason
            .contains("its right border, way 99, is not in the file")
    );
    assert_eq!(map.elements[0].kind, ElementKind::LaneMarking);
}

#[test]
fn other_formats_are_refused_with_a_sentence() {
    for (bytes, says) in [
        (&b""[..], "an empty file"),
        (b"  \n", "an empty file"),
        (
            b"{\"type\": 1}",
            "JSON, but not of an Argoverse 2 map: missing field",
        ),
        (b"[1]", "JSON"),
        (b"\x1f\x8b\x08", "a gzip archive: unpack it first"),
        (b"PK\x03\x04", "a zip archive"),
        (b"\x89MCAP0\r\n", "an MCAP log"),
        (b"\xff\xfe<\0", "UTF-16"),
        (b"hello", "no map format that we know"),
        (b"<gpx></gpx>", "XML with the root element <gpx>"),
    ] {
        let error = refused(bytes);
        assert!(
            error.contains(says) && error.contains("Lanelet2 (.osm), OpenDRIVE (.xodr) and"),
            "{error}"
        );
    }
}

#[test]
fn damaged_xml_is_refused_with_line_and_column() {
    for (text, says) in [
        ("<osm>\n <node id='1'", "line 2, column 2"),
        ("<osm>\n<way>", "it ends in the middle"),
        ("<osm></way>", "line 1, column 6"),
        ("<osm/><osm/>", "a second root element"),
        ("<!-- -->", "it ends before its root element"),
        (
            "<osm><node id='1' id='2'/></osm>",
            "the attribute \"id\" appears twice",
        ),
        ("<osm><node id=1/></osm>", "bad attribute"),
        (
            "<?xml version='1.0' encoding='Shift_JIS'?><osm/>",
            "only UTF-8 is read",
        ),
        ("<osm/> and more", "text stands outside"),
    ] {
        let error = refused(text);
        assert!(error.contains(says), "{text}\n{error}");
    }
    assert!(refused(b"<osm>\n<node id='\xff\xfe'/></osm>").contains("line 2, column 1"));
}

#[test]
fn entities_and_document_types_are_refused() {
    let bomb =
        "<?xml version='1.0'?>\n<!DOCTYPE osm [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;'>]>\n<osm/>";
    assert!(refused(bomb).contains("line 2, column 1: a document type (DOCTYPE) is not allowed"));
    assert!(refused(map_with("<node id='&b;'/>")).contains("the entity &b; is not allowed"));
    assert!(refused(map_with("&b;")).contains("the entity &b; is not allowed"));
    let allowed = map_with("&#65;&amp;<way id='8'><tag k='n' v='&lt;&#xe9;&quot;'/></way>");
    assert!(read(allowed).is_ok());
}

#[test]
fn limits_are_named() {
    let deep = format!("<osm>{}", "<a>".repeat(100_000));
    assert!(refused(deep).contains("the depth of XML is over the limit of 32 (MAX_MAP_DEPTH)"));
    let mut wide = "<osm><node".to_owned();
    for i in 0..100_000 {
        let _ = write!(wide, " a{i}='1'");
    }
    assert!(refused(wide + "/></osm>").contains("the limit of 64 (MAX_XML_ATTRIBUTES)"));
    let long_tag = format!(
        "<way id='8'><tag k='type' v='stop_line'/><tag k='a' v='{}'/></way>",
        "x".repeat(70_000)
    );
    assert!(set_aside(&long_tag).contains("MAX_TAG_BYTES"));
    let piece = format!("<osm><!--{}--></osm>", "x".repeat(5 << 20));
    assert!(refused(piece).contains("one piece of XML is over the limit"));
    let mut tags = "<way id='8'><tag k='type' v='stop_line'/>".to_owned();
    for i in 0..1_001 {
        let _ = write!(tags, "<tag k='k{i}' v='1'/>");
    }
    assert!(set_aside(&(tags + "</way>")).contains("MAX_TAGS_PER_ELEMENT"));
    let points = format!(
        "<way id='8'><tag k='type' v='stop_line'/>{}</way>",
        "<nd ref='2'/>".repeat(100_001)
    );
    assert!(set_aside(&points).contains("MAX_POINTS_PER_ELEMENT"));
    let far = "<node id='4' lat='0' lon='0'/><way id='8'><nd ref='2'/><nd ref='4'/><tag k='type' v='stop_line'/></way>";
    assert!(set_aside(far).contains("MAX_ELEMENT_LENGTH_M"));
}

/// `n` of everything that is wrong in some maps, each in a map of its own.
const SHAPES: [Shape; 14] = [
    ("equal ids", |n| map_with(&LINE.repeat(n))),
    ("dangling references", |n| {
        each(n, |i| {
            line(i, &format!("<nd ref='{}'/><nd ref='2'/>", 1_000_000 + i))
        })
    }),
    ("references of one way", |n| {
        map_with(&line(0, &"<nd ref='2'/>".repeat(n)))
    }),
    ("empty ways", |n| each(n, |i| line(i, ""))),
    ("bad numbers", |n| {
        each(n, |i| {
            format!("<node id='{}' lat='49,{i}' lon='NaN'/>\n", 10 + i)
        })
    }),
    ("one node in many places", |n| {
        each(n, |i| format!("<node id='2' lat='49.{i}' lon='8.4'/>\n"))
    }),
    ("attributes", |n| {
        let attributes: String = (0..n).map(|i| format!(" a{i}='{i}'")).collect();
        map_with(&format!("<way id='8'{attributes}><nd ref='2'/></way>"))
    }),
    ("tags of one way", |n| {
        let tags: String = (0..n).map(|i| format!("<tag k='k{i}' v='{i}'/>")).collect();
        map_with(&line(0, &tags))
    }),
    ("entities", |n| {
        let allowed = "&amp;&#38;".repeat(n);
        map_with(&line(0, &format!("<tag k='a' v='{allowed}'/>")))
    }),
    ("entities of its own", |n| {
        let named: String = (0..n).map(|i| format!("<!ENTITY a{i} '{i}'>")).collect();
        format!("<!DOCTYPE osm [{named}]><osm/>")
    }),
    ("depth", |n| format!("<osm>{}", "<way id='1'>".repeat(n))),
    ("a comment", |n| {
        map_with(&format!("<!--{}-->", "<".repeat(n * 20)))
    }),
    ("crosswalks between the same borders", |n| {
        between_two(n, "crosswalk")
    }),
    ("lanelets between the same borders", |n| {
        between_two(n, "road")
    }),
];

fn each(n: usize, one: impl Fn(usize) -> String) -> String {
    map_with(&(0..n).map(one).collect::<String>())
}

fn line(number: usize, body: &str) -> String {
    let id = 10 + number;
    format!("<way id='{id}'>{body}<tag k='type' v='line_thin'/></way>\n")
}

/// `n` lanelets, all with the same two ways of `n` nodes as borders.
fn between_two(n: usize, subtype: &str) -> String {
    let way = |id: usize, ends: [&str; 2]| {
        let nodes: String = (0..n)
            .map(|i| format!("<nd ref='{}'/>", ends[i % 2]))
            .collect();
        format!("<way id='{id}'>{nodes}<tag k='type' v='pedestrian_marking'/></way>\n")
    };
    let lanelet = |i: usize| {
        format!(
            "<relation id='{}'><member type='way' ref='20' role='left'/>\
             <member type='way' ref='21' role='right'/>\
             <tag k='type' v='lanelet'/><tag k='subtype' v='{subtype}'/></relation>\n",
            100 + i
        )
    };
    let ways = way(20, ["-1", "2"]) + &way(21, ["4", "9000000000000000003"]);
    let lanelets: String = (0..n).map(lanelet).collect();
    map_with(&format!(
        "<node id='4' lat='49.0' lon='8.401'/>{ways}{lanelets}"
    ))
}

/// Asserts that elements, roads and the text to be patched are all read in linear time.
#[track_caller]
fn is_linear((what, shape): &Shape) {
    let is_linear = |reader: &str, read: &dyn Fn(&str)| {
        assert_linear(&format!("{what}, {reader}"), 5_000, shape, read);
    };
    is_linear("elements", &|text| drop(read(text)));
    is_linear("roads", &|text| drop(roads(text)));
    is_linear("text", &|text| {
        drop(OsmText::read(text.into(), "map.osm"));
    });
}

#[test]
fn time_grows_with_the_bytes_of_broken_maps() {
    SHAPES[..7].iter().for_each(is_linear);
}

#[test]
fn time_grows_with_the_bytes_of_maps_that_say_too_much() {
    SHAPES[7..].iter().for_each(is_linear);
}

#[test]
fn one_way_borders_so_many_crosswalks_and_no_more() {
    let map = read(between_two(100, "crosswalk")).unwrap();
    assert_eq!((map.elements.len(), map.set_aside.len()), (64, 36));
    assert!(map.set_aside[0].reason.contains("MAX_LANELETS_PER_WAY"));
}

fn pieces() -> impl Strategy<Value = String> {
    let piece = prop::sample::select(vec![
        "<osm>",
        "</osm>",
        "<osm/>",
        "<node id='1' lat='1' lon='2'/>",
        "<node id='2' lat='1.001' lon='2'>",
        "</node>",
        "<way id='3'>",
        "</way>",
        "<nd ref='1'/>",
        "<nd ref='2'/>",
        "<nd ref='9'/>",
        "<nd/>",
        "<tag k='type' v='line_thin'/>",
        "<tag k='type' v='arrow'/>",
        "<tag k='area' v='yes'/>",
        "<tag/>",
        "<relation id='3'>",
        "</relation>",
        "<member type='way' ref='3' role='left'/>",
        "<member type='way' ref='3' role='right'/>",
        "<tag k='type' v='lanelet'/>",
        "<tag k='subtype' v='crosswalk'/>",
        "<tag k='subtype' v='road'/>",
        "<way id='4'><nd ref='1'/><nd ref='2'/></way>",
        "<member type='way' ref='4' role='left'/>",
        "<member type='way' ref='4' role='right'/>",
        "<!-- -->",
        "<![CDATA[x]]>",
        "<?pi?>",
        "&amp;",
        "&#0;",
        "&x;",
        "\n",
        "x",
        "<",
        ">",
        "'",
        "=",
    ]);
    prop::collection::vec(piece, 0..60).prop_map(|pieces| format!("<osm>{}", pieces.concat()))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), head in "(<osm>|<|\\{)?") {
        let _ = read([head.as_bytes(), &bytes].concat());
        let _ = roads([head.as_bytes(), &bytes].concat());
    }

    #[test]
    fn no_pieces_panic(text in pieces()) {
        if let Ok(map) = read(&text) {
            for element in &map.elements {
                prop_assert!(element.points.len() >= 2);
                prop_assert!(element.points.iter().flatten().all(|value| value.is_finite()));
            }
            prop_assert!(map.elements.is_sorted_by(|a, b| a.id < b.id));
            let roads = roads(&text).expect("the same XML is read");
            for border in roads.lanelets.iter().flat_map(|lanelet| [&lanelet.left, &lanelet.right]) {
                prop_assert!(border.points.len() >= 2 && !border.ways.is_empty());
                prop_assert!(border.points.iter().flatten().all(|value| value.is_finite()));
            }
            prop_assert!(roads.lanelets.is_sorted_by(|a, b| a.id < b.id));
        }
    }

    #[test]
    fn no_mutation_panics(at in any::<prop::sample::Index>(), cut in any::<prop::sample::Index>(), byte in any::<u8>(), flip in any::<bool>()) {
        let mut bytes = map_with(LINE).into_bytes();
        let at = at.index(bytes.len());
        if flip { bytes[at] = byte } else { bytes.insert(at, byte) }
        let _ = read(&bytes);
        let whole = map_with(LINE).into_bytes();
        let cut = cut.index(whole.len() - 1);
        // A file without its last line break is whole.
        prop_assert!(read(&whole[..cut]).is_err() || cut + 1 >= whole.len());
    }
}
