//! Stations: sections, places, projections; figures by hand and properties.

use proptest::prelude::*;
use tilefold_tiler::station::{Polyline, StationError, section_count, section_of, section_range};

fn corner() -> Polyline {
    Polyline::new([
        [0.0, 0.0, 0.0],
        [10.0, 0.0, 1.0],
        [10.0, 0.0, 9.0],
        [10.0, 20.0, 3.0],
    ])
    .expect("two places")
}

#[test]
fn sections_are_station_intervals_and_the_last_one_is_short() {
    for (length_m, count) in [
        (0.0, 1),
        (3.0, 1),
        (10.0, 1),
        (10.1, 2),
        (80.0, 8),
        (84.9, 9),
    ] {
        assert_eq!(section_count(length_m, 10.0), count, "{length_m}");
    }
    assert_eq!(section_count(80.000_03, 10.0), 8, "rounding is no section");
    assert_eq!(section_of(19.999, 84.9, 10.0), 1);
    assert_eq!(section_of(20.0, 84.9, 10.0), 2);
    assert_eq!(
        section_of(80.0, 80.0, 10.0),
        7,
        "the end belongs to the last"
    );
    assert_eq!(section_of(-3.0, 80.0, 10.0), 0);
    assert_eq!(section_range(8, 84.9, 10.0), [80.0, 84.9]);
    assert_eq!(section_range(7, 80.000_03, 10.0), [70.0, 80.000_03]);
}

#[test]
fn places_on_a_corner() {
    let line = corner();
    assert_eq!(line.length_m(), 30.0);
    assert_eq!(line.points().len(), 3, "the repeated vertex is dropped");
    let place = line.at(5.0);
    assert_eq!((place.point, place.tangent), ([5.0, 0.0, 0.5], [1.0, 0.0]));
    let place = line.at(20.0);
    assert_eq!(
        (place.point, place.tangent),
        ([10.0, 10.0, 2.0], [0.0, 1.0])
    );
    assert_eq!(line.at(-1.0).station_m, 0.0);
    assert_eq!(line.at(99.0).point, [10.0, 20.0, 3.0]);
    let stretch = line.between(5.0, 20.0);
    assert_eq!(
        stretch,
        [[5.0, 0.0, 0.5], [10.0, 0.0, 1.0], [10.0, 10.0, 2.0]]
    );
    assert!(line.between(20.0, 5.0).is_empty());
}

#[test]
fn left_is_positive() {
    let line = corner();
    let left = line.project([4.0, 2.0]);
    assert_eq!(
        (left.station_m, left.offset_m, left.distance_m),
        (4.0, 2.0, 2.0)
    );
    let right = line.project([13.0, 7.0]);
    assert_eq!((right.station_m, right.offset_m), (17.0, -3.0));
    let outside = line.project([13.0, -4.0]);
    assert_eq!(
        (outside.station_m, outside.offset_m, outside.distance_m),
        (10.0, -5.0, 5.0)
    );
    let before = line.project([-3.0, 4.0]);
    assert_eq!(
        (before.station_m, before.offset_m, before.distance_m),
        (0.0, 4.0, 5.0)
    );
    let behind = line.project([9.0, 22.0]);
    assert_eq!((behind.station_m, behind.offset_m), (30.0, 1.0));
}

#[test]
fn no_line_is_an_error() {
    let too_few = |points, distinct| Err(StationError::TooFewPoints { points, distinct });
    assert_eq!(Polyline::new([]), too_few(0, 0));
    assert_eq!(
        Polyline::new([[1.0, 2.0, 3.0], [1.0, 2.0, 4.0]]),
        too_few(2, 1)
    );
    let nan = Polyline::new([[0.0; 3], [f64::NAN, 0.0, 0.0]]);
    assert_eq!(nan, Err(StationError::NotFinite { index: 1 }));
    assert!(Polyline::of_element(&[]).is_err());
}

#[test]
fn an_element_is_measured_in_its_own_frame() {
    let points = [[8.4243, 49.0035, 115.0], [8.4254, 49.0035, 115.0]];
    let (frame, line) = Polyline::of_element(&points).unwrap();
    assert_eq!(frame.anchor(), points[0]);
    let ground_m = tilefold_tiler::geodesy::geodesic_m(points[0], points[1]);
    // 115 m above the ellipsoid a metre is 18 micrometres longer.
    assert!((line.length_m() / ground_m - 1.0 - 115.0 / 6.378e6).abs() < 1e-7);
}

fn line() -> impl Strategy<Value = Polyline> {
    proptest::collection::vec((-50.0..50.0_f64, -50.0..50.0_f64, 0.0..5.0_f64), 2..20)
        .prop_filter_map("needs a length", |points| {
            Polyline::new(points.into_iter().map(|(x, y, z)| [x, y, z])).ok()
        })
}

proptest! {
    #[test]
    fn what_lies_on_the_line_projects_onto_itself(line in line(), share in 0.0..=1.0_f64) {
        let place = line.at(share * line.length_m());
        let there = line.project([place.point[0], place.point[1]]);
        prop_assert!(there.distance_m < 1e-9);
        let again = line.at(there.station_m).point;
        prop_assert!((again[0] - place.point[0]).hypot(again[1] - place.point[1]) < 1e-8);
        prop_assert!((place.tangent[0].hypot(place.tangent[1]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn no_place_is_nearer(line in line(), x in -80.0..80.0_f64, y in -80.0..80.0_f64) {
        let nearest = line.project([x, y]);
        prop_assert!(nearest.offset_m.abs() <= nearest.distance_m);
        for step in 0..=200 {
            let place = line.at(line.length_m() * f64::from(step) / 200.0).point;
            prop_assert!((place[0] - x).hypot(place[1] - y) >= nearest.distance_m - 1e-9);
        }
    }

    #[test]
    fn a_reversed_line_has_the_other_side(line in line(), x in -80.0..80.0_f64, y in -80.0..80.0_f64) {
        let mut points = line.points().to_vec();
        points.reverse();
        let there = line.project([x, y]);
        let back = Polyline::new(points).unwrap().project([x, y]);
        prop_assert!((there.distance_m - back.distance_m).abs() < 1e-9);
    }

    #[test]
    fn sections_cover_the_line_once(length_m in 0.01..500.0_f64, section_m in 1.0..30.0_f64, share in 0.0..1.0_f64) {
        let count = section_count(length_m, section_m);
        prop_assert_eq!(section_range(0, length_m, section_m)[0], 0.0);
        prop_assert_eq!(section_range(count - 1, length_m, section_m)[1], length_m);
        for section in 1..count {
            let [before, own] = [section - 1, section].map(|k| section_range(k, length_m, section_m));
            prop_assert!((before[1] - own[0]).abs() < 1e-9 && own[0] < own[1]);
        }
        let [from_m, to_m] = section_range(section_of(share * length_m, length_m, section_m), length_m, section_m);
        prop_assert!(from_m <= share * length_m && share * length_m <= to_m);
    }
}
