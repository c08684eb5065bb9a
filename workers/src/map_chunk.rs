//! The map stage: one chunk in, keyed evidence out. This file only joins its siblings.

use tilefold_schemas::{EvidenceRow, Footprint, SetAside, SetAsideKind, Sighting};
use tilefold_tiler::chunk::Chunk;
use tilefold_tiler::map_index::MapIndex;

use crate::areas::{self, AreaEvidence, Glimpse, Passed, Whose};
use crate::aslant::match_aslant;
use crate::clock;
use crate::cuts::{CrossCut, cut_seen};
use crate::footprint::Footprints;
use crate::frames::FrameTree;
use crate::hidden::{Hidden, Traffic};
use crate::local_map::{LocalMap, Near, degrees_around};
use crate::look::{Look, SeenFrames, place};
use crate::matching::match_lines;
use crate::mounting::{self, Mounting};
use crate::perceived::{Perceived, perceived};
use crate::pose::{PoseError, Trajectory};
use crate::profile::{Profile, seen_profiles};
use crate::register::{Glance, Registering, Registration, register};
use crate::scale;
use crate::sight::Sightings;
use crate::surface::Heights;
use crate::testify::{Frame, Ledger};
use crate::visibility::Zone;

/// How far around the trajectory the map is looked at, in metres.
const MAP_REACH_M: f64 = 60.0;

/// What every chunk is confronted with.
#[derive(Debug)]
pub struct MapContext {
    /// The base map.
    pub map: MapIndex,
    /// Level of the tiles that evidence is keyed by.
    pub tile_level: u32,
    /// Whether poses are laid on the map.
    pub registering: Registering,
}

/// What a chunk testifies.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Evidence {
    /// Ledger rows, by element and section.
    pub rows: Vec<EvidenceRow>,
    /// Unexplained paint.
    pub sightings: Vec<Sighting>,
    /// Where it looked.
    pub footprints: Vec<Footprint>,
    /// Frames of the chunk's own window.
    pub frames: u64,
    /// South-west and north-east corner of the piece of the map that could have an effect, in degrees.
    pub confronted: ([f64; 2], [f64; 2]),
    /// What was found out about the camera's mounting, if detections are in pixels.
    pub mounting: Option<Mounting>,
    /// What poses had to do without, and what was done instead.
    pub without: Vec<&'static str>,
    /// What was not used. The file is left empty: the map stage does not know files.
    pub set_aside: Vec<SetAside>,
}

impl Evidence {
    /// Says by which method it was made, and by which network.
    fn sign(&mut self, method: i32, model: i64) {
        for row in &mut self.rows {
            (row.method, row.model) = (method, model);
        }
        for sighting in &mut self.sightings {
            (sighting.method, sighting.model) = (method, model);
        }
        for footprint in &mut self.footprints {
            (footprint.method, footprint.model) = (method, model);
        }
    }

    fn add_areas(&mut self, areas: AreaEvidence) {
        self.rows.extend(areas.rows);
        self.sightings.extend(areas.sightings);
        self.footprints.extend(areas.footprints);
    }
}

/// Maps one chunk.
///
/// # Errors
/// The chunk has no trajectory: it is set aside as a whole.
pub fn map_chunk(chunk: &Chunk, context: &MapContext) -> Result<Evidence, PoseError> {
    map_chunk_traced(chunk, context, |_, _| {})
}

