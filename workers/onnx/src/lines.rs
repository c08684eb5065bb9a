//! Lines of a line-anchor network: a grid of cells that say where a line passes their row and where
//! it is one row up and down (docs/decisions/0022).
//!
//! Cells that are maxima along their row are joined where the upper end of one and the lower end of
//! the other agree. A chain is one line: base point, chord and offsets to it are all in its points.

use tilefold_schemas::observation::{Observation, Place, Seen};

use crate::card::Lines;
use crate::chain::{Node, join};
use crate::fit::Placement;
use crate::network::{COLORS, GEOMETRY, MARKINGS};
use crate::session::Output;

/// Two cells of a row that mean places nearer than this (in cells) mean the same one.
const SAME_CELLS: f64 = 1.0;
/// How far two ends may be apart to agree, in cells, and how much more for each cell that the line
/// goes aside in a row.
const AGREE_CELLS: f64 = 1.0;
const AGREE_SHARE: f64 = 0.25;

/// The output as cells.
struct Grid<'a> {
    values: &'a [f32],
    rows: usize,
    columns: usize,
}

impl Grid<'_> {
    fn at(&self, channel: usize, row: usize, column: usize) -> f64 {
        f64::from(self.values[(channel * self.rows + row) * self.columns + column])
    }

    /// Places along a row where a line passes, with their columns.
    fn passes(&self, row: usize, threshold: f64) -> Vec<(f64, usize)> {
        let probability = |column: usize| self.at(0, row, column);
        let is_peak = |column: &usize| {
            let here = probability(*column);
            here >= threshold
                && (*column == 0 || here > probability(column - 1))
                && (column + 1 == self.columns || here >= probability(column + 1))
        };
        let x = |column: usize| column as f64 + 0.5 + self.at(1, row, column);
        let mut found: Vec<(f64, usize)> = Vec::new();
        for column in (0..self.columns).filter(is_peak) {
            match found.last_mut() {
                Some(last) if (x(column) - last.0).abs() < SAME_CELLS => {
                    if probability(column) > probability(last.1) {
                        *last = (x(column), column);
                    }
                }
                _ => found.push((x(column), column)),
            }
        }
        found.retain(|(x, _)| x.is_finite());
        found
    }
}

/// The lines of an output, in pixels of the picture.
pub(crate) fn read(card: &Lines, output: &Output<'_>, placement: Placement) -> Vec<Observation> {
    let [_, _, rows, columns] = output.shape[..] else {
        return Vec::new();
    };
    let grid = Grid {
        values: output.values,
        rows,
        columns,
    };
    let passes: Vec<Vec<(f64, usize)>> = (0..rows)
        .map(|row| grid.passes(row, f64::from(card.threshold)))
        .collect();
    let node = |row: usize| move |&(x, _): &(f64, usize)| Node { row, x };
    let nodes: Vec<Vec<Node>> = (passes.iter().enumerate())
        .map(|(row, passes)| passes.iter().map(node(row)).collect())
        .collect();
    let cost = |chain: &[(usize, usize)], (row, index): (usize, usize)| {
        let (last_row, last) = *chain.last()?;
        let (low_x, low_column) = passes[last_row][last];
        let (high_x, high_column) = passes[row][index];
        let steps = (last_row - row) as f64;
        let up = grid.at(2, last_row, low_column) * steps;
        let down = grid.at(3, row, high_column) * steps;
        let gate = AGREE_CELLS + AGREE_SHARE * up.abs().max(down.abs());
        let apart = [(low_x + up - high_x).abs(), (high_x + down - low_x).abs()];
        let is_near = apart.iter().all(|apart| *apart <= gate);
        is_near.then_some((apart[0] + apart[1]) / gate + steps)
    };
    let chains = join(&nodes, card.max_gap_rows, cost);
    let line = |chain: &Vec<(usize, usize)>| {
        let cells: Vec<(usize, usize, f64)> = chain
            .iter()
            .map(|&(row, index)| (row, passes[row][index].1, passes[row][index].0))
            .collect();
        observation(&grid, card, &cells, placement)
    };
    chains.iter().filter_map(line).collect()
}

/// One line of cells (row, column, place along the row).
fn observation(
    grid: &Grid<'_>,
    card: &Lines,
    cells: &[(usize, usize, f64)],
    placement: Placement,
) -> Option<Observation> {
    let count = cells.len() as f64;
    let mean = |channel: usize| {
        cells
            .iter()
            .map(|&(r, c, _)| grid.at(channel, r, c))
            .sum::<f64>()
            / count
    };
    let score = mean(0);
    if cells.len() < card.min_rows.max(2) || score < f64::from(card.min_score) {
        return None;
    }
    let stride = f64::from(card.stride_px);
    let pixel = |&(row, _, x): &(usize, usize, f64)| {
        placement.to_picture([x * stride - 0.5, (row as f64 + 0.5) * stride - 0.5])
    };
    let classes = |from: usize, size: usize| mean_log_probabilities(grid, cells, from..from + size);
    let first = GEOMETRY + MARKINGS + COLORS;
    Some(Observation {
        seen: Seen::LaneMarking,
        place: Place::Line(cells.iter().map(pixel).collect()),
        score: score.clamp(0.0, 1.0),
        marking: classes(GEOMETRY, MARKINGS),
        color: classes(GEOMETRY + MARKINGS, COLORS),
        appearance: of_unit_length((first..first + card.appearance).map(mean).collect()),
    })
}

