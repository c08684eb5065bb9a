//! What would flip a verdict: how many more passes, of vehicles that never came before and see the
//! contrary.
//!
//! Nothing is estimated: such passes are made up, beside those that are there, and the element is
//! judged anew with them.

use tilefold_schemas::evidence::{CLASS_BINS, WINDOW_NS, to_window_ms};
use tilefold_schemas::{ChangeRecord, EvidenceRow, Verdict, fixed};
use tilefold_tiler::map_index::MappedElement;

use crate::elements;
use crate::fold::Fold;
use crate::paper;

/// More than this many are not tried.
const MOST: i64 = 40;
/// Time between the passes that are made up.
const APART_NS: i64 = 3_600_000_000_000;
/// They see what is there in this share of their frames...
const SEEN: f64 = 0.9;
/// ... and place it to this, in metres.
const SIGMA_M: f64 = 0.2;

/// What would flip a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flip {
    /// Passes of as many vehicles.
    pub passes: i64,
    /// Whether they see the element as mapped, or nothing.
    pub see_it: bool,
    /// What is said then.
    pub verdict: Verdict,
}

/// The fewest passes like the clearest one there is that change what is said of a stretch of an
/// element; none if nobody looked, or if many do not.
#[must_use]
pub fn flip(
    mapped: &MappedElement,
    rows: &[&EvidenceRow],
    fold: &Fold,
    record: &ChangeRecord,
) -> Option<Flip> {
    let of_now = || rows.iter().filter(|row| row.content == mapped.content.0);
    let clearest = of_now().max_by_key(|row| (row.sum_v_q8, row.vehicle, row.window))?;
    let last_ns = of_now().map(|row| row.last_ns()).max()?;
    let see_it = record.verdict != Verdict::NoChange.code();
    let template: Vec<EvidenceRow> = of_now()
        .filter(|row| row.vehicle == clearest.vehicle && row.window.abs_diff(clearest.window) <= 1)
        .map(|row| contrary(row, mapped, see_it))
        .collect();
    let mut all: Vec<EvidenceRow> = rows.iter().map(|row| (*row).clone()).collect();
    let middle_m = 0.5 * (record.from_m + record.to_m);
    for passes in 1..=MOST {
        let at_ns = last_ns + passes * APART_NS;
        all.extend(template.iter().map(|row| newcomer(row, passes, at_ns)));
        let judged = elements::judge(mapped, &all.iter().collect::<Vec<_>>(), fold);
        let now = judged
            .iter()
            .find(|now| now.from_m <= middle_m && middle_m <= now.to_m);
        let verdict = now.map_or(Some(Verdict::NoChange), |now| {
            Verdict::from_code(now.verdict)
        });
        if let Some(verdict) = verdict.filter(|verdict| verdict.code() != record.verdict) {
            return Some(Flip {
                passes,
                see_it,
                verdict,
            });
        }
    }
    None
}

/// A row of the same looks that saw the element as mapped, or nothing.
fn contrary(row: &EvidenceRow, mapped: &MappedElement, see_it: bool) -> EvidenceRow {
    let share = if see_it { SEEN } else { 0.0 };
    let hit = (share * f64::from(row.exposed)).round() as i32;
    let lambda_q8 = fixed::to_q8(f64::from(hit) * SIGMA_M.powi(-2));
    let weight: f64 = paper::weight_q8(row.paper_q8());
    let mut seen = [0; CLASS_BINS];
    let as_mapped = match mapped.element.kind {
        tilefold_schemas::ElementKind::LaneMarking => mapped.element.marking.code(),
        _ => mapped.element.sign.code(),
    };
    if let Some(bin) = seen.get_mut(as_mapped as usize) {
        *bin = hit;
    }
    EvidenceRow {
        hit,
        seen,
        residual_eta_q8: 0,
        residual_lambda_q8: lambda_q8,
        along_eta_q8: 0,
        along_lambda_q8: if row.along_lambda_q8 > 0 {
            lambda_q8
        } else {
            0
        },
        sum_w_no_q8: (share * weight) as i64,
        sum_w_add_q8: 0,
        sum_w_del_q8: ((1.0 - share) * weight) as i64,
        sum_w_mod_q8: 0,
        ..row.clone()
    }
}

/// The same row by a vehicle that never came before, later.
fn newcomer(row: &EvidenceRow, number: i64, at_ns: i64) -> EvidenceRow {
    let window = at_ns.div_euclid(WINDOW_NS);
    let at_ms = to_window_ms(window, at_ns);
    EvidenceRow {
        vehicle: tilefold_schemas::id::hash_text(&format!("newcomer {number}")),
        window,
        first_ms: at_ms,
        ..row.clone()
    }
}
