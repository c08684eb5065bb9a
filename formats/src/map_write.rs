//! Elements to a Lanelet2 map (`.osm`): for simulated maps and for tests.
//!
//! Every element becomes a way with its own id and its tags as they are, and every vertex a node of
//! its own: ways do not share nodes, as in maps that are cut from a survey. Lanelet2 has one space of
//! ids for all, so nodes are numbered from 100,001 or from behind the largest element id, whichever
//! is more. The same elements give the same bytes.

use std::collections::BTreeMap;
use std::io::{self, Write};

use tilefold_schemas::element::{Color, Element, ElementKind, Marking, SignClass};

/// The first node id of a map whose elements have smaller ids.
const FIRST_NODE: i64 = 100_001;

/// Why a map could not be written.
#[derive(Debug, thiserror::Error)]
pub enum MapWriteError {
    /// The file behind it failed.
    #[error("cannot write the map: {0}; check the disk and its rights, then write it again")]
    Io(#[from] io::Error),
    /// A vertex that is no position.
    #[error("vertex {vertex} of element {element} is no position on the earth: {point:?}")]
    Point {
        /// The element.
        element: i64,
        /// Which of its vertices, counted from 0.
        vertex: usize,
        /// The vertex.
        point: [f64; 3],
    },
}

/// Writes `elements`, in their order, as a Lanelet2 map whose MetaInfo names `map_version`.
///
/// Latitudes and longitudes get ten digits (0.01 mm), elevations three.
///
/// # Errors
/// If a vertex is not finite or `out` does not take the bytes.
pub fn write_lanelet2(
    elements: &[Element],
    map_version: &str,
    out: &mut impl Write,
) -> Result<(), MapWriteError> {
    let largest = elements.iter().map(|element| element.id.0).max();
    let first_node = largest.map_or(FIRST_NODE, |id| FIRST_NODE.max(id.saturating_add(1)));
    writeln!(out, "<?xml version='1.0' encoding='UTF-8'?>")?;
    writeln!(out, "<osm version='0.6' generator='tilefold'>")?;
    let map_version = escape(map_version);
    writeln!(
        out,
        "  <MetaInfo format_version='1' map_version='{map_version}'/>"
    )?;
    let mut node = first_node;
    for element in elements {
        write_nodes(element, &mut node, out)?;
    }
    let mut node = first_node;
    for element in elements {
        write_way(element, &mut node, out)?;
    }
    writeln!(out, "</osm>")?;
    Ok(())
}

fn write_nodes(
    element: &Element,
    node: &mut i64,
    out: &mut impl Write,
) -> Result<(), MapWriteError> {
    for (vertex, &point) in element.points.iter().enumerate() {
        if !point.iter().all(|value| value.is_finite()) {
            return Err(MapWriteError::Point {
                element: element.id.0,
                vertex,
                point,
            });
        }
        let [longitude_deg, latitude_deg, elevation_m] = point;
        writeln!(
            out,
            "  <node id='{node}' lat='{latitude_deg:.10}' lon='{longitude_deg:.10}' version='1'>\
             <tag k='ele' v='{elevation_m:.3}'/></node>"
        )?;
        *node += 1;
    }
    Ok(())
}

fn write_way(element: &Element, node: &mut i64, out: &mut impl Write) -> Result<(), MapWriteError> {
    let first = *node;
    write!(out, "  <way id='{}' version='1'>", element.id)?;
    for _ in &element.points {
        write!(out, "<nd ref='{node}'/>")?;
        *node += 1;
    }
    if is_area(element.kind) && !element.points.is_empty() {
        write!(out, "<nd ref='{first}'/>")?;
    }
    for (key, value) in &element.tags {
        write!(out, "<tag k='{}' v='{}'/>", escape(key), escape(value))?;
    }
    writeln!(out, "</way>")?;
    Ok(())
}

/// The Lanelet2 tags of an element that has none yet: `type`, and where they are known `subtype`
/// and `color`; `area` for outlines.
#[must_use]
pub fn lanelet2_tags(
    kind: ElementKind,
    marking: Marking,
    color: Color,
    sign: SignClass,
) -> BTreeMap<String, String> {
    let type_tag = match kind {
        ElementKind::LaneMarking => "line_thin",
        ElementKind::StopLine => "stop_line",
        ElementKind::Crosswalk => "zebra_marking",
        ElementKind::GroundSign => "arrow",
    };
    let subtype = match (kind, marking) {
        (ElementKind::LaneMarking, Marking::Unknown | Marking::Other) => None,
        (ElementKind::LaneMarking, known) => Some(known.name()),
        (ElementKind::GroundSign, _) if sign != SignClass::Unknown => Some(sign.name()),
        _ => None,
    };
    let color = match color {
        Color::White | Color::Yellow => Some(color.name()),
        Color::Unknown | Color::Other => None,
    };
    let tags = [
        ("type", Some(type_tag)),
        ("subtype", subtype),
        ("color", color),
        ("area", is_area(kind).then_some("yes")),
    ];
    tags.into_iter()
        .filter_map(|(key, value)| Some((key.to_owned(), value?.to_owned())))
        .collect()
}

fn is_area(kind: ElementKind) -> bool {
    matches!(kind, ElementKind::Crosswalk | ElementKind::GroundSign)
}

/// `text` inside of single quotes; what XML 1.0 cannot hold at all becomes a replacement character.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '\'' => escaped.push_str("&apos;"),
            '\t' | '\n' | '\r' => escaped.push_str(&format!("&#{};", u32::from(character))),
            '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            _ => escaped.push(character),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::id::ElementId;

