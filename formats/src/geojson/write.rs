//! Change records to GeoJSON: one feature a line, keys in one order, so that the same records give
//! the same bytes and a diff shows what changed.

use std::fmt::Write as _;
use std::io::Write;

use tilefold_schemas::ChangeRecord;
use tilefold_schemas::wkb::Geometry;

use super::GeoJsonError;
use crate::export::attributes::{ATTRIBUTES, Value, values};
use crate::export::change::Change;

/// Writes `records` in their order as a `FeatureCollection`.
///
/// A feature's geometry is where the thing is on the road (`added`, `modified`) or was in the map (all
/// others), whichever is known; longitude and latitude have nine decimals (0.1 mm), rings run
/// counter-clockwise. Times are UTC to the millisecond. A number that is not finite becomes null.
///
/// # Errors
/// If a record has an unknown code or a geometry that is none, or `out` does not take the bytes.
pub fn write_changes(
    records: &[ChangeRecord],
    out: &mut (impl Write + ?Sized),
) -> Result<(), GeoJsonError> {
    write_reviewed(records, &|_| None, out)
}

/// What a reviewer decided of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reviewed<'a> {
    /// `accept`, `reject` or `later`.
    pub decision: &'a str,
    /// Why.
    pub note: &'a str,
    /// Who.
    pub reviewer: &'a str,
    /// When, UTC.
    pub at: &'a str,
    /// Version of the store that was looked at.
    pub version: i64,
    /// What that version said.
    pub verdict: &'a str,
}

/// As [`write_changes`]; features of changes that `reviewed` knows also have `review_decision`,
/// `review_note`, `reviewer`, `reviewed_at`, `reviewed_version` and `reviewed_verdict`.
///
/// # Errors
/// As [`write_changes`].
pub fn write_reviewed<'a>(
    records: &[ChangeRecord],
    reviewed: &dyn Fn(i64) -> Option<Reviewed<'a>>,
    out: &mut (impl Write + ?Sized),
) -> Result<(), GeoJsonError> {
    out.write_all(b"{\"type\":\"FeatureCollection\",\"features\":[")?;
    for (index, record) in records.iter().enumerate() {
        let feature = feature(record, reviewed(record.change))?;
        let separator = if index == 0 { "\n" } else { ",\n" };
        out.write_all(separator.as_bytes())?;
        out.write_all(feature.as_bytes())?;
    }
    out.write_all(b"\n]}\n")?;
    Ok(())
}

fn feature(record: &ChangeRecord, reviewed: Option<Reviewed<'_>>) -> Result<String, GeoJsonError> {
    let change = Change::of(record)?;
    let mut properties = properties(&change);
    if let Some(reviewed) = reviewed {
        properties["review_decision"] = reviewed.decision.into();
        properties["review_note"] = reviewed.note.into();
        properties["reviewer"] = reviewed.reviewer.into();
        properties["reviewed_at"] = reviewed.at.into();
        properties["reviewed_version"] = reviewed.version.into();
        properties["reviewed_verdict"] = reviewed.verdict.into();
    }
    let geometry = geometry(change.geometry);
    Ok(format!(
        "{{\"type\":\"Feature\",\"id\":\"{:016x}\",\"properties\":{properties},\"geometry\":{geometry}}}",
        record.change
    ))
}

fn properties(change: &Change<'_>) -> serde_json::Value {
    let cells = ATTRIBUTES.iter().zip(values(change));
    cells
        .map(|((name, _), value)| ((*name).to_owned(), json(value)))
        .collect()
}

fn json(value: Value<'_>) -> serde_json::Value {
    match value {
        Value::None => serde_json::Value::Null,
        Value::Text(text) => text.into(),
        Value::Integer(number) => number.into(),
        Value::Real(number) => number.into(),
        Value::Time(stamp_ns) => utc(stamp_ns).into(),
    }
}

fn geometry(geometry: Option<Geometry>) -> String {
    let Some(geometry) = geometry else {
        return "null".to_owned();
    };
    let mut text = String::new();
    if geometry.is_area {
        text.push_str("{\"type\":\"Polygon\",\"coordinates\":[");
        push_positions(&mut text, &closed_ring(geometry.points));
        text.push_str("]}");
    } else {
        text.push_str("{\"type\":\"LineString\",\"coordinates\":");
        push_positions(&mut text, &geometry.points);
        text.push('}');
    }
    text
}

