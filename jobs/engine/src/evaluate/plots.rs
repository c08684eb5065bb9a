//! An evaluation as pictures: the reliability of P(change), and precision and recall over T_s with
//! their intervals, both fusion models in each.

use std::io;
use std::path::{Path, PathBuf};

use super::{Calibration, Evaluation, Interval, Score, SweepPoint};
use crate::error::EngineError;
use crate::picture::{Anchor, BLUE, GREY, ORANGE, Picture, Rgb, Shape};

/// Side of the square that data is drawn in, pixels.
const SIDE: f64 = 300.0;
/// Room for the numbers to the left, and for the title above.
const LEFT: f64 = 58.0;
const TOP: f64 = 70.0;
/// Room to the right, for half of the last number.
const RIGHT: f64 = 26.0;
/// Room below, for numbers and the name of the axis.
const BELOW: f64 = 46.0;

/// A fusion model's curve.
struct Series<'a> {
    name: &'static str,
    color: Rgb,
    sweep: &'a [SweepPoint],
    calibration: &'a Calibration,
}

impl Series<'_> {
    /// The paper's lines are dashed: both can be told apart without colour, and where they meet.
    fn line(&self, points: Vec<[f64; 2]>, width: f64) -> Shape {
        Shape::Line {
            points,
            color: self.color,
            width,
            is_dashed: self.name == "paper",
        }
    }
}

/// Writes `reliability` and `sweep` as SVG and PNG into `folder`, which is made if need be.
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, evaluation: &Evaluation) -> Result<Vec<PathBuf>, EngineError> {
    draw(folder, evaluation).map_err(|source| EngineError::Picture {
        path: folder.to_owned(),
        source,
    })
}

fn draw(folder: &Path, evaluation: &Evaluation) -> io::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder)?;
    let other = &evaluation.other_model;
    let series = [
        (evaluation.fusion_model, &evaluation.findings),
        (other.fusion_model, &other.findings),
    ]
    .map(|(name, findings)| Series {
        name,
        color: if name == "calibrated" { BLUE } else { ORANGE },
        sweep: &findings.change.sweep,
        calibration: &findings.calibration,
    });
    let pictures = [
        ("reliability", reliability(&series)),
        ("sweep", sweep(&series)),
    ];
    let mut files = Vec::new();
    for (name, picture) in pictures {
        files.extend(picture.write(folder, name)?);
    }
    Ok(files)
}

/// A square with axes: data coordinates to pixels.
struct Panel {
    left: f64,
    x: [f64; 2],
}

impl Panel {
    fn new(number: u32, x: [f64; 2]) -> Self {
        let left = LEFT + f64::from(number) * (SIDE + LEFT + RIGHT);
        Self { left, x }
    }

    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let share = (x - self.x[0]) / (self.x[1] - self.x[0]);
        [self.left + share * SIDE, TOP + (1.0 - y) * SIDE]
    }

    /// Frame, grid, numbers and names.
    fn axes(&self, title: &str, x_name: &str, x_ticks: &[f64]) -> Vec<Shape> {
        let mut shapes = Vec::new();
        let [low, high] = self.x;
        for step in 0..=5 {
            let y = f64::from(step) / 5.0;
            shapes.push(rule(vec![self.at(low, y), self.at(high, y)]));
            let [x_px, y_px] = self.at(low, y);
            shapes.push(text(
                [x_px - 12.0, y_px + 4.5],
                format!("{y:.1}"),
                Anchor::End,
            ));
        }
        for &x in x_ticks {
            shapes.push(rule(vec![self.at(x, 0.0), self.at(x, 1.0)]));
            let [x_px, y_px] = self.at(x, 0.0);
            shapes.push(text([x_px, y_px + 20.0], tick(x), Anchor::Middle));
        }
        let middle = self.left + 0.5 * SIDE;
        let name_at = [middle, TOP + SIDE + 38.0];
        shapes.push(text(name_at, x_name.to_owned(), Anchor::Middle));
        shapes.push(text([self.left, 18.0], title.to_owned(), Anchor::Start));
        shapes
    }

    /// The name of a series with its colour, the `row`th below the title.
    fn legend(&self, row: u32, series: &Series<'_>, words: String) -> [Shape; 2] {
        let y = 36.0 + 17.0 * f64::from(row);
        let dash = vec![[self.left, y - 4.5], [self.left + 20.0, y - 4.5]];
        [
            series.line(dash, 2.0),
            text([self.left + 26.0, y], words, Anchor::Start),
        ]
    }
}

