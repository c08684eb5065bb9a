//! What a reviewer decided of a change, and the file where that is kept.
//!
//! One JSON object a line, appended and never rewritten: the last line about a change counts, the
//! ones before are its history. A decision is about a change id, which stays the same from version
//! to version; it names the version and the verdict that the reviewer looked at. The layers know
//! nothing of decisions, and no clock is read here: who decides says when.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::ReviewError;

/// Name of the file in the folder of a store.
pub const FILE: &str = "decisions.jsonl";
/// Longest note, in characters.
const MAX_NOTE: usize = 2_000;
/// Longest name of a reviewer, in characters.
const MAX_REVIEWER: usize = 100;
/// Longest line that is read, in bytes.
const MAX_LINE: usize = 64 * 1024;

/// What was said of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Said {
    /// It is so: the map is to be changed.
    Accept,
    /// It is not so.
    Reject,
    /// Not to be said yet.
    Later,
    /// What was said before is taken back.
    Undo,
}

impl Said {
    /// The name in files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Accept => "accept",
            Self::Reject => "reject",
            Self::Later => "later",
            Self::Undo => "undo",
        }
    }
}

/// A decision.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// Id of the change, 16 hexadecimal digits.
    pub change: String,
    /// Element of the map; null for an addition.
    pub element_id: Option<i64>,
    /// Version of the store that was looked at.
    pub version: i64,
    /// What that version says of the change.
    pub verdict: String,
    /// What the reviewer says.
    pub decision: Said,
    /// Why.
    pub note: String,
    /// Who.
    pub reviewer: String,
    /// When, UTC as RFC 3339; not part of anything that is computed.
    pub at: String,
}

impl Decision {
    /// The same without control characters, if it may be kept.
    ///
    /// # Errors
    /// A text is too long, or the id is none.
    pub fn checked(mut self) -> Result<Self, ReviewError> {
        let refused = |why: String| Err(ReviewError::Refused(why));
        let is_id = self.change.len() == 16 && self.change.bytes().all(|b| b.is_ascii_hexdigit());
        if !is_id {
            return refused("a change id has 16 hexadecimal digits".to_owned());
        }
        self.change.make_ascii_lowercase();
        for (what, text, most) in [
            ("note", &mut self.note, MAX_NOTE),
            ("name of the reviewer", &mut self.reviewer, MAX_REVIEWER),
        ] {
            text.retain(|c| !c.is_control() || c == '\n');
            *text = text.trim().to_owned();
            let count = text.chars().count();
            if count > most {
                return refused(format!(
                    "the {what} has {count} characters, at most {most} fit"
                ));
            }
        }
        Ok(self)
    }
}

/// The decisions of a file, by change.
#[derive(Debug, Clone)]
pub struct Decisions {
    path: PathBuf,
    latest: BTreeMap<String, Decision>,
}

impl Decisions {
    /// Reads a file; one that does not exist holds none.
    ///
    /// # Errors
    /// It cannot be read, or a line of it is no decision.
    pub fn read(path: &Path) -> Result<Self, ReviewError> {
        let mut decisions = Self {
            path: path.to_owned(),
            latest: BTreeMap::new(),
        };
        let unread = |source| ReviewError::File {
            path: path.to_owned(),
            source,
        };
        let file = match File::open(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(decisions),
            file => file.map_err(unread)?,
        };
        for (index, line) in BufReader::new(file).lines().enumerate() {
            let line = line.map_err(unread)?;
            if !line.trim().is_empty() {
                decisions.keep(parsed(path, index + 1, &line)?);
            }
        }
        Ok(decisions)
    }

    /// Appends a decision to the file, on the disk when this returns.
    ///
    /// # Errors
    /// It may not be kept, or the file cannot be written.
    pub fn add(&mut self, decision: Decision) -> Result<&Decision, ReviewError> {
        let decision = decision.checked()?;
        let line = serde_json::to_string(&decision)? + "\n";
        let unwritten = |source| ReviewError::File {
            path: self.path.clone(),
            source,
        };
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)
            .map_err(unwritten)?;
        // One call, so that two programs that append do not mix their lines.
        file.write_all(line.as_bytes()).map_err(unwritten)?;
        file.sync_data().map_err(unwritten)?;
        let change = decision.change.clone();
        Ok(self.latest.entry(change).insert_entry(decision).into_mut())
    }

    /// The last word on a change; none where it was taken back.
    #[must_use]
    pub fn of(&self, change: i64) -> Option<&Decision> {
        let decision = self.latest.get(&format!("{change:016x}"))?;
        (decision.decision != Said::Undo).then_some(decision)
    }

    /// The last words on all changes, by id.
    pub fn all(&self) -> impl Iterator<Item = &Decision> {
        let said = self.latest.values();
        said.filter(|decision| decision.decision != Said::Undo)
    }

    fn keep(&mut self, decision: Decision) {
        self.latest.insert(decision.change.clone(), decision);
    }
}

fn parsed(path: &Path, line: usize, text: &str) -> Result<Decision, ReviewError> {
    let refused = |reason: String| ReviewError::NoDecision {
        path: path.to_owned(),
        line,
        reason,
    };
    if text.len() > MAX_LINE {
        return Err(refused(format!("it is longer than {MAX_LINE} bytes")));
    }
    let decision: Decision =
        serde_json::from_str(text).map_err(|error| refused(error.to_string()))?;
    decision
        .checked()
        .map_err(|error| refused(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decision(change: &str, said: Said) -> Decision {
        Decision {
            change: change.to_owned(),
            element_id: Some(7),
            version: 3,
            verdict: "removed".to_owned(),
            decision: said,
            note: "seen on site\u{7}".to_owned(),
            reviewer: "Ada".to_owned(),
            at: "2026-11-23T04:00:00Z".to_owned(),
        }
    }

    #[test]
    fn the_last_word_counts_and_survives_reading() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        let mut kept = Decisions::read(&path).unwrap();
        kept.add(decision("00000000000000ff", Said::Accept))
            .unwrap();
        kept.add(decision("00000000000000FF", Said::Reject))
            .unwrap();
        kept.add(decision("00000000000000aa", Said::Accept))
            .unwrap();
        kept.add(decision("00000000000000aa", Said::Undo)).unwrap();
        let read = Decisions::read(&path).unwrap();
        let last = read.of(0xff).unwrap();
        assert_eq!(last.decision, Said::Reject);
        assert_eq!(last.note, "seen on site");
        assert!(read.of(0xaa).is_none());
        assert_eq!(read.all().count(), 1);
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 4);
    }

    #[test]
    fn what_is_no_decision_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        let good = serde_json::to_string(&decision("00000000000000ff", Said::Later)).unwrap();
        for bad in [
            "{}",
            "accept",
            &good.replace("later", "maybe"),
            &good.replace("00ff", "00fg"),
            &good.replace("\"note\"", "\"surprise\""),
        ] {
            std::fs::write(&path, format!("{good}\n\n{bad}\n")).unwrap();
            let error = Decisions::read(&path).unwrap_err().to_string();
            assert!(error.contains("line 3: this is no decision"), "{error}");
        }
        let long = Decision {
            note: "x".repeat(MAX_NOTE + 1),
            ..decision("00000000000000ff", Said::Accept)
        };
        let error = long.checked().unwrap_err().to_string();
        assert!(error.contains("at most 2000 fit"), "{error}");
    }
}
