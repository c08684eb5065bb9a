//! Objects and signals of a road that are paint: crosswalks, stop lines, arrows and what else is
//! painted on the road, where the file says how large it is.
//!
//! | what | becomes |
//! | --- | --- |
//! | object `crosswalk` | crosswalk, unless its `subtype` is `virtual` |
//! | object `roadMark` called a stop line (`subtype` or `name`), object `stopLine` | stop line: the line through the middle of its area |
//! | other object `roadMark` | ground sign; `subtype` says which (`arrowLeft`, ...) |
//! | signal 294 and 341 of Germany (stop line, line to wait at) | stop line across the lanes it is valid for, or as wide as it says |

use tilefold_schemas::limits::MAX_OUTLINES_PER_OBJECT;
use tilefold_schemas::{ElementKind, Marking, SignClass};

use super::road::{Across, Road};
use super::tree::Node;

/// What an object or a signal paints.
pub(super) struct Painted {
    pub(super) kind: ElementKind,
    pub(super) marking: Marking,
    pub(super) sign: SignClass,
    /// In the frame of the file, one behind the other.
    pub(super) points: Vec<[f64; 3]>,
}

/// What an object paints, by outline; nothing if it is no paint.
pub(super) fn of_object(road: &Road, object: &Node) -> Result<Vec<Painted>, String> {
    let Some((kind, sign)) = kind_of(object) else {
        return Ok(Vec::new());
    };
    let painted = |area: Vec<[f64; 3]>| Painted {
        kind,
        marking: if kind == ElementKind::StopLine {
            Marking::Solid
        } else {
            Marking::Unknown
        },
        sign,
        points: if kind == ElementKind::StopLine {
            middle_line(&area)
        } else {
            area
        },
    };
    Ok(areas(road, object)?.into_iter().map(painted).collect())
}

/// A word as it is compared: files write stop lines in every way.
fn word(text: &str) -> String {
    text.chars()
        .filter(char::is_ascii_alphanumeric)
        .collect::<String>()
        .to_ascii_lowercase()
}

fn kind_of(object: &Node) -> Option<(ElementKind, SignClass)> {
    let [kind, subtype, name] = ["type", "subtype", "name"].map(|key| word(object.attribute(key)));
    let is_stop_line = subtype.contains("stopline") || name.contains("stopline");
    match kind.as_str() {
        "crosswalk" if subtype != "virtual" => Some((ElementKind::Crosswalk, SignClass::Unknown)),
        "stopline" => Some((ElementKind::StopLine, SignClass::Unknown)),
        "roadmark" if is_stop_line => Some((ElementKind::StopLine, SignClass::Unknown)),
        "roadmark" => Some((ElementKind::GroundSign, sign(&subtype))),
        _ => None,
    }
}

fn sign(subtype: &str) -> SignClass {
    match subtype {
        "" => SignClass::Unknown,
        "arrowstraight" => SignClass::StraightArrow,
        "arrowleft" => SignClass::LeftArrow,
        "arrowright" => SignClass::RightArrow,
        "arrowstraightleft" => SignClass::StraightLeftArrow,
        "arrowstraightright" => SignClass::StraightRightArrow,
        _ => SignClass::Other,
    }
}

/// The areas of an object: its outlines, or else its box.
fn areas(road: &Road, object: &Node) -> Result<Vec<Vec<[f64; 3]>>, String> {
    let outlines = object
        .all("outline")
        .chain(object.all_in("outlines", "outline"));
    let outer = outlines.filter(|outline| outline.attribute("outer") != "false");
    let areas = outer
        .take(MAX_OUTLINES_PER_OBJECT + 1)
        .map(|outline| area(road, object, outline))
        .collect::<Result<Vec<_>, _>>()?;
    if areas.len() > MAX_OUTLINES_PER_OBJECT {
        return Err(format!(
            "it has over {MAX_OUTLINES_PER_OBJECT} outlines (MAX_OUTLINES_PER_OBJECT)"
        ));
    }
    match areas.is_empty() {
        true => Ok(vec![own_box(road, object)?]),
        false => Ok(areas),
    }
}

