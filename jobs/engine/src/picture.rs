//! Pictures made of lines, areas, dots and words, written as SVG and as PNG.
//!
//! Backgrounds are transparent and colours are of middle brightness, so that a picture can be read
//! on light and on dark pages. The same picture gives the same bytes.

pub(crate) mod bars;
mod png;
mod svg;

pub(crate) use png::over;

use std::io;
use std::path::{Path, PathBuf};

/// A colour: red, green and blue.
pub(crate) type Rgb = [u8; 3];

/// Axes and words: a contrast above 4 on white and on near-black.
pub(crate) const GREY: Rgb = [0x77, 0x77, 0x77];
/// The first series.
pub(crate) const BLUE: Rgb = [0x3a, 0x82, 0xcf];
/// The second series.
pub(crate) const ORANGE: Rgb = [0xc8, 0x74, 0x1a];

/// Which part of a text is at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// One thing in a picture. Places are pixels from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Shape {
    Line {
        points: Vec<[f64; 2]>,
        color: Rgb,
        width: f64,
        is_dashed: bool,
    },
    /// Filled, seen through.
    Area { points: Vec<[f64; 2]>, color: Rgb },
    Dot {
        at: [f64; 2],
        radius: f64,
        color: Rgb,
    },
    /// Printable ASCII; its place is on the base line.
    Text {
        at: [f64; 2],
        text: String,
        anchor: Anchor,
    },
}

/// Share of an area that covers what is behind it.
const AREA_OPACITY: f64 = 0.22;
/// Dashes and gaps, in pixels.
const DASH: [f64; 2] = [5.0, 4.0];

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// The last is in front.
    pub(crate) shapes: Vec<Shape>,
}

impl Picture {
    /// Writes `name.svg` and `name.png` into a folder that exists.
    pub(crate) fn write(&self, folder: &Path, name: &str) -> io::Result<[PathBuf; 2]> {
        let files = ["svg", "png"].map(|form| folder.join(format!("{name}.{form}")));
        std::fs::write(&files[0], svg::svg(self))?;
        std::fs::write(&files[1], png::png(self)?)?;
        Ok(files)
    }
}
