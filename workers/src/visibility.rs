//! How well a map line could be seen in a frame (method.md, section 6).

use tilefold_tiler::side::side_visibility;

use crate::cuts::{Cut, CutLine, RANGES_M};
use crate::hidden::Hidden;
use crate::look::Look;

/// Lateral noise of a line under the vehicle, in metres, and its growth to the side.
const NEAR_SIGMA_M: f64 = 0.08;
const SIGMA_GROWTH: f64 = 0.04;
/// A range belongs to the zone if it has at least this share of the sightings of the best range.
const ZONE_SHARE: f64 = 0.5;

/// The three parts of visibility, each in `[0, 1]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Visibility {
    /// V_geo: share of the zone in which the channel sees lines that the line crosses, in the image.
    pub geo: f64,
    /// V_occ: what other vehicles leave of it.
    pub occ: f64,
    /// V_dist: how well lines so far to the side are seen.
    pub dist: f64,
}

impl Visibility {
    /// That of a map line, if the vehicle really was `offset_m` to the left of its pose.
    #[must_use]
    pub fn of(mapped: &CutLine, offset_m: f64, zone: &Zone, hidden: &Hidden<'_>) -> Self {
        let points_m = zone
            .cuts(mapped)
            .map(|cut| [RANGES_M[cut.range], cut.lateral_m - offset_m, 0.0])
            .filter(|point_m| hidden.is_in_image(*point_m));
        Self {
            geo: points_m.clone().count() as f64 / zone.size.max(1) as f64,
            occ: hidden.open_share(points_m),
            dist: side_visibility(mapped.lateral_m() - offset_m),
        }
    }

    /// V of the calibrated model: a line that is fully hidden is not visible.
    #[must_use]
    pub fn product(&self) -> f64 {
        self.geo * self.occ * self.dist
    }
}

/// Ranges ahead at which a channel sees lines, learnt from what it saw around the chunk.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    is_seen: [bool; RANGES_M.len()],
    size: usize,
}

impl Zone {
    /// The zone of all looks of a chunk.
    #[must_use]
    pub fn learn(looks: &[Look]) -> Self {
        let mut counts = [0_usize; RANGES_M.len()];
        for line in looks.iter().flat_map(|look| &look.lines) {
            for (count, &range_m) in counts.iter_mut().zip(&RANGES_M) {
                *count += usize::from(line.lateral_m(range_m).is_some());
            }
        }
        let most = counts.iter().copied().max().unwrap_or(0);
        let enough = ((most as f64 * ZONE_SHARE).ceil() as usize).max(1);
        let is_seen = counts.map(|count| count >= enough);
        Self {
            is_seen,
            size: is_seen.iter().filter(|seen| **seen).count(),
        }
    }

    /// Nearest and farthest range of the zone, in metres; none if nothing was ever seen.
    #[must_use]
    pub fn range_m(&self) -> Option<(f64, f64)> {
        let mut ranges = RANGES_M.iter().zip(self.is_seen).filter(|(_, seen)| *seen);
        let nearest = *ranges.next()?.0;
        Some((nearest, ranges.next_back().map_or(nearest, |(far, _)| *far)))
    }

    /// The cuts of a line within the zone.
    pub fn cuts<'a>(&'a self, line: &'a CutLine) -> impl Iterator<Item = &'a Cut> + Clone {
        line.cuts.iter().filter(|cut| self.is_seen[cut.range])
    }
}

/// Lateral noise of a seen line, in metres: on flat-ground projection an error of pitch or height
/// moves a line in proportion to its distance to the side.
#[must_use]
pub fn line_sigma_m(lateral_m: f64) -> f64 {
    NEAR_SIGMA_M + SIGMA_GROWTH * lateral_m.abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::camera;
    use crate::frames::FrameTree;
    use crate::hidden::Traffic;
    use tilefold_tiler::recording::Recording;

    fn line(left_m: f64) -> CutLine {
        let cut = |range| Cut {
            range,
            lateral_m: left_m,
            station_m: 0.0,
        };
        CutLine {
            line: 0,
            ahead_m: [RANGES_M[0], RANGES_M[RANGES_M.len() - 1]],
            cuts: (0..RANGES_M.len()).map(cut).collect(),
        }
    }

    const EVERYWHERE: Zone = Zone {
        is_seen: [true; RANGES_M.len()],
        size: RANGES_M.len(),
    };

    #[test]
    fn without_a_camera_the_zone_is_all_that_limits() {
        let seen = Visibility::of(&line(1.8), 0.0, &EVERYWHERE, &Hidden::default());
        assert_eq!((seen.geo, seen.occ, seen.dist), (1.0, 1.0, 1.0));
        // The vehicle was farther left than its pose: the line is nearer to it.
        let seen = Visibility::of(&line(4.0), 1.8, &EVERYWHERE, &Hidden::default());
        assert_eq!(seen.product(), 1.0);
    }

    #[test]
    fn what_is_outside_the_image_is_not_visible() {
        let (recording, tree, camera) = (Recording::default(), FrameTree::default(), camera());
        let traffic = Traffic::new(&recording, &tree, Some(&camera));
        let geo = |left_m| Visibility::of(&line(left_m), 0.0, &EVERYWHERE, &traffic.at(0)).geo;
        assert!(geo(0.0) > geo(5.0), "{} {}", geo(0.0), geo(5.0));
        assert!(geo(5.0) > 0.3 && geo(0.0) < 1.0);
    }
}
