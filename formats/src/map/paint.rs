//! Which ways are paint, and what paint: the tags of Lanelet2 (its `LinestringTagging.md`), with the
//! words that older revisions and Autoware use for the same things.
//!
//! | `type` | becomes |
//! | --- | --- |
//! | `line_thin`, `line_thick` | lane marking; `subtype` says how it is painted |
//! | `bike_marking` (`bike`), `zig-zag` | lane marking, painted some other way |
//! | `stop_line` | stop line |
//! | `zebra_marking`, `pedestrian_marking`, `crosswalk`, `crosswalk_polygon` | crosswalk, if closed; open, it is the border of a crosswalk lanelet or else a lane marking |
//! | `arrow`, `symbol` | ground sign; `subtype` says which |
//! | anything else (`virtual`, `curbstone`, `road_border`, `guard_rail`, `traffic_sign`, ...) | no paint |

use std::collections::BTreeMap;

use tilefold_schemas::{Color, ElementKind, Marking, SignClass};

type Tags = BTreeMap<String, String>;

/// What a way's tags say of its paint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Paint {
    pub(super) kind: ElementKind,
    pub(super) marking: Marking,
    pub(super) sign: SignClass,
}

/// The paint of a way; none if it is no paint. `closed`: whether it is an area.
pub(super) fn of_way(tags: &Tags, closed: bool) -> Option<Paint> {
    let subtype = tag(tags, "subtype");
    let paint = match tag(tags, "type") {
        "line_thin" | "line_thick" => line(marking(subtype)),
        "bike_marking" | "bike" | "zig-zag" | "zigzag" => line(other_marking(subtype)),
        "stop_line" => Paint {
            kind: ElementKind::StopLine,
            ..line(marking(subtype))
        },
        kind if is_crosswalk_border(kind) && closed => crosswalk(),
        kind if is_crosswalk_border(kind) => line(other_marking(subtype)),
        "arrow" => ground_sign(arrow(subtype)),
        "symbol" => ground_sign(symbol(subtype)),
        _ => return None,
    };
    Some(paint)
}

/// The paint of a crosswalk.
pub(super) fn crosswalk() -> Paint {
    Paint {
        kind: ElementKind::Crosswalk,
        ..line(Marking::Unknown)
    }
}

/// Whether a way of this type may border a painted crosswalk: paint, or not said to be anything.
pub(super) fn may_border_crosswalk(tags: &Tags) -> bool {
    let kind = tag(tags, "type");
    kind.is_empty() || is_crosswalk_border(kind) || matches!(kind, "line_thin" | "line_thick")
}

/// Whether a way of this type is a part of a crosswalk where one is bordered by it.
pub(super) fn is_crosswalk_border(kind: &str) -> bool {
    matches!(
        kind,
        "zebra_marking" | "pedestrian_marking" | "crosswalk" | "crosswalk_polygon"
    )
}

/// The colour that the tags say.
pub(super) fn color(tags: &Tags) -> Color {
    let said = tags.get("color").or_else(|| tags.get("colour"));
    match said.map(|text| text.trim().to_ascii_lowercase()).as_deref() {
        None | Some("" | "unknown") => Color::Unknown,
        Some("white") => Color::White,
        Some("yellow") => Color::Yellow,
        Some(_) => Color::Other,
    }
}

/// The value of a tag, empty if there is none.
pub(super) fn tag<'a>(tags: &'a Tags, key: &str) -> &'a str {
    tags.get(key).map_or("", |value| value.trim())
}

fn line(marking: Marking) -> Paint {
    Paint {
        kind: ElementKind::LaneMarking,
        marking,
        sign: SignClass::Unknown,
    }
}

fn ground_sign(sign: SignClass) -> Paint {
    Paint {
        kind: ElementKind::GroundSign,
        marking: Marking::Unknown,
        sign,
    }
}

/// Older Lanelet2 maps say `straight` for `solid`.
pub(crate) fn marking(subtype: &str) -> Marking {
    match subtype {
        "" | "unknown" => Marking::Unknown,
        "solid" | "straight" => Marking::Solid,
        "dashed" => Marking::Dashed,
        "solid_solid" | "straight_straight" => Marking::SolidSolid,
        "solid_dashed" | "straight_dashed" => Marking::SolidDashed,
        "dashed_solid" | "dashed_straight" => Marking::DashedSolid,
        "dashed_dashed" => Marking::DashedDashed,
        _ => Marking::Other,
    }
}

/// Of a line that is not a plain one unless it says so.
fn other_marking(subtype: &str) -> Marking {
    match marking(subtype) {
        Marking::Unknown => Marking::Other,
        said => said,
    }
}

fn arrow(subtype: &str) -> SignClass {
    match subtype {
        "" | "unknown" => SignClass::Unknown,
        "straight" | "forward" | "through" => SignClass::StraightArrow,
        "left" => SignClass::LeftArrow,
        "right" => SignClass::RightArrow,
        "straight_left" | "left_straight" => SignClass::StraightLeftArrow,
        "straight_right" | "right_straight" => SignClass::StraightRightArrow,
        other => SignClass::from_name(other).unwrap_or(SignClass::Other),
    }
}

fn symbol(subtype: &str) -> SignClass {
    match subtype {
        "" | "unknown" => SignClass::Unknown,
        "bus" => SignClass::BusLane,
        "bike" | "bicycle" => SignClass::CycleLane,
        speed if speed.bytes().all(|byte| byte.is_ascii_digit()) => SignClass::SpeedLimit,
        other => SignClass::from_name(other).unwrap_or(SignClass::Other),
    }
}
