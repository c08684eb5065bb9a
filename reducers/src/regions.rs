//! Changes to regions: what lies beside each other is one thing to look at.
//!
//! Regions are a function of a version's change records alone, whatever tiles these lie in and
//! whatever order they come in. They are made when they are asked for: a change here can join two
//! regions far away, and no tile's layer should be rewritten for that.

use std::collections::{BTreeMap, BTreeSet};

use rstar::RTree;
use rstar::primitives::GeomWithData;
use tilefold_schemas::region::{Region, RegionCount};
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};
use tilefold_tiler::geodesy::LocalFrame;

/// Changes that come nearer than this to each other are of one region, in metres: a lane and a bit.
const BESIDE_M: f64 = 6.0;
/// Places along a geometry at which it is compared, in metres.
const STEP_M: f64 = 3.0;
/// A region's outline keeps this far from its changes, in metres.
const MARGIN_M: f64 = 2.0;
/// Metres of a degree of latitude.
const DEGREE_M: f64 = 111_000.0;

/// The regions of all changes in `records`, by owner tile and first change.
#[must_use]
pub fn regions(records: &[ChangeRecord]) -> Vec<Region> {
    let is_change =
        |record: &&ChangeRecord| Verdict::from_code(record.verdict).is_some_and(Verdict::is_change);
    let mut changes: Vec<&ChangeRecord> = records.iter().filter(is_change).collect();
    changes.sort_by_key(|record| (record.tile, record.change));
    let places: Vec<Vec<[f64; 2]>> = changes.iter().map(|record| places(record)).collect();
    let groups = groups(&places);
    let mut regions: Vec<Region> = groups
        .iter()
        .filter_map(|members| region(members, &changes, &places))
        .collect();
    regions.sort_by_key(|region| (region.tile, region.id));
    regions
}

/// Longitude and latitude of places along a record's geometries, old and new.
fn places(record: &ChangeRecord) -> Vec<[f64; 2]> {
    let geometries = [&record.geometry_old, &record.geometry_new];
    let read = geometries.into_iter().flatten();
    let read = read.filter_map(|geometry| wkb::read(geometry).ok());
    let mut places = Vec::new();
    for geometry in read {
        for pair in geometry.points.windows(2) {
            let [dx, dy] = metres_between(plane(pair[0]), plane(pair[1]));
            let steps = (dx.hypot(dy) / STEP_M).ceil().max(1.0);
            places.extend((0..steps as usize).map(|step| {
                let share = step as f64 / steps;
                [0, 1].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis]))
            }));
        }
        places.extend(geometry.points.last().map(|&last| plane(last)));
    }
    places
}

fn plane([lon, lat, _]: [f64; 3]) -> [f64; 2] {
    [lon, lat]
}

fn metres_between(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    let shrink = libm::cos(from[1].to_radians());
    [
        (to[0] - from[0]) * shrink * DEGREE_M,
        (to[1] - from[1]) * DEGREE_M,
    ]
}

/// Indices of changes in groups of which each lies beside another one.
fn groups(places: &[Vec<[f64; 2]>]) -> Vec<Vec<usize>> {
    let all = places.iter().enumerate();
    let entries = all.flat_map(|(index, places)| {
        places
            .iter()
            .map(move |&place| GeomWithData::new(place, index))
    });
    let tree = RTree::bulk_load(entries.collect());
    let mut is_free = vec![true; places.len()];
    let mut groups = Vec::new();
    for start in 0..places.len() {
        if !std::mem::replace(&mut is_free[start], false) {
            continue;
        }
        let mut members = vec![start];
        let mut next = 0;
        while let Some(&member) = members.get(next) {
            next += 1;
            for other in beside(&places[member], &tree) {
                if std::mem::replace(&mut is_free[other], false) {
                    members.push(other);
                }
            }
        }
        members.sort_unstable();
        groups.push(members);
    }
    groups
}

/// Changes with a place beside one of these.
fn beside(places: &[[f64; 2]], tree: &RTree<GeomWithData<[f64; 2], usize>>) -> BTreeSet<usize> {
    let mut found = BTreeSet::new();
    for &[lon, lat] in places {
        let reach = BESIDE_M / DEGREE_M;
        let reach_lon = reach / libm::cos(lat.to_radians()).max(0.01);
        let around = rstar::AABB::from_corners(
            [lon - reach_lon, lat - reach],
            [lon + reach_lon, lat + reach],
        );
        for near in tree.locate_in_envelope(around) {
            let [dx, dy] = metres_between([lon, lat], *near.geom());
            if dx.hypot(dy) <= BESIDE_M {
                found.insert(near.data);
            }
        }
    }
    found
}

fn region(
    members: &[usize],
    changes: &[&ChangeRecord],
    places: &[Vec<[f64; 2]>],
) -> Option<Region> {
    let records = || members.iter().map(|&member| changes[member]);
    let first = records().next()?;
    let all = members.iter().flat_map(|&member| places[member].iter());
    Some(Region {
        id: tilefold_schemas::id::hash_text(&format!("region of {}", first.change)),
        tile: first.tile,
        changes: records().map(|record| record.change).collect(),
        counts: counts(records()),
        since_ns: records()
            .filter_map(|record| record.changed_before_ns)
            .min(),
        outline: outline(all.copied().collect()),
    })
}

fn counts<'a>(records: impl Iterator<Item = &'a ChangeRecord>) -> Vec<RegionCount> {
    let mut counts: BTreeMap<(ElementKind, Verdict), usize> = BTreeMap::new();
    for record in records {
        let kind = ElementKind::from_code(record.kind);
        if let Some(of) = kind.zip(Verdict::from_code(record.verdict)) {
            *counts.entry(of).or_default() += 1;
        }
    }
    let count = |((kind, verdict), count)| RegionCount {
        kind,
        verdict,
        count,
    };
    counts.into_iter().map(count).collect()
}

/// The convex hull of places with a margin: longitude and latitude, counter-clockwise.
fn outline(places: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let Some(&[lon, lat]) = places.first() else {
        return Vec::new();
    };
    let frame = LocalFrame::new([lon, lat, 0.0]);
    let corners = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    let around = places.into_iter().flat_map(|[lon, lat]| {
        let [east, north, _] = frame.to_enu([lon, lat, 0.0]);
        corners.map(|[x, y]| [east + MARGIN_M * x, north + MARGIN_M * y])
    });
    let degrees = |[east, north]: [f64; 2]| {
        let [lon, lat, _] = frame.to_wgs84([east, north, 0.0]);
        [lon, lat].map(|value| (value * 1e9).round() / 1e9)
    };
    hull(around.collect()).into_iter().map(degrees).collect()
}

/// Andrew's monotone chain: lower half, then upper half.
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for &next in points {
            while let [.., a, b] = chain[..] {
                let turn = (b[0] - a[0]) * (next[1] - a[1]) - (b[1] - a[1]) * (next[0] - a[0]);
                if turn > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(next);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter());
    hull.extend(half(&mut points.iter().rev()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hull_goes_around_once() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let mut points = square.to_vec();
        points.extend([[1.0, 1.0], [1.0, 0.0], [2.0, 0.0]]);
        assert_eq!(hull(points), square);
    }
}
