//! The map stage of a job: units on rayon, each read once and cut into chunks.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use tilefold_schemas::{ChunkId, ChunkRow, SetAside, SetAsideKind, VehicleKey};
use tilefold_tiler::chunk::{self, Chunk};
use tilefold_tiler::recording::Recording;
use tilefold_workers::{Evidence, MapContext, map_chunk};

use crate::logs::{Catalogue, Unit};
use crate::meter::{Meter, Stage};
use crate::perceive::{self, Eye, Perception, Sights};
use crate::progress::Progress;

/// A chunk that was mapped.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// Its row in the store.
    pub row: ChunkRow,
    /// What it testifies.
    pub evidence: Evidence,
}

/// What the map stage of a job made.
#[derive(Debug, Clone, Default)]
pub struct MapOutput {
    /// New or better known chunks, by vehicle, channel and window.
    pub mapped: Vec<Mapped>,
    /// Chunks that the store knew already.
    pub known: u64,
    /// Messages that came more than once.
    pub duplicates: u64,
    /// What was set aside.
    pub set_aside: Vec<SetAside>,
}

/// A chunk of the store.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Known {
    /// Digest of the messages that it was made from.
    pub digest: i64,
    /// How many these were.
    pub messages: i32,
    /// Digest of the network that looked at its pictures; 0 for detections made on the vehicle.
    pub model: i64,
    /// Whether the base map around it has changed since.
    pub is_outdated: bool,
}

impl Known {
    /// What is known of a chunk by its row.
    #[must_use]
    pub fn of(row: &ChunkRow) -> Self {
        Self {
            digest: row.digest,
            messages: row.messages,
            model: row.model,
            is_outdated: row.map == 0,
        }
    }

    /// Whether the same chunk, made from these messages by this model, takes the place of this one.
    /// The greater of two digests wins among equals, so that the order of runs does not matter; but
    /// whoever names another model wants its answer.
    #[must_use]
    pub fn gives_way_to(&self, digest: i64, messages: i32, model: i64) -> bool {
        if model != self.model {
            return true;
        }
        if digest == self.digest {
            return self.is_outdated;
        }
        (messages, digest) > (self.messages, self.digest)
    }
}

/// Chunks of the store.
pub type KnownChunks = BTreeMap<ChunkId, Known>;

/// Maps all units whose chunks the store does not know yet; `perception` looks at their pictures.
#[must_use]
#[expect(clippy::too_many_arguments, reason = "one call joins them all")]
pub fn map_units(
    perception: Option<&Perception>,
    catalogue: &Catalogue,
    units: &[Unit],
    known: &KnownChunks,
    salt: &[u8; 32],
    context: &MapContext,
    meter: &Meter,
    progress: &dyn Progress,
) -> MapOutput {
    let sights = perception.map_or_else(Sights::default, |perception| {
        let find = |unit: &Unit| unseen(catalogue, unit, known, salt, meter);
        let windows: BTreeSet<(Eye, i64)> = units.par_iter().flat_map_iter(find).collect();
        perceive::look(perception, catalogue, &windows, meter, progress)
    });
    progress.begin(Stage::Map, units.len() as u64);
    let job = tracing::Span::current();
    // Whoever is idle takes the largest that is left.
    let mut order: Vec<(usize, &Unit)> = units.iter().enumerate().collect();
    order.sort_by_key(|&(index, unit)| (Reverse(unit.size(catalogue)), index));
    let mut outputs: Vec<(usize, MapOutput)> = order
        .into_iter()
        .par_bridge()
        .map(|(index, unit)| {
            let output = map_unit(&sights, catalogue, unit, known, salt, context, meter);
            let losses = output.set_aside.iter().map(|loss| loss.count).sum();
            // Workers are threads of their own: what they say belongs to the job all the same.
            job.in_scope(|| tell(catalogue, unit, &output, losses));
            progress.advance(Stage::Map, 1, losses);
            progress.measured(meter);
            (index, output)
        })
        .collect();
    progress.end(Stage::Map);
    outputs.sort_by_key(|(index, _)| *index);
    let mut all = MapOutput {
        set_aside: sights.set_aside,
        ..MapOutput::default()
    };
    for (_, output) in outputs {
        all.mapped.extend(output.mapped);
        all.known += output.known;
        all.duplicates += output.duplicates;
        all.set_aside.extend(output.set_aside);
    }
    all.mapped
        .sort_by_key(|mapped| (mapped.row.vehicle, mapped.row.channel, mapped.row.window));
    all
}

