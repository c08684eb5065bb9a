//! OpenDRIVE files that are wrong: what breaks the file refuses it, what breaks a road, a lane or a
//! mark sets that aside, and nothing panics or takes more than linear time.

mod linear;

use std::fmt::Write as _;

use linear::{Shape, assert_linear};
use proptest::prelude::*;
use tilefold_formats::map::{self, MapError, MapFile};

const HEADER: &str = "<header revMajor='1' revMinor='6'><geoReference>+proj=utm +zone=32 +datum=WGS84\
    </geoReference></header>";

fn read(text: impl AsRef<[u8]>) -> Result<MapFile, MapError> {
    map::read_from(text.as_ref(), "map.xodr")
}

fn refused(text: impl AsRef<[u8]>) -> String {
    read(text).expect_err("refused").to_string()
}

fn road(id: &str, shape: &str, rest: &str) -> String {
    format!(
        "<road id='{id}' length='100'><planView><geometry s='0' x='500000' y='5400000' hdg='0' length='100'>\
         {shape}</geometry></planView>\n{rest}</road>"
    )
}

fn lanes(left: &str) -> String {
    format!("<lanes><laneSection s='0'><left>{left}</left></laneSection></lanes>")
}

const WIDTH: &str = "<width sOffset='0' a='3' b='0' c='0' d='0'/>";
const MARK: &str = "<roadMark sOffset='0' type='solid'/>";

fn lane(id: &str, body: &str) -> String {
    format!("<lane id='{id}'>{WIDTH}{body}</lane>")
}

/// A good road with one mark, and `rest` on line 3.
fn with(rest: &str) -> String {
    let good = road("good", "<line/>", "").replace('\n', &lanes(&lane("1", MARK)));
    format!("<OpenDRIVE>{HEADER}\n{good}\n{rest}</OpenDRIVE>")
}

#[test]
fn what_is_wrong_is_set_aside_with_line_and_column() {
    let line = |rest: &str| road("7", "<line/>", rest);
    let curve = |shape: &str| road("7", shape, &lanes(&lane("1", MARK)));
    let second = |lane: &str| line(&lanes(&format!("{}{lane}", lane_without_marks())));
    for (rest, says) in [
        (
            road("good", "<line/>", ""),
            "road good (line 3, column 1): another road has the same id",
        ),
        (
            curve("<arc curvature='x'/>"),
            "the curvature of its <arc> (line 3, column",
        ),
        (curve("<arc curvature='NaN'/>"), "is \"NaN\", not a number"),
        (curve("<arc/>"), "is \"\", not a number"),
        (curve("<circle/>"), "has no shape that is read"),
        (
            curve("<spiral curvStart='0' curvEnd='9'/>"),
            "turns by 900 rad, the limit is 20 (MAX_SPIRAL_TURN_RAD)",
        ),
        (
            curve("<line/>")
                .replace("length='100'>\n", "")
                .replace("length='100'", "length='1e7'"),
            "MAX_ELEMENT_LENGTH_M",
        ),
        (
            "<road id='7' length='100'/>".to_owned(),
            "it has no geometry",
        ),
        (
            second(&lane("1", MARK)),
            "another lane of its section has the same id",
        ),
        (
            second(&lane("3", MARK)),
            "road 7, section 0, lane 3 (line 4, column",
        ),
        (
            second(&lane("3", MARK)),
            "lane 2, which it lies beyond, is not in its section",
        ),
        (
            second(&lane("-1", MARK)),
            "\"-1\" is no id of a lane on the left",
        ),
        (
            second("<lane id='2'><width sOffset='0' a='wide' b='0' c='0' d='0'/></lane>"),
            "the a of its <width> (line 4,",
        ),
        (
            second(&lane("2", "<roadMark sOffset='inf' type='solid'/>")),
            "the sOffset of its <roadMark>",
        ),
        (
            second(&lane("2", "<roadMark sOffset='100' type='solid'/>")),
            "it ends where it begins",
        ),
        (
            line("<objects><object id='1' type='crosswalk' s='5'/></objects>"),
            "object 1 (line 4, column 10)",
        ),
        (
            line(
                "<objects><object id='1' type='crosswalk' s='5' t='0'><outline><cornerRoad s='1' t='0'/></outline></object></objects>",
            ),
            "crosswalk needs 3 different points, it has 1",
        ),
        (curve("<line/>").replace("500000", "1e300"), "its point ("),
        (
            curve("<arc curvature='1e9'/>").replace("length='100'", "length='9e4'"),
            "MAX_POINTS_PER_ELEMENT",
        ),
    ] {
        let map = read(with(&rest)).unwrap();
        assert_eq!(map.elements.len(), 1, "{rest}");
        assert_eq!(map.set_aside.len(), 1, "{rest}: {:?}", map.set_aside);
        let reason = &map.set_aside[0].reason;
        assert!(reason.contains(says), "{reason}\n{says}");
    }
}

