//! Lines of a lane segmentation: runs of paint in every row, joined where they go on as the line
//! below them did.
//!
//! A mask tells neither instances nor types of marking; two lines that meet before the horizon end
//! up as one that goes on and one that ends.

use tilefold_schemas::observation::{Observation, Place, Seen};

use crate::card::{Activation, Lines};
use crate::chain::{Node, join};
use crate::fit::Placement;
use crate::session::Output;

/// A run wider than this share of the picture is no line along the road.
const MAX_RUN_SHARE: f64 = 0.12;
/// Rows of a chain that say where it goes.
const TAIL_ROWS: usize = 24;
/// How far from where it is expected a run's middle may be, in pixels, and how much more for each
/// row that is lacking.
const AGREE_PX: f64 = 4.0;
const AGREE_PX_PER_ROW: f64 = 0.5;
/// Every so many rows a line has a point.
const ROWS_PER_POINT: usize = 4;

/// A run of paint in a row.
#[derive(Debug, Clone, Copy)]
struct Run {
    middle: f64,
    width: f64,
    probability: f64,
}

/// The lines of a mask, in pixels of the picture.
pub(crate) fn read(card: &Lines, output: &Output<'_>, placement: Placement) -> Vec<Observation> {
    let [_, _, rows, columns] = output.shape[..] else {
        return Vec::new();
    };
    let mut line = vec![0.0; columns];
    let runs: Vec<Vec<Run>> = (0..rows)
        .map(|row| {
            probabilities(card, output, row, &mut line);
            runs(&line, f64::from(card.threshold))
        })
        .collect();
    let node = |row: usize| move |run: &Run| Node { row, x: run.middle };
    let nodes: Vec<Vec<Node>> = (runs.iter().enumerate())
        .map(|(row, runs)| runs.iter().map(node(row)).collect())
        .collect();
    let cost = |chain: &[(usize, usize)], (row, index): (usize, usize)| {
        let (last_row, last) = *chain.last()?;
        let (from, to) = (runs[last_row][last], runs[row][index]);
        let steps = (last_row - row) as f64;
        let expected = from.middle + slope(chain, &nodes) * steps;
        let apart = (expected - to.middle).abs();
        let gate = AGREE_PX + AGREE_PX_PER_ROW * steps + 0.25 * from.width.min(to.width);
        (apart <= gate).then_some(apart + steps)
    };
    let chains = join(&nodes, card.max_gap_rows, cost);
    let line = |chain: &Vec<(usize, usize)>| {
        let runs: Vec<(usize, Run)> = chain
            .iter()
            .map(|&(row, run)| (row, runs[row][run]))
            .collect();
        observation(card, &runs, placement)
    };
    chains.iter().filter_map(line).collect()
}

/// Probability of paint along a row.
fn probabilities(card: &Lines, output: &Output<'_>, row: usize, line: &mut [f64]) {
    let (rows, columns) = (output.shape[2], output.shape[3]);
    let channel = |channel: usize| {
        let from = (channel * rows + row) * columns;
        &output.values[from..from + columns]
    };
    let paint = channel(card.channel);
    match card.activation {
        Activation::None => line
            .iter_mut()
            .zip(paint)
            .for_each(|(p, v)| *p = f64::from(*v)),
        Activation::Sigmoid => {
            let sigmoid = |value: f32| 1.0 / (1.0 + (-f64::from(value)).exp());
            line.iter_mut()
                .zip(paint)
                .for_each(|(p, v)| *p = sigmoid(*v));
        }
        Activation::Softmax => {
            // 1 / sum of exp(other - paint).
            line.fill(0.0);
            for other in (0..card.channels).map(channel) {
                for ((sum, other), paint) in line.iter_mut().zip(other).zip(paint) {
                    *sum += (f64::from(*other) - f64::from(*paint)).exp();
                }
            }
            line.iter_mut().for_each(|sum| *sum = 1.0 / *sum);
        }
    }
}

