//! The paint of a map, as it lies on the plane for all times.

use tilefold_schemas::element::{Element, ElementKind};

use super::course::distance_m;
use super::ground::Ground;
use super::places::{CELL_M, Places};
use crate::world::{Lane, Paint, Point};

/// Every element, with its own id.
pub(super) fn paint(
    elements: &[Element],
    ground: &Ground,
    lanes: &[Lane],
    middles: &Places,
) -> Vec<Paint> {
    let painted = |element: &Element| {
        let places: Vec<_> = element
            .points
            .iter()
            .map(|point| ground.place(point))
            .collect();
        let places = match element.kind {
            ElementKind::Crosswalk | ElementKind::GroundSign => {
                let ahead = ahead(middle(&places), lanes, middles);
                as_driven_over(places, ahead)
            }
            ElementKind::LaneMarking | ElementKind::StopLine => places,
        };
        Paint {
            id: element.id.0,
            kind: element.kind,
            marking: element.marking,
            color: element.color,
            sign: element.sign,
            points: places.into_iter().map(|place| ground.lay(place)).collect(),
            phase_m: 0.0,
            wear: 0.0,
            since_ns: i64::MIN,
            until_ns: i64::MAX,
        }
    };
    elements.iter().map(painted).collect()
}

/// The direction in which the nearest lane is driven; east if there is none.
fn ahead(at: [f64; 2], lanes: &[Lane], middles: &Places) -> [f64; 2] {
    let near = middles.near(at, CELL_M);
    let nearest = near.min_by(|a, b| distance_m(a.at, at).total_cmp(&distance_m(b.at, at)));
    let Some(spot) = nearest else {
        return [1.0, 0.0];
    };
    let centre = &lanes[spot.lane].centre;
    let last = centre.len() - 1;
    let [from, to]: [Point; 2] = [
        centre[spot.point.saturating_sub(1)],
        centre[(spot.point + 1).min(last)],
    ];
    let length_m = distance_m([from[0], from[1]], [to[0], to[1]]).max(f64::MIN_POSITIVE);
    [(to[0] - from[0]) / length_m, (to[1] - from[1]) / length_m]
}

/// An outline counter-clockwise from its rear right corner.
fn as_driven_over(mut outline: Vec<[f64; 2]>, [ahead_e, ahead_n]: [f64; 2]) -> Vec<[f64; 2]> {
    if twice_area_m2(&outline) < 0.0 {
        outline.reverse();
    }
    // Metres ahead and to the left, together: least at the rear right.
    let rank = |[e, n]: [f64; 2]| (e * ahead_e + n * ahead_n) + (n * ahead_e - e * ahead_n);
    let corners = outline.iter().enumerate();
    let first = corners.min_by(|a, b| rank(*a.1).total_cmp(&rank(*b.1)));
    let first = first.map_or(0, |(corner, _)| corner);
    outline.rotate_left(first);
    outline
}

fn middle(outline: &[[f64; 2]]) -> [f64; 2] {
    let count = outline.len().max(1) as f64;
    [0, 1].map(|axis| outline.iter().map(|place| place[axis]).sum::<f64>() / count)
}

fn twice_area_m2(outline: &[[f64; 2]]) -> f64 {
    let after = outline.iter().cycle().skip(1);
    let sides = outline.iter().zip(after);
    sides.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_begins_at_the_rear_right() {
        let square = [[0.0, 0.0], [0.0, 2.0], [4.0, 2.0], [4.0, 0.0]];
        let turned = as_driven_over(square.to_vec(), [1.0, 0.0]);
        assert_eq!(turned, [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]);
        let northwards = as_driven_over(square.to_vec(), [0.0, 1.0]);
        assert_eq!(northwards[0], [4.0, 0.0]);
        assert_eq!(northwards[1], [4.0, 2.0]);
    }
}
