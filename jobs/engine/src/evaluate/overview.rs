//! The map with what changed on it, and what was claimed: one look at a whole evaluation.

use std::io;
use std::path::{Path, PathBuf};

use tilefold_formats::geojson::{Shape as Outline, TruthChange};
use tilefold_reducers::FusionModel;
use tilefold_schemas::Verdict;
use tilefold_tiler::geodesy::LocalFrame;

use super::claim::{Claim, claims};
use super::coverage::coverage;
use super::{Criteria, Subject};
use crate::error::EngineError;
use crate::picture::{Anchor, GREY, Picture, Rgb, Shape};

/// Width of the picture, the most height, and the room around the map, in pixels.
const WIDTH: f64 = 1_400.0;
const MOST_HEIGHT: f64 = 1_400.0;
const ROOM: f64 = 24.0;
/// Room above the map for the legend.
const LEGEND: f64 = 40.0;
/// Colours of the types of change, of middle brightness.
const COLORS: [(Verdict, Rgb); 3] = [
    (Verdict::Added, [0x2e, 0x9e, 0x4f]),
    (Verdict::Removed, [0xd0, 0x3c, 0x3c]),
    (Verdict::Modified, [0xc8, 0x74, 0x1a]),
];
/// Half the width of the band behind a true change, and radius of a dot at a small one, in pixels.
const BAND: f64 = 7.0;
const DOT: f64 = 5.0;

/// Writes `overview` and `coverage` as SVG and PNG into `folder`, which is made if need be.
///
/// # Errors
/// Evidence cannot be folded anew, or the folder not be written.
pub fn write(
    folder: &Path,
    subject: &Subject<'_>,
    model: FusionModel,
    criteria: Criteria,
) -> Result<Vec<PathBuf>, EngineError> {
    let records = subject.refold.of_fleet(model)?;
    let claims = claims(&records, criteria);
    let written = || -> io::Result<Vec<PathBuf>> {
        std::fs::create_dir_all(folder)?;
        let picture = picture(subject, &claims);
        let coverage = coverage(subject.refold.map(), &records);
        let files = [
            picture.write(folder, "overview")?,
            coverage.write(folder, "coverage")?,
        ];
        Ok(files.concat())
    };
    written().map_err(|source| EngineError::Picture {
        path: folder.to_owned(),
        source,
    })
}

fn picture(subject: &Subject<'_>, claims: &[Claim<'_>]) -> Picture {
    let elements = subject.refold.map().elements();
    let lines: Vec<&[[f64; 3]]> = elements
        .iter()
        .map(|mapped| mapped.element.points.as_slice())
        .collect();
    let Some(sheet) = Sheet::of(&lines) else {
        return Picture {
            width: 1,
            height: 1,
            shapes: Vec::new(),
        };
    };
    let mut shapes: Vec<Shape> = subject.truth.iter().flat_map(|t| sheet.band(t)).collect();
    shapes.extend(lines.iter().map(|points| sheet.line(points, GREY, 0.7)));
    shapes.extend(claims.iter().filter_map(|claim| sheet.claim(claim)));
    shapes.extend(legend());
    Picture {
        width: WIDTH as u32,
        height: sheet.height as u32,
        shapes,
    }
}

/// The plane of the picture.
struct Sheet {
    frame: LocalFrame,
    /// The north-western corner, metres east and north.
    corner_m: [f64; 2],
    pixels_per_m: f64,
    height: f64,
}

impl Sheet {
    /// A sheet that holds all lines; none if there are none.
    fn of(lines: &[&[[f64; 3]]]) -> Option<Self> {
        let first = *lines.first()?.first()?;
        let frame = LocalFrame::new([first[0], first[1], 0.0]);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for &[longitude_deg, latitude_deg, _] in lines.iter().copied().flatten() {
            let at = frame.to_enu([longitude_deg, latitude_deg, 0.0]);
            for axis in [0, 1] {
                low[axis] = at[axis].min(low[axis]);
                high[axis] = at[axis].max(high[axis]);
            }
        }
        let size_m = [0, 1].map(|axis| (high[axis] - low[axis]).max(1.0));
        let across = (WIDTH - 2.0 * ROOM) / size_m[0];
        let down = (MOST_HEIGHT - 2.0 * ROOM - LEGEND) / size_m[1];
        let pixels_per_m = across.min(down);
        Some(Self {
            frame,
            corner_m: [low[0], high[1]],
            pixels_per_m,
            height: (size_m[1] * pixels_per_m + 2.0 * ROOM + LEGEND).ceil(),
        })
    }

