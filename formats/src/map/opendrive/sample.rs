//! Curves as polylines, within half a centimetre of the curve.

use tilefold_schemas::limits::{MAX_MAP_SAMPLES, MAX_POINTS_PER_ELEMENT};

/// Draws curves, up to a number of points in all.
pub(super) struct Sampler {
    left: usize,
}

/// How far a curve may be from its polyline: half of the centimetre that is promised.
const TOLERANCE_M: f64 = 0.005;
/// Where a curve jumps (files have gaps), there is no use in looking closer.
const MIN_STEP_M: f64 = 0.01;
/// Between two vertices at most: so that a curve cannot hide between those that are looked at.
const MAX_STEP_M: f64 = 20.0;
/// A vertex, and three points between it and the one before.
const SAMPLES_PER_VERTEX: usize = 4;

impl Sampler {
    pub(super) fn new() -> Self {
        Self {
            left: MAX_MAP_SAMPLES,
        }
    }

    /// Whether no more may be drawn.
    pub(super) fn is_exhausted(&self) -> bool {
        self.left == 0
    }

    /// The polyline of `curve` between the stations `from` and `to`; its formula may change at
    /// `breaks`.
    pub(super) fn sample(
        &mut self,
        curve: impl Fn(f64) -> [f64; 3],
        [from, to]: [f64; 2],
        mut breaks: Vec<f64>,
    ) -> Result<Vec<[f64; 3]>, String> {
        breaks.retain(|at| from + MIN_STEP_M < *at && *at < to - MIN_STEP_M);
        breaks.push(to);
        breaks.sort_by(f64::total_cmp);
        breaks.dedup_by(|later, earlier| *later - *earlier < MIN_STEP_M);
        let mut points = vec![curve(from)];
        let mut start = from;
        for end in breaks {
            let parts = ((end - start) / MAX_STEP_M).ceil().max(1.0);
            let step = (end - start) / parts;
            for part in 0..parts as usize {
                let begin = start + part as f64 * step;
                self.draw(&curve, begin, begin + step, &mut points)?;
            }
            start = end;
        }
        Ok(points)
    }

    /// Adds the vertices after `from` up to `to`, halving until they fit.
    fn draw(
        &mut self,
        curve: &impl Fn(f64) -> [f64; 3],
        from: f64,
        to: f64,
        points: &mut Vec<[f64; 3]>,
    ) -> Result<(), String> {
        let mut ends = vec![to];
        let mut start = (from, curve(from));
        while let Some(&end) = ends.last() {
            self.spend(points.len())?;
            let last = curve(end);
            let inner = [0.25, 0.5, 0.75].map(|part| curve(start.0 + part * (end - start.0)));
            let is_close = |point: &[f64; 3]| distance_m(*point, start.1, last) < TOLERANCE_M;
            if end - start.0 < MIN_STEP_M || inner.iter().all(is_close) {
                points.push(last);
                start = (end, last);
                ends.pop();
            } else {
                ends.push(start.0 + (end - start.0) / 2.0);
            }
        }
        Ok(())
    }

    fn spend(&mut self, points: usize) -> Result<(), String> {
        if points >= MAX_POINTS_PER_ELEMENT {
            return Err(format!(
                "it has over {MAX_POINTS_PER_ELEMENT} points (MAX_POINTS_PER_ELEMENT)"
            ));
        }
        self.left = self.left.saturating_sub(SAMPLES_PER_VERTEX);
        if self.is_exhausted() {
            return Err("the file's limit of points is reached (MAX_MAP_SAMPLES)".to_owned());
        }
        Ok(())
    }
}

/// From a point to the line through two others, in metres.
fn distance_m(point: [f64; 3], from: [f64; 3], to: [f64; 3]) -> f64 {
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (along, off) = (minus(to, from), minus(point, from));
    let length2 = dot(along, along);
    let part = if length2 > 0.0 {
        (dot(off, along) / length2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let rest = minus(off, along.map(|value| value * part));
    dot(rest, rest).sqrt()
}
