//! Boxes of one picture: a seen box is right if it overlaps a true one of its class by half.

use tilefold_schemas::observation::{ObservationFrame, Place};

use super::score::ByClass;
use super::truth::{Box, Picture};

/// Least overlap: intersection over union.
const LEAST_OVERLAP: f64 = 0.5;
/// A seen box that overlaps one that is not asked for by this much is not wrong.
const BESIDE: f64 = 0.3;

/// Intersection over union of two boxes.
pub(super) fn overlap(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let across = (a[2].min(b[2]) - a[0].max(b[0])).max(0.0);
    let down = (a[3].min(b[3]) - a[1].max(b[1])).max(0.0);
    let area = |edges: &[f64; 4]| (edges[2] - edges[0]) * (edges[3] - edges[1]);
    across * down / (area(a) + area(b) - across * down).max(1e-9)
}

/// The true box that each observation is of: the likeliest choose first. None for lines.
pub(super) fn matched(picture: &Picture, frame: &ObservationFrame) -> Vec<Option<usize>> {
    let mut order: Vec<usize> = (0..frame.observations.len()).collect();
    order.sort_by(|&a, &b| {
        frame.observations[b]
            .score
            .total_cmp(&frame.observations[a].score)
    });
    let mut of = vec![None; frame.observations.len()];
    let mut is_taken = vec![false; picture.boxes.len()];
    for index in order {
        let observation = &frame.observations[index];
        let Place::Box(edges) = &observation.place else {
            continue;
        };
        let fits = |item: &Box| {
            item.seen == Some(observation.seen) && overlap(&item.edges, edges) >= LEAST_OVERLAP
        };
        let free = (0..picture.boxes.len()).filter(|&at| !is_taken[at] && fits(&picture.boxes[at]));
        let closeness = |at: &usize| overlap(&picture.boxes[*at].edges, edges);
        let best = free.max_by(|a, b| closeness(a).total_cmp(&closeness(b)));
        if let Some(at) = best {
            is_taken[at] = true;
            of[index] = Some(at);
        }
    }
    of
}

/// Counts the boxes of a picture by class.
pub(super) fn count(picture: &Picture, frame: &ObservationFrame, by_class: &mut ByClass) {
    let of = matched(picture, frame);
    for (observation, truth) in frame.observations.iter().zip(&of) {
        let Place::Box(edges) = &observation.place else {
            continue;
        };
        let is_asked = truth.map(|at| picture.boxes[at].is_asked);
        let is_beside = || {
            (picture.boxes.iter())
                .any(|item| !item.is_asked && overlap(&item.edges, edges) >= BESIDE)
        };
        if is_asked == Some(false) || is_asked.is_none() && is_beside() {
            continue;
        }
        let counts = by_class.of(observation.seen.name());
        counts.found += 1;
        counts.found_right += u64::from(is_asked.is_some());
    }
    for (at, item) in picture
        .boxes
        .iter()
        .enumerate()
        .filter(|(_, item)| item.is_asked)
    {
        if let Some(seen) = item.seen {
            let counts = by_class.of(seen.name());
            counts.wanted += 1;
            counts.wanted_found += u64::from(of.contains(&Some(at)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::observation::{Observation, Seen};

    fn observed(seen: Seen, edges: [f64; 4], score: f64) -> Observation {
        Observation {
            seen,
            place: Place::Box(edges),
            score,
            marking: Vec::new(),
            color: Vec::new(),
            appearance: Vec::new(),
        }
    }

    #[test]
    fn a_box_counts_once_and_for_its_class() {
        let wanted = Box {
            id: 7,
            seen: Some(Seen::Crosswalk),
            edges: [0.0, 0.0, 10.0, 10.0],
            is_asked: true,
        };
        let picture = Picture {
            boxes: vec![wanted],
            ..Picture::default()
        };
        let frame = ObservationFrame {
            size_px: [640, 360],
            observations: vec![
                observed(Seen::Crosswalk, [0.0, 0.0, 10.0, 6.0], 0.5),
                observed(Seen::Crosswalk, [0.0, 0.0, 10.0, 9.0], 0.9),
                observed(Seen::StopLine, [0.0, 0.0, 10.0, 10.0], 0.9),
            ],
        };
        let mut by_class = ByClass::default();
        count(&picture, &frame, &mut by_class);
        let crosswalks = *by_class.of("crosswalk");
        assert_eq!((crosswalks.found, crosswalks.found_right), (2, 1));
        assert_eq!((crosswalks.wanted, crosswalks.wanted_found), (1, 1));
        assert_eq!(by_class.of("stop_line").found_right, 0);
    }
}
