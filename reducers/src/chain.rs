//! Neighbouring sections of a line share its fate: a hidden Markov chain along the element.
//!
//! A line is repainted over its whole length more often than over ten metres, but ten metres can
//! be ground off. States of neighbouring sections are alike unless a boundary, which has a small
//! chance, lies between them. A section that nobody saw gets what its neighbours say.

/// Chance that a change begins or ends between two sections.
const BOUNDARY: f64 = 0.03;

/// Posterior of every state at every section, from log-likelihoods in nats and the prior.
/// `kin[a][b]` is the chance of state `b` after state `a` where no boundary lies between them.
#[must_use]
pub fn posterior<const N: usize>(
    log_likelihoods: &[[f64; N]],
    prior: &[f64; N],
    kin: &[[f64; N]; N],
) -> Vec<[f64; N]> {
    let likelihoods: Vec<[f64; N]> = log_likelihoods.iter().map(scaled).collect();
    let size = likelihoods.len();
    let mut forward: Vec<[f64; N]> = Vec::with_capacity(size);
    for likelihood in &likelihoods {
        let before = forward.last().map_or(*prior, |last| step(last, prior, kin));
        forward.push(product(&before, likelihood));
    }
    let mut backward = [1.0; N];
    for index in (0..size).rev() {
        forward[index] = product(&forward[index], &backward);
        let beyond = product(&backward, &likelihoods[index]);
        backward = step_back(&beyond, prior, kin);
    }
    forward
}

fn scaled<const N: usize>(logs: &[f64; N]) -> [f64; N] {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    logs.map(|log| libm::exp(log - most))
}

/// Pointwise product, normalised.
fn product<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    let products: [f64; N] = std::array::from_fn(|state| a[state] * b[state]);
    let total: f64 = products.iter().sum();
    if total > 0.0 {
        products.map(|value| value / total)
    } else {
        [1.0 / N as f64; N]
    }
}

fn step<const N: usize>(belief: &[f64; N], prior: &[f64; N], kin: &[[f64; N]; N]) -> [f64; N] {
    std::array::from_fn(|to| {
        let kept: f64 = (0..N).map(|from| belief[from] * kin[from][to]).sum();
        (1.0 - BOUNDARY) * kept + BOUNDARY * prior[to]
    })
}

fn step_back<const N: usize>(
    message: &[f64; N],
    prior: &[f64; N],
    kin: &[[f64; N]; N],
) -> [f64; N] {
    let anew: f64 = (0..N).map(|to| prior[to] * message[to]).sum();
    std::array::from_fn(|from| {
        let kept: f64 = (0..N).map(|to| kin[from][to] * message[to]).sum();
        (1.0 - BOUNDARY) * kept + BOUNDARY * anew
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALIKE: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];

    /// By hand: all 2^3 paths.
    #[test]
    fn equals_the_sum_over_all_paths() {
        let logs = [[0.0_f64, -1.0], [0.0, 0.0], [-2.0, 0.0]];
        let prior = [0.9, 0.1];
        let mut by_hand = [[0.0; 2]; 3];
        for path in 0..8_usize {
            let state = |section: usize| path >> section & 1;
            let mut weight = prior[state(0)];
            for section in 1..3 {
                let alike = if state(section) == state(section - 1) {
                    1.0
                } else {
                    0.0
                };
                weight *= (1.0 - BOUNDARY) * alike + BOUNDARY * prior[state(section)];
            }
            for (section, log) in logs.iter().enumerate() {
                weight *= log[state(section)].exp();
            }
            for (section, sums) in by_hand.iter_mut().enumerate() {
                sums[state(section)] += weight;
            }
        }
        for (found, sums) in posterior(&logs, &prior, &ALIKE).iter().zip(by_hand) {
            let total = sums[0] + sums[1];
            assert!((found[0] - sums[0] / total).abs() < 1e-12);
        }
    }
}
