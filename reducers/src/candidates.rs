//! Candidates: paint that the map lacks, found by following sightings, and confronted with every
//! pass that looked there.
//!
//! Sightings that touch form a component ([`crate::groups`]); each is worked on in its own plane, so nothing depends
//! on tile borders. Within a component lines are followed (`crate::follow`). Ties are broken by time,
//! vehicle and track, never by order of arrival.

use std::collections::{BTreeMap, BTreeSet};

use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};
use tilefold_schemas::{ChangeRecord, ElementKind, Footprint, Sighting, Verdict, fixed, wkb};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::{MapIndex, MappedElement};
use tilefold_tiler::side::side_visibility;
use tilefold_tiler::station::{Polyline, Projection};
use tilefold_tiler::tile::tile_of;

use crate::chain;
use crate::elements::{SECTION_M, round_degrees};
use crate::explain::{Explained, Weight};
use crate::fold::Fold;
use crate::follow::{Followed, STEP_M, Vertex, follow_all, unit};
use crate::groups::Groups;
use crate::look::{self, Look, Sighted};
use crate::moved::{self, Gone};

/// A vehicle's sighting within this distance along the line is a hit, in metres.
const HIT_REACH_M: f64 = 6.0;
/// How often a line is sighted: clutter, too, lasts long enough for a track.
const SIGHTED: Sighted = Sighted {
    there: 0.8,
    nothing: 0.1,
};
/// Prior that a place where something was sighted has paint that the map lacks.
const PRIOR_ADDED: f64 = 0.02;
/// Neighbouring sections share their passes: see `elements`.
const WORTH: f64 = 1.0 / 3.0;
/// Paint this near to a mapped line is no line of its own, in metres: no lane is narrower.
const BESIDE_M: f64 = 1.9;
/// Nearer than this it is the mapped line even where another one is gone, in metres.
const CLOSE_M: f64 = 1.1;
/// A candidate is at least this long, in metres: clutter runs along with a vehicle for a while.
const MIN_LENGTH_M: f64 = 35.0;
/// A footprint shows a place if it is in its range widened by half a sample, in metres.
const RANGE_SLACK_M: f64 = 3.0;

/// Change records of all additions in `sightings`, by owner tile (that of their first vertex).
#[must_use]
pub fn judge(
    sightings: &[Sighting],
    footprints: &[Footprint],
    map: &MapIndex,
    gone: &Gone,
    tile_level: u32,
    fold: &Fold,
) -> Vec<ChangeRecord> {
    let explained = explain(sightings, footprints, map, gone, tile_level, fold);
    let records = explained.into_iter().map(|explained| explained.record);
    records.collect()
}

/// As [`judge`], with what every vehicle that looked adds to each record.
#[must_use]
pub fn explain(
    sightings: &[Sighting],
    footprints: &[Footprint],
    map: &MapIndex,
    gone: &Gone,
    tile_level: u32,
    fold: &Fold,
) -> Vec<Explained> {
    let looks = LookIndex::new(footprints, map, gone);
    let mut explained: Vec<Explained> = Groups::of_lines(sightings)
        .all()
        .into_iter()
        .flat_map(|component| judge_component(&component, &looks, tile_level, fold))
        .collect();
    explained.sort_by_key(|explained| (explained.record.tile, explained.record.change));
    explained
}

/// How many more vehicles that look well and see nothing there it takes until an addition is no
/// more believed.
#[must_use]
pub fn misses_to_flip(added: &ChangeRecord) -> u32 {
    let unseen = Look {
        visibility: 1.0,
        frames: 0,
        first_ns: 0,
        last_ns: 0,
        best_ns: 0,
    };
    let sections = (added.to_m / SECTION_M).ceil().max(1.0);
    look::misses(
        added,
        PRIOR_ADDED,
        sections * WORTH * unseen.nats(false, SIGHTED),
    )
}

/// Vertices of a sighting; none if its geometry is damaged (the store checks that before).
fn vertices_of(sighting: &Sighting) -> Vec<[f64; 3]> {
    wkb::read(&sighting.geometry).map_or_else(|_| Vec::new(), |geometry| geometry.points)
}

