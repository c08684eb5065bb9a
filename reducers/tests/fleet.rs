//! Fleets with bad vehicles, and roads that change while they are driven: hand-made ledgers whose
//! truth is known, through the reducers as a job calls them.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use tilefold_reducers::{Fold, FusionModel, SensorModel, elements, fit};
use tilefold_schemas::evidence::{CLASS_BINS, WINDOW_NS, to_window_ms};
use tilefold_schemas::{
    ChangeRecord, Color, Element, ElementId, ElementKind, EvidenceRow, Marking, SignClass, Verdict,
    fixed,
};
use tilefold_tiler::map_index::MappedElement;

const DAY_NS: i64 = 86_400_000_000_000;
const FRAMES: i32 = 10;

/// Lines of 30 m.
fn line(id: i64) -> MappedElement {
    let at = |metres: f64| [10.0 + metres / 71_700.0, 50.0 + id as f64 * 1e-4, 0.0];
    let element = Element {
        id: ElementId(id),
        kind: ElementKind::LaneMarking,
        marking: Marking::Solid,
        color: Color::White,
        sign: SignClass::default(),
        points: vec![at(0.0), at(15.0), at(30.0)],
        tags: std::collections::BTreeMap::new(),
    };
    MappedElement::new(element, 15).unwrap()
}

/// What a pass says of a whole line: hits of ten frames in each section, and where they lie.
fn pass(
    mapped: &MappedElement,
    vehicle: i64,
    at_ns: i64,
    hits: i32,
    left_m: f64,
) -> Vec<EvidenceRow> {
    let information = f64::from(hits) / (0.2 * 0.2);
    let window = at_ns.div_euclid(WINDOW_NS);
    let at_ms = to_window_ms(window, at_ns);
    let row = |section: i32| EvidenceRow {
        tile: mapped.tile.0,
        element: mapped.element.id.0,
        content: mapped.content.0,
        section,
        vehicle,
        channel: 0,
        window,
        method: 3,
        model: 0,
        exposed: FRAMES,
        hit: hits,
        sum_v_q8: fixed::to_q8(0.9 * f64::from(FRAMES)),
        sum_w_no_q8: 0,
        sum_w_add_q8: 0,
        sum_w_del_q8: 0,
        sum_w_mod_q8: 0,
        residual_eta_q8: fixed::to_q8(left_m * information),
        residual_lambda_q8: fixed::to_q8(information),
        along_eta_q8: 0,
        along_lambda_q8: 0,
        seen: [0; CLASS_BINS],
        first_ms: at_ms,
        last_after_ms: 1_000,
        best_after_ms: 0,
        best_v_q8: 0,
    };
    (0..3).map(row).collect()
}

fn judged(mapped: &MappedElement, rows: &[EvidenceRow], sensor: &SensorModel) -> ChangeRecord {
    let of: Vec<&EvidenceRow> = rows
        .iter()
        .filter(|row| row.element == mapped.element.id.0)
        .collect();
    let fold = Fold::of_fleet(FusionModel::Calibrated, sensor.clone());
    elements::judge(mapped, &of, &fold).remove(0)
}

fn fitted(lines: &[MappedElement], rows: &[EvidenceRow]) -> SensorModel {
    let of = |mapped: &MappedElement| {
        let element = mapped.element.id.0;
        rows.iter().filter(|row| row.element == element).collect()
    };
    let all: Vec<(&MappedElement, Vec<&EvidenceRow>)> =
        lines.iter().map(|mapped| (mapped, of(mapped))).collect();
    fit::fit(&all)
}

#[test]
fn one_vehicle_that_lies_ten_thousand_times_is_outweighed() {
    let mapped = line(1);
    let mut rows = Vec::new();
    for vehicle in 1..=5 {
        rows.extend(pass(&mapped, vehicle, vehicle * DAY_NS, 8, 0.0));
    }
    for lie in 0..10_000 {
        rows.extend(pass(&mapped, 99, 3 * DAY_NS + lie * 60_000_000_000, 0, 0.0));
    }
    let record = judged(&mapped, &rows, &SensorModel::default());
    assert_eq!(record.verdict, Verdict::NoChange.code(), "{record:?}");
}

