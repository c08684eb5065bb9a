//! A picture with what was seen drawn into it, as PNG.
//!
//! Lines are green, boxes of paint blue, vehicles orange; what belongs to no believed track of a log
//! is drawn as everything is in a single picture.

use std::io;

use tilefold_schemas::Picture;
use tilefold_schemas::observation::Seen;
use tiny_skia::{Color, IntSize, Paint, PathBuilder, Pixmap, Stroke, Transform};

use super::Item;

/// Width of what is drawn, as a share of the picture's.
const WIDTH_SHARE: f32 = 0.004;

/// The whole file.
pub(super) fn png(picture: &Picture, items: &[Item]) -> io::Result<Vec<u8>> {
    let none = || io::Error::other("a picture without pixels");
    let size = IntSize::from_wh(picture.width_px, picture.height_px).ok_or_else(none)?;
    let rgba = picture
        .rgb
        .chunks_exact(3)
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255]);
    let mut pixmap = Pixmap::from_vec(rgba.collect(), size).ok_or_else(none)?;
    for item in items {
        draw(&mut pixmap, item);
    }
    pixmap.encode_png().map_err(io::Error::other)
}

fn draw(pixmap: &mut Pixmap, item: &Item) {
    let mut points = super::points(item);
    if item.edges.is_some() {
        points.extend(points.first().copied());
    }
    let mut path = PathBuilder::new();
    for (index, [x, y, _]) in points.iter().enumerate() {
        // A pixel's centre is half a pixel inside of what is drawn.
        let (x, y) = (*x as f32 + 0.5, *y as f32 + 0.5);
        if index == 0 {
            path.move_to(x, y)
        } else {
            path.line_to(x, y)
        }
    }
    let Some(path) = path.finish() else { return };
    let (r, g, b) = color(item);
    let mut paint = Paint::default();
    paint.set_color(Color::from_rgba8(r, g, b, 255));
    paint.anti_alias = true;
    let stroke = Stroke {
        width: (pixmap.width() as f32 * WIDTH_SHARE).max(1.5),
        ..Stroke::default()
    };
    pixmap.stroke_path(&path, &paint, &stroke, Transform::identity(), None);
}

fn color(item: &Item) -> (u8, u8, u8) {
    match Seen::from_name(item.class) {
        Some(Seen::LaneMarking) => (0x20, 0xd0, 0x40),
        Some(Seen::Vehicle) => (0xe0, 0x80, 0x20),
        _ => (0x30, 0x90, 0xf0),
    }
}
