//! The outline on the road of paint that was seen as a box.
//!
//! A box is the picture's upright rectangle around paint that lies flat and gets narrower with its
//! distance. The paint is taken for a rectangle along the vehicle's way on flat ground: its near and
//! far end are those of the box, and each of its sides touches the box at the end that is farther
//! out in the picture: the near end of what lies beside the middle on that side, the far end else.

use tilefold_schemas::ElementKind;

use crate::camera::Camera;
use crate::surface::Surface;

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
    let middle = 0.5 * (left + right);
    let (near_m, far_m) = (road([middle, bottom])?[0], road([middle, top])?[0]);
    if far_m <= near_m {
        return None;
    }
    // To the left is positive. A line along the way lies farther out in the picture the nearer it is.
    let left_m = side_m(road([left, bottom])?[1], road([left, top])?[1], 1.0);
    let right_m = side_m(road([right, bottom])?[1], road([right, top])?[1], -1.0);
    let pixel = |x: f64, y: f64| camera.pixel_from_vehicle([x, y, 0.0]);
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
        for x in ahead_m {
            for y in left_m {
                let [u, v] = camera.pixel_from_vehicle([x, y, 0.0]).unwrap();
                edges = [
                    edges[0].min(u),
                    edges[1].min(v),
                    edges[2].max(u),
                    edges[3].max(v),
                ];
            }
        }
        edges
    }

    #[test]
    fn a_rectangle_along_the_way_comes_back() {
        let camera = camera();
        for left_m in [[-0.5, 0.6], [1.4, 2.8], [-4.0, -2.9], [-3.0, 9.0]] {
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
