//! The lateral scale of a detector: how much wider the road is than it says.
//!
//! A wrong mounting height or pitch stretches flat-ground projection to the sides by a constant
//! factor. Where two map lines are seen beside each other, the ratio of their mapped to their
//! seen distance is that factor; the median over all such frames is robust against edited lines.

use crate::cuts::CrossCut;
use crate::look::Look;
use crate::matching::{IN_PLACE_M, match_lines};
use crate::pose::median;
use crate::register::Registration;

/// Two lines must be seen at least this far apart, in metres.
const MIN_APART_M: f64 = 2.5;
/// Lines farther to the side are too uncertain, in metres.
const MAX_SIDE_M: f64 = 3.5;
/// Below this many frames the scale is taken to be 1.
const MIN_FRAMES: usize = 30;
/// A factor outside of this is no matter of mounting.
const BOUNDS: (f64, f64) = (0.85, 1.2);

/// Mapped over seen lateral distance; 1 where there is too little to tell.
#[must_use]
pub fn estimate(cross_cuts: &[CrossCut], registrations: &[Registration]) -> f64 {
    let ratios: Vec<f64> = cross_cuts
        .iter()
        .zip(registrations)
        .filter(|(_, registration)| registration.confidence > 0.8)
        .filter_map(|(cross_cut, registration)| ratio(cross_cut, registration.offset_m))
        .collect();
    if ratios.len() < MIN_FRAMES {
        return 1.0;
    }
    median(ratios).clamp(BOUNDS.0, BOUNDS.1)
}

/// The ratio of one frame, from its outermost matched pair of near lines.
fn ratio(cross_cut: &CrossCut, offset_m: f64) -> Option<f64> {
    let matches = match_lines(cross_cut, offset_m, 0.0);
    let near: Vec<(f64, f64)> = matches
        .pairs
        .iter()
        .filter(|pair| pair.residual_m.abs() <= IN_PLACE_M)
        .map(|pair| {
            let seen_m = cross_cut.seen[pair.seen].lateral_m();
            // Over the cuts that both have.
            (seen_m, seen_m - pair.residual_m)
        })
        .filter(|(seen_m, _)| seen_m.abs() <= MAX_SIDE_M)
        .collect();
    let (first, last) = (near.first()?, near.last()?);
    let seen_m = last.0 - first.0;
    (seen_m >= MIN_APART_M).then(|| (last.1 - first.1) / seen_m)
}

/// Stretches what was seen to the sides by a factor.
pub fn stretch(looks: &mut [Look], factor: f64) {
    for line in looks.iter_mut().flat_map(|look| &mut look.lines) {
        for point in &mut line.points_m {
            point[1] *= factor;
        }
    }
}
