//! Centres and orders of outlines, wherever they come from.

use tilefold_schemas::ElementKind;

/// Twice the area below which an outline has none, in square metres.
const LEAST_AREA2_M2: f64 = 1e-6;

/// The middle of a line or the centroid of an outline; none without points. Both do not depend on how
/// many vertices lie on which side.
#[must_use]
pub fn centre(kind: ElementKind, points: &[[f64; 2]]) -> Option<[f64; 2]> {
    match kind {
        ElementKind::StopLine | ElementKind::LaneMarking => middle(points),
        ElementKind::Crosswalk | ElementKind::GroundSign => {
            centroid(points).or_else(|| middle(points))
        }
    }
}

/// The place half way along a line.
fn middle(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let length = |pair: &[[f64; 2]]| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
    let mut left_m = 0.5 * points.windows(2).map(length).sum::<f64>();
    for pair in points.windows(2) {
        let step_m = length(pair);
        if step_m > 0.0 && left_m <= step_m {
            let share = left_m / step_m;
            return Some(
                [0, 1].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis])),
            );
        }
        left_m -= step_m;
    }
    points.first().copied()
}

fn centroid(ring: &[[f64; 2]]) -> Option<[f64; 2]> {
    let origin = *ring.first()?;
    let (mut area2, mut sum) = (0.0, [0.0; 2]);
    for (index, from) in ring.iter().enumerate() {
        let to = ring[(index + 1) % ring.len()];
        let [a, b] = [from, &to].map(|p| [p[0] - origin[0], p[1] - origin[1]]);
        let cross = a[0] * b[1] - b[0] * a[1];
        area2 += cross;
        sum = [0, 1].map(|axis| sum[axis] + cross * (a[axis] + b[axis]));
    }
    (area2.abs() > LEAST_AREA2_M2)
        .then(|| [0, 1].map(|axis| origin[axis] + sum[axis] / (3.0 * area2)))
}

/// The same outline in one order, whoever drew it: counter-clockwise from its rear right corner in the
/// vehicle frame, so that the first side runs ahead. A line runs from right to left.
#[must_use]
pub fn ordered(kind: ElementKind, mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    if kind == ElementKind::StopLine {
        if points.first().map(|p| p[1]) > points.last().map(|p| p[1]) {
            points.reverse();
        }
        return points;
    }
    if points.len() > 1 && points.first() == points.last() {
        points.pop();
    }
    let doubled: f64 = (0..points.len())
        .map(|index| {
            let (a, b) = (points[index], points[(index + 1) % points.len()]);
            a[0] * b[1] - b[0] * a[1]
        })
        .sum();
    if doubled < 0.0 {
        points.reverse();
    }
    let corner = |&index: &usize| points[index][0] + points[index][1];
    let first = (0..points.len()).min_by(|a, b| corner(a).total_cmp(&corner(b)));
    points.rotate_left(first.unwrap_or(0));
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_do_not_depend_on_vertices_on_the_sides() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let dense = [
            [0.0, 0.0],
            [0.5, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 2.0],
            [0.0, 2.0],
        ];
        for ring in [&square[..], &dense[..]] {
            let [x, y] = centre(ElementKind::GroundSign, ring).unwrap();
            assert!((x - 1.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12);
        }
        let line = [[0.0, 3.0], [0.0, 2.5], [0.0, -1.0]];
        assert_eq!(centre(ElementKind::StopLine, &line), Some([0.0, 1.0]));
        assert_eq!(centre(ElementKind::StopLine, &[]), None);
    }

    #[test]
    fn an_outline_has_one_order() {
        let wanted = vec![[5.0, -1.0], [9.0, -1.0], [9.0, 1.0], [5.0, 1.0]];
        for turn in 0..4 {
            let mut drawn = wanted.clone();
            drawn.rotate_left(turn);
            assert_eq!(ordered(ElementKind::GroundSign, drawn.clone()), wanted);
            drawn.reverse();
            assert_eq!(ordered(ElementKind::GroundSign, drawn), wanted);
        }
        let across = ordered(ElementKind::StopLine, vec![[9.0, 3.0], [9.0, -3.0]]);
        assert_eq!(across, [[9.0, -3.0], [9.0, 3.0]]);
    }
}
