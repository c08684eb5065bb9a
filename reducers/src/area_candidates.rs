//! Candidates of areas: stop lines, crosswalks and ground signs that the map lacks, by where vehicles
//! saw one, confronted with every vehicle that looked there.
//!
//! A candidate is begun at the sighting that most vehicles agree with and takes all of these; then the
//! next one is. Ties are broken by time, vehicle and track, never by order of arrival.

use std::collections::{BTreeMap, BTreeSet};

use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};
use tilefold_schemas::evidence::CLASS_BINS;
use tilefold_schemas::{ChangeRecord, ElementKind, Footprint, Sighting, Verdict, fixed, wkb};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::MapIndex;
use tilefold_tiler::station::Polyline;
use tilefold_tiler::tile::tile_of;

use crate::candidates::candidate_id;
use crate::elements::round_degrees;
use crate::explain::{Explained, Weight};
use crate::fold::Fold;
use crate::groups::{Groups, degrees_of};
use crate::look::{self, Look, Sighted};

/// Sightings are of one thing if they lie within this of each other: along the way, where a vehicle's
/// position is worse, and across it, in metres.
const ALONG_M: f64 = 4.0;
const ACROSS_M: f64 = 1.6;
/// Lanes lie nearer to each other than this, in metres.
const LANE_M: f64 = 4.5;
/// Prior that a place where something was sighted has what the map lacks.
const PRIOR_ADDED: f64 = 0.02;
/// How often an area is sighted.
const SIGHTED: Sighted = Sighted {
    there: 0.75,
    nothing: 0.05,
};
/// A sign is read by who drives within this of its direction (cosine of 45 degrees).
const READABLE_COS: f64 = 0.707;
/// An outline and what its place may be off keep this far from the border of what was looked at, in
/// metres.
const MARGIN_M: f64 = 2.5;
/// No footprint reaches farther, in metres.
const REACH_M: f64 = 40.0;

/// A sighting in the plane of its candidate.
#[derive(Debug, Clone)]
struct Seen<'a> {
    sighting: &'a Sighting,
    points: Vec<[f64; 2]>,
    centre: [f64; 2],
    /// Unit vector of the way on which it was seen: the first side of outlines, the left of lines.
    ahead: [f64; 2],
}

/// Records of all areas in `sightings` that the map lacks, by owner tile.
#[must_use]
pub fn judge(
    sightings: &[Sighting],
    footprints: &[Footprint],
    map: &MapIndex,
    tile_level: u32,
    fold: &Fold,
) -> Vec<ChangeRecord> {
    let explained = explain(sightings, footprints, map, tile_level, fold);
    let records = explained.into_iter().map(|explained| explained.record);
    records.collect()
}

/// As [`judge`], with what every vehicle that looked adds to each record.
#[must_use]
pub fn explain(
    sightings: &[Sighting],
    footprints: &[Footprint],
    map: &MapIndex,
    tile_level: u32,
    fold: &Fold,
) -> Vec<Explained> {
    let looks = AreaLooks::new(footprints);
    let mut explained: Vec<Explained> = Vec::new();
    for component in Groups::of_areas(sightings).all() {
        let Some(frame) = component.first().and_then(|sighting| anchor(sighting)) else {
            continue;
        };
        let seen: Vec<Seen<'_>> = component
            .iter()
            .filter_map(|sighting| Seen::new(sighting, &frame))
            .collect();
        let clusters = clusters(&seen, fold.quorum);
        for (rank, cluster) in clusters.iter().enumerate() {
            let cluster = without_lane_aside(cluster, &clusters[..rank]);
            if vehicles(&cluster) < fold.quorum {
                continue;
            }
            let candidate = Candidate::new(&cluster);
            if !candidate.is_mapped(map, &frame) {
                explained.extend(candidate.record(&frame, &looks, tile_level, fold.model.name()));
            }
        }
    }
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
    look::misses(added, PRIOR_ADDED, unseen.nats(false, SIGHTED))
}

fn anchor(sighting: &Sighting) -> Option<LocalFrame> {
    let [lon, lat, _] = *wkb::read(&sighting.geometry).ok()?.points.first()?;
    Some(LocalFrame::new([lon, lat, 0.0]))
}

