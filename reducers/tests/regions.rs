//! Regions: what lies beside each other is one, in whatever order and tiles it comes.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use tilefold_reducers::regions::regions;
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};

/// A line of 40 m to the east, `north_m` off the equator, in a tile of its own.
fn line(change: i64, verdict: Verdict, north_m: f64) -> ChangeRecord {
    let at = |east_m: f64| [east_m / 111_000.0, north_m / 111_000.0, 0.0];
    let geometry = Some(wkb::line(&[at(0.0), at(40.0)]));
    let is_added = verdict == Verdict::Added;
    ChangeRecord {
        tile: change as i32 % 3,
        change,
        element: (!is_added).then_some(change),
        kind: ElementKind::LaneMarking.code(),
        to_m: 40.0,
        verdict: verdict.code(),
        p_no_change: 0.1,
        log_odds: 2.0,
        vehicles: 5,
        passes: 5,
        exposed: 1,
        last_ns: 1,
        changed_before_ns: (change == 4).then_some(77),
        geometry_old: if is_added { None } else { geometry.clone() },
        geometry_new: if is_added { geometry } else { None },
        fusion_model: "calibrated".to_owned(),
        ..ChangeRecord::default()
    }
}

fn road() -> Vec<ChangeRecord> {
    vec![
        line(1, Verdict::Removed, 0.0),
        line(2, Verdict::Removed, 4.0),
        line(3, Verdict::Added, 2.0),
        line(4, Verdict::Added, 8.0),
        line(5, Verdict::NoChange, 12.0),
        line(6, Verdict::Modified, 16.0),
    ]
}

#[test]
fn lines_that_give_way_to_others_are_a_construction_site() {
    let regions = regions(&road());
    let summaries: Vec<String> = regions.iter().map(|region| region.summary()).collect();
    // What did not change joins nothing: the modified line lies 8 m beside its neighbour.
    assert_eq!(
        summaries,
        [
            "1 line modified",
            "construction site: 2 lines added, 2 removed"
        ]
    );
    assert_eq!(regions[1].changes, [3, 1, 4, 2], "by tile, then by id");
    assert_eq!((regions[1].tile, regions[1].since_ns), (0, Some(77)));
}

#[test]
fn the_order_of_records_does_not_matter() {
    let mut records = road();
    let found = regions(&records);
    records.reverse();
    assert_eq!(regions(&records), found);
    records.rotate_left(2);
    assert_eq!(regions(&records), found);
}

#[test]
fn an_outline_goes_around_its_changes() {
    let site = regions(&road()).remove(1);
    let metres = |[lon, lat]: [f64; 2]| [lon * 111_000.0, lat * 111_000.0];
    let corners: Vec<[f64; 2]> = site.outline.into_iter().map(metres).collect();
    let area: f64 = (0..corners.len())
        .map(|at| {
            let (a, b) = (corners[at], corners[(at + 1) % corners.len()]);
            0.5 * (a[0] * b[1] - a[1] * b[0])
        })
        .sum();
    // 44 m by 12 m, counter-clockwise.
    assert!((area - 528.0).abs() < 10.0, "{area}");
}
