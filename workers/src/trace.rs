//! Which map element each detection was taken for: for those who hold matching against a truth.
//! The way of the evidence does not pass through here.

use tilefold_schemas::ElementId;

use crate::cuts::CutLine;
use crate::local_map::LocalMap;
use crate::testify::{Frame, MIN_CONFIDENCE};

/// A stretch of a detection and what it was taken for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Assignment {
    /// Capture time of its frame, by the frame's own stamp.
    pub stamp_ns: i64,
    /// Its number among the detections of the message, counted from 0.
    pub detection: usize,
    /// The element that it was matched to.
    pub element: ElementId,
    /// The stretch that runs beside it, by metres ahead: 0 where the detection is nearest, 1 where it is farthest.
    pub shares: [f64; 2],
    /// Whether the detection is longer beside no other element.
    pub is_main: bool,
}

/// The matches of a frame; none of a frame that testifies nothing.
pub fn assignments<'a>(
    frame: &'a Frame<'_>,
    map: &'a LocalMap<'_>,
) -> impl Iterator<Item = Assignment> + 'a {
    let testifies = frame.registration.confidence >= MIN_CONFIDENCE;
    let pairs = frame.matches.pairs.iter().map(|pair| {
        let [seen, mapped] = [
            &frame.cross_cut.seen[pair.seen],
            &frame.cross_cut.mapped[pair.mapped],
        ];
        let shares = shares(seen, mapped, frame.ahead_m);
        (seen.line, mapped.line, shares, pair.is_main)
    });
    let aslant = (frame.aslant.iter()).map(|of| (of.seen, of.mapped, [0.0, 1.0], true));
    let all = pairs.chain(aslant).filter(move |_| testifies);
    all.map(|(seen, mapped, shares, is_main)| Assignment {
        stamp_ns: frame.look.pose.stamp_ns,
        detection: frame.look.lines[seen].detection,
        element: map.lines[mapped].mapped.element.id,
        shares,
        is_main,
    })
}

/// The stretch of a seen line that runs beside a map line, the vehicle being `ahead_m` ahead of its pose.
fn shares(seen: &CutLine, mapped: &CutLine, ahead_m: f64) -> [f64; 2] {
    let [from_m, to_m] = seen.ahead_m;
    mapped
        .ahead_m
        .map(|at_m| ((at_m - ahead_m - from_m) / (to_m - from_m)).clamp(0.0, 1.0))
}