/// Counter-clockwise from above (RFC 7946, section 3.1.6), with the first vertex repeated. The first
/// vertex stays first.
pub(crate) fn closed_ring(mut ring: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    if doubled_area(&ring) < 0.0
        && let Some((_, rest)) = ring.split_first_mut()
    {
        rest.reverse();
    }
    ring.extend(ring.first().copied());
    ring
}

/// Twice the signed area in square degrees, positive if counter-clockwise; relative to the first
/// vertex, so that a small ring far from the origin keeps its sign.
fn doubled_area(ring: &[[f64; 3]]) -> f64 {
    let Some(first) = ring.first() else {
        return 0.0;
    };
    let around = ring
        .iter()
        .map(|point| [point[0] - first[0], point[1] - first[1]]);
    let next = around.clone().skip(1);
    around
        .zip(next)
        .map(|(a, b)| a[0] * b[1] - a[1] * b[0])
        .sum()
}

pub(super) fn push_positions(text: &mut String, points: &[[f64; 3]]) {
    text.push('[');
    for (index, [longitude_deg, latitude_deg, _]) in points.iter().enumerate() {
        let separator = if index == 0 { "" } else { "," };
        let [lon, lat] = [longitude_deg, latitude_deg].map(|degrees| rounded(*degrees));
        // Writing into a `String` cannot fail.
        let _ = write!(text, "{separator}[{lon:.9},{lat:.9}]");
    }
    text.push(']');
}

/// Never a negative zero.
fn rounded(degrees: f64) -> f64 {
    if degrees.abs() < 5e-10 { 0.0 } else { degrees }
}

/// Nanoseconds since the Unix epoch as `2026-11-22T10:15:00.123Z`.
pub(crate) fn utc(stamp_ns: i64) -> String {
    let milliseconds = stamp_ns.div_euclid(1_000_000);
    let (day, in_day) = (
        milliseconds.div_euclid(86_400_000),
        milliseconds.rem_euclid(86_400_000),
    );
    let (year, month, day) = civil(day);
    let (hours, minutes) = (in_day / 3_600_000, in_day / 60_000 % 60);
    let (seconds, millis) = (in_day / 1_000 % 60, in_day % 1_000);
    format!("{year:04}-{month:02}-{day:02}T{hours:02}:{minutes:02}:{seconds:02}.{millis:03}Z")
}

/// Year, month and day of a day counted from 1970-01-01 in the Gregorian calendar (Howard Hinnant,
/// "chrono-compatible low-level date algorithms", `civil_from_days`). Years begin in March here.
fn civil(day: i64) -> (i64, i64, i64) {
    let from_march_0 = day + 719_468;
    let era = from_march_0.div_euclid(146_097);
    let of_era = from_march_0.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day_of_month = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 {
        month_from_march + 3
    } else {
        month_from_march - 9
    };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    (year, month, day_of_month)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_utc() {
        // `date -u --date=@N +%FT%T.%3NZ`
        for (stamp_ns, text) in [
            (0, "1970-01-01T00:00:00.000Z"),
            (1_709_208_000_123_999_999, "2024-02-29T12:00:00.123Z"),
            (951_868_799_000_000_000, "2000-02-29T23:59:59.000Z"),
            (-1, "1969-12-31T23:59:59.999Z"),
            (i64::MAX, "2262-04-11T23:47:16.854Z"),
            (i64::MIN, "1677-09-21T00:12:43.145Z"),
        ] {
            assert_eq!(utc(stamp_ns), text);
        }
    }

    #[test]
    fn rings_turn_left_and_keep_their_first_vertex() {
        let clockwise = vec![[8.0, 49.0, 0.0], [8.0, 49.1, 0.0], [8.1, 49.1, 0.0]];
        let ring = closed_ring(clockwise);
        assert_eq!(
            ring,
            [
                [8.0, 49.0, 0.0],
                [8.1, 49.1, 0.0],
                [8.0, 49.1, 0.0],
                [8.0, 49.0, 0.0]
            ]
        );
        assert_eq!(closed_ring(ring[..3].to_vec()), ring);
        assert!(closed_ring(Vec::new()).is_empty());
    }
}
