//! `tilefold.json`: what is fixed when a store is created, and which format it has.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::StoreError;
use crate::location::Place;

/// Name of the file beside the tables.
pub(crate) const FILE: &str = "tilefold.json";

/// Format of the stores that are written here. Once stores are out there, this code reads this format
/// and, as a rule, the one before. Since 2 a chunk says what it was made from, so that drives can be
/// taken out and base maps changed. Since 3 what has geometry has a column `bbox`, and statistics of it.
/// Since 4 the ledger has smaller units and longer windows (decision 0036).
pub const FORMAT_VERSION: i64 = 4;

/// Oldest format that is still read: those before were never published.
const OLDEST_FORMAT: i64 = 4;

/// Named values of any JSON type, in the order of their names.
pub type Parameters = BTreeMap<String, Value>;

/// What a store is created with and keeps for life.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StoreProperties {
    /// Secret of the keyed hash that stands for vehicle ids. Made by the caller.
    #[serde(with = "hex_salt")]
    pub salt: [u8; 32],
    /// Level of the tiles that rows lie in (0 to 15).
    pub tile_level: u8,
    /// Creation parameters that the store keeps but does not understand.
    #[serde(default)]
    pub parameters: Parameters,
}

/// The file as a whole. The digest makes a flipped byte visible.
#[derive(Debug, Serialize, Deserialize)]
struct StoreFile {
    format_version: i64,
    digest: String,
    properties: StoreProperties,
}

/// Properties as they were read, with the format they were read from.
#[derive(Debug, Clone)]
pub(crate) struct ReadProperties {
    pub(crate) format_version: i64,
    pub(crate) properties: StoreProperties,
}

/// Stands in the file for its digest while that is computed.
const NO_DIGEST: &str = "0000000000000000000000000000000000000000000000000000000000000000";

fn digest(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// Writes the file, unless there is one already.
pub(crate) fn create(place: &Place, properties: &StoreProperties) -> Result<(), StoreError> {
    let file = StoreFile {
        format_version: FORMAT_VERSION,
        digest: NO_DIGEST.to_owned(),
        properties: properties.clone(),
    };
    let mut text = serde_json::to_string_pretty(&file)
        .map_err(|error| StoreError::encode("write", FILE, error))?;
    text.push('\n');
    let digest = digest(&text);
    place.create_file(FILE, text.replacen(NO_DIGEST, &digest, 1).into())
}

/// Reads the file and refuses formats that are not understood.
pub(crate) fn read(place: &Place) -> Result<ReadProperties, StoreError> {
    let bytes = place
        .read_file(FILE)?
        .ok_or_else(|| StoreError::NotAStore {
            location: place.to_string(),
            reason: format!("there is no {FILE} in it"),
        })?;
    let damaged = |reason: String| StoreError::damaged(place.describe(FILE), reason);
    let text = std::str::from_utf8(&bytes).map_err(|e| damaged(e.to_string()))?;
    let value: Value = serde_json::from_str(text).map_err(|e| damaged(e.to_string()))?;
    let format_version = value
        .get("format_version")
        .and_then(Value::as_i64)
        .ok_or_else(|| damaged("it has no `format_version`".to_owned()))?;
    check_format(place, format_version)?;
    let file: StoreFile = serde_json::from_value(value).map_err(|e| damaged(e.to_string()))?;
    if file.digest != digest(&text.replacen(&file.digest, NO_DIGEST, 1)) {
        return Err(damaged("its digest does not fit its content".to_owned()));
    }
    Ok(ReadProperties {
        format_version,
        properties: file.properties,
    })
}

fn check_format(place: &Place, found: i64) -> Result<(), StoreError> {
    let location = place.to_string();
    if found > FORMAT_VERSION {
        return Err(StoreError::FutureFormat {
            location,
            found,
            known: FORMAT_VERSION,
        });
    }
    if found < OLDEST_FORMAT {
        return Err(StoreError::AncientFormat {
            location,
            found,
            oldest: OLDEST_FORMAT,
        });
    }
    Ok(())
}

/// The salt as 64 hexadecimal digits.
mod hex_salt {
    use std::fmt::Write;

    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(salt: &[u8; 32], out: S) -> Result<S::Ok, S::Error> {
        let mut text = String::with_capacity(64);
        for byte in salt {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        out.serialize_str(&text)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<[u8; 32], D::Error> {
        let text = String::deserialize(input)?;
        let hash = blake3::Hash::from_hex(&text).map_err(|error| {
            D::Error::custom(format!("the salt is no 32 bytes of hex: {error}"))
        })?;
        Ok(*hash.as_bytes())
    }
}
