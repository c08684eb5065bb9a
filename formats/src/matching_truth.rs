//! Matching truth: which map element each detection of some logs truly is of. A CSV file with the
//! header `vehicle,topic,stamp_ns,detection,element_id,from_share,to_share`, a row a detection, or one
//! for each of its stretches if it is of several elements:
//!
//! | column | |
//! | --- | --- |
//! | `vehicle` | the vehicle's id, as the log's metadata say it |
//! | `topic` | topic of the detections |
//! | `stamp_ns` | header stamp of the message, nanoseconds since the Unix epoch |
//! | `detection` | number of the detection in the message, counted from 0 |
//! | `element_id` | element that it is of; empty for clutter |
//! | `from_share`, `to_share` | the stretch that is of it, by metres ahead: 0 where the detection is nearest, 1 where it is farthest |
//!
//! The last two columns may be left out: then each detection is of one element.
//!
//! An element that the base map lacks is named all the same: whoever compares knows the map.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Most bytes of a matching truth.
pub const MAX_MATCHING_BYTES: u64 = 4 << 30;

const HEADER: [&str; 7] = [
    "vehicle",
    "topic",
    "stamp_ns",
    "detection",
    "element_id",
    "from_share",
    "to_share",
];
/// How many of them there must be.
const NEEDED: usize = 5;

/// A stretch of a detection that is of one element, or of none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// The element.
    pub element: Option<i64>,
    /// From where to where, by metres ahead: 0 where the detection is nearest, 1 where it is farthest.
    pub shares: [f64; 2],
}

/// What a frame's detections are of, by number: a part for each element.
pub type FrameTruth = BTreeMap<usize, Vec<Part>>;

/// Which element each detection is of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MatchingTruth {
    /// By vehicle and topic, then by stamp.
    channels: BTreeMap<(String, String), BTreeMap<i64, FrameTruth>>,
}

/// Why a matching truth cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MatchingTruthError {
    /// The disk said no.
    #[error("matching truth {file}: {source}; check the path and its rights")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// No CSV, or another one.
    #[error("matching truth {file}, {what}; it is CSV with the header {}", HEADER.join(","))]
    Row {
        /// The file.
        file: String,
        /// Where and what is wrong.
        what: String,
    },
}

impl MatchingTruth {
    /// Reads a file.
    ///
    /// # Errors
    /// As [`Self::read`], and if it cannot be opened.
    pub fn read_file(path: &Path) -> Result<Self, MatchingTruthError> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|source| MatchingTruthError::Io {
            file: name.clone(),
            source,
        })?;
        Self::read(BufReader::new(file), &name)
    }

    /// Reads from `source`; `file` is what errors call it. What is beyond [`MAX_MATCHING_BYTES`]
    /// is not read.
    ///
    /// # Errors
    /// If it is no CSV with the columns of this module, or says a detection twice.
    pub fn read(source: impl Read, file: &str) -> Result<Self, MatchingTruthError> {
        let wrong = |what: String| MatchingTruthError::Row {
            file: file.to_owned(),
            what,
        };
        let mut reader = csv::Reader::from_reader(source.take(MAX_MATCHING_BYTES));
        let header = reader.headers().map_err(|error| wrong(error.to_string()))?;
        if header.iter().ne(HEADER) && header.iter().ne(HEADER[..NEEDED].iter().copied()) {
            let found: String = header.iter().collect::<Vec<_>>().join(",");
            let shown: String = found.chars().take(80).collect();
            return Err(wrong(format!("its header is {shown:?}")));
        }
        let mut truth = Self::default();
        for (index, record) in (2_u64..).zip(reader.records()) {
            let record = record.map_err(|error| wrong(error.to_string()))?;
            let fits = truth.add(&record);
            fits.map_err(|what| wrong(format!("row {index} (the header is row 1): {what}")))?;
        }
        Ok(truth)
    }

    fn add(&mut self, record: &csv::StringRecord) -> Result<(), String> {
        let field = |index: usize| record.get(index).unwrap_or_default();
        let stamp_ns = number(field(2), HEADER[2])?;
        let detection = number(field(3), HEADER[3])?;
        let element = match field(4) {
            "" => None,
            text => Some(number(text, HEADER[4])?),
        };
        let shares = match record.len() {
            NEEDED => [0.0, 1.0],
            _ => [number(field(5), HEADER[5])?, number(field(6), HEADER[6])?],
        };
        if !(0.0 <= shares[0] && shares[0] <= shares[1] && shares[1] <= 1.0) {
            return Err(format!(
                "it is of the stretch {shares:?}, not within 0 to 1"
            ));
        }
        let channel = (field(0).to_owned(), field(1).to_owned());
        let frames = self.channels.entry(channel).or_default();
        let frame = frames.entry(stamp_ns).or_default();
        let parts = frame.entry(detection).or_default();
        let is_whole = record.len() == NEEDED && !parts.is_empty();
        if is_whole || parts.iter().any(|known| known.element == element) {
            return Err("it says an element of a detection for the second time".to_owned());
        }
        parts.push(Part { element, shares });
        Ok(())
    }

    /// What the detections of a frame are of; none if the truth does not know the frame.
    #[must_use]
    pub fn frame(&self, vehicle: &str, topic: &str, stamp_ns: i64) -> Option<&FrameTruth> {
        let channel = (vehicle.to_owned(), topic.to_owned());
        self.channels.get(&channel)?.get(&stamp_ns)
    }
}

