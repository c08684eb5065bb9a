//! Pictures as SVG 1.1.

use std::fmt::Write as _;

use super::{AREA_OPACITY, Anchor, DASH, GREY, Picture, Rgb, Shape};

/// The whole file. Writing into a `String` cannot fail.
pub(super) fn svg(picture: &Picture) -> String {
    let (width, height) = (picture.width, picture.height);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" font-family=\"'Noto Sans Mono', monospace\" font-size=\"13\">\n"
    );
    for shape in &picture.shapes {
        let _ = writeln!(text, "{}", element(shape));
    }
    text.push_str("</svg>\n");
    text
}

fn element(shape: &Shape) -> String {
    match shape {
        Shape::Line {
            points,
            color,
            width,
            is_dashed,
        } => format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{}/>",
            list(points),
            hex(*color),
            if *is_dashed {
                format!(" stroke-dasharray=\"{} {}\"", DASH[0], DASH[1])
            } else {
                String::new()
            }
        ),
        Shape::Area { points, color } => format!(
            "<polygon points=\"{}\" fill=\"{}\" fill-opacity=\"{AREA_OPACITY}\"/>",
            list(points),
            hex(*color)
        ),
        Shape::Dot { at, radius, color } => format!(
            "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius:.2}\" fill=\"{}\"/>",
            at[0],
            at[1],
            hex(*color)
        ),
        Shape::Text { at, text, anchor } => format!(
            "<text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"{}\" fill=\"{}\">{}</text>",
            at[0],
            at[1],
            match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            },
            hex(GREY),
            escaped(text)
        ),
    }
}

fn list(points: &[[f64; 2]]) -> String {
    let points = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}"));
    points.collect::<Vec<_>>().join(" ")
}

fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
