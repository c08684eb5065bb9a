//! Lines of one picture, compared point by point: where a line crosses every fourth row.
//!
//! A seen point is right within [`NEAR_PX`] across the line of a true one. Nothing is asked, nor wrong,
//! far away, where a vehicle stands, and beside paint that is worn or hidden.

use std::collections::BTreeMap;

use tilefold_schemas::observation::{MARKINGS, Observation, ObservationFrame, Place, Seen};

use super::score::ByClass;
use super::truth::Picture;

/// Rows between points.
const ROWS_PX: f64 = 4.0;
/// How far across the line two points of one line may lie apart: 3 px of a picture 640 px wide.
const NEAR_PX: f64 = 3.0;
/// Seen paint this near to paint that is not asked for is not wrong.
const BESIDE_PX: f64 = 6.0;
/// A line that leaves a row by more pixels than this lies across the picture and has no point there.
const STEEP: f64 = 10.0;
/// The class of all lines, however they are painted.
pub(super) const ANY: &str = "lane_marking";

/// Where a line crosses a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossing {
    pub(super) x: f64,
    pub(super) row: i64,
    /// Pixels aside a row down.
    slope: f64,
}

impl Crossing {
    pub(super) fn is_near(&self, other: &Self, reach_px: f64) -> bool {
        let across = (1.0 + self.slope * self.slope).sqrt();
        self.row == other.row && (self.x - other.x).abs() <= reach_px * across
    }

    fn y(&self) -> f64 {
        (self.row as f64 + 0.5) * ROWS_PX
    }
}

/// Where a polyline crosses the rows.
pub(super) fn crossings(points: &[[f64; 2]]) -> Vec<Crossing> {
    let mut found = Vec::new();
    for pair in points.windows(2) {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        let (low, high) = (y0.min(y1), y0.max(y1));
        let slope = (x1 - x0) / (y1 - y0);
        if slope.is_nan() || slope.abs() > STEEP {
            continue;
        }
        let row_of = |y: f64| (y / ROWS_PX - 0.5).ceil() as i64;
        for row in row_of(low)..row_of(high) {
            let y = (row as f64 + 0.5) * ROWS_PX;
            found.push(Crossing {
                x: x0 + (y - y0) * slope,
                row,
                slope,
            });
        }
    }
    found
}

/// The true points that are asked for, and those that are not.
pub(super) struct Asked {
    /// With the line's number in the picture.
    pub(super) points: Vec<(usize, Crossing)>,
    beside: Vec<Crossing>,
}

impl Asked {
    pub(super) fn of(picture: &Picture) -> Self {
        let mut asked = Self {
            points: Vec::new(),
            beside: Vec::new(),
        };
        for (number, line) in picture.lines.iter().enumerate() {
            for crossing in line.parts.iter().flat_map(|part| crossings(part)) {
                if line.is_asked && is_open(picture, &crossing) {
                    asked.points.push((number, crossing));
                } else {
                    asked.beside.push(crossing);
                }
            }
        }
        asked
    }

    /// Whether a seen point can be judged.
    pub(super) fn judges(&self, picture: &Picture, seen: &Crossing) -> bool {
        let is_right = self
            .points
            .iter()
            .any(|(_, point)| point.is_near(seen, NEAR_PX));
        is_right
            || is_open(picture, seen)
                && !self
                    .beside
                    .iter()
                    .any(|point| point.is_near(seen, BESIDE_PX))
    }

    /// Numbers of the true lines that pass a seen point.
    pub(super) fn lines_at<'a>(&'a self, seen: &'a Crossing) -> impl Iterator<Item = usize> + 'a {
        let near = self
            .points
            .iter()
            .filter(|(_, point)| point.is_near(seen, NEAR_PX));
        near.map(|(number, _)| *number)
    }
}

/// Whether lines can be seen there: not far away, and no vehicle before it.
fn is_open(picture: &Picture, at: &Crossing) -> bool {
    let mut vehicles = picture
        .boxes
        .iter()
        .filter(|item| item.seen == Some(Seen::Vehicle));
    at.y() >= picture.top_px
        && !vehicles.any(|vehicle| {
            let [left, top, right, bottom] = vehicle.edges;
            (left..=right).contains(&at.x) && (top..=bottom).contains(&at.y())
        })
}

/// How a seen line is painted, if the network says so.
fn marking(observation: &Observation) -> Option<&'static str> {
    let likely = observation
        .marking
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(b.1))?;
    Some(MARKINGS.get(likely.0)?.name())
}

