//! Lines that were moved farther than a match reaches: gone from one place and new beside it.
//!
//! Taken by themselves they are a removal and an addition. A line that is gone from a stretch, with
//! a new one that runs along that stretch nearer than any lane is wide, is one line that was moved.

use std::collections::BTreeMap;

use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::station::Polyline;

/// Farther off than this it is another line, in metres: no lane is narrower.
pub(crate) const REACH_M: f64 = 2.5;
/// Share of the stretch that the new line covers at least, and share of the new line that lies
/// beside the stretch.
const COVERED: f64 = 0.5;
/// Step of the comparison, in metres.
const STEP_M: f64 = 2.0;
/// The place of a followed line, standard deviation in metres.
const FOLLOWED_SIGMA_M: f64 = 0.15;

/// Where mapped lines are gone: stretches by element, in metres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gone(BTreeMap<i64, Vec<(f64, f64)>>);

impl Gone {
    /// The stretches that records call removed.
    #[must_use]
    pub fn of<'a>(records: impl IntoIterator<Item = &'a ChangeRecord>) -> Self {
        let mut gone: BTreeMap<i64, Vec<(f64, f64)>> = BTreeMap::new();
        for record in records.into_iter().filter(|record| is_gone(record)) {
            if let Some(element) = record.element {
                let stretches = gone.entry(element).or_default();
                stretches.push((record.from_m, record.to_m));
            }
        }
        Self(gone)
    }

    /// Whether an element is gone at a station.
    #[must_use]
    pub fn is_gone(&self, element: i64, station_m: f64) -> bool {
        let stretches = self.0.get(&element);
        stretches.is_some_and(|stretches| {
            stretches
                .iter()
                .any(|&(from_m, to_m)| from_m <= station_m && station_m <= to_m)
        })
    }
}

fn is_gone(record: &ChangeRecord) -> bool {
    record.verdict == Verdict::Removed.code() && record.kind == ElementKind::LaneMarking.code()
}

/// Turns removals with a new line beside them into modifications; the additions that explain them
/// are taken out.
pub fn link(records: &mut [ChangeRecord], additions: &mut Vec<ChangeRecord>) {
    for record in records.iter_mut().filter(|record| is_gone(record)) {
        let found = additions.iter().enumerate();
        let beside = found.filter_map(|(index, added)| Some((index, beside(record, added)?)));
        let nearest = beside.min_by(|(a, (off_a, _)), (b, (off_b, _))| {
            off_a.abs().total_cmp(&off_b.abs()).then(a.cmp(b))
        });
        if let Some((index, (shift_m, sigma_m))) = nearest {
            let added = additions.remove(index);
            move_to(record, added, shift_m, sigma_m);
        }
    }
}

/// How far an addition lies beside a removed stretch, positive to the left, and the standard
/// deviation of that; none if it does not run along it.
fn beside(removed: &ChangeRecord, added: &ChangeRecord) -> Option<(f64, f64)> {
    if added.kind != ElementKind::LaneMarking.code() {
        return None;
    }
    let old = wkb::read(removed.geometry_old.as_deref()?).ok()?.points;
    let new = wkb::read(added.geometry_new.as_deref()?).ok()?.points;
    // Far apart in degrees: most pairs.
    let (a, b) = (old.first()?, new.first()?);
    if (a[1] - b[1]).abs() > 0.01 {
        return None;
    }
    let frame = LocalFrame::new([a[0], a[1], 0.0]);
    let plane = |points: &[[f64; 3]]| {
        Polyline::new(
            points
                .iter()
                .map(|&[lon, lat, _]| frame.to_enu([lon, lat, 0.0])),
        )
        .ok()
    };
    let (old, new) = (plane(&old)?, plane(&new)?);
    let steps = (new.length_m() / STEP_M).floor() as usize;
    let mut offsets_m: Vec<f64> = (0..=steps)
        .filter_map(|step| {
            let on = new.at(step as f64 * STEP_M);
            let at = old.project([on.point[0], on.point[1]]);
            let along = on.tangent[0] * at.tangent[0] + on.tangent[1] * at.tangent[1];
            let is_beside = at.distance_m <= REACH_M
                && (at.distance_m - at.offset_m.abs()) < 0.3
                && along.abs() > 0.9;
            is_beside.then_some(at.offset_m)
        })
        .collect();
    let covered_m = offsets_m.len() as f64 * STEP_M;
    if covered_m < COVERED * old.length_m() || covered_m < COVERED * new.length_m() {
        return None;
    }
    offsets_m.sort_by(f64::total_cmp);
    let median_m = offsets_m[offsets_m.len() / 2];
    let spread_m = offsets_m[offsets_m.len() * 3 / 4] - offsets_m[offsets_m.len() / 4];
    Some((median_m, FOLLOWED_SIGMA_M.hypot(spread_m / 1.35)))
}