fn runs(line: &[f64], threshold: f64) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut at = 0;
    while at < line.len() {
        if line[at] < threshold || line[at].is_nan() {
            at += 1;
            continue;
        }
        let length = line[at..].iter().take_while(|p| **p >= threshold).count();
        let weight: f64 = line[at..at + length].iter().sum();
        let moment: f64 = (at..at + length).map(|x| x as f64 * line[x]).sum();
        if length as f64 <= MAX_RUN_SHARE * line.len() as f64 {
            runs.push(Run {
                middle: moment / weight,
                width: length as f64,
                probability: weight / length as f64,
            });
        }
        at += length;
    }
    runs
}

/// Pixels that a chain goes aside for each row up, by least squares over its last rows.
fn slope(chain: &[(usize, usize)], nodes: &[Vec<Node>]) -> f64 {
    let tail = &chain[chain.len().saturating_sub(TAIL_ROWS)..];
    let points = tail.iter().map(|&(row, index)| {
        let node = nodes[row][index];
        (-(node.row as f64), node.x)
    });
    let count = tail.len() as f64;
    let (sum_u, sum_x) = points
        .clone()
        .fold((0.0, 0.0), |sum, (u, x)| (sum.0 + u, sum.1 + x));
    let (mean_u, mean_x) = (sum_u / count, sum_x / count);
    let (uu, ux) = points.fold((0.0, 0.0), |sum, (u, x)| {
        let du = u - mean_u;
        (sum.0 + du * du, sum.1 + du * (x - mean_x))
    });
    // A few rows say nothing yet.
    if tail.len() < 4 { 0.0 } else { ux / uu }
}

fn observation(card: &Lines, runs: &[(usize, Run)], placement: Placement) -> Option<Observation> {
    let score = runs.iter().map(|(_, run)| run.probability).sum::<f64>() / runs.len() as f64;
    if runs.len() < card.min_rows.max(2) || score < f64::from(card.min_score) {
        return None;
    }
    let last = runs.len() - 1;
    let points = runs.iter().enumerate();
    let points = points.filter(|(at, _)| at % ROWS_PER_POINT == 0 || *at == last);
    let pixel =
        |(_, (row, run)): (usize, &(usize, Run))| placement.to_picture([run.middle, *row as f64]);
    Some(Observation {
        seen: Seen::LaneMarking,
        place: Place::Line(points.map(pixel).collect()),
        score: score.clamp(0.0, 1.0),
        marking: Vec::new(),
        color: Vec::new(),
        appearance: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::card::Card;

    fn card() -> Card {
        toml::from_str(
            r#"
            name = "test"
            kind = "lane_segmentation"
            model = "m.onnx"
            sha256 = "00"
            input = { name = "image", width_px = 96, height_px = 64 }
            lines = { output = "ll", channels = 2, channel = 1, min_rows = 10, max_gap_rows = 8 }
            "#,
        )
        .unwrap()
    }

    #[test]
    fn lines_of_a_mask_are_told_apart_over_gaps() {
        let card = card();
        let (columns, rows) = (96, 64);
        let mut values = vec![0.0_f32; 2 * rows * columns];
        values[..rows * columns].fill(3.0);
        let left = |row: usize| 60.0 - row as f64 * 0.8;
        let right = |row: usize| 64.0 + row as f64 * 0.4;
        for row in 4..rows {
            for x in [left(row), right(row)] {
                // The right line is dashed.
                if x > 64.0 && row % 16 < 6 {
                    continue;
                }
                for column in 0..columns {
                    if (column as f64 - x).abs() <= 2.0 {
                        values[(rows + row) * columns + column] = 6.0;
                    }
                }
            }
        }
        let output = Output {
            shape: vec![1, 2, rows, columns],
            values: &values,
        };
        let placement = Placement::new([96, 64], &card.input);
        let found = read(card.lines.as_ref().unwrap(), &output, placement);
        assert_eq!(found.len(), 2, "{found:#?}");
        for observation in &found {
            let Place::Line(points) = &observation.place else {
                panic!("a line");
            };
            assert!(points.len() > 8);
            for [x, y] in points {
                let row = *y as usize;
                let apart = (x - left(row)).abs().min((x - right(row)).abs());
                assert!(apart <= 0.6, "{x} {y}");
            }
        }
    }
}
