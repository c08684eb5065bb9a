//! Neighbouring sections of a line share its fate: a hidden Markov chain along the element.
//!
//! A line is repainted over its whole length more often than over ten metres, but ten metres can
//! be ground off. States of neighbouring sections are alike unless a boundary, which has a small
//! chance, lies between them. A section that nobody saw gets what its neighbours say.

/// Chance that a change begins or ends between two sections.
const BOUNDARY: f64 = 0.03;

/// What a chain says.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Posterior of every state at every section.
    pub posterior: Vec<Vec<f64>>,
    /// Log-probability of all that was seen, in nats.
    pub log_evidence: f64,
}

/// Posterior of every state at every section, from log-likelihoods in nats and the prior.
/// `kin[a][b]` is the chance of state `b` after state `a` where no boundary lies between them.
#[must_use]
pub fn posterior(log_likelihoods: &[Vec<f64>], prior: &[f64], kin: &[Vec<f64>]) -> Chain {
    let mut log_evidence = 0.0;
    let mut likelihoods: Vec<Vec<f64>> = Vec::with_capacity(log_likelihoods.len());
    let mut forward: Vec<Vec<f64>> = Vec::with_capacity(log_likelihoods.len());
    for logs in log_likelihoods {
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let likelihood: Vec<f64> = logs.iter().map(|log| libm::exp(log - most)).collect();
        let before = forward
            .last()
            .map_or_else(|| prior.to_vec(), |last| step(last, prior, kin));
        let (belief, total) = product(&before, &likelihood);
        log_evidence += most + libm::log(total.max(f64::MIN_POSITIVE));
        forward.push(belief);
        likelihoods.push(likelihood);
    }
    let mut backward = vec![1.0; prior.len()];
    for index in (0..forward.len()).rev() {
        forward[index] = product(&forward[index], &backward).0;
        let (beyond, _) = product(&backward, &likelihoods[index]);
        backward = step_back(&beyond, prior, kin);
    }
    Chain {
        posterior: forward,
        log_evidence,
    }
}

/// Pointwise product, normalised, and what it summed to.
fn product(a: &[f64], b: &[f64]) -> (Vec<f64>, f64) {
    let products: Vec<f64> = a.iter().zip(b).map(|(a, b)| a * b).collect();
    let total: f64 = products.iter().sum();
    let normalised = match total > 0.0 {
        true => products.iter().map(|value| value / total).collect(),
        false => vec![1.0 / a.len() as f64; a.len()],
    };
    (normalised, total)
}

fn step(belief: &[f64], prior: &[f64], kin: &[Vec<f64>]) -> Vec<f64> {
    let mut next: Vec<f64> = prior.iter().map(|chance| BOUNDARY * chance).collect();
    for (from, row) in belief.iter().zip(kin) {
        for (to, chance) in next.iter_mut().zip(row) {
            *to += (1.0 - BOUNDARY) * from * chance;
        }
    }
    next
}

fn step_back(message: &[f64], prior: &[f64], kin: &[Vec<f64>]) -> Vec<f64> {
    let dot = |row: &[f64]| -> f64 { row.iter().zip(message).map(|(a, b)| a * b).sum() };
    let anew = dot(prior);
    kin.iter()
        .map(|row| (1.0 - BOUNDARY) * dot(row) + BOUNDARY * anew)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: all 2^3 paths.
    #[test]
    fn equals_the_sum_over_all_paths() {
        let logs = [vec![0.0_f64, -1.0], vec![0.0, 0.0], vec![-2.0, 0.0]];
        let alike = [vec![1.0, 0.0], vec![0.0, 1.0]];
        let prior = [0.9, 0.1];
        let mut by_hand = [[0.0; 2]; 3];
        for path in 0..8_usize {
            let state = |section: usize| path >> section & 1;
            let mut weight = prior[state(0)];
            for section in 1..3 {
                let same = if state(section) == state(section - 1) {
                    1.0
                } else {
                    0.0
                };
                weight *= (1.0 - BOUNDARY) * same + BOUNDARY * prior[state(section)];
            }
            for (section, log) in logs.iter().enumerate() {
                weight *= log[state(section)].exp();
            }
            for (section, sums) in by_hand.iter_mut().enumerate() {
                sums[state(section)] += weight;
            }
        }
        let chain = posterior(&logs, &prior, &alike);
        for (found, sums) in chain.posterior.iter().zip(by_hand) {
            let total = sums[0] + sums[1];
            assert!((chain.log_evidence - total.ln()).abs() < 1e-12);
            assert!((found[0] - sums[0] / total).abs() < 1e-12);
        }
    }
}
