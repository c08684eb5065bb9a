//! A picture with what was seen drawn into it, as PNG.
//!
//! Lines are green, boxes of paint blue, vehicles orange; what belongs to no believed track of a log
//! is drawn as everything is in a single picture.

use std::io;

use tilefold_schemas::Picture;
use tilefold_schemas::observation::Seen;

use super::Item;
use crate::picture::{Rgb, Shape, over};

/// Width of what is drawn, as a share of the picture's.
const WIDTH_SHARE: f64 = 0.004;
/// Least width of what is drawn, in pixels.
const LEAST_PX: f64 = 1.5;

/// The whole file.
pub(super) fn png(picture: &Picture, items: &[Item]) -> io::Result<Vec<u8>> {
    let width = (f64::from(picture.width_px) * WIDTH_SHARE).max(LEAST_PX);
    let shapes: Vec<Shape> = items.iter().map(|item| shape(item, width)).collect();
    over(picture, &shapes)
}

fn shape(item: &Item, width: f64) -> Shape {
    let points = super::points(item);
    let first = points.first().filter(|_| item.edges.is_some());
    Shape::Line {
        points: (points.iter().chain(first))
            .map(|&[x, y, _]| [x, y])
            .collect(),
        color: color(item),
        width,
        is_dashed: false,
    }
}

fn color(item: &Item) -> Rgb {
    match Seen::from_name(item.class) {
        Some(Seen::LaneMarking) => [0x20, 0xd0, 0x40],
        Some(Seen::Vehicle) => [0xe0, 0x80, 0x20],
        _ => [0x30, 0x90, 0xf0],
    }
}
