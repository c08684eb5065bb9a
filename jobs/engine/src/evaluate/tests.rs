//! Hand-made cases: every rule of what is counted, one at a time.

use tilefold_formats::geojson::{Shape, TruthChange};
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};
use tilefold_tiler::geodesy::LocalFrame;

use super::bootstrap::Resamples;
use super::change::{self, ChangeScores, Network};
use super::claim::Criteria;
use super::geometry::{GeometryErrors, geometry};
use super::known::Known;
use super::outcome::outcomes;
use super::pair::Laid;
use super::place::Grid;
use super::{TypeScores, above_sweep};

/// A line eastwards from station 0: `[longitude_deg, latitude_deg, height_m]` of east and north
/// metres.
fn line(points_m: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let frame = LocalFrame::new([10.0, 50.0, 0.0]);
    let wgs84 = |&[east_m, north_m]: &[f64; 2]| frame.to_wgs84([east_m, north_m, 0.0]);
    points_m.iter().map(wgs84).collect()
}

/// A straight line of 100 m, this far to the left.
fn straight(left_m: f64) -> Vec<[f64; 3]> {
    line(&[[0.0, left_m], [100.0, left_m]])
}

/// A true change of element 7, whole.
fn truth(change_type: Verdict) -> TruthChange {
    TruthChange {
        element_id: Some(7),
        change_type,
        kind: ElementKind::LaneMarking,
        from_m: None,
        to_m: None,
        detail: None,
        since_ns: None,
        shape: Shape::Line,
        points: straight(0.0),
    }
}

fn stretch(from_m: f64, to_m: f64) -> TruthChange {
    TruthChange {
        from_m: Some(from_m),
        to_m: Some(to_m),
        ..truth(Verdict::Removed)
    }
}

/// What is claimed of element 7, surely and by many; an addition has no element.
fn claim(verdict: Verdict, from_m: f64, to_m: f64) -> ChangeRecord {
    let p = |of: Verdict| if of == verdict { 0.99 } else { 0.0 };
    let is_added = verdict == Verdict::Added;
    let on_road = matches!(verdict, Verdict::Added | Verdict::Modified);
    let wkb_line = wkb::line(&line(&[[from_m, 0.0], [to_m, 0.0]]));
    ChangeRecord {
        change: (from_m * 1e3) as i64,
        element: (!is_added).then_some(7),
        kind: ElementKind::LaneMarking.code(),
        from_m: if is_added { 0.0 } else { from_m },
        to_m: if is_added { to_m - from_m } else { to_m },
        verdict: verdict.code(),
        p_no_change: 0.01,
        p_added: p(Verdict::Added),
        p_removed: p(Verdict::Removed),
        p_modified: p(Verdict::Modified),
        log_odds: 4.6,
        vehicles: 9,
        passes: 9,
        exposed: 100,
        last_ns: 1,
        geometry_old: (!is_added).then(|| wkb_line.clone()),
        geometry_new: on_road.then(|| wkb_line.clone()),
        best_vehicle: 1,
        fusion_model: "calibrated".to_owned(),
        ..ChangeRecord::default()
    }
}

fn addition(points: &[[f64; 3]]) -> ChangeRecord {
    ChangeRecord {
        change: points.len() as i64,
        geometry_new: Some(wkb::line(points)),
        ..claim(Verdict::Added, 0.0, 100.0)
    }
}

fn removed(from_m: f64, to_m: f64) -> ChangeRecord {
    claim(Verdict::Removed, from_m, to_m)
}

/// Evaluates one network.
struct Made {
    records: Vec<ChangeRecord>,
    truth: Vec<TruthChange>,
}