impl<'a> Seen<'a> {
    fn new(sighting: &'a Sighting, frame: &LocalFrame) -> Option<Self> {
        let geometry = wkb::read(&sighting.geometry).ok()?;
        let points: Vec<[f64; 2]> = geometry.points.iter().map(|&p| plane(frame, p)).collect();
        let (first, last) = (*points.first()?, *points.last()?);
        let is_line = sighting.kind == ElementKind::StopLine.code();
        let to = if is_line { last } else { *points.get(1)? };
        let (east, north) = (to[0] - first[0], to[1] - first[1]);
        let length = east.hypot(north);
        let side = (length > 1e-6).then(|| [east / length, north / length])?;
        Some(Self {
            sighting,
            centre: centre(&points),
            // The map stage draws lines from right to left, and outlines ahead first.
            ahead: if is_line { [side[1], -side[0]] } else { side },
            points,
        })
    }

    fn is_near(&self, other: &Self) -> bool {
        self.is_within(other, ACROSS_M)
    }

    fn is_lane_aside(&self, other: &Self) -> bool {
        self.is_within(other, LANE_M)
    }

    /// Whether the same vehicle saw both at one time.
    fn is_with(&self, other: &Self) -> bool {
        let (one, other) = (self.sighting, other.sighting);
        one.vehicle == other.vehicle
            && one.first_ns() <= other.last_ns()
            && other.first_ns() <= one.last_ns()
    }

    fn is_within(&self, other: &Self, across_m: f64) -> bool {
        let (dx, dy) = (
            other.centre[0] - self.centre[0],
            other.centre[1] - self.centre[1],
        );
        let along = self.ahead[0] * dx + self.ahead[1] * dy;
        let across = -self.ahead[1] * dx + self.ahead[0] * dy;
        let is_sign = self.sighting.kind == ElementKind::GroundSign.code();
        let turn = self.ahead[0] * other.ahead[0] + self.ahead[1] * other.ahead[1];
        along.abs() <= ALONG_M && across.abs() <= across_m && (!is_sign || turn > READABLE_COS)
    }

    fn weight(&self) -> f64 {
        fixed::from_q8(self.sighting.lambda_q8).max(1e-6)
    }
}

fn plane(frame: &LocalFrame, [lon, lat, _]: [f64; 3]) -> [f64; 2] {
    let [east, north, _] = frame.to_enu([lon, lat, 0.0]);
    [east, north]
}

fn centre(points: &[[f64; 2]]) -> [f64; 2] {
    let count = points.len() as f64;
    [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count)
}

/// Groups of sightings of one thing, the best supported first. What lies beside a group and was left
/// over by it is no thing of its own. A group is begun where `quorum` vehicles saw one.
fn clusters<'s, 'a>(seen: &'s [Seen<'a>], quorum: usize) -> Vec<Vec<&'s Seen<'a>>> {
    let near: Vec<Vec<usize>> = seen
        .iter()
        .map(|one| (0..seen.len()).filter(|&i| one.is_near(&seen[i])).collect())
        .collect();
    let mut is_free = vec![true; seen.len()];
    let mut clusters = Vec::new();
    loop {
        let support = |index: usize, is_free: &[bool]| {
            let members = near[index].iter().filter(|&&other| is_free[other]);
            let vehicles: BTreeSet<i64> = members.map(|&i| seen[i].sighting.vehicle).collect();
            vehicles.len()
        };
        let best = (0..seen.len())
            .filter(|&index| is_free[index])
            .map(|index| (std::cmp::Reverse(support(index, &is_free)), index))
            .min();
        let Some((std::cmp::Reverse(vehicles), index)) = best else {
            return clusters;
        };
        if vehicles < quorum {
            return clusters;
        }
        let members: Vec<usize> = near[index]
            .iter()
            .copied()
            .filter(|&other| is_free[other])
            .collect();
        // What is near to any of these, too, is theirs, but does not count.
        for &member in &members {
            for &other in &near[member] {
                is_free[other] = false;
            }
        }
        clusters.push(members.into_iter().map(|index| &seen[index]).collect());
    }
}