    fn element(id: i64, kind: ElementKind) -> Element {
        Element {
            id: ElementId(id),
            kind,
            marking: Marking::Dashed,
            color: Color::White,
            sign: SignClass::Unknown,
            points: vec![[8.4, 49.0, 115.0], [8.400_1, 49.0, 115.0]],
            tags: lanelet2_tags(kind, Marking::Dashed, Color::White, SignClass::Unknown),
        }
    }

    fn written(elements: &[Element]) -> String {
        let mut out = Vec::new();
        write_lanelet2(elements, "a<b", &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn a_line_and_an_area() {
        let map = written(&[
            element(1000, ElementKind::LaneMarking),
            element(1001, ElementKind::Crosswalk),
        ]);
        assert_eq!(
            map,
            "<?xml version='1.0' encoding='UTF-8'?>\n\
             <osm version='0.6' generator='tilefold'>\n  \
             <MetaInfo format_version='1' map_version='a&lt;b'/>\n  \
             <node id='100001' lat='49.0000000000' lon='8.4000000000' version='1'><tag k='ele' v='115.000'/></node>\n  \
             <node id='100002' lat='49.0000000000' lon='8.4001000000' version='1'><tag k='ele' v='115.000'/></node>\n  \
             <node id='100003' lat='49.0000000000' lon='8.4000000000' version='1'><tag k='ele' v='115.000'/></node>\n  \
             <node id='100004' lat='49.0000000000' lon='8.4001000000' version='1'><tag k='ele' v='115.000'/></node>\n  \
             <way id='1000' version='1'><nd ref='100001'/><nd ref='100002'/><tag k='color' v='white'/><tag k='subtype' v='dashed'/><tag k='type' v='line_thin'/></way>\n  \
             <way id='1001' version='1'><nd ref='100003'/><nd ref='100004'/><nd ref='100003'/><tag k='area' v='yes'/><tag k='color' v='white'/><tag k='type' v='zebra_marking'/></way>\n\
             </osm>\n"
        );
    }

    #[test]
    fn a_sign_says_its_class() {
        let tags = |sign| {
            lanelet2_tags(
                ElementKind::GroundSign,
                Marking::Unknown,
                Color::White,
                sign,
            )
        };
        assert_eq!(tags(SignClass::LeftArrow)["subtype"], "left_arrow");
        assert!(!tags(SignClass::Unknown).contains_key("subtype"));
    }

    #[test]
    fn nodes_are_numbered_behind_large_element_ids() {
        let map = written(&[element(5_000_000, ElementKind::StopLine)]);
        assert!(map.contains("<node id='5000001'"), "{map}");
    }

    #[test]
    fn a_vertex_that_is_no_number_is_refused_by_name() {
        let mut broken = element(7, ElementKind::LaneMarking);
        broken.points[1][0] = f64::NAN;
        let error = write_lanelet2(&[broken], "", &mut Vec::new()).unwrap_err();
        assert!(error.to_string().starts_with("vertex 1 of element 7"));
    }

    #[test]
    fn text_cannot_leave_its_quotes() {
        assert_eq!(
            escape("a'/><x>&\n\u{1}"),
            "a&apos;/&gt;&lt;x&gt;&amp;&#10;\u{fffd}"
        );
    }
}