    fn at(&self, [longitude_deg, latitude_deg, _]: [f64; 3]) -> [f64; 2] {
        let [east_m, north_m, _] = self.frame.to_enu([longitude_deg, latitude_deg, 0.0]);
        [
            ROOM + (east_m - self.corner_m[0]) * self.pixels_per_m,
            ROOM + LEGEND + (self.corner_m[1] - north_m) * self.pixels_per_m,
        ]
    }

    fn line(&self, points: &[[f64; 3]], color: Rgb, width: f64) -> Shape {
        Shape::Line {
            points: points.iter().map(|&point| self.at(point)).collect(),
            color,
            width,
            is_dashed: false,
        }
    }

    /// A true change: a broad band behind a line, a disc behind anything else.
    fn band(&self, change: &TruthChange) -> Option<Shape> {
        let color = color(change.change_type)?;
        let points: Vec<[f64; 2]> = change.points.iter().map(|&point| self.at(point)).collect();
        let points = match change.shape {
            Outline::Line => band(&points),
            _ => disc(middle(&points)?, 2.0 * BAND),
        };
        Some(Shape::Area { points, color })
    }

    /// A claim: its line in colour, or a dot.
    fn claim(&self, claim: &Claim<'_>) -> Option<Shape> {
        let color = color(claim.verdict)?;
        let points = claim.geometry()?.points;
        let drawn: Vec<[f64; 2]> = points.iter().map(|&point| self.at(point)).collect();
        let is_small = drawn
            .first()
            .zip(drawn.last())
            .is_some_and(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) < DOT);
        if is_small {
            return Some(Shape::Dot {
                at: middle(&drawn)?,
                radius: DOT,
                color,
            });
        }
        Some(self.line(&points, color, 2.5))
    }
}

fn color(verdict: Verdict) -> Option<Rgb> {
    let found = COLORS.iter().find(|(of, _)| *of == verdict);
    found.map(|(_, color)| *color)
}

fn middle(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let count = points.len() as f64;
    let mean = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / count;
    (!points.is_empty()).then(|| [mean(0), mean(1)])
}

/// The outline of a line that is drawn broadly.
fn band(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let side = |index: usize, sign: f64| {
        let before = points[index.saturating_sub(1)];
        let after = points[(index + 1).min(points.len() - 1)];
        let (dx, dy) = (after[0] - before[0], after[1] - before[1]);
        let scale = sign * BAND / dx.hypot(dy).max(1e-9);
        [points[index][0] - dy * scale, points[index][1] + dx * scale]
    };
    let there = (0..points.len()).map(|index| side(index, 1.0));
    let back = (0..points.len()).rev().map(|index| side(index, -1.0));
    there.chain(back).collect()
}

fn disc([x, y]: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let corner = |corner: u32| {
        let (sin, cos) = (f64::from(corner) * std::f64::consts::TAU / 24.0).sin_cos();
        [x + radius * cos, y + radius * sin]
    };
    (0..24).map(corner).collect()
}

/// What the colours mean.
fn legend() -> Vec<Shape> {
    let mut shapes = Vec::new();
    for (index, (verdict, color)) in COLORS.into_iter().enumerate() {
        let x = ROOM + 170.0 * index as f64;
        let points = vec![[x, ROOM], [x + 30.0, ROOM]];
        shapes.push(Shape::Area {
            points: band(&points),
            color,
        });
        shapes.push(Shape::Line {
            points,
            color,
            width: 2.5,
            is_dashed: false,
        });
        shapes.push(Shape::Text {
            at: [x + 40.0, ROOM + 4.0],
            text: verdict.name().to_owned(),
            anchor: Anchor::Start,
        });
    }
    shapes.push(Shape::Text {
        at: [ROOM + 520.0, ROOM + 4.0],
        text: "bands: what is true; lines and dots: what is claimed".to_owned(),
        anchor: Anchor::Start,
    });
    shapes
}