/// Maps one chunk, and shows every frame of its own window to `trace` as it is written down.
///
/// # Errors
/// As [`map_chunk`].
pub fn map_chunk_traced(
    chunk: &Chunk,
    context: &MapContext,
    mut trace: impl FnMut(&Frame<'_>, &LocalMap<'_>),
) -> Result<Evidence, PoseError> {
    let tree = FrameTree::new(&chunk.recording.static_transforms);
    let seen = perceived(&chunk.recording, &tree);
    let recording = seen.recording.as_ref();
    let local_frame = Trajectory::anchor(recording)?;
    let trajectory = Trajectory::estimate(recording, &local_frame, &tree)?;
    let SeenFrames {
        mut frames,
        pixels,
        without_place_ns,
        no_place,
    } = SeenFrames::collect(recording, &tree);
    let map = LocalMap::around(&context.map, &local_frame, trajectory.places(), MAP_REACH_M);
    let heights = Heights::of(&map, &local_frame);
    let refined = pixels
        .as_ref()
        .map(|pixels| mounting::settle(pixels, &mut frames, &trajectory, &map, heights.as_ref()));
    let clock = clock::estimate(&frames, &trajectory, &map);
    let (mut looks, without_pose_ns) = place(frames, &trajectory, clock.lag_ns);
    let mut evidence = Evidence {
        set_aside: losses(
            chunk,
            clock.lag_ns,
            &without_pose_ns,
            (&without_place_ns, &no_place),
        ),
        mounting: refined.as_ref().map(|(_, mounting)| *mounting),
        confronted: degrees_around(&local_frame, trajectory.places(), MAP_REACH_M),
        without: trajectory.sources.fallbacks().collect(),
        ..Evidence::default()
    };
    evidence.set_aside.extend(of_other_size(chunk, &seen));
    if looks.is_empty() {
        return Ok(evidence);
    }
    let casting = refined.as_ref().map(|(casting, _)| casting);
    if let (Some(casting), Some(pixels)) = (casting, &pixels) {
        casting.cast(pixels, &mut looks);
    }
    let mut cross_cuts = cut(&looks, &map);
    let mapped: Vec<Vec<Profile>> = cross_cuts.iter().map(|c| map.profiles(&c.mapped)).collect();
    let mut registrations = lay_on_map(&looks, &cross_cuts, &mapped, context.registering);
    let mut factor = 1.0;
    // A camera's mounting is more than the scale to the sides.
    if casting.is_none() {
        factor = scale::estimate(&cross_cuts, &registrations);
    }
    if factor != 1.0 {
        scale::stretch(&mut looks, factor);
        // Only what was seen has moved: the map's cuts stand.
        for (cross_cut, look) in cross_cuts.iter_mut().zip(&looks) {
            cross_cut.seen = cut_seen(&look.lines);
        }
        registrations = lay_on_map(&looks, &cross_cuts, &mapped, context.registering);
    }
    for registration in &mut registrations {
        registration.confidence *= clock.confidence;
    }
    let zone = Zone::learn(&looks);

    let traffic = Traffic::new(recording, &tree, casting.map(|casting| &casting.camera));
    let hidden: Vec<Hidden<'_>> = looks
        .iter()
        .map(|look| traffic.at(look.pose.stamp_ns))
        .collect();
    let mut ledger = Ledger::new(chunk.id, &map, &zone);
    let mut sightings = Sightings::default();
    let mut footprints = Footprints::default();
    let ways_m = ways_m(&looks);
    let seen_areas = areas::seen::collect(recording, &tree, casting, factor);
    let (from_ns, to_ns) = chunk.bounds_ns();
    let glimpse = |(index, look): (usize, _)| Glimpse {
        look,
        registration: registrations[index],
        way_m: ways_m[index],
        is_own: (from_ns..to_ns).contains(&look.pose.stamp_ns),
        is_anchored: false,
        hidden: &hidden[index],
        areas: seen_areas
            .get(&look.pose.stamp_ns)
            .map_or(&[][..], Vec::as_slice),
    };
    let mut glimpses: Vec<Glimpse<'_>> = looks.iter().enumerate().map(glimpse).collect();
    let places = looks
        .iter()
        .map(|look| [look.pose.east_m, look.pose.north_m]);
    let (low, high) = degrees_around(&local_frame, places.clone(), MAP_REACH_M);
    let (west_south, east_north) = evidence.confronted;
    evidence.confronted = (
        [0, 1].map(|axis| west_south[axis].min(low[axis])),
        [0, 1].map(|axis| east_north[axis].max(high[axis])),
    );
    let mapped_areas = areas::mapped::around(&context.map, &local_frame, places, MAP_REACH_M);
    let passed = Passed::new(&mapped_areas, &glimpses);
    let mut near = Near::default();
    for (index, look) in looks.iter().enumerate() {
        if !glimpses[index].is_own {
            continue;
        }
        let (cross_cut, registration) = (&cross_cuts[index], registrations[index]);
        let ahead_m = match context.registering {
            Registering::On => passed.drift.at(look.pose.stamp_ns, None).offset_m,
            Registering::Off => 0.0,
        };
        let matches = match_lines(cross_cut, registration.offset_m, ahead_m);
        let moved_m = [ahead_m, registration.offset_m];
        let frame = Frame {
            look,
            cross_cut,
            registration,
            ahead_m,
            aslant: &match_aslant(look, (cross_cut, &matches), moved_m, &map, &mut near),
            matches: &matches,
            hidden: &hidden[index],
            casting,
        };
        trace(&frame, &map);
        ledger.add(&frame);
        if frame.is_anchored() {
            glimpses[index].is_anchored = true;
            sightings.add(&frame, ways_m[index]);
            footprints.add(&frame, ways_m[index]);
        }
        evidence.frames += 1;
    }
    evidence.rows = ledger.into_rows();
    let level = context.tile_level;
    // A vertex on no tile cannot come of a trajectory on the earth; if it does, nothing is said.
    evidence.sightings = sightings
        .into_rows(chunk.id, &local_frame, level)
        .unwrap_or_default();
    evidence.footprints = footprints
        .into_rows(chunk.id, &local_frame, &zone, level)
        .unwrap_or_default();
    let whose = Whose {
        chunk: chunk.id,
        frame: &local_frame,
        tile_level: level,
        first_track: evidence.sightings.len() as i32,
    };
    let of_areas = areas::confront(whose, &mapped_areas, &glimpses, &passed);
    evidence.add_areas(of_areas.unwrap_or_default());
    evidence.sign(context.registering.method(), recording.model);
    Ok(evidence)
}

