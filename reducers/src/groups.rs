//! Groups of sightings: what is judged together, because it may be of one thing.
//!
//! Lines belong together where their boxes nearly touch, areas of one kind where they begin near each
//! other; a group is whatever hangs together that way. No group knows of another one, so whoever has
//! all sightings of a group, and all looks around it, has its candidates.

use std::collections::BTreeSet;

use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use tilefold_schemas::{ElementKind, Sighting, wkb};
use tilefold_tiler::map_index::bounds;

/// Lines whose boxes come this near belong together, in degrees (about 5 m).
const TOUCH_DEG: f64 = 5e-5;
/// Areas that begin within this of each other belong together, in metres.
const BESIDE_M: f64 = 8.0;
/// Metres of a degree of latitude.
const DEGREE_M: f64 = 111_000.0;

/// South-west and north-east corner, `[longitude_deg, latitude_deg]`.
pub type Extent = ([f64; 2], [f64; 2]);

/// An extent with a margin in metres.
#[must_use]
pub fn grown((low, high): Extent, margin_m: f64) -> Extent {
    let margin = |latitude_deg: f64| degrees_of(margin_m, latitude_deg);
    let widest = low[1].abs().max(high[1].abs());
    let (dlon, dlat) = margin(widest);
    (
        [low[0] - dlon, low[1] - dlat],
        [high[0] + dlon, high[1] + dlat],
    )
}

/// Degrees of longitude and latitude of a length in metres at a latitude.
pub(crate) fn degrees_of(metres: f64, latitude_deg: f64) -> (f64, f64) {
    let latitude = metres / DEGREE_M;
    let shrink = libm::cos(latitude_deg.to_radians()).max(0.01);
    (latitude / shrink, latitude)
}

type Tree = RTree<GeomWithData<Rectangle<[f64; 2]>, usize>>;

/// Sightings by place, in canonical order.
#[derive(Debug)]
pub struct Groups<'a> {
    ordered: Vec<&'a Sighting>,
    extents: Vec<Extent>,
    /// What reaches into another sighting's surroundings makes one group with it.
    marks: Vec<Extent>,
    by_mark: Tree,
    by_extent: Tree,
}

impl<'a> Groups<'a> {
    /// Of lines.
    #[must_use]
    pub fn of_lines(sightings: impl IntoIterator<Item = &'a Sighting>) -> Self {
        let line = ElementKind::LaneMarking.code();
        Self::new(sightings.into_iter().filter(|one| one.kind == line))
    }

    /// Of areas.
    #[must_use]
    pub fn of_areas(sightings: impl IntoIterator<Item = &'a Sighting>) -> Self {
        let line = ElementKind::LaneMarking.code();
        Self::new(sightings.into_iter().filter(|one| one.kind != line))
    }

    /// Sightings without a place are left out (the store checks geometries before).
    fn new(sightings: impl Iterator<Item = &'a Sighting>) -> Self {
        let placed = sightings.filter_map(|one| {
            let points = wkb::read(&one.geometry).ok()?.points;
            let &[lon, lat, _] = points.first()?;
            let extent = bounds(&points);
            let is_line = one.kind == ElementKind::LaneMarking.code();
            let begin = ([lon, lat], [lon, lat]);
            Some((one, extent, if is_line { extent } else { begin }))
        });
        let mut placed: Vec<_> = placed.collect();
        placed.sort_by_key(|(s, _, _)| (s.first_ns(), s.vehicle, s.channel, s.window, s.track));
        let extents: Vec<Extent> = placed.iter().map(|&(_, extent, _)| extent).collect();
        let marks: Vec<Extent> = placed.iter().map(|&(_, _, mark)| mark).collect();
        Self {
            by_extent: tree(&extents),
            by_mark: tree(&marks),
            ordered: placed
                .into_iter()
                .map(|(sighting, _, _)| sighting)
                .collect(),
            extents,
            marks,
        }
    }