fn tick(x: f64) -> String {
    let text = format!("{x:.2}");
    text.strip_suffix('0').unwrap_or(&text).to_owned()
}

fn text(at: [f64; 2], text: String, anchor: Anchor) -> Shape {
    Shape::Text { at, text, anchor }
}

fn rule(points: Vec<[f64; 2]>) -> Shape {
    Shape::Line {
        points,
        color: GREY,
        width: 0.4,
        is_dashed: false,
    }
}

fn picture(panels: u32, shapes: Vec<Shape>) -> Picture {
    let width = f64::from(panels) * (LEFT + SIDE + RIGHT);
    Picture {
        width: width as u32,
        height: (TOP + SIDE + BELOW) as u32,
        shapes,
    }
}

/// Share that changed against mean P(change), bin by bin; a dot's area grows with its elements.
fn reliability(series: &[Series<'_>; 2]) -> Picture {
    let panel = Panel::new(0, [0.0, 1.0]);
    let ticks = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
    let mut shapes = panel.axes("share that changed", "mean P(change)", &ticks);
    shapes.push(Shape::Line {
        points: vec![panel.at(0.0, 0.0), panel.at(1.0, 1.0)],
        color: GREY,
        width: 1.2,
        is_dashed: true,
    });
    for (row, series) in (0..).zip(series) {
        let ece = series.calibration.ece;
        let words = ece.map_or("-".to_owned(), |ece| format!("{ece:.3}"));
        shapes.extend(panel.legend(row, series, format!("{}, ECE {words}", series.name)));
        let bins = series.calibration.bins.iter();
        let points: Vec<([f64; 2], u64)> = bins
            .filter_map(|bin| Some((panel.at(bin.mean_p?, bin.changed_share?), bin.count)))
            .collect();
        let places = points.iter().map(|(at, _)| *at).collect();
        shapes.push(series.line(places, 1.0));
        shapes.extend(points.iter().map(|&(at, count)| Shape::Dot {
            at,
            radius: (2.0 + (count as f64).sqrt() / 2.0).min(9.0),
            color: series.color,
        }));
    }
    picture(1, shapes)
}

/// A figure of a score, and its interval.
type Figure = fn(&Score) -> (Option<f64>, Option<Interval>);

/// Precision and recall over T_s, with bands where there are intervals.
fn sweep(series: &[Series<'_>; 2]) -> Picture {
    let figures: [(&str, Figure); 2] = [
        ("precision", |score| (score.precision, score.precision_95)),
        ("recall", |score| (score.recall, score.recall_95)),
    ];
    let mut shapes = Vec::new();
    for (number, (title, figure)) in (0..).zip(figures) {
        let panel = Panel::new(number, [0.70, 0.95]);
        shapes.extend(panel.axes(title, "T_s", &super::SWEEP));
        for (row, series) in (0..).zip(series) {
            shapes.extend(panel.legend(row, series, series.name.to_owned()));
        }
        // No band hides a curve.
        shapes.extend(series.iter().map(|series| band(&panel, series, figure)));
        shapes.extend(
            series
                .iter()
                .flat_map(|series| curve(&panel, series, figure)),
        );
    }
    picture(2, shapes)
}

fn band(panel: &Panel, series: &Series<'_>, figure: Figure) -> Shape {
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for SweepPoint { threshold, scores } in series.sweep {
        let (_, interval) = figure(&scores.all);
        lower.extend(interval.map(|[low, _]| panel.at(*threshold, low)));
        upper.extend(interval.map(|[_, high]| panel.at(*threshold, high)));
    }
    Shape::Area {
        points: lower.into_iter().chain(upper.into_iter().rev()).collect(),
        color: series.color,
    }
}

fn curve(panel: &Panel, series: &Series<'_>, figure: Figure) -> Vec<Shape> {
    let points: Vec<[f64; 2]> = (series.sweep.iter())
        .filter_map(|point| Some(panel.at(point.threshold, figure(&point.scores.all).0?)))
        .collect();
    let dot = |&at| Shape::Dot {
        at,
        radius: 3.0,
        color: series.color,
    };
    let mut shapes: Vec<Shape> = points.iter().map(dot).collect();
    shapes.push(series.line(points, 2.0));
    shapes
}