fn lane_without_marks() -> String {
    lane("1", "")
}

#[test]
fn a_file_that_does_not_say_where_it_is_is_refused() {
    for (header, says) in [
        ("", "line 1, column 1: there is no geoReference"),
        ("<header>\n</header>", "there is no geoReference"),
        (
            "<header>\n<geoReference>EPSG:31467</geoReference></header>",
            "line 2, column 1: the geoReference \"EPSG:31467\"",
        ),
        (
            "<header><geoReference>EPSG:99999999999</geoReference></header>",
            "is no PROJ string or UTM code",
        ),
        (
            "<header><geoReference>+proj=nonsense</geoReference></header>",
            "is no PROJ string or UTM code that is read",
        ),
        (
            "<header><geoReference>+proj=longlat +datum=WGS84</geoReference></header>",
            "no metres on a plane",
        ),
        (
            "<header><geoReference>+proj=utm +zone=32</geoReference>\n<offset x='a'/></header>",
            "line 2, column 1: the x of its <offset>",
        ),
    ] {
        let error = refused(format!("<OpenDRIVE>{header}</OpenDRIVE>"));
        assert!(error.contains(says), "{error}\n{says}");
    }
    let roads = map::read_roads_from(with("").as_bytes(), "map.xodr").unwrap_err();
    assert!(roads.to_string().contains("read from Lanelet2 (.osm) only"));
}

#[test]
fn damage_entities_and_limits_end_the_reading() {
    for (text, says) in [
        (with("<road>"), "line 3, column"),
        ("<OpenDRIVE>\n<header".to_owned(), "line 2, column 1"),
        (
            "<!DOCTYPE OpenDRIVE [<!ENTITY a 'aaaa'>]>\n<OpenDRIVE/>".to_owned(),
            "line 1, column 1: a document type",
        ),
        (
            with("<road id='&b;'/>"),
            "line 3, column 1: the entity &b; is not allowed",
        ),
        (with(&"<road>".repeat(100_000)), "MAX_MAP_DEPTH"),
        (
            with(&format!("<road {}/>", attributes(100_000))),
            "the limit of 64 (MAX_XML_ATTRIBUTES)",
        ),
    ] {
        let error = refused(&text);
        assert!(error.contains(says), "{error}\n{says}");
    }
    // Lines that run in circles of 2 cm: far more points than bytes.
    let curly = road("7", "<arc curvature='50'/>", &lanes(&lane("1", MARK)));
    let named = |id: usize| curly.replace("'7'", &format!("'{id}'"));
    let many: String = (0..600).map(named).collect();
    let error = refused(with(&many));
    assert!(error.contains("MAX_MAP_SAMPLES"), "{error}");
}

fn attributes(count: usize) -> String {
    let mut text = String::new();
    for index in 0..count {
        let _ = write!(text, "a{index}='1' ");
    }
    text
}

/// One lane with `body` in it.
fn one_lane(body: &str) -> String {
    with(&road("7", "<line/>", &lanes(&lane("1", body))))
}

/// `n` of something in a file of its own, by its name.
const SHAPES: [Shape; 10] = [
    ("marks of one lane", |n| {
        let mark = |at| format!("<roadMark sOffset='{at}e-3' type='solid'/>");
        one_lane(&(0..n).map(mark).collect::<String>())
    }),
    ("lanes of one id", |n| {
        with(&road("7", "<line/>", &lanes(&lane("1", MARK).repeat(n))))
    }),
    ("widths of one lane", |n| {
        one_lane(&format!("{}{MARK}", WIDTH.repeat(n)))
    }),
    ("roads of one id", |n| with(&"<road id='7'/>".repeat(n))),
    ("bad numbers", |n| {
        one_lane(&"<roadMark sOffset='1,5' type='solid'/>".repeat(n))
    }),
    ("attributes", |n| {
        with(&format!("<road {}/>", attributes(n)))
    }),
    ("entities", |n| {
        one_lane(&format!("<roadMark type='{}'/>", "&amp;".repeat(n)))
    }),
    ("depth", |n| with(&"<road>".repeat(n))),
    ("outlines of one object", outlines),
    ("signals beside sections", |n| {
        let section = |at| format!("<laneSection s='{at}e-3'/>");
        let sections: String = (0..n).map(section).collect();
        let signal = "<signal type='294' country='DE' s='50' t='0'><validity fromLane='1' toLane='1'/></signal>";
        let signals = signal.repeat(n);
        let rest = format!("<lanes>{sections}</lanes><signals>{signals}</signals>");
        with(&road("7", "<line/>", &rest))
    }),
];