fn number<T: std::str::FromStr>(text: &str, column: &str) -> Result<T, String> {
    let shown: String = text.chars().take(40).collect();
    text.parse()
        .map_err(|_| format!("{column} is {shown:?}, not a number that fits"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "vehicle,topic,stamp_ns,detection,element_id\n";

    fn read(rows: &str) -> Result<MatchingTruth, String> {
        let text = format!("{HEAD}{rows}");
        MatchingTruth::read(text.as_bytes(), "m.csv").map_err(|error| error.to_string())
    }

    #[test]
    fn frames_are_found_by_vehicle_topic_and_stamp() {
        let truth = read("car,/lanes,7,0,1004\ncar,/lanes,7,1,\ncar,/lanes,8,0,-3\n").unwrap();
        let frame = truth.frame("car", "/lanes", 7).unwrap();
        let whole = |element| {
            vec![Part {
                element,
                shares: [0.0, 1.0],
            }]
        };
        assert_eq!(
            frame,
            &FrameTruth::from([(0, whole(Some(1004))), (1, whole(None))])
        );
        assert_eq!(
            truth.frame("car", "/lanes", 8).unwrap()[&0],
            whole(Some(-3))
        );
        assert_eq!(truth.frame("car", "/other", 7), None);
        assert_eq!(truth.frame("van", "/lanes", 7), None);
        assert_eq!(read("").unwrap(), MatchingTruth::default());
    }

    #[test]
    fn a_detection_may_be_of_several_elements() {
        let head = HEADER.join(",");
        let read = |rows: &str| {
            let text = format!("{head}\n{rows}");
            MatchingTruth::read(text.as_bytes(), "m.csv").map_err(|error| error.to_string())
        };
        let truth = read("car,/lanes,7,0,1004,0,0.4\ncar,/lanes,7,0,1005,0.5,1\n").unwrap();
        let parts = &truth.frame("car", "/lanes", 7).unwrap()[&0];
        let elements: Vec<_> = parts.iter().map(|part| part.element).collect();
        assert_eq!(elements, [Some(1004), Some(1005)]);
        assert!(read("car,/lanes,7,0,4,0,0.4\ncar,/lanes,7,0,4,0.5,1\n").is_err());
        assert!(read("car,/lanes,7,0,4,0.6,0.4\n").is_err());
        assert!(read("car,/lanes,7,0,4,0,NaN\n").is_err());
    }

    #[test]
    fn errors_name_the_row_and_the_column() {
        for (rows, says) in [
            (
                "car,/lanes,7,0,1004\ncar,/lanes,x,0,1\n",
                "row 3 (the header is row 1): stamp_ns is \"x\"",
            ),
            ("car,/lanes,7,-1,1\n", "detection is \"-1\""),
            ("car,/lanes,7,0,1e9\n", "element_id is \"1e9\""),
            ("car,/lanes,7,0,1\ncar,/lanes,7,0,2\n", "second time"),
            ("car,/lanes,7\n", "m.csv"),
        ] {
            let error = read(rows).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
        let other = MatchingTruth::read("a,b\n1,2\n".as_bytes(), "m.csv").unwrap_err();
        assert!(
            other.to_string().contains("its header is \"a,b\""),
            "{other}"
        );
    }
}