    /// All groups, each in canonical order, by their first sightings.
    #[must_use]
    pub fn all(&self) -> Vec<Vec<&'a Sighting>> {
        let mut taken = BTreeSet::new();
        let starts = 0..self.ordered.len();
        let groups = starts.map(|start| self.group(start, &mut taken));
        let groups = groups.filter(|members| !members.is_empty());
        groups
            .map(|members| {
                members
                    .into_iter()
                    .map(|index| self.ordered[index])
                    .collect()
            })
            .collect()
    }

    /// Numbers of all sightings of the groups of which one reaches into one of `places`.
    #[must_use]
    pub fn meeting(&self, places: &[Extent]) -> BTreeSet<usize> {
        let mut taken = BTreeSet::new();
        for &(low, high) in places {
            let place = AABB::from_corners(low, high);
            for found in self.by_extent.locate_in_envelope_intersecting(place) {
                self.group(found.data, &mut taken);
            }
        }
        taken
    }

    /// Numbers of all sightings.
    #[must_use]
    pub fn numbers(&self) -> BTreeSet<usize> {
        (0..self.ordered.len()).collect()
    }

    /// A sighting by its number.
    #[must_use]
    pub fn sighting(&self, number: usize) -> &'a Sighting {
        self.ordered[number]
    }

    /// Where all of it lies.
    #[must_use]
    pub fn extent(&self, number: usize) -> Extent {
        self.extents[number]
    }

    /// The group of a sighting that is not taken yet, ascending; takes it.
    fn group(&self, start: usize, taken: &mut BTreeSet<usize>) -> Vec<usize> {
        if !taken.insert(start) {
            return Vec::new();
        }
        let mut members = vec![start];
        let mut next = 0;
        while let Some(&member) = members.get(next) {
            next += 1;
            for other in self.touching(member) {
                if taken.insert(other) {
                    members.push(other);
                }
            }
        }
        members.sort_unstable();
        members
    }

    fn touching(&self, member: usize) -> impl Iterator<Item = usize> {
        let (low, high) = self.marks[member];
        let kind = self.ordered[member].kind;
        let (dlon, dlat) = match ElementKind::from_code(kind) {
            Some(ElementKind::LaneMarking) => (TOUCH_DEG, TOUCH_DEG),
            _ => degrees_of(BESIDE_M, low[1]),
        };
        let around = AABB::from_corners(
            [low[0] - dlon, low[1] - dlat],
            [high[0] + dlon, high[1] + dlat],
        );
        let near = self.by_mark.locate_in_envelope_intersecting(around);
        near.map(|found| found.data)
            .filter(move |&other| self.ordered[other].kind == kind)
    }
}

fn tree(extents: &[Extent]) -> Tree {
    let entries = extents.iter().enumerate();
    let entries = entries
        .map(|(index, &(low, high))| GeomWithData::new(Rectangle::from_corners(low, high), index));
    RTree::bulk_load(entries.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of 50 m to the east that begins `east_m` from the origin.
    fn line(track: i32, east_m: f64) -> Sighting {
        let degrees = |metres: f64| metres / 111_195.0;
        let points = [0.0, 25.0, 50.0].map(|at_m| [degrees(east_m + at_m), 0.0, 0.0]);
        Sighting {
            tile: 0,
            vehicle: 1,
            channel: 0,
            window: 0,
            track,
            method: 1,
            model: 0,
            kind: ElementKind::LaneMarking.code(),
            frames: 10,
            sum_v_q8: 1,
            geometry: wkb::line(&points),
            lambda_q8: 1,
            seen: Default::default(),
            first_ms: track,
            last_after_ms: 100,
            best_after_ms: 50,
        }
    }

    #[test]
    fn a_place_finds_whole_groups_and_no_others() {
        // Two that touch, one that touches the second, and one far away.
        let sightings = [line(0, 0.0), line(1, 53.0), line(2, 106.0), line(3, 300.0)];
        let groups = Groups::of_lines(&sightings);
        let begin = ([0.0, 0.0], [1e-6, 1e-6]);
        assert_eq!(groups.meeting(&[begin]), BTreeSet::from([0, 1, 2]));
        let sizes: Vec<usize> = groups.all().iter().map(Vec::len).collect();
        assert_eq!(sizes, [3, 1]);
        assert!(groups.meeting(&[([1.0, 1.0], [1.1, 1.1])]).is_empty());
    }

    #[test]
    fn a_margin_is_wider_in_degrees_of_longitude() {
        let (low, high) = grown(([8.0, 60.0], [8.0, 60.0]), 111.0);
        assert!((high[1] - 60.001).abs() < 1e-9 && (low[1] - 59.999).abs() < 1e-9);
        assert!((high[0] - 8.002).abs() < 1e-6, "{}", high[0]);
    }
}
