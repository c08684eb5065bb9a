//! Bounds on protobuf before it is decoded.
//!
//! An empty sub-message takes two bytes on the wire and hundreds in memory, so a message within
//! its byte limit could still take the machine's. The parts of a message are counted on the wire,
//! level by level, before anything is allocated.
//!
//! Source: protobuf encoding, <https://protobuf.dev/programming-guides/encoding>.

use super::error::DecodeError;

const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const DELIMITED: u64 = 2;
const FIXED32: u64 = 5;

/// How many parts (texts, packed numbers and sub-messages) one level of a message may have in
/// all, and in which of its fields the next level lies.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Level {
    /// What is counted, for the error.
    pub(crate) what: &'static str,
    /// Parts at most, over the whole message.
    pub(crate) limit: usize,
    /// Numbers of the fields that hold the next level.
    pub(crate) into: &'static [u64],
}

/// Holds `bytes`, a message of `schema`, against `levels`.
pub(crate) fn check(
    bytes: &[u8],
    schema: &'static str,
    levels: &[Level],
) -> Result<(), DecodeError> {
    let mut counts = vec![0; levels.len()];
    count(bytes, levels, &mut counts).unwrap_or(Err(DecodeError::Protobuf {
        schema,
        reason: "a field runs over the end of its message".to_owned(),
    }))
}

/// Counts one level and those below; `None` if the bytes are no message.
fn count(
    mut bytes: &[u8],
    levels: &[Level],
    counts: &mut [usize],
) -> Option<Result<(), DecodeError>> {
    let (Some((level, deeper)), Some((own, below))) =
        (levels.split_first(), counts.split_first_mut())
    else {
        return Some(Ok(()));
    };
    while !bytes.is_empty() {
        let Some((field, part)) = next_field(&mut bytes)? else {
            continue;
        };
        *own += 1;
        if *own > level.limit {
            return Some(Err(DecodeError::TooMany {
                what: level.what,
                got: *own,
                limit: level.limit,
            }));
        }
        if level.into.contains(&field)
            && let Err(error) = count(part, deeper, below)?
        {
            return Some(Err(error));
        }
    }
    Some(Ok(()))
}

/// Takes a field off `bytes`: its number and content if it has a length, else nothing.
#[allow(clippy::option_option)]
fn next_field<'a>(bytes: &mut &'a [u8]) -> Option<Option<(u64, &'a [u8])>> {
    let key = varint(bytes)?;
    let length = match key & 7 {
        VARINT => return varint(bytes).map(|_| None),
        FIXED64 => 8,
        FIXED32 => 4,
        DELIMITED => usize::try_from(varint(bytes)?).ok()?,
        _ => return None,
    };
    let (part, rest) = bytes.split_at_checked(length)?;
    *bytes = rest;
    Some((key & 7 == DELIMITED).then_some((key >> 3, part)))
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}
