//! Following a line through sightings: from its best supported place both ways, step by step, along
//! the median of what the vehicles saw.

use std::collections::{BTreeMap, BTreeSet};

use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};

/// Step of following, in metres.
pub(crate) const STEP_M: f64 = 2.0;
/// Half length and half width of the window that is looked at in each step, in metres.
const WINDOW_M: (f64, f64) = (4.0, 0.9);
/// A line is followed over at most this much road without a sighting, in metres.
const MAX_GAP_M: f64 = 12.0;
/// A line that comes back to itself this many nodes later is a ring.
const RING_NODES: usize = 6;

/// A vertex of a sighting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vertex {
    pub(crate) at: [f64; 2],
    /// Unit vector along the sighting.
    pub(crate) along: [f64; 2],
    pub(crate) vehicle: i64,
    /// Index of its sighting within the component.
    pub(crate) sighting: usize,
    /// Squared mean visibility: what is seen from the side is placed worse.
    pub(crate) weight: f64,
}

/// A line that was followed, in the plane of its component.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Followed {
    pub(crate) nodes: Vec<[f64; 2]>,
    /// Vehicles that saw it near each node, with the sightings.
    pub(crate) seen_by: Vec<BTreeMap<i64, BTreeSet<usize>>>,
}

pub(crate) fn unit([x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let length = x.hypot(y);
    (length > 1e-9).then(|| [x / length, y / length])
}

/// Follows lines until no place is left that `quorum` vehicles saw.
pub(crate) fn follow_all(vertices: &[Vertex], quorum: usize) -> Vec<Followed> {
    let tree = RTree::bulk_load(
        vertices
            .iter()
            .enumerate()
            .map(|(index, vertex)| GeomWithData::new(vertex.at, index))
            .collect(),
    );
    let mut free = vec![true; vertices.len()];
    // Support only shrinks while vertices are used up, so the order of seeds can be made once.
    let mut seeds: Vec<(std::cmp::Reverse<usize>, usize)> = (0..vertices.len())
        .map(|index| {
            let seed = &vertices[index];
            let window = Window::new(seed.at, seed.along);
            let support = window.gather(&tree, vertices, &free).by_vehicle.len();
            (std::cmp::Reverse(support), index)
        })
        .collect();
    seeds.sort_unstable();
    let mut lines = Vec::new();
    for (_, index) in seeds {
        if !free[index] {
            continue;
        }
        let seed = &vertices[index];
        let support = Window::new(seed.at, seed.along).gather(&tree, vertices, &free);
        if support.by_vehicle.len() < quorum {
            continue;
        }
        let line = follow(seed, &tree, vertices, &free);
        use_up(&line, &tree, vertices, &mut free);
        free[index] = false;
        lines.push(line);
    }
    lines
}

type VertexTree = RTree<GeomWithData<[f64; 2], usize>>;

/// The window around a place of a line.
struct Window {
    at: [f64; 2],
    along: [f64; 2],
}

/// What one vehicle saw in a window: weighted sums over its vertices.
#[derive(Default)]
struct SeenByVehicle {
    across: f64,
    along: [f64; 2],
    weight: f64,
    /// The clearest of its vertices: what the vehicle counts for among others.
    best_weight: f64,
    sightings: BTreeSet<usize>,
}

/// What was seen in a window.
#[derive(Default)]
struct Gathered {
    by_vehicle: BTreeMap<i64, SeenByVehicle>,
}

impl Window {
    fn new(at: [f64; 2], along: [f64; 2]) -> Self {
        Self { at, along }
    }

    /// Distance along and across (left positive) of a place.
    fn coordinates(&self, [east, north]: [f64; 2]) -> (f64, f64) {
        let (dx, dy) = (east - self.at[0], north - self.at[1]);
        let [c, s] = self.along;
        (c * dx + s * dy, -s * dx + c * dy)
    }

    fn indices(&self, tree: &VertexTree, vertices: &[Vertex]) -> Vec<usize> {
        let reach = WINDOW_M.0.hypot(WINDOW_M.1);
        let envelope = AABB::from_corners(
            self.at.map(|value| value - reach),
            self.at.map(|value| value + reach),
        );
        let mut found: Vec<usize> = tree
            .locate_in_envelope_intersecting(envelope)
            .map(|entry| entry.data)
            .filter(|&index| {
                let (along, across) = self.coordinates(vertices[index].at);
                along.abs() <= WINDOW_M.0 && across.abs() <= WINDOW_M.1
            })
            .collect();
        found.sort_unstable();
        found
    }

    fn gather(&self, tree: &VertexTree, vertices: &[Vertex], free: &[bool]) -> Gathered {
        let mut gathered = Gathered::default();
        for index in self.indices(tree, vertices) {
            let vertex = &vertices[index];
            let dot = vertex.along[0] * self.along[0] + vertex.along[1] * self.along[1];
            // Lines that cross are other lines.
            if !free[index] || dot.abs() < 0.9 {
                continue;
            }
            let (_, across) = self.coordinates(vertex.at);
            let entry = gathered.by_vehicle.entry(vertex.vehicle).or_default();
            entry.across += vertex.weight * across;
            entry.along[0] += vertex.weight * vertex.along[0] * dot.signum();
            entry.along[1] += vertex.weight * vertex.along[1] * dot.signum();
            entry.weight += vertex.weight;
            entry.best_weight = entry.best_weight.max(vertex.weight);
            entry.sightings.insert(vertex.sighting);
        }
        gathered
    }
}

impl Gathered {
    /// Weighted median over vehicles of their mean offsets, and the mean direction.
    fn middle(&self) -> Option<(f64, [f64; 2])> {
        let vehicles = || self.by_vehicle.values().filter(|seen| seen.weight > 0.0);
        let mut offsets: Vec<(f64, f64)> = vehicles()
            .map(|seen| (seen.across / seen.weight, seen.best_weight))
            .collect();
        offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = 0.5 * offsets.iter().map(|(_, weight)| weight).sum::<f64>();
        let mut below = 0.0;
        let (across, _) = *offsets.iter().find(|(_, weight)| {
            below += weight;
            below >= half
        })?;
        let mut along = [0.0; 2];
        for seen in vehicles() {
            along[0] += seen.best_weight * seen.along[0] / seen.weight;
            along[1] += seen.best_weight * seen.along[1] / seen.weight;
        }
        Some((across, unit(along)?))
    }

    fn seen_by(self) -> BTreeMap<i64, BTreeSet<usize>> {
        let vehicles = self.by_vehicle.into_iter();
        vehicles
            .map(|(vehicle, seen)| (vehicle, seen.sightings))
            .collect()
    }
}

/// Follows a line from a seed both ways; a ring, once round.
fn follow(seed: &Vertex, tree: &VertexTree, vertices: &[Vertex], free: &[bool]) -> Followed {
    let ahead = follow_one_way(seed.at, seed.along, tree, vertices, free);
    if ahead.is_ring() {
        return ahead;
    }
    let backward = seed.along.map(|value| -value);
    let mut line = follow_one_way(seed.at, backward, tree, vertices, free);
    line.nodes.reverse();
    line.seen_by.reverse();
    // Both begin with the node at the seed.
    line.nodes.extend(ahead.nodes.into_iter().skip(1));
    line.seen_by.extend(ahead.seen_by.into_iter().skip(1));
    line
}

fn follow_one_way(
    mut at: [f64; 2],
    mut along: [f64; 2],
    tree: &VertexTree,
    vertices: &[Vertex],
    free: &[bool],
) -> Followed {
    let mut line = Followed::default();
    let mut gap_m = 0.0;
    while gap_m <= MAX_GAP_M && !line.meets(at, along) {
        let gathered = Window::new(at, along).gather(tree, vertices, free);
        match gathered.middle() {
            Some((across, direction)) => {
                at = [at[0] - across * along[1], at[1] + across * along[0]];
                // Turn half way: one step is short against the radius of any road.
                let turned = [along[0] + direction[0], along[1] + direction[1]];
                along = unit(turned).unwrap_or(along);
                gap_m = 0.0;
            }
            None => gap_m += STEP_M,
        }
        line.nodes.push(at);
        line.seen_by.push(gathered.seen_by());
        at = [at[0] + STEP_M * along[0], at[1] + STEP_M * along[1]];
    }
    while line.seen_by.last().is_some_and(BTreeMap::is_empty) {
        line.seen_by.pop();
        line.nodes.pop();
    }
    line
}

impl Followed {
    /// Whether the line has been at this place before, on the same way: sightings are not used up
    /// while they are followed, and a roundabout would be followed for ever.
    fn meets(&self, at: [f64; 2], along: [f64; 2]) -> bool {
        let earlier = self.nodes.len().saturating_sub(RING_NODES - 1);
        self.nodes[..earlier].windows(2).any(|pair| {
            let way = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let off = [at[0] - pair[0][0], at[1] - pair[0][1]];
            off[0].hypot(off[1]) <= STEP_M && way[0] * along[0] + way[1] * along[1] > 0.0
        })
    }

    /// Whether its end meets its begin.
    fn is_ring(&self) -> bool {
        match (self.nodes.first(), self.nodes.last()) {
            (Some(first), Some(last)) if self.nodes.len() > RING_NODES => {
                (last[0] - first[0]).hypot(last[1] - first[1]) <= 2.0 * STEP_M
            }
            _ => false,
        }
    }
}

fn use_up(line: &Followed, tree: &VertexTree, vertices: &[Vertex], free: &mut [bool]) {
    for pair in line.nodes.windows(2) {
        if let Some(along) = unit([pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]]) {
            for index in Window::new(pair[0], along).indices(tree, vertices) {
                free[index] = false;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS_M: f64 = 40.0;

    /// Sightings by three vehicles of places along a way, a metre apart.
    fn sighted(places: impl Iterator<Item = ([f64; 2], [f64; 2])> + Clone) -> Vec<Vertex> {
        (0..3)
            .flat_map(|vehicle| {
                places.clone().map(move |(at, along)| Vertex {
                    at,
                    along,
                    vehicle,
                    sighting: vehicle as usize,
                    weight: 1.0,
                })
            })
            .collect()
    }

    fn on_ring(radius_m: f64, degree: i32) -> ([f64; 2], [f64; 2]) {
        let angle = f64::from(degree).to_radians();
        let (s, c) = (libm::sin(angle), libm::cos(angle));
        ([radius_m * c, radius_m * s], [-s, c])
    }

    fn length_m(line: &Followed) -> f64 {
        line.nodes
            .windows(2)
            .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]))
            .sum()
    }

    #[test]
    fn a_roundabout_is_followed_once_round() {
        let vertices = sighted((0..360).map(|degree| on_ring(RADIUS_M, degree)));
        let lines = follow_all(&vertices, 2);
        assert_eq!(lines.len(), 1);
        let around_m = 2.0 * std::f64::consts::PI * RADIUS_M;
        assert!(
            (length_m(&lines[0]) - around_m).abs() < 6.0,
            "{}",
            length_m(&lines[0])
        );
    }

    #[test]
    fn a_line_that_leads_into_a_ring_ends() {
        let straight = (0..60).map(|m| ([RADIUS_M, f64::from(m) - 60.0], [0.0, 1.0]));
        let ring = (0..360).map(|degree| on_ring(RADIUS_M, degree));
        let lines = follow_all(&sighted(straight.chain(ring)), 2);
        let all_m: f64 = lines.iter().map(length_m).sum();
        assert!((280.0..340.0).contains(&all_m), "{all_m}");
    }
}
