//! Lines and outlines cut to the picture.

type Pixel = [f64; 2];

/// The picture's first and last edge: pixels are squares around their centres.
fn edges(size: f64) -> (f64, f64) {
    (-0.5, size - 0.5)
}

/// The parts of a line within a picture.
pub(super) fn lines_within(line: &[Pixel], size: [f64; 2]) -> Vec<Vec<Pixel>> {
    let mut parts: Vec<Vec<Pixel>> = Vec::new();
    let mut last: Option<Pixel> = None;
    for pair in line.windows(2) {
        let Some((from, to)) = segment_within(pair[0], pair[1], size) else {
            last = None;
            continue;
        };
        match parts.last_mut() {
            Some(part) if last == Some(from) => part.push(to),
            _ => parts.push(vec![from, to]),
        }
        last = Some(to);
    }
    parts
}

/// The part of a straight line within a picture (Liang and Barsky, 1984).
fn segment_within(a: Pixel, b: Pixel, size: [f64; 2]) -> Option<(Pixel, Pixel)> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let (low, high) = edges(size[axis]);
        let way = b[axis] - a[axis];
        if way == 0.0 {
            if a[axis] < low || a[axis] > high {
                return None;
            }
            continue;
        }
        let (first, second) = ((low - a[axis]) / way, (high - a[axis]) / way);
        enter = enter.max(first.min(second));
        leave = leave.min(first.max(second));
    }
    let at = |share: f64| {
        if share == 0.0 {
            return a;
        }
        if share == 1.0 {
            return b;
        }
        [0, 1].map(|axis| a[axis] + (b[axis] - a[axis]) * share)
    };
    (enter < leave).then(|| (at(enter), at(leave)))
}

/// Left, top, right, bottom of the part of an outline within a picture (Sutherland and Hodgman,
/// 1974).
pub(super) fn boxed(outline: &[Pixel], size: [f64; 2]) -> Option<[f64; 4]> {
    let mut ring = outline.to_vec();
    for axis in 0..2 {
        let (low, high) = edges(size[axis]);
        ring = half(&ring, |pixel| pixel[axis] - low);
        ring = half(&ring, |pixel| high - pixel[axis]);
    }
    let [x, y] = *ring.first()?;
    let bounds = ring
        .iter()
        .fold([x, y, x, y], |[left, top, right, bottom], &[x, y]| {
            [left.min(x), top.min(y), right.max(x), bottom.max(y)]
        });
    Some(bounds.map(|value| (value * 1e3).round() / 1e3))
}

/// The part of a ring where `inside` is not negative.
fn half(ring: &[Pixel], inside: impl Fn(Pixel) -> f64) -> Vec<Pixel> {
    let mut kept = Vec::new();
    for (index, &to) in ring.iter().enumerate() {
        let from = ring[if index == 0 {
            ring.len() - 1
        } else {
            index - 1
        }];
        let (a, b) = (inside(from), inside(to));
        if (a < 0.0) != (b < 0.0) {
            let share = a / (a - b);
            kept.push([0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * share));
        }
        if b >= 0.0 {
            kept.push(to);
        }
    }
    kept
}

/// The line with fewer points, none of which is farther than `tolerance` from it (Douglas and
/// Peucker, 1973), at a hundredth of a pixel.
pub(super) fn simplified(line: &[Pixel], tolerance: f64) -> Vec<Pixel> {
    let mut keep = vec![false; line.len()];
    let mut open = vec![(0, line.len().saturating_sub(1))];
    while let Some((first, last)) = open.pop() {
        keep[first] = true;
        keep[last] = true;
        let inner = (first + 1..last).map(|at| (away(line[at], line[first], line[last]), at));
        let farthest = inner.max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, at)) = farthest.filter(|(away, _)| *away > tolerance) {
            open.push((first, at));
            open.push((at, last));
        }
    }
    let kept = line.iter().zip(keep).filter(|(_, keep)| *keep);
    kept.map(|(pixel, _)| pixel.map(|value| (value * 1e2).round() / 1e2))
        .collect()
}

fn away(pixel: Pixel, a: Pixel, b: Pixel) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let from = [pixel[0] - a[0], pixel[1] - a[1]];
    let length2 = (along[0] * along[0] + along[1] * along[1]).max(1e-12);
    let share = ((from[0] * along[0] + from[1] * along[1]) / length2).clamp(0.0, 1.0);
    (from[0] - along[0] * share).hypot(from[1] - along[1] * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 2] = [100.0, 50.0];

    #[test]
    fn a_line_that_leaves_and_returns_is_two_lines() {
        let line = [[10.0, 10.0], [10.0, -20.0], [30.0, -20.0], [30.0, 10.0]];
        let parts = lines_within(&line, SIZE);
        assert_eq!(
            parts,
            [
                vec![[10.0, 10.0], [10.0, -0.5]],
                vec![[30.0, -0.5], [30.0, 10.0]]
            ]
        );
    }

    #[test]
    fn an_outline_around_the_picture_fills_it() {
        let outline = [[-9.0, -9.0], [500.0, -9.0], [500.0, 500.0], [-9.0, 500.0]];
        assert_eq!(boxed(&outline, SIZE), Some([-0.5, -0.5, 99.5, 49.5]));
        assert_eq!(
            boxed(&[[200.0, 0.0], [210.0, 0.0], [210.0, 9.0]], SIZE),
            None
        );
    }

    #[test]
    fn points_on_the_way_are_left_out() {
        let line = [[0.0, 0.0], [1.0, 0.01], [2.0, 0.0], [3.0, 5.0]];
        assert_eq!(
            simplified(&line, 0.05),
            [[0.0, 0.0], [2.0, 0.0], [3.0, 5.0]]
        );
    }
}
