//! Boxes of a grid of cells: class probabilities at a box's middle, and distances to its edges.
//!
//! A cell is a box where none of its eight neighbours is likelier to be one of that class; of boxes
//! that overlap, the likeliest stays. Vehicles and paint do not compete.

use tilefold_schemas::observation::{Observation, Place, Seen};

use crate::card::Boxes;
use crate::fit::Placement;
use crate::lines::of_unit_length;
use crate::session::Output;

/// A box in cells of the grid.
struct Candidate {
    seen: Seen,
    score: f64,
    edges: [f64; 4],
    cell: (usize, usize),
}

/// The boxes of an output, in pixels of the picture, the likeliest first.
pub(crate) fn read(card: &Boxes, output: &Output<'_>, placement: Placement) -> Vec<Observation> {
    let [_, _, rows, columns] = output.shape[..] else {
        return Vec::new();
    };
    let at = |channel: usize, row: usize, column: usize| {
        f64::from(output.values[(channel * rows + row) * columns + column])
    };
    let classes = card.seen();
    let mut candidates = Vec::new();
    for (channel, seen) in classes.iter().enumerate() {
        let Some(seen) = *seen else { continue };
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)))
        {
            let score = at(channel, row, column);
            let is_peak = || {
                around((row, column), (rows, columns)).all(|(r, c)| {
                    let other = at(channel, r, c);
                    // Of two equal neighbours the first stands.
                    score > other || (score == other && (row, column) < (r, c))
                })
            };
            if score >= f64::from(card.threshold) && is_peak() {
                let distance = |side: usize| at(classes.len() + side, row, column).max(0.0);
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                candidates.push(Candidate {
                    seen,
                    score,
                    edges: [
                        x - distance(0),
                        y - distance(1),
                        x + distance(2),
                        y + distance(3),
                    ],
                    cell: (row, column),
                });
            }
        }
    }
    let is_box = |edges: &[f64; 4]| {
        edges.iter().all(|edge| edge.is_finite()) && edges[0] < edges[2] && edges[1] < edges[3]
    };
    candidates.retain(|candidate| is_box(&candidate.edges));
    // Stable: equal ones stay in the order of the channels and cells.
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
    let first = classes.len() + 4;
    let observation = |candidate: &Candidate| {
        let (row, column) = candidate.cell;
        let appearance = (first..first + card.appearance).map(|channel| at(channel, row, column));
        Observation {
            seen: candidate.seen,
            place: Place::Box(pixels(
                candidate.edges,
                f64::from(card.stride_px),
                placement,
            )),
            score: candidate.score.clamp(0.0, 1.0),
            marking: Vec::new(),
            color: Vec::new(),
            appearance: of_unit_length(appearance.collect()),
        }
    };
    let stay = suppress(candidates, f64::from(card.max_overlap));
    stay.iter().map(observation).collect()
}

fn around(
    (row, column): (usize, usize),
    (rows, columns): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
    near(row, rows)
        .flat_map(move |r| near(column, columns).map(move |c| (r, c)))
        .filter(move |cell| *cell != (row, column))
}

fn suppress(candidates: Vec<Candidate>, max_overlap: f64) -> Vec<Candidate> {
    let mut stay: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        let is_vehicle = |seen: Seen| seen == Seen::Vehicle;
        let is_known = stay.iter().any(|other| {
            is_vehicle(other.seen) == is_vehicle(candidate.seen)
                && overlap(&other.edges, &candidate.edges) > max_overlap
        });
        if !is_known {
            stay.push(candidate);
        }
    }
    stay
}

/// Intersection over union.
fn overlap(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let area = |edges: &[f64; 4]| (edges[2] - edges[0]).max(0.0) * (edges[3] - edges[1]).max(0.0);
    let common = area(&[
        a[0].max(b[0]),
        a[1].max(b[1]),
        a[2].min(b[2]),
        a[3].min(b[3]),
    ]);
    common / (area(a) + area(b) - common)
}

fn pixels(edges: [f64; 4], stride_px: f64, placement: Placement) -> [f64; 4] {
    let pixel = |x: f64, y: f64| placement.to_picture([x * stride_px - 0.5, y * stride_px - 0.5]);
    let [left, top] = pixel(edges[0], edges[1]);
    let [right, bottom] = pixel(edges[2], edges[3]);
    [left, top, right, bottom]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::card::Card;

    fn card() -> Card {
        toml::from_str(
            r#"
            name = "test"
            kind = "boxes"
            model = "m.onnx"
            sha256 = "00"
            input = { name = "image", width_px = 160, height_px = 96 }
            boxes = { output = "boxes", classes = ["left_arrow", "diamond", "vehicle"] }
            "#,
        )
        .unwrap()
    }

    #[test]
    fn overlapping_paint_is_one_and_a_vehicle_over_it_another() {
        let (rows, columns, channels) = (12, 20, 7);
        let mut values = vec![0.0_f32; channels * rows * columns];
        let mut set = |channel: usize, row: usize, column: usize, value: f32| {
            values[(channel * rows + row) * columns + column] = value;
        };
        for (channel, row, column, score) in [
            (0, 6, 9, 0.9),
            (0, 6, 10, 0.8),
            (1, 7, 9, 0.7),
            (2, 5, 9, 0.6),
        ] {
            set(channel, row, column, score);
            for (side, distance) in [2.0, 1.0, 2.0, 1.5].into_iter().enumerate() {
                set(3 + side, row, column, distance);
            }
        }
        let output = Output {
            shape: vec![1, channels, rows, columns],
            values: &values,
        };
        let card = card();
        let placement = Placement::new([160, 96], &card.input);
        let mut boxes = card.boxes.clone().unwrap();
        boxes.max_overlap = 0.3;
        let found = read(&boxes, &output, placement);
        let seen: Vec<&str> = found.iter().map(|found| found.seen.name()).collect();
        assert_eq!(seen, ["left_arrow", "vehicle"]);
        // Cell (6, 9), middle (9.5, 6.5) cells.
        assert_eq!(found[0].place, Place::Box([59.5, 43.5, 91.5, 63.5]));
        boxes.max_overlap = 1.0;
        assert_eq!(read(&boxes, &output, placement).len(), 3);
    }
}