fn judge_component(
    component: &[&Sighting],
    looks: &LookIndex,
    tile_level: u32,
    fold: &Fold,
) -> Vec<Explained> {
    let model_name = fold.model.name();
    let Some(anchor) = component
        .iter()
        .find_map(|s| vertices_of(s).first().copied())
    else {
        return Vec::new();
    };
    let frame = LocalFrame::new([anchor[0], anchor[1], 0.0]);
    let vertices = plane_vertices(component, &frame);
    follow_all(&vertices, fold.quorum)
        .into_iter()
        .flat_map(|line| judge_line(&line, component, &frame, looks, tile_level, model_name))
        .collect()
}

fn plane_vertices(component: &[&Sighting], frame: &LocalFrame) -> Vec<Vertex> {
    let mut vertices = Vec::new();
    for (index, sighting) in component.iter().enumerate() {
        let visibility = fixed::from_q8(sighting.sum_v_q8) / f64::from(sighting.frames.max(1));
        let points: Vec<[f64; 2]> = vertices_of(sighting)
            .iter()
            .map(|&[lon, lat, _]| {
                let [east, north, _] = frame.to_enu([lon, lat, 0.0]);
                [east, north]
            })
            .collect();
        for at in 0..points.len() {
            let (from, to) = (
                points[at.saturating_sub(1)],
                points[(at + 1).min(points.len() - 1)],
            );
            if let Some(along) = unit([to[0] - from[0], to[1] - from[1]]) {
                vertices.push(Vertex {
                    at: points[at],
                    along,
                    vehicle: sighting.vehicle,
                    sighting: index,
                    weight: visibility * visibility,
                });
            }
        }
    }
    vertices
}

/// Footprints by place, in degrees.
struct LookIndex<'a> {
    footprints: &'a [Footprint],
    map: &'a MapIndex,
    gone: &'a Gone,
    tree: RTree<GeomWithData<[f64; 2], usize>>,
}

impl<'a> LookIndex<'a> {
    fn new(footprints: &'a [Footprint], map: &'a MapIndex, gone: &'a Gone) -> Self {
        let places = footprints
            .iter()
            .enumerate()
            .filter(|(_, footprint)| footprint.kinds & (1 << ElementKind::LaneMarking.code()) != 0)
            .map(|(index, footprint)| GeomWithData::new(footprint.place_deg(), index));
        Self {
            footprints,
            map,
            gone,
            tree: RTree::bulk_load(places.collect()),
        }
    }

    /// Whether a mapped line runs so near to a place that paint there is that line, moved a little or
    /// seen double. Where a line is gone beside the place, the paint may be that line, moved: then
    /// other lines may be as near as moved lines come to them.
    fn is_beside_mapped(&self, place: [f64; 2], frame: &LocalFrame) -> bool {
        let (mut nearest_m, mut is_gone_beside) = (f64::INFINITY, false);
        for (element, at) in self.lines_around(place, frame) {
            if self.gone.is_gone(element, at.station_m) {
                is_gone_beside |= at.distance_m <= moved::REACH_M;
            } else {
                nearest_m = nearest_m.min(at.distance_m);
            }
        }
        nearest_m <= if is_gone_beside { CLOSE_M } else { BESIDE_M }
    }

    /// Mapped lines around a place, and where it lies on them.
    fn lines_around(&self, place: [f64; 2], frame: &LocalFrame) -> Vec<(i64, Projection)> {
        let reach = |sign: f64| {
            let corner = place.map(|value| value + sign * moved::REACH_M);
            let [lon, lat, _] = frame.to_wgs84([corner[0], corner[1], 0.0]);
            [lon, lat]
        };
        let around = self.map.within(reach(-1.0), reach(1.0));
        let project = |mapped: &&MappedElement| {
            let points = mapped.element.points.iter();
            let plane = points.map(|&[lon, lat, _]| frame.to_enu([lon, lat, 0.0]));
            let line = Polyline::new(plane.collect::<Vec<_>>()).ok()?;
            Some((mapped.element.id.0, line.project(place)))
        };
        around
            .iter()
            .filter(|mapped| mapped.element.kind == ElementKind::LaneMarking)
            .filter_map(project)
            .collect()
    }

