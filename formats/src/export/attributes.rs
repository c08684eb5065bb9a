//! What every export says of a change: one table of names and types, and its values.

use std::borrow::Cow;

use super::change::Change;

/// The type of an attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Type {
    Text,
    Integer,
    Real,
    /// Nanoseconds since the Unix epoch.
    Time,
}

/// The value of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value<'a> {
    None,
    Text(Cow<'a, str>),
    Integer(i64),
    Real(f64),
    /// Nanoseconds since the Unix epoch.
    Time(i64),
}

/// Names and types, in the order of [`values`].
pub(crate) const ATTRIBUTES: [(&str, Type); 22] = [
    ("element_id", Type::Integer),
    ("change_type", Type::Text),
    ("kind", Type::Text),
    ("from_m", Type::Real),
    ("to_m", Type::Real),
    ("p_no_change", Type::Real),
    ("p_added", Type::Real),
    ("p_removed", Type::Real),
    ("p_modified", Type::Real),
    ("vehicles", Type::Integer),
    ("passes", Type::Integer),
    ("exposed", Type::Integer),
    ("hit", Type::Integer),
    ("first_seen", Type::Time),
    ("last_seen", Type::Time),
    ("changed_after", Type::Time),
    ("changed_before", Type::Time),
    ("shift_m", Type::Real),
    ("shift_sigma_m", Type::Real),
    ("tile", Type::Integer),
    ("change", Type::Text),
    ("fusion_model", Type::Text),
];

/// The values of [`ATTRIBUTES`] for one change. A number that is not finite is none.
pub(crate) fn values<'a>(change: &Change<'a>) -> [Value<'a>; 22] {
    let record = change.record;
    let integer = |value: i32| Value::Integer(value.into());
    let time = |stamp_ns: Option<i64>| stamp_ns.map_or(Value::None, Value::Time);
    [
        record.element.map_or(Value::None, Value::Integer),
        Value::Text(change.verdict.name().into()),
        Value::Text(change.kind.name().into()),
        real(Some(record.from_m)),
        real(Some(record.to_m)),
        real(Some(record.p_no_change)),
        real(Some(record.p_added)),
        real(Some(record.p_removed)),
        real(Some(record.p_modified)),
        integer(record.vehicles),
        integer(record.passes),
        Value::Integer(record.exposed),
        Value::Integer(record.hit),
        Value::Time(record.first_ns),
        Value::Time(record.last_ns),
        time(record.changed_after_ns),
        time(record.changed_before_ns),
        real(record.shift_m),
        real(record.shift_sigma_m),
        integer(record.tile),
        Value::Text(format!("{:016x}", record.change).into()),
        Value::Text(record.fusion_model.as_str().into()),
    ]
}

fn real<'a>(value: Option<f64>) -> Value<'a> {
    let finite = value.filter(|value| value.is_finite());
    finite.map_or(Value::None, Value::Real)
}