/// Sightings of a cluster that are not those of a better supported one by vehicles that believe to be a
/// lane aside: who sees both at once sees two.
fn without_lane_aside<'s, 'a>(
    cluster: &[&'s Seen<'a>],
    better: &[Vec<&'s Seen<'a>>],
) -> Vec<&'s Seen<'a>> {
    let is_beside = |other: &&Vec<&'s Seen<'a>>| other[0].is_lane_aside(cluster[0]);
    let beside: Vec<&Vec<&Seen<'_>>> = better.iter().filter(is_beside).collect();
    let saw_both = |one: &Seen<'_>| {
        beside
            .iter()
            .all(|other| other.iter().any(|other| one.is_with(other)))
    };
    cluster
        .iter()
        .filter(|one| saw_both(one))
        .copied()
        .collect()
}

fn vehicles(cluster: &[&Seen<'_>]) -> usize {
    let vehicles: BTreeSet<i64> = cluster.iter().map(|one| one.sighting.vehicle).collect();
    vehicles.len()
}

/// Something that the map lacks.
struct Candidate<'s, 'a> {
    members: &'s [&'s Seen<'a>],
    points: Vec<[f64; 2]>,
    centre: [f64; 2],
    ahead: [f64; 2],
}

impl<'s, 'a> Candidate<'s, 'a> {
    fn new(members: &'s [&'s Seen<'a>]) -> Self {
        let reference = reference(members);
        let alike = members
            .iter()
            .filter(|member| member.points.len() == reference.points.len());
        let mut points = vec![[0.0; 2]; reference.points.len()];
        let mut total = 0.0;
        for member in alike {
            let weight = member.weight();
            total += weight;
            for (sum, point) in points.iter_mut().zip(turned(&member.points, reference)) {
                *sum = [0, 1].map(|axis| sum[axis] + weight * point[axis]);
            }
        }
        for point in &mut points {
            *point = point.map(|value| value / total);
        }
        Self {
            members,
            centre: centre(&points),
            points,
            ahead: reference.ahead,
        }
    }

    fn kind(&self) -> Option<ElementKind> {
        ElementKind::from_code(self.members[0].sighting.kind)
    }

    /// Whether the map has one of the kind so near that this is it.
    fn is_mapped(&self, map: &MapIndex, frame: &LocalFrame) -> bool {
        let [lon, lat, _] = frame.to_wgs84([self.centre[0], self.centre[1], 0.0]);
        let (dlon, dlat) = degrees_of(2.0 * ALONG_M, lat);
        let near = map.within([lon - dlon, lat - dlat], [lon + dlon, lat + dlat]);
        near.iter()
            .filter(|mapped| Some(mapped.element.kind) == self.kind())
            .any(|mapped| {
                let points = mapped.element.points.iter().map(|&p| plane(frame, p));
                let centre = centre(&points.collect::<Vec<_>>());
                let (dx, dy) = (centre[0] - self.centre[0], centre[1] - self.centre[1]);
                let along = self.ahead[0] * dx + self.ahead[1] * dy;
                let across = -self.ahead[1] * dx + self.ahead[0] * dy;
                along.abs() <= ALONG_M && across.abs() <= ACROSS_M
            })
    }

    fn record(
        &self,
        frame: &LocalFrame,
        looks: &AreaLooks<'_>,
        tile_level: u32,
        model_name: &str,
    ) -> Option<Explained> {
        let kind = self.kind()?;
        let sighted: BTreeSet<i64> = self.members.iter().map(|m| m.sighting.vehicle).collect();
        let looked = looks.at(self, kind, frame);
        let weigh = |(&vehicle, look): (&i64, &Look)| {
            let saw = sighted.contains(&vehicle);
            look.weight(vehicle, saw, fixed::from_f64(look.nats(saw, SIGHTED)))
        };
        let weights: Vec<Weight> = looked.iter().map(weigh).collect();
        let nats_fx: i64 = weights.iter().map(|weight| weight.nats_fx[1]).sum();
        let odds = libm::log(PRIOR_ADDED / (1.0 - PRIOR_ADDED)) + fixed::to_f64(nats_fx);
        let p_added = 1.0 / (1.0 + libm::exp(-odds));
        if p_added < 0.5 {
            return None;
        }
        let vertices: Vec<[f64; 3]> = self
            .points
            .iter()
            .map(|&[east, north]| {
                let [lon, lat, _] = frame.to_wgs84([east, north, 0.0]);
                round_degrees([lon, lat, 0.0])
            })
            .collect();
        let earliest = self.members[0].sighting;
        let best = self.members.iter().map(|m| m.sighting).max_by_key(|s| {
            let order = std::cmp::Reverse((s.first_ns(), s.vehicle, s.track));
            (s.sum_v_q8, order)
        })?;
        let looks = || looked.values();
        let length_m = Polyline::of_element(&vertices).map_or(0.0, |(_, line)| line.length_m());
        let record = ChangeRecord {
            tile: tile_of(vertices[0][0], vertices[0][1], tile_level).ok()?.0,
            change: candidate_id(earliest, 0),
            element: None,
            content: 0,
            kind: kind.code(),
            from_m: 0.0,
            to_m: (length_m * 1e3).round() / 1e3,
            verdict: Verdict::Added.code(),
            p_no_change: 1.0 - p_added,
            p_added,
            p_removed: 0.0,
            p_modified: 0.0,
            log_odds: odds,
            vehicles: looked.len() as i32,
            passes: looked.len() as i32,
            exposed: looks().map(|look| look.frames).sum(),
            hit: (self.members.iter())
                .map(|member| i64::from(member.sighting.frames))
                .sum(),
            first_ns: looks()
                .map(|look| look.first_ns)
                .min()
                .unwrap_or(earliest.first_ns()),
            last_ns: looks()
                .map(|look| look.last_ns)
                .max()
                .unwrap_or(earliest.last_ns()),
            changed_after_ns: None,
            changed_before_ns: None,
            shift_m: None,
            shift_sigma_m: None,
            class_observed: self.class(),
            geometry_old: None,
            geometry_new: Some(match kind {
                ElementKind::StopLine => wkb::line(&vertices),
                _ => wkb::polygon(&vertices),
            }),
            evidence_fx: 0,
            best_vehicle: best.vehicle,
            best_ns: best.best_ns(),
            fusion_model: model_name.to_owned(),
        };
        Some(Explained::new(record, weights))
    }

    /// The class read in most sightings, each counting once; the lower code of equals.
    fn class(&self) -> Option<i16> {
        let mut votes = [0_usize; CLASS_BINS];
        for member in self.members {
            let seen = &member.sighting.seen;
            let most = (1..CLASS_BINS).max_by_key(|&bin| (seen[bin], std::cmp::Reverse(bin)));
            if let Some(bin) = most.filter(|&bin| seen[bin] > 0) {
                votes[bin] += 1;
            }
        }
        let most = (1..CLASS_BINS).max_by_key(|&bin| (votes[bin], std::cmp::Reverse(bin)))?;
        (votes[most] > 0).then_some(most as i16)
    }
}

/// The outline that the others are laid on: the one with most information, the earliest of equals.
fn reference<'s, 'a>(members: &'s [&'s Seen<'a>]) -> &'s Seen<'a> {
    let mut best = members[0];
    for &member in members {
        if member.sighting.lambda_q8 > best.sighting.lambda_q8 {
            best = member;
        }
    }
    best
}

/// The vertices of an outline in the order in which they lie nearest to those of the reference: who
/// comes from the other side begins at another corner.
fn turned(points: &[[f64; 2]], reference: &Seen<'_>) -> Vec<[f64; 2]> {
    let count = points.len();
    let is_line = reference.sighting.kind == ElementKind::StopLine.code();
    let orders = (0..count).map(|turn| -> Vec<usize> {
        match (is_line, turn) {
            (true, 0) => (0..count).collect(),
            (true, _) => (0..count).rev().collect(),
            (false, turn) => (0..count).map(|index| (index + turn) % count).collect(),
        }
    });
    let [dx, dy] = {
        let own = centre(points);
        [reference.centre[0] - own[0], reference.centre[1] - own[1]]
    };
    let misfit = |order: &Vec<usize>| -> f64 {
        let pairs = order.iter().zip(&reference.points);
        pairs
            .map(|(&index, to)| {
                let [x, y] = points[index];
                (x + dx - to[0]).powi(2) + (y + dy - to[1]).powi(2)
            })
            .sum()
    };
    let best = orders.min_by(|a, b| misfit(a).total_cmp(&misfit(b)));
    best.unwrap_or_default()
        .into_iter()
        .map(|index| points[index])
        .collect()
}

/// Footprints of areas by place, in degrees.
struct AreaLooks<'a> {
    footprints: &'a [Footprint],
    tree: RTree<GeomWithData<[f64; 2], usize>>,
}

