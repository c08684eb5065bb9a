//! Bars to the right, one below the other, each with its name and its figure.

use super::{Anchor, BLUE, GREY, Picture, Shape};

/// Width of the longest bar, room for names to the left and figures to the right, in pixels.
const LONGEST: f64 = 360.0;
const LEFT: f64 = 130.0;
const RIGHT: f64 = 220.0;
/// Height of the title, of a bar and of its row.
const TOP: f64 = 44.0;
const BAR: f64 = 18.0;
const ROW: f64 = 28.0;
/// From the middle of a bar to the base line of its text.
const BASE: f64 = 4.5;

/// A bar: its name, how long it is in any unit, and the figure beside it.
pub(crate) struct Bar {
    pub(crate) name: String,
    pub(crate) value: f64,
    pub(crate) figure: String,
}

/// The picture; the longest bar takes all the width.
pub(crate) fn bars(title: &str, bars: &[Bar]) -> Picture {
    let most = bars.iter().map(|bar| bar.value).fold(0.0, f64::max);
    let scale = if most > 0.0 { LONGEST / most } else { 0.0 };
    let mut shapes = vec![Shape::Text {
        at: [LEFT, 24.0],
        text: title.to_owned(),
        anchor: Anchor::Start,
    }];
    for (row, bar) in (0_u32..).zip(bars) {
        let middle = TOP + ROW * (f64::from(row) + 0.5);
        let right = LEFT + bar.value * scale;
        let text = |x: f64, text: &str, anchor| Shape::Text {
            at: [x, middle + BASE],
            text: text.to_owned(),
            anchor,
        };
        shapes.push(text(LEFT - 10.0, &bar.name, Anchor::End));
        shapes.push(Shape::Line {
            points: vec![[LEFT, middle], [right.max(LEFT + 0.5), middle]],
            color: BLUE,
            width: BAR,
            is_dashed: false,
        });
        shapes.push(text(right + 12.0, &bar.figure, Anchor::Start));
    }
    let height = TOP + ROW * bars.len() as f64 + 16.0;
    shapes.push(Shape::Line {
        points: vec![[LEFT, TOP - 6.0], [LEFT, height - 10.0]],
        color: GREY,
        width: 1.0,
        is_dashed: false,
    });
    Picture {
        width: (LEFT + LONGEST + RIGHT) as u32,
        height: height as u32,
        shapes,
    }
}