/// Lateral positions of all looks.
pub(crate) fn cut(looks: &[Look], map: &LocalMap<'_>) -> Vec<CrossCut> {
    let mut near = Near::default();
    looks
        .iter()
        .map(|look| CrossCut::new(look, map, &mut near))
        .collect()
}

/// The error of the poses of all looks; `mapped` are the map lines of their cross-cuts.
fn lay_on_map(
    looks: &[Look],
    cross_cuts: &[CrossCut],
    mapped: &[Vec<Profile>],
    registering: Registering,
) -> Vec<Registration> {
    if registering == Registering::Off {
        return vec![Registration::NONE; looks.len()];
    }
    let seen: Vec<Vec<Profile>> = (looks.iter().zip(cross_cuts))
        .map(|(look, cross_cut)| seen_profiles(&cross_cut.seen, &look.lines))
        .collect();
    let glances: Vec<Glance<'_>> = looks
        .iter()
        .zip(seen.iter().zip(mapped))
        .map(|(look, (seen, mapped))| Glance {
            stamp_ns: look.pose.stamp_ns,
            place_m: [look.pose.east_m, look.pose.north_m],
            seen,
            mapped,
        })
        .collect();
    register(&glances)
}

/// Metres of way at each look since the first.
fn ways_m(looks: &[Look]) -> Vec<f64> {
    let mut way_m = 0.0;
    let mut ways_m = Vec::with_capacity(looks.len());
    for (index, look) in looks.iter().enumerate() {
        if let Some(before) = index.checked_sub(1).map(|before| &looks[before].pose) {
            let (east, north) = (
                look.pose.east_m - before.east_m,
                look.pose.north_m - before.north_m,
            );
            way_m += east.hypot(north);
        }
        ways_m.push(way_m);
    }
    ways_m
}

/// Pictures of the chunk's own window that are not of the calibrated size.
fn of_other_size(chunk: &Chunk, seen: &Perceived<'_>) -> Option<SetAside> {
    let (from_ns, to_ns) = chunk.bounds_ns();
    let own = seen
        .other_size_ns
        .iter()
        .filter(|stamp| (from_ns..to_ns).contains(*stamp));
    let first = *own.clone().next()?;
    let [[width, height], [stated_width, stated_height]] = seen.sizes_px;
    let reason = format!(
        "pictures of {width} x {height} pixels, where the calibration is of {stated_width} x {stated_height}; record the calibration of the pictures that are recorded"
    );
    let loss = SetAside::new(SetAsideKind::Frame, "", reason);
    Some(loss.when(first).times(own.count() as u64))
}

/// Frames of the chunk's own window that could not be used.
fn losses(
    chunk: &Chunk,
    lag_ns: i64,
    without_pose_ns: &[i64],
    (without_place_ns, no_place): (&[i64], &str),
) -> Vec<SetAside> {
    let (from_ns, to_ns) = chunk.bounds_ns();
    let loss = |kind: SetAsideKind, stamps: &[i64], reason: String| {
        let mut own = stamps
            .iter()
            .filter(|stamp| (from_ns..to_ns).contains(*stamp));
        let first = *own.next()?;
        let count = 1 + own.count() as u64;
        let loss = SetAside::new(kind, "", reason);
        Some(loss.when(first).times(count))
    };
    [
        loss(
            SetAsideKind::Uncovered,
            without_pose_ns,
            format!(
                "no position at its capture, which is {:.2} s before its stamp",
                lag_ns as f64 * 1e-9
            ),
        ),
        loss(
            SetAsideKind::Frame,
            without_place_ns,
            format!("detections cannot be brought into the vehicle frame: {no_place}"),
        ),
    ]
    .into_iter()
    .flatten()
    .collect()
}
