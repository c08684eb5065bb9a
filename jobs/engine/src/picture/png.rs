//! Pictures as PNG, at two pixels a pixel, or over a photograph.

use std::io;

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{
    Color, FillRule, IntSize, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash,
    Transform,
};

use tilefold_schemas as schemas;

use super::{AREA_OPACITY, Anchor, DASH, GREY, Picture, Rgb, Shape};

/// Pixels of the file for one of the picture.
const SCALE: f32 = 2.0;
/// Glyphs of the font, whose rasters are ready made.
const WEIGHT: FontWeight = FontWeight::Regular;
const HEIGHT: RasterHeight = RasterHeight::Size32;
/// Of a glyph's raster, so much is above the base line.
const ASCENT: usize = 25;

/// The whole file.
pub(super) fn png(picture: &Picture) -> io::Result<Vec<u8>> {
    let size = |pixels: u32| (pixels as f32 * SCALE) as u32;
    let mut pixmap = Pixmap::new(size(picture.width), size(picture.height))
        .ok_or_else(|| io::Error::other("a picture without pixels"))?;
    let scale = Transform::from_scale(SCALE, SCALE);
    for shape in &picture.shapes {
        draw(&mut pixmap, shape, scale);
    }
    pixmap.encode_png().map_err(io::Error::other)
}

/// Shapes over a photograph, at its own size. Places are of its pixels, the centre of the first of
/// which is (0, 0).
pub(crate) fn over(photograph: &schemas::Picture, shapes: &[Shape]) -> io::Result<Vec<u8>> {
    let none = || io::Error::other("a picture without pixels");
    let size = IntSize::from_wh(photograph.width_px, photograph.height_px).ok_or_else(none)?;
    let pixels = photograph.rgb.chunks_exact(3);
    let rgba = pixels.flat_map(|pixel| [pixel[0], pixel[1], pixel[2], u8::MAX]);
    let mut pixmap = Pixmap::from_vec(rgba.collect(), size).ok_or_else(none)?;
    for shape in shapes {
        draw(&mut pixmap, shape, Transform::from_translate(0.5, 0.5));
    }
    pixmap.encode_png().map_err(io::Error::other)
}

fn draw(pixmap: &mut Pixmap, shape: &Shape, scale: Transform) {
    match shape {
        Shape::Line {
            points,
            color,
            width,
            is_dashed,
        } => {
            let stroke = Stroke {
                width: *width as f32,
                line_join: LineJoin::Round,
                dash: is_dashed
                    .then(|| StrokeDash::new(DASH.map(|length| length as f32).into(), 0.0))
                    .flatten(),
                ..Stroke::default()
            };
            if let Some(path) = path(points, false) {
                pixmap.stroke_path(&path, &paint(*color, 1.0), &stroke, scale, None);
            }
        }
        Shape::Area { points, color } => {
            if let Some(path) = path(points, true) {
                fill(pixmap, &path, &paint(*color, AREA_OPACITY), scale);
            }
        }
        Shape::Dot { at, radius, color } => {
            let circle = PathBuilder::from_circle(at[0] as f32, at[1] as f32, *radius as f32);
            if let Some(path) = circle {
                fill(pixmap, &path, &paint(*color, 1.0), scale);
            }
        }
        Shape::Text { at, text, anchor } => write(pixmap, scale, *at, text, *anchor),
    }
}

fn fill(pixmap: &mut Pixmap, path: &Path, paint: &Paint<'_>, transform: Transform) {
    pixmap.fill_path(path, paint, FillRule::Winding, transform, None);
}

/// None for a path without extent.
fn path(points: &[[f64; 2]], is_closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    let (first, rest) = points.split_first()?;
    path.move_to(first[0] as f32, first[1] as f32);
    for point in rest {
        path.line_to(point[0] as f32, point[1] as f32);
    }
    if is_closed {
        path.close();
    }
    path.finish()
}

fn paint(color: Rgb, opacity: f64) -> Paint<'static> {
    let [red, green, blue] = color;
    let mut paint = Paint::default();
    paint.set_color(Color::from_rgba8(
        red,
        green,
        blue,
        (opacity * 255.0).round() as u8,
    ));
    paint.anti_alias = true;
    paint
}

/// Words, glyph by glyph; characters that the font lacks are left blank.
fn write(pixmap: &mut Pixmap, scale: Transform, at: [f64; 2], text: &str, anchor: Anchor) {
    let advance = get_raster_width(WEIGHT, HEIGHT);
    let length = (advance * text.chars().count()) as f64;
    let before = match anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => 0.5 * length,
        Anchor::End => length,
    };
    let left = (at[0] * f64::from(scale.sx) - before).round() as i64;
    let top = (at[1] * f64::from(scale.sy)).round() as i64 - ASCENT as i64;
    for (index, character) in text.chars().enumerate() {
        let Some(glyph) = get_raster(character, WEIGHT, HEIGHT) else {
            continue;
        };
        let left = left + (index * advance) as i64;
        for (row, shades) in glyph.rows().enumerate() {
            for (column, &shade) in shades.iter().enumerate() {
                blend(pixmap, left + column as i64, top + row as i64, shade);
            }
        }
    }
}

/// Lays grey over a pixel, as opaque as `shade` says (premultiplied alpha).
fn blend(pixmap: &mut Pixmap, x: i64, y: i64, shade: u8) {
    let (width, height) = (i64::from(pixmap.width()), i64::from(pixmap.height()));
    if shade == 0 || !(0..width).contains(&x) || !(0..height).contains(&y) {
        return;
    }
    let first = (y * width + x) as usize * 4;
    let over = [GREY[0], GREY[1], GREY[2], u8::MAX];
    for (channel, value) in pixmap.data_mut()[first..first + 4].iter_mut().zip(over) {
        let mixed =
            u32::from(value) * u32::from(shade) + u32::from(*channel) * (255 - u32::from(shade));
        *channel = ((mixed + 127) / 255) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(shapes: Vec<Shape>) -> Pixmap {
        let picture = Picture {
            width: 40,
            height: 30,
            shapes,
        };
        Pixmap::decode_png(&png(&picture).unwrap()).unwrap()
    }

    fn covered(pixmap: &Pixmap, columns: std::ops::Range<u32>) -> usize {
        let is_covered = |x, y| pixmap.pixel(x, y).is_some_and(|pixel| pixel.alpha() > 127);
        let rows = (0..pixmap.height()).flat_map(|y| columns.clone().map(move |x| (x, y)));
        rows.filter(|&(x, y)| is_covered(x, y)).count()
    }

    #[test]
    fn words_are_where_their_anchor_says() {
        let text = |anchor| Shape::Text {
            at: [20.0, 20.0],
            text: "H".to_owned(),
            anchor,
        };
        let start = picture(vec![text(Anchor::Start)]);
        assert_eq!(covered(&start, 0..40), 0);
        assert!(covered(&start, 40..80) > 20);
        let end = picture(vec![text(Anchor::End)]);
        assert_eq!(covered(&end, 40..80), 0);
        assert!(covered(&end, 0..40) > 20);
    }

    #[test]
    fn the_background_is_transparent_and_dots_are_round() {
        let dot = Shape::Dot {
            at: [20.0, 15.0],
            radius: 5.0,
            color: GREY,
        };
        let pixmap = picture(vec![dot]);
        assert_eq!(pixmap.pixel(0, 0).unwrap().alpha(), 0);
        // Pi * 10^2 pixels at twice the size.
        let area = covered(&pixmap, 0..80);
        assert!((300..330).contains(&area), "{area}");
    }
}
