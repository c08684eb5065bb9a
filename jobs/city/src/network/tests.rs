use std::collections::BTreeSet;

use super::*;

const ANCHOR: [f64; 3] = [10.0, 50.0, 300.0];

fn distance_m(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn length_m(points: &[Point]) -> f64 {
    points.windows(2).map(|p| distance_m(p[0], p[1])).sum()
}

#[test]
fn every_lane_leads_on_to_where_the_next_begins() {
    for seed in 0..20 {
        let world = draw(seed, 6.0, ANCHOR);
        for (index, lane) in world.lanes.iter().enumerate() {
            assert!(!lane.next.is_empty(), "seed {seed}: lane {index} ends");
            let end = lane.centre[lane.centre.len() - 1];
            for &next in &lane.next {
                let gap_m = distance_m(end, world.lanes[next].centre[0]);
                // Where a lane is gained, the new one begins beside the old.
                let beside_m = world.lanes[next].width_m + 0.1;
                assert!(gap_m < beside_m, "seed {seed}: {index} -> {next}: {gap_m}");
            }
        }
    }
}

#[test]
fn neighbours_lie_a_lane_apart_on_their_side() {
    let world = draw(3, 6.0, ANCHOR);
    for lane in &world.lanes {
        let Some(left) = lane.left else { continue };
        let neighbour = &world.lanes[left];
        assert_eq!(neighbour.right.map(|right| &world.lanes[right]), Some(lane));
        // Where a lane comes or goes, it lies on its neighbour: not so half-way.
        let middle = lane.centre.len() / 2;
        let [from, to] = [lane.centre[middle], lane.centre[middle + 1]];
        let [along_e, along_n] = [to[0] - from[0], to[1] - from[1]];
        let beside = neighbour.centre[middle];
        let aside = [beside[0] - from[0], beside[1] - from[1]];
        let left_m = (along_e * aside[1] - along_n * aside[0]) / along_e.hypot(along_n);
        assert!(left_m > 0.0 && left_m < lane.width_m + 0.2, "{left_m}");
    }
}

#[test]
fn all_kinds_of_paint_and_all_signs_appear() {
    let world = draw(1, 60.0, ANCHOR);
    let kinds: BTreeSet<_> = world.paint.iter().map(|paint| paint.kind).collect();
    assert_eq!(kinds.len(), ElementKind::ALL.len());
    let signs: BTreeSet<_> = world.paint.iter().map(|paint| paint.sign).collect();
    // All but `other`; lines have none.
    assert_eq!(signs.len(), SignClass::ALL.len() - 1, "{signs:?}");
    let markings: BTreeSet<_> = world.paint.iter().map(|paint| paint.marking).collect();
    for marking in [
        Marking::Solid,
        Marking::Dashed,
        Marking::SolidSolid,
        Marking::SolidDashed,
    ] {
        assert!(markings.contains(&marking), "{marking}");
    }
}

#[test]
fn a_city_has_about_the_length_asked_for() {
    for km in [2.0, 10.0, 100.0] {
        let world = draw(5, km, ANCHOR);
        let kerbs: f64 = world.kerbs.iter().map(|kerb| length_m(kerb)).sum();
        let drawn_km = kerbs / 2_000.0;
        assert!((0.8..1.6).contains(&(drawn_km / km)), "{km}: {drawn_km}");
    }
}

#[test]
fn slopes_are_those_of_roads() {
    let world = draw(2, 20.0, ANCHOR);
    for lane in &world.lanes {
        for pair in lane.centre.windows(2) {
            let slope = (pair[1][2] - pair[0][2]) / distance_m(pair[0], pair[1]);
            assert!(slope.abs() < 0.06, "{slope}");
        }
    }
}

#[test]
fn the_seed_alone_decides() {
    assert_eq!(draw(4, 5.0, ANCHOR).paint, draw(4, 5.0, ANCHOR).paint);
    assert_ne!(draw(4, 5.0, ANCHOR).paint, draw(5, 5.0, ANCHOR).paint);
}