impl Made {
    fn with<R>(&self, act: impl FnOnce(&[Network<'_>]) -> R) -> R {
        let known: Vec<Known<'_>> = self.truth.iter().map(Known::new).collect();
        let network = Network {
            grid: Grid {
                network: 0,
                side_m: 500.0,
            },
            known: &known,
            in_view: vec![true; known.len()],
            laid: Laid::new(&self.records, &known, above_sweep(Criteria::default())),
        };
        act(&[network])
    }

    fn scores(&self) -> ChangeScores {
        self.with(|networks| {
            let places = change::places(networks, &Default::default());
            let resamples = Resamples::draw(&places, 1);
            change::score(networks, Criteria::default().threshold, &resamples)
        })
    }

    fn geometry(&self) -> GeometryErrors {
        self.with(|networks| geometry(networks, Criteria::default().threshold))
    }
}

fn made(records: impl Into<Vec<ChangeRecord>>, truth: impl Into<Vec<TruthChange>>) -> Made {
    Made {
        records: records.into(),
        truth: truth.into(),
    }
}

/// `[true, claimed, right]` over all types.
fn counts(scores: &TypeScores) -> [u64; 3] {
    [scores.all.truth, scores.all.claimed, scores.all.right]
}

#[track_caller]
fn check(
    records: impl Into<Vec<ChangeRecord>>,
    truth: impl Into<Vec<TruthChange>>,
    expected: [u64; 3],
) {
    let scores = made(records, truth).scores();
    assert_eq!(counts(&scores.scores), expected, "[true, claimed, right]");
}

#[test]
fn a_claim_of_the_whole_is_right() {
    check([removed(0.0, 100.0)], [truth(Verdict::Removed)], [1, 1, 1]);
}

#[test]
fn the_type_must_agree() {
    let claim = claim(Verdict::Modified, 0.0, 100.0);
    let scores = made([claim], [truth(Verdict::Removed)]).scores().scores;
    assert_eq!(counts(&scores), [1, 1, 0]);
    // Wrong as a modification, missed as a removal.
    let modified = scores.by_type["modified"];
    assert_eq!((modified.truth, modified.claimed), (0, 1));
    assert_eq!((modified.precision, modified.recall), (Some(0.0), None));
    let removed = scores.by_type["removed"];
    assert_eq!((removed.precision, removed.recall), (None, Some(0.0)));
    assert_eq!((scores.all.f1, removed.f1), (None, None));
}

#[test]
fn the_kind_must_agree() {
    let claim = ChangeRecord {
        kind: ElementKind::StopLine.code(),
        ..removed(0.0, 100.0)
    };
    check([claim], [truth(Verdict::Removed)], [1, 1, 0]);
}

#[test]
fn the_element_must_be_the_same_where_both_name_one() {
    let beside = ChangeRecord {
        element: Some(8),
        ..removed(0.0, 100.0)
    };
    check([beside.clone()], [truth(Verdict::Removed)], [1, 1, 0]);
    // Where the truth names none, it is where it is.
    let nameless = TruthChange {
        element_id: None,
        ..truth(Verdict::Removed)
    };
    check([beside], [nameless], [1, 1, 1]);
}

#[test]
fn one_metre_is_near_enough() {
    let truth = [truth(Verdict::Added)];
    check([addition(&straight(0.99))], truth.clone(), [1, 1, 1]);
    check([addition(&straight(1.01))], truth.clone(), [1, 1, 0]);
    check([addition(&straight(-0.99))], truth, [1, 1, 1]);
}

#[test]
fn half_of_the_change_is_enough() {
    let truth = [truth(Verdict::Removed)];
    check([removed(0.0, 50.0)], truth.clone(), [1, 1, 1]);
    check([removed(0.0, 49.0)], truth, [1, 1, 0]);
    let added = [TruthChange {
        element_id: None,
        ..self::truth(Verdict::Added)
    }];
    let of_length = |to_m| addition(&line(&[[0.0, 0.0], [to_m, 0.0]]));
    check([of_length(51.0)], added.clone(), [1, 1, 1]);
    check([of_length(47.0)], added, [1, 1, 0]);
}

#[test]
fn a_stretch_is_found_by_its_stations() {
    let truth = [stretch(20.0, 60.0)];
    check([removed(20.0, 60.0)], truth.clone(), [1, 1, 1]);
    check([removed(40.0, 100.0)], truth.clone(), [1, 1, 1]);
    check([removed(45.0, 100.0)], truth.clone(), [1, 1, 0]);
    check([removed(70.0, 90.0)], truth.clone(), [1, 1, 0]);
    // The whole line for a stretch of it is right; the metres say that it overreaches.
    let scores = made([removed(0.0, 100.0)], truth).scores();
    assert_eq!(counts(&scores.scores), [1, 1, 1]);
    assert_eq!(scores.metres.claimed, 100.0);
    assert_eq!((scores.metres.truth, scores.metres.right), (40.0, 40.0));
}

#[test]
fn a_stretch_without_an_element_is_cut_out_of_its_line() {
    let truth = [TruthChange {
        element_id: None,
        ..stretch(20.0, 60.0)
    }];
    // Geometry of the whole line: only metres 20 to 60 of it are the change.
    check([removed(20.0, 60.0)], truth.clone(), [1, 1, 1]);
    check([removed(60.0, 100.0)], truth, [1, 1, 0]);
}

#[test]
fn pieces_of_one_change_add_up() {
    let truth = [truth(Verdict::Removed)];
    // Neither is half of it, both are; they are one right claim and no wrong one.
    check([removed(0.0, 30.0), removed(60.0, 90.0)], truth, [1, 1, 1]);
    // The same of an addition in two pieces.
    let added = [self::truth(Verdict::Added)];
    let pieces = [
        addition(&line(&[[0.0, 0.2], [40.0, 0.2]])),
        addition(&line(&[[50.0, 0.2], [70.0, 0.2], [95.0, 0.2]])),
    ];
    check(pieces, added, [1, 1, 1]);
}

#[test]
fn pieces_that_cover_too_little_are_wrong_once() {
    let truth = [truth(Verdict::Removed)];
    check([removed(0.0, 20.0), removed(60.0, 80.0)], truth, [1, 1, 0]);
}

#[test]
fn stretches_of_an_unchanged_element_are_wrong_once() {
    let stretches = [removed(0.0, 20.0), removed(40.0, 60.0), removed(80.0, 90.0)];
    check(stretches.clone(), [], [0, 1, 0]);
    let two_types = [stretches[0].clone(), claim(Verdict::Modified, 40.0, 60.0)];
    check(two_types, [], [0, 2, 0]);
    let other_element = ChangeRecord {
        element: Some(8),
        ..stretches[1].clone()
    };
    check([stretches[0].clone(), other_element], [], [0, 2, 0]);
    // Additions have no element that would make them one.
    let additions = [
        addition(&straight(3.0)),
        addition(&line(&[[0.0, 9.0], [50.0, 9.0], [99.0, 9.0]])),
    ];
    check(additions, [], [0, 2, 0]);
}

#[test]
fn a_right_stretch_does_not_excuse_a_wrong_one() {
    let records = [removed(0.0, 40.0), removed(80.0, 90.0)];
    check(records, [stretch(0.0, 40.0)], [1, 2, 1]);
}

#[test]
fn a_double_is_wrong() {
    let surest = ChangeRecord {
        p_added: 0.995,
        ..addition(&straight(0.1))
    };
    let double = addition(&line(&[[0.0, -0.3], [50.0, -0.3], [100.0, -0.3]]));
    let made = made([double.clone(), surest.clone()], [truth(Verdict::Added)]);
    assert_eq!(counts(&made.scores().scores), [1, 2, 1]);
    let outcomes = made.with(|networks| outcomes(&networks[0], 0.85, &made.records));
    let fates: Vec<_> = outcomes.iter().map(|o| (o.outcome, o.posterior)).collect();
    assert_eq!(fates, [("right", Some(0.995)), ("wrong", Some(0.99))]);
    // What adds a little to a found change is a piece of it, even if it overlaps.
    let longer = addition(&line(&[
        [60.0, 0.0],
        [80.0, 0.0],
        [90.0, 0.0],
        [160.0, 0.0],
    ]));
    let half = ChangeRecord {
        p_added: 0.995,
        ..addition(&line(&[[0.0, 0.0], [75.0, 0.0]]))
    };
    check([half, longer], [truth(Verdict::Added)], [1, 1, 1]);
}

#[test]
fn one_claim_may_find_two_changes() {
    let way = |from_m, to_m| TruthChange {
        element_id: None,
        points: line(&[[from_m, 0.0], [to_m, 0.0]]),
        ..truth(Verdict::Added)
    };
    let whole = addition(&line(&[[0.0, 0.3], [160.0, 0.3]]));
    check([whole], [way(0.0, 80.0), way(80.0, 160.0)], [2, 2, 2]);
}

#[test]
fn two_stretches_of_one_element_are_two_changes() {
    let truth = [stretch(0.0, 20.0), stretch(80.0, 100.0)];
    check([removed(0.0, 20.0)], truth.clone(), [2, 1, 1]);
    check([removed(0.0, 20.0), removed(80.0, 100.0)], truth, [2, 2, 2]);
}

#[test]
fn what_is_unsure_or_seen_by_few_is_no_claim() {
    let truth = || [truth(Verdict::Removed)];
    let unsure = ChangeRecord {
        p_removed: 0.84,
        ..removed(0.0, 100.0)
    };
    let few = ChangeRecord {
        vehicles: 4,
        ..removed(0.0, 100.0)
    };
    let unknown = ChangeRecord {
        verdict: Verdict::Unknown.code(),
        ..removed(0.0, 100.0)
    };
    check([unsure.clone()], truth(), [1, 0, 0]);
    check([few], truth(), [1, 0, 0]);
    check([unknown], truth(), [1, 0, 0]);
    let sweep = made([unsure], truth()).scores().sweep;
    let found: Vec<(f64, u64)> = sweep
        .iter()
        .map(|point| (point.threshold, point.scores.all.right))
        .collect();
    let expected = [
        (0.70, 1),
        (0.75, 1),
        (0.80, 1),
        (0.85, 0),
        (0.90, 0),
        (0.95, 0),
    ];
    assert_eq!(found, expected);
}

#[test]
fn nothing_claimed_and_nothing_true() {
    let scores = made([], []).scores().scores;
    assert_eq!(counts(&scores), [0, 0, 0]);
    assert_eq!((scores.all.precision, scores.all.recall), (None, None));
    check([], [truth(Verdict::Removed)], [1, 0, 0]);
    check([removed(0.0, 100.0)], [], [0, 1, 0]);
}

#[test]
fn details_have_a_recall() {
    let detailed = |id, detail: &str| TruthChange {
        element_id: Some(id),
        detail: Some(detail.to_owned()),
        ..truth(Verdict::Removed)
    };
    let truth = [
        detailed(7, "lane_dropped"),
        detailed(8, "lane_dropped"),
        detailed(9, "construction"),
        self::truth(Verdict::Added),
    ];
    let by_detail = made([removed(0.0, 100.0)], truth).scores().by_detail;
    let found: Vec<(&str, u64, u64)> = by_detail
        .iter()
        .map(|(detail, found)| (detail.as_str(), found.truth, found.right))
        .collect();
    assert_eq!(found, [("construction", 1, 0), ("lane_dropped", 2, 1)]);
}

#[test]
fn areas_and_points_have_places_too() {
    let square = |left_m: f64| {
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        line(&corners.map(|[east_m, north_m]| [east_m, north_m + left_m]))
    };
    let crosswalk = TruthChange {
        kind: ElementKind::Crosswalk,
        shape: Shape::Area,
        points: square(0.0),
        ..truth(Verdict::Added)
    };
    let seen = |left_m| ChangeRecord {
        kind: ElementKind::Crosswalk.code(),
        geometry_new: Some(wkb::polygon(&square(left_m))),
        ..claim(Verdict::Added, 0.0, 1.0)
    };
    check([seen(0.5)], [crosswalk.clone()], [1, 1, 1]);
    check([seen(8.0)], [crosswalk], [1, 1, 0]);
    let point = TruthChange {
        shape: Shape::Point,
        points: line(&[[50.0, 0.5]]),
        ..truth(Verdict::Added)
    };
    check([addition(&straight(0.0))], [point], [1, 1, 1]);
    let nowhere = TruthChange {
        shape: Shape::None,
        points: Vec::new(),
        ..truth(Verdict::Removed)
    };
    check([removed(0.0, 100.0)], [nowhere], [1, 1, 1]);
}

#[test]
fn lateral_errors_by_hand() {
    // 0.3 m to the left, and 20 m beyond the end: what lies beyond is not lateral.
    let added = addition(&line(&[[0.0, 0.3], [120.0, 0.3]]));
    let errors = made([added], [truth(Verdict::Added)]).geometry();
    assert_eq!(errors.added_lines, 1);
    let median_m = errors.added_lateral_median_m.unwrap();
    assert!((median_m - 0.3).abs() < 1e-3, "{median_m}");
    assert!((errors.added_lateral_p95_m.unwrap() - 0.3).abs() < 1e-3);
    assert_eq!(errors.added_within_90, None);
    assert_eq!(errors.modified_lateral_median_m, None);
}

#[test]
fn the_interval_of_a_shift_holds_the_truth_or_not() {
    let moved = |left_m: f64, sigma_m| ChangeRecord {
        geometry_new: Some(wkb::line(&straight(left_m))),
        shift_m: Some(left_m),
        shift_sigma_m: Some(sigma_m),
        ..claim(Verdict::Modified, 0.0, 100.0)
    };
    let truth = TruthChange {
        points: straight(1.2),
        ..truth(Verdict::Modified)
    };
    // 0.2 m off: within 1.645 * 0.15 = 0.247, not within 1.645 * 0.1 = 0.165.
    let within = |sigma_m| {
        let errors = made([moved(1.0, sigma_m)], [truth.clone()]).geometry();
        assert!((errors.modified_lateral_median_m.unwrap() - 0.2).abs() < 1e-3);
        errors.modified_within_90
    };
    assert_eq!((within(0.15), within(0.1)), (Some(1.0), Some(0.0)));
    // Repainted, not moved: nothing to measure.
    let repainted = ChangeRecord {
        geometry_new: None,
        ..claim(Verdict::Modified, 0.0, 100.0)
    };
    assert_eq!(made([repainted], [truth]).geometry().modified_lines, 0);
}

#[test]
fn what_was_not_looked_at_is_neither_missed_nor_wrong() {
    let truth = [truth(Verdict::Removed)];
    let known: Vec<Known<'_>> = truth.iter().map(Known::new).collect();
    let records = [removed(0.0, 20.0)];
    let score = |in_view| {
        let networks = [Network {
            grid: Grid {
                network: 0,
                side_m: 500.0,
            },
            known: &known,
            in_view: vec![in_view],
            laid: Laid::new(&records, &known, Criteria::default()),
        }];
        let resamples = Resamples::draw(&change::places(&networks, &Default::default()), 1);
        counts(&change::score(&networks, 0.85, &resamples).scores)
    };
    assert_eq!(score(true), [1, 1, 0]);
    assert_eq!(score(false), [0, 0, 0]);
}
