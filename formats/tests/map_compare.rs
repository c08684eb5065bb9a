//! What differs between maps: made up ones, and the revisions of real ones.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use tilefold_formats::map_compare::{Class, Comparable, Difference, How};
use tilefold_formats::map_patch::OsmText;

const MAP: &str = "<osm><node id='1' lat='49.0' lon='8.4'/><node id='2' lat='49.001' lon='8.4'/>\
<node id='3' lat='49.0' lon='8.401'/><node id='4' lat='49.001' lon='8.401'/>\
<way id='10'><nd ref='1'/><nd ref='2'/><tag k='type' v='line_thin'/><tag k='subtype' v='solid'/></way>\
<way id='11'><nd ref='3'/><nd ref='4'/><tag k='type' v='line_thin'/></way>\
<relation id='20'><member type='way' ref='10' role='left'/><member type='way' ref='11' role='right'/></relation></osm>";

fn differences(a: &str, b: &str) -> Vec<Difference> {
    let [a, b] = [a, b].map(|text| OsmText::read(text.into(), "map.osm").unwrap());
    Comparable::osm(&a).differences(&Comparable::osm(&b), 0.01)
}

fn told(a: &str, b: &str) -> Vec<(Class, i64, &'static str)> {
    let all = differences(a, b);
    all.iter().map(|d| (d.class, d.id, d.how.name())).collect()
}

#[test]
fn a_map_is_like_itself_whatever_it_is_numbered() {
    assert_eq!(differences(MAP, MAP), []);
    let renumbered = MAP
        .replace("'10'", "'70'")
        .replace("'20'", "'80'")
        .replace("'1'", "'5'");
    assert_eq!(
        told(MAP, &renumbered),
        [
            (Class::Way, 10, "renumbered"),
            (Class::Relation, 20, "renumbered"),
            (Class::Relation, 20, "rewired")
        ]
    );
}

#[test]
fn moved_retyped_added_removed() {
    let moved = MAP.replace(
        "<node id='2' lat='49.001' lon='8.4'/>",
        "<node id='2' lat='49.001' lon='8.40001'/>",
    );
    let found = differences(MAP, &moved);
    assert_eq!(found.len(), 2);
    // A hundred-thousandth of a degree of longitude at 49 degrees north.
    let How::Moved(metres) = found[1].how else {
        panic!("{found:?}")
    };
    assert!((metres - 0.731).abs() < 0.001, "{metres}");
    assert_eq!(differences(&moved, &moved), []);

    let retyped = MAP.replace("'solid'", "'dashed'");
    assert_eq!(
        differences(MAP, &retyped)[0].how,
        How::Retyped("subtype: solid -> dashed".to_owned())
    );
    let less = MAP.replace(
        "<way id='11'><nd ref='3'/><nd ref='4'/><tag k='type' v='line_thin'/></way>",
        "",
    );
    assert_eq!(told(MAP, &less), [(Class::Way, 11, "removed")]);
    assert_eq!(told(&less, MAP), [(Class::Way, 11, "added")]);
}
