//! Which map element each detection was taken for: for those who hold matching against a truth.
//! The way of the evidence does not pass through here.

use tilefold_schemas::ElementId;

use crate::local_map::LocalMap;
use crate::testify::{Frame, MIN_CONFIDENCE};

/// A detection and what it was taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Assignment {
    /// Capture time of its frame, by the frame's own stamp.
    pub stamp_ns: i64,
    /// Its number among the detections of the message, counted from 0.
    pub detection: usize,
    /// The element that it was matched to.
    pub element: ElementId,
}

/// The matches of a frame; none of a frame that testifies nothing.
pub fn assignments<'a>(
    frame: &'a Frame<'_>,
    map: &'a LocalMap<'_>,
) -> impl Iterator<Item = Assignment> + 'a {
    let testifies = frame.registration.confidence >= MIN_CONFIDENCE;
    let pairs = frame.matches.pairs.iter().filter(|pair| pair.is_main);
    let along = pairs.map(|pair| {
        let seen = frame.cross_cut.seen[pair.seen].line;
        (seen, frame.cross_cut.mapped[pair.mapped].line)
    });
    let aslant = frame.aslant.iter().map(|of| (of.seen, of.mapped));
    let all = along.chain(aslant).filter(move |_| testifies);
    all.map(|(seen, mapped)| Assignment {
        stamp_ns: frame.look.pose.stamp_ns,
        detection: frame.look.lines[seen].detection,
        element: map.lines[mapped].mapped.element.id,
    })
}
