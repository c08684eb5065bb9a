//! What the tags of lanelets and their borders say of traffic: Lanelet2's `LaneletAndAreaTagging.md`
//! and `LinestringTagging.md`, with the words of older revisions. Where tags are missing, the
//! defaults are those of the Lanelet2 library: a lanelet without a subtype is a road, and one way.

use std::collections::BTreeMap;

use tilefold_schemas::Marking;

use super::paint::{self, tag};
use super::roads::{BorderKind, Crossing};

type Tags = BTreeMap<String, String>;

/// Kilometres per hour and miles per hour, in metres per second.
const KM_H: f64 = 1.0 / 3.6;
const MPH: f64 = 0.447_04;
/// No road allows more, in metres per second.
const MOST_SPEED_M_S: f64 = 200.0;

/// Whether cars may drive there. Who is named (`participant:...`, older maps: `vehicle`) goes before
/// the subtype.
pub(super) fn is_for_vehicles(tags: &Tags) -> bool {
    if tags.keys().any(|key| key.starts_with("participant:")) {
        let named = ["participant:vehicle:car", "participant:vehicle"];
        return first_of(tags, &named).is_some_and(is_yes);
    }
    match (tag(tags, "subtype"), tag(tags, "vehicle")) {
        ("" | "normal", vehicle) => vehicle.is_empty() || is_yes(vehicle),
        ("road" | "highway" | "play_street" | "exit" | "bus_lane", _) => true,
        _ => false,
    }
}

/// Whether it may be driven in one direction only.
pub(super) fn is_one_way(tags: &Tags) -> bool {
    let named = ["one_way:vehicle:car", "one_way:vehicle", "one_way"];
    first_of(tags, &named).is_none_or(is_yes)
}

/// The speed limit of a lanelet, in metres per second: `50`, `50 km/h`, `30 mph` or `14 m/s`.
pub(super) fn speed_limit_m_s(tags: &Tags) -> Option<f64> {
    let text = tag(tags, "speed_limit");
    let unit_at = text.find(|c: char| !c.is_ascii_digit() && c != '.');
    let (number, unit) = text.split_at(unit_at.unwrap_or(text.len()));
    let unit_m_s = match unit.trim() {
        "" | "km/h" | "kmh" | "kph" => KM_H,
        "mph" => MPH,
        "m/s" | "mps" => 1.0,
        _ => return None,
    };
    let speed_m_s = number.parse::<f64>().ok()? * unit_m_s;
    (speed_m_s > 0.0 && speed_m_s <= MOST_SPEED_M_S).then_some(speed_m_s)
}

/// What a border is.
pub(super) fn border_kind(tags: &Tags) -> BorderKind {
    match tag(tags, "type") {
        "" => BorderKind::Unstated,
        "virtual" => BorderKind::Virtual,
        "curbstone" | "road_border" | "guard_rail" | "wall" | "fence" | "jersey_barrier" => {
            BorderKind::Edge
        }
        _ if paint::of_way(tags, false).is_some() => BorderKind::Paint,
        _ => BorderKind::Other,
    }
}

/// Which lane changes over a border are allowed, as seen along its way; none if it is not known.
pub(super) fn crossing(tags: &Tags) -> Option<Crossing> {
    let by_line = by_line(tags);
    let said = |side: &str| {
        let found = first_of(tags, &[side, "lane_change"]);
        found.map(is_yes)
    };
    Some(Crossing {
        to_left: said("lane_change:left").or(by_line.map(|line| line.to_left))?,
        to_right: said("lane_change:right").or(by_line.map(|line| line.to_right))?,
    })
}

fn by_line(tags: &Tags) -> Option<Crossing> {
    let (to_left, to_right) = match (border_kind(tags), paint::of_way(tags, false)) {
        (BorderKind::Unstated, _) => return None,
        (BorderKind::Paint, Some(paint)) => match paint.marking {
            Marking::Unknown => return None,
            Marking::Dashed | Marking::DashedDashed => (true, true),
            Marking::DashedSolid => (false, true),
            Marking::SolidDashed => (true, false),
            Marking::Solid | Marking::SolidSolid | Marking::Other => (false, false),
        },
        _ => (false, false),
    };
    Some(Crossing { to_left, to_right })
}

fn first_of<'a>(tags: &'a Tags, keys: &[&str]) -> Option<&'a str> {
    let mut said = keys.iter().map(|key| tag(tags, key));
    said.find(|value| !value.is_empty())
}

fn is_yes(value: &str) -> bool {
    matches!(value, "yes" | "true" | "1")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tags(pairs: &[(&str, &str)]) -> Tags {
        let owned = pairs
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
        owned.collect()
    }

    #[test]
    fn who_may_drive() {
        for (said, expected) in [
            (&[][..], true),
            (&[("subtype", "road")], true),
            (&[("subtype", "crosswalk")], false),
            (&[("subtype", "road_shoulder")], false),
            (&[("subtype", "normal"), ("vehicle", "no")], false),
            (&[("subtype", "normal"), ("vehicle", "yes")], true),
            (
                &[("subtype", "road"), ("participant:bicycle", "yes")],
                false,
            ),
            (
                &[("subtype", "walkway"), ("participant:vehicle", "yes")],
                true,
            ),
            (
                &[
                    ("participant:vehicle", "yes"),
                    ("participant:vehicle:car", "no"),
                ],
                false,
            ),
        ] {
            assert_eq!(is_for_vehicles(&tags(said)), expected, "{said:?}");
        }
    }

    #[test]
    fn speeds_with_their_units() {
        for (said, expected) in [
            ("50", Some(50.0 / 3.6)),
            ("50 km/h", Some(50.0 / 3.6)),
            ("30mph", Some(13.4112)),
            ("14 m/s", Some(14.0)),
            ("", None),
            ("fast", None),
            ("-5", None),
            ("0", None),
            ("1e400", None),
            ("99999", None),
            ("1.2.3", None),
        ] {
            assert_eq!(
                speed_limit_m_s(&tags(&[("speed_limit", said)])),
                expected,
                "{said}"
            );
        }
    }

    #[test]
    fn which_lines_may_be_crossed() {
        let crossing = |said: &[(&str, &str)]| {
            crossing(&tags(said)).map(|found| (found.to_left, found.to_right))
        };
        let line = |subtype| crossing(&[("type", "line_thin"), ("subtype", subtype)]);
        assert_eq!(line("dashed"), Some((true, true)));
        assert_eq!(line("solid"), Some((false, false)));
        assert_eq!(line("dashed_solid"), Some((false, true)));
        assert_eq!(line(""), None);
        assert_eq!(crossing(&[]), None);
        assert_eq!(crossing(&[("type", "virtual")]), Some((false, false)));
        assert_eq!(crossing(&[("lane_change", "yes")]), Some((true, true)));
        let left_only = [("type", "curbstone"), ("lane_change:left", "yes")];
        assert_eq!(crossing(&left_only), Some((true, false)));
    }
}