    /// How well each vehicle looked at a place: its best sample.
    fn visibility(&self, place: [f64; 2], frame: &LocalFrame) -> BTreeMap<i64, Look> {
        let [lon, lat, _] = frame.to_wgs84([place[0], place[1], 0.0]);
        // 35 m reaches any trusted range; a degree of longitude is shortest at the poles.
        let reach_lat = 35.0 / 111_000.0;
        let reach_lon = reach_lat / lat.to_radians().cos().max(0.01);
        let around = AABB::from_corners(
            [lon - reach_lon, lat - reach_lat],
            [lon + reach_lon, lat + reach_lat],
        );
        let mut looks: BTreeMap<i64, Look> = BTreeMap::new();
        for entry in self.tree.locate_in_envelope_intersecting(around) {
            let footprint = &self.footprints[entry.data];
            let Some(visibility) = visibility(footprint, place, frame) else {
                continue;
            };
            let look = Look {
                visibility,
                frames: i64::from(footprint.frames),
                first_ns: footprint.at_ns(),
                last_ns: footprint.at_ns(),
                best_ns: footprint.at_ns(),
            };
            let known = looks.entry(footprint.vehicle);
            known.and_modify(|known| known.add(&look)).or_insert(look);
        }
        looks
    }
}

fn visibility(footprint: &Footprint, place: [f64; 2], frame: &LocalFrame) -> Option<f64> {
    let [lon, lat] = footprint.place_deg();
    let [east, north, _] = frame.to_enu([lon, lat, 0.0]);
    let (sin, cos) = footprint.yaw_rad().sin_cos();
    let (dx, dy) = (place[0] - east, place[1] - north);
    let (ahead_m, left_m) = (cos * dx + sin * dy, -sin * dx + cos * dy);
    let metres = |mm: i32| f64::from(mm) * 1e-3;
    let in_range = metres(footprint.range_from_mm) - RANGE_SLACK_M <= ahead_m
        && ahead_m <= metres(footprint.range_to_mm) + RANGE_SLACK_M;
    let in_reach = metres(footprint.right_mm) <= left_m && left_m <= metres(footprint.left_mm);
    let side = side_visibility(left_m);
    (in_range && in_reach).then(|| side * fixed::from_q8(footprint.v_q8))
}

/// Splits a followed line into sections, judges each against the looks, and makes a record of
/// every run of sections that is likely there.
fn judge_line(
    line: &Followed,
    component: &[&Sighting],
    frame: &LocalFrame,
    looks: &LookIndex<'_>,
    tile_level: u32,
    model_name: &str,
) -> Vec<Explained> {
    let nodes_per_section = (SECTION_M / STEP_M) as usize;
    let starts: Vec<usize> = (0..line.nodes.len()).step_by(nodes_per_section).collect();
    let judged: Vec<SectionLooks> = starts
        .iter()
        .map(|&start| SectionLooks::new(line, start, nodes_per_section, frame, looks))
        .collect();
    let logs: Vec<Vec<f64>> = judged
        .iter()
        .map(|section| vec![0.0, section.nats()])
        .collect();
    let prior = [1.0 - PRIOR_ADDED, PRIOR_ADDED];
    let chain = chain::posterior(&logs, &prior, &[vec![1.0, 0.0], vec![0.0, 1.0]]);
    let posterior = chain.posterior;
    let mut records = Vec::new();
    let mut from = 0;
    while from < judged.len() {
        let size = posterior[from..]
            .iter()
            .zip(&judged[from..])
            .take_while(|(p, section)| p[1] >= 0.5 && !section.is_beside_mapped)
            .count();
        let to = from + size;
        if size > 0 {
            let nodes = (
                starts[from],
                (starts[to - 1] + nodes_per_section).min(line.nodes.len() - 1),
            );
            let p_added = posterior[from..to].iter().map(|p| p[1]).sum::<f64>() / size as f64;
            let stretch = &judged[from..to];
            let record = record(
                line, nodes, p_added, stretch, component, frame, tile_level, model_name,
            );
            let weights = || stretch.iter().flat_map(SectionLooks::weights).collect();
            records.extend(record.map(|record| Explained::new(record, weights())));
        }
        from = to.max(from + 1);
    }
    records
}

/// What every vehicle that looked at a section says.
struct SectionLooks {
    is_beside_mapped: bool,
    /// Vehicle, its look, whether it saw the line.
    looks: BTreeMap<i64, (Look, bool)>,
}

impl SectionLooks {
    fn new(
        line: &Followed,
        start: usize,
        size: usize,
        frame: &LocalFrame,
        looks: &LookIndex<'_>,
    ) -> Self {
        let middle = (start + size / 2).min(line.nodes.len() - 1);
        let reach = (HIT_REACH_M / STEP_M) as usize;
        let near = middle.saturating_sub(reach)..(middle + reach + 1).min(line.nodes.len());
        let saw = |vehicle: &i64| {
            line.seen_by[near.clone()]
                .iter()
                .any(|s| s.contains_key(vehicle))
        };
        let is_beside_mapped = looks.is_beside_mapped(line.nodes[middle], frame);
        let looks = looks.visibility(line.nodes[middle], frame);
        Self {
            is_beside_mapped,
            looks: looks
                .into_iter()
                .map(|(vehicle, look)| (vehicle, (look, saw(&vehicle))))
                .collect(),
        }
    }