fn area(road: &Road, object: &Node, outline: &Node) -> Result<Vec<[f64; 3]>, String> {
    let corners = outline.children.iter();
    corners
        .map(|corner| match corner.name.as_str() {
            "cornerRoad" => {
                let [s, t] = corner.numbers(["s", "t"])?;
                let [x, y, z] = road.point(s, Across::banked(t));
                Ok([x, y, z + corner.number_or("dz", 0.0)?])
            }
            _ => {
                let [u, v] = corner.numbers(["u", "v"])?;
                local(road, object, [u, v, corner.number_or("z", 0.0)?])
            }
        })
        .collect()
}

fn own_box(road: &Road, object: &Node) -> Result<Vec<[f64; 3]>, String> {
    let [length, width] = object.numbers(["length", "width"])?;
    let [u, v] = [length / 2.0, width / 2.0];
    let corners = [[-u, -v, 0.0], [u, -v, 0.0], [u, v, 0.0], [-u, v, 0.0]];
    corners
        .into_iter()
        .map(|corner| local(road, object, corner))
        .collect()
}

/// A point in an object's own frame: u along the road, turned by the object's heading.
fn local(road: &Road, object: &Node, [u, v, up]: [f64; 3]) -> Result<[f64; 3], String> {
    let [s, t] = object.numbers(["s", "t"])?;
    let [x, y, z] = road.point(s, Across::banked(t));
    let heading_rad = road.pose(s).heading_rad + object.number_or("hdg", 0.0)?;
    let (sin, cos) = heading_rad.sin_cos();
    let above = z + object.number_or("zOffset", 0.0)? + up;
    Ok([x + u * cos - v * sin, y + u * sin + v * cos, above])
}

/// The line between the middles of an area's two ends: those sides of a box that are shortest.
fn middle_line(area: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let &[a, b, c, d] = area else {
        return area.to_vec();
    };
    let between =
        |one: [f64; 3], other: [f64; 3]| [0, 1, 2].map(|axis| (one[axis] + other[axis]) / 2.0);
    let length = |one: [f64; 3], other: [f64; 3]| (one[0] - other[0]).hypot(one[1] - other[1]);
    match length(a, b) + length(c, d) > length(b, c) + length(d, a) {
        true => vec![between(d, a), between(b, c)],
        false => vec![between(a, b), between(c, d)],
    }
}

/// The stop line that a signal stands for; none if it is none, or does not say how wide it is.
/// `lanes` gives the span of lanes across the road at a station.
pub(super) fn of_signal(
    road: &Road,
    signal: &Node,
    lanes: impl Fn(f64, [i64; 2]) -> Option<[Across; 2]>,
) -> Result<Option<Painted>, String> {
    let country = word(signal.attribute("country"));
    if !matches!(country.as_str(), "de" | "deu" | "germany" | "opendrive") {
        return Ok(None);
    }
    let marking = match signal.attribute("type") {
        "294" => Marking::Solid,
        "341" => Marking::Dashed,
        _ => return Ok(None),
    };
    let [s, t] = signal.numbers(["s", "t"])?;
    let width_m = signal.number_or("width", 0.0)?;
    let validity = signal.all("validity").next();
    let ids = validity.map(|node| ["fromLane", "toLane"].map(|key| node.attribute(key).parse()));
    let span = match ids {
        _ if width_m > 0.0 => Some([t + width_m / 2.0, t - width_m / 2.0].map(Across::banked)),
        Some([Ok(from), Ok(to)]) => lanes(s, [from, to]),
        _ => None,
    };
    Ok(span.map(|ends| Painted {
        kind: ElementKind::StopLine,
        marking,
        sign: SignClass::Unknown,
        points: ends.map(|across| road.point(s, across)).to_vec(),
    }))
}
