//! The `paper` fusion model: Eq 19 to 22 of Zhang et al. as printed, with the decisions of
//! method.md, section 8. It is here to be compared with.

use tilefold_schemas::fixed;

use crate::passes::Pass;

/// Added before the logarithm, so that one vehicle costs at most 13.8 nats.
const EPSILON: f64 = 1e-6;

/// Posterior of no change, added, removed, modified (Eq 20 to 22), from the weighted averages of
/// all passes (Eq 19) and a uniform prior. Uniform without passes that carry weight.
#[must_use]
pub fn posterior(passes: &[Pass]) -> [f64; 4] {
    let mut sums_fx = [0_i64; 4];
    for pass in passes {
        for (sum, nats_fx) in sums_fx.iter_mut().zip(testimony(pass)) {
            *sum += nats_fx;
        }
    }
    softmax(sums_fx.map(fixed::to_f64))
}

/// What one pass says of the four hypotheses (Eq 20): quantised once and summed as integers, so that
/// order cannot matter. A pass without weight says nothing.
#[must_use]
pub fn testimony(pass: &Pass) -> [i64; 4] {
    let weight = weight_q8(pass.paper_q8);
    if weight <= 0.0 {
        return [0; 4];
    }
    pass.paper_q8.map(|share_q8| {
        let average = share_q8 as f64 / weight;
        fixed::from_f64(libm::log(average + EPSILON))
    })
}

/// The sum of the weights: the four shares of each were parts of it. As a float, which no damaged row
/// can overflow.
pub(crate) fn weight_q8(shares_q8: [i64; 4]) -> f64 {
    shares_q8.iter().map(|&share_q8| share_q8 as f64).sum()
}

/// Exponentials normalised to sum 1.
#[must_use]
pub fn softmax<const N: usize>(logs: [f64; N]) -> [f64; N] {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares = logs.map(|log| libm::exp(log - most));
    let total: f64 = shares.iter().sum();
    shares.map(|share| share / total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::EvidenceRow;
    use tilefold_schemas::evidence::CLASS_BINS;

    fn row(vehicle: i64, no: f64, del: f64) -> EvidenceRow {
        EvidenceRow {
            tile: 0,
            element: 1,
            content: 1,
            section: 0,
            vehicle,
            channel: 0,
            window: 0,
            method: 1,
            model: 0,
            exposed: 10,
            hit: 5,
            sum_v_q8: fixed::to_q8(8.0),
            sum_w_no_q8: fixed::to_q8(no),
            sum_w_add_q8: 0,
            sum_w_del_q8: fixed::to_q8(del),
            sum_w_mod_q8: 0,
            residual_eta_q8: 0,
            residual_lambda_q8: 0,
            along_eta_q8: 0,
            along_lambda_q8: 0,
            seen: [0; CLASS_BINS],
            first_ms: 0,
            last_after_ms: 1,
            best_after_ms: 0,
            best_v_q8: 0,
        }
    }

    fn posterior_of(rows: &[EvidenceRow]) -> [f64; 4] {
        posterior(&crate::passes::passes(&rows.iter().collect::<Vec<_>>()))
    }

    #[test]
    fn two_vehicles_by_hand() {
        // e = [0.8, 0, 0.2, 0] and [0.5, 0, 0.5, 0]; the product of (e + 1e-6), normalised.
        let found = posterior_of(&[row(1, 8.0, 2.0), row(2, 2.0, 2.0)]);
        let (a, b): (f64, f64) = (0.8 * 0.5, 0.2 * 0.5);
        assert!((found[0] - a / (a + b)).abs() < 1e-4, "{found:?}");
        assert!((found[2] - b / (a + b)).abs() < 1e-4, "{found:?}");
        assert!(found[1] < 1e-10 && found[3] < 1e-10);
    }

    #[test]
    fn one_contrary_vehicle_costs_nearly_fourteen_nats() {
        let agreeing: Vec<EvidenceRow> = (0..5).map(|v| row(v, 1.0, 9.0)).collect();
        let mut with_contrary = agreeing.clone();
        with_contrary.push(row(9, 10.0, 0.0));
        let odds = |p: [f64; 4]| (p[2] / p[0]).ln();
        let cost = odds(posterior_of(&agreeing)) - odds(posterior_of(&with_contrary));
        assert!((cost - 1e6_f64.ln()).abs() < 1e-3, "{cost}");
    }

    #[test]
    fn nothing_said_is_uniform() {
        assert_eq!(posterior(&[]), [0.25; 4]);
    }
}