    /// Log-likelihood ratio of "there" against "nothing there", bounded per vehicle.
    fn nats(&self) -> f64 {
        let sum_fx: i64 = self.weights().map(|weight| weight.nats_fx[1]).sum();
        fixed::to_f64(sum_fx)
    }

    /// What every vehicle that looked adds to that.
    fn weights(&self) -> impl Iterator<Item = Weight> {
        self.looks.iter().map(|(&vehicle, (look, saw))| {
            let nats_fx = fixed::from_f64(WORTH * look.nats(*saw, SIGHTED));
            look.weight(vehicle, *saw, nats_fx)
        })
    }
}

#[allow(
    clippy::too_many_arguments,
    reason = "a record is made of all of them, once"
)]
fn record(
    line: &Followed,
    (from, to): (usize, usize),
    p_added: f64,
    sections: &[SectionLooks],
    component: &[&Sighting],
    frame: &LocalFrame,
    tile_level: u32,
    model_name: &str,
) -> Option<ChangeRecord> {
    let nodes = &line.nodes[from..=to];
    let length_m: f64 = nodes
        .windows(2)
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]))
        .sum();
    let sightings: BTreeSet<usize> = line.seen_by[from..=to]
        .iter()
        .flat_map(|seen| seen.values().flatten().copied())
        .collect();
    // Canonical order is by time: the first is the earliest, whose name the candidate takes.
    let earliest = component[*sightings.first()?];
    if length_m < MIN_LENGTH_M {
        return None;
    }
    let vertices: Vec<[f64; 3]> = nodes
        .iter()
        .map(|&[east, north]| {
            let [lon, lat, _] = frame.to_wgs84([east, north, 0.0]);
            round_degrees([lon, lat, 0.0])
        })
        .collect();
    let vehicles: BTreeSet<i64> = sections
        .iter()
        .flat_map(|s| s.looks.keys().copied())
        .collect();
    let looks = || {
        sections
            .iter()
            .flat_map(|s| s.looks.values().map(|(look, _)| look))
    };
    let best = sightings
        .iter()
        .map(|&index| component[index])
        .max_by_key(|s| {
            (
                s.sum_v_q8,
                std::cmp::Reverse((s.first_ns(), s.vehicle, s.track)),
            )
        })?;
    Some(ChangeRecord {
        tile: tile_of(vertices[0][0], vertices[0][1], tile_level).ok()?.0,
        change: candidate_id(earliest, from),
        element: None,
        content: 0,
        kind: ElementKind::LaneMarking.code(),
        from_m: 0.0,
        to_m: (length_m * 1e3).round() / 1e3,
        verdict: Verdict::Added.code(),
        p_no_change: 1.0 - p_added,
        p_added,
        p_removed: 0.0,
        p_modified: 0.0,
        log_odds: libm::log(p_added.max(1e-300)) - libm::log((1.0 - p_added).max(1e-300)),
        vehicles: vehicles.len() as i32,
        passes: vehicles.len() as i32,
        exposed: looks().map(|look| look.frames).sum(),
        hit: sightings
            .iter()
            .map(|&s| i64::from(component[s].frames))
            .sum(),
        first_ns: looks().map(|look| look.first_ns).min().unwrap_or(0),
        last_ns: looks().map(|look| look.last_ns).max().unwrap_or(0),
        changed_after_ns: None,
        changed_before_ns: None,
        shift_m: None,
        shift_sigma_m: None,
        class_observed: None,
        geometry_old: None,
        geometry_new: Some(wkb::line(&vertices)),
        evidence_fx: 0,
        best_vehicle: best.vehicle,
        best_ns: best.best_ns(),
        fusion_model: model_name.to_owned(),
    })
}

/// The id of a candidate: of its earliest sighting, and of the node of the followed line at which
/// the stretch begins.
pub(crate) fn candidate_id(earliest: &Sighting, from: usize) -> i64 {
    tilefold_schemas::id::hash_text(&format!(
        "{}:{}:{}:{}:{from}",
        earliest.vehicle,
        earliest.channel,
        earliest.first_ns(),
        earliest.track
    ))
}