/// Sixty lines, every tenth gone. Five of ten vehicles are honest.
fn with_liars(lie: impl Fn(bool) -> (i32, f64)) -> (Vec<MappedElement>, Vec<EvidenceRow>) {
    let lines: Vec<MappedElement> = (1..=60).map(line).collect();
    let mut rows = Vec::new();
    for mapped in &lines {
        let is_gone = mapped.element.id.0 % 10 == 0;
        for vehicle in 1..=10 {
            let (hits, left_m) = match (vehicle > 5, is_gone) {
                (true, _) => lie(is_gone),
                (false, true) => (0, 0.0),
                // Honest vehicles miss a little, each in its own way, and waver by a decimetre.
                (false, false) => {
                    let lot = (vehicle * 7 + mapped.element.id.0 * 3) % 5;
                    (9 - lot as i32, 0.05 * (lot as f64 - 2.0))
                }
            };
            // Honest ones and liars by turns: all of one kind after the other would be a change.
            let at_ns = vehicle * 7 % 10 * DAY_NS + mapped.element.id.0 * 60_000_000_000;
            rows.extend(pass(mapped, vehicle, at_ns, hits, left_m));
        }
    }
    (lines, rows)
}

/// No verdict is wrong, honest vehicles count as such, and the liars stand out as `is_named` says.
fn assert_seen_through(
    (lines, rows): &(Vec<MappedElement>, Vec<EvidenceRow>),
    is_named: impl Fn(&tilefold_reducers::sensor::VehicleModel) -> bool,
) {
    let sensor = fitted(lines, rows);
    for mapped in lines {
        let record = judged(mapped, rows, &sensor);
        let truth = match mapped.element.id.0 % 10 == 0 {
            true => Verdict::Removed,
            false => Verdict::NoChange,
        };
        let said = Verdict::from_code(record.verdict).unwrap();
        assert!(
            said == truth || said == Verdict::Unknown,
            "{}: {said:?}, p = {:?}",
            mapped.element.id.0,
            (record.p_no_change, record.p_removed, record.p_modified)
        );
    }
    for (vehicle, model) in &sensor.vehicles {
        assert_eq!(is_named(model), *vehicle > 5, "{vehicle}: {model:?}");
    }
}

#[test]
fn half_a_fleet_that_sees_nothing_removes_nothing() {
    let blind = with_liars(|_| (0, 0.0));
    assert_seen_through(&blind, |model| model.detection < 0.6);
}

#[test]
fn a_line_that_was_taken_away_is_gone_since_then() {
    let mapped = line(1);
    let mut rows = Vec::new();
    for day in 0..20 {
        let hits = if day < 14 { 8 } else { 0 };
        rows.extend(pass(&mapped, day % 8 + 1, day * DAY_NS, hits, 0.0));
    }
    let record = judged(&mapped, &rows, &SensorModel::default());
    assert_eq!(record.verdict, Verdict::Removed.code(), "{record:?}");
    let (after, before) = (
        record.changed_after_ns.unwrap(),
        record.changed_before_ns.unwrap(),
    );
    assert_eq!((after / DAY_NS, before / DAY_NS), (13, 14));
}

#[test]
fn a_line_that_was_gone_for_a_while_is_back() {
    let mapped = line(1);
    let mut rows = Vec::new();
    for day in 0..30 {
        let hits = if (8..18).contains(&day) { 0 } else { 8 };
        rows.extend(pass(&mapped, day % 8 + 1, day * DAY_NS, hits, 0.0));
    }
    let record = judged(&mapped, &rows, &SensorModel::default());
    assert_eq!(record.verdict, Verdict::NoChange.code(), "{record:?}");
    let until: Vec<EvidenceRow> = rows
        .into_iter()
        .filter(|row| row.first_ns() < 17 * DAY_NS)
        .collect();
    let record = judged(&mapped, &until, &SensorModel::default());
    assert_eq!(record.verdict, Verdict::Removed.code(), "{record:?}");
}