/// Says in the log what came of a unit. The vehicle is not named: logs are kept, and read by many.
fn tell(catalogue: &Catalogue, unit: &Unit, output: &MapOutput, set_aside: u64) {
    let log = unit.logs.first().map(|&log| &catalogue.logs[log].path);
    tracing::debug!(
        log = %log.map(|path| path.display().to_string()).unwrap_or_default(),
        first_window = unit.windows.0,
        mapped = output.mapped.len(),
        known = output.known,
        set_aside,
        "unit mapped"
    );
}

/// Windows of cameras whose pictures are needed for chunks of a unit that the store does not know.
fn unseen(
    catalogue: &Catalogue,
    unit: &Unit,
    known: &KnownChunks,
    salt: &[u8; 32],
    meter: &Meter,
) -> BTreeSet<(Eye, i64)> {
    let vehicle = VehicleKey::new(salt, &unit.vehicle);
    let mut windows = BTreeSet::new();
    for (topic, recording) in &unit.read(catalogue, meter).channels {
        if recording.observations.is_empty() {
            continue;
        }
        let all: BTreeSet<i64> = chunk::windows(recording).into_iter().collect();
        let own = |window: &&i64| (unit.windows.0..unit.windows.1).contains(*window);
        for &window in all.iter().filter(own) {
            let chunk = chunk::cut(recording, vehicle, topic, window);
            // What is said of known chunks is said when they are mapped.
            let mut unsaid = MapOutput::default();
            if chunk.is_some_and(|chunk| !is_known(&chunk, known, "", &mut unsaid)) {
                let eye = (unit.vehicle.clone(), topic.clone());
                let needed = all.range(chunk::around(window));
                windows.extend(needed.map(|window| (eye.clone(), *window)));
            }
        }
    }
    windows
}

fn map_unit(
    sights: &Sights,
    catalogue: &Catalogue,
    unit: &Unit,
    known: &KnownChunks,
    salt: &[u8; 32],
    context: &MapContext,
    meter: &Meter,
) -> MapOutput {
    let read = unit.read(catalogue, meter);
    let mut output = MapOutput {
        set_aside: read.set_aside.clone(),
        ..MapOutput::default()
    };
    let vehicle = VehicleKey::new(salt, &unit.vehicle);
    let name = |log: usize| catalogue.logs[log].path.display().to_string();
    let log = unit.logs.first().map(|&log| name(log)).unwrap_or_default();
    for (topic, recording) in &read.channels {
        output.duplicates += recording.duplicates;
        let own = |window: &i64| (unit.windows.0..unit.windows.1).contains(window);
        for window in chunk::windows(recording).into_iter().filter(own) {
            let Some(mut chunk) = chunk::cut(recording, vehicle, topic, window) else {
                continue;
            };
            if is_known(&chunk, known, &log, &mut output) {
                continue;
            }
            let frames_ns = own_frames_ns(&chunk);
            let messages = message_count(&chunk.recording);
            if !chunk.recording.observations.is_empty() {
                let eye = (unit.vehicle.clone(), topic.clone());
                sights.fill(&eye, &mut chunk.recording);
            }
            match meter.time(Stage::Map, || map_chunk(&chunk, context)) {
                Ok(evidence) => {
                    meter.count(Stage::Map, evidence.frames, 0);
                    let losses = evidence.set_aside.iter().cloned();
                    output.set_aside.extend(losses.map(|loss| SetAside {
                        file: log.clone(),
                        topic: Some(topic.clone()),
                        ..loss
                    }));
                    let logs: BTreeSet<String> = read.logs_of(window).map(name).collect();
                    let row = row(
                        (&chunk, &frames_ns, messages),
                        context,
                        topic,
                        logs,
                        &evidence,
                    );
                    output.mapped.push(Mapped { row, evidence });
                }
                Err(error) => output.set_aside.push(
                    SetAside::new(SetAsideKind::Drive, &log, error.to_string())
                        .on(topic)
                        .when(chunk.bounds_ns().0)
                        .times(frames_ns.len() as u64),
                ),
            }
        }
    }
    output
}

