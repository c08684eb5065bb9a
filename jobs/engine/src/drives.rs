//! The drives that a store has evidence of, told from its chunks.
//!
//! Two chunks of a vehicle are of one drive if what they were made from, context included, overlaps
//! in time. So no chunk of one drive knows anything of another: a drive can be taken out as a whole.

use std::collections::BTreeSet;

use chrono::DateTime;
use tilefold_schemas::{ChunkId, ChunkRow, VehicleKey};

/// One drive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drive {
    /// Its vehicle's key and the second of its first frame (UTC).
    pub id: String,
    /// Its chunks, on all channels.
    pub chunks: BTreeSet<ChunkId>,
    first_ns: i64,
    reached_ns: i64,
}

/// The drives of chunks, by vehicle and time.
#[must_use]
pub fn drives(rows: &[ChunkRow]) -> Vec<Drive> {
    let mut ordered: Vec<&ChunkRow> = rows.iter().collect();
    ordered.sort_by_key(|row| (row.vehicle, row.given_from_ns, row.window));
    let mut drives: Vec<(i64, Drive)> = Vec::new();
    for row in ordered {
        match drives.last_mut() {
            Some((vehicle, drive))
                if *vehicle == row.vehicle && row.given_from_ns <= drive.reached_ns =>
            {
                drive.add(row);
            }
            _ => drives.push((row.vehicle, Drive::begun(row))),
        }
    }
    let named = |(vehicle, drive): (i64, Drive)| Drive {
        id: format!("{}-{}", VehicleKey(vehicle), second(drive.first_ns)),
        ..drive
    };
    drives.into_iter().map(named).collect()
}

fn second(stamp_ns: i64) -> String {
    let time = DateTime::from_timestamp_nanos(stamp_ns);
    time.format("%Y%m%dT%H%M%SZ").to_string()
}

impl Drive {
    fn begun(row: &ChunkRow) -> Self {
        let mut drive = Self {
            id: String::new(),
            chunks: BTreeSet::new(),
            first_ns: row.first_ns,
            reached_ns: row.given_to_ns,
        };
        drive.add(row);
        drive
    }

    fn add(&mut self, row: &ChunkRow) {
        self.chunks.insert(row.chunk());
        self.first_ns = self.first_ns.min(row.first_ns);
        self.reached_ns = self.reached_ns.max(row.given_to_ns);
    }
}
