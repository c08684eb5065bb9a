//! Makes small logs and messages, byte by byte where the dialect is ROS 2.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

use mcap::records::{MessageHeader, Metadata};
use mcap::{WriteOptions, Writer};
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader, ReadReport};
use tilefold_schemas::log::LogMessage;

/// A log in a temporary folder.
pub(crate) struct LogFile {
    _folder: tempfile::TempDir,
    pub(crate) path: PathBuf,
}

impl LogFile {
    pub(crate) fn new(bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("made.mcap");
        std::fs::write(&path, bytes).unwrap();
        Self {
            _folder: folder,
            path,
        }
    }

    /// Everything in it.
    pub(crate) fn read(&self) -> (LogIndex, Vec<LogMessage>, ReadReport) {
        let index = LogIndex::open(&self.path).unwrap();
        let mut messages = Vec::new();
        let report = LogReader::new()
            .read(
                &index,
                |_, _| true,
                ALL_TIME,
                |message| messages.push(message),
            )
            .unwrap();
        (index, messages, report)
    }
}

/// A message to be written.
#[derive(Clone)]
pub(crate) struct Made {
    pub(crate) topic: &'static str,
    pub(crate) schema: &'static str,
    pub(crate) encoding: &'static str,
    pub(crate) log_time: u64,
    pub(crate) payload: Vec<u8>,
}

/// The bytes of a log with these messages.
pub(crate) fn log_bytes(options: WriteOptions, messages: &[Made]) -> Vec<u8> {
    let mut writer: Writer<Cursor<Vec<u8>>> = options.create(Cursor::default()).unwrap();
    writer
        .write_metadata(&Metadata {
            name: "vehicle".to_owned(),
            metadata: BTreeMap::from([("vehicle_id".to_owned(), "car-7".to_owned())]),
        })
        .unwrap();
    for (sequence, made) in messages.iter().enumerate() {
        let schema = writer.add_schema(made.schema, "test", b"").unwrap();
        let channel = writer
            .add_channel(schema, made.topic, made.encoding, &BTreeMap::new())
            .unwrap();
        let header = MessageHeader {
            channel_id: channel,
            sequence: sequence as u32,
            log_time: made.log_time,
            publish_time: made.log_time,
        };
        writer
            .write_to_known_channel(&header, &made.payload)
            .unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Reads one message alone in a log.
pub(crate) fn read_one(made: Made) -> (Vec<LogMessage>, ReadReport) {
    let (index, messages, report) = LogFile::new(&log_bytes(WriteOptions::new(), &[made])).read();
    assert!(index.set_aside.is_empty(), "{:?}", index.set_aside);
    (messages, report)
}

/// Lays out CDR, in either byte order.
pub(crate) struct CdrMaker {
    bytes: Vec<u8>,
    is_little_endian: bool,
}

impl CdrMaker {
    pub(crate) fn new(is_little_endian: bool) -> Self {
        Self {
            bytes: vec![0, u8::from(is_little_endian), 0, 0],
            is_little_endian,
        }
    }

    fn put<const N: usize>(mut self, little: [u8; N]) -> Self {
        while !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0xee);
        }
        let mut value = little;
        if !self.is_little_endian {
            value.reverse();
        }
        self.bytes.extend(value);
        self
    }

    pub(crate) fn u8(self, value: u8) -> Self {
        self.put([value])
    }

    pub(crate) fn u16(self, value: u16) -> Self {
        self.put(value.to_le_bytes())
    }

    pub(crate) fn u32(self, value: u32) -> Self {
        self.put(value.to_le_bytes())
    }

    pub(crate) fn f64s(mut self, values: &[f64]) -> Self {
        for value in values {
            self = self.put(value.to_le_bytes());
        }
        self
    }

    pub(crate) fn octets(self, octets: &[u8]) -> Self {
        let mut this = self.u32(octets.len() as u32);
        this.bytes.extend(octets);
        this
    }

    pub(crate) fn text(self, text: &str) -> Self {
        self.octets(&[text.as_bytes(), &[0]].concat())
    }

    pub(crate) fn header(self, stamp: (u32, u32), frame: &str) -> Self {
        self.u32(stamp.0).u32(stamp.1).text(frame)
    }

    pub(crate) fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// A NavSatFix at `stamp`.
pub(crate) fn fix_cdr(stamp: (u32, u32), latitude_longitude_altitude: [f64; 3]) -> Vec<u8> {
    CdrMaker::new(true)
        .header(stamp, "gnss")
        .u8(2)
        .u16(1)
        .f64s(&latitude_longitude_altitude)
        .f64s(&[4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0])
        .u8(2)
        .finish()
}

/// `count` fixes, a tenth of a second apart.
pub(crate) fn fixes(count: u32) -> Vec<Made> {
    let fix = |at: u32| Made {
        topic: "/gnss",
        schema: "sensor_msgs/msg/NavSatFix",
        encoding: "cdr",
        log_time: 1_000_000_000_000 + u64::from(at) * 100_000_000,
        payload: fix_cdr(
            (1_000 + at / 10, at % 10 * 100_000_000),
            [48.0, 9.0 + f64::from(at) * 1e-5, 300.0],
        ),
    };
    (0..count).map(fix).collect()
}