fn move_to(record: &mut ChangeRecord, added: ChangeRecord, shift_m: f64, sigma_m: f64) {
    // Removed it is either way; it was moved as far as the new line is there.
    let moved = record.p_removed * added.p_added;
    record.p_modified += moved;
    record.p_removed -= moved;
    record.verdict = Verdict::Modified.code();
    record.evidence_fx += added.evidence_fx;
    record.shift_m = Some(shift_m);
    record.shift_sigma_m = Some(sigma_m);
    record.geometry_new = added.geometry_new;
    record.first_ns = record.first_ns.min(added.first_ns);
    record.last_ns = record.last_ns.max(added.last_ns);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight line to the east, `left_m` north of the equator, as a record.
    fn line(verdict: Verdict, left_m: f64, length_m: f64) -> ChangeRecord {
        let degrees = |metres: f64| metres / 111_195.0;
        let points: Vec<[f64; 3]> = [0.0, 0.5, 1.0]
            .map(|share| [degrees(share * length_m), degrees(left_m), 0.0])
            .to_vec();
        let geometry = Some(wkb::line(&points));
        let is_added = verdict == Verdict::Added;
        ChangeRecord {
            change: 1,
            element: (!is_added).then_some(7),
            kind: ElementKind::LaneMarking.code(),
            to_m: length_m,
            verdict: verdict.code(),
            p_no_change: 0.02,
            p_added: if is_added { 0.98 } else { 0.0 },
            p_removed: if is_added { 0.0 } else { 0.97 },
            p_modified: 0.01,
            log_odds: 3.9,
            vehicles: 6,
            passes: 8,
            exposed: 100,
            first_ns: 10,
            last_ns: 20,
            geometry_old: if is_added { None } else { geometry.clone() },
            geometry_new: if is_added { geometry } else { None },
            fusion_model: "calibrated".to_owned(),
            ..ChangeRecord::default()
        }
    }

    #[test]
    fn gone_here_and_new_beside_is_moved() {
        let mut records = vec![line(Verdict::Removed, 0.0, 80.0)];
        let mut additions = vec![
            line(Verdict::Added, 3.5, 80.0),
            line(Verdict::Added, 1.8, 70.0),
        ];
        link(&mut records, &mut additions);
        assert_eq!(records[0].verdict, Verdict::Modified.code());
        assert!((records[0].shift_m.unwrap() - 1.8).abs() < 0.02);
        assert!((records[0].p_modified - (0.01 + 0.97 * 0.98)).abs() < 1e-12);
        assert_eq!(additions.len(), 1, "the line of the next lane stays");
    }

    #[test]
    fn a_short_piece_beside_a_long_line_is_another_line() {
        let mut records = vec![line(Verdict::Removed, 0.0, 80.0)];
        let mut additions = vec![line(Verdict::Added, 1.8, 30.0)];
        link(&mut records, &mut additions);
        assert_eq!(records[0].verdict, Verdict::Removed.code());
        assert_eq!(additions.len(), 1);
    }

    #[test]
    fn what_is_gone_is_gone_on_its_stretch_only() {
        let mut removed = line(Verdict::Removed, 0.0, 80.0);
        (removed.from_m, removed.to_m) = (20.0, 50.0);
        let gone = Gone::of([&removed, &line(Verdict::Added, 2.0, 80.0)]);
        assert!(gone.is_gone(7, 30.0) && !gone.is_gone(7, 60.0) && !gone.is_gone(8, 30.0));
    }
}