/// Counts the lines of a picture: of any marking, and of each.
pub(super) fn count(
    picture: &Picture,
    frame: &ObservationFrame,
    by_class: &mut ByClass,
    confusion: &mut BTreeMap<String, BTreeMap<String, u64>>,
) {
    let asked = Asked::of(picture);
    let mut seen: Vec<(Crossing, Option<&'static str>)> = Vec::new();
    for observation in &frame.observations {
        if let Place::Line(points) = &observation.place {
            let painted = marking(observation);
            seen.extend(crossings(points).into_iter().map(|point| (point, painted)));
        }
    }
    for (point, painted) in seen
        .iter()
        .filter(|(point, _)| asked.judges(picture, point))
    {
        let truths: Vec<&str> = asked
            .lines_at(point)
            .map(|number| picture.lines[number].marking.as_str())
            .collect();
        found(by_class, ANY, !truths.is_empty());
        if let Some(painted) = painted {
            found(by_class, painted, truths.contains(painted));
        }
    }
    for (number, point) in &asked.points {
        let truth = picture.lines[*number].marking.as_str();
        let near: Vec<Option<&str>> = (seen.iter())
            .filter(|(other, _)| point.is_near(other, NEAR_PX))
            .map(|(_, painted)| *painted)
            .collect();
        wanted(by_class, ANY, !near.is_empty());
        wanted(by_class, truth, near.contains(&Some(truth)));
        if let Some(painted) = near.first().copied().flatten() {
            let row = confusion.entry(truth.to_owned()).or_default();
            *row.entry(painted.to_owned()).or_default() += 1;
        }
    }
}

fn found(by_class: &mut ByClass, class: &str, is_right: bool) {
    let counts = by_class.of(class);
    counts.found += 1;
    counts.found_right += u64::from(is_right);
}

fn wanted(by_class: &mut ByClass, class: &str, is_found: bool) {
    let counts = by_class.of(class);
    counts.wanted += 1;
    counts.wanted_found += u64::from(is_found);
}

#[cfg(test)]
mod tests {
    use super::super::truth::Line;
    use super::*;

    fn line(x: f64, is_asked: bool) -> Line {
        Line {
            id: 1,
            marking: "solid".to_owned(),
            parts: vec![vec![[x, 100.0], [x, 200.0]]],
            is_asked,
        }
    }

    fn observed(x: f64, to: f64) -> Observation {
        Observation {
            seen: Seen::LaneMarking,
            place: Place::Line(vec![[x, to], [x, 100.0]]),
            score: 1.0,
            marking: vec![0.0, -5.0, -5.0, -5.0, -5.0, -5.0, -5.0],
            color: Vec::new(),
            appearance: Vec::new(),
        }
    }

    #[test]
    fn half_of_a_line_is_half_of_its_points() {
        let picture = Picture {
            lines: vec![line(300.0, true), line(400.0, false)],
            ..Picture::default()
        };
        // Half of the first, the second, which is not asked for, and one that is not there.
        let frame = ObservationFrame {
            size_px: [640, 360],
            observations: vec![
                observed(302.0, 150.0),
                observed(401.0, 200.0),
                observed(500.0, 200.0),
            ],
        };
        let (mut by_class, mut confusion) = (ByClass::default(), BTreeMap::new());
        count(&picture, &frame, &mut by_class, &mut confusion);
        let all = by_class.of(ANY);
        assert_eq!((all.wanted, all.wanted_found), (25, 12));
        assert_eq!((all.found, all.found_right), (37, 12));
        assert_eq!(by_class.of("solid"), &mut all_of(25, 12, 37, 12));
        assert_eq!(confusion["solid"]["solid"], 12);
    }

    fn all_of(
        wanted: u64,
        wanted_found: u64,
        found: u64,
        found_right: u64,
    ) -> super::super::score::Counts {
        super::super::score::Counts {
            wanted,
            wanted_found,
            found,
            found_right,
        }
    }

    #[test]
    fn distance_counts_across_the_line() {
        let aslant = crossings(&[[0.0, 100.0], [300.0, 200.0]]);
        let beside = crossings(&[[8.0, 100.0], [308.0, 200.0]]);
        // 8 px aside along the row are 2.5 px across.
        assert!(aslant[5].is_near(&beside[5], NEAR_PX));
        assert!(crossings(&[[0.0, 100.0], [300.0, 101.0]]).is_empty());
    }
}
