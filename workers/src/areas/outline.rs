//! The outline on the road of paint that was seen as a box.
//!
//! A box is the picture's upright rectangle around paint that lies flat and gets narrower with its
//! distance. The paint is taken for a rectangle along the vehicle's way on flat ground: its near and
//! far end are those of the box, and each of its sides touches the box at the end that is farther
//! out in the picture: the near end of what lies beside the middle on that side, the far end else.

use tilefold_schemas::ElementKind;

use crate::camera::Camera;
use crate::surface::Surface;

/// How often the ends of the far side are looked for anew.
const ROUNDS: usize = 3;

/// The outline of a box (left, top, right and bottom edge) of a kind of paint, in pixels: near left,
/// near right, far right and far left corner; of a stop line, its middle line from left to right.
/// None if the box does not lie on the road. Without a camera it is the box itself.
#[must_use]
pub fn of(kind: ElementKind, edges: [f64; 4], camera: Option<&Camera>) -> Option<Vec<[f64; 3]>> {
    let [left, top, right, bottom] = edges;
    let corners = match camera {
        None => [[left, bottom], [right, bottom], [right, top], [left, top]],
        Some(camera) => on_road(edges, camera)?,
    };
    let point = |[x, y]: [f64; 2]| [x, y, 0.0];
    let [near_left, near_right, far_right, far_left] = corners;
    Some(match kind {
        ElementKind::StopLine => {
            let middle = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|i| 0.5 * (a[i] + b[i]));
            vec![
                point(middle(near_left, far_left)),
                point(middle(near_right, far_right)),
            ]
        }
        _ => corners.map(point).to_vec(),
    })
}

/// Corners of the rectangle on the road that the box is drawn around, in pixels.
fn on_road([left, top, right, bottom]: [f64; 4], camera: &Camera) -> Option<[[f64; 2]; 4]> {
    let road = |pixel| camera.road_from_pixel(pixel, &Surface::FLAT);
    let axis = camera.axis_px();
    let pixel = |x: f64, y: f64| camera.pixel_from_vehicle([x, y, 0.0]);
    // A lens bends straight lines outwards: what lies across is lowest in the picture where it is
    // nearest to the lens' axis, and highest where it is farthest from it. Where its ends are
    // is not known yet: they are looked for from the middle.
    let [mut near_px, mut far_px] = [axis.max(left).min(right), 0.5 * (left + right)];
    let [mut near_m, mut far_m, mut left_m, mut right_m] = [0.0; 4];
    for _ in 0..ROUNDS {
        (near_m, far_m) = (road([near_px, bottom])?[0], road([far_px, top])?[0]);
        if far_m <= near_m {
            return None;
        }
        // To the left is positive. A line along the way lies farther out in the picture the nearer it is.
        let far_row = |side_m: f64| pixel(far_m, side_m).map_or(top, |[_, row]| row);
        let near_row = |side_m: f64| pixel(near_m, side_m).map_or(bottom, |[_, row]| row);
        let side = |edge: f64, outward: f64, known_m: f64| {
            let near = road([edge, near_row(known_m)])?[1];
            let far = road([edge, far_row(known_m)])?[1];
            Some(side_m(near, far, outward))
        };
        (left_m, right_m) = (side(left, 1.0, left_m)?, side(right, -1.0, right_m)?);
        let ends = |ahead_m: f64| Some([pixel(ahead_m, left_m)?[0], pixel(ahead_m, right_m)?[0]]);
        let ([near_left, near_right], far) = (ends(near_m)?, ends(far_m)?);
        near_px = axis.max(near_left).min(near_right.max(near_left));
        let from_axis = far.map(|end| (end - axis).abs());
        far_px = far[usize::from(from_axis[1] > from_axis[0])];
    }
    let is_wide = left_m > right_m;
    is_wide.then_some([
        pixel(near_m, left_m)?,
        pixel(near_m, right_m)?,
        pixel(far_m, right_m)?,
        pixel(far_m, left_m)?,
    ])
}

/// Where a side of the box is on the road: of an edge on its own side of the middle, what the near
/// end says; of one beyond the middle, what the far end says.
fn side_m(near_m: f64, far_m: f64, outward: f64) -> f64 {
    if near_m * outward > 0.0 {
        near_m
    } else {
        far_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::camera;

    /// The box around a rectangle on the road.
    fn box_around(ahead_m: [f64; 2], left_m: [f64; 2]) -> [f64; 4] {
        let camera = camera();
        let mut edges = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        let shares = || (0..=40).map(|step| f64::from(step) / 40.0);
        for (share_x, share_y) in shares().flat_map(|x| shares().map(move |y| (x, y))) {
            let x = ahead_m[0] + share_x * (ahead_m[1] - ahead_m[0]);
            let y = left_m[0] + share_y * (left_m[1] - left_m[0]);
            let [u, v] = camera.pixel_from_vehicle([x, y, 0.0]).unwrap();
            edges = [
                edges[0].min(u),
                edges[1].min(v),
                edges[2].max(u),
                edges[3].max(v),
            ];
        }
        edges
    }

    #[test]
    fn a_rectangle_along_the_way_comes_back() {
        let camera = camera();
        for left_m in [[-0.5, 0.6], [1.4, 2.8], [-4.0, -2.9], [-3.0, 5.0]] {
            let edges = box_around([8.0, 12.0], left_m);
            let outline = of(ElementKind::GroundSign, edges, Some(&camera)).unwrap();
            let expected = [
                [8.0, left_m[1]],
                [8.0, left_m[0]],
                [12.0, left_m[0]],
                [12.0, left_m[1]],
            ];
            for ([u, v, _], expected) in outline.into_iter().zip(expected) {
                let road = camera.road_from_pixel([u, v], &Surface::FLAT).unwrap();
                // The lens bends the ends of the box a little.
                let apart = (road[0] - expected[0]).hypot(road[1] - expected[1]);
                assert!(apart < 0.25, "{left_m:?}: {road:?} {expected:?}");
            }
        }
    }

    #[test]
    fn a_stop_line_is_its_middle_and_the_sky_holds_no_paint() {
        let camera = camera();
        let edges = box_around([9.0, 9.4], [-1.5, 1.7]);
        let line = of(ElementKind::StopLine, edges, Some(&camera)).unwrap();
        assert_eq!(line.len(), 2);
        let ends = line
            .iter()
            .map(|[u, v, _]| camera.road_from_pixel([*u, *v], &Surface::FLAT).unwrap());
        let ends: Vec<[f64; 3]> = ends.collect();
        assert!(
            (ends[0][0] - 9.2).abs() < 0.1 && (ends[0][1] - 1.7).abs() < 0.1,
            "{ends:?}"
        );
        assert!((ends[1][1] + 1.5).abs() < 0.1, "{ends:?}");
        assert_eq!(
            of(
                ElementKind::Crosswalk,
                [900.0, 100.0, 1000.0, 200.0],
                Some(&camera)
            ),
            None
        );
    }
}