impl<'a> AreaLooks<'a> {
    fn new(footprints: &'a [Footprint]) -> Self {
        let lines = 1 << ElementKind::LaneMarking.code();
        let of_areas = footprints
            .iter()
            .enumerate()
            .filter(|(_, footprint)| footprint.kinds & lines == 0);
        let places = of_areas.map(|(index, footprint)| {
            let degrees = footprint.place_deg();
            GeomWithData::new(degrees, index)
        });
        Self {
            footprints,
            tree: RTree::bulk_load(places.collect()),
        }
    }

    /// How well each vehicle looked at a candidate; one that saw it looked.
    fn at(
        &self,
        candidate: &Candidate<'_, '_>,
        kind: ElementKind,
        frame: &LocalFrame,
    ) -> BTreeMap<i64, Look> {
        let mut looks: BTreeMap<i64, Look> = BTreeMap::new();
        for member in candidate.members {
            let sighting = member.sighting;
            let visibility = fixed::from_q8(sighting.sum_v_q8) / f64::from(sighting.frames.max(1));
            add(
                &mut looks,
                sighting.vehicle,
                Look {
                    visibility,
                    frames: 0,
                    first_ns: sighting.first_ns(),
                    last_ns: sighting.last_ns(),
                    best_ns: sighting.best_ns(),
                },
            );
        }
        let [lon, lat, _] = frame.to_wgs84([candidate.centre[0], candidate.centre[1], 0.0]);
        let (dlon, dlat) = degrees_of(REACH_M, lat);
        let around = AABB::from_corners([lon - dlon, lat - dlat], [lon + dlon, lat + dlat]);
        for entry in self.tree.locate_in_envelope(around) {
            let footprint = &self.footprints[entry.data];
            let tells = footprint.kinds & (1 << kind.code()) != 0;
            if tells && shows(footprint, candidate, kind, frame) {
                add(
                    &mut looks,
                    footprint.vehicle,
                    Look {
                        visibility: fixed::from_q8(footprint.v_q8),
                        frames: i64::from(footprint.frames),
                        first_ns: footprint.at_ns(),
                        last_ns: footprint.at_ns(),
                        best_ns: footprint.at_ns(),
                    },
                );
            }
        }
        looks
    }
}