/// An object of `n` outlines and a name that is as long as they are many, up to the limit of a tag.
fn outlines(n: usize) -> String {
    let corner = |u, v| format!("<cornerLocal u='{u}' v='{v}' z='0'/>");
    let corners = corner(0, 0) + &corner(1, 0) + &corner(0, 1);
    let outlines = format!("<outline>{corners}</outline>").repeat(n);
    let name = "x".repeat(n);
    let object = format!(
        "<objects><object id='1' type='roadMark' s='9' t='0' name='{name}'>{outlines}</object></objects>"
    );
    with(&road("7", "<line/>", &object))
}

#[test]
fn time_grows_with_the_bytes() {
    for (what, shape) in SHAPES {
        assert_linear(what, 3_000, &shape, &|text| drop(read(text)));
    }
}

#[test]
fn an_object_has_so_many_outlines_and_no_more() {
    let elements = |n| read(outlines(n)).unwrap().elements.len();
    assert_eq!(elements(64) - elements(1), 63);
    let map = read(outlines(65)).unwrap();
    assert_eq!(
        (map.elements.len() + 1, map.set_aside.len()),
        (elements(1), 1)
    );
    assert!(map.set_aside[0].reason.contains("MAX_OUTLINES_PER_OBJECT"));
}

fn pieces() -> impl Strategy<Value = String> {
    let piece = prop::sample::select(vec![
        "<road id='1' length='50'>",
        "<road id='2' length='0'>",
        "</road>",
        "<planView><geometry s='0' x='500000' y='5400000' hdg='1' length='50'><line/></geometry></planView>",
        "<planView><geometry s='9' x='0' y='0' hdg='0' length='0'><spiral curvStart='0' curvEnd='.1'/></geometry></planView>",
        "<planView><geometry s='0' x='500000' y='0' hdg='-9' length='60'><poly3 a='1' b='-9' c='0' d='9'/></geometry></planView>",
        "<planView><geometry s='-5' x='500000' y='0' hdg='0' length='60'><paramPoly3 aU='0' bU='0' cU='0' dU='0' aV='0' bV='0' cV='0' dV='0'/></geometry></planView>",
        "<lanes>",
        "</lanes>",
        "<laneOffset s='3' a='1' b='1' c='1' d='1'/>",
        "<laneSection s='0'>",
        "<laneSection s='40'>",
        "</laneSection>",
        "<left>",
        "</left>",
        "<right>",
        "</right>",
        "<center><lane id='0'><roadMark type='solid'/></lane></center>",
        "<lane id='1'>",
        "<lane id='-1' level='true'>",
        "<lane id='-2'>",
        "</lane>",
        "<width sOffset='0' a='3' b='0' c='0' d='0'/>",
        "<width sOffset='5' a='-3' b='9' c='9' d='9'/>",
        "<border sOffset='0' a='3' b='0' c='0' d='0'/>",
        "<roadMark sOffset='1' type='broken broken'/>",
        "<roadMark sOffset='-7' type='solid'><type><line tOffset='1'/></type></roadMark>",
        "<objects><object type='crosswalk' s='1' t='1' length='3' width='2'/></objects>",
        "<objects><object type='roadMark' s='1' t='1'><outline><cornerLocal u='1' v='1'/></outline></object></objects>",
        "<signals><signal type='341' country='DE' s='1' t='1'><validity fromLane='-1' toLane='2'/></signal></signals>",
        "<x>",
        "</x>",
        "&amp;",
    ]);
    prop::collection::vec(piece, 0..50)
        .prop_map(|pieces| format!("<OpenDRIVE>{HEADER}{}", pieces.concat()))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn no_pieces_panic(text in pieces()) {
        // What is still open is closed, so that more than the empty text is read.
        let mut open = Vec::new();
        for tag in text.split('<').skip(1) {
            let name: &str = tag.split([' ', '>', '/']).next().unwrap_or_default();
            match tag.strip_prefix('/') {
                Some(_) => drop(open.pop()),
                None if tag.contains("/>") => {}
                None => open.push(name.to_owned()),
            }
        }
        let closed: String = open.iter().rev().map(|name| format!("</{name}>")).collect();
        if let Ok(map) = read(format!("{text}{closed}")) {
            for element in &map.elements {
                prop_assert!(element.points.len() >= 2);
                prop_assert!(element.points.iter().flatten().all(|value| value.is_finite()));
            }
            prop_assert!(map.elements.is_sorted_by(|a, b| a.id < b.id));
        }
    }

    #[test]
    fn no_mutation_panics(at in any::<prop::sample::Index>(), byte in any::<u8>(), flip in any::<bool>()) {
        let mut bytes = with(&road("7", "<arc curvature='0.1'/>", &lanes(&lane("1", MARK)))).into_bytes();
        let at = at.index(bytes.len());
        if flip { bytes[at] = byte } else { bytes.insert(at, byte) }
        let _ = read(&bytes);
    }
}