/// Log of the softmax over `channels`, mean over the cells.
fn mean_log_probabilities(
    grid: &Grid<'_>,
    cells: &[(usize, usize, f64)],
    channels: std::ops::Range<usize>,
) -> Vec<f64> {
    let mut sums = vec![0.0; channels.len()];
    for &(row, column, _) in cells {
        let logits: Vec<f64> = channels
            .clone()
            .map(|channel| grid.at(channel, row, column))
            .collect();
        let most = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let norm = most
            + logits
                .iter()
                .map(|logit| (logit - most).exp())
                .sum::<f64>()
                .ln();
        sums.iter_mut()
            .zip(&logits)
            .for_each(|(sum, logit)| *sum += logit - norm);
    }
    sums.iter().map(|sum| sum / cells.len() as f64).collect()
}

/// A vector of length one; one that has no direction is left away.
pub(crate) fn of_unit_length(vector: Vec<f64>) -> Vec<f64> {
    let length = vector.iter().map(|value| value * value).sum::<f64>().sqrt();
    if length > 1e-9 && length.is_finite() {
        vector.iter().map(|value| value / length).collect()
    } else {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::card::{Card, Input};

    const ROWS: usize = 12;
    const COLUMNS: usize = 20;
    const CHANNELS: usize = GEOMETRY + MARKINGS + COLORS + 2;

    fn card() -> Card {
        toml::from_str(
            r#"
            name = "test"
            kind = "line_anchor"
            model = "m.onnx"
            sha256 = "00"
            input = { name = "image", width_px = 160, height_px = 96 }
            lines = { output = "lines", threshold = 0.5, min_rows = 3, appearance = 2 }
            "#,
        )
        .unwrap()
    }

    fn whole(input: &Input) -> Placement {
        Placement::new([input.width_px, input.height_px], input)
    }

    /// The grid that a perfect network would give for lines x(row), in cells.
    fn grid(lines: &[(&dyn Fn(f64) -> f64, usize)]) -> Vec<f32> {
        let mut values = vec![0.0; CHANNELS * ROWS * COLUMNS];
        let mut set = |channel: usize, row: usize, column: usize, value: f64| {
            values[(channel * ROWS + row) * COLUMNS + column] = value as f32;
        };
        for (x, marking) in lines {
            for row in 0..ROWS {
                let here = x(row as f64);
                let column = here.floor();
                for (aside, probability) in [(-1.0, 0.6), (0.0, 0.9), (1.0, 0.6)] {
                    let at = column + aside;
                    if !(0.0..COLUMNS as f64).contains(&at) {
                        continue;
                    }
                    let column = at as usize;
                    set(0, row, column, probability);
                    set(1, row, column, here - (at + 0.5));
                    set(2, row, column, x(row as f64 - 1.0) - here);
                    set(3, row, column, x(row as f64 + 1.0) - here);
                    set(GEOMETRY + marking, row, column, 5.0);
                    set(GEOMETRY + MARKINGS, row, column, 5.0);
                    set(CHANNELS - 1, row, column, 2.0);
                }
            }
        }
        values
    }

    #[test]
    fn lines_come_back_where_they_are_with_what_they_are() {
        let card = card();
        let steep = |row: f64| 4.3 + 0.2 * row;
        let slanted = |row: f64| 18.0 - 0.8 * row;
        let values = grid(&[(&steep, 1), (&slanted, 0)]);
        let output = Output {
            shape: vec![1, CHANNELS, ROWS, COLUMNS],
            values: &values,
        };
        let found = read(card.lines.as_ref().unwrap(), &output, whole(&card.input));
        assert_eq!(found.len(), 2, "{found:#?}");
        for observation in &found {
            let Place::Line(points) = &observation.place else {
                panic!("a line");
            };
            assert_eq!(points.len(), ROWS);
            assert!(points[0][1] > points[1][1], "from the bottom up");
            let is_dashed = observation.marking[1] > observation.marking[0];
            for [x_px, y_px] in points {
                let row = (y_px + 0.5) / 8.0 - 0.5;
                let cells = if is_dashed { steep(row) } else { slanted(row) };
                assert!((x_px - (cells * 8.0 - 0.5)).abs() < 1e-4);
            }
            assert!((observation.score - 0.9).abs() < 1e-6);
            assert_eq!(observation.appearance, [0.0, 1.0]);
            assert!(observation.color[0] > -0.05);
        }
    }

    #[test]
    fn nothing_is_seen_in_an_empty_grid() {
        let card = card();
        let values = vec![0.0; CHANNELS * ROWS * COLUMNS];
        let output = Output {
            shape: vec![1, CHANNELS, ROWS, COLUMNS],
            values: &values,
        };
        assert!(read(card.lines.as_ref().unwrap(), &output, whole(&card.input)).is_empty());
    }
}