fn add(looks: &mut BTreeMap<i64, Look>, vehicle: i64, look: Look) {
    let known = looks.entry(vehicle);
    known.and_modify(|known| known.add(&look)).or_insert(look);
}

/// Whether the whole of a candidate was before a vehicle at a footprint.
fn shows(
    footprint: &Footprint,
    candidate: &Candidate<'_, '_>,
    kind: ElementKind,
    frame: &LocalFrame,
) -> bool {
    let degrees = footprint.place_deg();
    let [east, north] = plane(frame, [degrees[0], degrees[1], 0.0]);
    let yaw_rad = footprint.yaw_rad();
    let (sin, cos) = (libm::sin(yaw_rad), libm::cos(yaw_rad));
    let along = candidate.ahead[0] * cos + candidate.ahead[1] * sin;
    if kind == ElementKind::GroundSign && along <= READABLE_COS {
        return false;
    }
    let metres = |mm: i32| f64::from(mm) * 1e-3;
    candidate.points.iter().all(|&[x, y]| {
        let (dx, dy) = (x - east, y - north);
        let (ahead_m, left_m) = (cos * dx + sin * dy, -sin * dx + cos * dy);
        metres(footprint.range_from_mm) + MARGIN_M <= ahead_m
            && ahead_m <= metres(footprint.range_to_mm) - MARGIN_M
            && metres(footprint.right_mm) <= left_m
            && left_m <= metres(footprint.left_mm)
    })
}
