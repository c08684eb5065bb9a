//! What Tilefold writes into the `commitInfo` of each commit to `layers`: operation, parameters,
//! pins, and a digest over them, so that a flipped byte in the log is noticed.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::StoreError;
use crate::properties::Parameters;
use crate::version::{Pin, VersionInfo};

/// Key in `commitInfo`.
pub(crate) const KEY: &str = "tilefold";

/// A commit's own words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct JobInfo {
    pub(crate) operation: String,
    pub(crate) parameters: Parameters,
    pub(crate) pins: BTreeMap<String, Pin>,
}

/// The job is kept as text: its digest must survive readers that write numbers in another way.
#[derive(Serialize, Deserialize)]
struct Sealed {
    digest: String,
    job: String,
}

fn digest(version: i64, job: &str) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&version.to_le_bytes());
    hasher.update(job.as_bytes());
    hasher.finalize().to_hex().to_string()
}

/// The value for [`KEY`] in the commit that makes `version`.
pub(crate) fn seal(job: &JobInfo, version: i64) -> Result<Value, StoreError> {
    let refuse = |error| StoreError::encode("describe", "layers", error);
    let job = serde_json::to_string(job).map_err(refuse)?;
    let digest = digest(version, &job);
    serde_json::to_value(Sealed { digest, job }).map_err(refuse)
}

/// Reads a commit file of `layers`; `file` names it in errors.
pub(crate) fn read(version: i64, file: &str, commit: &[u8]) -> Result<VersionInfo, StoreError> {
    let damaged = |reason: &str| StoreError::damaged(file, reason);
    let info = commit_info(commit).ok_or_else(|| damaged("it has no readable commitInfo"))?;
    let sealed = info
        .get(KEY)
        .cloned()
        .ok_or_else(|| damaged("the commit was not made by Tilefold"))?;
    let sealed: Sealed =
        serde_json::from_value(sealed).map_err(|error| damaged(&error.to_string()))?;
    if sealed.digest != digest(version, &sealed.job) {
        return Err(damaged("its digest does not fit its content"));
    }
    let job: JobInfo =
        serde_json::from_str(&sealed.job).map_err(|error| damaged(&error.to_string()))?;
    let timestamp_ms = info.get("timestamp").and_then(Value::as_i64).unwrap_or(0);
    Ok(VersionInfo {
        version,
        timestamp_ms,
        operation: job.operation,
        parameters: job.parameters,
        pins: job.pins,
    })
}

fn commit_info(commit: &[u8]) -> Option<Value> {
    let text = std::str::from_utf8(commit).ok()?;
    text.lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .find_map(|mut action| action.get_mut("commitInfo").map(Value::take))
}
