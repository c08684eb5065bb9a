//! Errors that drift: sums of Gauss-Markov processes of first order.

use crate::noise::Drift;
use crate::random::Random;

/// One error that drifts, where it is now.
#[derive(Debug, Clone)]
pub(crate) struct Drifting {
    parts: Vec<(Drift, f64)>,
}

impl Drifting {
    /// Begins anywhere that it can be.
    pub(crate) fn draw(parts: &[Drift], random: &mut Random) -> Self {
        let parts = parts.iter().map(|&part| (part, random.normal(part.sigma)));
        Self {
            parts: parts.collect(),
        }
    }

    /// Goes on by `seconds` and gives the error then.
    pub(crate) fn step(&mut self, seconds: f64, random: &mut Random) -> f64 {
        for (part, now) in &mut self.parts {
            let kept = (-seconds / part.seconds).exp();
            *now = kept * *now + random.normal(part.sigma * (1.0 - kept * kept).sqrt());
        }
        self.parts.iter().map(|(_, now)| now).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_keep_their_spread_and_forget_in_their_time() {
        let parts = [(1.5, 1.0), (2.0, 20.0)].map(|(sigma, seconds)| Drift { sigma, seconds });
        let mut random = Random::new(5, "drift", 0);
        let mut drifting = Drifting::draw(&parts, &mut random);
        let errors: Vec<f64> = (0..400_000)
            .map(|_| drifting.step(0.25, &mut random))
            .collect();
        let mean_product = |lag: usize| {
            let products = errors.iter().zip(&errors[lag..]).map(|(a, b)| a * b);
            products.sum::<f64>() / (errors.len() - lag) as f64
        };
        for (lag, seconds) in [(0, 0.0), (4, 1.0), (20, 5.0), (80, 20.0_f64)] {
            let expected: f64 = parts
                .iter()
                .map(|p| p.sigma.powi(2) * (-seconds / p.seconds).exp())
                .sum();
            let found = mean_product(lag);
            assert!(
                (found - expected).abs() < 0.35,
                "after {seconds} s: {found}, not {expected}"
            );
        }
    }
}