/// Whether the store has the chunk already, from these messages or from more of them.
fn is_known(chunk: &Chunk, known: &KnownChunks, log: &str, output: &mut MapOutput) -> bool {
    let Some(known) = known.get(&chunk.id) else {
        return false;
    };
    let is_better = known.gives_way_to(
        chunk.digest,
        message_count(&chunk.recording),
        chunk.recording.model,
    );
    if known.digest == chunk.digest && !is_better {
        output.known += 1;
    } else if !is_better {
        let reason = "the store has evidence of this window from more messages of this vehicle";
        output.set_aside.push(
            SetAside::new(SetAsideKind::Frame, log, reason)
                .when(chunk.bounds_ns().0)
                .times(own_frames_ns(chunk).len() as u64),
        );
    }
    !is_better
}

/// Capture times of the frames of a chunk's own window.
fn own_frames_ns(chunk: &Chunk) -> Vec<i64> {
    let (from_ns, to_ns) = chunk.bounds_ns();
    let frames = chunk.recording.frames_ns();
    frames
        .filter(|stamp_ns| (from_ns..to_ns).contains(stamp_ns))
        .collect()
}

fn message_count(recording: &Recording) -> i32 {
    let count = recording.fixes.len()
        + recording.imu.len()
        + recording.odometry.len()
        + recording.frames_ns().count();
    i32::try_from(count).unwrap_or(i32::MAX)
}

fn row(
    (chunk, own_ns, messages): (&Chunk, &[i64], i32),
    context: &MapContext,
    topic: &str,
    logs: BTreeSet<String>,
    evidence: &Evidence,
) -> ChunkRow {
    let from_ns = chunk.bounds_ns().0;
    let rows = evidence.rows.iter().map(|row| row.tile);
    let sightings = evidence.sightings.iter().map(|row| row.tile);
    let footprints = evidence.footprints.iter().map(|row| row.tile);
    let tiles: BTreeSet<i32> = rows.chain(sightings).chain(footprints).collect();
    let tiles: Vec<String> = tiles.iter().map(i32::to_string).collect();
    let (low, high) = evidence.confronted;
    let (given_from_ns, given_to_ns) = chunk.recording.span_ns().unwrap_or((from_ns, from_ns));
    ChunkRow {
        vehicle: chunk.id.vehicle.0,
        channel: chunk.id.channel,
        window: chunk.id.window,
        digest: chunk.digest,
        method: context.registering.method(),
        model: chunk.recording.model,
        messages,
        tiles: tiles.join(","),
        topic: topic.to_owned(),
        log: logs.into_iter().collect::<Vec<_>>().join("\n"),
        frames: own_ns.len() as i32,
        frames_set_aside: (own_ns.len() as u64).saturating_sub(evidence.frames) as i32,
        first_ns: own_ns.first().copied().unwrap_or(from_ns),
        last_ns: own_ns.last().copied().unwrap_or(from_ns),
        given_from_ns,
        given_to_ns,
        xmin: low[0],
        ymin: low[1],
        xmax: high[0],
        ymax: high[1],
        map: context.map.digest_within(low, high),
    }
}
